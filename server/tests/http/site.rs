//! Tests of health, documentation, and errors that the framework would answer in plain text.

use reqwest::header::HeaderValue;
use reqwest::{Method, StatusCode};
use serde_json::json;

use crate::harness::Harness;

/// Files of the documentation, which a build with the feature `swagger` has.
const SWAGGER: &[&str] = &["swagger-ui-bundle.js", "swagger-ui.css", "palpate.js", "palpate.css"];

#[tokio::test(flavor = "multi_thread")]
async fn health_documentation_and_metrics_are_served() {
    let it = Harness::start().await;
    assert_eq!(it.get("/livez").await.expect(200)["alive"], true);
    let ready = it.get("/readyz").await.expect(200);
    assert_eq!(ready["ready"], true, "{ready}");
    assert_eq!(it.get("/version").await.expect(200)["api"], "v1");
    let described = it.get("/openapi.json").await;
    assert_eq!(described.text, palpate_server::openapi::text());
    let docs = it.get("/docs/").await;
    assert_eq!(docs.status, 200);
    let shown = if cfg!(feature = "swagger") { "palpate.js" } else { "/v1/sessions/{session}" };
    assert!(docs.text.contains(shown), "{}", docs.text);
    let parts = if cfg!(feature = "swagger") { SWAGGER } else { &[] };
    for part in parts {
        let text = it.get(&format!("/docs/{part}")).await.text;
        assert!(!text.is_empty() && !text.contains("//cdn") && !text.contains("unpkg"), "{part}");
    }
    let page = it.get("/").await;
    assert_eq!(page.headers["content-type"], "text/html; charset=utf-8");
    for path in ["/assets/app.js", "/assets/app.css"] {
        assert!(page.text.contains(path), "{}", page.text);
        let file = it.get(path).await;
        assert_eq!(
            (file.status, &file.headers["cache-control"]),
            (StatusCode::OK, &HeaderValue::from_static("no-cache"))
        );
        let known = it.client.get(it.url(path)).header("if-none-match", &file.headers["etag"]);
        assert_eq!(known.send().await.unwrap().status(), 304, "{path}");
    }
    let figures = it.get("/metrics").await.text;
    assert!(figures.contains("palpate_http_requests_total"), "{figures}");
    for typed in figures.lines().filter_map(|line| line.strip_prefix("# TYPE ")) {
        let name = typed.split(' ').next().unwrap();
        let help = format!("# HELP {name} ");
        assert!(figures.lines().any(|line| line.len() > help.len() && line.starts_with(&help)));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn errors_of_the_framework_are_problems_too() {
    let it = Harness::start().await;
    it.get("/v1/nothing").await.problem(404, "not-found", None);
    it.get("/docs/nothing.js").await.problem(404, "not-found", None);
    let wrong = it.send(Method::DELETE, "/v1/sensors", None).await;
    wrong.problem(405, "method-not-allowed", None);
    assert!(wrong.headers["allow"].to_str().unwrap().contains("GET"));
    let text = Some(("text/plain", b"{}".to_vec()));
    let wrong = it.send(Method::POST, "/v1/objects", text).await;
    wrong.problem(415, "unsupported-media-type", Some("header:content-type"));
    let bare = it.send(Method::POST, "/v1/objects", None).await;
    bare.problem(415, "unsupported-media-type", None);
    let escaped = it.get("/v1/objects/%ff").await;
    escaped.problem(400, "malformed-request", None);
    it.get("/v1/objects?limit=0").await.problem(422, "invalid-value", Some("?limit"));
    it.get("/v1/objects?limit=ten").await.problem(422, "invalid-value", Some("?limit"));
    it.get("/v1/objects?limits=1").await.problem(422, "invalid-value", Some("?limits"));
    it.get("/v1/objects?cursor=x").await.problem(422, "invalid-value", Some("?cursor"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_valid_request_id_is_kept_and_others_are_replaced() {
    let it = Harness::start().await;
    for (given, is_kept) in [("robot-7:41", true), ("a b", false), (&"x".repeat(65), false)] {
        let request = it.client.get(it.url("/livez")).header("x-request-id", given);
        let answer = request.send().await.unwrap();
        assert_eq!(answer.headers()["x-request-id"] == given, is_kept, "{given}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_above_the_limit_are_refused() {
    let it = Harness::start_with(|config| config.requests_max = 0).await;
    let refused = it.get("/v1/objects").await;
    refused.problem(503, "overloaded", None);
    assert_eq!(refused.headers["retry-after"], "1");
    it.get("/livez").await.expect(200);
    let body = json!({"name": "mug"});
    it.post("/v1/objects", &body).await.problem(503, "overloaded", None);
}
