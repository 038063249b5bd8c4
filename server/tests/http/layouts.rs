//! Sensors as lists of taxels: described, refused by field, trained with, and recognised by.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use serde_json::{Value, json};

use crate::harness::{BAR, CUBE, Harness, content, off_box, touches_by};

/// A fingertip of five taxels.
fn tip() -> Value {
    let taxel = |x: f64, y: f64| {
        let tilt: f64 = if x == 0.0 && y == 0.0 { 0.0 } else { 0.35 };
        let (sine, cosine) = tilt.sin_cos();
        json!({
            "position": {"x": 0.01 * sine * x, "y": 0.01 * sine * y, "z": 0.01 * (cosine - 1.0)},
            "normal": {"x": sine * x, "y": sine * y, "z": cosine},
            "width": 0.003,
        })
    };
    let taxels: Vec<Value> = [(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]
        .map(|(x, y)| taxel(x, y))
        .to_vec();
    json!({"taxels": taxels, "covering_thickness": 0.002, "saturation": 50_000.0,
           "quantisation": 0.0})
}

#[tokio::test(flavor = "multi_thread")]
async fn a_list_of_taxels_is_a_sensor() {
    let it = Harness::start().await;
    let post = async |name: &str, description: &Value| {
        it.post("/v1/sensors", &json!({"name": name, "description": description})).await
    };
    let made = post("tip", &tip()).await.expect(201);
    assert_eq!(made["layout"]["drawing"], "at_contact");
    let loss = made["layout"]["drawing_loss"].as_f64().unwrap();
    assert!((0.0..0.5).contains(&loss), "{loss}");
    let radius = made["layout"]["radius"].as_f64().unwrap();
    assert!((0.009..0.011).contains(&radius), "{radius}");
    assert_eq!(made["description"]["taxels"].as_array().unwrap().len(), 5);
    // What was read can be sent again.
    let again = post("again", &made["description"]).await.expect(201);
    assert_eq!(again["description"], made["description"]);
    // A value for each taxel; the image is drawn.
    let check = |n: usize| json!({"image": vec![9_000.0; n], "sensor": "tip"});
    let checked = it.post("/v1/sensors/tip/check", &check(5)).await.expect(200);
    let places = checked["rows"].as_u64().unwrap() * checked["cols"].as_u64().unwrap();
    assert_eq!(checked["image"].as_array().unwrap().len() as u64, places);
    let wrong = it.post("/v1/sensors/tip/check", &check(9)).await;
    let problem = wrong.problem(422, "invalid-value", Some("/image"));
    assert!(problem.to_string().contains("expected 5 (one for each taxel"), "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn wrong_taxels_are_named() {
    let it = Harness::start().await;
    let none = json!({"covering_thickness": 0.002, "saturation": 5e4, "quantisation": 0.0});
    let cases: [(&str, Value, &str); 6] = [
        ("/taxels/3/normal/z", json!(0.2), "/description/taxels/3/normal"),
        ("/taxels/2/position/x", json!(7.0), "/description/taxels/2/position"),
        ("/taxels/4/width", json!(0.0), "/description/taxels/4/width"),
        ("/taxels", json!([]), "/description/taxels"),
        ("/image_order", json!({"transposed": true}), "/description/image_order"),
        (
            "/grid",
            json!({"rows": 2, "cols": 3, "pitch": 0.003, "taxel_width": 0.003}),
            "/description/taxels",
        ),
    ];
    for (at, value, pointer) in cases {
        let mut description = tip();
        match description.pointer_mut(at) {
            Some(field) => *field = value,
            None => {
                description[&at[1..]] = value;
            }
        }
        let request = json!({"name": "wrong", "description": description});
        it.post("/v1/sensors", &request).await.problem(422, "invalid-value", Some(pointer));
    }
    let request = json!({"name": "wrong", "description": none});
    let refused = it.post("/v1/sensors", &request).await;
    refused.problem(422, "invalid-value", Some("/description/grid"));
}

#[tokio::test(flavor = "multi_thread")]
async fn fingertips_recognise_what_they_and_others_learnt() {
    let it = Harness::trained().await;
    for (name, size) in [("cube", CUBE), ("bar", BAR)] {
        it.put_mesh(name, &off_box(size)).await.expect(200);
    }
    let training = json!({"readings_per_object": 80, "seed": 3, "n_classes": 8,
                          "sensor": "fingertip-curved-24"});
    let job = it.post("/v1/catalogues/tips/trainings", &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let pose = Pose::from_parts(DQuat::from_rotation_z(0.4), DVec3::new(0.02, -0.03, 0.05));
    let mut beliefs = Vec::new();
    for (catalogue, sensor) in [
        ("tips", "fingertip-curved-24"),
        ("default", "fingertip-curved-24"),
        ("default", "icub-fingertip-12"),
    ] {
        for (name, size) in [("cube", CUBE), ("bar", BAR)] {
            let session = it.session(json!({"catalogue": catalogue})).await;
            let readings = touches_by(sensor, size, 10, 21, pose);
            let n_values = readings[0]["image"].as_array().unwrap().len();
            let path = format!("/v1/sessions/{session}");
            let body = json!({"readings": readings});
            let added = it.post(&format!("{path}/readings"), &body).await.expect(200);
            assert_eq!(added["belief"]["objects"][0]["name"], name, "{catalogue} {sensor}");
            let stored = it.get(&format!("{path}/readings")).await.expect(200);
            let first = &stored["items"][0];
            assert_eq!(first["image"].as_array().unwrap().len(), n_values, "{first}");
            assert_eq!(first["pose"]["position"], body["readings"][0]["pose"]["position"]);
            beliefs.push((path, added["belief"].clone()));
        }
    }
    let it = it.restart().await;
    for (path, before) in beliefs {
        let after = it.get(&format!("{path}/belief")).await.expect(200);
        assert_eq!(content(&after), content(&before));
    }
}
