//! Tests of the frames of an answer: a pose is also given in the object's training frame, for
//! an object with a mesh and for one trained by a robot.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::units::MM;
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, off_box, pose_of, touches};

/// The centre of the bar in its mesh file, millimetres.
const MIDDLE_IN_FILE: [f64; 3] = [130.0, -70.0, 45.0];
/// Three different edges, millimetres.
const BRICK: [f64; 3] = [60.0, 40.0, 25.0];

/// The bar as an OFF file whose origin is not its centre.
fn shifted_bar() -> String {
    let moved = |line: &str| {
        let at: Vec<f64> = line.split(' ').map(|part| part.parse().unwrap()).collect();
        let moved: Vec<_> =
            at.iter().zip(MIDDLE_IN_FILE).map(|(a, b)| (a + b).to_string()).collect();
        moved.join(" ")
    };
    let file = off_box(BAR);
    let lines = file.lines().enumerate();
    let lines =
        lines.map(|(n, line)| if (2..10).contains(&n) { moved(line) } else { line.to_owned() });
    lines.collect::<Vec<_>>().join("\n") + "\n"
}

/// Adds the shifted bar as a mesh and the brick by touches; the brick's centre lies at the
/// given pose in the frame of its training readings.
async fn train(it: &Harness, training_from_brick: Pose) {
    it.post("/v1/objects", &json!({"name": "bar"})).await.expect(201);
    it.put_mesh("bar", &shifted_bar()).await.expect(200);
    it.post("/v1/objects", &json!({"name": "brick"})).await.expect(201);
    let readings = touches(BRICK, 300, 5, training_from_brick);
    it.post("/v1/objects/brick/readings", &json!({"readings": readings})).await.expect(200);
    let training = json!({"readings_per_object": 300, "n_classes": 8, "seed": 3,
        "sensor_knowledge": "measured"});
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
}

/// The centre of `size` according to the likeliest pose of an object, by its model frame.
async fn middle(it: &Harness, method: &str, size: [f64; 3], at: Pose, in_model: DVec3) -> DVec3 {
    let session = it.session(json!({"method": method})).await;
    let path = format!("/v1/sessions/{session}/readings");
    let readings = json!({"readings": touches(size, 12, 77, at)});
    let belief = it.post(&path, &readings).await.expect(200)["belief"].clone();
    let report = it.get("/v1/catalogues/default/versions/1/report").await.expect(200);
    for mode in belief["poses"].as_array().unwrap() {
        same_in_both_frames(mode, &report);
    }
    let name = if size == BAR { "bar" } else { "brick" };
    assert_eq!(belief["poses"][0]["name"], name, "{method}: {belief}");
    pose_of(&belief["poses"][0]["session_from_model"]) * in_model
}

/// Checks that both poses of a mode have equal axes and differ by the origin in the report.
fn same_in_both_frames(mode: &Value, report: &Value) {
    let objects = report["objects"].as_array().unwrap();
    let trained = objects.iter().find(|object| object["name"] == mode["name"]).unwrap();
    let origin: [f64; 3] = serde_json::from_value(trained["origin_in_mesh"].clone()).unwrap();
    let (object, model) = (pose_of(&mode["pose"]), pose_of(&mode["session_from_model"]));
    assert!((model * DVec3::from_array(origin)).distance(object.translation) < 1e-9, "{mode}");
    assert!(object.angle_to(&model) < 1e-6, "{mode}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_pose_is_given_in_the_objects_training_frame() {
    let it = Harness::start().await;
    let training_from_brick =
        Pose::from_parts(DQuat::from_rotation_y(0.7), DVec3::new(0.31, -0.22, 0.13));
    train(&it, training_from_brick).await;
    let it = it.restart().await;
    let truth = Pose::from_parts(DQuat::from_rotation_z(0.4), DVec3::new(0.02, -0.03, 0.05));
    // The centre of a box is invariant to its half turns. A missing or doubled origin would
    // be off by the 150 mm and 400 mm of the frames.
    let in_file = DVec3::from_array(MIDDLE_IN_FILE) * MM;
    for method in ["surface", "sva"] {
        let bar = middle(&it, method, BAR, truth, in_file).await;
        assert!(bar.distance(truth.translation) < 3.0 * MM, "{method}: {bar}");
        let brick = middle(&it, method, BRICK, truth, training_from_brick.translation).await;
        assert!(brick.distance(truth.translation) < 5.0 * MM, "{method}: {brick}");
    }
}
