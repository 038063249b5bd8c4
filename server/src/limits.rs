//! Limits as clients see them: the headers `RateLimit` and `RateLimit-Policy` (IETF draft,
//! httpapi working group), and `Retry-After`.

use std::time::Duration;

use axum::http::{HeaderName, HeaderValue, header};

/// State of a limit, for the client that meets it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Bound {
    /// The limited resource.
    pub(crate) name: &'static str,
    /// Unit: `requests`, or another unit of the draft or of ours.
    pub(crate) unit: &'static str,
    /// Maximum amount.
    pub(crate) limit: u64,
    /// Time window of the amount; `None` for concurrent use.
    pub(crate) window: Option<Duration>,
    /// Remaining amount.
    pub(crate) left: u64,
    /// Time until there will be more.
    pub(crate) reset: Duration,
}

impl Bound {
    /// An exhausted limit on concurrent use; a retry after a second may succeed.
    pub(crate) fn used_up(name: &'static str, unit: &'static str, limit: usize) -> Self {
        let reset = Duration::from_secs(1);
        Self { name, unit, limit: limit as u64, window: None, left: 0, reset }
    }

    /// The headers of the limit.
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

/// The header with the time of a retry, in whole seconds and at least one.
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
    fn headers_follow_the_draft() {
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
