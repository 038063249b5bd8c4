//! Tests of removal: unused sensors, catalogues and versions are removed, used ones name
//! their users.

use palpate_core::pose::Pose;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{Answer, BAR, Harness, quiet_reading, touches};

async fn delete(it: &Harness, path: &str) -> Answer {
    it.send(Method::DELETE, path, None).await
}

/// Checks a refusal and the named user of the resource.
async fn needed(it: &Harness, path: &str, by: &str) {
    let refused = delete(it, path).await.problem(409, "wrong-state", None);
    assert!(refused["detail"].as_str().unwrap().contains(by), "{by}: {refused}");
}

/// Trains another version that is not current.
async fn train(it: &Harness, extra: &Value) -> Value {
    let mut training = json!({"readings_per_object": 60, "n_classes": 8, "seed": 4});
    training.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    it.finished(job["id"].as_str().unwrap()).await
}

#[tokio::test(flavor = "multi_thread")]
async fn an_unused_version_is_removed() {
    let it = Harness::trained().await;
    let path = "/v1/catalogues/default/versions/1";
    needed(&it, path, "new sessions use it").await;
    let session = it.session(json!({})).await;
    let touch = json!({"readings": touches(BAR, 2, 5, Pose::IDENTITY)});
    it.post(&format!("/v1/sessions/{session}/readings"), &touch).await.expect(200);
    assert_eq!(train(&it, &json!({})).await["version"], 2);
    needed(&it, path, &session).await;
    it.post(&format!("/v1/sessions/{session}/close"), &json!({})).await.expect(200);
    needed(&it, path, &session).await;
    // A version that shares parts with the first one keeps them.
    assert_eq!(
        train(
            &it,
            &json!({"objects": ["bar"], "extend": 1, "seed": 9,
        "readings_per_object": 40, "n_classes": null})
        )
        .await["version"],
        3
    );
    delete(&it, &format!("/v1/sessions/{session}")).await.expect(204);
    delete(&it, path).await.expect(204);
    delete(&it, path).await.problem(404, "not-found", None);
    it.get(path).await.problem(404, "not-found", None);
    let versions = it.get("/v1/catalogues/default/versions").await.expect(200);
    let numbers: Vec<&Value> =
        versions["items"].as_array().unwrap().iter().map(|version| &version["version"]).collect();
    assert_eq!(numbers, [2, 3]);
    let gone = it.post("/v1/sessions", &json!({"version": 1})).await;
    gone.problem(422, "invalid-value", Some("/version"));
    let it = it.restart().await;
    let session = it.session(json!({"version": 3})).await;
    let posted = it.post(&format!("/v1/sessions/{session}/readings"), &touch).await.expect(200);
    assert_eq!(posted["belief"]["objects"].as_array().unwrap().len(), 2);
    assert_eq!(it.get("/readyz").await.expect(200)["ready"], true, "nothing is missing");
    assert_eq!(train(&it, &json!({"activate": false})).await["version"], 4);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_catalogue_is_removed_with_all_its_versions() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    needed(&it, "/v1/catalogues/default", &session).await;
    delete(&it, &format!("/v1/sessions/{session}")).await.expect(204);
    let long = json!({"readings_per_object": 20_000});
    let job = it.post("/v1/catalogues/default/trainings", &long).await.expect(202);
    let job = job["id"].as_str().unwrap();
    needed(&it, "/v1/catalogues/default", job).await;
    it.post(&format!("/v1/jobs/{job}/cancel"), &json!({})).await.expect(200);
    delete(&it, "/v1/catalogues/default").await.expect(204);
    it.get("/v1/catalogues/default").await.problem(404, "not-found", None);
    assert_eq!(it.get("/v1/catalogues").await.expect(200)["items"], json!([]));
    let it = it.restart().await;
    assert_eq!(train(&it, &json!({})).await["version"], 1, "the name is free");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sensor_without_readings_is_removed() {
    let it = Harness::trained().await;
    for name in ["palm", "finger", "typo"] {
        it.post("/v1/sensors", &json!({"name": name, "preset": "digitacts-6x6"})).await.expect(201);
    }
    let of = |sensor: &str| {
        let mut reading = quiet_reading();
        reading["sensor"] = json!(sensor);
        json!({"readings": [reading]})
    };
    it.post("/v1/objects/bar/readings", &of("palm")).await.expect(200);
    let session = it.session(json!({})).await;
    let readings = format!("/v1/sessions/{session}/readings");
    it.post(&readings, &of("digitacts-6x6")).await.expect(200);
    it.post(&readings, &of("finger")).await.expect(200);
    needed(&it, "/v1/sensors/palm", "bar").await;
    needed(&it, "/v1/sensors/finger", &session).await;
    needed(&it, "/v1/sensors/digitacts-6x6", "preset").await;
    delete(&it, "/v1/sensors/typo").await.expect(204);
    it.get("/v1/sensors/typo").await.problem(404, "not-found", None);
    let refused = it.post(&readings, &of("typo")).await;
    refused.problem(422, "invalid-value", Some("/readings/0/sensor"));
    // Refused resources stay usable.
    it.post(&readings, &of("finger")).await.expect(200);
    delete(&it, &format!("/v1/sessions/{session}")).await.expect(204);
    delete(&it, "/v1/sensors/finger").await.expect(204);
    delete(&it, "/v1/objects/bar").await.expect(204);
    delete(&it, "/v1/sensors/palm").await.expect(204);
}
