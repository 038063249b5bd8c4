//! Tests of error messages in a client author's terms, and of hints for small mistakes.

use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{CUBE, Harness, off_box, quiet_reading, read};

/// The detail of a field's error in a 422.
fn detail(problem: &Value, pointer: &str) -> String {
    let errors = problem["errors"].as_array().unwrap();
    let named = errors.iter().find(|error| error["pointer"] == pointer);
    named.unwrap_or_else(|| panic!("{problem}"))["detail"].as_str().unwrap().to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn wrong_types_are_named_in_json_terms() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/readings");
    let said = async |field: &str, value: Value, pointer: &str| {
        let mut reading = quiet_reading();
        reading[field] = value;
        let refused = it.post(&path, &json!({"readings": [reading]})).await;
        let pointer = format!("/readings/0/{pointer}");
        detail(&refused.problem(422, "invalid-value", Some(&pointer)), &pointer)
    };
    let seq = said("seq", json!(-1), "seq").await;
    assert!(seq.starts_with("came -1, expected an integer of at least 0"), "{seq}");
    let rows = said("image", json!([[0.0, 1.0]]), "image/0").await;
    assert!(rows.starts_with("came a list, expected a number: one list of numbers"), "{rows}");
    let mut huge = vec![0.0; 36];
    huge[3] = 1e308;
    let huge = said("image", json!(huge), "image/3").await;
    assert!(huge.contains("1e308") && huge.len() < 100, "{huge}");
    let far = said(
        "pose",
        json!({"position": [0, 1e300, 0], "orientation": [0, 0, 0, 1]}),
        "pose/position/1",
    )
    .await;
    assert!(far.contains("1e300") && far.len() < 100, "{far}");
    let poses = it.get(&format!("/v1/sessions/{session}/belief?poses=-1")).await;
    let poses = poses.problem(422, "invalid-value", Some("?poses"));
    assert_eq!(detail(&poses, "?poses"), "expected an integer of at least 0");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_number_shared_by_two_readings_is_named() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let reading = |seq: u64, z: f64| {
        let mut reading = quiet_reading();
        reading["robot"] = json!("arm");
        reading["seq"] = json!(seq);
        reading["pose"]["position"][2] = json!(z);
        reading
    };
    it.post("/v1/objects", &json!({"name": "mug"})).await.expect(201);
    for path in [format!("/v1/sessions/{session}/readings"), "/v1/objects/mug/readings".into()] {
        let other = json!({"readings": [reading(1, 0.1), reading(2, 0.1), reading(1, 0.2)]});
        let refused = it.post(&path, &other).await;
        let refused = refused.problem(422, "invalid-value", Some("/readings/2/seq"));
        assert!(
            detail(&refused, "/readings/0/seq").contains("/readings/0 and /readings/2"),
            "{refused}"
        );
        let same = json!({"readings": [reading(1, 0.1), reading(1, 0.1)]});
        let added = it.post(&path, &same).await.expect(200);
        let counts = [&added["n_new"], &added["n_repeated"], &added["n_readings"]];
        assert_eq!(counts, [1, 1, 1], "nothing of the refused request was stored");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn meshes_accept_four_units_and_report_their_format() {
    let it = Harness::start().await;
    it.post("/v1/objects", &json!({"name": "mug"})).await.expect(201);
    let file = || off_box(CUBE).into_bytes();
    let put = async |query: &str, content_type: &str| {
        let path = format!("/v1/objects/mug/mesh{query}");
        it.send(Method::PUT, &path, Some((content_type, file()))).await
    };
    let missing = put("", "model/off").await.problem(422, "invalid-value", Some("?unit"));
    assert_eq!(
        detail(&missing, "?unit"),
        "the unit is missing, expected m, mm, cm or in: OFF does not record it"
    );
    for (unit, metres) in [("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("in", 25.4e-3)] {
        let report = put(&format!("?unit={unit}"), "model/off").await.expect(200);
        assert_eq!(report["mesh"]["unit"], unit);
        let size = report["size"][0].as_f64().unwrap();
        assert!((size / (40.0 * metres) - 1.0).abs() < 1e-12, "{size} {unit}");
        let stored = it.get("/v1/objects/mug").await.expect(200);
        assert_eq!(stored["mesh"]["unit"], unit);
    }
    let wrong = put("?unit=mm", "model/stl").await.problem(422, "invalid-value", Some(""));
    assert!(wrong["detail"].as_str().unwrap().contains("begins as OFF"), "{wrong}");
}

#[tokio::test(flavor = "multi_thread")]
async fn small_mistakes_get_a_hint() {
    let it = Harness::start().await;
    let request = it.client.post(it.url("/v1/objects")).header("content-encoding", "gzip");
    let request = request.header("content-type", "application/json").body(vec![0x1f, 0x8b, 8, 0]);
    let zipped = read(request.send().await.unwrap()).await;
    zipped.problem(415, "unsupported-media-type", Some("header:content-encoding"));
    let plain = it.client.post(it.url("/v1/objects")).header("content-encoding", "identity");
    let plain = plain.json(&json!({"name": "mug"})).send().await.unwrap();
    assert_eq!(plain.status(), 201);

    let slash = it.get("/v1/objects/").await.problem(404, "not-found", None);
    assert!(slash["detail"].as_str().unwrap().ends_with("as /v1/objects"), "{slash}");
    let other = it.get("/v1/things").await.problem(404, "not-found", None);
    assert_eq!(other["detail"], "nothing exists at /v1/things");

    let job = it.train().await;
    let cancel = format!("/v1/jobs/{}/cancel", job["id"].as_str().unwrap());
    let ended = it.post(&cancel, &json!({})).await.problem(409, "wrong-state", None);
    assert!(ended["detail"].as_str().unwrap().ends_with("already ended: succeeded"), "{ended}");
}
