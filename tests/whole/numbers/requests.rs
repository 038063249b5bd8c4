//! A valid request for every operation that has numbers, on a server with data of every kind:
//! sensors, flat and solid objects, a version of each, and a session of each method.

use std::f64::consts::PI;
use std::time::Duration;

use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::SensorDescription;
use palpate_sim::indent::indentation_run;
use palpate_sim::letters::Font;
use palpate_sim::press::PressSimulator;
use palpate_sim::rig::{Rig, RigNoise, rig_sensor};
use palpate_sim::sampler::{SamplerConfig, sample};
use palpate_sim::shapes;
use reqwest::Method;
use serde_json::{Value, json};

use super::Asked;
use super::fields::Operation;

/// A request in which a number is changed.
pub(crate) struct Base {
    pub(crate) method: Method,
    pub(crate) path: String,
    pub(crate) body: Option<Value>,
}

/// Maximum time of a training of the set-up; it only ends a test that hangs.
const SET_UP: Duration = Duration::from_secs(1800);

/// Creates the subjects of the requests: two catalogues with a version each, and a sensor.
pub(crate) async fn set_up(asked: &Asked) {
    for name in ["hammer", "mug", "spare", "I", "O"] {
        asked.must(Method::POST, "/v1/objects", Some(&json!({"name": name}))).await;
    }
    let probe = json!({"name": "probe", "preset": "digitacts-6x6"});
    asked.must(Method::POST, "/v1/sensors", Some(&probe)).await;
    asked.must(Method::POST, "/v1/sensors/probe/calibration", Some(&calibration())).await;
    asked.put_mesh("mug", shapes::example("mug").unwrap().to_stl_bytes()).await;
    let own = [("hammer", touches("hammer", 60)), ("I", letter_presses('I'))];
    for (name, readings) in own.into_iter().chain([("O", letter_presses('O'))]) {
        let path = format!("/v1/objects/{name}/readings");
        asked.must(Method::POST, &path, Some(&json!({"readings": readings}))).await;
    }
    for training in [
        json!({"objects": ["hammer", "mug"], "readings_per_object": 60, "n_classes": 8,
            "geometric": {"kind": "solid", "cell": 0.004}, "appearance": {"n_classes": [8]}}),
        json!({"objects": ["I", "O"], "n_classes": 4, "geometric": {"kind": "planar"}}),
    ] {
        let flat = training["geometric"]["kind"] == "planar";
        let catalogue = if flat { "flat" } else { "solid" };
        let path = format!("/v1/catalogues/{catalogue}/trainings");
        let job = asked.must(Method::POST, &path, Some(&training)).await;
        assert_eq!(asked.end(&job, SET_UP).await, "succeeded", "{training}");
    }
    for session in sessions() {
        let made = asked.must(Method::POST, "/v1/sessions", Some(&session)).await;
        let path = format!("/v1/sessions/{}/readings", made["id"].as_str().unwrap());
        let catalogue = &session["catalogue"];
        for _ in 0..6 {
            asked.must(Method::POST, &path, Some(&readings(catalogue))).await;
        }
    }
    close_sessions(asked).await;
}

/// Closes sessions with their true objects, as many as a recalibration needs.
async fn close_sessions(asked: &Asked) {
    for (name, touches) in [("hammer", touches("hammer", 3)), ("mug", touches("mug", 3))] {
        for _ in 0..10 {
            let session = json!({"catalogue": "solid"});
            let made = asked.must(Method::POST, "/v1/sessions", Some(&session)).await;
            let path = format!("/v1/sessions/{}", made["id"].as_str().unwrap());
            let readings = json!({"readings": touches});
            asked.must(Method::POST, &format!("{path}/readings"), Some(&readings)).await;
            let truth = json!({"object": name});
            asked.must(Method::POST, &format!("{path}/close"), Some(&truth)).await;
        }
    }
}

/// The values of the names in braces in paths.
pub(crate) async fn placeholders(asked: &Asked) -> Vec<(String, Vec<String>)> {
    let all = asked.must(Method::GET, "/v1/sessions?state=open", None).await;
    let ids = all["items"].as_array().unwrap().iter();
    let ids: Vec<String> = ids.map(|session| session["id"].as_str().unwrap().to_owned()).collect();
    assert_eq!(ids.len(), sessions().len());
    let one = |name: &str, value: &str| (name.to_owned(), vec![value.to_owned()]);
    vec![
        ("session".to_owned(), ids),
        one("name", "solid"),
        one("version", "1"),
        one("object", "hammer"),
        one("sensor", "probe"),
        one("body", "cube"),
        one("key", "none"),
        one("webhook", "none"),
        one("job", "none"),
        one("alias", "candidate"),
    ]
}

/// A path with its names filled in, except the one that is a number itself.
pub(crate) fn with_number(
    path: &str,
    name: &str,
    number: &Value,
    placeholders: &[(String, Vec<String>)],
) -> String {
    let path = path.replace(&format!("{{{name}}}"), &number.to_string());
    filled(&path, placeholders).remove(0)
}

/// A path with its names filled in, in every way.
pub(crate) fn filled(path: &str, placeholders: &[(String, Vec<String>)]) -> Vec<String> {
    // The objects of the trained versions stay unchanged.
    let path = path.replace("/v1/objects/{object}", "/v1/objects/spare");
    let mut paths = vec![path.clone()];
    for (name, values) in placeholders {
        let name = format!("{{{name}}}");
        if path.contains(&name) {
            let of = |path: &String| -> Vec<String> {
                values.iter().map(|value| path.replace(&name, value)).collect()
            };
            paths = paths.iter().flat_map(of).collect();
        }
    }
    paths
}

/// Valid requests of an operation. Requests without a body are valid by their path alone.
pub(crate) fn bases(operation: &Operation, placeholders: &[(String, Vec<String>)]) -> Vec<Base> {
    let bodies = match &operation.method {
        &Method::GET | &Method::DELETE => vec![None],
        _ => bodies(&operation.path).into_iter().map(Some).collect(),
    };
    let mut bases = Vec::new();
    let is_forwarding =
        operation.method == Method::PUT && operation.path == "/v1/sessions/{session}";
    let paths = match is_forwarding {
        // The sessions of the set-up belong to robots.
        true => vec!["/v1/sessions/0198a0d0-0000-7000-8000-000000000000".to_owned()],
        false => filled(&operation.path, placeholders),
    };
    for path in paths {
        for body in &bodies {
            let (method, path, body) = (operation.method.clone(), path.clone(), body.clone());
            bases.push(Base { method, path, body });
        }
    }
    bases
}

/// Valid bodies of an operation, enough for every number to be in one.
fn bodies(path: &str) -> Vec<Value> {
    let reading = || touches("hammer", 1).remove(0);
    match path {
        "/v1/analyses/covering" => vec![
            json!({"element_width": 0.002, "force_resolutions": [0.01], "spreads": [0.002]}),
            json!({"element_width": 0.002, "thicknesses": [0.001, 0.002]}),
        ],
        "/v1/catalogues/{name}/calibrations" => vec![json!({"version": 1, "activate": false})],
        "/v1/catalogues/{name}/current" | "/v1/catalogues/{name}/aliases/{alias}" => {
            vec![json!({"version": 1})]
        }
        "/v1/catalogues/{name}/versions/{version}/shadow" => {
            vec![json!({"against": 1, "risk": 0.05})]
        }
        "/v1/catalogues/{name}/merges" => {
            vec![json!({"version": 1, "with": {"catalogue": "solid", "version": 1}})]
        }
        "/v1/catalogues/{name}/trainings" => vec![
            json!({"objects": ["mug"], "readings_per_object": 20, "n_classes": 2, "seed": 1,
                "surface_readings_per_object": 20,
                "distance_range": {"min": 0.008, "max": 0.16},
                "geometric": {"kind": "solid", "cell": 0.004},
                "appearance": {"n_classes": [2], "discriminant_axes": 1, "report_readings": 1,
                    "variance_share": 0.9}}),
            json!({"objects": ["I"], "n_classes": 2, "geometric": {"kind": "planar", "cell": 0.001}}),
            json!({"objects": ["I"], "extend": 1}),
        ],
        "/v1/keys" => vec![json!({"name": "probing", "role": "viewer", "expires_in_s": 60})],
        "/v1/keys/{key}/rotate" | "/v1/webhooks/{webhook}/rotate" => vec![json!({"grace_s": 1})],
        "/v1/sensors" => vec![
            json!({"name": "made", "description": description()}),
            json!({"name": "made", "description": open_description(), "coupling": coupling()}),
            json!({"name": "made", "description": listed()}),
        ],
        "/v1/sensors/{sensor}/calibration" => vec![calibration()],
        "/v1/sensors/{sensor}/commissionings" => vec![commissioning()],
        "/v1/sensors/{sensor}/check" => vec![full(reading()), featured(), contact()],
        "/v1/sessions" => sessions(),
        "/v1/sessions/{session}" => {
            let hash = "0".repeat(64);
            let forwarded =
                |session: &Value| json!({"cell": "cell", "version_hash": hash, "session": session});
            sessions().iter().map(forwarded).collect()
        }
        "/v1/sessions/{session}/forwarded" => {
            let readings = [full(reading()), featured(), contact()];
            let entries = readings.map(|reading| json!({"reading": reading}));
            let entries = entries.into_iter().chain([json!({"retracts": 0})]);
            entries.map(|entry| json!({"from": 0, "entries": [entry]})).collect()
        }
        "/v1/fleet/acknowledgements" => {
            vec![json!({"sessions": ["00000000-0000-0000-0000-000000000001"], "mute_s": 60})]
        }
        // No object of the catalogues: later cases need the sessions open.
        "/v1/sessions/{session}/close" => {
            vec![json!({"object": "none-such", "pose": reading()["pose"]})]
        }
        "/v1/sessions/{session}/lease" => vec![json!({"seconds": 60})],
        "/v1/sessions/{session}/next-touches" => vec![
            json!({"n": 4, "deadline_ms": 100, "seed": 1,
                "workspace": {"center": [0.0, 0.0, 0.0], "radius": 0.1}}),
            json!({"deadline_ms": 100, "candidates": [
                {"pose": reading()["pose"], "reach_m": 0.1, "cost": 1.0}]}),
        ],
        "/v1/objects/{object}/readings" | "/v1/sessions/{session}/readings" => {
            let readings = [full(reading()), featured(), contact()];
            readings.map(|reading| json!({"readings": [reading]})).to_vec()
        }
        _ => Vec::new(),
    }
}

/// New sessions: at least one of each method and kind of maps, some with two numbers at their
/// ends.
fn sessions() -> Vec<Value> {
    let at = json!({"position": [0.0, 0.0, 0.0], "orientation": [0.0, 0.0, 0.0, 1.0]});
    let looseness = json!({"position_m": 0.01, "angle_rad": 0.1});
    let planar = |half_extent: f64| {
        json!({"kind": "planar", "plane": at, "center": [0.0, 0.0], "half_extent": half_extent,
            "angle": 0.0, "half_angle": PI})
    };
    let bounded = |half_angle: f64| {
        json!({"kind": "bounded", "pose": at, "half_extents": [0.01, 0.01, 0.01],
            "half_angle": half_angle})
    };
    let flat = |method: &str, prior: Value| json!({"catalogue": "flat", "method": method, "pose_prior": prior, "seed": 1});
    let solid = |method: &str, prior: Value| json!({"catalogue": "solid", "method": method, "pose_prior": prior, "seed": 1});
    let with = |mut session: Value, field: &str, value: Value| {
        session[field] = value;
        session
    };
    let covariance: Vec<f64> = (0..36).map(|n| if n % 7 == 0 { 0.01 } else { 0.0 }).collect();
    let seen = |hypotheses: Value| {
        let workspace = json!({"low": [-1.0, -1.0, -1.0], "high": [1.0, 1.0, 1.0]});
        json!({"catalogue": "solid", "method": "surface", "pose_prior": {"kind": "camera",
            "hypotheses": hypotheses, "workspace": workspace, "wrong": 0.1,
            "class_weights": [{"object": "hammer", "weight": 1.0}]}})
    };
    let histogram = |half_extent: f64, bins: [u32; 3]| {
        with(flat("geometric_histogram", planar(half_extent)), "bins", json!(bins))
    };
    vec![
        json!({"catalogue": "solid", "method": "surface", "risk": 0.01, "unknown_prior": 0.1,
            "ttl_s": 600, "version": 1, "object_moves": looseness,
            "prior": [{"object": "hammer", "probability": 0.5}],
            "robots": [{"robot": "arm", "base": looseness}]}),
        seen(json!([{"pose": at, "deviation": looseness, "weight": 2.0, "object": "hammer"}])),
        seen(json!([{"pose": at, "covariance": covariance, "weight": 1.0}])),
        json!({"catalogue": "solid", "method": "sva"}),
        json!({"catalogue": "solid", "method": "sva_literal"}),
        json!({"catalogue": "solid", "method": "appearance"}),
        flat("geometric", planar(0.01)),
        histogram(0.01, [25, 25, 16]),
        histogram(0.01, [200, 200, 2]),
        histogram(0.0008, [2, 2, 200]),
        with(flat("geometric_particles", planar(0.01)), "particles", json!(1000)),
        solid("geometric", bounded(0.3)),
        with(solid("geometric_particles", bounded(0.3)), "particles", json!(1000)),
        with(solid("geometric_particles", bounded(0.001)), "particles", json!(100_000)),
    ]
}

/// Readings that a session of this catalogue accepts.
pub(crate) fn readings(catalogue: &Value) -> Value {
    let readings = if catalogue == "flat" { letter_presses('I') } else { touches("hammer", 2) };
    json!({"readings": readings[..2]})
}

/// A reading with every number but a feature's.
fn full(mut reading: Value) -> Value {
    reading["robot"] = json!("arm");
    reading["seq"] = json!(7);
    reading["stamp"] = json!({"sec": 1, "nanosec": 5});
    reading["approach_m"] = json!(0.1);
    reading["shear"] = json!(vec![[1.0, 1.0]; 36]);
    reading["object_moved"] = json!({"position_m": 0.01, "angle_rad": 0.1});
    reading
}

/// A reading with the client's own feature.
fn featured() -> Value {
    json!({"sensor": "probe", "image": [], "feature": [0.5, 0.25]})
}

/// A contact without an image.
fn contact() -> Value {
    json!({"sensor": "probe", "contact": {"position": [0.0, 0.0, 0.01], "position_deviation_m": 0.002,
        "normal": [0.0, 0.0, 1.0], "normal_deviation_rad": 0.2, "force_n": 2.5}})
}

fn wire(sensor: &str, reading: &Reading) -> Value {
    let pose = reading.session_from_sensor();
    json!({"sensor": sensor, "image": reading.image().pressures, "pose": {
        "position": pose.translation.to_array(), "orientation": pose.rotation.to_array()}})
}

/// Touches of an example object.
pub(crate) fn touches(name: &str, n: usize) -> Vec<Value> {
    let mesh = shapes::example(name).unwrap();
    let simulator = PressSimulator::new(mesh, SensorDescription::digitacts_6x6());
    let config = SamplerConfig::for_simulator(&simulator);
    let mut go_on = |_, _| std::ops::ControlFlow::Continue(());
    let touches = sample(&simulator, SensorId(0), n, 7, &config, &mut go_on).unwrap();
    touches.iter().map(|touch| wire("digitacts-6x6", touch)).collect()
}

/// Presses of a raised letter, straight down.
fn letter_presses(symbol: char) -> Vec<Value> {
    let rig = Rig::new(SensorId(0), &rig_sensor(), RigNoise::physical(), 1);
    let presses = rig.session(&rig.field(Font::built_in().letter(symbol).unwrap()), 0);
    presses.iter().map(|press| wire("digitacts-6x6-thin", press)).collect()
}

/// Indentations of every taxel.
fn calibration() -> Value {
    let run = indentation_run(&SensorDescription::digitacts_6x6(), 3);
    let response = run.response.iter().map(|press| {
        json!({"row": press.taxel / 6, "col": press.taxel % 6, "depth": press.depth,
            "pressures": press.pressures})
    });
    let presses = run.spread.iter().take(60).map(|press| {
        json!({"x": press.at.0, "y": press.at.1, "depth": press.depth,
            "pressures": press.pressures})
    });
    json!({"response": response.collect::<Vec<_>>(), "spread": {"indenter_diameter": 0.001,
        "covering_thickness": 0.002, "presses": presses.collect::<Vec<_>>()}})
}

/// Touches of the hammer, whose pose is stated.
pub(crate) fn commissioning() -> Value {
    let of = |touch: &Value| json!({"image": touch["image"], "pose": touch["pose"]});
    let readings: Vec<Value> = touches("hammer", 8).iter().map(of).collect();
    json!({"object": "hammer", "seed": 1, "readings": readings, "session_from_object":
        {"position": [0.0, 0.0, 0.0], "orientation": [0.0, 0.0, 0.0, 1.0]}})
}

/// A sensor of 6 × 6 taxels.
fn description() -> Value {
    json!({"grid": {"rows": 6, "cols": 6, "pitch": 0.002, "taxel_width": 0.0018},
        "covering_thickness": 0.00254, "point_spread": 0.003482, "saturation": 20000.0,
        "noise": 100.0, "quantisation": 78.125,
        "force_curve": [{"displacement": 0.0, "pressure": 0.0},
            {"displacement": 0.00254, "pressure": 20000.0}]})
}

/// A fingertip of three taxels.
fn listed() -> Value {
    let taxel = |x: f64, z: f64| {
        json!({"position": {"x": 0.01 * x, "y": 0.0, "z": 0.01 * (z - 1.0)},
            "normal": {"x": x, "y": 0.0, "z": z}, "width": 0.003})
    };
    json!({"taxels": [taxel(-0.6, 0.8), taxel(0.0, 1.0), taxel(0.6, 0.8)],
        "covering_thickness": 0.002, "saturation": 50000.0, "quantisation": 0.0})
}

/// A sensor whose coupling is stated and whose ranges replace the defaults.
fn open_description() -> Value {
    let range = |low: f64, high: f64| json!({"low": low, "high": high});
    let mut open = description();
    open["coupling"] = coupling();
    open["ranges"] = json!({"spread_factor": range(0.5, 1.5), "margin": range(0.0, 0.004),
        "cross_talk": range(0.0, 0.1), "stiffness": range(0.5, 2.0),
        "stiffening": range(0.0, 1.0)});
    open
}

fn coupling() -> Value {
    json!({"margin": 0.002, "cross_talk": 0.05, "gain_spread": 0.02, "hysteresis": 0.05})
}

/// A training that presses a mesh with a sensor.
pub(crate) fn training_with(sensor: &Value) -> Value {
    json!({"objects": ["mug"], "sensor": sensor, "readings_per_object": 20, "n_classes": 2,
        "activate": false})
}
