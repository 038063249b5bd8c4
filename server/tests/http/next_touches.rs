//! Tests of next touches: ranked from the first moment, within the deadline, with clear refusals.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, touches};

fn resting_pose() -> Pose {
    Pose::from_parts(DQuat::from_rotation_z(0.4), DVec3::new(0.02, -0.03, 0.05))
}

/// An approach from a point of the object frame along a direction of it.
fn candidate(start: DVec3, direction: DVec3) -> Value {
    let object_from_sensor = Pose::from_parts(DQuat::from_rotation_arc(DVec3::Z, direction), start);
    let pose = resting_pose() * object_from_sensor;
    json!({"reach_m": 0.2, "pose": {
        "position": pose.translation.to_array(), "orientation": pose.rotation.to_array()}})
}

#[tokio::test(flavor = "multi_thread")]
async fn the_servers_approaches_are_ranked_from_the_start() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/next-touches");
    let ask = json!({"sensor": "digitacts-6x6", "deadline_ms": 10000, "n": 3});
    let problem = it.post(&path, &ask).await.problem(409, "wrong-state", None);
    assert!(problem["detail"].as_str().unwrap().contains("workspace"), "{problem}");

    let mut blind = ask.clone();
    blind["workspace"] = json!({"center": [0.02, -0.03, 0.05], "radius": 0.08});
    let first = it.post(&path, &blind).await.expect(200);
    assert_eq!(first["touches"].as_array().unwrap().len(), 3, "{first}");
    assert_eq!((&first["revision"], &first["complete"]), (&json!(0), &json!(true)));
    assert!(first["entropy_bits"].as_f64().unwrap() > 1.0, "two objects and none: {first}");

    let readings = json!({"readings": touches(BAR, 1, 77, resting_pose())});
    it.post(&format!("/v1/sessions/{session}/readings"), &readings).await.expect(200);
    let answer = it.post(&path, &ask).await.expect(200);
    assert_eq!(answer["revision"], 1);
    let best = &answer["touches"][0];
    assert!(best["information_bits"].as_f64().unwrap() > 0.05, "{answer}");
    assert!(best["contact_probability"].as_f64().unwrap() > 0.25, "{answer}");
    assert_eq!((&best["candidate"], &best["bits_per_cost"]), (&Value::Null, &Value::Null));
    assert_eq!(it.post(&path, &ask).await.expect(200), answer, "equal questions, equal answers");
    let mut other = ask.clone();
    other["seed"] = json!(1);
    assert_ne!(it.post(&path, &other).await.expect(200)["touches"], answer["touches"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn candidates_are_ranked_by_bits_per_cost() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}");
    let readings = json!({"readings": touches(BAR, 5, 77, resting_pose())});
    it.post(&format!("{path}/readings"), &readings).await.expect(200);
    // Down onto the bar's top, the same again at double the cost, and past it.
    let (above, past) = (DVec3::new(0.01, 0.0, 0.1), DVec3::new(0.01, 0.1, 0.1));
    let mut candidates = [past, above, above].map(|start| candidate(start, DVec3::NEG_Z));
    for (candidate, cost) in candidates.iter_mut().zip([1.0, 2.0, 1.0]) {
        candidate["cost"] = json!(cost);
    }
    let ask = json!({"sensor": "digitacts-6x6", "candidates": candidates, "recenters": true});
    let answer = it.post(&format!("{path}/next-touches"), &ask).await.expect(200);
    let touches = answer["touches"].as_array().unwrap();
    let order: Vec<&Value> = touches.iter().map(|touch| &touch["candidate"]).collect();
    assert_eq!(order, [&json!(2), &json!(1), &json!(0)], "{answer}");
    assert_eq!(touches[2]["contact_probability"], json!(0.0), "{answer}");
    let worth = |touch: &Value| touch["bits_per_cost"].as_f64().unwrap();
    assert!((worth(&touches[0]) - 2.0 * worth(&touches[1])).abs() < 1e-12, "{answer}");
    assert_eq!((&answer["evaluated"], &answer["complete"]), (&json!(3), &json!(true)));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_deadline_shortens_the_answer() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/next-touches");
    let one = candidate(DVec3::new(0.0, 0.0, 0.1), DVec3::NEG_Z);
    let ask = json!({"sensor": "digitacts-6x6", "candidates": vec![one; 1000], "deadline_ms": 1,
        "workspace": {"center": [0, 0, 0.05], "radius": 0.2}});
    let answer = it.post(&path, &ask).await.expect(200);
    assert_eq!(answer["complete"], json!(false), "{}", answer["evaluated"]);
    assert!((1..1000).contains(&answer["evaluated"].as_u64().unwrap()));
    assert!(!answer["touches"].as_array().unwrap().is_empty());
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_requests_name_the_field() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/next-touches");
    let good = candidate(DVec3::new(0.0, 0.0, 0.1), DVec3::NEG_Z);
    let with = |field: &str, value: Value| {
        let mut candidate = good.clone();
        candidate[field] = value;
        json!([good, candidate])
    };
    let turned = json!({"position": [0, 0, 0], "orientation": [0, 0, 0, 0]});
    for (field, value, pointer) in [
        ("sensor", json!("nose"), "/sensor"),
        ("n", json!(0), "/n"),
        ("deadline_ms", json!(0), "/deadline_ms"),
        ("deadline_ms", json!(10_001), "/deadline_ms"),
        ("candidates", json!([]), "/candidates"),
        ("candidates", with("reach_m", json!(0)), "/candidates/1/reach_m"),
        ("candidates", with("cost", json!(1)), "/candidates/1/cost"),
        ("candidates", with("pose", turned), "/candidates/1/pose/orientation"),
        ("workspace", json!({"center": [0, 0, 0], "radius": -1}), "/workspace/radius"),
        ("workspace", json!({"center": [0, 1e9, 0], "radius": 1}), "/workspace/center/1"),
    ] {
        let mut ask = json!({"sensor": "digitacts-6x6"});
        ask[field] = value;
        it.post(&path, &ask).await.problem(422, "invalid-value", Some(pointer));
    }
    let sva = it.session(json!({"method": "sva"})).await;
    let path = format!("/v1/sessions/{sva}/next-touches");
    let problem = it.post(&path, &json!({"sensor": "digitacts-6x6"})).await;
    let problem = problem.problem(409, "wrong-state", None);
    assert!(problem["detail"].as_str().unwrap().contains("`sva`"), "{problem}");
}
