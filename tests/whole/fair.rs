//! Short requests beside every kind of long work, against a real server.
//!
//! Copies of one request after the other keep the server busy: every answer that can be fetched,
//! and what takes long as known. Meanwhile lists and readings are asked; the processor time that
//! the server uses until each is answered has a bound. Unlike wall time it does not depend on the
//! load of the machine; it does on its speed. Not here: the content of the answers.

use std::path::Path;
use std::time::Duration;

use palpate_sim::shapes;
use palpate_tests::processor_seconds;
use reqwest::Method;
use serde_json::{Value, json};

use crate::command::Serving;
use crate::numbers::Asked;
use crate::numbers::requests::{self, commissioning, filled, placeholders, touches};

/// Number of concurrent copies of a long request: twice the cores of a small machine.
const AT_ONCE: usize = 4;
/// Maximum processor time until a short request is answered. Before the others' slices of 50 ms
/// ended, it was their whole time: minutes.
const ANSWERED_WITHIN_CORE_SECONDS: f64 = 1.5;
/// Processor time after which the long work is under way, and the longest wait for it.
const UNDER_WAY_CORE_SECONDS: f64 = 0.2;
const UNDER_WAY_WITHIN: Duration = Duration::from_secs(1);

/// A request that keeps the server busy, for each copy.
struct Long {
    name: String,
    copies: Vec<(Method, String, Option<Value>)>,
}

impl Long {
    fn of(method: Method, path: String, body: Option<Value>) -> Self {
        Self { name: format!("{method} {path}"), copies: vec![(method, path, body); AT_ONCE] }
    }
}

/// Every answer that can be fetched: each path, with the first two of its sessions.
fn fetched(placeholders: &[(String, Vec<String>)]) -> Vec<Long> {
    let description = Path::new(env!("CARGO_MANIFEST_DIR")).join("../schemas/openapi.json");
    let description: Value = serde_json::from_slice(&std::fs::read(description).unwrap()).unwrap();
    let paths = description["paths"].as_object().unwrap().iter();
    let paths = paths.filter(|(path, of)| of.get("get").is_some() && !path.ends_with("/events"));
    paths
        .flat_map(|(path, _)| filled(path, placeholders).into_iter().take(2))
        .map(|path| Long::of(Method::GET, path, None))
        .collect()
}

/// A session for each copy, with readings in one request.
async fn folds(asked: &Asked, name: &str, session: Value, readings: Vec<Value>) -> Long {
    let (mut copies, body) = (Vec::new(), json!({"readings": readings}));
    for _ in 0..AT_ONCE {
        let made = asked.must(Method::POST, "/v1/sessions", Some(&session)).await;
        let path = format!("/v1/sessions/{}/readings", made["id"].as_str().unwrap());
        copies.push((Method::POST, path, Some(body.clone())));
    }
    Long { name: name.to_owned(), copies }
}

/// Touches that contradict each other, of robots in turn.
fn contradictory(n: usize, robots: usize) -> Vec<Value> {
    let touch = |(number, mut touch): (usize, Value)| {
        for axis in 0..3 {
            let off = 0.1 * ((number * (axis + 2)) as f64).sin();
            let found = touch["pose"]["position"][axis].as_f64().unwrap();
            touch["pose"]["position"][axis] = json!(found + off);
        }
        touch["robot"] = json!(format!("arm-{}", number % robots));
        touch["seq"] = json!(number);
        touch
    };
    touches("hammer", 20).into_iter().cycle().take(n).enumerate().map(touch).collect()
}

/// What takes long.
async fn known(asked: &Asked) -> Vec<Long> {
    let at = json!({"position": [0.0, 0.0, 0.0], "orientation": [0.0, 0.0, 0.0, 1.0]});
    let loose = json!({"position_m": 0.1, "angle_rad": 1.0});
    let robot = |n: usize| json!({"robot": format!("arm-{n}"), "base": loose});
    let robots: Vec<Value> = (0..30).map(robot).collect();
    let seen = |n: usize| {
        let mut at = at.clone();
        at["position"][0] = json!(0.002 * n as f64);
        json!({"pose": at, "weight": 1.0, "deviation": {"position_m": 0.01, "angle_rad": 0.2}})
    };
    let camera = json!({"kind": "camera", "wrong": 0.1, "hypotheses": (0..64).map(seen).collect::<Vec<_>>(),
        "workspace": {"low": [-1.0, -1.0, -1.0], "high": [1.0, 1.0, 1.0]}});
    let particles = json!({"kind": "bounded", "pose": at, "half_extents": [0.05, 0.05, 0.05], "half_angle": 3.0});
    let surface = json!({"catalogue": "solid", "method": "surface"});
    let with = |mut session: Value, field: &str, value: &Value| {
        session[field] = value.clone();
        session
    };
    let long = [
        ("a thousand contradictory readings", surface.clone(), contradictory(1000, 1)),
        (
            "thirty loose bases",
            with(surface.clone(), "robots", &json!(robots)),
            contradictory(30, 30),
        ),
        ("ten loose bases", with(surface.clone(), "robots", &json!(robots)), contradictory(50, 10)),
        (
            "hypotheses of a camera",
            with(surface.clone(), "pose_prior", &camera),
            contradictory(30, 1),
        ),
        ("drift", with(surface, "object_moves", &loose), contradictory(60, 1)),
        ("pair maps", json!({"catalogue": "solid", "method": "sva"}), contradictory(60, 1)),
        (
            "particles",
            json!({"catalogue": "solid", "method": "geometric_particles",
            "particles": 100_000, "pose_prior": particles, "seed": 1}),
            contradictory(30, 1),
        ),
    ];
    let mut all = Vec::new();
    for (name, session, readings) in long {
        all.push(folds(asked, name, session, readings).await);
    }
    // Answers that fold many readings again.
    let made = asked.must(Method::POST, "/v1/sessions", Some(&json!({"catalogue": "solid"}))).await;
    let path = format!("/v1/sessions/{}", made["id"].as_str().unwrap());
    let readings = json!({"readings": contradictory(60, 1)});
    asked.must(Method::POST, &format!("{path}/readings"), Some(&readings)).await;
    for question in ["explain", "replay?limit=60", "belief?at=59", "marginals"] {
        all.push(Long::of(Method::GET, format!("{path}/{question}"), None));
    }
    let next = json!({"n": 64, "deadline_ms": 10_000, "seed": 1});
    all.push(Long::of(Method::POST, format!("{path}/next-touches"), Some(next)));
    let path = "/v1/sensors/probe/commissionings".to_owned();
    all.push(Long::of(Method::POST, path, Some(commissioning())));
    all
}

/// Asks again and again.
async fn keep_asking(url: String, (method, path, body): (Method, String, Option<Value>)) {
    let asked = Asked::new(&url);
    loop {
        let _ = asked.send(&method, &path, body.as_ref()).await;
    }
}

/// Processor time of the server until each of some short requests was answered.
async fn short(asked: &Asked, process: u32) -> Vec<(String, f64)> {
    let reading = json!({"readings": [touches("hammer", 1).remove(0)]});
    let made = asked.must(Method::POST, "/v1/sessions", Some(&json!({"catalogue": "solid"}))).await;
    let session = format!("/v1/sessions/{}", made["id"].as_str().unwrap());
    let mut found = Vec::new();
    for (method, path, body) in [
        (Method::GET, "/v1/sessions?limit=10".to_owned(), None),
        (Method::POST, format!("{session}/readings"), Some(&reading)),
        (Method::GET, "/v1/objects".to_owned(), None),
        (Method::GET, format!("{session}/belief"), None),
        (Method::DELETE, session, None),
    ] {
        let before = processor_seconds(process).unwrap();
        asked.must(method.clone(), &path, body).await;
        let used = processor_seconds(process).unwrap() - before;
        found.push((format!("{method} {path}"), used));
    }
    found
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn short_requests_pass_every_kind_of_long_work() {
    let folder = tempfile::tempdir().unwrap();
    let serving = Serving::start(folder.path(), &[]);
    let (asked, process) = (Asked::new(&serving.url), serving.process());
    requests::set_up(&asked).await;
    asked.put_mesh("spare", shapes::example("mug").unwrap().to_stl_bytes()).await;
    let mut all = fetched(&placeholders(&asked).await);
    all.extend(known(&asked).await);
    let mut faults = Vec::new();
    for Long { name, copies } in all {
        let before = processor_seconds(process).unwrap();
        let begun = std::time::Instant::now();
        let copies: Vec<_> = copies
            .into_iter()
            .map(|copy| tokio::spawn(keep_asking(serving.url.clone(), copy)))
            .collect();
        // Quick requests never use much.
        while processor_seconds(process).unwrap() - before < UNDER_WAY_CORE_SECONDS
            && begun.elapsed() < UNDER_WAY_WITHIN
        {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        let found = short(&asked, process).await;
        let most = found.iter().map(|(_, used)| *used).fold(0.0, f64::max);
        println!("{most:.2} core seconds beside {name}");
        for (asked, used) in found {
            if used > ANSWERED_WITHIN_CORE_SECONDS {
                faults.push(format!("beside {name}: {asked} after {used:.2} core seconds"));
            }
        }
        copies.iter().for_each(tokio::task::JoinHandle::abort);
    }
    assert!(faults.is_empty(), "{faults:#?}");
}
