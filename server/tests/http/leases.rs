//! Tests of session expiry: idle sessions expire, leases keep them open, and the end is final.

use std::time::Duration;

use palpate_core::pose::Pose;
use serde_json::{Value, json};

use crate::harness::{CUBE, Harness, touches};

/// Longer than the time to live of the sessions here, and the following sweep.
const LONG: Duration = Duration::from_millis(2600);

fn reading() -> Value {
    json!({"readings": touches(CUBE, 1, 5, Pose::IDENTITY)})
}

async fn ids(it: &Harness, query: &str) -> Vec<String> {
    let (mut ids, mut path) = (Vec::new(), format!("/v1/sessions?limit=2{query}"));
    loop {
        let page = it.get(&path).await.expect(200);
        let items = page["items"].as_array().unwrap();
        ids.extend(items.iter().map(|item| item["id"].as_str().unwrap().to_owned()));
        let Some(cursor) = page["next_cursor"].as_str() else { return ids };
        path = format!("/v1/sessions?limit=2{query}&cursor={cursor}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_expires_and_a_lease_keeps_one_open() {
    let it = Harness::trained().await;
    let short = it.session(json!({"ttl_s": 1})).await;
    let leased = it.session(json!({"ttl_s": 1})).await;
    let usual = it.session(json!({})).await;
    it.post(&format!("/v1/sessions/{short}/readings"), &reading()).await.expect(200);
    let lease = format!("/v1/sessions/{leased}/lease");
    let first = it.post(&lease, &json!({"seconds": 600})).await.expect(200);
    let second = it.post(&lease, &json!({"seconds": 5})).await.expect(200);
    assert_eq!(first["leased_until"], second["leased_until"], "a lease is never shortened");
    assert_eq!(first["expires_at"], first["leased_until"]);
    for (body, pointer) in
        [(json!({"seconds": 0}), "/seconds"), (json!({"minutes": 3}), "/minutes")]
    {
        it.post(&lease, &body).await.problem(422, "invalid-value", Some(pointer));
    }
    let events = it.client.get(it.url(&format!("/v1/sessions/{short}/events"))).send();
    let events = events.await.unwrap();
    tokio::time::sleep(LONG).await;

    let told = events.text().await.unwrap();
    assert!(told.contains("event: closed"), "followers are told, and the stream ends: {told}");
    let path = format!("/v1/sessions/{short}");
    for (path, body) in [
        (format!("{path}/readings"), reading()),
        (format!("{path}/lease"), json!({"seconds": 60})),
        (format!("{path}/next-touches"), json!({"sensor": "digitacts-6x6"})),
    ] {
        let gone = it.post(&path, &body).await.problem(410, "session-ended", None);
        let why = gone["detail"].as_str().unwrap();
        assert!(why.contains("expired at 20") && why.contains("time to live"), "{gone}");
    }
    assert_eq!(it.get(&format!("{path}/belief")).await.expect(200)["n_readings"], 1);
    let known = it.get(&path).await.expect(200);
    assert_eq!((&known["state"], &known["ended"]), (&json!("closed"), &json!("expired")));
    it.post(&format!("/v1/sessions/{leased}/readings"), &reading()).await.expect(200);
    assert_eq!(ids(&it, "&state=open").await, [leased.as_str(), &usual]);
    assert_eq!(ids(&it, "&state=closed").await, [short.as_str()]);
    assert_eq!(ids(&it, "").await, [short.as_str(), &leased, &usual]);

    let it = it.restart().await;
    assert_eq!(ids(&it, "&state=open").await, [leased.as_str(), &usual]);
    let usual = it.get(&format!("/v1/sessions/{usual}")).await.expect(200);
    assert_eq!(usual["ttl_s"], 86_400, "the server's own bound");
}

#[tokio::test(flavor = "multi_thread")]
async fn ended_sessions_are_deleted_when_configured() {
    let it = Harness::trained_with(|config| {
        config.session_kept = Some(Duration::from_millis(400));
    })
    .await;
    let (closed, expired) = (it.session(json!({})).await, it.session(json!({"ttl_s": 1})).await);
    let open = it.session(json!({})).await;
    for session in [&closed, &open] {
        it.post(&format!("/v1/sessions/{session}/readings"), &reading()).await.expect(200);
    }
    it.post(&format!("/v1/sessions/{closed}/close"), &json!({})).await.expect(200);
    while ids(&it, "").await.len() > 1 {
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert_eq!(ids(&it, "").await, [open.as_str()]);
    for gone in [&closed, &expired] {
        it.get(&format!("/v1/sessions/{gone}")).await.problem(404, "not-found", None);
        it.get(&format!("/v1/sessions/{gone}/readings")).await.problem(404, "not-found", None);
    }
    // After a restart without the setting nothing is deleted.
    it.post(&format!("/v1/sessions/{open}/close"), &json!({})).await.expect(200);
    let it = it.restart_with(|config| config.session_kept = None).await;
    assert_eq!(it.get(&format!("/v1/sessions/{open}")).await.expect(200)["n_readings"], 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_number_of_open_sessions_is_limited() {
    let it = Harness::trained_with(|config| config.sessions_open_max = 2).await;
    let first = it.session(json!({"ttl_s": 500})).await;
    let short = it.session(json!({"ttl_s": 2})).await;
    let full = it.post("/v1/sessions", &json!({})).await;
    full.problem(429, "too-many-requests", None);
    assert_eq!(full.headers["ratelimit-policy"], "\"sessions\";q=2;qu=\"sessions\"");
    assert_eq!(full.headers["ratelimit"], "\"sessions\";r=0;t=1");
    let wait: u64 = full.headers["retry-after"].to_str().unwrap().parse().unwrap();
    assert!((1..=2).contains(&wait), "the soonest end: {wait}");
    it.post(&format!("/v1/sessions/{first}/close"), &json!({})).await.expect(200);
    let third = it.session(json!({})).await;
    it.post("/v1/sessions", &json!({})).await.problem(429, "too-many-requests", None);
    tokio::time::sleep(LONG).await;
    let fourth = it.session(json!({})).await;
    assert_eq!(ids(&it, "&state=open").await, [third.as_str(), &fourth], "{short} expired");
    // Open sessions stay open after a restart, and count.
    let it = it.restart_with(|config| config.sessions_open_max = 2).await;
    it.post("/v1/sessions", &json!({})).await.problem(429, "too-many-requests", None);
}
