//! Tests of appearance: trainings and reports, sessions without poses, added versions,
//! clients' features.

use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use serde_json::{Value, json};

use crate::harness::{CUBE, Harness, off_box, quiet_reading, touches};

/// A rod, whose touches differ from those of a cube. Edges in millimetres.
const ROD: [f64; 3] = [100.0, 8.0, 8.0];
const TRAININGS: &str = "/v1/catalogues/default/trainings";

/// Readings without poses.
fn unposed(mut readings: Vec<Value>) -> Vec<Value> {
    for reading in &mut readings {
        reading.as_object_mut().unwrap().remove("pose");
    }
    readings
}

async fn add_object(it: &Harness, name: &str, size: [f64; 3]) {
    it.post("/v1/objects", &json!({"name": name})).await.expect(201);
    it.put_mesh(name, &off_box(size)).await.expect(200);
}

/// Trains and follows the job to its end.
async fn train(it: &Harness, training: Value) -> Value {
    let job = it.post(TRAININGS, &training).await.expect(202);
    it.finished(job["id"].as_str().unwrap()).await
}

/// A server with the appearance of a cube and a rod.
async fn trained() -> Harness {
    let it = Harness::start().await;
    add_object(&it, "cube", CUBE).await;
    add_object(&it, "rod", ROD).await;
    let appearance = json!({"n_classes": [4, 6], "report_readings": 10});
    let job = train(
        &it,
        json!({"readings_per_object": 150, "n_classes": 8, "seed": 3, "appearance": appearance}),
    )
    .await;
    assert_eq!(job["state"], "succeeded", "{job}");
    assert_eq!(job["training"]["appearance"]["descriptor"], "mnti");
    assert_eq!(job["training"]["appearance"]["variance_share"], 0.99);
    it
}

async fn report(it: &Harness, version: u32) -> Value {
    let path = format!("/v1/catalogues/default/versions/{version}/report/appearance");
    it.get(&path).await.expect(200)
}

fn names(belief: &Value) -> Vec<&str> {
    belief["objects"].as_array().unwrap().iter().map(|o| o["name"].as_str().unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_are_recognised_without_poses_and_after_a_restart() {
    let it = trained().await;
    let mut before = Vec::new();
    for (name, size) in [("cube", CUBE), ("rod", ROD)] {
        // Touches at unknown positions: the object may move.
        let readings = unposed(touches(size, 30, 77, Pose::IDENTITY));
        let session = it.session(json!({"method": "appearance"})).await;
        let path = format!("/v1/sessions/{session}");
        let added = it.post(&format!("{path}/readings"), &json!({"readings": readings})).await;
        let belief = &added.expect(200)["belief"];
        assert_eq!(names(belief)[0], name, "{belief}");
        assert!(belief["objects"][0]["probability"].as_f64().unwrap() > 0.9, "{belief}");
        assert_eq!(belief["poses"], json!([]));
        let marginals = it.get(&format!("{path}/marginals")).await;
        marginals.problem(409, "wrong-state", None);
        before.push((path, belief.clone()));
    }
    let it = it.restart().await;
    for (path, belief) in before {
        assert_eq!(it.get(&format!("{path}/belief")).await.expect(200), belief);
        let first = it.get(&format!("{path}/belief?at=0")).await.expect(200);
        assert_eq!(first["objects"][0]["probability"], 0.5);
        let session = it.get(&path).await.expect(200);
        assert_eq!((&session["method"], &session["seed"]), (&json!("appearance"), &Value::Null));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn order_of_readings_and_poses_do_not_matter() {
    let it = trained().await;
    let posed = touches(ROD, 12, 5, Pose::IDENTITY);
    let mut turned = unposed(posed.clone());
    turned.reverse();
    for method in ["appearance", "appearance_literal"] {
        let mut answers = Vec::new();
        for readings in [&posed, &turned] {
            let session = it.session(json!({"method": method})).await;
            let path = format!("/v1/sessions/{session}/readings");
            let added = it.post(&path, &json!({"readings": readings})).await.expect(200);
            answers.push(added["belief"]["objects"].clone());
        }
        assert_eq!(answers[0], answers[1], "{method}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn methods_that_need_poses_refuse_readings_without_them() {
    let it = trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/readings");
    let readings = [touches(CUBE, 1, 5, Pose::IDENTITY), unposed(vec![quiet_reading()])].concat();
    let refused = it.post(&path, &json!({"readings": readings})).await;
    let problem = refused.problem(422, "invalid-value", Some("/readings/1/pose"));
    assert!(problem["detail"].as_str().unwrap().contains("`surface`"), "{problem}");
    assert_eq!(it.get(&format!("/v1/sessions/{session}")).await.expect(200)["n_readings"], 0);
    // The unknown pose of a sensor is not invented.
    let check = it.post("/v1/sensors/digitacts-6x6/check", &readings[1]).await.expect(200);
    assert_eq!(check["sensor_z_in_session"], Value::Null);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_report_has_confusion_and_affinity() {
    let it = trained().await;
    let report = report(&it, 1).await;
    assert_eq!((&report["source"], &report["descriptor"]), (&json!("images"), &json!("mnti")));
    assert_eq!((&report["n_readings"], &report["feature_length"]), (&json!(10), &json!(25)));
    let candidates = report["candidates"].as_array().unwrap();
    let tried: Vec<&Value> = candidates.iter().map(|candidate| &candidate["n_classes"]).collect();
    assert_eq!(tried, [4, 6]);
    for (row, object) in report["objects"].as_array().unwrap().iter().enumerate() {
        // A fifth of the 150 touches is held out, if they touched at all.
        assert_eq!(object["n_held_back"].as_u64().unwrap(), 30, "{object}");
        assert_eq!(object["n_readings"].as_u64().unwrap(), 120, "{object}");
        let confusion = report["confusion"][row].as_array().unwrap();
        let sum: f64 = confusion.iter().map(|value| value.as_f64().unwrap()).sum();
        assert!((sum - 1.0).abs() < 1e-9, "{report}");
        assert!(confusion[row].as_f64().unwrap() > 0.8, "{report}");
        assert!((report["affinity"][row][row].as_f64().unwrap() - 1.0).abs() < 1e-9);
    }
    let version = it.get("/v1/catalogues/default/versions/1").await.expect(200);
    let summary = &version["report"]["appearance"];
    for field in ["vocabulary", "accuracy", "n_classes", "n_components", "warnings"] {
        assert_eq!(summary[field], report[field], "{field}");
    }
    assert_eq!(report["warnings"], json!([]));
}

#[tokio::test(flavor = "multi_thread")]
async fn adding_an_object_keeps_the_others_unchanged() {
    let it = trained().await;
    let before = report(&it, 1).await;
    let map = |version: u32| format!("/v1/catalogues/default/versions/{version}/objects/rod/map");
    let rod = it.get(&map(1)).await.expect(200);
    let wrong = it.post(TRAININGS, &json!({"extend": 1, "n_classes": 9})).await;
    wrong.problem(422, "invalid-value", Some("/n_classes"));
    it.post(TRAININGS, &json!({"extend": 7})).await.problem(422, "invalid-value", Some("/extend"));
    let nothing = it.post(TRAININGS, &json!({"extend": 1})).await;
    nothing.problem(422, "invalid-value", Some("/objects"));

    // A block that touch hardly distinguishes from the cube.
    add_object(&it, "block", [40.5, 40.0, 40.0]).await;
    let job = train(&it, json!({"extend": 1, "readings_per_object": 150})).await;
    assert_eq!((&job["state"], &job["version"]), (&json!("succeeded"), &json!(2)), "{job}");
    assert_eq!(job["training"]["n_classes"], 8, "as version 1 has it");
    let after = report(&it, 2).await;
    assert_eq!(after["vocabulary"], before["vocabulary"]);
    let objects = after["objects"].as_array().unwrap();
    assert_eq!(objects[..2], before["objects"].as_array().unwrap()[..]);
    assert_eq!(objects[2]["name"], "block");
    assert_eq!(it.get(&map(2)).await.expect(200), rod);
    let pair = &after["near_duplicates"][0];
    assert_eq!((&pair["first"], &pair["second"]), (&json!("cube"), &json!("block")));
    let warning = after["warnings"][0].as_str().unwrap();
    assert!(warning.contains("\"cube\" and \"block\" are nearly the same"), "{warning}");
    let version = it.get("/v1/catalogues/default/versions/2").await.expect(200);
    assert_eq!(version["report"]["appearance"]["warnings"][0], warning);
    assert_eq!(version["report"]["objects"].as_array().unwrap().len(), 3);

    // Both methods know the new object; it does not affect sessions of version 1.
    let session = it.session(json!({"method": "appearance"})).await;
    let readings = unposed(touches(ROD, 30, 77, Pose::IDENTITY));
    let path = format!("/v1/sessions/{session}/readings");
    let added = it.post(&path, &json!({"readings": readings})).await.expect(200);
    assert_eq!(names(&added["belief"])[0], "rod");
    assert_eq!(names(&added["belief"]).len(), 3);
    it.session(json!({"method": "sva", "version": 2})).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn readings_without_poses_train_appearance_alone() {
    let it = Harness::start().await;
    for (name, size) in [("cube", CUBE), ("rod", ROD)] {
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
        let readings = unposed(touches(size, 120, 9, Pose::IDENTITY));
        let path = format!("/v1/objects/{name}/readings");
        it.post(&path, &json!({"readings": readings})).await.expect(200);
    }
    let stored = it.get("/v1/objects/rod/readings?limit=1").await.expect(200);
    assert_eq!(stored["items"][0]["pose"], Value::Null);
    let failed = train(&it, json!({"appearance": {"n_classes": [5]}})).await;
    assert_eq!(failed["state"], "failed");
    let reason = failed["reason"].as_str().unwrap();
    assert!(reason.contains("\"cube\" has readings without poses"), "{reason}");
    let nothing = it.post(TRAININGS, &json!({"sva": false})).await;
    nothing.problem(422, "invalid-value", Some("/sva"));
    let job = train(&it, json!({"sva": false, "appearance": {"n_classes": [5]}})).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    it.post("/v1/sessions", &json!({})).await.problem(409, "wrong-state", None);
    let map = it.get("/v1/catalogues/default/versions/1/objects/rod/map").await;
    map.problem(409, "wrong-state", None);
    let session = it.session(json!({"method": "appearance"})).await;
    let readings = unposed(touches(CUBE, 40, 78, Pose::IDENTITY));
    let path = format!("/v1/sessions/{session}/readings");
    let added = it.post(&path, &json!({"readings": readings})).await.expect(200);
    assert_eq!(names(&added["belief"])[0], "cube", "{added}");
}

/// A client's learnt feature of four values, near 1 along the object's own axis.
fn coded(object: usize, n: usize, seed: u64) -> Vec<Value> {
    let mut stream = Stream::new(seed, Purpose::Shape, object as u64);
    let mut reading = quiet_reading();
    reading.as_object_mut().unwrap().remove("pose");
    let mut one = || {
        let along = |axis: usize| if axis == object { 1.0 } else { 0.0 };
        let feature: Vec<f64> = (0..4).map(|axis| along(axis) + 0.3 * stream.normal()).collect();
        reading["feature"] = json!(feature);
        reading.clone()
    };
    (0..n).map(|_| one()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn clients_train_and_recognise_by_their_own_features() {
    let it = Harness::start().await;
    // The images show no contact: the clients' features alone count.
    for (object, name) in ["cup", "bowl", "jug"].iter().enumerate() {
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
        let readings = coded(object, 120, 1);
        let path = format!("/v1/objects/{name}/readings");
        it.post(&path, &json!({"readings": readings})).await.expect(200);
        let mut other = coded(object, 1, 2);
        other[0]["feature"] = json!([1.0, 2.0]);
        let other = it.post(&path, &json!({"readings": other})).await;
        other.problem(422, "invalid-value", Some("/readings/0/feature"));
        let without = unposed(vec![quiet_reading()]);
        let without = it.post(&path, &json!({"readings": without})).await;
        without.problem(422, "invalid-value", Some("/readings/0/feature"));
    }
    let appearance = json!({"source": "features", "n_classes": [6]});
    let job = train(&it, json!({"sva": false, "appearance": appearance})).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let report = report(&it, 1).await;
    assert_eq!((&report["source"], &report["descriptor"]), (&json!("features"), &Value::Null));
    assert_eq!(report["feature_length"], 4);

    let session = it.session(json!({"method": "appearance"})).await;
    let path = format!("/v1/sessions/{session}/readings");
    let send = async |readings: Vec<Value>| it.post(&path, &json!({"readings": readings})).await;
    let added = send(coded(2, 10, 50)).await.expect(200);
    assert_eq!(names(&added["belief"])[0], "jug", "{added}");
    let mut short = coded(2, 2, 51);
    short[1]["feature"] = json!([0.5]);
    let problem = send(short).await.problem(422, "invalid-value", Some("/readings/1/feature"));
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("1 values, expected 4"), "{detail}");
    let bare = send(unposed(vec![quiet_reading()])).await;
    bare.problem(422, "invalid-value", Some("/readings/0/feature"));
    let mut infinite = coded(2, 1, 52);
    infinite[0]["feature"] = json!([0.0, 1e300, 0.0, 0.0]);
    send(infinite).await.problem(422, "invalid-value", Some("/readings/0/feature/1"));
    assert_eq!(it.get(&format!("/v1/sessions/{session}")).await.expect(200)["n_readings"], 10);
}

#[tokio::test(flavor = "multi_thread")]
async fn features_are_refused_without_a_model_of_them() {
    let it = trained().await;
    for (method, word) in [("appearance", "trained on images"), ("sva", "`sva`")] {
        let session = it.session(json!({"method": method})).await;
        let mut readings = touches(CUBE, 1, 5, Pose::IDENTITY);
        readings[0]["feature"] = json!([1.0, 2.0]);
        let path = format!("/v1/sessions/{session}/readings");
        let refused = it.post(&path, &json!({"readings": readings})).await;
        let problem = refused.problem(422, "invalid-value", Some("/readings/0/feature"));
        assert!(problem["detail"].as_str().unwrap().contains(word), "{problem}");
    }
    let appearance = json!({"source": "features"});
    let failed = train(&it, json!({"readings_per_object": 20, "appearance": appearance})).await;
    assert_eq!(failed["state"], "failed");
    assert!(failed["reason"].as_str().unwrap().contains("no readings with features"), "{failed}");
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_trainings_and_sessions_are_refused_by_name() {
    let it = Harness::trained().await;
    let session = it.post("/v1/sessions", &json!({"method": "appearance"})).await;
    session.problem(409, "wrong-state", None);
    let report = it.get("/v1/catalogues/default/versions/1/report/appearance").await;
    report.problem(409, "wrong-state", None);
    let wrong = [
        (json!({"variance_share": 1.5}), "/appearance/variance_share"),
        (json!({"n_classes": []}), "/appearance/n_classes"),
        (json!({"n_classes": [8, 1]}), "/appearance/n_classes/1"),
        (json!({"report_readings": 0}), "/appearance/report_readings"),
        (json!({"discriminant_axes": 0}), "/appearance/discriminant_axes"),
        (json!({"source": "features", "descriptor": "mnti"}), "/appearance/descriptor"),
        (json!({"classes": 3}), "/appearance/classes"),
    ];
    for (appearance, pointer) in wrong {
        let refused = it.post(TRAININGS, &json!({"appearance": appearance})).await;
        refused.problem(422, "invalid-value", Some(pointer));
    }
    let both = json!({"sva": false, "appearance": {}, "geometric": {"kind": "solid"}});
    it.post(TRAININGS, &both).await.problem(422, "invalid-value", Some("/sva"));
}
