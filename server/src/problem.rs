//! Errors as HTTP, in the form of RFC 9457: the only place that knows statuses.
//!
//! A handler's [`Refusal`] becomes a draft in the response's extensions; [`body::finish`], the
//! last layer, adds path and request id and writes the body. Errors of the framework carry no
//! draft and get one by their status.

pub(crate) mod body;
mod jobs;

use std::fmt::Display;
use std::time::Duration;

use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use palpate_schemas::{FieldError, ProblemType};
use palpate_store::engine::EngineError;
use palpate_store::error::StoreError;

use body::Draft;

use crate::budget::ShareFull;
use crate::cause::Cause;
use crate::compute::ComputeError;
use crate::known_sensors::UnknownSensor;
use crate::limits::{Bound, retry_after};
use crate::live::LiveError;
use crate::refusal::{AccessError, LoadError, Refusal, RequestError};
use crate::secret::redacted;
use crate::services::catalogues::CatalogueError;
use crate::services::keys::error::{KeyError, KeyFault};
use crate::services::objects::ObjectError;
use crate::services::sessions::SessionError;
use crate::services::webhooks::error::WebhookError;
use crate::wire::Invalid;
use crate::wire::object::FormatError;

/// Time after which a robot may retry a request to an overloaded server.
const RETRY_AFTER: Duration = Duration::from_secs(1);
/// Maximum time after which a robot may retry when there are too many sessions.
const SESSION_WAIT: Duration = Duration::from_secs(10);

/// What HTTP says of an error beside its words.
struct Answer {
    kind: ProblemType,
    /// The fields at fault.
    errors: Vec<FieldError>,
    /// Time of a retry; `None` when a retry would not help.
    wait: Option<Duration>,
    /// The limit that was exceeded, if any.
    bound: Option<Bound>,
    header: Option<(HeaderName, HeaderValue)>,
}

impl From<ProblemType> for Answer {
    fn from(kind: ProblemType) -> Self {
        let is_passing = matches!(
            kind,
            ProblemType::Overloaded | ProblemType::Unavailable | ProblemType::TooManyRequests
        );
        let wait = is_passing.then_some(RETRY_AFTER);
        Self { kind, errors: Vec::new(), wait, bound: None, header: None }
    }
}

impl Answer {
    /// An error of one field.
    fn at(kind: ProblemType, pointer: &str, error: &dyn Display) -> Self {
        let (pointer, detail) = (pointer.to_owned(), error.to_string());
        Self { errors: vec![FieldError { pointer, detail }], ..kind.into() }
    }

    /// An exhausted limit on concurrent use.
    fn used_up(kind: ProblemType, name: &'static str, unit: &'static str, limit: usize) -> Self {
        Self { bound: Some(Bound::used_up(name, unit, limit)), ..kind.into() }
    }

    /// A limit on the rate.
    fn too_fast(bound: Bound, wait: Duration) -> Self {
        Self { wait: Some(wait), bound: Some(bound), ..ProblemType::TooManyRequests.into() }
    }

    fn with_header(kind: ProblemType, name: HeaderName, value: Option<HeaderValue>) -> Self {
        Self { header: value.map(|value| (name, value)), ..kind.into() }
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        let Answer { kind, errors, wait, bound, header } = refusal(&self);
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
        headers_of.extend(wait.map(retry_after));
        headers_of.extend(bound.iter().flat_map(Bound::headers));
        headers_of.extend(header);
        response.extensions_mut().insert(Draft { kind, detail, errors });
        response
    }
}

fn refusal(refusal: &Refusal) -> Answer {
    match refusal {
        Refusal::Cause(error) => cause(error),
        Refusal::Key(error) => key(error),
        Refusal::Object(error) => object(error),
        Refusal::Catalogue(error) => catalogue(error),
        Refusal::Session(error) => session(error),
        Refusal::Job(error) => jobs::job(error),
        Refusal::Webhook(error) => webhook(error),
        Refusal::Access(error) => access(error),
        Refusal::Request(error) => request(error),
        Refusal::Load(error) => load(error),
        Refusal::NotReady(readiness) => {
            let failed = readiness.checks.iter().filter(|check| !check.passed).cloned();
            let failed = failed.map(|it| FieldError { pointer: it.name, detail: it.detail });
            Answer { errors: failed.collect(), ..ProblemType::Unavailable.into() }
        }
    }
}

fn access(error: &AccessError) -> Answer {
    match error {
        AccessError::Unauthenticated(fault) => {
            let asks = match fault {
                KeyFault::Missing => "Bearer realm=\"palpate\"",
                _ => "Bearer realm=\"palpate\", error=\"invalid_token\"",
            };
            let asks = Some(HeaderValue::from_static(asks));
            Answer::with_header(ProblemType::Unauthenticated, header::WWW_AUTHENTICATE, asks)
        }
        AccessError::OtherMethod { allow } => {
            let allow = HeaderValue::from_str(allow).ok();
            Answer::with_header(ProblemType::MethodNotAllowed, header::ALLOW, allow)
        }
        AccessError::Forbidden { .. }
        | AccessError::ForeignHost { .. }
        | AccessError::ForeignOrigin { .. } => ProblemType::Forbidden.into(),
    }
}

fn request(error: &RequestError) -> Answer {
    match error {
        RequestError::Malformed { errors, .. } => {
            Answer { errors: errors.clone(), ..ProblemType::MalformedRequest.into() }
        }
        RequestError::Unreadable { .. } => ProblemType::MalformedRequest.into(),
        RequestError::Repeated { name, .. } => {
            Answer::at(ProblemType::MalformedRequest, &format!("header:{name}"), error)
        }
        RequestError::Host { .. } => {
            Answer::at(ProblemType::MalformedRequest, "header:host", error)
        }
        RequestError::BodyTooLarge { .. } | RequestError::BodyTooHeavy { .. } => {
            ProblemType::BodyTooLarge.into()
        }
        RequestError::BodyTooSlow { .. } => ProblemType::Timeout.into(),
        RequestError::ContentType { .. } => {
            Answer::at(ProblemType::UnsupportedMediaType, "header:content-type", error)
        }
        RequestError::ContentEncoding { .. } => {
            Answer::at(ProblemType::UnsupportedMediaType, "header:content-encoding", error)
        }
        RequestError::RevisionMissing => {
            Answer::at(ProblemType::PreconditionRequired, "header:if-match", error)
        }
    }
}

fn load(error: &LoadError) -> Answer {
    match error {
        LoadError::RateExceeded { bound, wait } | LoadError::FailuresExceeded { bound, wait } => {
            Answer::too_fast(*bound, *wait)
        }
        LoadError::RequestsFull { under_way } => {
            overloaded("concurrency", "concurrent-requests", *under_way)
        }
        LoadError::StreamsFull { open } => overloaded("streams", "streams", *open),
        LoadError::BodiesFull { max, .. } => overloaded("bodies", "content-bytes", *max),
        LoadError::AnswersFull { max, .. } => overloaded("answers", "content-bytes", *max),
        LoadError::ShareFull(error) => share(error),
        LoadError::TooSlow { .. } => ProblemType::Overloaded.into(),
    }
}

fn overloaded(name: &'static str, unit: &'static str, limit: usize) -> Answer {
    Answer::used_up(ProblemType::Overloaded, name, unit, limit)
}

fn share(ShareFull { name, unit, total, .. }: &ShareFull) -> Answer {
    Answer::used_up(ProblemType::TooManyRequests, name, unit, *total)
}

fn cause(error: &Cause) -> Answer {
    match error {
        Cause::NotFound { .. } | Cause::UnknownSensor(UnknownSensor::Sensor { .. }) => {
            ProblemType::NotFound.into()
        }
        Cause::Invalid(error) => invalid(error),
        Cause::Needed { .. } | Cause::ReadingsFull { .. } => ProblemType::WrongState.into(),
        Cause::ReadingConflict { pointer, .. } => Answer::at(ProblemType::Conflict, pointer, error),
        Cause::Compute(ComputeError::Full { places }) => overloaded("compute", "places", *places),
        Cause::Compute(ComputeError::Stopped) => ProblemType::Overloaded.into(),
        Cause::Store(error) | Cause::UnknownSensor(UnknownSensor::Store(error)) => store(error),
        Cause::Compute(ComputeError::Panicked)
        | Cause::Unusable { .. }
        | Cause::UnknownSensor(UnknownSensor::Calibration { .. } | UnknownSensor::World { .. })
        | Cause::Panicked => ProblemType::Internal.into(),
    }
}

fn invalid(Invalid(errors): &Invalid) -> Answer {
    Answer { errors: errors.clone(), ..ProblemType::InvalidValue.into() }
}

fn store(error: &StoreError) -> Answer {
    match error {
        StoreError::NotFound { .. } | StoreError::NoVersion { .. } => ProblemType::NotFound.into(),
        StoreError::NameTaken { .. } => Answer::at(ProblemType::Conflict, "/name", error),
        StoreError::Exists { .. } | StoreError::Changed { .. } => ProblemType::Conflict.into(),
        StoreError::Damaged { .. } | StoreError::Model { .. } => ProblemType::Damaged.into(),
        StoreError::Engine(error) => engine(error),
    }
}

fn engine(error: &EngineError) -> Answer {
    match error {
        EngineError::Full { .. } => ProblemType::StorageFull.into(),
        EngineError::OverQuota { quota, .. } => {
            let quota = usize::try_from(*quota).unwrap_or(usize::MAX);
            Answer::used_up(ProblemType::QuotaExceeded, "storage", "content-bytes", quota)
        }
        EngineError::Busy { .. }
        | EngineError::Elsewhere { .. }
        | EngineError::CutsUnderWay { .. }
        | EngineError::CutTooLarge { .. } => ProblemType::Overloaded.into(),
        EngineError::Poisoned | EngineError::Stopped | EngineError::NoRoomToCompact { .. } => {
            ProblemType::Unavailable.into()
        }
        _ => ProblemType::Internal.into(),
    }
}

fn key(error: &KeyError) -> Answer {
    match error {
        KeyError::RobotHeld { pointer, .. } => Answer::at(ProblemType::Forbidden, pointer, error),
        KeyError::RobotsFull { .. }
        | KeyError::LastAdmin { .. }
        | KeyError::Refused { .. }
        | KeyError::Full { .. } => ProblemType::WrongState.into(),
        KeyError::NoRandom(_) => ProblemType::Internal.into(),
        KeyError::Cause(error) => cause(error),
    }
}

fn webhook(error: &WebhookError) -> Answer {
    match error {
        WebhookError::Full { .. }
        | WebhookError::Disabled { .. }
        | WebhookError::InFlight { .. } => ProblemType::WrongState.into(),
        WebhookError::NoRandom(_) => ProblemType::Internal.into(),
        WebhookError::Cause(error) => cause(error),
    }
}

fn object(error: &ObjectError) -> Answer {
    match error {
        ObjectError::InTraining { .. } => ProblemType::WrongState.into(),
        ObjectError::Format(FormatError::ContentType { .. }) => {
            Answer::at(ProblemType::UnsupportedMediaType, "header:content-type", error)
        }
        ObjectError::Format(FormatError::Invalid(error)) => invalid(error),
        ObjectError::Cause(error) => cause(error),
    }
}

fn catalogue(error: &CatalogueError) -> Answer {
    match error {
        CatalogueError::NoVersion { .. } => ProblemType::NotFound.into(),
        CatalogueError::Untrained { .. }
        | CatalogueError::NoPart(_)
        | CatalogueError::OtherContent { .. }
        | CatalogueError::Adopt(_) => ProblemType::WrongState.into(),
        CatalogueError::RevisionChanged { .. } => {
            Answer::at(ProblemType::PreconditionFailed, "header:if-match", error)
        }
        // Waiting does not make a model smaller.
        CatalogueError::ModelTooLarge { .. } => {
            Answer { wait: None, ..ProblemType::Unavailable.into() }
        }
        CatalogueError::ModelsInUse { .. } => ProblemType::Overloaded.into(),
        CatalogueError::Quarantined { .. } => ProblemType::Damaged.into(),
        CatalogueError::Unreadable(_) => ProblemType::Internal.into(),
        CatalogueError::Cause(error) => cause(error),
    }
}

fn live(error: &LiveError) -> Answer {
    match error {
        LiveError::Ended { .. } => ProblemType::SessionEnded.into(),
        LiveError::Busy { waiting } => Answer::used_up(
            ProblemType::TooManyRequests,
            "session",
            "concurrent-requests",
            *waiting,
        ),
        LiveError::NoMarginals { .. }
        | LiveError::NoNextTouches { .. }
        | LiveError::NoTouch { .. }
        | LiveError::TooManyToExplain { .. }
        | LiveError::OfCell { .. }
        | LiveError::NotForwarded { .. }
        | LiveError::Gap { .. } => ProblemType::WrongState.into(),
        LiveError::OtherEntry { .. } => ProblemType::Conflict.into(),
        LiveError::BeliefsFull { max, .. } => overloaded("beliefs", "bytes", *max),
        LiveError::Cause(error) => cause(error),
    }
}

fn session(error: &SessionError) -> Answer {
    match error {
        // Sessions are closed all the time, so an earlier retry is worthwhile.
        SessionError::Full { max, wait } => Answer::too_fast(
            Bound::used_up("sessions", "sessions", *max),
            wait.unwrap_or(SESSION_WAIT).min(SESSION_WAIT),
        ),
        SessionError::ShareFull(error) => share(error),
        SessionError::OtherTruth(_) => ProblemType::Conflict.into(),
        SessionError::Live(error) => live(error),
        SessionError::Catalogue(error) => catalogue(error),
        SessionError::Key(error) => key(error),
        SessionError::Cause(error) => cause(error),
    }
}

/// The response to a handler that panicked.
pub(crate) fn panicked(_: Box<dyn std::any::Any + Send>) -> Response {
    Refusal::from(Cause::Panicked).into_response()
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
        StatusCode::PAYLOAD_TOO_LARGE => (ProblemType::BodyTooLarge, "the body is too long".into()),
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

/// The status of all problems of a type.
pub(crate) fn status(kind: ProblemType) -> StatusCode {
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
