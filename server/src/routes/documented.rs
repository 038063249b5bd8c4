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

/// The answer of an operation that deletes.
#[derive(IntoResponses)]
#[response(status = 204, description = "Deleted")]
pub(crate) struct Deleted;

/// A mesh file.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
pub(crate) struct MeshFile(#[expect(dead_code, reason = "the type only documents")] Vec<u8>);

/// A snapshot file, in the format of `docs/formats.md`.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
pub(crate) struct SnapshotFile(#[expect(dead_code, reason = "the type only documents")] Vec<u8>);

/// A contact map as an image or a PLY file.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
pub(crate) struct MapFile(#[expect(dead_code, reason = "the type only documents")] Vec<u8>);
