//! The dashboard's files, built from `web/` and embedded: nothing is read from disk or loaded
//! from elsewhere. `web/build` rebuilds them.

use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

/// A file of the dashboard.
struct Asset {
    path: &'static str,
    content_type: &'static str,
    bytes: &'static [u8],
}

const HTML: &str = "text/html; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";
const TEXT: &str = "text/plain; charset=utf-8";

/// Every file; the names stay, since browsers revalidate files on each request.
const ASSETS: &[Asset] = &[
    asset("/", HTML, include_bytes!("../dashboard/index.html")),
    asset("/assets/app.js", SCRIPT, include_bytes!("../dashboard/assets/app.js")),
    asset("/assets/scene.js", SCRIPT, include_bytes!("../dashboard/assets/scene.js")),
    asset("/assets/app.css", STYLE, include_bytes!("../dashboard/assets/app.css")),
    asset("/assets/licences.txt", TEXT, include_bytes!("../dashboard/assets/licences.txt")),
    asset("/assets/icon.svg", "image/svg+xml", include_bytes!("../dashboard/assets/icon.svg")),
];

const fn asset(path: &'static str, content_type: &'static str, bytes: &'static [u8]) -> Asset {
    Asset { path, content_type, bytes }
}

/// The paths of all files.
pub(crate) fn paths() -> impl Iterator<Item = &'static str> {
    ASSETS.iter().map(|asset| asset.path)
}

/// Whether a path is a file of the dashboard.
pub(crate) fn has(path: &str) -> bool {
    paths().any(|known| known == path)
}

/// The answer with a file.
pub(crate) fn answer(path: &str) -> Response {
    let Some(asset) = ASSETS.iter().find(|asset| asset.path == path) else {
        return StatusCode::NOT_FOUND.into_response();
    };
    tagged(asset.content_type, asset.bytes)
}

/// The answer with a document that is constant while the server runs, with its tag.
pub(crate) fn tagged(content_type: &'static str, bytes: &'static [u8]) -> Response {
    let tag = format!("\"{}\"", &blake3::hash(bytes).to_hex()[..32]);
    let headers = [
        (header::CONTENT_TYPE, content_type),
        (header::CACHE_CONTROL, "no-cache"),
        (header::ETAG, tag.as_str()),
    ];
    (headers, bytes).into_response()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use super::*;

    #[test]
    fn every_built_file_is_served_and_nothing_else() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("dashboard");
        let mut built = BTreeSet::from(["/".to_owned()]);
        for entry in std::fs::read_dir(folder.join("assets")).unwrap() {
            built.insert(format!("/assets/{}", entry.unwrap().file_name().to_string_lossy()));
        }
        assert_eq!(built, paths().map(str::to_owned).collect());
    }

    #[test]
    fn the_page_has_nothing_inline_and_nothing_from_elsewhere() {
        let page = std::str::from_utf8(ASSETS[0].bytes).unwrap();
        for forbidden in ["<style", " style=", "<script>", "http://", "https://", " on"] {
            let found = page.find(forbidden).map(|at| &page[at..page.len().min(at + 40)]);
            assert!(found.is_none(), "{forbidden}: {found:?}");
        }
    }
}
