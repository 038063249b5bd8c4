//! The router: every route of the API and every page, behind the layers.

use std::sync::Arc;

use axum::Router;
use axum::http::Uri;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::response::Response;
use axum::routing::get;
use tower_http::CompressionLevel;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{DefaultPredicate, Predicate, SizeAbove};

use crate::app::App;
use crate::middleware::admission::admit;
use crate::middleware::audit::record;
use crate::middleware::guard::guard;
use crate::middleware::headers::{cors, secure};
use crate::middleware::once;
use crate::middleware::rate::share;
use crate::middleware::{query, telemetry};
use crate::{dashboard, etag, openapi, problem, routes};

/// Length from which an answer is compressed, bytes. Chosen: a shorter one fits into one packet.
const COMPRESSED_MIN: u16 = 1400;

/// Every route behind every layer; the outermost is added last.
pub(crate) fn router(app: App) -> Router {
    let (api, _) = routes::api().split_for_parts();
    let without = Arc::new(openapi::operations_without_query());
    let guarded = api
        .merge(pages())
        .layer(from_fn_with_state(without, query::heed))
        .layer(from_fn(etag::condition))
        .layer(CatchPanicLayer::custom(problem::panicked))
        .layer(from_fn_with_state(app.clone(), record))
        .layer(from_fn_with_state(app.clone(), admit))
        .layer(from_fn_with_state(app.clone(), share))
        .layer(from_fn_with_state(app.clone(), guard));
    // Browsers send preflight requests without a key.
    let shared = match cors(&app.config.cors_origins) {
        Some(cors) => guarded.layer(cors),
        None => guarded,
    };
    shared
        .layer(from_fn(once::check))
        .layer(compressed())
        .layer(from_fn_with_state(app.clone(), secure))
        .layer(from_fn(telemetry::observe))
        .with_state(app)
}

/// Compresses answers for clients that accept it, but no event streams and no pictures. The fastest
/// level: robots wait for their beliefs.
fn compressed() -> CompressionLayer<impl Predicate> {
    let long = DefaultPredicate::new().and(SizeAbove::new(COMPRESSED_MIN));
    CompressionLayer::new().quality(CompressionLevel::Fastest).compress_when(long)
}

/// The dashboard, and the API's description and documentation.
fn pages() -> Router<App> {
    let pages = docs().route("/openapi.json", get(description));
    dashboard::paths().fold(pages, |pages, path| pages.route(path, get(file)))
}

/// The API's documentation: Swagger UI in a page of our own.
#[cfg(feature = "swagger")]
fn docs() -> Router<App> {
    use axum::extract::Path;
    use axum::http::StatusCode;
    use axum::response::{IntoResponse, Redirect};

    async fn named(name: Option<Path<String>>) -> Response {
        let name = name.map_or_else(String::new, |Path(name)| name);
        match openapi::reader::file(&name) {
            Some((content_type, bytes)) => dashboard::tagged(content_type, bytes),
            None => StatusCode::NOT_FOUND.into_response(),
        }
    }
    Router::new()
        .route("/docs", get(|| async { Redirect::to("/docs/") }))
        .route("/docs/", get(named))
        .route("/docs/{*name}", get(named))
}

/// The API's documentation: a plain list of operations.
#[cfg(not(feature = "swagger"))]
fn docs() -> Router<App> {
    async fn listing() -> Response {
        let page = openapi::listing::page().as_bytes();
        dashboard::tagged("text/html; charset=utf-8", page)
    }
    ["/docs", "/docs/"]
        .into_iter()
        .fold(Router::new(), |pages, path| pages.route(path, get(listing)))
}

async fn file(uri: Uri) -> Response {
    dashboard::answer(uri.path())
}

async fn description() -> Response {
    dashboard::tagged("application/json", openapi::text().as_bytes())
}
