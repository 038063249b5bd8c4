//! Tests of chapter 3's methods: maps of contact and force, poses, export and merging of maps.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::{DEG, MM};
use palpate_sim::letters::{Font, Letter};
use palpate_sim::rig::{PlanarPose, Rig, RigNoise, rig_sensor};
use serde_json::{Value, json};

use crate::harness::{BAR, CUBE, Harness, off_box, touches};

const SENSOR: &str = "digitacts-6x6-thin";
const LETTERS: [char; 5] = ['A', 'E', 'I', 'O', 'U'];

fn rig(seed: u64) -> Rig {
    Rig::new(SensorId(0), &rig_sensor(), RigNoise::physical(), seed)
}

fn letter(symbol: char) -> Letter {
    Font::built_in().letter(symbol).unwrap().clone()
}

pub(crate) fn wire(reading: &Reading) -> Value {
    let pose = reading.session_from_sensor();
    json!({
        "sensor": SENSOR,
        "pose": {
            "position": pose.translation.to_array(),
            "orientation": pose.rotation.to_array(),
        },
        "image": reading.image().pressures,
    })
}

/// Adds letters with the presses of the rig's plan.
pub(crate) async fn add_letters(it: &Harness, letters: &[char]) {
    let rig = rig(1);
    for symbol in letters {
        let name = symbol.to_string();
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
        let readings = rig.session(&rig.field(&letter(*symbol)), 0);
        let readings: Vec<Value> = readings.iter().map(wire).collect();
        let path = format!("/v1/objects/{name}/readings");
        it.post(&path, &json!({"readings": readings})).await.expect(200);
    }
}

/// Trains all objects, which must succeed; the version.
pub(crate) async fn train(it: &Harness, training: &Value) -> u64 {
    let job = it.post("/v1/catalogues/default/trainings", training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    job["version"].as_u64().unwrap()
}

/// Presses of a letter that lies at `session_from_letter`, by the trained sensor.
pub(crate) fn presses(symbol: char, n: usize, seed: u64, session_from_letter: Pose) -> Vec<Value> {
    let rig = rig(1);
    let field = rig.field(&letter(symbol));
    let mut stream = Stream::new(seed, Purpose::ObjectPose, 7);
    let mut press = || {
        let mut along = |reach: f64| stream.uniform(-reach, reach);
        let at = PlanarPose { x: along(9.0 * MM), y: along(9.0 * MM), angle: along(PI) };
        wire(&rig.press(&field, at, &mut stream).moved_by(session_from_letter))
    };
    (0..n).map(|_| press()).collect()
}

/// A tilted plane away from the origin.
fn session_from_plane() -> Pose {
    let rotation = DQuat::from_rotation_x(0.5) * DQuat::from_rotation_z(0.3);
    Pose::from_parts(rotation, DVec3::new(0.4, -0.1, 0.25))
}

fn wire_pose(pose: &Pose) -> Value {
    let orientation = pose.rotation.to_array();
    json!({"position": pose.translation.to_array(), "orientation": orientation})
}

fn pose(value: &Value) -> Pose {
    let numbers = |field: &str| -> Vec<f64> {
        value[field].as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
    };
    let (position, orientation) = (numbers("position"), numbers("orientation"));
    Pose::new(position.try_into().unwrap(), orientation.try_into().unwrap()).unwrap()
}

/// Pose of an object's frame in the frame of its training readings.
async fn letter_from_object(it: &Harness, name: &str) -> Pose {
    let report = it.get("/v1/catalogues/default/versions/1/report").await.expect(200);
    let objects = report["objects"].as_array().unwrap();
    let object = objects.iter().find(|object| object["name"] == name).unwrap();
    let origin = object["origin_in_mesh"].as_array().unwrap();
    let [x, y, z] = [0, 1, 2].map(|axis: usize| origin[axis].as_f64().unwrap());
    Pose { translation: DVec3::new(x, y, z), ..Pose::IDENTITY }
}

/// Checks that the best pose is the true one, in the plane.
#[track_caller]
fn check_pose(belief: &Value, plane_from_object: Pose, position_max: f64, angle_max: f64) {
    let found = session_from_plane().inverse() * pose(&belief["poses"][0]["pose"]);
    let off = found.translation - plane_from_object.translation;
    assert!(off.length() < position_max, "{off} m off: {}", belief["poses"]);
    // Half the covering is 0.5 mm; the sensors were 0.81 mm below the face.
    assert!(off.z.abs() < 0.35 * MM, "{off} m off: {}", belief["poses"]);
    let angle = found.angle_to(&plane_from_object);
    assert!(angle < angle_max, "{angle} rad off: {}", belief["poses"]);
}

fn sum(probabilities: &Value) -> f64 {
    probabilities.as_array().unwrap().iter().map(|p| p.as_f64().unwrap()).sum()
}

#[tokio::test(flavor = "multi_thread")]
async fn letters_are_recognised_and_located_after_a_restart() {
    let it = Harness::start().await;
    add_letters(&it, &LETTERS).await;
    train(&it, &json!({"n_classes": 8, "geometric": {"kind": "planar"}})).await;
    let report = it.get("/v1/catalogues/default/versions/1").await.expect(200);
    assert_eq!(report["training"]["geometric"], json!({"kind": "planar", "cell": 0.001}));
    let learnt = &report["report"]["objects"][0]["geometric"];
    assert_eq!((&learnt["has_force"], &learnt["n_cells"][2]), (&json!(true), &json!(1)));

    let plane_from_letter =
        Pose::from_parts(DQuat::from_rotation_z(2.1), DVec3::new(0.006, -0.004, 0.0));
    let session_from_letter = session_from_plane() * plane_from_letter;
    let session = it
        .session(json!({
            "method": "geometric",
            "pose_prior": {"kind": "planar", "plane": wire_pose(&session_from_plane())},
        }))
        .await;
    let path = format!("/v1/sessions/{session}");
    let shown = it.get(&path).await.expect(200);
    let prior = &shown["pose_prior"];
    assert_eq!((&shown["method"], &shown["seed"]), (&json!("geometric"), &json!(1)));
    assert_eq!((&prior["half_extent"], &prior["center"]), (&json!(0.01), &json!([0.0, 0.0])));
    let readings = presses('E', 7, 5, session_from_letter);
    let added = it.post(&format!("{path}/readings"), &json!({"readings": readings})).await;
    let belief = added.expect(200)["belief"].clone();
    assert_eq!(belief["objects"][0]["name"], "E", "{belief}");
    assert!(belief["objects"][0]["probability"].as_f64().unwrap() > 0.95, "{belief}");
    let plane_from_object = plane_from_letter * letter_from_object(&it, "E").await;
    check_pose(&belief, plane_from_object, 1.5 * MM, 6.0 * DEG);

    let marginals = it.get(&format!("{path}/marginals")).await;
    assert_eq!(marginals.headers["etag"], "\"7\"");
    let marginals = marginals.expect(200);
    assert_eq!((&marginals["name"], &marginals["revision"]), (&json!("E"), &json!(7)));
    let axes = marginals["axes"].as_array().unwrap();
    let named: Vec<_> = axes.iter().map(|axis| (&axis["axis"], &axis["unit"])).collect();
    assert_eq!(json!(named), json!([["x", "m"], ["y", "m"], ["theta", "rad"]]));
    for axis in axes.iter().chain([&marginals["plane"]]) {
        assert!((sum(&axis["probabilities"]) - 1.0).abs() < 1e-9, "{axis}");
    }
    // The likeliest bin of x contains the truth, or its neighbour does.
    let x: Vec<f64> = serde_json::from_value(axes[0]["probabilities"].clone()).unwrap();
    let [low, high] = ["low", "high"].map(|end| axes[0][end].as_f64().unwrap());
    let best = x.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
    let width = (high - low) / x.len() as f64;
    let at = low + (best as f64 + 0.5) * width;
    assert!((at - plane_from_object.translation.x).abs() < 1.5 * MM, "{at}");
    let other = it.get(&format!("{path}/marginals?object=Q")).await;
    other.problem(422, "invalid-value", Some("?object"));

    let it = it.restart().await;
    let after = it.get(&format!("{path}/belief")).await.expect(200);
    assert_eq!(after, belief);
    assert_eq!(it.get(&format!("{path}/marginals")).await.expect(200), marginals);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_printed_filters_recognise_letters_too() {
    let it = Harness::start().await;
    add_letters(&it, &['A', 'I', 'O']).await;
    train(&it, &json!({"n_classes": 4, "geometric": {"kind": "planar"}})).await;
    let plane_from_letter =
        Pose::from_parts(DQuat::from_rotation_z(-0.7), DVec3::new(-0.003, 0.005, 0.0));
    let session_from_letter = session_from_plane() * plane_from_letter;
    let prior = json!({"kind": "planar", "plane": wire_pose(&session_from_plane())});
    for request in [
        json!({"method": "geometric_histogram", "bins": [20, 20, 24], "pose_prior": prior}),
        json!({"method": "geometric_particles", "particles": 4000, "seed": 4, "pose_prior": prior}),
    ] {
        let session = it.session(request).await;
        let body = json!({"readings": presses('I', 25, 6, session_from_letter)});
        let added = it.post(&format!("/v1/sessions/{session}/readings"), &body).await.expect(200);
        let belief = &added["belief"];
        assert_eq!(belief["objects"][0]["name"], "I", "{belief}");
        let plane_from_object = plane_from_letter * letter_from_object(&it, "I").await;
        // An I is the same after half a turn.
        let turned = plane_from_object.rotation * DQuat::from_rotation_z(PI);
        let found = session_from_plane().inverse() * pose(&belief["poses"][0]["pose"]);
        let is_turned = found.rotation.angle_between(turned) < 1.0;
        let rotation = if is_turned { turned } else { plane_from_object.rotation };
        check_pose(belief, Pose { rotation, ..plane_from_object }, 4.0 * MM, 25.0 * DEG);
        let marginals = it.get(&format!("/v1/sessions/{session}/marginals")).await.expect(200);
        for axis in marginals["axes"].as_array().unwrap() {
            assert!((sum(&axis["probabilities"]) - 1.0).abs() < 1e-9, "{axis}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_solid_is_recognised_near_its_nominal_pose() {
    let it = Harness::start().await;
    for (name, size) in [("cube", CUBE), ("bar", BAR)] {
        it.post("/v1/objects", &json!({"name": name})).await.expect(201);
        it.put_mesh(name, &off_box(size)).await.expect(200);
    }
    let geometry = json!({"kind": "solid", "cell": 0.003});
    let training = json!({"readings_per_object": 120, "n_classes": 8, "geometric": geometry});
    train(&it, &training).await;
    let truth = Pose::from_parts(DQuat::from_rotation_z(0.1), DVec3::new(0.302, 0.001, -0.002));
    let middle = Pose { translation: DVec3::new(0.3, 0.0, 0.0), ..Pose::IDENTITY };
    let none = it.post("/v1/sessions", &json!({"method": "geometric"})).await;
    none.problem(422, "invalid-value", Some("/pose_prior"));
    let prior = json!({"kind": "bounded", "pose": wire_pose(&middle),
        "half_extents": [0.01, 0.01, 0.01], "half_angle": 0.3});
    for (field, value, pointer) in [
        ("half_extents", json!([0.01, 0.5, 0.01]), "/pose_prior/half_extents/1"),
        ("half_angle", json!(1.5), "/pose_prior/half_angle"),
    ] {
        let mut wide = prior.clone();
        wide[field] = value;
        let refused =
            it.post("/v1/sessions", &json!({"method": "geometric", "pose_prior": wide})).await;
        refused.problem(422, "invalid-value", Some(pointer));
    }
    let session = it.session(json!({"method": "geometric", "pose_prior": prior})).await;
    let body = json!({"readings": touches(BAR, 12, 41, truth)});
    let added = it.post(&format!("/v1/sessions/{session}/readings"), &body).await.expect(200);
    let belief = &added["belief"];
    assert_eq!(belief["objects"][0]["name"], "bar", "{belief}");
    let found = pose(&belief["poses"][0]["pose"]);
    assert!(found.distance_to(&truth) < 5.0 * MM, "{belief}");
    let marginals = it.get(&format!("/v1/sessions/{session}/marginals")).await.expect(200);
    assert_eq!(marginals["axes"].as_array().unwrap().len(), 6);
    let ply = it.get("/v1/catalogues/default/versions/1/objects/bar/occupancy.ply?form=mesh").await;
    assert_eq!(ply.headers["content-type"], "model/ply");
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_input_of_geometric_sessions_is_refused() {
    let it = Harness::start().await;
    add_letters(&it, &['I', 'O']).await;
    let flat = json!({"n_classes": 4, "geometric": {"kind": "planar"}});
    assert_eq!(train(&it, &json!({"n_classes": 4})).await, 1);
    let bare = it.post("/v1/sessions", &json!({"method": "geometric"})).await;
    let problem = bare.problem(409, "wrong-state", None);
    assert!(problem["detail"].as_str().unwrap().contains("geometric"), "{problem}");
    let occupancy = "/v1/catalogues/default/versions/1/objects/I/occupancy";
    it.get(occupancy).await.problem(409, "wrong-state", None);
    let sva = it.session(json!({})).await;
    it.get(&format!("/v1/sessions/{sva}/marginals")).await.problem(409, "wrong-state", None);

    train(&it, &flat).await;
    let bounded = json!({"kind": "bounded", "half_extents": [0.1, 0.1, 0.1], "half_angle": 1.0,
        "pose": wire_pose(&Pose::IDENTITY)});
    let planar = |change: Value| {
        let mut prior = json!({"kind": "planar"});
        prior.as_object_mut().unwrap().extend(change.as_object().unwrap().clone());
        json!({"method": "geometric", "pose_prior": prior})
    };
    for (request, pointer) in [
        (json!({"method": "geometric", "pose_prior": bounded}), "/pose_prior/kind"),
        (json!({"method": "geometric", "bins": [9, 9, 9]}), "/bins"),
        (json!({"method": "geometric", "particles": 1000}), "/particles"),
        (json!({"method": "geometric_histogram", "bins": [9, 9, 1]}), "/bins/2"),
        (json!({"method": "geometric_histogram", "bins": [99, 99, 99]}), "/bins"),
        (json!({"method": "sva", "pose_prior": {"kind": "planar"}}), "/pose_prior"),
        (json!({"seed": 3}), "/seed"),
        (planar(json!({"half_extent": 0.0})), "/pose_prior/half_extent"),
        (planar(json!({"half_angle": 4.0})), "/pose_prior/half_angle"),
        (planar(json!({"center": [0.0, 1e9]})), "/pose_prior/center/1"),
        (
            planar(json!({"plane": {"position": [0, 0, 0], "orientation": [0, 0, 0, 0]}})),
            "/pose_prior/plane/orientation",
        ),
    ] {
        let refused = it.post("/v1/sessions", &request).await;
        refused.problem(422, "invalid-value", Some(pointer));
    }
    it.post("/v1/sessions", &planar(json!({"halfextent": 0.1}))).await.expect(422);

    let session = it.session(json!({"method": "geometric"})).await;
    let good = presses('I', 1, 3, Pose::IDENTITY).remove(0);
    let tilt = Pose::from_parts(DQuat::from_rotation_x(40.0 * DEG), DVec3::ZERO);
    let tilted = presses('I', 1, 3, tilt).remove(0);
    let path = format!("/v1/sessions/{session}");
    let refused = it.post(&format!("{path}/readings"), &json!({"readings": [good, tilted]})).await;
    refused.problem(422, "invalid-value", Some("/readings/1/pose"));
    assert_eq!(it.get(&path).await.expect(200)["n_readings"], 0);
    // Any sensor is accepted, even of another shape than in training.
    let mut other = json!({"sensor": "fingertip-14x14", "image": vec![0.0; 196]});
    other["pose"] = presses('I', 1, 4, Pose::IDENTITY)[0]["pose"].clone();
    it.post(&format!("{path}/readings"), &json!({"readings": [other]})).await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_training_with_a_too_large_map_fails_by_object() {
    let it = Harness::start().await;
    add_letters(&it, &['I']).await;
    it.post("/v1/objects", &json!({"name": "huge"})).await.expect(201);
    it.put_mesh("huge", &off_box([900.0, 900.0, 900.0])).await.expect(200);
    let geometry = json!({"kind": "solid", "cell": 0.0002});
    let training = json!({"objects": ["huge"], "readings_per_object": 20, "n_classes": 4,
        "geometric": geometry});
    let job = it.post("/v1/catalogues/default/trainings", &training).await.expect(202);
    let job = it.finished(job["id"].as_str().unwrap()).await;
    assert_eq!(job["state"], "failed", "{job}");
    let reason = job["reason"].as_str().unwrap();
    assert!(reason.contains("huge") && reason.contains("0.2 mm"), "{reason}");
    for (geometry, pointer) in [
        (json!({"kind": "planar", "cell": 0.06}), "/geometric/cell"),
        (json!({"kind": "flat"}), "/geometric/kind"),
        (json!({"kind": "solid", "cells": 3}), "/geometric/cells"),
    ] {
        let refused =
            it.post("/v1/catalogues/default/trainings", &json!({"geometric": geometry})).await;
        refused.problem(422, "invalid-value", Some(pointer));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn maps_are_shown_exported_and_merged() {
    let it = Harness::start().await;
    add_letters(&it, &['I', 'O']).await;
    train(&it, &json!({"n_classes": 4, "geometric": {"kind": "planar"}})).await;
    let path = "/v1/catalogues/default/versions/1/objects/O/occupancy";
    let map = it.get(path).await;
    assert_eq!(map.headers["cache-control"], "private, max-age=31536000, immutable");
    let tag = map.headers["etag"].to_str().unwrap().to_owned();
    let map = map.expect(200);
    let n = |field: &str| map[field].as_u64().unwrap();
    let cells: Vec<u64> = serde_json::from_value(map["n_cells"].clone()).unwrap();
    assert_eq!(n("n_occupied") + n("n_free") + n("n_unknown"), cells[0] * cells[1]);
    assert!(n("n_occupied") > 50 && n("n_free") > 50, "{map}");
    assert_eq!((&map["kind"], &map["log_odds"]), (&json!("planar"), &Value::Null));
    let slice = it.get(&format!("{path}?slice=0")).await.expect(200);
    assert_eq!(slice["log_odds"].as_array().unwrap().len() as u64, cells[0] * cells[1]);
    it.get(&format!("{path}?slice=1")).await.problem(422, "invalid-value", Some("?slice"));
    let known = it.client.get(it.url(path)).header("if-none-match", &tag).send().await.unwrap();
    assert_eq!(known.status(), 304);

    let png = it.client.get(it.url(&format!("{path}.png"))).send().await.unwrap();
    assert_eq!(png.headers()["content-type"], "image/png");
    let png = png.bytes().await.unwrap();
    let mut image = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut pixels = vec![0; image.output_buffer_size().unwrap()];
    let frame = image.next_frame(&mut pixels).unwrap();
    assert_eq!(u64::from(frame.width) % cells[0], 0);
    assert_eq!(u64::from(frame.height) % cells[1], 0);
    let ply = it.get(&format!("{path}.ply")).await;
    assert_eq!(ply.status, 200);
    assert!(ply.text.starts_with("ply\n"), "{:.40}", ply.text);

    // The same readings again: twice the evidence.
    let request = json!({"version": 1, "with": {"catalogue": "default", "version": 1}});
    let merged = it.post("/v1/catalogues/default/merges", &request).await.expect(201);
    assert_eq!((&merged["version"], &merged["is_current"]), (&json!(2), &json!(true)));
    assert_eq!(
        (&merged["job"], merged["merged_from"].as_array().unwrap().len()),
        (&Value::Null, 2)
    );
    let twice = it.get(&path.replace("versions/1", "versions/2")).await.expect(200);
    assert_eq!(twice["n_cells"], map["n_cells"]);
    let twice = it.get(&format!("{}?slice=0", path.replace("versions/1", "versions/2"))).await;
    let values = |map: &Value| -> Vec<f64> {
        map["log_odds"].as_array().unwrap().iter().map(|cell| cell.as_f64().unwrap()).collect()
    };
    // The prior is a half, its log-odds 0; maps end at ±8.
    for (twice, once) in values(&twice.expect(200)).iter().zip(values(&slice)) {
        assert!((twice - (2.0 * once).clamp(-8.0, 8.0)).abs() < 1e-5, "{twice} {once}");
    }
    it.session(json!({"method": "geometric"})).await;

    train(&it, &json!({"n_classes": 4, "geometric": {"kind": "planar", "cell": 0.002}})).await;
    train(&it, &json!({"n_classes": 4, "objects": ["I"]})).await;
    let with = |version: u32, catalogue: &str| json!({"version": 1, "with": {"catalogue": catalogue, "version": version}});
    for (request, status, kind, pointer) in [
        (with(3, "default"), 422, "invalid-value", Some("/with")),
        (with(4, "default"), 409, "wrong-state", None),
        (with(9, "default"), 422, "invalid-value", Some("/with/version")),
        (with(1, "other"), 422, "invalid-value", Some("/with/catalogue")),
    ] {
        let refused = it.post("/v1/catalogues/default/merges", &request).await;
        refused.problem(status, kind, pointer);
    }
    let mut aside = with(1, "default");
    aside["activate"] = json!(false);
    let aside = it.post("/v1/catalogues/default/merges", &aside).await.expect(201);
    assert_eq!((&aside["version"], &aside["is_current"]), (&json!(5), &json!(false)));
}
