//! Tests of webhooks: which events are sent and how often, retries and redelivery, and roles.

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use palpate_core::pose::Pose;
use palpate_server::Config;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, quiet_reading, touches};
use crate::receiver::{Receiver, SECRET};

/// A box unlike the trained ones (mm).
const DISC: [f64; 3] = [110.0, 70.0, 8.0];

/// A server that may send to this machine, and repeats soon.
pub(crate) fn here(config: &mut Config) {
    config.webhook_allow_private = true;
    config.webhook_pauses = vec![Duration::from_millis(20); 3];
}

/// A server that does not repeat.
fn once(config: &mut Config) {
    config.webhook_allow_private = true;
    config.webhook_pauses = Vec::new();
}

async fn deliveries(it: &Harness, hook: &str) -> Vec<Value> {
    let page = it.get(&format!("/v1/webhooks/{hook}/deliveries")).await.expect(200);
    page["items"].as_array().unwrap().clone()
}

/// Waits until no delivery waits; the deliveries.
async fn settled(it: &Harness, hook: &str) -> Vec<Value> {
    for _ in 0..600 {
        let shown = it.get(&format!("/v1/webhooks/{hook}")).await.expect(200);
        if shown["n_waiting"] == 0 {
            return deliveries(it, hook).await;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    panic!("deliveries still wait: {:?}", deliveries(it, hook).await)
}

pub(crate) async fn test(it: &Harness, hook: &str) -> Value {
    it.send(Method::POST, &format!("/v1/webhooks/{hook}/test"), None).await.expect(200)
}

async fn touch(it: &Harness, session: &str, size: [f64; 3], n: usize, seed: u64) -> Value {
    let readings = touches(size, n, seed, Pose::IDENTITY);
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &json!({"readings": readings})).await.expect(200)
}

fn types(deliveries: &[Value]) -> Vec<&str> {
    deliveries.iter().map(|one| one["type"].as_str().unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_decision_is_told_once_signed_also_after_a_restart() {
    let it = Harness::trained_with(here).await;
    let mut receiver = Receiver::start().await;
    let (hook, secret) = receiver.subscribe(&it, &["session.decided", "session.unknown"]).await;
    let session = it.session(json!({"risk": 0.2})).await;
    let answer = touch(&it, &session, BAR, 12, 5).await;
    assert_eq!(answer["belief"]["stop"]["reached"], true, "{answer}");

    let came = receiver.next().await;
    assert!(came.is_signed_by(&secret) && !came.is_signed_by(SECRET), "{came:?}");
    let event = came.json();
    assert_eq!((&event["id"], &event["type"]), (&json!(came.id), &json!("session.decided")));
    assert_eq!(event["data"]["session"]["id"], json!(session));
    let belief = &event["data"]["belief"];
    assert_eq!(belief["objects"].as_array().unwrap().len(), 1);
    assert_eq!(belief["objects"][0], answer["belief"]["objects"][0]);
    assert_eq!(belief["objects"][0]["name"], "bar");
    assert_eq!(belief["poses"].as_array().unwrap().len(), 1);
    assert_eq!(belief["poses"][0]["name"], "bar");

    touch(&it, &session, BAR, 3, 6).await;
    assert_eq!(types(&settled(&it, &hook).await), ["session.decided"]);
    let it = it.restart_with(here).await;
    touch(&it, &session, BAR, 3, 7).await;
    // The server forms the beliefs of open sessions again; this one is told after that.
    let other = it.session(json!({"risk": 0.2})).await;
    touch(&it, &other, BAR, 12, 8).await;
    assert_eq!(receiver.next().await.json()["data"]["session"]["id"], json!(other));
    let told = settled(&it, &hook).await;
    assert_eq!(types(&told), ["session.decided"; 2]);
    assert_eq!((&told[1]["id"], &told[1]["state"]), (&json!(came.id), &json!("delivered")));
    assert_eq!(told[1]["body"], json!(came.body));
}

#[tokio::test(flavor = "multi_thread")]
async fn an_unknown_object_is_told_and_that_somebody_is_needed() {
    let it = Harness::trained_with(here).await;
    let mut receiver = Receiver::start().await;
    let events = ["session.unknown", "session.needs_attention"];
    let (hook, _) = receiver.subscribe(&it, &events).await;
    // What nobody subscribed to is not told.
    let decided = it.session(json!({"risk": 0.2})).await;
    touch(&it, &decided, BAR, 12, 5).await;
    let session = it.session(json!({"risk": 0.2})).await;
    touch(&it, &session, DISC, 10, 5).await;
    let both = [receiver.next().await.json(), receiver.next().await.json()];
    let found: BTreeSet<&str> = both.iter().map(|one| one["type"].as_str().unwrap()).collect();
    assert_eq!(found, events.into());
    for event in &both {
        assert_eq!(event["data"]["session"]["id"], json!(session), "{event}");
        match event["type"].as_str().unwrap() {
            "session.unknown" => assert_eq!(event["data"]["belief"]["poses"], json!([])),
            _ => assert_eq!(event["data"]["attention"]["level"], "surprising"),
        }
    }
    // The watch looks again after a restart, and both alarms still hold.
    let it = it.restart_with(here).await;
    let snapshot = receiver.subscribe(&it, &["session.needs_attention"]).await.0;
    let again = it.session(json!({})).await;
    touch(&it, &again, DISC, 10, 6).await;
    for _ in 0..2 {
        assert_eq!(receiver.next().await.json()["data"]["session"]["id"], json!(again));
    }
    assert_eq!(settled(&it, &hook).await.len(), 3);
    assert_eq!(settled(&it, &snapshot).await.len(), 1, "older alarms are not for a new webhook");
}

#[tokio::test(flavor = "multi_thread")]
async fn failed_attempts_are_repeated_under_one_id() {
    let it = Harness::start_with(here).await;
    let mut receiver = Receiver::start().await;
    let (hook, secret) = receiver.subscribe(&it, &["snapshot.made"]).await;
    receiver.answer(&[500, 302]);
    it.send_as(None, Method::POST, "/v1/snapshots").await;
    let came = [receiver.next().await, receiver.next().await, receiver.next().await];
    assert!(came.iter().all(|one| one.id == came[0].id && one.body == came[0].body));
    assert!(came.iter().all(|one| one.is_signed_by(&secret)));
    assert!(came[0].json()["data"]["snapshot"]["bytes"].as_u64().unwrap() > 1000);
    let told = settled(&it, &hook).await;
    let attempts = told[0]["attempts"].as_array().unwrap();
    let statuses: Vec<_> = attempts.iter().map(|one| one["status"].as_u64().unwrap()).collect();
    assert_eq!((&told[0]["state"], statuses), (&json!("delivered"), vec![500, 302, 200]));
    assert!(attempts[1]["error"].as_str().unwrap().contains("redirects"), "{attempts:?}");
    assert_eq!(attempts[2]["error"], Value::Null);
    let shown = it.get(&format!("/v1/webhooks/{hook}")).await.expect(200);
    assert_eq!(shown["failing_since"], Value::Null);
    assert!(shown["last_delivered_at"].is_string());
    let metrics = it.get("/metrics").await.text;
    assert!(metrics.contains("palpate_webhook_attempts_total{outcome=\"failed\"}"), "{metrics}");
    assert!(metrics.contains("palpate_webhook_oldest_waiting_seconds"));
}

#[tokio::test(flavor = "multi_thread")]
async fn abandoned_deliveries_are_delivered_again_on_request() {
    let it = Harness::start_with(once).await;
    let mut receiver = Receiver::start().await;
    let (hook, _) = receiver.subscribe(&it, &["snapshot.made"]).await;
    receiver.answer(&[503]);
    it.send_as(None, Method::POST, "/v1/snapshots").await;
    let came = receiver.next().await;
    let told = settled(&it, &hook).await;
    assert_eq!(
        (&told[0]["state"], &told[0]["next_attempt_at"]),
        (&json!("abandoned"), &Value::Null)
    );
    let path = format!("/v1/webhooks/{hook}");
    let failing = it.get(&path).await.expect(200);
    assert_eq!(failing["failing_since"], told[0]["attempts"][0]["at"]);
    assert_eq!(failing["enabled"], true);

    let one = format!("{path}/deliveries/{}", came.id);
    let due = it.send(Method::POST, &format!("{one}/redeliver"), None).await.expect(200);
    assert_eq!(due["state"], "pending");
    assert_eq!(receiver.next().await.id, came.id);
    settled(&it, &hook).await;
    let shown = it.get(&one).await.expect(200);
    assert_eq!(
        (&shown["state"], shown["attempts"].as_array().unwrap().len()),
        (&json!("delivered"), 2)
    );
    assert_eq!(it.get(&path).await.expect(200)["failing_since"], Value::Null);
    let unknown = format!("{path}/deliveries/{}/redeliver", uuid());
    it.send(Method::POST, &unknown, None).await.problem(404, "not-found", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_receiver_that_is_gone_gets_no_more() {
    let it = Harness::start_with(here).await;
    let receiver = Receiver::start().await;
    let (hook, _) = receiver.subscribe(&it, &["snapshot.made"]).await;
    receiver.answer(&[410]);
    let sent = test(&it, &hook).await;
    assert_eq!(
        (&sent["state"], &sent["attempts"][0]["status"]),
        (&json!("abandoned"), &json!(410))
    );
    let path = format!("/v1/webhooks/{hook}");
    let shown = it.get(&path).await.expect(200);
    assert_eq!(shown["enabled"], false);
    assert_eq!(shown["disabled_reason"], "the receiver answered 410 Gone");
    for action in
        ["test".to_owned(), format!("deliveries/{}/redeliver", sent["id"].as_str().unwrap())]
    {
        let refused = it.send(Method::POST, &format!("{path}/{action}"), None).await;
        refused.problem(409, "wrong-state", None);
    }
    it.send_as(None, Method::POST, "/v1/snapshots").await;
    let body = Some(("application/json", json!({"enabled": true}).to_string().into_bytes()));
    let enabled = it.send(Method::PATCH, &path, body).await.expect(200);
    assert_eq!(
        (&enabled["disabled_reason"], &enabled["failing_since"]),
        (&Value::Null, &Value::Null)
    );
    assert_eq!(test(&it, &hook).await["state"], "delivered");
    assert_eq!(types(&deliveries(&it, &hook).await), ["ping", "ping"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn deliveries_that_wait_survive_a_restart() {
    let patient = |config: &mut Config| {
        here(config);
        config.webhook_pauses = vec![Duration::from_millis(500); 20];
    };
    let it = Harness::start_with(patient).await;
    let receiver = Receiver::start().await;
    receiver.answer(&[500; 1000]);
    let (hook, secret) = receiver.subscribe(&it, &["snapshot.made"]).await;
    it.send_as(None, Method::POST, "/v1/snapshots").await;
    let mut receiver = receiver;
    let first = receiver.next().await;
    let it = it.restart_with(patient).await;
    let waiting = deliveries(&it, &hook).await;
    assert_eq!((waiting.len(), &waiting[0]["id"]), (1, &json!(first.id)));
    let body = json!({"url": "http://127.0.0.1:1/hook"}).to_string().into_bytes();
    let path = format!("/v1/webhooks/{hook}");
    it.send(Method::PATCH, &path, Some(("application/json", body))).await.expect(200);
    let mut other = Receiver::start().await;
    let body = json!({"url": other.url()}).to_string().into_bytes();
    it.send(Method::PATCH, &path, Some(("application/json", body))).await.expect(200);
    let came = other.next().await;
    assert_eq!((&came.id, &came.body), (&first.id, &first.body));
    assert!(came.is_signed_by(&secret));
    assert_eq!(settled(&it, &hook).await[0]["state"], "delivered");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_slow_receiver_delays_only_itself() {
    let it = Harness::start_with(here).await;
    let slow = Receiver::start_at("127.0.0.1:0".parse().unwrap(), Duration::from_secs(60)).await;
    let mut quick = Receiver::start().await;
    let (slow, _) = slow.subscribe(&it, &["snapshot.made"]).await;
    let (hook, _) = quick.subscribe(&it, &["snapshot.made"]).await;
    for _ in 0..3 {
        it.send_as(None, Method::POST, "/v1/snapshots").await;
    }
    for _ in 0..3 {
        quick.next().await;
    }
    assert_eq!(settled(&it, &hook).await.len(), 3);
    let waiting = it.get(&format!("/v1/webhooks/{slow}")).await.expect(200);
    assert_eq!(waiting["n_waiting"], 3);
    // An attempt ends by itself.
    let sent = test(&it, &slow).await;
    assert_eq!(sent["attempts"][0]["error"], "no answer within 10 s");
}

#[tokio::test(flavor = "multi_thread")]
async fn trainings_are_told_with_their_version() {
    let it = Harness::start_with(here).await;
    let mut receiver = Receiver::start().await;
    let (hook, _) = receiver.subscribe(&it, &["training.finished"]).await;
    let job = it.train().await;
    let event = receiver.next().await.json();
    let told = &event["data"]["job"];
    for field in ["id", "catalogue", "state", "version", "finished_at"] {
        assert_eq!(told[field], job[field], "{field}");
    }
    // A start tells trainings again that a crash may have kept from being told.
    let it = it.restart_with(here).await;
    assert_eq!(types(&settled(&it, &hook).await), ["training.finished"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reading_does_not_wait_for_a_webhook() {
    let it = Harness::trained_with(here).await;
    let slow = Receiver::start_at("127.0.0.1:0".parse().unwrap(), Duration::from_secs(60)).await;
    slow.subscribe(&it, &["session.decided", "session.needs_attention"]).await;
    let session = it.session(json!({"risk": 0.2})).await;
    let before = Instant::now();
    touch(&it, &session, BAR, 12, 5).await;
    let path = format!("/v1/sessions/{session}/readings");
    let twelve = before.elapsed();
    let begun = Instant::now();
    it.post(&path, &json!({"readings": [quiet_reading()]})).await.expect(200);
    // An attempt takes ten seconds. On a slow machine a reading takes less than twelve before it.
    assert!(begun.elapsed() < twelve.max(Duration::from_secs(10)));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_decision_before_a_close_and_a_stop_is_told() {
    let it = Harness::trained_with(here).await;
    let mut receiver = Receiver::start().await;
    receiver.subscribe(&it, &["session.decided"]).await;
    let session = it.session(json!({"risk": 0.2})).await;
    touch(&it, &session, BAR, 12, 5).await;
    it.post(&format!("/v1/sessions/{session}/close"), &json!({})).await.expect(200);
    let _it = it.restart_with(here).await;
    assert_eq!(receiver.next().await.json()["data"]["session"]["id"], json!(session));
}

fn uuid() -> &'static str {
    "00000000-0000-0000-0000-000000000001"
}
