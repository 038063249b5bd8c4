//! Tests of comparisons of two versions on recorded sessions.

use palpate_core::pose::Pose;
use serde_json::{Value, json};

use crate::harness::{BAR, CUBE, Harness, touches};

const SHADOW: &str = "/v1/catalogues/default/versions/2/shadow";

/// A session that touched a box six times and has ended; with `truth` also what it was.
async fn ended(it: &Harness, size: [f64; 3], seed: u64, truth: Value) -> String {
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}");
    let readings = touches(size, 6, seed, Pose::IDENTITY);
    it.post(&format!("{path}/readings"), &json!({"readings": readings})).await.expect(200);
    it.post(&format!("{path}/close"), &truth).await.expect(200);
    session
}

/// Version 1 knows a cube and a bar, version 2 the cube alone.
async fn two_versions() -> Harness {
    let it = Harness::trained().await;
    let request = json!({
        "objects": ["cube"], "activate": false, "readings_per_object": 60, "n_classes": 8, "seed": 3
    });
    let job = it.post("/v1/catalogues/default/trainings", &request).await.expect(202);
    it.finished(job["id"].as_str().unwrap()).await;
    it
}

async fn report(it: &Harness, request: &Value) -> Value {
    let job = it.post(SHADOW, request).await.expect(202);
    assert_eq!(job["shadow_report"], Value::Null);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!((&job["state"], &job["version"]), (&json!("succeeded"), &json!(2)), "{job}");
    job["shadow_report"].clone()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_version_that_lacks_an_object_loses_its_sessions() {
    let it = two_versions().await;
    let cube = ended(&it, CUBE, 5, json!({"object": "cube"})).await;
    let bar = ended(&it, BAR, 5, json!({"object": "bar"})).await;
    let untold = ended(&it, BAR, 6, json!({})).await;
    it.session(json!({})).await;

    let found = report(&it, &json!({})).await;
    assert_eq!((&found["version"], &found["against"]), (&json!(2), &json!(1)));
    assert_eq!(found["n_sessions"], 3, "not the open one: {found}");
    assert_eq!((&found["n_with_truth"], &found["n_left_out"]), (&json!(2), &json!(0)));
    assert_eq!(found["old"]["accuracy"], 1.0, "{found}");
    let changed: Vec<&str> = found["changed"].as_array().unwrap().iter().map(id).collect();
    assert_eq!(changed, [untold.as_str(), bar.as_str()], "newest first, and not {cube}");
    let [of_untold, of_bar] = [0, 1].map(|at| &found["changed"][at]);
    assert_eq!((&of_bar["truth"], &of_bar["old"]["name"]), (&json!("bar"), &json!("bar")));
    assert_ne!(of_bar["new"]["name"], "bar");
    assert_eq!(of_untold["truth"], Value::Null);

    // The replay says what the session said, and nothing changed by it.
    let belief = it.get(&format!("/v1/sessions/{bar}/belief")).await.expect(200);
    assert_eq!(of_bar["old"]["probability"], belief["objects"][0]["probability"]);
    let current = it.get("/v1/catalogues/default").await.expect(200)["current"].clone();
    assert_eq!(current["version"], 1);
    let named = report(&it, &json!({"sessions": [cube], "risk": 0.4})).await;
    assert_eq!((&named["n_sessions"], &named["risk"]), (&json!(1), &json!(0.4)));
    assert_eq!(named["changed"], json!([]));
    assert!(named["old"]["n_decided"] == 1 && named["old"]["touches"].is_f64(), "{named}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_comparison_without_sense_is_refused() {
    let it = two_versions().await;
    it.post(SHADOW, &json!({})).await.problem(409, "wrong-state", None);
    let open = it.session(json!({})).await;
    let session = ended(&it, CUBE, 5, json!({})).await;
    let refused = async |request: Value, pointer: &str| {
        it.post(SHADOW, &request).await.problem(422, "invalid-value", Some(pointer));
    };
    refused(json!({"against": 2}), "/against").await;
    refused(json!({"against": 9}), "/against").await;
    refused(json!({"risk": 0.9}), "/risk").await;
    refused(json!({"sessions": []}), "/sessions").await;
    refused(json!({"sessions": [open]}), "/sessions/0").await;
    refused(json!({"sessions": [session, session]}), "/sessions/1").await;
    let path = "/v1/catalogues/default/versions/9/shadow";
    it.post(path, &json!({})).await.problem(404, "not-found", None);
}

fn id(changed: &Value) -> &str {
    changed["session"].as_str().unwrap()
}
