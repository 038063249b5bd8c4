//! Tests of trainings by what is known of the sensor: reports, extension, and recognition with a
//! sensor that differs from its description.

use std::ops::ControlFlow;

use palpate_core::pose::Pose;
use palpate_core::reading::SensorId;
use palpate_core::sensor::{Coupling, SensorDescription, SensorParameters};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SamplerConfig, sample};
use palpate_sim::shapes::example;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{BAR, CUBE, Harness, off_box, wire};

const OBJECTS: [&str; 4] = ["mug", "hammer", "bottle", "screwdriver"];
/// Sessions of each object, and touches of each session.
const SESSIONS: usize = 6;
const TOUCHES: usize = 6;

async fn train(it: &Harness, catalogue: &str, training: Value) -> Value {
    let path = format!("/v1/catalogues/{catalogue}/trainings");
    let job = it.post(&path, &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    job
}

async fn report(it: &Harness, catalogue: &str, version: u32) -> Value {
    let path = format!("/v1/catalogues/{catalogue}/versions/{version}/report");
    it.get(&path).await.expect(200)
}

/// Touches of an example by a sensor whose covering ends with the array, an even press of which
/// reads the same in every taxel.
fn presses(object: &str) -> Vec<Value> {
    let known = SensorDescription::digitacts_6x6().parameters().clone();
    let coupling = Coupling { margin: Some(0.0), ..Coupling::default() };
    let sensor = SensorDescription::new(SensorParameters { coupling, ..known }).unwrap();
    let simulator = PressSimulator::new(example(object).unwrap(), sensor);
    let config = SamplerConfig::for_simulator(&simulator);
    let mut go_on = |_: usize, _: usize| ControlFlow::Continue(());
    let n = SESSIONS * TOUCHES;
    let readings = sample(&simulator, SensorId(1), n, 601, &config, &mut go_on).unwrap();
    let moved = Pose::from_parts(glam::DQuat::from_rotation_x(0.7), glam::DVec3::X);
    readings.iter().map(|reading| wire(&reading.moved_by(moved))).collect()
}

/// Share of sessions whose likeliest answer is the touched object, and the mean probability of
/// "none of these".
async fn recognised(it: &Harness, catalogue: &str) -> (f64, f64) {
    let (mut right, mut unknown) = (0.0, 0.0);
    for object in OBJECTS {
        for touches in presses(object).chunks(TOUCHES) {
            let id = it.session(json!({"catalogue": catalogue})).await;
            let path = format!("/v1/sessions/{id}/readings");
            let answer = it.post(&path, &json!({"readings": touches})).await.expect(200);
            let belief = &answer["belief"];
            let none = belief["unknown"].as_f64().unwrap();
            let best = &belief["objects"][0];
            let is_right = best["name"] == object && best["probability"].as_f64().unwrap() > none;
            right += f64::from(u8::from(is_right));
            unknown += none;
        }
    }
    let n = (OBJECTS.len() * SESSIONS) as f64;
    (right / n, unknown / n)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_family_recognises_what_one_sensor_calls_none_of_these() {
    let it = Harness::start().await;
    for object in OBJECTS {
        it.post("/v1/objects", &json!({"name": object})).await.expect(201);
        let (path, stl) = (format!("/v1/objects/{object}/mesh?unit=m"), example(object).unwrap());
        let body = Some(("model/stl", stl.to_stl_bytes()));
        it.send(Method::PUT, &path, body).await.expect(200);
    }
    let training = |level: &str| {
        json!({"readings_per_object": 400, "sva": false, "surface": true, "seed": 601,
            "sensor_knowledge": level})
    };
    for level in ["measured", "data_sheet"] {
        let job = train(&it, level, training(level)).await;
        assert_eq!(job["training"]["sensor_knowledge"], level);
        let report = report(&it, level, 1).await;
        assert_eq!(
            (&report["sensor_knowledge"], &report["calibrated"]),
            (&json!(level), &json!(true))
        );
        assert_eq!(report["objects"][0]["n_readings"], 400);
    }
    let (measured, sheet) =
        (recognised(&it, "measured").await, recognised(&it, "data_sheet").await);
    println!("right and none of these: measured {measured:?}, data sheet {sheet:?}");
    assert!(sheet.0 >= 0.9 && sheet.1 < 0.15, "{sheet:?}");
    assert!(measured.1 > 2.0 * sheet.1 + 0.1, "{measured:?} {sheet:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn knowledge_is_that_of_the_sensor_and_the_same_in_a_version() {
    let it = Harness::start().await;
    for (name, size) in [("cube", CUBE), ("bar", BAR)] {
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
        it.put_mesh(name, &off_box(size)).await.expect(200);
    }
    for (name, level) in [("thumb", "data_sheet"), ("exact", "measured")] {
        let new = json!({"name": name, "preset": "digitacts-6x6", "sensor_knowledge": level});
        it.post("/v1/sensors", &new).await.expect(201);
    }
    let some = |sensor: &str| json!({"objects": ["cube"], "sensor": sensor, "readings_per_object": 40, "n_classes": 4});
    let job = train(&it, "exact", some("exact")).await;
    assert_eq!(job["training"]["sensor_knowledge"], "measured");
    let job = train(&it, "preset", some("digitacts-6x6")).await;
    assert_eq!(job["training"]["sensor_knowledge"], "data_sheet");
    let job = train(&it, "open", some("thumb")).await;
    assert_eq!(job["training"]["sensor_knowledge"], "data_sheet");
    // Another sensor, but the level of the version.
    let more = json!({"extend": 1, "objects": ["bar"], "readings_per_object": 40});
    train(&it, "open", more).await;
    let extended = report(&it, "open", 2).await;
    assert_eq!(extended["sensor_knowledge"], "data_sheet");
    assert_eq!(extended["objects"][1]["sensor_knowledge"], "data_sheet");
    let wrong = json!({"extend": 1, "sensor_knowledge": "measured"});
    let wrong = it.post("/v1/catalogues/open/trainings", &wrong).await;
    wrong.problem(422, "invalid-value", Some("/sensor_knowledge"));
    // The same seed gives the same version.
    train(&it, "open", some("thumb")).await;
    let [first, again] = [report(&it, "open", 1).await, report(&it, "open", 3).await];
    assert_eq!(first["objects"], again["objects"]);
    let map = async |version: u32| {
        let path = format!("/v1/catalogues/open/versions/{version}/objects/cube/map?limit=1000");
        it.get(&path).await.expect(200)
    };
    assert_eq!(map(1).await, map(3).await);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_catalogue_trained_anew_keeps_its_level_and_says_so() {
    let it = Harness::start().await;
    it.post("/v1/objects", &json!({"name": "cube"})).await.expect(201);
    it.put_mesh("cube", &off_box(CUBE)).await.expect(200);
    let training =
        json!({"readings_per_object": 40, "n_classes": 4, "sva": false, "surface": true});
    let with = |level: &str| {
        let mut stated = training.clone();
        stated["sensor_knowledge"] = json!(level);
        stated
    };
    let kept = async |version: u32| {
        let report = report(&it, "old", version).await;
        let warnings = report["warnings"].as_array().unwrap().clone();
        let mut kept = warnings.iter().filter(|warning| warning["code"] == "knowledge_kept");
        (report["sensor_knowledge"].clone(), kept.next().map(|it| it["detail"].to_string()))
    };
    train(&it, "old", with("measured")).await;
    assert_eq!(kept(1).await, (json!("measured"), None));
    train(&it, "old", training.clone()).await;
    let (level, detail) = kept(2).await;
    assert_eq!(level, "measured");
    assert!(detail.unwrap().contains("version 1"));
    // An extension, too.
    it.post("/v1/objects", &json!({"name": "bar"})).await.expect(201);
    it.put_mesh("bar", &off_box(BAR)).await.expect(200);
    train(&it, "old", json!({"extend": 2, "readings_per_object": 40})).await;
    assert!(kept(3).await.1.unwrap().contains("version 2"));
    // The request decides, and then nothing is to be said.
    train(&it, "old", with("data_sheet")).await;
    assert_eq!(kept(4).await, (json!("data_sheet"), None));
    train(&it, "old", training).await;
    assert_eq!(kept(5).await, (json!("data_sheet"), None));
}
