//! What a session believed when, and what each reading contributed.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{BAR, CUBE, Harness, touches};

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

/// A step says of a revision what its belief said.
#[track_caller]
fn check(step: &Value, belief: &Value) {
    assert_eq!(step["revision"], belief["revision"]);
    assert_eq!(step["n_readings"], belief["n_readings"]);
    assert_eq!(step["best"]["object"], belief["objects"][0]["object"]);
    assert_eq!(step["best"]["probability"], belief["objects"][0]["probability"]);
    assert_eq!(step["unknown"], belief["unknown"]);
    assert_eq!(step["entropy_bits"], belief["entropy_bits"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_replay_has_every_belief_also_of_late_and_withdrawn_readings() {
    let it = Harness::start().await;
    it.train().await;
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
    assert_eq!((steps.len(), &replay["upto"], &replay["next_after"]), (10, &json!(10), &Value::Null));
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
    assert_eq!(page["belief"]["revision"], 10);
    for (query, field) in [("upto=11", "?upto"), ("upto=2&after=3", "?after"), ("limit=0", "?limit")]
    {
        let refused = it.get(&format!("{path}/replay?{query}")).await;
        refused.problem(422, "invalid-value", Some(field));
    }
}

fn show(what: &str, place: usize, e: &Value) {
    let of = |f: &str| -> Vec<f64> { e["readings"].as_array().unwrap().iter().map(|r| r[f].as_f64().unwrap_or(99.0)).collect() };
 let dis = disagreeing(e);
    let mut s = if e["readings"][0]["fit_bits"].is_null() {of("support_bits")} else {of("fit_bits")}; let planted = s.get(place).copied(); if planted.is_some() { s.remove(place); }
    s.sort_by(f64::total_cmp);
    eprintln!("RES {what} {} {:.4} planted {planted:.1?} others min {:.1} median {:.1} dis {dis:?}", e["answer"]["name"], e["answer"]["probability"].as_f64().unwrap(), s[0], s[s.len()/2]);
}

/// What disagrees in a session, by number.
fn disagreeing(explanation: &Value) -> Vec<u64> {
    let readings = explanation["readings"].as_array().unwrap().iter();
    let those = readings.filter(|reading| reading["disagrees"] == true);
    those.map(|reading| reading["number"].as_u64().unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_reading_is_named_and_in_a_clean_session_none() {
    let it = Harness::start().await;
    it.train().await;
    let training = json!({"readings_per_object": 60, "n_classes": 8, "seed": 3,
        "geometry": {"kind": "solid"}, "appearance": {"n_classes": [8]}, "objects": ["cube", "bar"]});
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    it.finished(job["id"].as_str().unwrap()).await;
    let pose = json!({"position": [0.02, -0.03, 0.05], "orientation": [0.0, 0.0, 0.0, 1.0]});
    let prior = json!({"kind": "bounded", "pose": pose, "half_extents": [0.01, 0.01, 0.01],
        "half_angle": 0.5});
    for begin in [
        json!({"method": "hybrid"}),
        json!({"method": "sva"}),
        json!({"method": "appearance"}),
        json!({"method": "geometric", "pose_prior": prior}),
    ] {
    for n in [6, 12, 24] {
    for seed in 101..(if n==12 {113} else {106}) {
        let method = begin["method"].as_str().unwrap();
        let clean = it.session(begin.clone()).await;
        let mut readings = numbered(touches(BAR, n, seed, resting_pose()));
        post(&it, &clean, &readings).await;
        let path = format!("/v1/sessions/{clean}/explain");
        let t = std::time::Instant::now();
        let explanation = it.get(&path).await.expect(200);
        let t = t.elapsed().as_millis();
        show(&format!("{method} {n} {seed} {t}ms clean"), 99, &explanation);
        let place = (seed as usize) % n;
        let right = readings[place].clone();
        let x = readings[place]["pose"]["position"][0].as_f64().unwrap();
        readings[place]["pose"]["position"][0] = json!(x + 0.05);
        let wrong = it.session(begin.clone()).await;
        post(&it, &wrong, &readings).await;
        let explanation = it.get(&format!("/v1/sessions/{wrong}/explain")).await.expect(200);
        show(&format!("{method} {n} {seed} moved"), place, &explanation);
        readings[place] = right;
        let cube = numbered(touches(CUBE, n, seed + 50, resting_pose()));
        readings[place]["pose"] = cube[place]["pose"].clone();
        readings[place]["image"] = cube[place]["image"].clone();
        let wrong = it.session(begin.clone()).await;
        post(&it, &wrong, &readings).await;
        let explanation = it.get(&format!("/v1/sessions/{wrong}/explain")).await.expect(200);
        show(&format!("{method} {n} {seed} cube"), place, &explanation);
    }}}
    panic!();
}
