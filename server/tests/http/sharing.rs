//! Tests of sessions shared by robots, moving objects, the stopping risk, and the prior of
//! "none of these".

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, touches};

fn resting_pose() -> Pose {
    Pose::from_parts(DQuat::from_rotation_z(0.4), DVec3::new(0.02, -0.03, 0.05))
}

/// Distance of the likeliest pose of a belief from the truth, metres.
fn error(belief: &Value, truth: &Pose) -> f64 {
    let at = &belief["poses"][0]["pose"]["position"];
    let at = DVec3::from_array([0, 1, 2].map(|axis| at[axis].as_f64().unwrap()));
    at.distance(truth.translation)
}

/// The probability of the bar.
fn bar(belief: &Value) -> f64 {
    let objects = belief["objects"].as_array().unwrap();
    let bar = objects.iter().find(|object| object["name"] == "bar").unwrap();
    bar["probability"].as_f64().unwrap()
}

/// Posts readings of a robot, each with `more` fields; the belief.
async fn post(
    it: &Harness,
    session: &str,
    robot: &str,
    readings: Vec<Value>,
    more: &Value,
) -> Value {
    let name = |(seq, mut reading): (usize, Value)| {
        reading["robot"] = json!(robot);
        reading["seq"] = json!(seq);
        for (field, value) in more.as_object().unwrap() {
            reading[field] = value.clone();
        }
        reading
    };
    let readings: Vec<Value> = readings.into_iter().enumerate().map(name).collect();
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &json!({"readings": readings})).await.expect(200)["belief"].clone()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_with_a_stated_base_error_shares_a_session() {
    let it = Harness::trained().await;
    let off = Pose::from_parts(DQuat::IDENTITY, DVec3::new(0.003, -0.003, 0.002));
    let base = json!({"position_m": 0.003, "angle_rad": 0.02});
    let mut errors = Vec::new();
    for robots in [json!([{"robot": "loose", "base": base}]), json!([])] {
        let begin = json!({"robots": robots, "risk": 0.05});
        let session = it.session(begin).await;
        let known = it.get(&format!("/v1/sessions/{session}")).await.expect(200);
        assert_eq!(known["robots"], robots);
        post(&it, &session, "exact", touches(BAR, 8, 77, resting_pose()), &json!({})).await;
        let shifted = touches(BAR, 8, 78, off * resting_pose());
        let belief = post(&it, &session, "loose", shifted, &json!({})).await;
        errors.push(error(&belief, &resting_pose()));
        let stop = &belief["stop"];
        assert_eq!(stop["risk"], 0.05);
        let found = stop["found"].as_f64().unwrap();
        assert_eq!(stop["reached"], found <= 0.05, "{stop}");
    }
    assert!(errors[0] < errors[1], "told {} m, not told {} m", errors[0], errors[1]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_moved_object_keeps_its_identity_after_a_restart() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let before = post(&it, &session, "a", touches(BAR, 8, 77, resting_pose()), &json!({})).await;
    assert!(bar(&before) > 0.8, "{before}");
    assert_eq!(before["stop"], Value::Null, "no risk was named");
    let shift = Pose::from_parts(DQuat::IDENTITY, DVec3::new(0.006, 0.0, 0.0));
    let now = shift * resting_pose();
    let mut readings = touches(BAR, 8, 79, now);
    let rest = readings.split_off(1);
    let moved = json!({"object_moved": {"position_m": 0.006, "angle_rad": 0.05}});
    let loose = post(&it, &session, "b", readings, &moved).await;
    assert!(bar(&loose) > 0.5, "{loose}");
    let after = post(&it, &session, "c", rest, &json!({})).await;
    assert!(bar(&after) > 0.8, "{after}");
    // The same readings folded again from the journal.
    let path = format!("/v1/sessions/{session}/belief?at=16");
    let again = it.get(&path).await.expect(200);
    assert_eq!(again["objects"], after["objects"]);
    assert_eq!(again["poses"], after["poses"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_drifting_object_is_recognised_when_announced() {
    let it = Harness::trained().await;
    let mut deviations = Vec::new();
    for begin in [json!({}), json!({"object_moves": {"position_m": 0.003, "angle_rad": 0.05}})] {
        let session = it.session(begin.clone()).await;
        let known = it.get(&format!("/v1/sessions/{session}")).await.expect(200);
        assert_eq!(known["object_moves"], begin["object_moves"]);
        let mut last = Value::Null;
        for touch in 0..10 {
            let shift = 0.003 * if touch % 2 == 0 { 1.0 } else { -1.0 };
            let moved = Pose::from_parts(DQuat::IDENTITY, DVec3::new(shift, -shift, 0.0));
            let reading = touches(BAR, 10, 77, moved * resting_pose()).remove(touch);
            last = post(&it, &session, &format!("r{touch}"), vec![reading], &json!({})).await;
        }
        assert!(begin == json!({}) || bar(&last) > 0.5, "{last}");
        deviations.push(last["poses"][0]["covariance"][0].as_f64().unwrap());
    }
    assert!(deviations[1] > deviations[0], "known less well: {deviations:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_free_path_through_an_object_is_evidence_against_it() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}");
    let readings = json!({"readings": touches(BAR, 3, 77, resting_pose())});
    let belief =
        it.post(&format!("{path}/readings"), &readings).await.expect(200)["belief"].clone();
    let mut through = touches(BAR, 1, 77, Pose::IDENTITY).remove(0);
    let n = through["image"].as_array().unwrap().len();
    through["image"] = json!(vec![0.0; n]);
    // Down through the middle of the likeliest pose.
    let at = &belief["poses"][0]["pose"]["position"];
    let place = |axis: usize| at[axis].as_f64().unwrap();
    through["pose"] = json!({"position": [place(0), place(1), place(2) - 0.1],
        "orientation": [1.0, 0.0, 0.0, 0.0]});
    through["approach_m"] = json!(0.2);
    let readings = json!({"readings": [through]});
    let after = it.post(&format!("{path}/readings"), &readings).await.expect(200)["belief"].clone();
    let weight = |belief: &Value| belief["poses"][0]["weight"].as_f64().unwrap();
    let unknown = |belief: &Value| belief["unknown"].as_f64().unwrap();
    assert!(
        weight(&after) < weight(&belief) || unknown(&after) > unknown(&belief),
        "{belief}\n{after}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_sets_the_prior_of_none_of_these() {
    let it = Harness::trained().await;
    let mut odds = Vec::new();
    for (begin, prior) in [(json!({}), 0.05), (json!({"unknown_prior": 0.5}), 0.5)] {
        let session = it.session(begin).await;
        let known = it.get(&format!("/v1/sessions/{session}")).await.expect(200);
        assert_eq!(known["unknown_prior"], prior);
        let before = it.get(&format!("/v1/sessions/{session}/belief")).await.expect(200);
        assert!((before["unknown"].as_f64().unwrap() - prior).abs() < 1e-9, "{before}");
        let after = post(&it, &session, "a", touches(BAR, 1, 77, resting_pose()), &json!({})).await;
        let unknown = after["unknown"].as_f64().unwrap();
        odds.push(unknown / (1.0 - unknown));
    }
    // Equal evidence: the odds differ by (0.5/0.5)/(0.05/0.95) = 19.
    assert!((odds[1] / odds[0] - 19.0).abs() < 1e-6, "{odds:?}");
    let other = it.session(json!({"method": "sva"})).await;
    let other = it.get(&format!("/v1/sessions/{other}")).await.expect(200);
    assert_eq!(other["unknown_prior"], Value::Null, "it knows no none of these");
}

#[tokio::test(flavor = "multi_thread")]
async fn values_out_of_range_are_named() {
    let it = Harness::trained().await;
    let wrong = [
        (json!({"risk": 0.9}), "/risk"),
        (
            json!({"robots": [{"robot": "", "base": {"position_m": 0.01, "angle_rad": 0.1}}]}),
            "/robots/0/robot",
        ),
        (
            json!({"robots": [{"robot": "a", "base": {"position_m": 0.5, "angle_rad": 0.1}}]}),
            "/robots/0/base/position_m",
        ),
        (json!({"method": "sva", "risk": 0.1}), "/risk"),
        (json!({"unknown_prior": 0.0}), "/unknown_prior"),
        (json!({"unknown_prior": 1}), "/unknown_prior"),
        (json!({"method": "sva", "unknown_prior": 0.1}), "/unknown_prior"),
        (
            json!({"object_moves": {"position_m": 0.0, "angle_rad": 0.1}}),
            "/object_moves/position_m",
        ),
    ];
    for (request, pointer) in wrong {
        it.post("/v1/sessions", &request).await.problem(422, "invalid-value", Some(pointer));
    }
    let session = it.session(json!({})).await;
    let mut reading = touches(BAR, 1, 77, resting_pose()).remove(0);
    reading["approach_m"] = json!(-1.0);
    reading["object_moved"] = json!({"position_m": 0.01, "angle_rad": 0.1});
    let path = format!("/v1/sessions/{session}/readings");
    let readings = json!({"readings": [reading]});
    it.post(&path, &readings).await.problem(422, "invalid-value", Some("/readings/0/approach_m"));
    let mut reading = readings["readings"][0].clone();
    reading["approach_m"] = json!(0.1);
    reading["object_moved"]["angle_rad"] = json!(0.0);
    let readings = json!({"readings": [reading]});
    let pointer = "/readings/0/object_moved/angle_rad";
    it.post(&path, &readings).await.problem(422, "invalid-value", Some(pointer));
}
