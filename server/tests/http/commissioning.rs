//! Tests of commissioning: mistakes are found, a passport corrects later readings, bad input is
//! refused.

use std::ops::ControlFlow;

use glam::{DQuat, DVec3};
use palpate_commissioning::commission::{ORDERS, PressureUnit};
use palpate_commissioning::mistakes::Mistake;
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::SensorDescription;
use palpate_core::units::MM;
use palpate_sim::indent::indentation_run;
use palpate_sim::mesh::{Mesh, MeshFormat};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SamplerConfig, sample};
use palpate_sim::shapes;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{Harness, pose_of};

const PATH: &str = "/v1/sensors/finger/commissionings";

/// Pressures in kPa, rows reversed, and a tool centre that is 4 mm off.
fn mistake() -> Mistake {
    Mistake {
        pressure: PressureUnit::Kilopascal,
        order: ORDERS[1],
        tool: Pose::from_parts(DQuat::IDENTITY, DVec3::new(0.0, 0.0, 4.0) * MM),
        ..Mistake::none()
    }
}

fn resting() -> Pose {
    let turn = DQuat::from_scaled_axis(DVec3::new(0.4, -0.9, 1.7));
    Pose::from_parts(turn, DVec3::new(0.5, -0.2, 0.1))
}

fn touched(mesh: Mesh, n: usize, seed: u64) -> Vec<Reading> {
    let object = PressSimulator::new(mesh, SensorDescription::digitacts_6x6());
    let config = SamplerConfig::for_simulator(&object);
    sample(&object, SensorId(0), n, seed, &config, &mut |_, _| ControlFlow::Continue(())).unwrap()
}

/// Touches of an object at rest, as the driver of a set-up sends them.
fn sent(mesh: Mesh, n: usize, seed: u64, mistake: &Mistake) -> Vec<Value> {
    let sensor = SensorDescription::digitacts_6x6();
    let one = |reading: &Reading| {
        let sent = mistake.sent(reading, resting(), &sensor);
        json!({"image": sent.pressures,
            "pose": {"position": sent.position, "orientation": sent.quaternion}})
    };
    touched(mesh, n, seed).iter().map(one).collect()
}

/// The same as readings of the sensor `finger`.
fn readings(name: &str, n: usize, seed: u64, mistake: &Mistake) -> Value {
    let mut readings = sent(shapes::example(name).unwrap(), n, seed, mistake);
    readings.iter_mut().for_each(|reading| reading["sensor"] = json!("finger"));
    json!({ "readings": readings })
}

fn hammer(mistake: &Mistake) -> Value {
    json!({"object": "hammer", "readings": sent(shapes::example("hammer").unwrap(), 20, 5, mistake)})
}

/// A server with a sensor `finger` and the meshes of a hammer and a mug.
async fn with_meshes() -> Harness {
    let it = Harness::start().await;
    let finger = json!({"name": "finger", "preset": "digitacts-6x6"});
    it.post("/v1/sensors", &finger).await.expect(201);
    for name in ["hammer", "mug"] {
        it.post("/v1/objects", &json!({ "name": name })).await.expect(201);
        let path = format!("/v1/objects/{name}/mesh?unit=m");
        let file = shapes::example(name).unwrap().to_stl_bytes();
        it.send(Method::PUT, &path, Some(("model/stl", file))).await.expect(200);
    }
    it
}

fn finding<'a>(answer: &'a Value, name: &str) -> &'a Value {
    let mut findings = answer["findings"].as_array().unwrap().iter();
    findings.find(|finding| finding["name"] == name).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn three_mistakes_are_found_with_their_corrections() {
    let it = with_meshes().await;
    let answer = it.post(PATH, &hammer(&mistake())).await.expect(200);
    assert_eq!(answer["wrong"], json!(["pressure_unit", "image_order", "tool_center"]), "{answer}");
    assert_eq!((&answer["verdict"], &answer["calibration"]), (&json!("wrong"), &Value::Null));
    let correction = |name: &str| finding(&answer, name)["correction"].as_str().unwrap();
    assert_eq!(correction("pressure_unit"), "Multiply pressures by 1000: they are in kPa.");
    assert!(correction("image_order").contains("rows_reversed true"), "{answer}");
    assert!(correction("tool_center").starts_with("Move the tool centre"), "{answer}");
    assert_eq!(finding(&answer, "position_unit")["correction"], Value::Null);
    let tool = pose_of(&answer["tool_center"]["sent_from_true"]);
    assert!(tool.distance_to(&mistake().tool) < 0.6 * MM, "{answer}");
    assert_eq!(pose_of(&answer["passport"]["sent_from_true"]), tool);
    let residual = |of: &str| answer[of].as_f64().unwrap();
    assert!(residual("residual_after") < 0.12 && residual("residual_before") > 0.12, "{answer}");
    assert!(pose_of(&answer["session_from_object"]).distance_to(&resting()) < 3.0 * MM);
    let touch = &answer["touches"][7];
    assert_eq!(answer["touches"].as_array().unwrap().len(), 20);
    let peak = |of: &str| {
        let image = touch[of].as_array().unwrap().iter().map(|p| p.as_f64().unwrap());
        image.fold(0.0, f64::max)
    };
    assert!((0.5..2.0).contains(&(peak("predicted") / peak("observed"))), "{touch}");
    it.get("/v1/sensors/finger/passport").await.problem(404, "not-found", None);
    assert_eq!(it.get("/v1/sensors/finger").await.expect(200)["passport"], Value::Null);
}

/// The likeliest object of a belief and its probability.
fn best(belief: &Value) -> (String, f64) {
    let best = &belief["objects"][0];
    (best["name"].as_str().unwrap().to_owned(), best["probability"].as_f64().unwrap())
}

#[tokio::test(flavor = "multi_thread")]
async fn an_applied_passport_makes_a_wrong_driver_right() {
    let it = with_meshes().await;
    let training = json!({"readings_per_object": 300, "sva": false, "surface": true,
        "sensor": "finger", "sensor_knowledge": "measured"});
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let sends = async |seed: u64| {
        let session = it.session(json!({})).await;
        let path = format!("/v1/sessions/{session}/readings");
        let added = it.post(&path, &readings("mug", 8, seed, &mistake())).await.expect(200);
        (session, added)
    };
    let (_, before) = sends(31).await;
    assert_eq!(before["warnings"][0]["code"], "pressure_unit", "{before}");
    let (name, probability) = best(&before["belief"]);
    assert!(name != "mug" || probability < 0.9, "{before}");

    let mut request = hammer(&mistake());
    request["apply"] = json!(true);
    let applied = it.post(PATH, &request).await.expect(200);
    assert_eq!(applied["calibration"], 1);
    let (session, after) = sends(31).await;
    assert_eq!(after["warnings"], json!([]), "{after}");
    assert_eq!(after["belief"]["warnings"], json!([]), "{after}");
    let (name, probability) = best(&after["belief"]);
    assert!(name == "mug" && probability > 0.95, "{after}");
    let placed = pose_of(&after["belief"]["poses"][0]["session_from_model"]);
    assert!(placed.distance_to(&resting()) < 3.0 * MM, "{after}");

    let it = it.restart().await;
    let belief = it.get(&format!("/v1/sessions/{session}/belief")).await.expect(200);
    assert_eq!(belief, after["belief"]);
    let listed = it.get(&format!("/v1/sessions/{session}/readings")).await.expect(200);
    let (first, given) = (&listed["items"][0], &readings("mug", 8, 31, &mistake())["readings"][0]);
    assert_eq!((&first["image"], &first["calibration"]), (&given["image"], &json!(1)));
    assert_eq!(first["pose"]["position"], given["pose"]["position"], "as it was sent");
    let way = pose_of(&first["corrected_pose"]).distance_to(&pose_of(&first["pose"]));
    assert!((way - 4.0 * MM).abs() < 0.6 * MM, "{first}");
    let check = it.post("/v1/sensors/finger/check", given).await.expect(200);
    assert_eq!((&check["passport"], &check["warnings"]), (&json!(1), &json!([])));
    assert!(check["max_pressure"].as_f64().unwrap() > 1e3, "{check}");
}

#[tokio::test(flavor = "multi_thread")]
async fn taxel_lines_and_passport_stay_beside_each_other() {
    let it = with_meshes().await;
    let mut request = hammer(&mistake());
    request["apply"] = json!(true);
    it.post(PATH, &request).await.expect(200);
    let shown = it.get("/v1/sensors/finger").await.expect(200);
    assert_eq!((&shown["calibration"], &shown["passport"]), (&json!(1), &json!(1)));
    let path = "/v1/sensors/finger/calibration";
    it.get(path).await.problem(404, "not-found", None);
    let passport = it.get("/v1/sensors/finger/passport").await.expect(200);
    assert_eq!(passport["wrong"], json!(["pressure_unit", "image_order", "tool_center"]));
    assert_eq!((&passport["touched"], &passport["n_touches"]), (&json!("hammer"), &json!(20)));
    assert_eq!(passport["corrections"][0], "Multiply pressures by 1000: they are in kPa.");

    let run = indentation_run(&SensorDescription::digitacts_6x6(), 3);
    let response = run.response.iter().map(|press| {
        json!({"row": press.taxel / 6, "col": press.taxel % 6, "depth": press.depth,
            "pressures": press.pressures})
    });
    let fit = json!({"response": response.collect::<Vec<_>>()});
    assert_eq!(it.post(path, &fit).await.expect(201)["number"], 2);
    let shown = it.get("/v1/sensors/finger").await.expect(200);
    assert_eq!((&shown["calibration"], &shown["passport"]), (&json!(2), &json!(1)));
    assert_eq!(it.get("/v1/sensors/finger/passport?number=2").await.expect(200), passport);
    it.get("/v1/sensors/finger/passport?number=3").await.problem(404, "not-found", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn trainings_press_with_a_commissioned_sensor_as_measured() {
    let it = with_meshes().await;
    let path = "/v1/catalogues/default/trainings";
    let mut training = json!({"readings_per_object": 100, "sva": false, "surface": true,
        "objects": ["mug"], "sensor": "finger", "sensor_knowledge": "commissioned"});
    let pointer = Some("/sensor_knowledge");
    it.post(path, &training).await.problem(422, "invalid-value", pointer);
    let new = json!({"name": "thumb", "preset": "digitacts-6x6",
        "sensor_knowledge": "commissioned"});
    it.post("/v1/sensors", &new).await.problem(422, "invalid-value", pointer);
    let mut request = hammer(&mistake());
    request["apply"] = json!(true);
    it.post(PATH, &request).await.expect(200);
    training.as_object_mut().unwrap().remove("sensor_knowledge");
    let job = it.post(path, &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let report = it.get("/v1/catalogues/default/versions/1/report").await.expect(200);
    assert_eq!(report["sensor_knowledge"], "commissioned");
    assert_eq!(report["objects"][0]["sensor_knowledge"], "commissioned");
    let session = it.session(json!({})).await;
    let readings = readings("mug", 8, 33, &mistake());
    let added = it.post(&format!("/v1/sessions/{session}/readings"), &readings).await.expect(200);
    let (name, probability) = best(&added["belief"]);
    assert!(name == "mug" && probability > 0.9, "{added}");
}

#[tokio::test(flavor = "multi_thread")]
async fn touches_that_cannot_be_used_are_refused_at_their_fields() {
    let it = with_meshes().await;
    it.post("/v1/objects", &json!({"name": "idea"})).await.expect(201);
    let refused = async |change: &dyn Fn(&mut Value), pointer: &str| {
        let mut request = hammer(&Mistake::none());
        change(&mut request);
        it.post(PATH, &request).await.problem(422, "invalid-value", Some(pointer));
    };
    refused(&|it| it["object"] = json!("nothing"), "/object").await;
    refused(&|it| it["object"] = json!("idea"), "/object").await;
    refused(&|it| it["object"] = Value::Null, "/object").await;
    refused(&|it| it["reference_body"] = json!("cube"), "/object").await;
    refused(&|it| it["seed"] = json!(1_u64 << 60), "/seed").await;
    let all = |it: &mut Value| it["readings"].as_array_mut().unwrap().truncate(7);
    refused(&all, "/readings").await;
    refused(&|it| it["readings"][3]["image"] = json!([1.0]), "/readings/3/image").await;
    refused(&|it| it["readings"][3]["image"][4] = json!(1e12), "/readings/3/image/4").await;
    let turn = |it: &mut Value| it["readings"][2]["pose"]["orientation"] = json!([0, 0, 0, 0]);
    refused(&turn, "/readings/2/pose/orientation").await;
    let silent = |it: &mut Value| {
        let readings = it["readings"].as_array_mut().unwrap();
        readings.iter_mut().for_each(|reading| reading["image"] = json!([0.0; 36].as_slice()));
    };
    refused(&silent, "/readings").await;
    let place = json!({"position": [0, 0, 0], "orientation": [0, 0, 0, 2]});
    let at = "/session_from_object/orientation";
    refused(&|it| it["session_from_object"] = place.clone(), at).await;
    // Noise instead of touches of a hammer is understood by no set-up, and no passport follows.
    let noise = |it: &mut Value| {
        it["apply"] = json!(true);
        // As few as possible: every place of the object is tried in vain.
        it["readings"].as_array_mut().unwrap().truncate(8);
        for (touch, reading) in it["readings"].as_array_mut().unwrap().iter_mut().enumerate() {
            let image: Vec<f64> = (0..36)
                .map(|taxel| f64::from((taxel * 7919 + touch as u32 * 104_729) % 9000))
                .collect();
            reading["image"] = json!(image);
        }
    };
    refused(&noise, "/apply").await;
    it.get("/v1/sensors/finger/passport").await.problem(404, "not-found", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn reference_bodies_are_listed_printed_and_touched() {
    let it = with_meshes().await;
    let bodies = it.get("/v1/reference-bodies").await.expect(200);
    let names: Vec<&Value> =
        bodies["items"].as_array().unwrap().iter().map(|body| &body["name"]).collect();
    assert_eq!(names, ["ridge", "sphere", "cube", "wedge"]);
    let size = bodies["items"][2]["size"][0].as_f64().unwrap();
    assert!((size - 50.0 * MM).abs() < 1.0 * MM, "{bodies}");
    let file = reqwest::get(it.url("/v1/reference-bodies/cube/mesh")).await.unwrap();
    let file = file.bytes().await.unwrap();
    let mesh = Mesh::from_bytes(MeshFormat::Stl, &file, 1e-3).unwrap();
    assert!((mesh.extent().x - size).abs() < 1e-6, "in millimetres");
    it.get("/v1/reference-bodies/teapot/mesh").await.problem(404, "not-found", None);
    let ridge = shapes::reference_body("reference_ridge").unwrap();
    let touches = sent(ridge, 20, 8, &Mistake::none());
    let request = json!({"reference_body": "ridge", "readings": touches});
    let answer = it.post(PATH, &request).await.expect(200);
    assert_eq!((&answer["wrong"], &answer["touched"]), (&json!([]), &json!("ridge")), "{answer}");
}
