//! Entity tags of conditional requests.

use axum::http::{HeaderMap, header};

/// Whether `If-None-Match` names a tag, weak or strong, alone or in a list.
pub(crate) fn is_known(headers: &HeaderMap, tag: &str) -> bool {
    let known = headers.get(header::IF_NONE_MATCH).and_then(|value| value.to_str().ok());
    known
        .is_some_and(|known| known.split(',').any(|one| one.trim().trim_start_matches("W/") == tag))
}
