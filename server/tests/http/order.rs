//! Tests of the order of arrival, repeats and retractions: one set of readings gives one belief.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, content, touches};

fn resting_pose() -> Pose {
    Pose::from_parts(DQuat::from_rotation_z(0.4), DVec3::new(0.02, -0.03, 0.05))
}

/// Readings of three robots in turn, with stamps; every fourth reports a motion of the object.
fn of_a_fleet(n: usize) -> Vec<Value> {
    let number = |(index, mut reading): (usize, Value)| {
        reading["robot"] = json!(format!("arm-{}", index % 3));
        reading["seq"] = json!(index / 3);
        // Pairs of robots press at the same time.
        reading["stamp"] = json!({"sec": 100 + index / 2, "nanosec": 5});
        if index % 4 == 3 {
            reading["object_moved"] = json!({"position_m": 0.001, "angle_rad": 0.01});
        }
        reading
    };
    touches(BAR, n, 61, resting_pose()).into_iter().enumerate().map(number).collect()
}

async fn post(it: &Harness, session: &str, readings: &[Value]) -> Value {
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &json!({"readings": readings})).await.expect(200)
}

async fn retract(it: &Harness, session: &str, reading: &str) -> Value {
    let path = format!("/v1/sessions/{session}/readings/{reading}");
    it.send(Method::DELETE, &path, None).await.expect(200)
}

async fn now(it: &Harness, session: &str) -> Value {
    content(&it.get(&format!("/v1/sessions/{session}/belief")).await.expect(200))
}

#[tokio::test(flavor = "multi_thread")]
async fn readings_in_any_order_and_batches_give_one_belief() {
    let it = Harness::trained().await;
    let readings = of_a_fleet(14);
    let whole = it.session(json!({})).await;
    let expected = content(&post(&it, &whole, &readings).await["belief"]);
    for round in 0..6 {
        let mut stream = Stream::new(101, Purpose::Sampling, round);
        let session = it.session(json!({})).await;
        let mut left = readings.clone();
        while !left.is_empty() {
            let n = 1 + stream.index(left.len().min(4));
            let batch: Vec<Value> =
                (0..n).map(|_| left.swap_remove(stream.index(left.len()))).collect();
            post(&it, &session, &batch).await;
            if stream.index(3) == 0 {
                let again = post(&it, &session, &batch).await;
                assert_eq!(again["n_repeated"], batch.len());
            }
        }
        assert_eq!(now(&it, &session).await, expected, "round {round}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn late_readings_count_as_if_in_time_for_every_method() {
    let it = Harness::start().await;
    let names = ["cube", "bar"];
    it.train().await;
    let training = json!({"readings_per_object": 60, "n_classes": 8, "seed": 3,
        "geometric": {"kind": "solid"}, "appearance": {"n_classes": [8]}, "objects": names});
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let mut readings = of_a_fleet(9);
    readings.iter_mut().for_each(|reading| reading["object_moved"] = Value::Null);
    let pose = json!({"position": [0.02, -0.03, 0.05], "orientation": [0.0, 0.0, 0.0, 1.0]});
    let prior = json!({"kind": "bounded", "pose": pose, "half_extents": [0.01, 0.01, 0.01],
        "half_angle": 0.4});
    for begin in [
        json!({"method": "surface"}),
        json!({"method": "sva"}),
        json!({"method": "appearance"}),
        json!({"method": "geometric", "pose_prior": prior}),
    ] {
        let in_time = it.session(begin.clone()).await;
        let expected = content(&post(&it, &in_time, &readings).await["belief"]);
        let late = it.session(begin.clone()).await;
        for index in [2, 0, 1, 7, 8, 3, 5, 4, 6] {
            post(&it, &late, &readings[index..=index]).await;
        }
        assert_eq!(now(&it, &late).await, expected, "{begin}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_retraction_leaves_no_trace_and_survives_repeats() {
    let it = Harness::trained().await;
    let readings = of_a_fleet(12);
    let others: Vec<Value> = readings
        .iter()
        .enumerate()
        .filter(|(i, _)| ![3, 7].contains(i))
        .map(|(_, r)| r.clone())
        .collect();
    let without = it.session(json!({})).await;
    let expected = content(&post(&it, &without, &others).await["belief"]);
    let session = it.session(json!({})).await;
    let before = post(&it, &session, &readings).await["belief"].clone();
    let first = retract(&it, &session, "arm-1/2").await;
    assert_eq!((&first["number"], &first["revision"]), (&json!(7), &json!(13)));
    let second = retract(&it, &session, "3").await;
    assert_eq!((&second["n_readings"], &second["belief"]["n_readings"]), (&json!(10), &json!(10)));
    assert_eq!(content(&second["belief"]), expected);
    let again = retract(&it, &session, "7").await;
    assert_eq!((&again["revision"], &again["belief"]), (&json!(13), &first["belief"]));
    let repeat = post(&it, &session, &readings).await;
    assert_eq!((&repeat["n_new"], &repeat["n_repeated"]), (&json!(0), &json!(12)));
    assert_eq!(repeat["belief"], before, "as the first time");
    assert_eq!(now(&it, &session).await, expected, "and not back");
    let it = it.restart().await;
    assert_eq!(now(&it, &session).await, expected);
    let again = retract(&it, &session, "arm-1/2").await;
    assert_eq!(again["belief"], first["belief"]);
    assert_eq!(post(&it, &session, &readings).await["belief"], before);
    let shown = it.get(&format!("/v1/sessions/{session}")).await.expect(200);
    let counts = [&shown["n_readings"], &shown["n_retracted"], &shown["revision"]];
    assert_eq!(counts, [&json!(10), &json!(2), &json!(14)]);
    let at = it.get(&format!("/v1/sessions/{session}/belief?at=12")).await.expect(200);
    assert_eq!(at, before, "what was believed stays known");
}

#[tokio::test(flavor = "multi_thread")]
async fn readings_without_ids_are_listed_and_retracted_by_number() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}");
    let mut readings = touches(BAR, 4, 61, resting_pose());
    readings[2]["stamp"] = json!({"sec": 1, "nanosec": 2});
    readings[2]["robot"] = json!("arm/1 ü");
    readings[2]["seq"] = json!(9);
    post(&it, &session, &readings).await;
    let events = it.client.get(it.url(&format!("{path}/events"))).send().await.unwrap();
    retract(&it, &session, "1").await;
    let list = it.get(&format!("{path}/readings?limit=3")).await.expect(200);
    assert_eq!(list["next_cursor"], "3");
    let items = list["items"].as_array().unwrap();
    let numbers: Vec<&Value> = items.iter().map(|item| &item["number"]).collect();
    assert_eq!(numbers, [0, 1, 2]);
    assert_eq!((&items[0]["retracted_by"], &items[1]["retracted_by"]), (&Value::Null, &json!(5)));
    assert_eq!(items[0]["pose"], readings[0]["pose"]);
    assert_eq!((&items[2]["robot"], &items[2]["seq"]), (&json!("arm/1 ü"), &json!(9)));
    assert_eq!(items[2]["stamp"], readings[2]["stamp"]);
    let rest = it.get(&format!("{path}/readings?cursor=3")).await.expect(200);
    assert_eq!(rest["items"].as_array().unwrap().len(), 1, "a retraction is no reading");
    assert_eq!(rest["next_cursor"], Value::Null);
    retract(&it, &session, "arm%2F1%20%C3%BC/9").await;
    for unknown in ["4", "77", "x", "arm-9/1", "arm-9/x"] {
        let path = format!("{path}/readings/{unknown}");
        it.send(Method::DELETE, &path, None).await.problem(404, "not-found", None);
    }
    it.post(&format!("{path}/close"), &json!({})).await.expect(200);
    let refused = it.send(Method::DELETE, &format!("{path}/readings/0"), None).await;
    refused.problem(410, "session-ended", None);
    // A retraction is final, and the request is answered.
    retract(&it, &session, "1").await;
    let text = events.text().await.unwrap();
    let names: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("event: ")).collect();
    assert_eq!(names, ["belief", "belief", "belief", "closed"]);
    assert!(text.contains("id: 6\n"), "{text}");
}

#[tokio::test(flavor = "multi_thread")]
async fn retracted_readings_still_count_towards_the_limit() {
    let it = Harness::trained_with(|config| config.session_readings_max = 3).await;
    let session = it.session(json!({})).await;
    let readings = of_a_fleet(4);
    post(&it, &session, &readings[..3]).await;
    retract(&it, &session, "0").await;
    let path = format!("/v1/sessions/{session}/readings");
    let full = it.post(&path, &json!({"readings": readings})).await;
    full.problem(409, "wrong-state", None);
}
