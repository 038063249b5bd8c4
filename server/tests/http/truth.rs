//! Tests of the true pose of a session's object: what is kept of it, and how beliefs are judged.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, touches};

/// Where the bar rests.
fn session_from_bar() -> Pose {
    Pose::from_parts(DQuat::from_rotation_z(0.6), DVec3::new(0.3, -0.2, 0.1))
}

fn wire(pose: &Pose) -> Value {
    json!({"position": pose.translation.to_array(), "orientation": pose.rotation.to_array()})
}

/// A session that touched the bar.
async fn touched(it: &Harness, request: Value) -> String {
    let session = it.session(request).await;
    let readings = touches(BAR, 8, 5, session_from_bar());
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &json!({"readings": readings})).await.expect(200);
    session
}

#[tokio::test(flavor = "multi_thread")]
async fn a_true_pose_is_kept_and_the_believed_one_judged() {
    let it = Harness::trained().await;
    let session = touched(&it, json!({})).await;
    let close = format!("/v1/sessions/{session}/close");
    let told = json!({"object": "bar", "pose": wire(&session_from_bar())});
    let truth = it.post(&close, &told).await.expect(200)["truth"].clone();
    assert_eq!(truth["pose"], told["pose"]);
    // The bar looks the same after half a turn about any of its axes.
    assert!(truth["position_error"].as_f64().unwrap() < 0.003, "{truth}");
    assert!(truth["angle_error"].as_f64().unwrap() < 0.1, "{truth}");
    // Told again without the pose or with the same, nothing changes; another pose is refused.
    let object = it.post(&close, &json!({"object": "bar"})).await.expect(200);
    assert_eq!(object["truth"], truth);
    assert_eq!(it.post(&close, &told).await.expect(200)["truth"], truth);
    let other = json!({"object": "bar", "pose": wire(&Pose::IDENTITY)});
    it.post(&close, &other).await.problem(409, "conflict", None);
    assert_eq!(it.get(&format!("/v1/sessions/{session}")).await.expect(200)["truth"], truth);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_pose_that_is_far_off_is_as_far_off_as_told() {
    let it = Harness::trained().await;
    let session = touched(&it, json!({})).await;
    let close = format!("/v1/sessions/{session}/close");
    // The object was known before its pose was.
    let first = it.post(&close, &json!({"object": "bar"})).await.expect(200);
    assert_eq!(first["truth"]["pose"], Value::Null);
    let moved = Pose::from_parts(DQuat::IDENTITY, DVec3::new(0.0, 0.0, 0.04)) * session_from_bar();
    let told = json!({"object": "bar", "pose": wire(&moved)});
    let truth = it.post(&close, &told).await.expect(200)["truth"].clone();
    let error = truth["position_error"].as_f64().unwrap();
    assert!((error - 0.04).abs() < 0.003, "{error} m");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_pose_needs_its_object_and_finite_numbers() {
    let it = Harness::trained().await;
    let session = touched(&it, json!({})).await;
    let close = format!("/v1/sessions/{session}/close");
    let pose = wire(&Pose::IDENTITY);
    let mut far = pose.clone();
    far["position"][1] = json!(1e9);
    for (told, pointer) in [
        (json!({"pose": pose}), "/pose"),
        (json!({"none_of_these": true, "pose": pose}), "/pose"),
        (json!({"object": "bar", "pose": far}), "/pose/position/1"),
    ] {
        it.post(&close, &told).await.problem(422, "invalid-value", Some(pointer));
    }
    let open = it.get(&format!("/v1/sessions/{session}")).await.expect(200);
    assert_eq!(open["state"], "open", "a refused end ends nothing");
}
