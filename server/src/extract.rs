//! Extractors of handlers: bodies, queries and path segments, with errors that name the field.
//!
//! The framework's own extractors answer in plain text; these answer with a [`Refusal`].

mod msgpack;
mod plain;
mod shape;

use std::cell::Cell;
use std::error::Error as _;

use axum::body::{Bytes, HttpBody};
use axum::extract::rejection::QueryRejection;
use axum::extract::{FromRequest, FromRequestParts, Path, Query, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use palpate_schemas::FieldError;
use serde::Deserializer;
use serde::de::{DeserializeOwned, DeserializeSeed as _};
use serde_json::error::Category;
use serde_path_to_error::Segment;
use utoipa::ToSchema;

use crate::admission::Room;
use crate::app::App;
use crate::cause::Cause;
use crate::etag::Tags;
use crate::refusal::{Refusal, RequestError};
pub(crate) use msgpack::parse as parse_msgpack;

/// Length in bytes above which bodies are parsed on the compute pool: 1 ms is about 100 kB.
const PARSE_HERE_MAX: usize = 100_000;

/// Maximum memory of a parsed body, in bytes. Chosen: the longest body of numbers as robots write
/// them, at four bytes a number, becomes this.
const MEMORY_MAX: usize = 128 << 20;

/// A JSON body.
pub(crate) struct JsonBody<T>(pub(crate) T);

/// An optional JSON body.
pub(crate) struct OptionalBody<T>(pub(crate) T);

/// Readings in JSON or MessagePack.
pub(crate) struct ReadingsBody<T>(pub(crate) T);

/// The parameters of a query.
pub(crate) struct Params<T>(pub(crate) T);

/// The segments of the path: an id or a name, or a tuple of them.
pub(crate) struct Segments<T = String>(pub(crate) T);

/// A type of bodies.
pub(crate) trait Parsed: DeserializeOwned + ToSchema + Send + 'static {}

impl<T: DeserializeOwned + ToSchema + Send + 'static> Parsed for T {}

/// Asks for the memory that a body will take, before it takes any.
pub(crate) type Admit<'a> = &'a dyn Fn(usize) -> Result<(), Refusal>;

/// A mesh file: its content type and bytes.
pub(crate) struct MeshBody {
    pub(crate) content_type: String,
    pub(crate) bytes: Bytes,
}

impl<T: Parsed> FromRequest<App> for JsonBody<T> {
    type Rejection = Refusal;

    async fn from_request(request: Request, app: &App) -> Result<Self, Refusal> {
        let body = Body::of(request, app).await?;
        if !is_json(&body.content_type) {
            return Err(body.content_type_refused("application/json"));
        }
        body.parsed(app, parse).await.map(Self)
    }
}

impl<T: Parsed + Default> FromRequest<App> for OptionalBody<T> {
    type Rejection = Refusal;

    async fn from_request(request: Request, app: &App) -> Result<Self, Refusal> {
        let body = Body::of(request, app).await?;
        if body.bytes.is_empty() {
            return Ok(Self(T::default()));
        }
        if !is_json(&body.content_type) {
            return Err(body.content_type_refused("application/json"));
        }
        body.parsed(app, parse).await.map(Self)
    }
}

impl<T: Parsed> FromRequest<App> for ReadingsBody<T> {
    type Rejection = Refusal;

    async fn from_request(request: Request, app: &App) -> Result<Self, Refusal> {
        let body = Body::of(request, app).await?;
        if body.content_type == msgpack::CONTENT_TYPE {
            return body.parsed(app, msgpack::parse).await.map(Self);
        }
        if is_json(&body.content_type) {
            return body.parsed(app, parse).await.map(Self);
        }
        Err(body.content_type_refused("application/json or application/msgpack"))
    }
}

impl FromRequest<App> for MeshBody {
    type Rejection = Refusal;

    async fn from_request(request: Request, app: &App) -> Result<Self, Refusal> {
        let content_type = content_type(request.headers());
        let config = &app.config;
        let bytes = read(request, config.mesh_bytes_max).await?;
        Ok(Self { content_type, bytes })
    }
}

impl<T: DeserializeOwned> FromRequestParts<App> for Params<T> {
    type Rejection = Refusal;

    async fn from_request_parts(parts: &mut Parts, _: &App) -> Result<Self, Refusal> {
        let parsed = Query::<T>::try_from_uri(&parts.uri);
        parsed.map(|Query(params)| Self(params)).map_err(|error| query_refusal(&error))
    }
}

impl<T: DeserializeOwned + Send> FromRequestParts<App> for Segments<T> {
    type Rejection = Refusal;

    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self, Refusal> {
        let segments = Path::<T>::from_request_parts(parts, app).await;
        let Path(segments) =
            segments.map_err(|error| RequestError::Unreadable { reason: error.body_text() })?;
        Ok(Self(segments))
    }
}

/// The revision that a request's `If-Match` expects: the present one if it is listed.
///
/// # Errors
/// [`RequestError::RevisionMissing`] without the header, [`Cause::Invalid`] when it has none of our
/// tags.
pub(crate) fn if_match(headers: &HeaderMap, present: u64) -> Result<u64, Refusal> {
    let tags = Tags::of(headers, &header::IF_MATCH).ok_or(RequestError::RevisionMissing)?;
    if tags.has(&present.to_string()) {
        return Ok(present);
    }
    tags.revisions().next().ok_or_else(|| {
        let value = headers.get(header::IF_MATCH);
        let detail = format!("came {value:?}, expected the `ETag` of what is changed");
        Cause::field("header:if-match", detail).into()
    })
}

/// Parses JSON; the error names an invalid value by a JSON pointer.
pub(crate) fn parse<T: Parsed>(bytes: &[u8], admit: Admit<'_>) -> Result<T, Refusal> {
    let mut first = serde_json::Deserializer::from_slice(bytes);
    admit(weight::<T, _>(&mut first, |at, error| json_refusal(at, &error))?)?;
    let mut deserializer = serde_json::Deserializer::from_slice(bytes);
    let value = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
        let pointer = pointer(error.path());
        json_refusal(pointer, &error.into_inner())
    })?;
    deserializer.end().map_err(|error| json_refusal(String::new(), &error))?;
    Ok(value)
}

/// The memory that a body will take, after a first pass over its bytes.
fn weight<'de, T: Parsed, D: Deserializer<'de>>(
    deserializer: D,
    refusal: impl Fn(String, D::Error) -> Refusal,
) -> Result<usize, Refusal> {
    let shape = shape::of::<T>();
    let weight = Cell::new(0);
    let pass = shape::Pass { shape, weight: &weight, weight_max: MEMORY_MAX };
    let mut track = serde_path_to_error::Track::new();
    let tracked = serde_path_to_error::Deserializer::new(deserializer, &mut track);
    match pass.deserialize(tracked) {
        Ok(()) => Ok(weight.get()),
        Err(_) if weight.get() > MEMORY_MAX => {
            Err(RequestError::BodyTooHeavy { max: MEMORY_MAX }.into())
        }
        Err(error) => Err(refusal(pointer(&track.path()), error)),
    }
}

/// A complete body, and the memory that it may take.
struct Body {
    content_type: String,
    bytes: Bytes,
    room: Option<Room>,
}

impl Body {
    async fn of(request: Request, app: &App) -> Result<Self, Refusal> {
        let content_type = content_type(request.headers());
        let room = request.extensions().get().cloned();
        let bytes = read(request, app.config.json_bytes_max).await?;
        Ok(Self { content_type, bytes, room })
    }

    /// Parses the body, a long one on the compute pool.
    async fn parsed<T: Send + 'static>(
        self,
        app: &App,
        parse: fn(&[u8], Admit<'_>) -> Result<T, Refusal>,
    ) -> Result<T, Refusal> {
        let Self { bytes, room, .. } = self;
        let length = bytes.len();
        let admit = move |weight| match &room {
            Some(room) => Ok(room.grow_to(length + weight)?),
            None => Ok(()),
        };
        if length <= PARSE_HERE_MAX {
            return parse(&bytes, &admit);
        }
        app.pool.place()?.run(move || parse(&bytes, &admit)).await?
    }

    fn content_type_refused(self, expected: &'static str) -> Refusal {
        RequestError::ContentType { found: self.content_type, expected }.into()
    }
}

/// Permitted values of mandatory query parameters, for requests without them.
const MANDATORY: [(&str, &str); 2] =
    [("unit", "m, cm, mm or in"), ("sessions", "ids of sessions, separated by commas")];

/// The framework says "name: fault" or names the field between backticks.
fn query_refusal(error: &QueryRejection) -> Refusal {
    let said = error.source().map_or_else(|| error.body_text(), ToString::to_string);
    let is_name = |name: &str| name.chars().all(|c| c.is_ascii_lowercase() || c == '_');
    let (name, detail) = match said.split_once(": ") {
        Some((name, detail)) if is_name(name) => (name.to_owned(), detail.to_owned()),
        _ => (named_field(&said).unwrap_or_default(), said),
    };
    let expected = MANDATORY.iter().find(|(mandatory, _)| *mandatory == name);
    let detail = match expected {
        Some((_, expected)) if detail.starts_with("missing field") => {
            format!("is missing, expected {expected}")
        }
        _ => plain::words(&detail),
    };
    Cause::field(format!("?{name}"), detail).into()
}

fn json_refusal(pointer: String, error: &serde_json::Error) -> Refusal {
    let detail = error.to_string();
    let is_value = error.classify() == Category::Data || detail.contains("out of range");
    if is_value { wrong_value(pointer, detail) } else { malformed("JSON", pointer, detail) }
}

/// The refusal of a readable body with an invalid value at `pointer`, or a missing one under it.
fn wrong_value(pointer: String, detail: String) -> Refusal {
    let missing = named_field(&detail).filter(|_| detail.starts_with("missing field"));
    let pointer = missing.map_or(pointer.clone(), |name| format!("{pointer}/{name}"));
    Cause::field(pointer, plain::words(&detail)).into()
}

/// The refusal of a body that cannot be read from `pointer` on.
fn malformed(format: &'static str, pointer: String, reason: String) -> Refusal {
    let errors = vec![FieldError { pointer, detail: reason.clone() }];
    RequestError::Malformed { format, reason, errors }.into()
}

fn pointer(path: &serde_path_to_error::Path) -> String {
    let mut pointer = String::new();
    for segment in path.iter() {
        let segment = match segment {
            Segment::Seq { index } => index.to_string(),
            // A key is shown as far as a name may be long.
            Segment::Map { key } => {
                let key: String = key.chars().take(shape::TEXT_MAX).collect();
                key.replace('~', "~0").replace('/', "~1")
            }
            Segment::Enum { variant } => variant.clone(),
            Segment::Unknown => continue,
        };
        pointer.push('/');
        pointer.push_str(&segment);
    }
    pointer
}

/// The field between the first backticks of serde's message.
fn named_field(detail: &str) -> Option<String> {
    detail.split('`').nth(1).map(str::to_owned)
}

fn content_type(headers: &HeaderMap) -> String {
    let value = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
    let essence = value.unwrap_or_default().split(';').next().unwrap_or_default();
    essence.trim().to_ascii_lowercase()
}

fn is_json(content_type: &str) -> bool {
    content_type == "application/json"
        || (content_type.starts_with("application/") && content_type.ends_with("+json"))
}

/// The body of a request, which has arrived by now (`admission`).
async fn read(request: Request, max: usize) -> Result<Bytes, Refusal> {
    if let Some(encoding) = request.headers().get(header::CONTENT_ENCODING)
        && !encoding.as_bytes().eq_ignore_ascii_case(b"identity")
    {
        let found = String::from_utf8_lossy(encoding.as_bytes()).into_owned();
        return Err(RequestError::ContentEncoding { found }.into());
    }
    let length = request.body().size_hint().lower();
    if length > max as u64 {
        return Err(RequestError::BodyTooLarge { max, advice: "" }.into());
    }
    let read = axum::body::to_bytes(request.into_body(), max).await;
    read.map_err(|error| RequestError::Unreadable { reason: error.to_string() }.into())
}
