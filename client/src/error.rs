//! Errors of calls, with the server's problem if there is one.

use std::time::Duration;

use palpate_schemas::{Problem, ProblemType};
use thiserror::Error;

/// Error of a failed call.
#[derive(Debug, Error)]
pub enum Error {
    /// The server refused the request.
    #[error("{}", words(problem))]
    Problem {
        /// The problem document.
        problem: Box<Problem>,
        /// Time until a retry, if the server states it.
        retry_after: Option<Duration>,
    },
    /// The answer does not come from Palpate, but for instance from a proxy.
    #[error("{url} answered {status} without a problem document: {body}")]
    Status {
        /// URL of the request.
        url: String,
        /// HTTP status.
        status: u16,
        /// Beginning of the body.
        body: String,
        /// Time until a retry, if the answer states it.
        retry_after: Option<Duration>,
    },
    /// The connection failed.
    #[error("cannot reach {url}: {}", root_cause(source))]
    Unreachable {
        /// URL of the request.
        url: String,
        /// Cause of the failure.
        source: reqwest::Error,
    },
    /// The server did not answer in time.
    #[error("{url} did not answer in time")]
    TimedOut {
        /// URL of the request.
        url: String,
    },
    /// The connection broke during the answer; whether the request took effect is unknown.
    #[error("the connection to {url} broke: {}", root_cause(source))]
    Broken {
        /// URL of the request.
        url: String,
        /// Cause of the failure.
        source: reqwest::Error,
    },
    /// The answer has an unexpected type: the server has another version.
    #[error("{url} answered something unexpected: {source}")]
    Unexpected {
        /// URL of the request.
        url: String,
        /// Error of the parser, with its position.
        source: serde_json::Error,
    },
    /// An event could not be parsed.
    #[error("{url} sent an event that cannot be read: {detail}")]
    Event {
        /// URL of the request.
        url: String,
        /// Description of the fault.
        detail: String,
    },
    /// The server's address is not valid.
    #[error("{found:?} is not the address of a server, expected one like http://127.0.0.1:7411")]
    Address {
        /// The given address.
        found: String,
    },
    /// The address names the API below the server.
    #[error("{found:?} ends with /v1, expected the address of the server without it")]
    AddressOfApi {
        /// The given address.
        found: String,
    },
    /// The key contains characters that no key has.
    #[error("the key has spaces or characters that no key has, expected one like palpate_…")]
    Key,
    /// The certificate authority is not valid PEM.
    #[error("the authority to trust is not PEM with a certificate (BEGIN CERTIFICATE)")]
    Authority,
    /// The HTTP client cannot be set up on this machine.
    #[error("cannot set up the HTTP client: {}", root_cause(source))]
    SetUp {
        /// Cause of the failure.
        source: reqwest::Error,
    },
}

impl Error {
    /// The server's problem document, if there is one.
    #[must_use]
    pub fn problem(&self) -> Option<&Problem> {
        match self {
            Self::Problem { problem, .. } => Some(problem),
            _ => None,
        }
    }

    /// Type of the server's problem, if there is one.
    #[must_use]
    pub fn kind(&self) -> Option<ProblemType> {
        self.problem().map(|problem| problem.kind)
    }

    /// HTTP status of a failed answer, if there was an answer.
    #[must_use]
    pub fn status(&self) -> Option<u16> {
        match self {
            Self::Problem { problem, .. } => Some(problem.status),
            Self::Status { status, .. } => Some(*status),
            _ => None,
        }
    }

    /// Whether the server could not be reached or did not answer.
    #[must_use]
    pub fn is_unreachable(&self) -> bool {
        matches!(self, Self::Unreachable { .. } | Self::TimedOut { .. } | Self::Broken { .. })
    }

    /// Time until a retry, if the server states it.
    #[must_use]
    pub fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::Problem { retry_after, .. } | Self::Status { retry_after, .. } => *retry_after,
            _ => None,
        }
    }
}

/// A problem in one line, with each invalid field.
fn words(problem: &Problem) -> String {
    let mut words = problem.detail.clone();
    for field in &problem.errors {
        let said = problem.detail.contains(&field.detail);
        // An empty pointer is the whole body and needs no name.
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

/// The innermost error; the text of reqwest's own errors lacks the cause.
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
