//! Errors on the wire: RFC 9457 `application/problem+json`, with a closed list of types.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// An error, as RFC 9457 describes it.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Problem {
    /// Type of the problem, from a closed list.
    #[serde(rename = "type")]
    pub kind: ProblemType,
    /// Title of the type; the same for every problem of that type.
    pub title: String,
    /// The HTTP status.
    #[schema(minimum = 400, maximum = 599)]
    pub status: u16,
    /// What went wrong this time: what was found and what was expected.
    pub detail: String,
    /// The path of the request.
    pub instance: String,
    /// Request id, as in the header `x-request-id` and the server's log.
    pub request_id: String,
    /// The invalid fields; empty if no field is at fault.
    #[serde(default)]
    pub errors: Vec<FieldError>,
}

/// One invalid field.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct FieldError {
    /// Location in the request: a JSON pointer into the body (`/readings/3/pose/orientation`),
    /// `?name` for a query parameter, or `header:name`; for `/readyz` the name of a check.
    pub pointer: String,
    /// What was found and what was expected.
    pub detail: String,
}

/// Type of a problem.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub enum ProblemType {
    /// 400: the body is not JSON, or the request cannot be read at all.
    #[serde(rename = "urn:palpate:problem:malformed-request")]
    MalformedRequest,
    /// 401: the API key is missing or not valid.
    #[serde(rename = "urn:palpate:problem:unauthenticated")]
    Unauthenticated,
    /// 403: the key's role does not allow the operation; `detail` lists the roles that do.
    #[serde(rename = "urn:palpate:problem:forbidden")]
    Forbidden,
    /// 404: nothing exists at this path or with this id.
    #[serde(rename = "urn:palpate:problem:not-found")]
    NotFound,
    /// 405: the path exists, but not with this method.
    #[serde(rename = "urn:palpate:problem:method-not-allowed")]
    MethodNotAllowed,
    /// 408: the request's body did not arrive in time.
    #[serde(rename = "urn:palpate:problem:timeout")]
    Timeout,
    /// 409: the state of the resource does not allow the request, such as cancelling a finished
    /// job.
    #[serde(rename = "urn:palpate:problem:wrong-state")]
    WrongState,
    /// 409: the name is taken, or a different reading with this robot and `seq` exists.
    #[serde(rename = "urn:palpate:problem:conflict")]
    Conflict,
    /// 409: the key has used up its quota of stored bytes; `detail` gives both numbers. Remove
    /// something that the key wrote, then repeat the request.
    #[serde(rename = "urn:palpate:problem:quota-exceeded")]
    QuotaExceeded,
    /// 410: the session was closed or has expired; `detail` says which, and when. Its belief can
    /// still be read.
    #[serde(rename = "urn:palpate:problem:session-ended")]
    SessionEnded,
    /// 412: the resource has changed since it was read (`If-Match`).
    #[serde(rename = "urn:palpate:problem:precondition-failed")]
    PreconditionFailed,
    /// 428: the request needs an `If-Match` header.
    #[serde(rename = "urn:palpate:problem:precondition-required")]
    PreconditionRequired,
    /// 413: the body exceeds the size limit.
    #[serde(rename = "urn:palpate:problem:body-too-large")]
    BodyTooLarge,
    /// 415: the content type of the body is not supported here.
    #[serde(rename = "urn:palpate:problem:unsupported-media-type")]
    UnsupportedMediaType,
    /// 422: the request is readable, but a value in it is invalid.
    #[serde(rename = "urn:palpate:problem:invalid-value")]
    InvalidValue,
    /// 429: the client exceeds a limit. `RateLimit` names the limit, `Retry-After` says when to try
    /// again.
    #[serde(rename = "urn:palpate:problem:too-many-requests")]
    TooManyRequests,
    /// 503: the server is overloaded. `Retry-After` says when to try again.
    #[serde(rename = "urn:palpate:problem:overloaded")]
    Overloaded,
    /// 503: the server is shutting down, or its store does not accept writes.
    #[serde(rename = "urn:palpate:problem:unavailable")]
    Unavailable,
    /// 507: the disk is full. Nothing was stored; reads still work.
    #[serde(rename = "urn:palpate:problem:storage-full")]
    StorageFull,
    /// 500: the requested data is damaged. All other data is served.
    #[serde(rename = "urn:palpate:problem:damaged")]
    Damaged,
    /// 500: internal error. The server's log gives the reason under the request id.
    #[serde(rename = "urn:palpate:problem:internal")]
    Internal,
}
