//! Tests of contradictions in what clients send: said in a warning, or refused; never swallowed.

use std::collections::BTreeMap;

use palpate_core::pose::Pose;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{BAR, CUBE, Harness, off_box, quiet_reading, touches};

const DESCRIPTION: &str = include_str!("../../../schemas/openapi.json");

fn codes(answer: &Value) -> Vec<&str> {
    let warnings = answer["warnings"].as_array().unwrap();
    warnings.iter().map(|warning| warning["code"].as_str().unwrap()).collect()
}

/// Readings of one robot, numbered from `first`, with these stamps.
fn stamped(robot: &str, first: usize, seconds: &[Option<u32>]) -> Vec<Value> {
    let all = touches(BAR, 40, 61, Pose::IDENTITY);
    let number = |(index, sec): (usize, &Option<u32>)| {
        let mut reading = all[first + index].clone();
        reading["robot"] = json!(robot);
        reading["seq"] = json!(first + index);
        if let Some(sec) = sec {
            reading["stamp"] = json!({"sec": sec, "nanosec": 0});
        }
        reading
    };
    seconds.iter().enumerate().map(number).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn stamps_that_step_back_are_said_in_answer_and_belief() {
    let it = Harness::trained().await;
    let some = |from: u32| -> Vec<Option<u32>> { (0..3).map(|n| Some(from + 2 * n)).collect() };
    // The second batch of each case, and whether it contradicts the first.
    let cases = [
        (stamped("arm", 3, &some(200)), false),
        (stamped("arm", 3, &some(40)), true),
        (stamped("arm", 3, &some(0)), true),
        (stamped("arm", 3, &[None, None, None]), false),
        (stamped("other", 3, &some(40)), false),
        (stamped("arm", 3, &[Some(104), Some(300), Some(200)]), true),
    ];
    for (case, (second, is_wrong)) in cases.into_iter().enumerate() {
        for detail in ["full", "none"] {
            let session = it.session(json!({})).await;
            let path = format!("/v1/sessions/{session}/readings?belief={detail}");
            let first = json!({"readings": stamped("arm", 0, &some(100))});
            let first = it.post(&path, &first).await.expect(200);
            assert_eq!(codes(&first), [""; 0], "{case}");
            let answer = it.post(&path, &json!({ "readings": second })).await.expect(200);
            let expected = if is_wrong { vec!["stamps_backwards"] } else { Vec::new() };
            assert_eq!(codes(&answer), expected, "{case} {detail}");
            if is_wrong {
                let pointer = answer["warnings"][0]["pointer"].as_str().unwrap();
                assert!(pointer.ends_with("/stamp"), "{pointer}");
            }
            let belief = it.get(&format!("/v1/sessions/{session}/belief")).await.expect(200);
            assert_eq!(codes(&belief), expected, "{case} {detail}");
            // Earlier beliefs are as they were, and an order of arrival changes nothing.
            let past = it.get(&format!("/v1/sessions/{session}/belief?at=3")).await.expect(200);
            assert_eq!(codes(&past), [""; 0], "{case}");
        }
    }
}

/// A value of each field of a reading that differs from the usual one.
fn other_fields() -> BTreeMap<&'static str, Value> {
    let contact = json!({"position": [0.0, 0.0, 0.1], "position_deviation_m": 0.01});
    let mut image = vec![0.0; 36];
    image[14] = 9e3;
    BTreeMap::from([
        ("robot", json!("other")),
        ("seq", json!(7)),
        ("sensor", json!("copy")),
        ("frame_id", json!("table")),
        ("stamp", json!({"sec": 5, "nanosec": 0})),
        ("pose", json!({"position": [0.0, 0.0, 0.2], "orientation": [0.0, 0.0, 0.0, 1.0]})),
        ("image", json!(image)),
        ("contact", contact),
        ("shear", json!(vec![[1.0, 2.0]; 36])),
        ("feature", json!([1.0, 2.0])),
        ("approach_m", json!(0.01)),
        ("object_moved", json!({"position_m": 0.01, "angle_rad": 0.1})),
    ])
}

#[tokio::test(flavor = "multi_thread")]
async fn every_field_of_a_reading_has_an_effect_or_is_refused() {
    let it = Harness::trained().await;
    let copy = json!({"name": "copy", "preset": "digitacts-6x6"});
    it.post("/v1/sensors", &copy).await.expect(201);
    let description: Value = serde_json::from_str(DESCRIPTION).unwrap();
    let fields = description["components"]["schemas"]["Reading"]["properties"].as_object().unwrap();
    let others = other_fields();
    for field in fields.keys() {
        let value = others.get(field.as_str());
        let value = value.unwrap_or_else(|| panic!("{field} needs a value in other_fields"));
        for taught in [false, true] {
            let path = if taught {
                let name = format!("taught-{}", field.replace('_', "-"));
                it.post("/v1/objects", &json!({ "name": name })).await.expect(201);
                format!("/v1/objects/{name}/readings")
            } else {
                format!("/v1/sessions/{}/readings", it.session(json!({})).await)
            };
            let mut reading = quiet_reading();
            (reading["robot"], reading["seq"]) = (json!("arm"), json!(3));
            let mut other = reading.clone();
            // Beside the usual reading, so that a second frame or sensor shows.
            other["seq"] = json!(4);
            other[field] = value.clone();
            let sent = json!({"readings": [reading, other]});
            let answer = it.post(&path, &sent).await;
            if answer.status == 422 {
                let text = answer.problem(422, "invalid-value", None).to_string();
                assert!(text.contains(field.as_str()), "{path} {field}: {text}");
                continue;
            }
            answer.expect(200);
            let stored = it.get(&path).await.expect(200);
            let [usual, other] = [0, 1].map(|n| stored["items"][n][field].clone());
            assert!(usual != other, "{path} swallowed {field}: {stored}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_method_leaves_out_is_said() {
    let it = Harness::trained().await;
    let mut reading = quiet_reading();
    reading["approach_m"] = json!(0.02);
    reading["object_moved"] = json!({"position_m": 0.01, "angle_rad": 0.1});
    let readings = json!({"readings": [quiet_reading(), reading]});
    for (method, expected) in
        [("surface", vec![]), ("sva", vec!["motion_ignored", "approach_ignored"])]
    {
        let session = it.session(json!({ "method": method })).await;
        let path = format!("/v1/sessions/{session}/readings?belief=none");
        let answer = it.post(&path, &readings).await.expect(200);
        assert_eq!(codes(&answer), expected, "{method}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn one_shape_under_two_names_is_said_in_every_training() {
    let it = Harness::start().await;
    // The same body, moved and cut otherwise.
    let moved = "OFF\n8 12 0\n5 7 9\n45 7 9\n5 47 9\n45 47 9\n5 7 49\n45 7 49\n5 47 49\n45 47 49\n\
        3 0 2 3\n3 0 3 1\n3 4 5 7\n3 4 7 6\n3 0 1 5\n3 0 5 4\n3 2 6 7\n3 2 7 3\n3 0 4 6\n3 0 6 2\n\
        3 1 3 7\n3 1 7 5\n";
    let meshes = [("cube", off_box(CUBE)), ("again", off_box(CUBE)), ("moved", moved.to_owned())];
    for (name, mesh) in meshes.iter().chain([&("bar", off_box(BAR))]) {
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
        it.put_mesh(name, mesh).await.expect(200);
    }
    let readings = json!({"readings": touches(BAR, 80, 3, Pose::IDENTITY)});
    for name in ["taught", "taught-again"] {
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
        it.post(&format!("/v1/objects/{name}/readings"), &readings).await.expect(200);
    }
    let report = async |catalogue: &str, version: u32, mut training: Value| {
        training["readings_per_object"] = json!(60);
        let path = format!("/v1/catalogues/{catalogue}/trainings");
        let job = it.post(&path, &training).await.expect(202);
        let job = it.finished(job["id"].as_str().unwrap()).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        it.get(&format!("/v1/catalogues/{catalogue}/versions/{version}/report")).await.expect(200)
    };
    let kinds = [
        json!({"sva": false, "surface": true}),
        json!({"sva": true, "surface": false, "n_classes": 4}),
        json!({"sva": false, "surface": false, "appearance": {"n_classes": [4]}}),
    ];
    let pairs = [["cube", "again"], ["cube", "moved"], ["taught", "taught-again"], ["cube", "bar"]];
    for (kind, settings) in kinds.iter().enumerate() {
        for (pair, names) in pairs.iter().enumerate() {
            let mut training = settings.clone();
            training["objects"] = json!(names);
            let report = report(&format!("c{kind}-{pair}"), 1, training).await;
            let is_said = codes(&report).contains(&"duplicate_objects");
            assert_eq!(is_said, pair < 3, "{settings} {names:?}: {report}");
        }
    }
    let more = report("c0-3", 2, json!({"extend": 1, "objects": ["again"]})).await;
    assert!(codes(&more).contains(&"duplicate_objects"), "{more}");
}

#[tokio::test(flavor = "multi_thread")]
async fn presses_that_are_all_alike_are_called_so() {
    let it = Harness::start().await;
    let mut press = quiet_reading();
    press["image"][14] = json!(9e3);
    for (name, step) in [("frozen", 0.0), ("jittered", 1e-6)] {
        let nth = |n: u32| {
            let mut press = press.clone();
            press["pose"]["position"][0] = json!(f64::from(n) * step);
            press
        };
        let readings: Vec<Value> = (0..180).map(nth).collect();
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
        let path = format!("/v1/objects/{name}/readings");
        it.post(&path, &json!({ "readings": readings })).await.expect(200);
        let training = json!({"objects": [name], "sva": false, "surface": true});
        let job = it.post("/v1/catalogues/alike/trainings", &training).await.expect(202);
        let job = it.finished(job["id"].as_str().unwrap()).await;
        let reason = job["reason"].as_str().unwrap();
        assert!(reason.contains("180 readings") && reason.contains("look alike"), "{job}");
    }
    // Beside an object that can be learnt, each is trained, and the report says what it knows.
    it.post("/v1/objects", &json!({"name": "bar"})).await.expect(201);
    it.put_mesh("bar", &off_box(BAR)).await.expect(200);
    let training = json!({"sva": false, "surface": true, "readings_per_object": 80});
    let job = it.post("/v1/catalogues/alike/trainings", &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    let path = format!("/v1/catalogues/alike/versions/{}/report", job["version"]);
    let report = it.get(&path).await.expect(200);
    for object in report["objects"].as_array().unwrap() {
        let is_place = object["name"] != "bar";
        assert_eq!(codes(object).contains(&"few_touches"), is_place, "{object}");
        assert!(!is_place || object["symmetry_by"] == "undetermined", "{object}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn no_route_ignores_a_parameter_of_its_query() {
    let it = Harness::start().await;
    let description: Value = serde_json::from_str(DESCRIPTION).unwrap();
    let mut n = 0;
    for (path, operations) in description["paths"].as_object().unwrap() {
        let path = path.split('/').map(|part| if part.starts_with('{') { "1" } else { part });
        let path = path.collect::<Vec<_>>().join("/");
        for method in operations.as_object().unwrap().keys() {
            let Ok(method) = Method::from_bytes(method.to_uppercase().as_bytes()) else { continue };
            if !["GET", "PUT", "POST", "PATCH", "DELETE"].contains(&method.as_str()) {
                continue;
            }
            let answer = it.send(method.clone(), &format!("{path}?no_such=1"), None).await;
            let problem = answer.problem(422, "invalid-value", Some("?no_such"));
            assert!(problem["detail"].is_string(), "{method} {path}");
            n += 1;
        }
    }
    assert!(n > 90, "{n}");
    // What has no parameters and no answer of its own stays as it was.
    it.get("/livez").await.expect(200);
    it.get("/livez?").await.expect(200);
    assert_eq!(it.get("/nowhere?x=1").await.status, 404);
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_are_named_as_ros_names_them() {
    let it = Harness::trained().await;
    let named = |frame: Value| {
        let mut reading = quiet_reading();
        reading["frame_id"] = frame;
        json!({"readings": [reading]})
    };
    let none = [json!(null), json!("")];
    let base = [json!("base_link"), json!("/base_link")];
    for stated in none.iter().chain(&base) {
        let session = it.session(json!({"frame_id": stated})).await;
        let shown = it.get(&format!("/v1/sessions/{session}")).await.expect(200);
        let is_named = base.contains(stated);
        let expected = if is_named { json!("base_link") } else { Value::Null };
        assert_eq!(shown["frame_id"], expected);
        let path = format!("/v1/sessions/{session}/readings?belief=none");
        for frame in none.iter().chain(&base) {
            let status = it.post(&path, &named(frame.clone())).await.status;
            let is_right = is_named || none.contains(frame);
            assert_eq!(status, if is_right { 200 } else { 422 }, "{stated} {frame}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_driver_that_begins_again_is_told_what_to_do() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/readings?belief=none");
    let readings = stamped("arm", 0, &[None, None]);
    it.post(&path, &json!({ "readings": readings })).await.expect(200);
    let mut again = readings[1].clone();
    again["seq"] = json!(0);
    let refused = it.post(&path, &json!({"readings": [again]})).await;
    let problem = refused.problem(409, "conflict", Some("/readings/0"));
    assert!(problem["detail"].as_str().unwrap().contains("begins a session"), "{problem}");
}
