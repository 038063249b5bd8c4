//! Retries: only where they cannot do the work twice.
//!
//! Repeatable calls (reads, writes of a whole state, readings with ids) are retried after lost
//! connections, time-outs, 429, 502, 503 and 504. All others are retried only if the server
//! certainly did nothing: no connection, or a refusal with 429 or 503. The server's `Retry-After`
//! takes precedence over the growing pause.

use std::time::Duration;

use backon::ExponentialBuilder;
use palpate_schemas::ProblemType;

use crate::error::Error;

/// Number of attempts and pauses between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RetryPolicy {
    /// Maximum number of attempts; 1 disables retries.
    pub attempts_max: usize,
    /// Pause before the second attempt; it doubles from then on, with jitter.
    pub pause_min: Duration,
    /// Longest pause. If the server asks for a longer one, the call fails.
    pub pause_max: Duration,
}

impl Default for RetryPolicy {
    fn default() -> Self {
        Self {
            attempts_max: 5,
            pause_min: Duration::from_millis(100),
            pause_max: Duration::from_secs(10),
        }
    }
}

impl RetryPolicy {
    /// A policy without retries.
    #[must_use]
    pub fn never() -> Self {
        Self { attempts_max: 1, ..Self::default() }
    }

    pub(crate) fn backoff(&self) -> ExponentialBuilder {
        ExponentialBuilder::new()
            .with_min_delay(self.pause_min)
            .with_max_delay(self.pause_max)
            .with_max_times(self.attempts_max.saturating_sub(1))
            .with_jitter()
    }

    /// Pause before the next attempt: the server's, unless it is too long.
    pub(crate) fn pause(&self, error: &Error, planned: Option<Duration>) -> Option<Duration> {
        let planned = planned?;
        match error.retry_after() {
            Some(wish) if wish > self.pause_max => None,
            Some(wish) => Some(wish.max(Duration::from_millis(1))),
            None => Some(planned),
        }
    }
}

/// Whether repeating a call is harmless.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Repeat {
    /// Repeating it changes nothing.
    Harmless,
    /// Repeating it does the work twice.
    Harmful,
}

/// Whether a failed call should be retried.
pub(crate) fn is_worth_repeating(error: &Error, repeat: Repeat) -> bool {
    // A server that is shutting down or cannot write will not recover in a moment.
    if error.kind() == Some(ProblemType::Unavailable) && error.retry_after().is_none() {
        return false;
    }
    let refused = matches!(error.status(), Some(429 | 503));
    match (error, repeat) {
        (Error::Unreachable { .. }, _) => true,
        (_, Repeat::Harmful) => refused,
        (Error::TimedOut { .. } | Error::Broken { .. }, Repeat::Harmless) => true,
        (_, Repeat::Harmless) => refused || matches!(error.status(), Some(502 | 504)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(status: u16, retry_after: Option<Duration>) -> Error {
        Error::Status { url: String::new(), status, body: String::new(), retry_after }
    }

    #[test]
    fn what_is_harmful_is_repeated_only_when_it_was_refused() {
        for (code, harmless, harmful) in [
            (429, true, true),
            (503, true, true),
            (502, true, false),
            (504, true, false),
            (500, false, false),
            (422, false, false),
            (409, false, false),
        ] {
            let error = status(code, None);
            assert_eq!(is_worth_repeating(&error, Repeat::Harmless), harmless, "{code}");
            assert_eq!(is_worth_repeating(&error, Repeat::Harmful), harmful, "{code}");
        }
        let late = Error::TimedOut { url: String::new() };
        assert!(is_worth_repeating(&late, Repeat::Harmless));
        assert!(!is_worth_repeating(&late, Repeat::Harmful));
    }

    #[test]
    fn the_servers_wish_takes_precedence_unless_it_is_too_long() {
        let policy = RetryPolicy::default();
        let planned = Some(Duration::from_millis(100));
        let wish = |seconds| status(503, Some(Duration::from_secs(seconds)));
        assert_eq!(policy.pause(&wish(2), planned), Some(Duration::from_secs(2)));
        assert_eq!(policy.pause(&wish(60), planned), None);
        assert_eq!(policy.pause(&status(503, None), planned), planned);
        assert_eq!(policy.pause(&wish(2), None), None, "attempts are used up");
    }
}
