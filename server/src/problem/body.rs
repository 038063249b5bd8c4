//! Bodies of errors, in the form of RFC 9457.

use axum::body::Body;
use axum::http::{HeaderValue, header};
use axum::response::Response;
use palpate_schemas::{FieldError, Problem, ProblemType};

use super::{framework_draft, status};

/// The content type of every error.
pub(crate) const CONTENT_TYPE: &str = "application/problem+json";

/// A problem without its request.
#[derive(Clone, Debug)]
pub(super) struct Draft {
    pub(super) kind: ProblemType,
    pub(super) detail: String,
    pub(super) errors: Vec<FieldError>,
}

/// Adds the body of an error; other responses pass unchanged.
pub(crate) fn finish(response: Response, path: &str, request_id: &str) -> Response {
    let found = response.status();
    if !(found.is_client_error() || found.is_server_error()) {
        return response;
    }
    let draft = response.extensions().get::<Draft>().cloned();
    let draft = draft.unwrap_or_else(|| framework_draft(found, path));
    let problem = Problem {
        kind: draft.kind,
        title: title(draft.kind).to_owned(),
        status: status(draft.kind).as_u16(),
        detail: draft.detail,
        instance: path.to_owned(),
        request_id: request_id.to_owned(),
        errors: draft.errors,
    };
    let body = serde_json::to_vec(&problem).expect("a problem consists of strings and a number");
    let (mut parts, _) = response.into_parts();
    parts.status = status(draft.kind);
    parts.headers.remove(header::CONTENT_LENGTH);
    parts.headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(CONTENT_TYPE));
    Response::from_parts(parts, Body::from(body))
}

/// The title of all problems of a type.
pub(crate) fn title(kind: ProblemType) -> &'static str {
    match kind {
        ProblemType::MalformedRequest => "Malformed request",
        ProblemType::Unauthenticated => "Authentication required",
        ProblemType::Forbidden => "Forbidden",
        ProblemType::NotFound => "Not found",
        ProblemType::MethodNotAllowed => "Method not allowed",
        ProblemType::Timeout => "Request timeout",
        ProblemType::WrongState => "Invalid state",
        ProblemType::Conflict => "Conflict",
        ProblemType::QuotaExceeded => "Storage quota exceeded",
        ProblemType::SessionEnded => "Session ended",
        ProblemType::TooManyRequests => "Rate limit exceeded",
        ProblemType::PreconditionFailed => "Precondition failed",
        ProblemType::PreconditionRequired => "Precondition required",
        ProblemType::BodyTooLarge => "Body too large",
        ProblemType::UnsupportedMediaType => "Unsupported media type",
        ProblemType::InvalidValue => "Invalid value",
        ProblemType::Overloaded => "Server overloaded",
        ProblemType::Unavailable => "Service unavailable",
        ProblemType::StorageFull => "Storage full",
        ProblemType::Damaged => "Stored data damaged",
        ProblemType::Internal => "Internal error",
    }
}
