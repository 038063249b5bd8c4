//! The documentation at `/docs`: a page of our own around Swagger UI, in the dashboard's colours.
//!
//! `server/docs` holds the page, its style and its script; Swagger UI's script and style are
//! those of the vendored crate. Nothing is loaded from elsewhere.

use std::borrow::Cow;
use std::sync::Arc;

use utoipa_swagger_ui::Config;

const HTML: &str = "text/html; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";

/// The file of the documentation with a name below `/docs/`: its content type and its bytes.
pub(crate) fn file(name: &str) -> Option<(&'static str, &'static [u8])> {
    Some(match name {
        "" => (HTML, &include_bytes!("../../docs/index.html")[..]),
        "palpate.css" => (STYLE, &include_bytes!("../../docs/palpate.css")[..]),
        "palpate.js" => (SCRIPT, &include_bytes!("../../docs/palpate.js")[..]),
        "swagger-ui.css" => (STYLE, vendored(name)?),
        "swagger-ui-bundle.js" => (SCRIPT, vendored(name)?),
        _ => return None,
    })
}

/// A file of Swagger UI.
fn vendored(name: &str) -> Option<&'static [u8]> {
    let file = utoipa_swagger_ui::serve(name, Arc::new(Config::default())).ok()??;
    match file.bytes {
        Cow::Borrowed(bytes) => Some(bytes),
        Cow::Owned(_) => None,
    }
}
