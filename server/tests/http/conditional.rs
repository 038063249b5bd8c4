//! Tests of conditional requests, on every route whose answers have an `ETag`.
//!
//! The routes come from the API's description: one whose answer has a tag without saying so, or
//! says so without having one, fails here.

use palpate_core::pose::Pose;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{Answer, BAR, Harness, read, touches};

/// A route with an example of its path.
struct Route {
    path: String,
    is_tagged: bool,
}

/// Every GET of the description, filled with what exists on the server; none that streams.
async fn routes(it: &Harness) -> Vec<Route> {
    let document: Value = serde_json::from_str(palpate_server::openapi::text()).unwrap();
    let session = it.session(json!({})).await;
    let readings = json!({"readings": touches(BAR, 3, 5, Pose::IDENTITY)});
    it.post(&format!("/v1/sessions/{session}/readings"), &readings).await.expect(200);
    let mut found = Vec::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        let given = &item["get"]["responses"]["200"];
        if given.is_null() || given["content"].get("text/event-stream").is_some() {
            continue;
        }
        let is_tagged = given["headers"].get("etag").is_some();
        let unchanged = &item["get"]["responses"]["304"];
        assert_eq!(unchanged["headers"].get("etag").is_some(), is_tagged, "{path}: 304");
        let path = path
            .replace("{session}", &session)
            .replace("{object}", "bar")
            .replace("{version}", "1")
            .replace("{name}", "default");
        if !path.contains('{') {
            found.push(Route { path, is_tagged });
        }
    }
    found
}

async fn ask(it: &Harness, method: Method, path: &str, known: &[String]) -> Answer {
    let request = it.client.request(method, it.url(path));
    let request = known.iter().fold(request, |request, line| request.header("if-none-match", line));
    read(request.send().await.unwrap()).await
}

#[tokio::test(flavor = "multi_thread")]
async fn every_tagged_answer_is_sent_only_when_changed() {
    let it = Harness::trained().await;
    let mut tagged = 0;
    let pages = ["/", "/openapi.json", "/assets/app.js", "/docs/"];
    let pages = pages.map(|path| Route { path: path.to_owned(), is_tagged: true });
    for Route { path, is_tagged } in routes(&it).await.into_iter().chain(pages) {
        let first = ask(&it, Method::GET, &path, &[]).await;
        if first.status != 200 {
            continue;
        }
        let tag = first.headers.get("etag").map(|tag| tag.to_str().unwrap().to_owned());
        assert_eq!(tag.is_some(), is_tagged, "{path}");
        let Some(tag) = tag else { continue };
        tagged += 1;
        for known in [
            &[tag.clone()][..],
            &[format!("W/{tag}")],
            &[format!("\"x\", {tag}")],
            &[format!("{tag},\"x,y\"")],
            &["\"x\"".to_owned(), tag.clone()],
            &["*".to_owned()],
        ] {
            for method in [Method::GET, Method::HEAD] {
                let again = ask(&it, method, &path, known).await;
                assert_eq!(again.status, 304, "{path} with {known:?}");
                assert_eq!(again.text, "", "{path}");
                for header in ["etag", "cache-control"] {
                    let (given, now) = (first.headers.get(header), again.headers.get(header));
                    assert_eq!(now, given, "{path}: {header}");
                }
            }
        }
        for known in [&["\"x\"".to_owned()][..], &["W/\"y\", \"z\"".to_owned()], &[String::new()]] {
            assert_eq!(ask(&it, Method::GET, &path, known).await.text, first.text, "{path}");
        }
    }
    // The belief, a catalogue's current version, the thumbnail, three maps and the pages at least.
    assert!(tagged >= 7, "{tagged} tagged routes were reached");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_change_may_expect_one_of_several_tags() {
    let it = Harness::trained().await;
    let put = async |expected: &str| {
        let request = it.client.put(it.url("/v1/catalogues/default/current"));
        let request = request.header("if-match", expected).json(&json!({"version": 1}));
        read(request.send().await.unwrap()).await
    };
    let path = "/v1/catalogues/default/current";
    let tag = async || it.get(path).await.headers["etag"].to_str().unwrap().to_owned();
    for expected in [format!("\"x\", {}", tag().await), "*".to_owned()] {
        put(&expected).await.expect(200);
    }
    put("\"97\", \"98\"").await.problem(412, "precondition-failed", Some("header:if-match"));
    put("\"x\"").await.problem(422, "invalid-value", Some("header:if-match"));
}
