//! Security headers for browsers.
//!
//! Answers of the API may not be run, framed or kept by others; pages may load files of this
//! server and nothing else. The documentation page styles itself inline, so it has its own
//! policy. Pages of other sites may read answers only if an operator lists them.

use std::str::FromStr as _;
use std::time::Duration;

use axum::extract::{Request, State};
use axum::http::{HeaderName, HeaderValue, Method, Uri, header};
use axum::middleware::Next;
use axum::response::Response;
use tower_http::cors::CorsLayer;

use crate::app::App;
use crate::middleware::telemetry::REQUEST_ID;

/// Policy of the API's answers: nothing in them is to be run or shown in a frame.
const API_POLICY: &str = "default-src 'none'; frame-ancestors 'none'";
/// Policy of pages: their own files and this server, and nothing inline.
const PAGE_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; \
    img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; manifest-src 'self'; \
    base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// Policy of the documentation page, whose script writes styles into its elements.
const DOCS_POLICY: &str = "default-src 'none'; script-src 'self'; \
    style-src 'self' 'unsafe-inline'; img-src 'self' data:; font-src 'self' data:; \
    connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// One year of TLS only.
const TRANSPORT: &str = "max-age=31536000";
/// Time for which a browser may cache permissions of other sites' pages, in seconds.
const PREFLIGHT: Duration = Duration::from_secs(3600);

/// Sets the headers of every answer.
pub(crate) async fn secure(State(app): State<App>, request: Request, next: Next) -> Response {
    let path = request.uri().path().to_owned();
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    let mut set = |name: HeaderName, value: &'static str| {
        headers.insert(name, HeaderValue::from_static(value));
    };
    set(header::X_CONTENT_TYPE_OPTIONS, "nosniff");
    set(header::REFERRER_POLICY, "no-referrer");
    set(header::X_FRAME_OPTIONS, "DENY");
    set(header::CONTENT_SECURITY_POLICY, policy(&path));
    set(HeaderName::from_static("cross-origin-opener-policy"), "same-origin");
    set(HeaderName::from_static("cross-origin-resource-policy"), "same-origin");
    if app.config.tls.is_some() {
        set(header::STRICT_TRANSPORT_SECURITY, TRANSPORT);
    }
    if let Some(cached) = cached(&path) {
        headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static(cached));
    }
    response
}

/// Permits pages of the configured origins to read answers; `None` when there are none.
pub(crate) fn cors(origins: &[String]) -> Option<CorsLayer> {
    let origins: Vec<_> =
        origins.iter().filter_map(|origin| HeaderValue::from_str(origin).ok()).collect();
    let last_event_id = HeaderName::from_static("last-event-id");
    let sent = [
        header::AUTHORIZATION,
        header::CONTENT_TYPE,
        header::IF_MATCH,
        header::IF_NONE_MATCH,
        last_event_id,
        REQUEST_ID,
    ];
    let read = [
        header::ALLOW,
        header::ETAG,
        header::LOCATION,
        header::RETRY_AFTER,
        header::WWW_AUTHENTICATE,
        HeaderName::from_static("ratelimit"),
        HeaderName::from_static("ratelimit-policy"),
        REQUEST_ID,
    ];
    (!origins.is_empty()).then(|| {
        CorsLayer::new()
            .allow_origin(origins)
            .allow_methods([Method::GET, Method::POST, Method::PUT, Method::PATCH, Method::DELETE])
            .allow_headers(sent)
            .expose_headers(read)
            .max_age(PREFLIGHT)
    })
}

/// Whether a text is an origin as sent by browsers: scheme, host, and a port unless it is the
/// scheme's own.
#[must_use]
pub(crate) fn is_origin(text: &str) -> bool {
    let Some((scheme, authority)) = text.split_once("://") else { return false };
    let is_plain = !authority.contains(['/', '@', '?', '#', '*', ' ']);
    let is_lower = text.bytes().all(|byte| !byte.is_ascii_uppercase());
    let own_port = if scheme == "https" { ":443" } else { ":80" };
    let parses = Uri::from_str(text).is_ok_and(|uri| uri.host().is_some_and(|h| !h.is_empty()));
    matches!(scheme, "http" | "https")
        && is_plain
        && is_lower
        && parses
        && !authority.ends_with(own_port)
}

fn policy(path: &str) -> &'static str {
    match path {
        "/docs" => DOCS_POLICY,
        path if path.starts_with("/docs/") => DOCS_POLICY,
        "/" => PAGE_POLICY,
        _ => API_POLICY,
    }
}

/// Default caching of the API's answers: none if they hold secrets or their holders,
/// otherwise by the client alone, which must revalidate.
fn cached(path: &str) -> Option<&'static str> {
    let secret = ["/v1/keys", "/v1/whoami", "/v1/audit"];
    if secret.iter().any(|secret| path.starts_with(secret)) {
        return Some("no-store");
    }
    path.starts_with("/v1/").then_some("private, no-cache")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn origins_have_the_form_that_browsers_send() {
        for origin in ["https://lab.example", "http://localhost:3000", "http://[::1]:8080"] {
            assert!(is_origin(origin), "{origin}");
        }
        for wrong in [
            "*",
            "null",
            "lab.example",
            "https://lab.example/",
            "https://*.example",
            "https://",
            "ftp://lab.example",
            "https://Lab.example",
            "https://lab.example:443",
            "http://lab.example:80",
            "https://u@lab.example",
        ] {
            assert!(!is_origin(wrong), "{wrong}");
        }
    }
}
