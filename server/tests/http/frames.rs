//! Tests of frames: a ramp of frames is one press, in any order of arrival.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_sim::mesh::{Mesh, MeshFormat};
use palpate_sim::press::PressSimulator;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, content, off_box, touches};

const N_FRAMES: usize = 40;

fn resting_pose() -> Pose {
    Pose::from_parts(DQuat::from_rotation_z(0.4), DVec3::new(0.02, -0.03, 0.05))
}

/// The pose of a reading on the wire.
fn pose(reading: &Value) -> Pose {
    let numbers = |value: &Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
    };
    let position = numbers(&reading["pose"]["position"]);
    let orientation = numbers(&reading["pose"]["orientation"]);
    Pose::new(position.try_into().unwrap(), orientation.try_into().unwrap()).unwrap()
}

/// Readings of a driver at 30 frames a second during the last 2.5 mm before a touch.
fn ramp(touch: &Value, second: usize) -> Vec<Value> {
    let mesh = Mesh::from_bytes(MeshFormat::Off, off_box(BAR).as_bytes(), 1e-3).unwrap();
    let simulator = PressSimulator::new(mesh, SensorDescription::digitacts_6x6());
    let deepest = pose(touch);
    let frame = |index: usize| {
        let back = 2.5e-3 * (1.0 - (index + 1) as f64 / N_FRAMES as f64);
        let session_from_sensor =
            deepest * Pose::from_parts(DQuat::IDENTITY, DVec3::new(0.0, 0.0, -back));
        let object_from_sensor = resting_pose().inverse() * session_from_sensor;
        let mut stream = Stream::new(3, Purpose::SensorNoise, index as u64);
        let press = simulator.press(object_from_sensor);
        let mut reading = touch.clone();
        reading["pose"]["position"] = json!(session_from_sensor.translation.to_array());
        reading["image"] = json!(simulator.pressures(&press, &mut stream));
        reading["robot"] = json!("arm");
        reading["seq"] = json!(100 * second + index);
        let nanosec = 33_000_000 * index as u64;
        let (sec, nanosec) = (second as u64 + nanosec / 1_000_000_000, nanosec % 1_000_000_000);
        reading["stamp"] = json!({"sec": sec, "nanosec": nanosec});
        reading
    };
    (0..N_FRAMES).map(frame).collect()
}

async fn post(it: &Harness, session: &str, readings: &[Value]) -> Value {
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &json!({"readings": readings})).await.expect(200)
}

async fn now(it: &Harness, session: &str) -> Value {
    content(&it.get(&format!("/v1/sessions/{session}/belief")).await.expect(200))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_ramp_of_frames_counts_as_its_last_press() {
    let it = Harness::trained().await;
    let mut presses: Vec<Vec<Value>> = touches(BAR, 3, 61, resting_pose())
        .iter()
        .enumerate()
        .map(|(n, touch)| ramp(touch, 10 * (n + 1)))
        .collect();
    // The object may have moved before the second press, according to its first frame.
    let moved = json!({"position_m": 0.001, "angle_rad": 0.01});
    presses[1][0]["object_moved"] = moved.clone();
    let mut settled: Vec<Value> = presses.iter().map(|press| press[N_FRAMES - 1].clone()).collect();
    settled[1]["object_moved"] = moved;
    let alone = it.session(json!({})).await;
    let expected = content(&post(&it, &alone, &settled).await["belief"]);
    assert_eq!(expected["n_readings"], 3);

    let all: Vec<Value> = presses.iter().flatten().cloned().collect();
    for round in 0..3 {
        let mut stream = Stream::new(11, Purpose::Sampling, round);
        let session = it.session(json!({})).await;
        let mut left = all.clone();
        let mut answer = Value::Null;
        while !left.is_empty() {
            let n = 1 + stream.index(left.len().min(25));
            let batch: Vec<Value> =
                (0..n).map(|_| left.swap_remove(stream.index(left.len()))).collect();
            answer = post(&it, &session, &batch).await;
        }
        assert_eq!(content(&answer["belief"]), expected, "round {round}");
        let counts = [&answer["n_readings"], &answer["n_presses"]];
        assert_eq!(counts, [&json!(3 * N_FRAMES), &json!(3)]);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_other_frames_keep_a_press_after_a_retraction() {
    let it = Harness::trained().await;
    let touch = &touches(BAR, 1, 61, resting_pose())[0];
    let frames = ramp(touch, 10);
    let (last, others) = frames.split_last().unwrap();
    let shorter = it.session(json!({})).await;
    let without = content(&post(&it, &shorter, others).await["belief"]);
    let session = it.session(json!({})).await;
    let whole = post(&it, &session, &frames).await["belief"].clone();
    assert_ne!(content(&whole), without, "the deepest frame counts");
    assert_eq!(whole["n_readings"], 1);
    let path = format!("/v1/sessions/{session}/readings/arm/{}", last["seq"]);
    let retracted = it.send(Method::DELETE, &path, None).await.expect(200);
    assert_eq!(content(&retracted["belief"]), without);
    let explained = it.get(&format!("/v1/sessions/{session}/explain")).await.expect(200);
    assert_eq!(explained["readings"].as_array().unwrap().len(), 1);
    let it = it.restart().await;
    assert_eq!(now(&it, &session).await, without);
    let at = it.get(&format!("/v1/sessions/{session}/belief?at={N_FRAMES}")).await.expect(200);
    assert_eq!(at, whole, "as it was then");
    let replay = it.get(&format!("/v1/sessions/{session}/replay")).await.expect(200);
    assert_eq!(content(&replay["belief"]), without);
}

#[tokio::test(flavor = "multi_thread")]
async fn without_stamps_frames_are_separate_presses() {
    let it = Harness::trained().await;
    let mut frames = ramp(&touches(BAR, 1, 61, resting_pose())[0], 10);
    frames.iter_mut().for_each(|frame| frame["stamp"] = Value::Null);
    let session = it.session(json!({})).await;
    let answer = post(&it, &session, &frames[30..]).await;
    assert_eq!((&answer["n_readings"], &answer["n_presses"]), (&json!(10), &json!(10)));
    let none = it
        .post(
            &format!("/v1/sessions/{session}/readings?belief=none"),
            &json!({"readings": frames[..1]}),
        )
        .await
        .expect(200);
    assert_eq!(none["n_presses"], Value::Null);
}
