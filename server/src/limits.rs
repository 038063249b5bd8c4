//! What a bound looks like to a client: the headers `RateLimit` and `RateLimit-Policy` (IETF
//! draft, httpapi working group), and `Retry-After`.

use std::time::Duration;

use axum::http::{HeaderName, HeaderValue, header};

/// The state of one bound, as the client that meets it is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Bound {
    /// What is bounded.
    pub(crate) name: &'static str,
    /// What is counted: `requests`, or another unit of the draft or of ours.
    pub(crate) unit: &'static str,
    /// How much there may be.
    pub(crate) limit: u64,
    /// The time in which there may be so much; `None` for what is held at once.
    pub(crate) window: Option<Duration>,
    /// How much is left.
    pub(crate) left: u64,
    /// When there will be more.
    pub(crate) reset: Duration,
}

impl Bound {
    /// A bound on what is held at once, which is used up; in a second things look different.
    pub(crate) fn used_up(name: &'static str, unit: &'static str, limit: usize) -> Self {
        let reset = Duration::from_secs(1);
        Self { name, unit, limit: limit as u64, window: None, left: 0, reset }
    }

    /// The headers that say it.
    pub(crate) fn headers(&self) -> [(HeaderName, HeaderValue); 2] {
        let Self { name, unit, limit, left, .. } = self;
        let window = self.window.map_or(String::new(), |window| format!(";w={}", seconds(window)));
        let policy = format!("\"{name}\";q={limit};qu=\"{unit}\"{window}");
        let state = format!("\"{name}\";r={left};t={}", seconds(self.reset));
        let value = |text: String| {
            HeaderValue::try_from(text).expect("names and numbers are visible ASCII")
        };
        [
            (HeaderName::from_static("ratelimit-policy"), value(policy)),
            (HeaderName::from_static("ratelimit"), value(state)),
        ]
    }
}

/// Bytes as messages show them.
pub(crate) fn megabytes(bytes: u64) -> String {
    format!("{:.3} MB", bytes as f64 / 1e6)
}

/// The header that says when to ask again, in whole seconds and never at once.
pub(crate) fn retry_after(wait: Duration) -> (HeaderName, HeaderValue) {
    (header::RETRY_AFTER, HeaderValue::from(seconds(wait)))
}

/// Whole seconds, rounded up, at least one.
fn seconds(time: Duration) -> u64 {
    time.as_millis().div_ceil(1000).max(1) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_written_as_the_draft_has_them() {
        let bound = Bound {
            name: "requests",
            unit: "requests",
            limit: 50,
            window: Some(Duration::from_secs(1)),
            left: 7,
            reset: Duration::from_millis(1001),
        };
        let [policy, state] = bound.headers();
        assert_eq!(policy.1, "\"requests\";q=50;qu=\"requests\";w=1");
        assert_eq!(state.1, "\"requests\";r=7;t=2");
        let held = Bound::used_up("sessions", "sessions", 3).headers();
        assert_eq!(held[0].1, "\"sessions\";q=3;qu=\"sessions\"");
        assert_eq!(held[1].1, "\"sessions\";r=0;t=1");
        assert_eq!(retry_after(Duration::ZERO).1, "1");
    }
}
