//! Tests of models in memory: parts are loaded as methods need them, within a budget.

use palpate_core::pose::Pose;
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, touches};

/// Two catalogues of the same two objects.
async fn two_catalogues(it: &Harness) -> [u64; 2] {
    it.train().await;
    let training = json!({"readings_per_object": 60, "n_classes": 8, "seed": 4});
    let job = it.post("/v1/catalogues/other/trainings", &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    [surface_bytes(it, "default").await, surface_bytes(it, "other").await]
}

async fn surface_bytes(it: &Harness, catalogue: &str) -> u64 {
    let report = it.get(&format!("/v1/catalogues/{catalogue}/versions/1/report")).await;
    report.expect(200)["surface_bytes"].as_u64().unwrap()
}

/// Bytes of a part of the models, from the server's metrics.
async fn bytes_in_memory(it: &Harness, part: &str) -> u64 {
    let figures = it.get("/metrics").await.text;
    let name = format!("palpate_model_bytes{{part=\"{part}\"}} ");
    let line = figures.lines().find_map(|line| line.strip_prefix(&name));
    line.unwrap_or_else(|| panic!("no {name}in {figures}")).parse::<f64>().unwrap() as u64
}

/// Beliefs of two sessions after each of their readings, which come in turn.
async fn in_turn(it: &Harness, budget: u64) -> Vec<Value> {
    let mut sessions = Vec::new();
    for catalogue in ["default", "other"] {
        sessions.push(it.session(json!({"catalogue": catalogue})).await);
    }
    let mut believed = Vec::new();
    for reading in touches(BAR, 4, 77, Pose::IDENTITY) {
        for session in &sessions {
            let path = format!("/v1/sessions/{session}/readings");
            let added = it.post(&path, &json!({"readings": [reading]})).await.expect(200);
            let mut belief = added["belief"].clone();
            belief.as_object_mut().unwrap().remove("session");
            believed.push(belief);
            let bytes = bytes_in_memory(it, "surface").await;
            assert!(bytes <= budget, "{bytes} of {budget}");
        }
    }
    believed
}

#[tokio::test(flavor = "multi_thread")]
async fn two_catalogues_answer_equally_when_only_one_fits() {
    let it = Harness::start().await;
    let bytes = two_catalogues(&it).await;
    let with_plenty = in_turn(&it, u64::MAX).await;
    // Either catalogue fits, both do not.
    let budget = bytes[0].max(bytes[1]) + bytes[0].min(bytes[1]) / 2;
    let it = it.restart_with(|config| config.model_memory_bytes_max = budget).await;
    assert_eq!(in_turn(&it, budget).await, with_plenty);
    assert_eq!(with_plenty.len(), 8);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_loads_its_methods_part_or_is_refused() {
    let it = Harness::trained().await;
    let needed = surface_bytes(&it, "default").await;
    let it = it.restart_with(|config| config.model_memory_bytes_max = needed - 1).await;
    let refused = it.post("/v1/sessions", &json!({})).await;
    let problem = refused.problem(503, "unavailable", None);
    let detail = problem["detail"].as_str().unwrap();
    let megabytes = |bytes: u64| format!("{:.3} MB", bytes as f64 / 1e6);
    for named in ["surface", "default", &megabytes(needed), &megabytes(needed - 1)] {
        assert!(detail.contains(named), "{named} in {detail}");
    }
    assert!(!refused.headers.contains_key("retry-after"), "waiting does not help");
    // The pair maps of the same version are smaller, and need no surface.
    let session = it.session(json!({"method": "sva"})).await;
    let readings = json!({"readings": touches(BAR, 3, 77, Pose::IDENTITY)});
    let added = it.post(&format!("/v1/sessions/{session}/readings"), &readings).await.expect(200);
    assert_eq!(added["belief"]["n_readings"], 3);
    assert_eq!(bytes_in_memory(&it, "surface").await, 0);
    let missing = it.post("/v1/sessions", &json!({"method": "appearance"})).await;
    missing.problem(409, "wrong-state", None);
}
