//! Tests of browser headers and of requests from other sites.

use std::io::Read;

use palpate_server::{Access, Server, StartError};
use reqwest::Method;
use serde_json::json;

use crate::harness::{Answer, Harness, config, read};

async fn with(it: &Harness, method: Method, path: &str, headers: &[(&str, &str)]) -> Answer {
    let request = it.client.request(method, it.url(path));
    let add = |request: reqwest::RequestBuilder, (name, value): &(&str, &str)| {
        request.header(*name, *value)
    };
    read(headers.iter().fold(request, add).send().await.unwrap()).await
}

#[tokio::test(flavor = "multi_thread")]
async fn every_answer_has_security_headers() {
    let it = Harness::guarded().await;
    for path in ["/", "/livez", "/docs/", "/v1/objects", "/v1/nothing", "/v1/keys", "/metrics"] {
        for key in [it.key.as_deref(), None] {
            let answer = it.send_as(key, Method::GET, path).await;
            assert_eq!(answer.headers["x-content-type-options"], "nosniff", "{path}");
            assert_eq!(answer.headers["referrer-policy"], "no-referrer", "{path}");
            assert_eq!(answer.headers["x-frame-options"], "DENY", "{path}");
            let policy = answer.headers["content-security-policy"].to_str().unwrap();
            assert!(policy.starts_with("default-src 'none'"), "{path}: {policy}");
            assert!(policy.contains("frame-ancestors 'none'"), "{path}: {policy}");
            let inline = policy.contains("unsafe-inline");
            assert_eq!(inline, path.starts_with("/docs"), "{path}: {policy}");
            assert!(!policy.contains("script-src 'self' 'unsafe"), "{path}: {policy}");
            let secure = answer.headers.contains_key("strict-transport-security");
            assert!(!secure, "{path} is not behind TLS");
        }
    }
    for (path, cached) in [
        ("/v1/keys", "no-store"),
        ("/v1/whoami", "no-store"),
        ("/v1/audit", "no-store"),
        ("/v1/objects", "private, no-cache"),
    ] {
        assert_eq!(it.get(path).await.headers["cache-control"], cached, "{path}");
    }
    let created = it.post("/v1/keys", &json!({"name": "a", "role": "robot"})).await;
    assert_eq!(created.headers["cache-control"], "no-store");
    // The page has nothing inline that its policy would block.
    let page = it.get("/").await.text;
    assert!(!page.contains("<style") && !page.contains("<script>"), "{page}");
}

#[tokio::test(flavor = "multi_thread")]
async fn only_listed_sites_may_read_answers() {
    const LAB: &str = "https://lab.example";
    let it = Harness::start_with(|config| {
        config.access = Access::Keys;
        config.cors_origins = vec![LAB.to_owned(), "http://localhost:3000".to_owned()];
    })
    .await;
    let ask = [("access-control-request-method", "DELETE"), ("origin", LAB)];
    let preflight = with(&it, Method::OPTIONS, "/v1/objects/mug", &ask).await;
    assert_eq!(preflight.status, 200);
    assert_eq!(preflight.headers["access-control-allow-origin"], LAB);
    let allowed = preflight.headers["access-control-allow-headers"].to_str().unwrap();
    assert!(allowed.contains("authorization"), "{allowed}");
    assert!(!preflight.headers.contains_key("access-control-allow-credentials"));
    let refused = with(&it, Method::GET, "/v1/objects", &[("origin", LAB)]).await;
    refused.problem(401, "unauthenticated", None);
    assert_eq!(refused.headers["access-control-allow-origin"], LAB, "a page may read why");
    for other in ["https://evil.example", "http://lab.example", "null"] {
        let answer = with(&it, Method::GET, "/livez", &[("origin", other)]).await;
        assert!(!answer.headers.contains_key("access-control-allow-origin"), "{other}");
    }
    let closed = Harness::guarded().await;
    let preflight = with(&closed, Method::OPTIONS, "/v1/objects/mug", &ask).await;
    assert!(!preflight.headers.contains_key("access-control-allow-origin"));

    let folder = tempfile::TempDir::new().unwrap();
    let mut wrong = config(folder.path());
    wrong.cors_origins = vec!["*".to_owned()];
    let error = Server::start(wrong).await.unwrap_err();
    assert!(matches!(error, StartError::Origin { .. }), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn without_keys_requests_of_other_sites_are_refused() {
    let it = Harness::start_with(|config| {
        config.cors_origins = vec!["http://localhost:3000".to_owned()];
    })
    .await;
    let own = it.server.address();
    let [other_scheme, secure] = ["file", "https"].map(|scheme| own.replace("http", scheme));
    for (name, value, status) in [
        ("origin", own.as_str(), 200),
        ("origin", other_scheme.as_str(), 403),
        ("origin", secure.as_str(), 403),
        ("origin", "http://localhost:3000", 200),
        ("origin", "https://evil.example", 403),
        ("origin", "null", 403),
        ("host", "localhost:1", 200),
        ("host", "evil.example", 403),
    ] {
        let answer = with(&it, Method::GET, "/v1/objects", &[(name, value)]).await;
        assert_eq!(answer.status, status, "{name}: {value}: {answer:?}");
    }
    let close = "/v1/sessions/01890000-0000-7000-8000-000000000000/close";
    let forged = with(&it, Method::POST, close, &[("origin", "https://evil.example")]).await;
    forged.problem(403, "forbidden", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn long_answers_are_compressed_for_those_who_accept_it() {
    let it = Harness::trained().await;
    let accepting = [("accept-encoding", "gzip")];
    for path in ["/openapi.json", "/assets/app.js"] {
        let plain = it.client.get(it.url(path)).send().await.unwrap();
        assert!(!plain.headers().contains_key("content-encoding"), "{path}");
        let whole = plain.bytes().await.unwrap();
        let request = it.client.get(it.url(path)).header("accept-encoding", "gzip");
        let short = request.send().await.unwrap();
        assert_eq!(short.headers()["content-encoding"], "gzip", "{path}");
        assert!(short.headers()["vary"].to_str().unwrap().contains("accept-encoding"), "{path}");
        let sent = short.bytes().await.unwrap();
        assert!(2 * sent.len() < whole.len(), "{path}: {} of {}", sent.len(), whole.len());
        let mut unpacked = Vec::new();
        flate2::read::GzDecoder::new(&*sent).read_to_end(&mut unpacked).unwrap();
        assert!(unpacked == whole, "{path}");
    }
    let short = with(&it, Method::GET, "/livez", &accepting).await;
    assert!(!short.headers.contains_key("content-encoding"));
    let path = format!("/v1/events?sessions={}", it.session(json!({})).await);
    let request = it.client.get(it.url(&path)).header("accept-encoding", "gzip");
    let stream = request.send().await.unwrap();
    assert_eq!(stream.headers()["content-type"], "text/event-stream");
    assert!(!stream.headers().contains_key("content-encoding"));
}
