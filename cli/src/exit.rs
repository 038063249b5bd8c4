//! Exit codes, so that scripts can tell what happened.
//!
//! 0 done · 1 failed · 2 wrong usage (clap's) · 3 server unreachable · 4 object not
//! recognised · 130 interrupted (128 + SIGINT, as shells have it).

use std::process::ExitCode;

use palpate_client::Error as ClientError;
use thiserror::Error;

/// Outcomes with an exit code of their own.
#[derive(Debug, Error)]
pub(crate) enum Ended {
    /// The robot touched one thing and the server said another, or nothing certain.
    #[error("not recognised")]
    NotRecognised,
    /// Ctrl-C.
    #[error("interrupted")]
    Interrupted,
}

/// Says what went wrong, if anything, and gives the exit code.
pub(crate) fn code_of(outcome: anyhow::Result<()>) -> ExitCode {
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            if error.downcast_ref::<Ended>().is_none() {
                eprintln!("error: {error:#}");
                if is_unreachable(&error) {
                    eprintln!(
                        "hint: start one with `palpate serve --data DIR`, or name it: --server URL"
                    );
                }
            }
            ExitCode::from(code(&error))
        }
    }
}

fn code(error: &anyhow::Error) -> u8 {
    match error.downcast_ref::<Ended>() {
        Some(Ended::NotRecognised) => 4,
        Some(Ended::Interrupted) => 130,
        None if is_unreachable(error) => 3,
        None => 1,
    }
}

fn is_unreachable(error: &anyhow::Error) -> bool {
    error.downcast_ref::<ClientError>().is_some_and(ClientError::is_unreachable)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outcomes_have_their_codes_also_behind_a_context() {
        let unreachable = ClientError::TimedOut { url: "u".to_owned() };
        let other = ClientError::EventsEnded { url: "u".to_owned() };
        assert_eq!(code(&anyhow::Error::from(unreachable).context("adding the mug")), 3);
        assert_eq!(code(&other.into()), 1);
        assert_eq!(code(&Ended::NotRecognised.into()), 4);
        assert_eq!(code(&Ended::Interrupted.into()), 130);
        assert_eq!(code(&anyhow::anyhow!("a broken file")), 1);
    }
}
