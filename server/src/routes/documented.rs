//! Answers and files as the API's description shows them; the types only document.

use palpate_schemas::Problem;
use utoipa::{IntoResponses, ToSchema};

/// The answer of an operation that may not fit the state of things.
#[derive(IntoResponses)]
#[response(
    status = 409,
    content_type = "application/problem+json",
    description = "The request conflicts with the current state, or its name or number is taken"
)]
pub(crate) struct Conflict(#[expect(dead_code, reason = "the type only documents")] Problem);

/// The answer of an operation to a session that has ended.
#[derive(IntoResponses)]
#[response(
    status = 410,
    content_type = "application/problem+json",
    description = "The session was closed or has expired"
)]
pub(crate) struct Ended(#[expect(dead_code, reason = "the type only documents")] Problem);

/// A mesh file, as its program wrote it.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
pub(crate) struct MeshFile(#[expect(dead_code, reason = "the type only documents")] Vec<u8>);

/// A snapshot, as `docs/formats.md` draws it.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
pub(crate) struct SnapshotFile(#[expect(dead_code, reason = "the type only documents")] Vec<u8>);

/// A map of contact as an image or a model.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
pub(crate) struct MapFile(#[expect(dead_code, reason = "the type only documents")] Vec<u8>);
