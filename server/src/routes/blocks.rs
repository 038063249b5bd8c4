//! A stored file as the body of an answer, read from the store block by block at the reader's
//! pace.

use std::io;

use axum::Extension;
use axum::body::{Body, Bytes};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use futures::stream;
use palpate_store::mesh::MeshReader;

use crate::admission::InMemory;
use crate::compute::Pool;

/// Memory of one answer, in bytes: a block being sent, the next one, and the connection's buffer.
const IN_MEMORY: usize = 640 << 10;

/// A mesh file as an answer. If it is damaged, or is replaced meanwhile, the answer ends
/// before its stated length.
pub(crate) fn answer(content_type: &'static str, reader: MeshReader, pool: &Pool) -> Response {
    let length = reader.info().length;
    let blocks = stream::try_unfold((reader, pool.clone()), async |(mut reader, pool)| {
        let reading = pool.place_in_time().await?;
        let reading = reading.run_long(move || Ok((reader.next_block()?, reader)));
        let read = reading.await.map_err(io::Error::other)?;
        let (block, reader) = read.map_err(|error: palpate_store::error::StoreError| {
            tracing::error!(%error, "A mesh was not sent to its end: {error}");
            io::Error::other(error)
        })?;
        Ok::<_, io::Error>(block.map(|block| (Bytes::from(block), (reader, pool))))
    });
    let kind = [(header::CONTENT_TYPE, content_type)];
    let length = [(header::CONTENT_LENGTH, length)];
    (kind, length, Extension(InMemory(IN_MEMORY)), Body::from_stream(blocks)).into_response()
}
