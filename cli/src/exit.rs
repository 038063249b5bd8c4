//! Exit codes, for scripts.
//!
//! 0 done · 1 failed · 2 wrong usage (clap's) · 3 server unreachable · 4 object not recognised · 5
//! stored data damaged · 6 bound exceeded · 130 interrupted (128 + SIGINT, as in shells).

use std::process::ExitCode;

use palpate_client::Error as ClientError;
use thiserror::Error;

use crate::output::plain;

/// Outcomes with an exit code of their own.
#[derive(Debug, Error)]
pub(crate) enum Ended {
    /// The answer was wrong or undecided.
    #[error("not recognised")]
    NotRecognised,
    /// Stored data is damaged; the answer says which.
    #[error("damaged")]
    Damaged,
    /// A bound was exceeded; the answer says which.
    #[error("a bound is broken")]
    BoundBroken,
    /// Ctrl-C.
    #[error("interrupted")]
    Interrupted,
}

/// Prints the error, if any, and returns the exit code.
pub(crate) fn code_of(outcome: anyhow::Result<()>) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            if error.downcast_ref::<Ended>().is_none() {
                eprintln!("error: {}", plain(&words(&error)));
                if let Some(hint) = hint(&error) {
                    eprintln!("hint: {hint}");
                }
            }
            ExitCode::from(code(&error))
        }
    }
}

/// What to do about an error, if that is known.
fn hint(error: &anyhow::Error) -> Option<&'static str> {
    let client = error.downcast_ref::<ClientError>()?;
    let text = client.to_string();
    Some(match client {
        _ if status(error) == Some(401) => "set PALPATE_KEY to a key, or give it with --key",
        ClientError::TimedOut { .. } => {
            "the server may be busy: `palpate health` tells whether it answers at all"
        }
        // What rustls says of an answer that is not TLS.
        _ if text.contains("InvalidContentType") => {
            "the server does not speak TLS there: name it with --server http://…"
        }
        ClientError::Broken { .. } if text.contains("http://") => {
            "the connection was accepted and closed: a server with TLS needs --server https://…"
        }
        _ if client.is_unreachable() => {
            "start one with `palpate serve --data DIR`, or name it: --server URL"
        }
        _ => return None,
    })
}

/// The error and its causes in one line. Causes already contained in the text are left out, as are
/// those of a client error, which is complete.
fn words(error: &anyhow::Error) -> String {
    let mut words = String::new();
    for cause in error.chain() {
        let text = cause.to_string();
        if !words.contains(&text) {
            let separator = if words.is_empty() { "" } else { ": " };
            words.push_str(separator);
            words.push_str(&text);
        }
        if cause.is::<ClientError>() {
            break;
        }
    }
    words
}

fn code(error: &anyhow::Error) -> u8 {
    match error.downcast_ref::<Ended>() {
        Some(Ended::NotRecognised) => 4,
        Some(Ended::Damaged) => 5,
        Some(Ended::BoundBroken) => 6,
        Some(Ended::Interrupted) => 130,
        None if is_unreachable(error) => 3,
        None => 1,
    }
}

fn status(error: &anyhow::Error) -> Option<u16> {
    error.downcast_ref::<ClientError>().and_then(ClientError::status)
}

fn is_unreachable(error: &anyhow::Error) -> bool {
    error.downcast_ref::<ClientError>().is_some_and(ClientError::is_unreachable)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_does_not_say_the_same_twice() {
        #[derive(Debug, Error)]
        #[error("cannot open d: {source}")]
        struct Open {
            source: std::io::Error,
        }
        let error = anyhow::Error::from(Open { source: std::io::Error::other("disk is gone") });
        let error = error.context("starting");
        assert_eq!(words(&error), "starting: cannot open d: disk is gone");
    }

    #[test]
    fn outcomes_have_their_codes_also_behind_a_context() {
        let unreachable = ClientError::TimedOut { url: "u".to_owned() };
        let other = ClientError::Event { url: "u".to_owned(), detail: String::new() };
        assert_eq!(code(&anyhow::Error::from(unreachable).context("adding the mug")), 3);
        assert_eq!(code(&other.into()), 1);
        assert_eq!(code(&Ended::NotRecognised.into()), 4);
        assert_eq!(code(&Ended::Damaged.into()), 5);
        assert_eq!(code(&Ended::BoundBroken.into()), 6);
        assert_eq!(code(&Ended::Interrupted.into()), 130);
        assert_eq!(code(&anyhow::anyhow!("a broken file")), 1);
    }
}
