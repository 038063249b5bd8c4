//! Tests of stored bytes: use by each key, its quota, and the things that would free most.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use palpate_core::pose::Pose;
use palpate_server::{Access, FreeSpace};
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{Answer, CUBE, Harness, read, touches};

/// Sends a body with a key.
async fn send(it: &Harness, key: &str, method: Method, path: &str, body: &Value) -> Answer {
    let request = it.client.request(method, it.url(path)).bearer_auth(key);
    read(request.json(body).send().await.unwrap()).await
}

fn readings(robot: &str, from: usize, n: usize) -> Value {
    let mut readings = touches(CUBE, n, 9, Pose::IDENTITY);
    for (seq, reading) in (from..).zip(readings.iter_mut()) {
        (reading["robot"], reading["seq"]) = (json!(robot), json!(seq));
    }
    json!({ "readings": readings })
}

fn stored_bytes(whoami: &Value) -> u64 {
    whoami["key"]["stored_bytes"].as_u64().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_over_its_quota_is_refused_until_it_removes_something() {
    let quota = 20_000;
    let it = Harness::start_with(|config| {
        config.access = Access::Keys;
        config.store_quota_bytes = Some(quota);
    })
    .await;
    let arm = it.new_key("arm", "robot").await;
    let trainer = it.new_key("trainer", "trainer").await;
    let object = send(&it, &trainer, Method::POST, "/v1/objects", &json!({"name": "mug"})).await;
    object.expect(201);
    let path = "/v1/objects/mug/readings";
    send(&it, &trainer, Method::POST, path, &readings("t", 0, 9)).await.expect(200);
    let whoami = it.send_as(Some(&trainer), Method::GET, "/v1/whoami").await.expect(200);
    let held = stored_bytes(&whoami);
    assert!(held > 9 * 300 && held < quota, "{whoami}");
    assert_eq!(whoami["quota_bytes"], quota);

    let refused = send(&it, &trainer, Method::POST, path, &readings("t", 9, 50)).await;
    let problem = refused.problem(409, "quota-exceeded", None);
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("may hold 0.020 MB"), "{detail}");
    assert!(detail.contains(&format!("holds {:.3} MB", held as f64 / 1e6)), "{detail}");
    let whoami = it.send_as(Some(&arm), Method::GET, "/v1/whoami").await.expect(200);
    assert_eq!(stored_bytes(&whoami), 0, "what others hold is not counted");

    let removed = it.send_as(Some(&trainer), Method::DELETE, "/v1/objects/mug").await;
    assert_eq!(removed.status, 204);
    let whoami = it.send_as(Some(&trainer), Method::GET, "/v1/whoami").await.expect(200);
    assert_eq!(stored_bytes(&whoami), 0, "{whoami}");
    let again = send(&it, &trainer, Method::POST, "/v1/objects", &json!({"name": "mug"})).await;
    again.expect(201);
    it.server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn stored_data_counts_towards_the_key_that_made_it() {
    let it = Harness::guarded().await;
    it.train().await;
    let arm = it.new_key("arm", "robot").await;
    let session = send(&it, &arm, Method::POST, "/v1/sessions", &json!({})).await.expect(201);
    let session = session["id"].as_str().unwrap().to_owned();
    let path = format!("/v1/sessions/{session}/readings");
    send(&it, &arm, Method::POST, &path, &readings("arm", 0, 6)).await.expect(200);
    let keys = it.get("/v1/keys").await.expect(200);
    let holds = |keys: &Value, name: &str| {
        let items = keys["items"].as_array().unwrap();
        items.iter().find(|key| key["name"] == name).unwrap()["stored_bytes"].as_u64().unwrap()
    };
    let storage = it.get("/v1/storage").await.expect(200);
    let first = &storage["holders"][0];
    assert_eq!(first["key"]["key_name"], "admin", "who trained: {storage}");
    let version = storage["largest"].as_array().unwrap();
    let version = version.iter().find(|thing| thing["kind"] == "catalogue").unwrap();
    assert!(first["bytes"].as_u64() > version["bytes"].as_u64(), "{storage}");
    assert!((6 * 300..20_000).contains(&holds(&keys, "arm")), "{keys}");

    let n_readings = storage["n_readings"].as_u64().unwrap();
    assert!(n_readings >= 6, "{storage}");

    let it = it.restart().await;
    let again = it.get("/v1/storage").await.expect(200);
    assert_eq!(again["holders"], storage["holders"]);
    assert_eq!(again["n_readings"], n_readings, "counted in the store");
    it.send(Method::DELETE, &format!("/v1/sessions/{session}/readings/0"), None).await.expect(200);
    let again = it.get("/v1/storage").await.expect(200);
    assert_eq!(again["n_readings"], n_readings, "a retracted reading stays stored");
    it.send(Method::DELETE, &format!("/v1/sessions/{session}"), None).await.expect(204);
    let keys = it.get("/v1/keys").await.expect(200);
    // Its robot's name still counts towards it.
    assert!(holds(&keys, "arm") < 200, "an administrator removed what it wrote: {keys}");
    let metrics = it.get("/metrics").await.text;
    let line = metrics.lines().find(|line| line.starts_with("palpate_store_key_bytes"));
    assert!(line.unwrap().contains("key=\"admin\""), "{metrics}");
    it.server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_tells_holders_of_keys_what_would_free_most() {
    let free = Arc::new(AtomicU64::new(u64::MAX));
    let seen = Arc::clone(&free);
    let it = Harness::start_with(|config| {
        config.access = Access::Keys;
        config.free_space = FreeSpace::from_probe(move |_| Ok(seen.load(Ordering::Relaxed)));
    })
    .await;
    it.train().await;
    let session = it.session(json!({})).await;
    it.post(&format!("/v1/sessions/{session}/readings"), &readings("arm", 0, 6)).await.expect(200);
    let storage = it.get("/v1/storage").await.expect(200);
    let bytes = |thing: &Value| thing["bytes"].as_u64().unwrap();
    let largest = storage["largest"].as_array().unwrap();
    assert!(largest.is_sorted_by_key(|thing| std::cmp::Reverse(bytes(thing))), "{storage}");
    let kind = |kind: &str| largest.iter().find(|thing| thing["kind"] == kind).unwrap();
    assert_eq!(kind("session")["id"], json!(session));
    assert_eq!(kind("catalogue")["name"], "default");
    assert!(bytes(kind("object")) > 200, "an object with its mesh");

    free.store(1 << 20, Ordering::Relaxed);
    let room = |ready: &Value| {
        let checks = ready["checks"].as_array().unwrap().clone();
        checks.into_iter().find(|check| check["name"] == "room").unwrap()
    };
    let ready = it.get("/readyz").await.expect(200);
    let detail = room(&ready)["detail"].as_str().unwrap().to_owned();
    assert!(detail.contains("most would be freed by removing"), "{detail}");
    assert!(detail.contains("catalogue default ("), "{detail}");
    let strangers = it.send_as(None, Method::GET, "/readyz").await.expect(200);
    assert_eq!(room(&strangers)["detail"], "failed");
    let metrics = it.get("/metrics").await.text;
    assert!(metrics.contains("palpate_store_largest_bytes{kind=\"catalogue\",name=\"default\"}"));
    it.server.shutdown().await;
}
