//! Errors on the wire: RFC 9457 `application/problem+json`, with a closed list of types.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Why a request was not done.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Problem {
    /// What kind of problem, from a closed list.
    #[serde(rename = "type")]
    pub kind: ProblemType,
    /// The kind in words; the same for every problem of the kind.
    pub title: String,
    /// The HTTP status.
    #[schema(minimum = 400, maximum = 599)]
    pub status: u16,
    /// What happened this time: what came and what was expected.
    pub detail: String,
    /// The path of the request.
    pub instance: String,
    /// The request's id, as in the header `x-request-id` and in the server's log.
    pub request_id: String,
    /// The fields that are wrong; empty when no field is to blame.
    #[serde(default)]
    pub errors: Vec<FieldError>,
}

/// One field that is wrong.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct FieldError {
    /// Where in the request: a JSON pointer into the body (`/readings/3/pose/orientation`), or
    /// `?name` for a parameter of the query, or `header:name`; for `/readyz` a check's name.
    pub pointer: String,
    /// What came there, and what was expected.
    pub detail: String,
}

/// The kinds of problem.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub enum ProblemType {
    /// 400: the body is not JSON, or the request cannot be read at all.
    #[serde(rename = "urn:palpate:problem:malformed-request")]
    MalformedRequest,
    /// 401: the request has no API key, or none that is let in.
    #[serde(rename = "urn:palpate:problem:unauthenticated")]
    Unauthenticated,
    /// 403: the key's role may not do this; `detail` says which roles may.
    #[serde(rename = "urn:palpate:problem:forbidden")]
    Forbidden,
    /// 404: there is nothing at this path, or nothing with this id.
    #[serde(rename = "urn:palpate:problem:not-found")]
    NotFound,
    /// 405: the path exists, this method does not.
    #[serde(rename = "urn:palpate:problem:method-not-allowed")]
    MethodNotAllowed,
    /// 408: the request's body did not arrive in time.
    #[serde(rename = "urn:palpate:problem:timeout")]
    Timeout,
    /// 409: the request does not fit the state of the thing, such as a job that is finished.
    #[serde(rename = "urn:palpate:problem:wrong-state")]
    WrongState,
    /// 409: something with this name, or another reading with this robot and sequence, exists.
    #[serde(rename = "urn:palpate:problem:conflict")]
    Conflict,
    /// 409: the key's quota of stored bytes is used up; `detail` says how many bytes it holds and
    /// may hold. Remove something that it wrote, then repeat the request.
    #[serde(rename = "urn:palpate:problem:quota-exceeded")]
    QuotaExceeded,
    /// 410: the session was closed or has expired; `detail` says which, and when. What it
    /// believed can still be read.
    #[serde(rename = "urn:palpate:problem:session-ended")]
    SessionEnded,
    /// 412: the thing has changed since it was read (`If-Match`).
    #[serde(rename = "urn:palpate:problem:precondition-failed")]
    PreconditionFailed,
    /// 428: the request needs an `If-Match` header.
    #[serde(rename = "urn:palpate:problem:precondition-required")]
    PreconditionRequired,
    /// 413: the body is larger than the server takes.
    #[serde(rename = "urn:palpate:problem:body-too-large")]
    BodyTooLarge,
    /// 415: the body's content type is not one of those expected.
    #[serde(rename = "urn:palpate:problem:unsupported-media-type")]
    UnsupportedMediaType,
    /// 422: the request can be read, a value in it is wrong.
    #[serde(rename = "urn:palpate:problem:invalid-value")]
    InvalidValue,
    /// 429: the client has used up what it may have; `RateLimit` says of what, and `Retry-After`
    /// when there is more.
    #[serde(rename = "urn:palpate:problem:too-many-requests")]
    TooManyRequests,
    /// 503: too much is being asked of the server at once; `Retry-After` says when to ask again.
    #[serde(rename = "urn:palpate:problem:overloaded")]
    Overloaded,
    /// 503: the server is stopping, or its store does not take writes.
    #[serde(rename = "urn:palpate:problem:unavailable")]
    Unavailable,
    /// 507: the disk is full; nothing was stored, reading goes on.
    #[serde(rename = "urn:palpate:problem:storage-full")]
    StorageFull,
    /// 500: what is stored and was asked for is damaged; everything else is served.
    #[serde(rename = "urn:palpate:problem:damaged")]
    Damaged,
    /// 500: the server is at fault; the request id finds the reason in its log.
    #[serde(rename = "urn:palpate:problem:internal")]
    Internal,
}
