//! Accuracy of the height of planar poses: letters pressed by the rig, under two coverings.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::SensorId;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::training::TrainingSet;
use palpate_core::units::MM;
use palpate_dissertation::geometric::train::{GeometricConfig, map_geometry};
use palpate_dissertation::geometric::{
    AdaptiveOptions, GeometricBelief, GeometricFilter, GeometricOptions, PosePrior,
    PreparedGeometry,
};
use palpate_sim::letters::Font;
use palpate_sim::rig::{PlanarPose, Rig, RigNoise, rig_sensor};

/// Error of the height of a letter's face after six presses, and its posterior deviation, m.
fn height_error(symbol: char, sensor: &SensorDescription) -> [f64; 2] {
    let rig = Rig::new(SensorId(0), sensor, RigNoise::physical(), 3);
    let font = Font::built_in();
    let field = rig.field(font.letter(symbol).unwrap());
    let readings = rig.session(&field, 0);
    let set = TrainingSet { readings: &readings, sensor: rig.sensor() };
    let model = map_geometry(&[set], &[DVec3::ZERO], &GeometricConfig::planar()).unwrap();
    let session_from_plane =
        Pose::from_parts(DQuat::from_rotation_x(0.4), DVec3::new(0.3, 0.2, 0.1));
    let pose = PosePrior::Planar {
        session_from_plane,
        center: [0.0; 2],
        half_extent: 10.0 * MM,
        angle: 0.0,
        half_angle: PI,
    };
    let filter = GeometricFilter::Adaptive(AdaptiveOptions::default());
    let options = GeometricOptions { pose, filter, seed: 1 };
    let prepared = PreparedGeometry::new(Arc::new(model));
    let mut belief = GeometricBelief::new(&prepared, options, None).unwrap();
    let mut stream = Stream::new(7, Purpose::ObjectPose, u64::from(u32::from(symbol)));
    let turned = DQuat::from_rotation_z(1.1);
    let truth = session_from_plane * Pose::from_parts(turned, DVec3::new(0.004, -0.003, 0.0));
    for _ in 0..6 {
        let mut along = |reach: f64| stream.uniform(-reach, reach);
        let at = PlanarPose { x: along(8.0 * MM), y: along(8.0 * MM), angle: along(PI) };
        belief.add(&rig.press(&field, at, &mut stream).moved_by(truth), rig.sensor()).unwrap();
    }
    let mode = belief.answer(1).modes[0];
    let up = session_from_plane.turn(DVec3::Z);
    let off = (mode.session_from_object.translation - truth.translation).dot(up);
    let position = mode.covariance.fixed_view::<3, 3>(0, 0).into_owned();
    let along = nalgebra::Vector3::new(up.x, up.y, up.z);
    [off, (along.transpose() * position * along)[0].sqrt()]
}

#[test]
fn letters_are_found_in_the_plane_of_their_faces() {
    for sensor in [rig_sensor(), SensorDescription::digitacts_6x6()] {
        let covering = sensor.parameters().covering_thickness;
        for symbol in ['I', 'E', 'O', 'm', 'x'] {
            let [off, deviation] = height_error(symbol, &sensor);
            println!("{symbol} {covering}: {off} ± {deviation}");
            // The sensor stood 0.8 coverings below the face; the error was once as large.
            assert!(off.abs() < 0.3 * covering, "{symbol}: {off} of {covering}");
            assert!(off.abs() < 2.5 * deviation, "{symbol}: {off}, said to be {deviation}");
            assert!(deviation < 0.3 * covering, "{symbol}: {deviation} of {covering}");
        }
    }
}
