//! Bounds and rules of webhooks: addresses, URLs and secrets, the history's length, rotation.

use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::Harness;
use crate::receiver::{Receiver, SECRET};
use crate::webhooks::{here, test};

#[tokio::test(flavor = "multi_thread")]
async fn addresses_of_private_networks_are_refused_by_default() {
    let it = Harness::start().await;
    let events = ["snapshot.made"];
    for url in
        ["https://127.0.0.1/x", "https://10.0.0.7/x", "http://mes.example/x", "https://[::1]/"]
    {
        let answer = it.post("/v1/webhooks", &json!({"url": url, "events": events})).await;
        let problem = answer.problem(422, "invalid-value", Some("/url"));
        let detail = problem["errors"][0]["detail"].as_str().unwrap();
        assert!(detail.contains("--webhook-allow-private"), "{detail}");
    }
    // A name is resolved when something is sent.
    let named = json!({"url": "https://localhost:9/x", "events": events});
    let made = it.post("/v1/webhooks", &named).await.expect(201);
    let sent = test(&it, made["webhook"]["id"].as_str().unwrap()).await;
    let error = sent["attempts"][0]["error"].as_str().unwrap();
    assert!(error.contains("--webhook-allow-private"), "{error}");

    let it = it.restart_with(here).await;
    let metadata = json!({"url": "http://169.254.169.254/latest", "events": events});
    it.post("/v1/webhooks", &metadata).await.problem(422, "invalid-value", Some("/url"));
    let receiver = Receiver::start().await;
    let (hook, _) = receiver.subscribe(&it, &events).await;
    assert_eq!(test(&it, &hook).await["state"], "delivered");
    // The setting holds for webhooks that were made before it.
    let it = it.restart().await;
    assert_eq!(test(&it, &hook).await["state"], "abandoned");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_history_is_bounded_and_paged() {
    let it = Harness::start_with(here).await;
    let mut receiver = Receiver::start().await;
    let (hook, _) = receiver.subscribe(&it, &["snapshot.made"]).await;
    let mut sent = Vec::new();
    for _ in 0..203 {
        sent.push(test(&it, &hook).await["id"].as_str().unwrap().to_owned());
        receiver.next().await;
    }
    sent.reverse();
    let path = format!("/v1/webhooks/{hook}/deliveries?limit=150");
    let ids = |page: &Value| -> Vec<String> {
        let items = page["items"].as_array().unwrap().iter();
        items.map(|one| one["id"].as_str().unwrap().to_owned()).collect()
    };
    let first = it.get(&path).await.expect(200);
    let next = first["next_cursor"].as_str().unwrap();
    let rest = it.get(&format!("{path}&cursor={next}")).await.expect(200);
    assert_eq!([ids(&first), ids(&rest)].concat(), sent[..200]);
    assert_eq!(rest["next_cursor"], Value::Null);
    let it = it.restart_with(here).await;
    assert_eq!(ids(&it.get(&path).await.expect(200)), sent[..150]);
    it.send(Method::DELETE, &format!("/v1/webhooks/{hook}"), None).await.expect(204);
    it.get(&path).await.problem(404, "not-found", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn rotated_secrets_sign_together_for_a_while() {
    let it = Harness::start_with(here).await;
    let mut receiver = Receiver::start().await;
    let (hook, first) = receiver.subscribe(&it, &["snapshot.made"]).await;
    let rotate = format!("/v1/webhooks/{hook}/rotate");
    let request = json!({"secret": SECRET, "grace_s": 60});
    let rotated = it.post(&rotate, &request).await.expect(200);
    assert_eq!(rotated["secret"], SECRET);
    assert!(rotated["webhook"]["rotating_until"].is_string());
    test(&it, &hook).await;
    let came = receiver.next().await;
    assert!(came.is_signed_by(&first) && came.is_signed_by(SECRET));
    let drawn = it.post(&rotate, &json!({})).await.expect(200);
    test(&it, &hook).await;
    let came = receiver.next().await;
    assert!(came.is_signed_by(drawn["secret"].as_str().unwrap()));
    assert!(!came.is_signed_by(&first) && !came.is_signed_by(SECRET));
}

#[tokio::test(flavor = "multi_thread")]
async fn wrong_webhooks_are_refused_by_field_and_number() {
    let it = Harness::start_with(here).await;
    let right = json!({"url": "https://mes.example/x", "events": ["session.decided"]});
    let wrong = [
        ("url", json!("mes.example"), "/url"),
        ("url", json!("https://u:p@mes.example/"), "/url"),
        ("events", json!([]), "/events"),
        ("events", json!(["ping"]), "/events/0"),
        ("events", json!(["session.decided", "session.decided"]), "/events/1"),
        ("description", json!("x".repeat(201)), "/description"),
        ("secret", json!("whsec_AAAA"), "/secret"),
    ];
    for (field, value, pointer) in wrong {
        let mut request = right.clone();
        request[field] = value;
        it.post("/v1/webhooks", &request).await.problem(422, "invalid-value", Some(pointer));
    }
    let made = it.post("/v1/webhooks", &right).await.expect(201);
    assert!(made["webhook"].get("secret").is_none());
    let path = format!("/v1/webhooks/{}", made["webhook"]["id"].as_str().unwrap());
    let rotate = json!({"grace_s": 2_592_001});
    let answer = it.post(&format!("{path}/rotate"), &rotate).await;
    answer.problem(422, "invalid-value", Some("/grace_s"));
    for _ in 1..32 {
        it.post("/v1/webhooks", &right).await.expect(201);
    }
    it.post("/v1/webhooks", &right).await.problem(409, "wrong-state", None);
    let page = it.get("/v1/webhooks?limit=20").await.expect(200);
    let next = page["next_cursor"].as_str().unwrap();
    let rest = it.get(&format!("/v1/webhooks?cursor={next}")).await.expect(200);
    assert_eq!(rest["items"].as_array().unwrap().len(), 12);
    it.get("/v1/webhooks/nobody").await.problem(404, "not-found", None);
}
