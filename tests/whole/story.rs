//! The main job over HTTP with the SDK: train, recognise from unseen readings, restart, recognise
//! again, with the embedded store in a temporary folder and the SDK as a robot uses it.

use std::net::{Ipv4Addr, SocketAddr};
use std::ops::ControlFlow;
use std::path::Path;

use palpate_client::{Client, TouchSession};
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::units::MM;
use palpate_schemas::{
    AppearanceTraining, Belief, BeliefQuery, CreateObject, CreateSession, JobState, MeshFormat,
    MeshUnit, Method, PageQuery, SensorKnowledge, StartTraining,
};
use palpate_server::{Config, Server};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SamplerConfig, sample};
use palpate_sim::shapes;

const OBJECTS: [&str; 3] = ["hammer", "gear", "mug"];
const SENSOR: &str = "digitacts-6x6";

async fn start(folder: &Path) -> (Server, Client) {
    let listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let server = Server::start(Config { listen, ..Config::new(folder) }).await.unwrap();
    let client = Client::new(&format!("http://{}", server.local_addr())).unwrap();
    (server, client)
}

/// Touches that training never saw.
fn unseen_touches(object: &str, n: usize) -> Vec<Reading> {
    let mesh = shapes::example(object).unwrap();
    let simulator = PressSimulator::new(mesh, SensorDescription::digitacts_6x6());
    let config = SamplerConfig::for_simulator(&simulator);
    let mut go_on = |_, _| ControlFlow::Continue(());
    sample(&simulator, SensorId(0), n, 4_711, &config, &mut go_on).unwrap()
}

async fn train(client: &Client) {
    for name in OBJECTS {
        let object = CreateObject { name: name.to_owned(), ..CreateObject::default() };
        client.create_object(&object).await.unwrap();
        let file = shapes::example(name).unwrap().to_stl_bytes().into();
        let report = client.put_mesh(name, MeshFormat::Stl, MeshUnit::M, file).await.unwrap();
        assert!(report.warnings.is_empty(), "{report:?}");
    }
    let training = StartTraining {
        // The readings are of the described sensor.
        sensor_knowledge: Some(SensorKnowledge::Measured),
        readings_per_object: Some(500),
        seed: Some(1),
        appearance: Some(AppearanceTraining::default()),
        ..StartTraining::default()
    };
    let job = client.start_training("default", &training).await.unwrap();
    let job = client.follow_job(job.id, |_| ()).await.unwrap();
    assert_eq!(job.state, JobState::Succeeded, "{job:?}");
}

/// Touches an object in a pose of its own; returns the session and the last belief.
async fn recognise(client: &Client, object: &str, seed: u64) -> (TouchSession, Belief) {
    let mut stream = Stream::new(seed, Purpose::ObjectPose, 0);
    let session_from_mesh = Pose::from_parts(stream.rotation(), 0.3 * stream.direction());
    let mut session = client.touch_session(&CreateSession::default(), "arm").await.unwrap();
    let mut last = None;
    for reading in unseen_touches(object, 12) {
        let pose = reading.moved_by(session_from_mesh).session_from_sensor();
        let pose = palpate_schemas::Pose {
            position: pose.translation.to_array(),
            orientation: pose.rotation.to_array(),
        };
        let image = reading.image().pressures.iter().copied().map(Some).collect();
        last = Some(session.touch(SENSOR, pose, image).await.unwrap());
    }
    let belief = last.unwrap();
    let version = client.catalogue_version("default", 1).await.unwrap();
    let report = version.report.objects.iter().find(|o| o.name == object).unwrap();
    let object_in_mesh = glam::DVec3::from_array(report.origin_in_mesh);
    let best = &belief.objects[0];
    assert_eq!(best.name, object, "{belief:?}");
    assert!(best.probability > 0.9, "{best:?}");
    let found = glam::DVec3::from_array(belief.poses[0].pose.position);
    let error = found.distance(session_from_mesh * object_in_mesh);
    assert!(error < 8.0 * MM, "{object} lies {error} m from where it was believed");
    (session, belief)
}

/// Touches an object that moves arbitrarily, by a robot without poses.
async fn recognise_by_appearance(client: &Client, object: &str) -> (TouchSession, Belief) {
    let request = CreateSession { method: Some(Method::Appearance), ..CreateSession::default() };
    let mut session = client.touch_session(&request, "arm").await.unwrap();
    let mut last = None;
    for reading in unseen_touches(object, 40) {
        let image = reading.image().pressures.iter().copied().map(Some).collect();
        let pose = None::<palpate_schemas::Pose>;
        last = Some(session.touch(SENSOR, pose, image).await.unwrap());
    }
    let belief = last.unwrap();
    assert_eq!(belief.objects[0].name, object, "{belief:?}");
    assert!(belief.objects[0].probability > 0.8, "{belief:?}");
    assert!(belief.poses.is_empty());
    (session, belief)
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_are_recognised_and_a_restart_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (server, client) = start(folder.path()).await;
    train(&client).await;
    let mut before = Vec::new();
    for object in OBJECTS {
        before.push(recognise(&client, object, 1).await);
        before.push(recognise_by_appearance(&client, object).await);
    }
    let report = client.appearance_report("default", 1).await.unwrap();
    assert_eq!(report.objects.len(), OBJECTS.len());
    assert!(report.accuracy > 0.9, "{report:?}");
    server.shutdown().await;

    let (server, client) = start(folder.path()).await;
    for (session, belief) in &before {
        let again = client.belief(session.id(), BeliefQuery::default()).await.unwrap();
        assert_eq!(again.objects, belief.objects, "the belief is rebuilt from the journal");
        assert_eq!(again.poses, belief.poses);
    }
    for object in OBJECTS {
        recognise(&client, object, 2).await;
    }
    let versions = client.catalogue_versions("default", &PageQuery::default()).await.unwrap();
    assert_eq!(versions.items.len(), 1, "nothing was trained again");
    server.shutdown().await;
}
