//! Tests of single taxels and single rows: recognition by them, and that no path fails on them.

use std::ops::ControlFlow;

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::SensorId;
use palpate_core::sensor::{SensorDescription, SensorParameters, TaxelGrid};
use palpate_core::units::MM;
use palpate_sim::mesh::{Mesh, MeshFormat};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SamplerConfig, sample};
use serde_json::{Value, json};

use crate::harness::{BAR, CUBE, Harness, off_box};

const GRIDS: [(usize, usize); 3] = [(1, 1), (1, 8), (8, 1)];

fn resting_pose() -> Pose {
    Pose::from_parts(DQuat::from_rotation_z(0.4), DVec3::new(0.02, -0.03, 0.05))
}

fn name((rows, cols): (usize, usize)) -> String {
    format!("array-{rows}x{cols}")
}

/// A sensor like the preset, with this grid.
fn described((rows, cols): (usize, usize)) -> SensorDescription {
    let six = SensorDescription::digitacts_6x6();
    let grid = TaxelGrid { rows, cols, pitch: 2.0 * MM, taxel_width: 1.8 * MM };
    SensorDescription::new(SensorParameters { grid, ..six.parameters().clone() }).unwrap()
}

async fn create(it: &Harness, grid: (usize, usize)) {
    let description = json!({"grid": {"rows": grid.0, "cols": grid.1, "pitch": 0.002,
        "taxel_width": 0.0018}, "covering_thickness": 0.00254, "saturation": 20_000.0,
        "quantisation": 78.125});
    let body = json!({"name": name(grid), "description": description});
    it.post("/v1/sensors", &body).await.expect(201);
}

/// Simulated presses of a box, in wire form.
fn presses(grid: (usize, usize), size: [f64; 3], n: usize, seed: u64) -> Vec<Value> {
    let mesh = Mesh::from_bytes(MeshFormat::Off, off_box(size).as_bytes(), 1e-3).unwrap();
    let simulator = PressSimulator::new(mesh, described(grid));
    let config = SamplerConfig::for_simulator(&simulator);
    let mut go_on = |_, _| ControlFlow::Continue(());
    let readings = sample(&simulator, SensorId(1), n, seed, &config, &mut go_on).unwrap();
    let wire = |reading: &palpate_core::reading::Reading| {
        let pose = resting_pose() * reading.session_from_sensor();
        json!({"sensor": name(grid), "image": reading.image().pressures, "pose": {
            "position": pose.translation.to_array(), "orientation": pose.rotation.to_array()}})
    };
    readings.iter().map(wire).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_row_and_a_single_taxel_recognise_objects() {
    let it = Harness::trained().await;
    for grid in [(1, 8), (1, 1)] {
        create(&it, grid).await;
        let (mut right, mut probability) = (0, 0.0);
        for (object, size) in [("cube", CUBE), ("bar", BAR)] {
            for seed in 61..64 {
                let session = it.session(json!({})).await;
                let path = format!("/v1/sessions/{session}/readings");
                let body = json!({"readings": presses(grid, size, 24, seed)});
                let added = it.post(&path, &body).await.expect(200);
                let objects = added["belief"]["objects"].as_array().unwrap();
                right += usize::from(objects[0]["name"] == object);
                let of_true = objects.iter().find(|found| found["name"] == object).unwrap();
                probability += of_true["probability"].as_f64().unwrap() / 6.0;
            }
        }
        // By chance 3 of 6.
        assert!(right >= 5 && probability > 0.6, "{grid:?}: {right} of 6, {probability}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn no_request_fails_on_a_row_or_a_single_taxel() {
    let it = Harness::trained().await;
    for grid in GRIDS {
        create(&it, grid).await;
        let sensor = name(grid);
        let readings = presses(grid, CUBE, 4, 5);
        let check = it.post(&format!("/v1/sensors/{sensor}/check"), &readings[0]).await;
        assert_eq!(check.expect(200)["image"].as_array().unwrap().len(), grid.0 * grid.1);
        let session = it.session(json!({})).await;
        let path = format!("/v1/sessions/{session}");
        let missing: Value = vec![Value::Null; grid.0 * grid.1].into();
        let mut nothing = readings[0].clone();
        nothing["image"] = missing;
        let refused = it.post(&format!("{path}/readings"), &json!({"readings": [nothing]})).await;
        refused.problem(422, "invalid-value", Some("/readings/0/image"));
        nothing["image"] = vec![0.0; grid.0 * grid.1].into();
        nothing["approach_m"] = json!(0.1);
        let all = [vec![nothing], readings.clone()].concat();
        it.post(&format!("{path}/readings"), &json!({"readings": all})).await.expect(200);
        it.post(&format!("{path}/next-touches"), &json!({"sensor": sensor})).await.expect(200);
        it.get(&format!("{path}/explain")).await.expect(200);

        // Its own readings of an object, by the methods that compare images.
        let object = format!("thing-{sensor}");
        it.post("/v1/objects", &json!({"name": object})).await.expect(201);
        let own = json!({"readings": presses(grid, CUBE, 30, 6)});
        it.post(&format!("/v1/objects/{object}/readings"), &own).await.expect(200);
        let training = json!({"objects": [object, "bar"], "readings_per_object": 30,
            "n_classes": 4, "seed": 3, "sensor": sensor, "appearance": {}});
        let catalogue = format!("/v1/catalogues/{sensor}/trainings");
        let job = it.post(&catalogue, &training).await;
        if job.status == 202 {
            let job = it.finished(job.json()["id"].as_str().unwrap()).await;
            let reason = job["reason"].as_str().unwrap_or_default();
            assert!(job["state"] == "succeeded" || reason.contains("expected"), "{job}");
            if job["state"] == "succeeded" {
                for method in ["surface", "sva", "appearance"] {
                    let request = json!({"catalogue": sensor, "method": method});
                    let session = it.session(request).await;
                    let body = json!({"readings": readings});
                    let path = format!("/v1/sessions/{session}/readings");
                    it.post(&path, &body).await.expect(200);
                }
            }
        } else {
            job.problem(422, "invalid-value", None);
        }
    }
}
