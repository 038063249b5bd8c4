//! Reasons for which the service refuses a request. `problem` maps them to HTTP.

use std::time::Duration;

use palpate_schemas::{FieldError, JobState, Readiness, Role};
use palpate_store::access::AccessKey;
use palpate_store::error::StoreError;
use palpate_store::journal::AppendError;
use thiserror::Error;
use uuid::Uuid;

use crate::compute::ComputeError;
use crate::known_sensors::UnknownSensor;
use crate::limits::{Bound, megabytes};
use crate::model::NoPart;
use crate::wire::life::{End, OtherTruth};
use crate::wire::object::FormatError;
use crate::wire::{Invalid, training};
use crate::{roles, wire};

/// Reason for which a request was refused.
#[derive(Debug, Error)]
pub(crate) enum Refusal {
    #[error("there is no {what} {reference:?}")]
    NotFound { what: &'static str, reference: String },
    #[error("catalogue {catalogue:?} has no version {version}")]
    NoVersion { catalogue: String, version: u32 },
    #[error("the body is not {format}: {reason}")]
    Malformed { format: &'static str, reason: String, errors: Vec<FieldError> },
    #[error("the request's path or body cannot be read: {reason}")]
    Unreadable { reason: String },
    #[error("the body is longer than {max} bytes")]
    BodyTooLarge { max: usize },
    #[error("the body did not arrive within {within:?}")]
    BodyTooSlow { within: Duration },
    #[error("the content type is {found:?}, expected {expected}")]
    ContentType { found: String, expected: &'static str },
    #[error(
        "the content encoding is {found:?}, expected none: bodies are not compressed, leave the \
         header `content-encoding` out"
    )]
    ContentEncoding { found: String },
    #[error(transparent)]
    Invalid(#[from] Invalid),
    #[error(
        "session {session} {end}; it accepts no more readings, but its readings and its belief can \
         still be read"
    )]
    SessionEnded { session: Uuid, end: End },
    #[error(
        "{max} sessions are open, which is the maximum: close finished ones, or let them expire \
         (`ttl_s`)"
    )]
    SessionsFull { max: usize, wait: Option<Duration> },
    #[error(
        "{waiting} requests already wait for this session: send several readings in one request, \
         or fewer requests at once"
    )]
    SessionBusy { waiting: usize },
    #[error("catalogue {catalogue:?} has no current version: train it first")]
    Untrained { catalogue: String },
    #[error(
        "session {session} has no marginals: its method keeps no pose distribution, or its \
         readings rule the object out"
    )]
    NoMarginals { session: Uuid },
    #[error(
        "session {session} has the method `{method}`, which cannot rank next touches: expected \
         `surface`"
    )]
    NoNextTouches { session: Uuid, method: &'static str },
    #[error(
        "session {session} has no touch yet: expected a `workspace` (center and radius of a ball \
         that contains the object), or a reading that touches the object"
    )]
    NoTouch { session: Uuid },
    #[error(
        "session {session} rests on {found} readings, and at most {max} can be explained: name an \
         earlier revision with `?at=`"
    )]
    TooManyToExplain { session: Uuid, found: usize, max: usize },
    #[error("reading {seq} of robot {robot:?} is already stored with different content")]
    ReadingConflict { pointer: String, robot: String, seq: u64 },
    #[error(
        "the robot name {robot:?} belongs to another key: use another name, or have an \
         administrator assign this one to your key (`PUT /v1/robots/…`)"
    )]
    RobotHeld { pointer: String, robot: String },
    #[error("this key holds {held} robot names, and at most {max} are allowed")]
    RobotsFull { held: usize, max: usize },
    #[error(
        "the {what} has {found} readings, and at most {max} are allowed: {more} more do not fit"
    )]
    ReadingsFull { what: &'static str, found: u64, more: usize, max: usize },
    #[error(
        "the {part} of version {version} of catalogue {catalogue:?} need {} of memory, more than \
         the {} for models: raise `--model-memory-mb`",
        megabytes(*.needed), megabytes(*.budget)
    )]
    ModelTooLarge { catalogue: String, version: u32, part: &'static str, needed: u64, budget: u64 },
    #[error(
        "version {version} of catalogue {catalogue:?} needs {} of memory, and the models in use \
         already take {} of {}",
        megabytes(*.needed), megabytes(*.in_use), megabytes(*.budget)
    )]
    ModelsInUse { catalogue: String, version: u32, needed: u64, in_use: u64, budget: u64 },
    #[error(transparent)]
    Unauthenticated(KeyFault),
    #[error(
        "the key {:?} has the role {}, expected {}", key.name, role_name(key.role), needed(roles)
    )]
    Forbidden { key: Box<AccessKey>, roles: &'static [Role] },
    #[error("this path exists, but not with this method; the header `Allow` lists which")]
    OtherMethod { allow: String },
    #[error(
        "the request addresses the host {host:?}: a server without keys answers only to its own \
         names, such as 127.0.0.1 or localhost; in a network also to its addresses and to the \
         names that `--host-name` lists"
    )]
    ForeignHost { host: String },
    #[error("pages of {origin} may not use this server: allow them with `--cors-origin {origin}`")]
    ForeignOrigin { origin: String },
    #[error("{name:?} is the last valid admin key: create another one first")]
    LastAdmin { name: String },
    #[error("the key {name:?} was revoked or has expired: create a new one")]
    KeyRefused { name: String },
    #[error("there are {found} keys, which is the maximum, and none of them is revoked")]
    KeysFull { found: usize },
    #[error("the operating system provides no random bits")]
    NoRandom,
    #[error("job {job} has already ended: {}", state.name())]
    JobFinished { job: Uuid, state: JobState },
    #[error("{what} is needed: {by}")]
    Needed { what: String, by: String },
    #[error("object {object:?} is being trained by job {job}: cancel the job first")]
    ObjectInTraining { object: String, job: Uuid },
    #[error("the revision is {found}, `If-Match` expects {expected}")]
    RevisionChanged { expected: String, found: u64 },
    #[error("the header `If-Match` is missing: expected the `ETag` of the resource to change")]
    RevisionMissing,
    #[error("{waiting} trainings are already waiting, which is the maximum")]
    TrainingQueueFull { waiting: usize },
    #[error(
        "each client may send {} requests a second: try again in {:.1} s", bound.limit,
        wait.as_secs_f64()
    )]
    RateExceeded { bound: Bound, wait: Duration },
    #[error(
        "{} changes with one key have failed within a minute, which is the maximum: find the \
         cause, and try again in {:.1} s", bound.limit, wait.as_secs_f64()
    )]
    FailuresExceeded { bound: Bound, wait: Duration },
    #[error("bodies in transit take {used} of {max} bytes: this one does not fit")]
    BodiesFull { used: usize, max: usize },
    #[error(
        "beliefs in use take {} of memory, and at most {} are allowed",
        megabytes(*bytes as u64), megabytes(*max as u64)
    )]
    BeliefsFull { bytes: usize, max: usize },
    #[error("unread answers take {used} of {max} bytes: this one does not fit")]
    AnswersFull { used: usize, max: usize },
    #[error("{open} connections are open, which is the maximum: only health checks are answered")]
    ConnectionsFull { open: usize },
    #[error(
        "this client holds its share of the server's {name}: all clients hold {used} of {total} \
         {unit}, and one client at most three times what is free"
    )]
    ShareFull { name: &'static str, unit: &'static str, used: usize, total: usize },
    #[error("{open} event streams are open, which is the maximum")]
    StreamsFull { open: usize },
    #[error("{under_way} requests are in progress, which is the maximum")]
    RequestsFull { under_way: usize },
    #[error(
        "no answer within {within:?}; the request may have been stored: repeat readings with the \
         same robot and seq"
    )]
    TooSlow { within: Duration },
    #[error(transparent)]
    NoPart(#[from] NoPart),
    #[error(transparent)]
    Format(#[from] FormatError),
    #[error(transparent)]
    OtherTruth(#[from] OtherTruth),
    #[error(transparent)]
    UnreadableVersion(#[from] training::Unreadable),
    #[error(transparent)]
    UnknownSensor(#[from] UnknownSensor),
    #[error(transparent)]
    Compute(#[from] ComputeError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("the stored data of {what} {id} cannot be used: {reason}")]
    Unusable { what: &'static str, id: String, reason: String },
    #[error(
        "version {version} of catalogue {catalogue:?} is damaged ({reason}): use another version, \
         train a new one, or restore a snapshot"
    )]
    Quarantined { catalogue: String, version: u32, reason: String },
    #[error("the server is not ready")]
    NotReady(Readiness),
    #[error("a task of the server panicked")]
    Panicked,
}

/// Reason of a refused request.
#[derive(Clone, Debug, Error)]
pub(crate) enum KeyFault {
    #[error("this server requires an API key: send it as `Authorization: Bearer palpate_…`")]
    Missing,
    #[error("the header `Authorization` holds no key of Palpate, expected `Bearer palpate_…`")]
    NotAKey,
    #[error("the server does not know this API key")]
    Unknown,
    #[error("the API key {:?} was revoked", .0.name)]
    Revoked(Box<AccessKey>),
    #[error("the API key {:?} has expired", .0.name)]
    Expired(Box<AccessKey>),
    #[error("the API key {:?} was rotated, and its previous secret is no longer valid", .0.name)]
    Rotated(Box<AccessKey>),
}

impl KeyFault {
    /// The key meant by the request, if the secret proves it.
    pub(crate) fn key(&self) -> Option<&AccessKey> {
        match self {
            Self::Missing | Self::NotAKey | Self::Unknown => None,
            Self::Revoked(key) | Self::Expired(key) | Self::Rotated(key) => Some(key),
        }
    }
}

impl Refusal {
    /// One wrong field.
    pub(crate) fn field(pointer: impl Into<String>, detail: impl ToString) -> Self {
        Self::Invalid(Invalid::field(pointer, detail))
    }
}

impl From<AppendError> for Refusal {
    fn from(error: AppendError) -> Self {
        match error {
            AppendError::Store(error) => Self::Store(error),
            AppendError::Sequence { .. } | AppendError::Retracted { .. } => {
                Self::Store(StoreError::Changed { what: "journal", id: Uuid::nil() })
            }
            AppendError::Repeated { robot, seq, .. } => {
                Self::ReadingConflict { pointer: "/readings".to_owned(), robot, seq }
            }
            AppendError::RobotLength { .. } => Self::field("/readings", error),
        }
    }
}

impl From<palpate_store::engine::EngineError> for Refusal {
    fn from(error: palpate_store::engine::EngineError) -> Self {
        Self::Store(error.into())
    }
}

impl From<KeyFault> for Refusal {
    fn from(fault: KeyFault) -> Self {
        Self::Unauthenticated(fault)
    }
}

impl From<getrandom::Error> for Refusal {
    fn from(_: getrandom::Error) -> Self {
        Self::NoRandom
    }
}

fn role_name(role: palpate_store::access::Role) -> &'static str {
    roles::name(wire::access::role(role))
}

fn needed(roles: &[Role]) -> String {
    match roles {
        [] => "a role that no key has".to_owned(),
        [only] => format!("the role {}", roles::name(*only)),
        several => format!("one of the roles {}", roles::listed(several)),
    }
}
