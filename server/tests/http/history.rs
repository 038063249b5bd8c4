//! Tests of a session's history: its beliefs over time, and the contributions of readings.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, quiet_reading, touches};

fn resting_pose() -> Pose {
    Pose::from_parts(DQuat::from_rotation_z(0.4), DVec3::new(0.02, -0.03, 0.05))
}

/// Readings of one robot with numbers and stamps.
fn numbered(mut readings: Vec<Value>) -> Vec<Value> {
    for (seq, reading) in readings.iter_mut().enumerate() {
        reading["robot"] = json!("arm");
        reading["seq"] = json!(seq);
        reading["stamp"] = json!({"sec": seq, "nanosec": 0});
    }
    readings
}

async fn post(it: &Harness, session: &str, readings: &[Value]) -> Value {
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &json!({"readings": readings})).await.expect(200)["belief"].clone()
}

/// Checks that a step equals the belief of its revision.
#[track_caller]
fn check(step: &Value, belief: &Value) {
    assert_eq!(step["revision"], belief["revision"]);
    assert_eq!(step["n_readings"], belief["n_readings"]);
    assert_eq!(step["best"]["object"], belief["objects"][0]["object"]);
    assert_eq!(step["best"]["probability"], belief["objects"][0]["probability"]);
    assert_eq!(step["objects"], belief["objects"], "a catalogue of less than ten objects");
    assert_eq!(step["unknown"], belief["unknown"]);
    assert_eq!(step["entropy_bits"], belief["entropy_bits"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_replay_has_all_beliefs_with_late_and_retracted_readings() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}");
    let readings = numbered(touches(BAR, 8, 61, resting_pose()));
    let mut beliefs = Vec::new();
    for index in [0, 1, 2, 7, 4, 3, 5] {
        beliefs.push(post(&it, &session, &readings[index..=index]).await);
    }
    let withdrawn = it.send(Method::DELETE, &format!("{path}/readings/arm/4"), None).await;
    beliefs.push(withdrawn.expect(200)["belief"].clone());
    beliefs.push(post(&it, &session, &readings[6..=6]).await);
    it.post(&format!("{path}/close"), &json!({})).await.expect(200);
    let it = it.restart().await;
    let replay = it.get(&format!("{path}/replay")).await.expect(200);
    let steps = replay["steps"].as_array().unwrap();
    assert_eq!(
        (steps.len(), &replay["upto"], &replay["next_after"]),
        (10, &json!(10), &Value::Null)
    );
    for (step, belief) in steps.iter().zip(&beliefs) {
        check(step, belief);
    }
    let late: Vec<bool> =
        steps.iter().filter_map(|step| step["change"]["late"].as_bool()).collect();
    assert_eq!(late, [false, false, false, false, true, true, true, true]);
    assert_eq!(steps[7]["change"], json!({"kind": "retraction", "number": 4}));
    assert_eq!(steps[9]["change"], json!({"kind": "closed"}));
    assert_eq!(steps[4]["change"]["seq"], 4);
    for upto in [0, 4, 6, 9] {
        let replay = it.get(&format!("{path}/replay?upto={upto}&after=0")).await.expect(200);
        assert_eq!(replay["steps"].as_array().unwrap().len(), upto);
        let then = it.get(&format!("{path}/belief?at={upto}")).await.expect(200);
        assert_eq!(replay["belief"], then);
        assert!(upto == 0 || then == beliefs[upto - 1], "as it was answered");
    }
    let page = it.get(&format!("{path}/replay?after=3&limit=2&poses=0")).await.expect(200);
    assert_eq!(page["steps"].as_array().unwrap()[..], steps[3..5]);
    assert_eq!((&page["next_after"], &page["belief"]["poses"]), (&json!(5), &json!([])));
    let then = it.get(&format!("{path}/belief?at=5&poses=0")).await.expect(200);
    assert_eq!(page["belief"], then);
    for (query, field) in
        [("upto=11", "?upto"), ("upto=2&after=3", "?after"), ("limit=0", "?limit")]
    {
        let refused = it.get(&format!("{path}/replay?{query}")).await;
        refused.problem(422, "invalid-value", Some(field));
    }
}

/// Numbers of the disagreeing readings of a session.
fn disagreeing(explanation: &Value) -> Vec<u64> {
    let readings = explanation["readings"].as_array().unwrap().iter();
    let those = readings.filter(|reading| reading["disagrees"] == true);
    those.map(|reading| reading["number"].as_u64().unwrap()).collect()
}

async fn explain(it: &Harness, session: &str) -> Value {
    it.get(&format!("/v1/sessions/{session}/explain")).await.expect(200)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_reading_is_named_and_few_in_a_clean_session() {
    let it = Harness::trained().await;
    let mut n_named_in_vain = 0;
    for seed in 101..109 {
        let clean = it.session(json!({})).await;
        let mut readings = numbered(touches(BAR, 12, seed, resting_pose()));
        post(&it, &clean, &readings).await;
        let explanation = explain(&it, &clean).await;
        assert_eq!(explanation["answer"]["name"], "bar");
        n_named_in_vain += disagreeing(&explanation).len();
        // A touch of the bar in the air above it: its robot's pose was wrong.
        let place = seed % 10;
        let z = readings[place as usize]["pose"]["position"][2].as_f64().unwrap();
        readings[place as usize]["pose"]["position"][2] = json!(z + 0.03);
        let wrong = it.session(json!({})).await;
        post(&it, &wrong, &readings).await;
        let explanation = explain(&it, &wrong).await;
        assert!(disagreeing(&explanation).contains(&place), "seed {seed}: {explanation}");
        // Without it hardly anything disagrees.
        let path = format!("/v1/sessions/{wrong}/readings/{place}");
        it.send(Method::DELETE, &path, None).await.expect(200);
        let explanation = explain(&it, &wrong).await;
        let left = disagreeing(&explanation);
        assert!(!left.contains(&place) && left.len() <= 1, "seed {seed}: {explanation}");
    }
    // In 96 touches: an edge between the 60 touches of the map may have been missed there.
    assert!(n_named_in_vain <= 1, "{n_named_in_vain} readings in order are named");
}

#[tokio::test(flavor = "multi_thread")]
async fn none_of_these_is_explained_by_what_speaks_against() {
    let it = Harness::trained().await;
    let clean = it.session(json!({})).await;
    post(&it, &clean, &numbered(touches(BAR, 10, 120, resting_pose()))).await;
    let explanation = explain(&it, &clean).await;
    assert_eq!(explanation["nearest"]["name"], "bar");
    assert_eq!(explanation["against"], json!([]));
    let heights: Vec<f64> = explanation["readings"]
        .as_array()
        .unwrap()
        .iter()
        .map(|reading| reading["misfit"]["height_m"].as_f64().unwrap())
        .collect();
    assert!(heights.iter().all(|height| height.abs() < 2e-3), "{heights:?}");

    // Positions in another unit: the touched object is larger than any of the catalogue.
    let mut readings = numbered(touches(BAR, 10, 120, resting_pose()));
    for coordinate in readings
        .iter_mut()
        .flat_map(|reading| reading["pose"]["position"].as_array_mut().unwrap().iter_mut())
    {
        *coordinate = json!(1.7 * coordinate.as_f64().unwrap());
    }
    let scaled = it.session(json!({})).await;
    post(&it, &scaled, &readings).await;
    let explanation = explain(&it, &scaled).await;
    assert_eq!(explanation["answer"]["name"], Value::Null, "{explanation}");
    assert!(explanation["nearest"]["name"].is_string());
    let against = explanation["against"].as_array().unwrap();
    let said: Vec<&str> = against.iter().map(|one| one["code"].as_str().unwrap()).collect();
    let is_off = |code: &&str| ["away_from_surface", "above_surface"].contains(code);
    assert!(said.iter().any(is_off), "{explanation}");
    let objecting = against[0]["readings"].as_array().unwrap().len();
    assert!(objecting >= 3, "{against:?}");
    let detail = against[0]["detail"].as_str().unwrap();
    assert!(detail.starts_with(&format!("{objecting} of 10 readings")), "{detail}");
}

#[tokio::test(flavor = "multi_thread")]
async fn contributions_equal_leaving_each_reading_out() {
    let it = Harness::trained().await;
    let training = json!({"readings_per_object": 60, "n_classes": 8, "seed": 3,
        "appearance": {"n_classes": [8]}});
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    it.finished(job["id"].as_str().unwrap()).await;
    let readings = numbered(touches(BAR, 5, 104, resting_pose()));
    for method in ["surface", "sva", "appearance"] {
        let session = it.session(json!({"method": method})).await;
        let whole = post(&it, &session, &readings).await;
        let explanation = explain(&it, &session).await;
        assert_eq!(explanation["complete"], true);
        assert_eq!(explanation["answer"]["name"], whole["objects"][0]["name"]);
        for left_out in 0..readings.len() {
            let mut others = readings.clone();
            others.remove(left_out);
            let other = it.session(json!({"method": method})).await;
            let without = post(&it, &other, &others).await;
            let (p, q) = (identities(&whole), identities(&without));
            let bits = p[0].1.log2() - q.iter().find(|(name, _)| *name == p[0].0).unwrap().1.log2();
            let divergence: f64 = p
                .iter()
                .map(|(name, p)| p * (p / q.iter().find(|q| q.0 == *name).unwrap().1).log2())
                .sum();
            let found = &explanation["readings"][left_out];
            let close = |field: &str, expected: f64| {
                let found = found[field].as_f64().unwrap();
                assert!((found - expected).abs() < 1e-9, "{method} {field}: {found} {expected}");
            };
            close("bits", bits);
            close("information_bits", divergence);
        }
    }
}

/// Names and probabilities, likeliest object first, "none of these" last.
fn identities(belief: &Value) -> Vec<(String, f64)> {
    let objects = belief["objects"].as_array().unwrap().iter();
    let known = objects.map(|object| {
        (object["name"].to_string(), object["probability"].as_f64().unwrap().max(1e-12))
    });
    let unknown = belief["unknown"].as_f64().unwrap().max(1e-12);
    known.chain([("unknown".to_owned(), unknown)]).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_belief_of_too_many_readings_is_not_explained() {
    let it = Harness::trained().await;
    let session = it.session(json!({"method": "sva"})).await;
    let readings: Vec<Value> = (0..201).map(|_| quiet_reading()).collect();
    post(&it, &session, &readings).await;
    let path = format!("/v1/sessions/{session}/explain");
    it.get(&path).await.problem(409, "wrong-state", None);
    let earlier = it.get(&format!("{path}?at=3")).await.expect(200);
    assert_eq!(earlier["readings"].as_array().unwrap().len(), 3);
    assert_eq!((&earlier["revision"], &earlier["readings"][0]["bits"]), (&json!(3), &json!(0.0)));
    it.get(&format!("{path}?at=202")).await.problem(422, "invalid-value", Some("?at"));
}
