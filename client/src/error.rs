//! Why a call did not give an answer, with the server's own words where it gave any.

use std::time::Duration;

use palpate_schemas::{Problem, ProblemType};
use thiserror::Error;

/// Why a call failed.
#[derive(Debug, Error)]
pub enum Error {
    /// The server refused, and says why.
    #[error("{}", words(problem))]
    Problem {
        /// The server's words.
        problem: Box<Problem>,
        /// When the server says to ask again.
        retry_after: Option<Duration>,
    },
    /// Something answered that is not Palpate, such as a proxy.
    #[error("{url} answered {status} without a problem document: {body}")]
    Status {
        /// What was asked.
        url: String,
        /// The HTTP status.
        status: u16,
        /// The beginning of the answer's body.
        body: String,
        /// When to ask again, if the answer says so.
        retry_after: Option<Duration>,
    },
    /// No connection to the server.
    #[error("cannot reach {url}: {}", root_cause(source))]
    Unreachable {
        /// What was asked.
        url: String,
        /// What went wrong.
        source: reqwest::Error,
    },
    /// The server did not answer in time.
    #[error("{url} did not answer in time")]
    TimedOut {
        /// What was asked.
        url: String,
    },
    /// The connection broke while the answer came; whether the request was done is not known.
    #[error("the connection to {url} broke: {}", root_cause(source))]
    Broken {
        /// What was asked.
        url: String,
        /// What went wrong.
        source: reqwest::Error,
    },
    /// The answer is not of the expected type: the server is of another version.
    #[error("{url} answered something unexpected: {source}")]
    Unexpected {
        /// What was asked.
        url: String,
        /// Where it differs.
        source: serde_json::Error,
    },
    /// A stream of events ended before what was waited for.
    #[error("the events of {url} ended early")]
    EventsEnded {
        /// What was asked.
        url: String,
    },
    /// An event cannot be read.
    #[error("{url} sent an event that cannot be read: {detail}")]
    Event {
        /// What was asked.
        url: String,
        /// What is wrong with it.
        detail: String,
    },
    /// The server's address is not one.
    #[error("{found:?} is not the address of a server, expected one like http://127.0.0.1:7411")]
    Address {
        /// What was given.
        found: String,
    },
    /// The key has characters that no key has.
    #[error("the key has spaces or characters that no key has, expected one like palpate_…")]
    Key,
    /// The authority to trust is none.
    #[error("the authority to trust is not PEM with a certificate (BEGIN CERTIFICATE)")]
    Authority,
    /// The HTTP client cannot be set up on this machine.
    #[error("cannot set up the HTTP client: {}", root_cause(source))]
    SetUp {
        /// Why not.
        source: reqwest::Error,
    },
}

impl Error {
    /// The server's problem document, if it gave one.
    #[must_use]
    pub fn problem(&self) -> Option<&Problem> {
        match self {
            Self::Problem { problem, .. } => Some(problem),
            _ => None,
        }
    }

    /// What kind of problem the server named.
    #[must_use]
    pub fn kind(&self) -> Option<ProblemType> {
        self.problem().map(|problem| problem.kind)
    }

    /// The HTTP status, if there was an answer that failed.
    #[must_use]
    pub fn status(&self) -> Option<u16> {
        match self {
            Self::Problem { problem, .. } => Some(problem.status),
            Self::Status { status, .. } => Some(*status),
            _ => None,
        }
    }

    /// Whether no server was there, or none that answers.
    #[must_use]
    pub fn is_unreachable(&self) -> bool {
        matches!(self, Self::Unreachable { .. } | Self::TimedOut { .. } | Self::Broken { .. })
    }

    /// When the server says to ask again.
    #[must_use]
    pub fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::Problem { retry_after, .. } | Self::Status { retry_after, .. } => *retry_after,
            _ => None,
        }
    }
}

/// A problem in one line: what happened, and each field that is to blame.
fn words(problem: &Problem) -> String {
    let mut words = problem.detail.clone();
    for field in &problem.errors {
        let said = problem.detail.contains(&field.detail);
        // An empty pointer is the whole body: there is nothing to name.
        let field = if said && field.pointer.is_empty() {
            continue;
        } else if said {
            format!(" ({})", field.pointer)
        } else {
            format!("; {}: {}", field.pointer, field.detail)
        };
        words.push_str(&field);
    }
    words
}

/// The innermost error: reqwest's own words only say that sending failed.
fn root_cause(error: &reqwest::Error) -> String {
    let mut cause: &dyn std::error::Error = error;
    while let Some(inner) = cause.source() {
        cause = inner;
    }
    cause.to_string()
}

#[cfg(test)]
mod tests {
    use palpate_schemas::FieldError;

    use super::*;

    #[test]
    fn a_problem_reads_as_one_line_that_names_the_fields() {
        let problem = |detail: &str| Problem {
            kind: ProblemType::InvalidValue,
            title: "Invalid value".to_owned(),
            status: 422,
            detail: detail.to_owned(),
            instance: "/v1/sessions".to_owned(),
            request_id: "r".to_owned(),
            errors: vec![FieldError {
                pointer: "/readings/0/pose".to_owned(),
                detail: "quaternion has norm 0, expected 1".to_owned(),
            }],
        };
        let error =
            |detail| Error::Problem { problem: Box::new(problem(detail)), retry_after: None };
        let expected = "one reading is wrong; /readings/0/pose: quaternion has norm 0, expected 1";
        assert_eq!(error("one reading is wrong").to_string(), expected);
        let expected = "quaternion has norm 0, expected 1 (/readings/0/pose)";
        assert_eq!(error("quaternion has norm 0, expected 1").to_string(), expected);
        assert_eq!(error("").status(), Some(422));
    }
}
