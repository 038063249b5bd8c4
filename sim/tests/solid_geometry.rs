//! Recognition of solid bodies by occupancy: simulated touches, a pose known to centimetres.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::{DQuat, DVec3};
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::SensorDescription;
use palpate_core::training::TrainingSet;
use palpate_core::units::{DEG, MM};
use palpate_dissertation::geometric::train::{GeometricConfig, map_geometry};
use palpate_dissertation::geometric::{
    AdaptiveOptions, GeometricBelief, GeometricError, GeometricFilter, GeometricOptions, PosePrior,
    PreparedGeometry,
};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SamplerConfig, sample};
use palpate_sim::shapes::example;

const BODIES: [&str; 3] = ["chess_knight", "hammer", "mug"];

fn touches(body: &str, n: usize, seed: u64) -> Vec<Reading> {
    let mesh = example(body).unwrap();
    let simulator = PressSimulator::new(mesh, SensorDescription::digitacts_6x6());
    let config = SamplerConfig::for_simulator(&simulator);
    sample(&simulator, SensorId(1), n, seed, &config, &mut |_, _| ControlFlow::Continue(()))
        .unwrap()
}

fn geometry() -> PreparedGeometry {
    let sensor = SensorDescription::digitacts_6x6();
    let readings: Vec<Vec<Reading>> = BODIES.iter().map(|body| touches(body, 400, 1)).collect();
    let sets: Vec<TrainingSet<'_>> =
        readings.iter().map(|readings| TrainingSet { readings, sensor: &sensor }).collect();
    let geometry = map_geometry(&sets, &[DVec3::ZERO; 3], &GeometricConfig::solid()).unwrap();
    PreparedGeometry::new(Arc::new(geometry))
}

fn options(pose: PosePrior) -> GeometricOptions {
    GeometricOptions {
        pose,
        filter: GeometricFilter::Adaptive(AdaptiveOptions::default()),
        seed: 0,
    }
}

#[test]
fn a_body_within_bounds_is_recognised_and_located() {
    let geometry = geometry();
    let nominal = Pose::from_parts(DQuat::from_rotation_z(0.8), DVec3::new(0.5, 0.1, 0.3));
    let pose = PosePrior::Bounded {
        session_from_object: nominal,
        half_extent: DVec3::splat(10.0 * MM),
        half_angle: 20.0 * DEG,
    };
    for (object, body) in BODIES.iter().enumerate() {
        let off = DQuat::from_scaled_axis(DVec3::new(10.0, -8.0, 12.0) * DEG);
        let moved = DVec3::new(6.0, -5.0, 4.0) * MM;
        let truth = Pose::from_parts(off * nominal.rotation, nominal.translation + moved);
        let mut belief = GeometricBelief::new(&geometry, options(pose), None).unwrap();
        for reading in touches(body, 10, 2) {
            let sensor = SensorDescription::digitacts_6x6();
            belief.add(&reading.moved_by(truth), &sensor).unwrap();
        }
        let answer = belief.answer(1);
        assert_eq!(answer.best_object(), Some(ObjectIdx(object as u32)), "{body}: {answer:?}");
        let mode = answer.modes[0].session_from_object;
        let error = mode.distance_to(&truth);
        println!("{body}: {} mm, {} degrees", error / MM, mode.angle_to(&truth) / DEG);
        assert!(error < 4.0 * MM, "{body}: {} mm", error / MM);
        let marginals = belief.marginals(ObjectIdx(object as u32)).unwrap();
        assert_eq!(marginals.axes.len(), 6);
        assert!(marginals.plane.is_none());
    }
    let plane = PosePrior::Planar {
        session_from_plane: nominal,
        center: [0.0; 2],
        half_extent: 0.01,
        angle: 0.0,
        half_angle: 1.0,
    };
    let error = GeometricBelief::new(&geometry, options(plane), None).err();
    assert_eq!(error, Some(GeometricError::NotPlanar));
}
