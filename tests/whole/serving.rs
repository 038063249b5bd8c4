//! The real server under a supervisor: stopped under load, configured by a file.

use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use palpate_client::{Client, ClientOptions, RetryPolicy};
use palpate_core::reading::SensorId;
use palpate_core::sensor::SensorDescription;
use palpate_schemas::{
    AddReadings, BeliefDetail, CreateObject, CreateSession, JobState, MeshFormat, MeshUnit,
    ReadingsQuery, SessionsQuery, StartTraining,
};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SamplerConfig, sample};
use palpate_sim::shapes;
use serde_json::Value;
use uuid::Uuid;

use crate::command::{Serving, palpate};

/// Time after which the supervisors of `deploy/` kill. The server's own limits end a stop earlier,
/// on any machine.
const PATIENCE: Duration = Duration::from_secs(60);
const ROBOTS: usize = 24;

fn client(url: &str) -> Client {
    let options = ClientOptions { retry: RetryPolicy::never(), ..ClientOptions::default() };
    Client::with_options(url, options).unwrap()
}

async fn train(client: &Client) {
    for name in ["hammer", "mug"] {
        let object = CreateObject { name: name.to_owned(), ..CreateObject::default() };
        client.create_object(&object).await.unwrap();
        let mesh = shapes::example(name).unwrap().to_stl_bytes().into();
        client.put_mesh(name, MeshFormat::Stl, MeshUnit::M, mesh).await.unwrap();
    }
    let training =
        StartTraining { readings_per_object: Some(200), seed: Some(1), ..StartTraining::default() };
    let job = client.start_training("default", &training).await.unwrap();
    let job = client.follow_job(job.id, |_| ()).await.unwrap();
    assert_eq!(job.state, JobState::Succeeded, "{job:?}");
}

/// Readings as robots send them.
fn readings() -> Vec<palpate_schemas::Reading> {
    let mesh = shapes::example("mug").unwrap();
    let sensor = SensorDescription::digitacts_6x6();
    let simulator = PressSimulator::new(mesh, sensor);
    let config = SamplerConfig::for_simulator(&simulator);
    let mut go_on = |_, _| std::ops::ControlFlow::Continue(());
    let touches = sample(&simulator, SensorId(0), 40, 7, &config, &mut go_on).unwrap();
    let as_sent = |touch: &palpate_core::reading::Reading| {
        let pose = touch.session_from_sensor();
        palpate_schemas::Reading {
            robot: None,
            seq: None,
            sensor: "digitacts-6x6".to_owned(),
            frame_id: None,
            stamp: None,
            pose: Some(palpate_schemas::Pose {
                position: pose.translation.to_array(),
                orientation: pose.rotation.to_array(),
            }),
            image: touch.image().pressures.iter().copied().map(Some).collect(),
            feature: None,
            approach_m: None,
            object_moved: None,
            contact: None,
            shear: None,
        }
    };
    touches.iter().map(as_sent).collect()
}

/// A robot that sends readings one after the other until one is refused; counts acknowledgements.
async fn touch(client: Client, session: Uuid, robot: usize, acknowledged: Arc<AtomicU32>) {
    for (seq, mut reading) in readings().into_iter().cycle().enumerate() {
        reading.robot = Some(format!("arm-{robot}"));
        reading.seq = Some(seq as u64);
        let query = ReadingsQuery { belief: Some(BeliefDetail::Top) };
        let readings = AddReadings { readings: vec![reading] };
        match client.add_readings(session, &readings, query).await {
            Ok(_) => acknowledged.fetch_add(1, Ordering::SeqCst),
            Err(error) if error.status() == Some(503) => continue,
            Err(_) => return,
        };
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_under_load_stops_in_time_and_keeps_readings() {
    let folder = tempfile::tempdir().unwrap();
    let mut serving = Serving::start(folder.path(), &[]);
    let url = serving.url.clone();
    train(&client(&url)).await;
    let mut robots = Vec::new();
    for robot in 0..ROBOTS {
        let session = client(&url).create_session(&CreateSession::default()).await.unwrap().id;
        let acknowledged = Arc::new(AtomicU32::new(0));
        let touching = touch(client(&url), session, robot, Arc::clone(&acknowledged));
        robots.push((session, acknowledged, tokio::spawn(touching)));
    }
    // A training is under way as well, far from its end.
    let long = StartTraining { readings_per_object: Some(5000), ..StartTraining::default() };
    client(&url).start_training("default", &long).await.unwrap();
    let all = || robots.iter().all(|(_, n, _)| n.load(Ordering::SeqCst) >= 3);
    while !all() {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let asked = Instant::now();
    let (ended, log) = tokio::task::spawn_blocking(move || serving.stop()).await.unwrap();
    assert!(ended.success(), "exit code 0, {ended}: {log}");
    assert!(asked.elapsed() < PATIENCE, "took {:?}", asked.elapsed());
    assert!(log.contains("Suspended job"), "{log}");

    let serving = Serving::start(folder.path(), &[]);
    for (session, acknowledged, touching) in robots {
        touching.await.unwrap();
        let known = client(&serving.url).session(session).await.unwrap();
        let acknowledged = acknowledged.load(Ordering::SeqCst);
        // The last may have been stored although its answer did not arrive.
        let stored = known.n_readings;
        assert!(stored >= acknowledged && stored <= acknowledged + 1, "{stored}, {acknowledged}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn sessions_have_a_prior_and_a_retention_time() {
    let folder = tempfile::tempdir().unwrap();
    let serving = Serving::start(folder.path(), &["--keep-sessions-s", "1"]);
    let client = client(&serving.url);
    train(&client).await;
    let mesh = folder.path().join("mug.stl");
    std::fs::write(&mesh, shapes::example("mug").unwrap().to_stl_bytes()).unwrap();
    let mut touching = Command::new(palpate());
    touching.args(["--server", &serving.url, "touch", "--object", "mug", "--mesh"]).arg(&mesh);
    touching.args(["--unit", "m", "--readings", "2", "--seed", "7", "--unknown-prior", "0.25"]);
    let touched = tokio::task::spawn_blocking(move || touching.output().unwrap()).await.unwrap();
    // After two touches the answer may be the mug (0) or unknown (4).
    let said = String::from_utf8_lossy(&touched.stderr);
    assert!(matches!(touched.status.code(), Some(0 | 4)), "{said}");

    let session = client.sessions(&SessionsQuery::default()).await.unwrap().items.remove(0);
    assert_eq!((session.unknown_prior, session.n_readings), (Some(0.25), 2));
    client.close_session(session.id).await.unwrap();
    while client.session(session.id).await.is_ok() {
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    assert_eq!(client.session(session.id).await.unwrap_err().status(), Some(404));
}

#[test]
fn every_signal_that_usually_ends_a_process_stops_in_order() {
    for signal in ["TERM", "INT", "HUP", "QUIT"] {
        let folder = tempfile::tempdir().unwrap();
        let mut serving = Serving::start(folder.path(), &[]);
        serving.signal(signal);
        let (ended, log) = serving.ended();
        assert!(ended.success(), "{signal}: {ended}: {log}");
    }
}

#[tokio::test]
async fn a_server_may_be_started_to_survive_a_hang_up() {
    let folder = tempfile::tempdir().unwrap();
    let mut serving = Serving::start_after(folder.path(), "trap '' HUP");
    serving.signal("HUP");
    assert!(client(&serving.url).alive().await.is_ok());
    let (ended, log) = serving.stop();
    assert!(ended.success(), "{ended}: {log}");
}

#[test]
fn flags_win_over_the_file_and_config_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("palpate.toml");
    std::fs::write(&file, "[serve]\nrequests = 77\nsession_ttl_s = 60\n").unwrap();
    let config = |arguments: &[&str]| {
        let mut command = Command::new(palpate());
        command.arg("config").args(arguments).arg("--config").arg(&file).stdin(Stdio::null());
        command.env("PALPATE_SESSIONS_OPEN", "5").output().unwrap()
    };
    let shown = config(&["--json", "--session-ttl-s", "90"]);
    let settings: Vec<Value> = serde_json::from_slice(&shown.stdout).unwrap();
    let is = |name: &str| {
        let found = settings.iter().find(|one| one["name"] == name).unwrap();
        ["value", "source", "from"].map(|field| found[field].as_str().unwrap_or("-").to_owned())
    };
    let path = file.to_str().unwrap();
    assert_eq!(is("serve.requests"), ["77", "file", path]);
    assert_eq!(is("serve.session_ttl_s"), ["90", "flag", "--session-ttl-s"]);
    assert_eq!(is("serve.sessions_open"), ["5", "environment", "PALPATE_SESSIONS_OPEN"]);
    assert_eq!(is("serve.listen"), ["127.0.0.1:7411", "default", "-"]);

    std::fs::write(&file, "[serve]\nrequest = 77\n").unwrap();
    let refused = config(&[]);
    assert_eq!(refused.status.code(), Some(1));
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(said.contains(path) && said.contains("serve.request is no setting"), "{said}");
}
