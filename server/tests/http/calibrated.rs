//! Tests of calibration: reports and beliefs state whether probabilities are calibrated.

use serde_json::{Value, json};

use crate::harness::{Harness, off_box};

const ROD: [f64; 3] = [100.0, 12.0, 12.0];

/// Trains as requested; the report.
async fn report(it: &Harness, training: Value) -> Value {
    let path = "/v1/catalogues/default/trainings";
    let job = it.post(path, &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let version = &job["version"];
    it.get(&format!("/v1/catalogues/default/versions/{version}/report")).await.expect(200)
}

/// Checks a report: whether it is calibrated, on how many objects, and the reason if not.
#[track_caller]
fn check(report: &Value, expected: (bool, u32, Value)) {
    let found = (&report["calibrated"], &report["calibrated_on"], &report["uncalibrated_reason"]);
    assert_eq!(found, (&json!(expected.0), &json!(expected.1), &expected.2));
}

/// The belief of a new session: whether it is calibrated, and the reason if not.
async fn believed(it: &Harness, session: Value) -> (Value, Value) {
    let id = it.session(session).await;
    let belief = it.get(&format!("/v1/sessions/{id}/belief")).await.expect(200);
    (belief["calibrated"].clone(), belief["uncalibrated_reason"].clone())
}

#[tokio::test(flavor = "multi_thread")]
async fn report_and_belief_state_whether_they_are_calibrated() {
    let it = Harness::trained().await;
    let path = "/v1/catalogues/default/versions/1/report";
    let first = it.get(path).await.expect(200);
    check(&first, (false, 0, json!("few_readings")));
    let of_first = |method: &str| json!({"version": 1, "method": method});
    let found = believed(&it, of_first("surface")).await;
    assert_eq!(found, (json!(false), json!("few_readings")));
    assert_eq!(believed(&it, of_first("sva")).await, (json!(false), json!("method")));

    let alone = json!({"objects": ["bar"], "readings_per_object": 60, "sva": false,
        "surface": true, "activate": false});
    check(&report(&it, alone).await, (false, 0, json!("one_object")));

    // The object without held-out touches is trained again for the third version.
    it.post("/v1/objects", &json!({"name": "rod"})).await.expect(201);
    it.put_mesh("rod", &off_box(ROD)).await.expect(200);
    let more = json!({"extend": 1, "objects": ["rod"], "readings_per_object": 60});
    check(&report(&it, more).await, (true, 2, Value::Null));
    assert_eq!(believed(&it, json!({"version": 3})).await, (json!(true), Value::Null));
}
