//! Errors as HTTP, in the form of RFC 9457: the only place that knows statuses.
//!
//! A handler's [`Refusal`] becomes a draft in the response's extensions; [`finish`], the last
//! layer, adds path and request id and writes the body. Errors of the framework carry no
//! draft and get one by their status.

use std::time::Duration;

use axum::body::Body;
use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use palpate_schemas::{FieldError, Problem, ProblemType};
use palpate_store::engine::EngineError;
use palpate_store::error::StoreError;

use crate::compute::ComputeError;
use crate::known_sensors::UnknownSensor;
use crate::limits::{Bound, retry_after};
use crate::refusal::{KeyFault, Refusal};
use crate::secret::redacted;
use crate::wire::Invalid;
use crate::wire::object::FormatError;

/// The content type of every error.
pub(crate) const CONTENT_TYPE: &str = "application/problem+json";

/// Time after which a robot may retry a request to an overloaded server.
const RETRY_AFTER: Duration = Duration::from_secs(1);
/// Maximum time after which a robot may retry when there are too many sessions.
const SESSION_WAIT: Duration = Duration::from_secs(10);

/// A problem without its request.
#[derive(Clone, Debug)]
struct Draft {
    kind: ProblemType,
    detail: String,
    errors: Vec<FieldError>,
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        let kind = kind(&self);
        if status(kind).is_server_error() && !matches!(kind, ProblemType::Overloaded) {
            let words = self.to_string();
            let words = redacted(&words);
            tracing::error!(error = %words, "Refused a request: {words}");
        }
        let detail = match kind {
            ProblemType::Internal => "internal error; the server's log has the reason".to_owned(),
            _ => redacted(&self.to_string()).into_owned(),
        };
        let mut response = status(kind).into_response();
        let headers_of = response.headers_mut();
        headers_of.extend(wait(&self, kind).map(retry_after));
        headers_of.extend(bound(&self).iter().flat_map(Bound::headers));
        headers_of.extend(headers(&self));
        response.extensions_mut().insert(Draft { kind, detail, errors: errors(self) });
        response
    }
}

/// Time of a retry; `None` when a retry would not help.
fn wait(refusal: &Refusal, kind: ProblemType) -> Option<Duration> {
    match (refusal, kind) {
        // Waiting does not make a model smaller.
        (Refusal::ModelTooLarge { .. }, _) => None,
        (Refusal::RateExceeded { wait, .. } | Refusal::FailuresExceeded { wait, .. }, _) => {
            Some(*wait)
        }
        // Sessions are closed all the time, so an earlier retry is worthwhile.
        (Refusal::SessionsFull { wait, .. }, _) => {
            Some(wait.unwrap_or(SESSION_WAIT).min(SESSION_WAIT))
        }
        (_, ProblemType::Overloaded | ProblemType::Unavailable | ProblemType::TooManyRequests) => {
            Some(RETRY_AFTER)
        }
        _ => None,
    }
}

/// The limit that was exceeded, if any.
fn bound(refusal: &Refusal) -> Option<Bound> {
    Some(match refusal {
        Refusal::RateExceeded { bound, .. } | Refusal::FailuresExceeded { bound, .. } => *bound,
        Refusal::SessionsFull { max, .. } => Bound::used_up("sessions", "sessions", *max),
        Refusal::SessionBusy { waiting } => {
            Bound::used_up("session", "concurrent-requests", *waiting)
        }
        Refusal::RequestsFull { under_way } => {
            Bound::used_up("concurrency", "concurrent-requests", *under_way)
        }
        Refusal::StreamsFull { open } => Bound::used_up("streams", "streams", *open),
        Refusal::TrainingQueueFull { waiting } => {
            Bound::used_up("trainings", "trainings", *waiting)
        }
        Refusal::BeliefsFull { max, .. } => Bound::used_up("beliefs", "bytes", *max),
        Refusal::BodiesFull { max, .. } => Bound::used_up("bodies", "content-bytes", *max),
        Refusal::AnswersFull { max, .. } => Bound::used_up("answers", "content-bytes", *max),
        Refusal::ConnectionsFull { open } => Bound::used_up("connections", "connections", *open),
        Refusal::ShareFull { name, unit, total, .. } => Bound::used_up(name, unit, *total),
        Refusal::Store(StoreError::Engine(EngineError::OverQuota { quota, .. })) => Bound::used_up(
            "storage",
            "content-bytes",
            usize::try_from(*quota).unwrap_or(usize::MAX),
        ),
        Refusal::Compute(ComputeError::Full { places }) => {
            Bound::used_up("compute", "places", *places)
        }
        _ => return None,
    })
}

/// Further headers of some refusals.
fn headers(refusal: &Refusal) -> Option<(HeaderName, HeaderValue)> {
    match refusal {
        Refusal::Unauthenticated(KeyFault::Missing) => {
            let asks = HeaderValue::from_static("Bearer realm=\"palpate\"");
            Some((header::WWW_AUTHENTICATE, asks))
        }
        Refusal::Unauthenticated(_) => {
            let asks =
                HeaderValue::from_static("Bearer realm=\"palpate\", error=\"invalid_token\"");
            Some((header::WWW_AUTHENTICATE, asks))
        }
        Refusal::OtherMethod { allow } => {
            HeaderValue::from_str(allow).ok().map(|allow| (header::ALLOW, allow))
        }
        _ => None,
    }
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

/// The response to a handler that panicked.
pub(crate) fn panicked(_: Box<dyn std::any::Any + Send>) -> Response {
    Refusal::Panicked.into_response()
}

fn framework_draft(found: StatusCode, path: &str) -> Draft {
    let (kind, detail) = match found {
        StatusCode::NOT_FOUND => {
            let hint = match path.trim_end_matches('/') {
                "" => String::new(),
                without if without == path => String::new(),
                without => format!(": paths end without a slash, as {without}"),
            };
            (ProblemType::NotFound, format!("nothing exists at {path}{hint}"))
        }
        StatusCode::METHOD_NOT_ALLOWED => (
            ProblemType::MethodNotAllowed,
            format!("{path} exists, but not with this method; the header `Allow` lists which"),
        ),
        StatusCode::PAYLOAD_TOO_LARGE => {
            (ProblemType::BodyTooLarge, "the body exceeds the size limit".to_owned())
        }
        StatusCode::UNSUPPORTED_MEDIA_TYPE => {
            (ProblemType::UnsupportedMediaType, "the content type is not supported here".to_owned())
        }
        other if other.is_client_error() => {
            (ProblemType::MalformedRequest, format!("the request cannot be read ({other})"))
        }
        _ => (ProblemType::Internal, "internal error; the server's log has the reason".to_owned()),
    };
    Draft { kind, detail, errors: Vec::new() }
}

fn kind(refusal: &Refusal) -> ProblemType {
    match refusal {
        Refusal::NotFound { .. }
        | Refusal::NoVersion { .. }
        | Refusal::UnknownSensor(UnknownSensor::Sensor { .. }) => ProblemType::NotFound,
        Refusal::Unauthenticated(_) => ProblemType::Unauthenticated,
        Refusal::Forbidden { .. }
        | Refusal::ForeignHost { .. }
        | Refusal::ForeignOrigin { .. }
        | Refusal::RobotHeld { .. } => ProblemType::Forbidden,
        Refusal::OtherMethod { .. } => ProblemType::MethodNotAllowed,
        Refusal::Malformed { .. } | Refusal::Unreadable { .. } => ProblemType::MalformedRequest,
        Refusal::BodyTooLarge { .. } => ProblemType::BodyTooLarge,
        Refusal::BodyTooSlow { .. } => ProblemType::Timeout,
        Refusal::ContentType { .. }
        | Refusal::Format(FormatError::ContentType { .. })
        | Refusal::ContentEncoding { .. } => ProblemType::UnsupportedMediaType,
        Refusal::Invalid(_) | Refusal::Format(FormatError::Invalid(_)) => ProblemType::InvalidValue,
        Refusal::ReadingConflict { .. } | Refusal::OtherTruth(_) => ProblemType::Conflict,
        Refusal::SessionEnded { .. } => ProblemType::SessionEnded,
        Refusal::RateExceeded { .. }
        | Refusal::FailuresExceeded { .. }
        | Refusal::ShareFull { .. }
        | Refusal::SessionsFull { .. }
        | Refusal::SessionBusy { .. } => ProblemType::TooManyRequests,
        Refusal::TooManyToExplain { .. }
        | Refusal::Untrained { .. }
        | Refusal::NoPart(_)
        | Refusal::NoMarginals { .. }
        | Refusal::NoNextTouches { .. }
        | Refusal::NoTouch { .. }
        | Refusal::ReadingsFull { .. }
        | Refusal::JobFinished { .. }
        | Refusal::LastAdmin { .. }
        | Refusal::KeyRefused { .. }
        | Refusal::KeysFull { .. }
        | Refusal::RobotsFull { .. }
        | Refusal::Needed { .. }
        | Refusal::ObjectInTraining { .. } => ProblemType::WrongState,
        Refusal::RevisionChanged { .. } => ProblemType::PreconditionFailed,
        Refusal::RevisionMissing => ProblemType::PreconditionRequired,
        Refusal::TrainingQueueFull { .. }
        | Refusal::StreamsFull { .. }
        | Refusal::RequestsFull { .. }
        | Refusal::BodiesFull { .. }
        | Refusal::AnswersFull { .. }
        | Refusal::ConnectionsFull { .. }
        | Refusal::BeliefsFull { .. }
        | Refusal::TooSlow { .. }
        | Refusal::ModelsInUse { .. }
        | Refusal::Compute(ComputeError::Full { .. } | ComputeError::Stopped) => {
            ProblemType::Overloaded
        }
        Refusal::Quarantined { .. } => ProblemType::Damaged,
        Refusal::NotReady(_) | Refusal::ModelTooLarge { .. } => ProblemType::Unavailable,
        Refusal::Store(error) | Refusal::UnknownSensor(UnknownSensor::Store(error)) => {
            store_kind(error)
        }
        Refusal::Compute(ComputeError::Panicked)
        | Refusal::Unusable { .. }
        | Refusal::UnreadableVersion(_)
        | Refusal::UnknownSensor(UnknownSensor::Calibration { .. })
        | Refusal::NoRandom
        | Refusal::Panicked => ProblemType::Internal,
    }
}

fn store_kind(error: &StoreError) -> ProblemType {
    match error {
        StoreError::NotFound { .. } | StoreError::NoVersion { .. } => ProblemType::NotFound,
        StoreError::Exists { .. } | StoreError::NameTaken { .. } | StoreError::Changed { .. } => {
            ProblemType::Conflict
        }
        StoreError::Engine(EngineError::Full { .. }) => ProblemType::StorageFull,
        StoreError::Engine(EngineError::OverQuota { .. }) => ProblemType::QuotaExceeded,
        StoreError::Engine(
            EngineError::Busy { .. }
            | EngineError::CutsUnderWay { .. }
            | EngineError::CutTooLarge { .. },
        ) => ProblemType::Overloaded,
        StoreError::Engine(
            EngineError::Poisoned | EngineError::Stopped | EngineError::NoRoomToCompact { .. },
        ) => ProblemType::Unavailable,
        StoreError::Damaged { .. } | StoreError::Model { .. } => ProblemType::Damaged,
        StoreError::Engine(_) => ProblemType::Internal,
    }
}

fn errors(refusal: Refusal) -> Vec<FieldError> {
    let detail = refusal.to_string();
    match refusal {
        Refusal::Invalid(Invalid(errors))
        | Refusal::Format(FormatError::Invalid(Invalid(errors)))
        | Refusal::Malformed { errors, .. } => errors,
        Refusal::Store(StoreError::NameTaken { .. }) => {
            vec![FieldError { pointer: "/name".to_owned(), detail }]
        }
        Refusal::ReadingConflict { pointer, .. } | Refusal::RobotHeld { pointer, .. } => {
            vec![FieldError { pointer, detail }]
        }
        Refusal::ContentType { .. } | Refusal::Format(FormatError::ContentType { .. }) => {
            vec![FieldError { pointer: "header:content-type".to_owned(), detail }]
        }
        Refusal::ContentEncoding { .. } => {
            vec![FieldError { pointer: "header:content-encoding".to_owned(), detail }]
        }
        Refusal::RevisionChanged { .. } | Refusal::RevisionMissing => {
            vec![FieldError { pointer: "header:if-match".to_owned(), detail }]
        }
        Refusal::NotReady(readiness) => {
            let failed = readiness.checks.into_iter().filter(|check| !check.passed);
            failed.map(|check| FieldError { pointer: check.name, detail: check.detail }).collect()
        }
        _ => Vec::new(),
    }
}

fn status(kind: ProblemType) -> StatusCode {
    match kind {
        ProblemType::MalformedRequest => StatusCode::BAD_REQUEST,
        ProblemType::Unauthenticated => StatusCode::UNAUTHORIZED,
        ProblemType::Forbidden => StatusCode::FORBIDDEN,
        ProblemType::NotFound => StatusCode::NOT_FOUND,
        ProblemType::MethodNotAllowed => StatusCode::METHOD_NOT_ALLOWED,
        ProblemType::Timeout => StatusCode::REQUEST_TIMEOUT,
        ProblemType::WrongState | ProblemType::Conflict | ProblemType::QuotaExceeded => {
            StatusCode::CONFLICT
        }
        ProblemType::SessionEnded => StatusCode::GONE,
        ProblemType::TooManyRequests => StatusCode::TOO_MANY_REQUESTS,
        ProblemType::PreconditionFailed => StatusCode::PRECONDITION_FAILED,
        ProblemType::PreconditionRequired => StatusCode::PRECONDITION_REQUIRED,
        ProblemType::BodyTooLarge => StatusCode::PAYLOAD_TOO_LARGE,
        ProblemType::UnsupportedMediaType => StatusCode::UNSUPPORTED_MEDIA_TYPE,
        ProblemType::InvalidValue => StatusCode::UNPROCESSABLE_ENTITY,
        ProblemType::Overloaded | ProblemType::Unavailable => StatusCode::SERVICE_UNAVAILABLE,
        ProblemType::StorageFull => StatusCode::INSUFFICIENT_STORAGE,
        ProblemType::Damaged | ProblemType::Internal => StatusCode::INTERNAL_SERVER_ERROR,
    }
}

fn title(kind: ProblemType) -> &'static str {
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
