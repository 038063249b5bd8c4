//! Raised letters over real HTTP: rig readings are trained, then a letter is recognised.
//!
//! The letter is located in a tilted plane, its map is exported, and all of it is there after
//! a restart.

use std::f64::consts::PI;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;

use glam::{DQuat, DVec3};
use palpate_client::Client;
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::{DEG, MM};
use palpate_schemas::{
    AddTrainingReadings, BeliefQuery, CreateObject, CreateSession, GeometricKind,
    GeometricTraining, JobState, MarginalsQuery, Method, PlyForm, PosePrior,
    Reading as WireReading, SliceQuery, StartTraining,
};
use palpate_server::{Config, Server};
use palpate_sim::letters::Font;
use palpate_sim::rig::{PlanarPose, Rig, RigNoise, rig_sensor};

const SENSOR: &str = "digitacts-6x6-thin";
const LETTERS: [char; 5] = ['A', 'E', 'I', 'O', 'U'];

async fn start(folder: &Path) -> (Server, Client) {
    let listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let server = Server::start(Config { listen, ..Config::new(folder) }).await.unwrap();
    let client = Client::new(&format!("http://{}", server.local_addr())).unwrap();
    (server, client)
}

fn rig() -> Rig {
    Rig::new(SensorId(0), &rig_sensor(), RigNoise::physical(), 11)
}

fn wire_pose(pose: Pose) -> palpate_schemas::Pose {
    palpate_schemas::Pose {
        position: pose.translation.to_array(),
        orientation: pose.rotation.to_array(),
    }
}

fn image(reading: &Reading) -> Vec<Option<f64>> {
    reading.image().pressures.iter().copied().map(Some).collect()
}

async fn train(client: &Client) {
    let (rig, font) = (rig(), Font::built_in());
    for symbol in LETTERS {
        let object = CreateObject { name: symbol.to_string(), description: String::new() };
        client.create_object(&object).await.unwrap();
        let readings = rig.session(&rig.field(font.letter(symbol).unwrap()), 0);
        let wire = |reading: &Reading| WireReading {
            robot: None,
            seq: None,
            sensor: SENSOR.to_owned(),
            frame_id: None,
            stamp: None,
            pose: Some(wire_pose(reading.session_from_sensor())),
            image: image(reading),
            feature: None,
            approach_m: None,
            object_moved: None,
        };
        let readings = AddTrainingReadings { readings: readings.iter().map(wire).collect() };
        client.add_training_readings(&symbol.to_string(), &readings).await.unwrap();
    }
    let geometric = Some(GeometricTraining { kind: GeometricKind::Planar, cell: None });
    let training = StartTraining { geometric, n_classes: Some(8), ..StartTraining::default() };
    let job = client.start_training("default", &training).await.unwrap();
    let job = client.follow_job(job.id, |_| ()).await.unwrap();
    assert_eq!(job.state, JobState::Succeeded, "{job:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_letter_is_recognised_in_its_plane() {
    let folder = tempfile::tempdir().unwrap();
    let (server, client) = start(folder.path()).await;
    train(&client).await;

    let tilted = DQuat::from_rotation_y(0.4);
    let session_from_plane = Pose::from_parts(tilted, DVec3::new(0.5, 0.2, 0.1));
    let turned = DQuat::from_rotation_z(-1.2);
    let plane_from_letter = Pose::from_parts(turned, DVec3::new(-0.004, 0.007, 0.0));
    let prior = PosePrior::Planar {
        plane: Some(wire_pose(session_from_plane)),
        center: None,
        half_extent: None,
        angle: None,
        half_angle: None,
    };
    let request = CreateSession {
        method: Some(Method::Geometric),
        pose_prior: Some(prior),
        ..CreateSession::default()
    };
    let mut session = client.touch_session(&request, "arm").await.unwrap();
    let rig = rig();
    let field = rig.field(Font::built_in().letter('U').unwrap());
    let mut stream = Stream::new(5, Purpose::ObjectPose, 1);
    let mut last = None;
    for _ in 0..7 {
        let mut along = |reach: f64| stream.uniform(-reach, reach);
        let at = PlanarPose { x: along(9.0 * MM), y: along(9.0 * MM), angle: along(PI) };
        let press = rig.press(&field, at, &mut stream);
        let press = press.moved_by(session_from_plane * plane_from_letter);
        let pose = wire_pose(press.session_from_sensor());
        last = Some(session.touch(SENSOR, pose, image(&press)).await.unwrap());
    }
    let belief = last.unwrap();
    assert_eq!(belief.objects[0].name, "U", "{belief:?}");

    let report = client.catalogue_version("default", 1).await.unwrap().report;
    let object = report.objects.iter().find(|object| object.name == "U").unwrap();
    assert!(object.geometric.is_some_and(|geometry| geometry.has_force), "{object:?}");
    let letter_from_object = Pose { translation: object.origin_in_mesh.into(), ..Pose::IDENTITY };
    let truth = plane_from_letter * letter_from_object;
    let found = belief.poses[0].pose;
    let found =
        session_from_plane.inverse() * Pose::new(found.position, found.orientation).unwrap();
    let off = found.translation - truth.translation;
    assert!(off.length() < 1.5 * MM && off.z.abs() < 0.35 * MM, "{off} m");
    assert!(found.angle_to(&truth) < 5.0 * DEG, "{found:?} {truth:?}");
    let marginals = client.marginals(session.id(), &MarginalsQuery::default()).await.unwrap();
    for axis in &marginals.axes {
        assert!((axis.probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{axis:?}");
    }

    let png = client.occupancy_png("default", 1, "U", SliceQuery::default()).await.unwrap();
    assert!(png.starts_with(b"\x89PNG"), "{:?}", &png[..8]);
    let ply = client.occupancy_ply("default", 1, "U", PlyForm::Points).await.unwrap();
    assert!(ply.starts_with(b"ply\n"), "{:?}", &ply[..8]);
    server.shutdown().await;

    let (server, client) = start(folder.path()).await;
    let again = client.belief(session.id(), BeliefQuery::default()).await.unwrap();
    assert_eq!((&again.objects, &again.poses), (&belief.objects, &belief.poses));
    server.shutdown().await;
}
