//! Tests of symmetries: found in training, stored with the version, and poses answered as orbits.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::symmetry::{AxisOrder, Symmetry};
use palpate_core::units::{DEG, MM};
use palpate_sim::shapes;
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, off_box, touches};

/// A box with three different edges, in millimetres: it has three half turns.
const BRICK: [f64; 3] = [60.0, 40.0, 25.0];

/// Trains the bar, which has four quarter turns about its length and four half turns across,
/// and a brick.
async fn train(it: &Harness) -> Value {
    for (name, size) in [("bar", BAR), ("brick", BRICK)] {
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
        it.put_mesh(name, &off_box(size)).await.expect(200);
    }
    let training = json!({"readings_per_object": 500, "n_classes": 8, "seed": 3,
        "sensor_knowledge": "measured"});
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    it.get("/v1/catalogues/default/versions/1/report").await.expect(200)
}

fn vector(value: &Value) -> DVec3 {
    DVec3::from_array(serde_json::from_value(value.clone()).unwrap())
}

/// The symmetry of axes on the wire.
fn symmetry(axes: &Value) -> Symmetry {
    let axes = axes.as_array().unwrap();
    let axis = |axis: &Value| {
        let order = axis["order"].as_u64();
        let order = order.map_or(AxisOrder::Continuous, |n| AxisOrder::Finite(n as u8));
        (vector(&axis["direction"]), order)
    };
    let center = axes.first().map_or(DVec3::ZERO, |axis| vector(&axis["point"]));
    Symmetry::through(center, &axes.iter().map(axis).collect::<Vec<_>>())
}

fn pose(value: &Value) -> Pose {
    let orientation = serde_json::from_value(value["orientation"].clone()).unwrap();
    Pose::new(vector(&value["position"]).to_array(), orientation).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bar_has_one_pose_modulo_quarter_turns() {
    let it = Harness::start().await;
    let report = train(&it).await;
    assert!(report["objects"].as_array().unwrap().iter().all(|o| o["symmetry_by"] == "mesh"));
    let [bar, brick] = [0, 1].map(|object| symmetry(&report["objects"][object]["symmetry"]));
    let orders = |symmetry: &Symmetry| symmetry.axes.iter().map(|a| a.order).collect::<Vec<_>>();
    let (two, four) = (AxisOrder::Finite(2), AxisOrder::Finite(4));
    assert_eq!(orders(&bar), [four, two, two, two, two], "{report}");
    assert_eq!(orders(&brick), [two, two, two], "{report}");
    // Its length is x; frames have their origin at the centre of the mesh.
    assert!(bar.axes[0].direction.x.abs() > (2.0 * DEG).cos(), "{bar:?}");
    assert!(bar.center.length() < 1.0 * MM, "{bar:?}");

    let it = it.restart().await;
    let truth = Pose::from_parts(DQuat::from_rotation_z(0.4), DVec3::new(0.02, -0.03, 0.05));
    let readings = json!({"readings": touches(BAR, 12, 77, truth)});
    for method in ["surface", "sva"] {
        let session = it.session(json!({"method": method})).await;
        let path = format!("/v1/sessions/{session}/readings");
        let belief = it.post(&path, &readings).await.expect(200)["belief"].clone();
        assert_eq!(belief["objects"][0]["name"], "bar", "{belief}");
        let poses = belief["poses"].as_array().unwrap();
        let bars: Vec<&Value> = poses.iter().filter(|pose| pose["name"] == "bar").collect();
        let best = pose(&bars[0]["pose"]);
        let (moved, angle) = bar.distance(&best, &truth);
        assert!(moved < 2.0 * MM && angle < 6.0 * DEG, "{method}: {moved} m {angle} rad");
        // The reported axis lies in the session frame.
        let told = symmetry(&bars[0]["symmetry"]);
        assert_eq!(orders(&told), orders(&bar));
        let along = truth.turn(DVec3::X).cross(told.axes[0].direction).length();
        assert!(along < 6.0 * DEG && told.center.distance(truth.translation) < 2.0 * MM);
        for (index, one) in bars.iter().enumerate() {
            for other in &bars[index + 1..] {
                let (one, other) = (pose(&one["pose"]), pose(&other["pose"]));
                assert!(!bar.look_alike(&one, &other, 3.0 * MM, 6.0 * DEG), "{method}: {belief}");
            }
        }
    }
    let literal = it.session(json!({"method": "sva_literal"})).await;
    let path = format!("/v1/sessions/{literal}/readings");
    let belief = it.post(&path, &readings).await.expect(200)["belief"].clone();
    let poses = belief["poses"].as_array().unwrap();
    assert!(!poses.is_empty() && poses.iter().all(|pose| pose["symmetry"] == json!([])));
}

#[tokio::test(flavor = "multi_thread")]
async fn meshes_decide_a_symmetry_that_few_touches_cannot() {
    let it = Harness::start().await;
    // With 100 touches of this seed the mug could seem to have a continuous axis, handle and all.
    let mug = shapes::example("mug").unwrap().scaled_to_largest_dimension(80.0);
    let mug = String::from_utf8(mug.to_off_bytes()).unwrap();
    it.post("/v1/objects", &json!({"name": "mug"})).await.expect(201);
    it.put_mesh("mug", &mug).await.expect(200);
    it.post("/v1/objects", &json!({"name": "taught"})).await.expect(201);
    let readings = touches(BRICK, 70, 5, Pose::IDENTITY);
    it.post("/v1/objects/taught/readings", &json!({"readings": readings})).await.expect(200);
    let training = json!({
        "readings_per_object": 100, "sva": false, "surface": true, "seed": 2,
        "objects": ["mug", "taught"],
    });
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let report = it.get("/v1/catalogues/default/versions/1/report").await.expect(200);
    let [mug, taught] = [0, 1].map(|object| &report["objects"][object]);
    assert_eq!((&mug["symmetry"], &mug["symmetry_by"]), (&json!([]), &json!("mesh")), "{mug}");
    assert_eq!(mug["symmetry_touches_needed"], Value::Null);
    assert_eq!(taught["symmetry"], json!([]), "{taught}");
    assert_eq!(taught["symmetry_by"], "undetermined", "{taught}");
    assert!((1..1_000).contains(&taught["symmetry_touches_needed"].as_u64().unwrap()), "{taught}");
}
