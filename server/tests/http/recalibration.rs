//! Tests of recalibration: from sessions whose sensor is noisier than that of training.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{BAR, CUBE, Harness, pose_of, touches};

/// Deviations of the sensor along and about each axis in every touch, metres and rad.
const NOISE: (f64, f64) = (0.003, 0.15);
const CALIBRATIONS: &str = "/v1/catalogues/default/calibrations";

/// Six touches of a box by a sensor that is off in each.
fn noisy(size: [f64; 3], seed: u64) -> Vec<Value> {
    let turn = DQuat::from_rotation_z(0.1 * seed as f64);
    let mut readings = touches(size, 6, seed, Pose::from_parts(turn, DVec3::splat(0.1)));
    let mut stream = Stream::new(seed, Purpose::Perturbation, 0);
    for reading in &mut readings {
        let mut off = || DVec3::new(stream.normal(), stream.normal(), stream.normal());
        let (moved, turned) = (NOISE.0 * off(), DQuat::from_scaled_axis(NOISE.1 * off()));
        let pose = pose_of(&reading["pose"]);
        reading["pose"]["position"] = json!((pose.translation + moved).to_array());
        reading["pose"]["orientation"] = json!((turned * pose.rotation).to_array());
    }
    readings
}

/// A session with these readings, not closed; its id.
async fn felt(it: &Harness, session: Value, readings: &[Value]) -> String {
    let id = it.session(session).await;
    let readings = json!({"readings": readings});
    it.post(&format!("/v1/sessions/{id}/readings"), &readings).await.expect(200);
    id
}

/// Closed sessions of both objects, `n` each; their ids.
async fn closed(it: &Harness, n: u64) -> Vec<String> {
    let mut ids = Vec::new();
    for seed in 0..n {
        for (object, size) in [("cube", CUBE), ("bar", BAR)] {
            let id = felt(it, json!({}), &noisy(size, 100 + seed)).await;
            let truth = json!({"object": object});
            it.post(&format!("/v1/sessions/{id}/close"), &truth).await.expect(200);
            ids.push(id);
        }
    }
    ids
}

async fn belief(it: &Harness, session: &str) -> Value {
    let mut belief = it.get(&format!("/v1/sessions/{session}/belief")).await.expect(200);
    belief["session"] = Value::Null;
    belief
}

fn probability(belief: &Value, object: &str) -> f64 {
    let objects = belief["objects"].as_array().unwrap();
    let found = objects.iter().find(|entry| entry["name"] == object).unwrap();
    found["probability"].as_f64().unwrap()
}

/// Mean −ln probability of the truth in sessions that no calibration knows.
async fn loss(it: &Harness, version: u32) -> f64 {
    let mut sum = 0.0;
    for seed in 500..505 {
        for (object, size) in [("cube", CUBE), ("bar", BAR)] {
            let id = felt(it, json!({"version": version}), &noisy(size, seed)).await;
            sum -= probability(&belief(it, &id).await, object).max(1e-6).ln();
        }
    }
    sum / 10.0
}

/// Recalibrates as requested; the job and the new version.
async fn recalibrated(it: &Harness, request: Value) -> (Value, Value) {
    let accepted = it.post(CALIBRATIONS, &request).await;
    let job = accepted.expect(202);
    let id = job["id"].as_str().unwrap();
    assert_eq!(accepted.headers["location"], format!("/v1/jobs/{id}"));
    let job = it.finished(id).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let path = format!("/v1/catalogues/default/versions/{}", job["version"]);
    (job, it.get(&path).await.expect(200))
}

async fn make_current(it: &Harness, version: u32) {
    let path = "/v1/catalogues/default/current";
    let etag = it.get(path).await.headers["etag"].to_str().unwrap().to_owned();
    let request = it.client.request(Method::PUT, it.url(path)).header("if-match", etag);
    let answer = request.json(&json!({"version": version})).send().await.unwrap();
    assert_eq!(answer.status(), 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_noisier_sensor_is_better_understood_and_undone() {
    let it = Harness::trained().await;
    let ids = closed(&it, 12).await;
    let probe = noisy(BAR, 900);
    let open = felt(&it, json!({}), &probe).await;
    let of_first = belief(&it, &open).await;
    let loss_before = loss(&it, 1).await;

    let (job, version) = recalibrated(&it, json!({})).await;
    assert_eq!(job["recalibration"]["sessions"], json!(ids), "the sessions whose truth is known");
    assert_eq!(
        (&job["training"], &job["recalibration"]["version"]),
        (&json!({}), &json!(1)),
        "{job}"
    );
    let report = &version["report"];
    let found = &report["recalibration"];
    let state = (&version["version"], &version["is_current"]);
    assert_eq!(state, (&json!(2), &json!(true)), "{found}");
    assert_eq!(
        (&report["calibrated"], &report["calibrated_on"]),
        (&json!(true), &json!(2)),
        "{report}"
    );
    for (field, expected) in [
        ("from_version", json!(1)),
        ("n_sessions", json!(24)),
        ("n_known", json!(24)),
        ("n_objects", json!(2)),
        ("n_left_out", json!(0)),
        ("is_better", json!(true)),
    ] {
        assert_eq!(found[field], expected, "{field}: {found}");
    }
    let figure = |side: &str, name: &str| found[side][name].as_f64().unwrap();
    assert!(figure("after", "log_loss") < figure("before", "log_loss"), "{found}");
    assert!(figure("after", "unknown_of_known") <= figure("before", "unknown_of_known"));
    assert!(figure("after", "sensor_width") > 1.0 && figure("before", "sensor_width") <= 1.0);

    // Only the calibration is another one.
    let map = |version: u32| format!("/v1/catalogues/default/versions/{version}/objects/bar/map");
    assert_eq!(it.get(&map(1)).await.expect(200), it.get(&map(2)).await.expect(200));
    let loss_after = loss(&it, 2).await;
    assert!(loss_after < 0.8 * loss_before, "{loss_before} {loss_after}");

    // The open session keeps its version, a new one has the new version.
    assert_eq!(belief(&it, &open).await, of_first);
    let new = felt(&it, json!({}), &probe).await;
    assert_eq!(it.get(&format!("/v1/sessions/{new}")).await.expect(200)["version"], 2);
    let of_second = belief(&it, &new).await;
    assert!(probability(&of_second, "bar") > probability(&of_first, "bar"), "{of_second}");

    // Again from the version itself: nothing is left to be gained, so it stays current.
    let (_, third) = recalibrated(&it, json!({"version": 2})).await;
    let again = &third["report"]["recalibration"];
    assert_eq!((&again["is_better"], &again["from_version"]), (&json!(false), &json!(2)));
    assert_eq!((&third["version"], &third["is_current"]), (&json!(3), &json!(false)));

    let it = it.restart().await;
    assert_eq!(belief(&it, &new).await, of_second);
    let anew = felt(&it, json!({}), &probe).await;
    assert_eq!(belief(&it, &anew).await, of_second);
    make_current(&it, 1).await;
    let undone = felt(&it, json!({}), &probe).await;
    assert_eq!(belief(&it, &undone).await, of_first);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recalibrated_version_is_extended_with_its_calibration() {
    let it = Harness::trained().await;
    closed(&it, 10).await;
    let (_, second) = recalibrated(&it, json!({})).await;
    it.post("/v1/objects", &json!({"name": "rod"})).await.expect(201);
    it.put_mesh("rod", &crate::harness::off_box([100.0, 12.0, 12.0])).await.expect(200);
    let more = json!({"extend": 2, "objects": ["rod"], "readings_per_object": 60});
    let job = it.post("/v1/catalogues/default/trainings", &more).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!((&job["state"], &job["version"]), (&json!("succeeded"), &json!(3)), "{job}");
    let found = recalibrated(&it, json!({"version": 3})).await.1["report"].clone();
    let (kept, fitted) = (&found["recalibration"]["before"], &second["report"]["recalibration"]);
    assert_eq!(kept["stages"], fitted["after"]["stages"]);
    assert_eq!(kept["sensor_width"], fitted["after"]["sensor_width"]);
    // The cube and the bar were known to the sessions, the rod was not.
    assert_eq!(found["recalibration"]["n_known"], 20);
}

#[tokio::test(flavor = "multi_thread")]
async fn sessions_that_tell_too_little_are_refused() {
    let it = Harness::trained().await;
    let few = it.post(CALIBRATIONS, &json!({})).await;
    few.problem(409, "wrong-state", None);
    assert!(few.text.contains("has 0 sessions") && few.text.contains("at least 20"), "{few:?}");
    it.post("/v1/catalogues/none/calibrations", &json!({})).await.problem(404, "not-found", None);
    let refused = async |request: Value, pointer: &str| {
        it.post(CALIBRATIONS, &request).await.problem(422, "invalid-value", Some(pointer));
    };
    refused(json!({"version": 7}), "/version").await;
    refused(json!({"sensor": "nose"}), "/sensor").await;
    let ids = closed(&it, 10).await;
    refused(json!({"sessions": ids[..19]}), "/sessions").await;
    let open = felt(&it, json!({}), &noisy(BAR, 1)).await;
    let with = |at: usize, id: &str| {
        let mut named = ids.clone();
        named[at] = id.to_owned();
        json!({"sessions": named})
    };
    refused(with(3, &open), "/sessions/3").await;
    refused(with(4, &ids[0]), "/sessions/4").await;
    refused(with(5, "00000000-0000-0000-0000-000000000000"), "/sessions/5").await;
    // Two readings have no pose.
    let short = felt(&it, json!({}), &noisy(BAR, 1)[..2]).await;
    it.post(&format!("/v1/sessions/{short}/close"), &json!({"object": "bar"})).await.expect(200);
    refused(with(6, &short), "/sessions/6").await;
    it.post("/v1/sensors", &json!({"name": "other", "preset": "digitacts-6x6"})).await.expect(201);
    let other = it.post(CALIBRATIONS, &json!({"sensor": "other"})).await;
    other.problem(409, "wrong-state", None);

    // With sessions of an object that the catalogue lacks.
    let ball = felt(&it, json!({}), &noisy([25.0, 25.0, 70.0], 3)).await;
    let unknown = json!({"none_of_these": true});
    it.post(&format!("/v1/sessions/{ball}/close"), &unknown).await.expect(200);
    let request = json!({"sensor": "digitacts-6x6", "activate": false});
    let (job, version) = recalibrated(&it, request).await;
    assert_eq!(job["recalibration"]["sessions"].as_array().unwrap().len(), 21);
    assert_eq!(version["is_current"], false);
    let found = &version["report"]["recalibration"];
    assert_eq!((&found["n_sessions"], &found["n_known"]), (&json!(21), &json!(20)));
}
