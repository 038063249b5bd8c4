//! Tests of the contact controllers, on bodies whose touches can be computed by hand.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};
use palpate_core::rng::Purpose;

use super::*;
use crate::mesh::Mesh;
use crate::mesh::tests_support::{cuboid, sphere, tube};

fn setup(mesh: Mesh) -> (PressSimulator, ContactConfig, Stream) {
    let sensor = SensorDescription::digitacts_6x6();
    let config = ContactConfig::for_sensor(&sensor, NoiseLevel::NONE);
    (PressSimulator::new(mesh, sensor), config, Stream::new(1, Purpose::SensorNoise, 0))
}

/// A sensor that looks down on the origin from `height`, tilted about its x.
fn above(height: f64, tilt: f64) -> Pose {
    let rotation = DQuat::from_rotation_x(PI) * DQuat::from_rotation_x(tilt);
    Pose::from_parts(rotation, DVec3::new(0.0, 0.0, height))
}

fn converged(outcome: Outcome) -> Contact {
    match outcome {
        Outcome::Converged(contact) => contact,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_tilted_sensor_comes_to_rest_flat_at_the_target_pressure() {
    for tilt in [-20.0 * DEG, -8.0 * DEG, 0.0, 12.0 * DEG, 25.0 * DEG] {
        let plate = cuboid(DVec3::new(80.0 * MM, 80.0 * MM, 10.0 * MM));
        let (simulator, config, mut stream) = setup(plate);
        let contact = converged(touch(&simulator, above(12.0 * MM, tilt), &config, &mut stream));
        let facing = contact.object_from_sensor.turn(DVec3::Z);
        let angle = facing.angle_between(-DVec3::Z);
        assert!(angle < 3.0 * DEG, "from {tilt}: {angle} rad");
        let mean = contact.pressures.iter().sum::<f64>() / 36.0;
        assert!((mean - config.target_pressure).abs() <= config.pressure_tolerance);
    }
}

#[test]
fn a_thin_rod_stops_press_on_the_raw_depth() {
    // A rod of 2 mm diameter: blurred, it never gives a quarter of the range on average.
    let rod = tube(40, |ring| (1.0 * MM, (f64::from(ring) - 19.5) * 2.0 * MM));
    let (simulator, config, mut stream) = setup(rod);
    let rotation = DQuat::from_rotation_arc(DVec3::Z, -DVec3::X);
    let start = Pose::from_parts(rotation, DVec3::new(5.0 * MM, 0.0, 0.0));
    let contact = converged(touch(&simulator, start, &config, &mut stream));
    let thickness = simulator.sensor().parameters().covering_thickness;
    assert!((contact.press.max_penetration / thickness - 0.9).abs() < 0.021);
    let mean = contact.pressures.iter().sum::<f64>() / 36.0;
    assert!(mean < config.target_pressure && mean > 0.0);
}

#[test]
fn a_touch_beside_the_object_misses() {
    let (simulator, config, mut stream) = setup(sphere(10.0 * MM, 24));
    let beside = Pose::from_parts(above(0.0, 0.0).rotation, DVec3::new(0.05, 0.0, 0.02));
    assert_eq!(touch(&simulator, beside, &config, &mut stream), Outcome::Missed);
    let far = above(10.0 * MM + config.approach_max + 1.0 * MM, 0.0);
    assert_eq!(touch(&simulator, far, &config, &mut stream), Outcome::Missed);
}

#[test]
fn a_sensor_that_starts_inside_backs_out_first() {
    let (simulator, config, mut stream) = setup(sphere(30.0 * MM, 60));
    let contact = converged(touch(&simulator, above(25.0 * MM, 0.0), &config, &mut stream));
    assert!(contact.press.max_penetration < config.penetration_max * 1.03);
}

#[test]
fn travel_and_rounds_are_bounded() {
    let (simulator, config, mut stream) = setup(sphere(30.0 * MM, 60));
    let stingy = ContactConfig { travel_max: 0.01 * MM, ..config };
    let outcome = touch(&simulator, above(35.0 * MM, 0.0), &stingy, &mut stream);
    assert_eq!(outcome, Outcome::NoConvergence);
    let hasty = ContactConfig { rounds_max: 1, ..config };
    let outcome = touch(&simulator, above(50.0 * MM, 0.3), &hasty, &mut stream);
    assert!(!matches!(outcome, Outcome::Converged(_)));
}

#[test]
fn carry_receives_every_pose_and_a_refusal_ends_the_touch() {
    let (simulator, config, _) = setup(sphere(30.0 * MM, 60));
    let touch_within = |n_followed: usize| {
        let mut stream = Stream::new(1, Purpose::SensorNoise, 0);
        let mut poses = Vec::new();
        let start = above(35.0 * MM, 0.2);
        let outcome = touch_carried(&simulator, start, &config, &mut stream, &mut |pose| {
            poses.push(pose);
            poses.len() <= n_followed
        });
        (outcome, poses)
    };
    let (outcome, poses) = touch_within(usize::MAX);
    let contact = converged(outcome);
    // The first contact, then one press per round and one turn in every round but the last.
    assert_eq!(poses.len(), 2 * contact.rounds);
    // Every turn of Orient, and at least the first press, took a command.
    assert!(contact.commands >= contact.rounds, "{contact:?}");
    assert_eq!(poses.last(), Some(&contact.object_from_sensor));
    assert_eq!(touch_within(2), (Outcome::Unreachable, poses[..3].to_vec()));
}

#[test]
fn touches_under_heavy_noise_end_and_mostly_converge() {
    let sensor = SensorDescription::digitacts_6x6();
    let noise_level = NoiseLevel::new(0.4).unwrap();
    let press_config =
        crate::press::PressConfig { noise_level, ..crate::press::PressConfig::for_sensor(&sensor) };
    let config = ContactConfig::for_sensor(&sensor, noise_level);
    let simulator = PressSimulator::with_config(sphere(30.0 * MM, 60), sensor, press_config);
    let n_converged = (0..50)
        .filter(|index| {
            let mut stream = Stream::new(3, Purpose::SensorNoise, *index);
            let outcome = touch(&simulator, above(35.0 * MM, 0.1), &config, &mut stream);
            matches!(outcome, Outcome::Converged(_))
        })
        .count();
    assert!(n_converged > 25, "{n_converged} of 50");
}

#[test]
fn the_printed_idle_rule_takes_longer_only_under_noise() {
    let quiet = {
        let parameters = SensorDescription::digitacts_6x6().parameters().clone();
        let silent = palpate_core::sensor::SensorParameters { noise: 0.0, ..parameters };
        SensorDescription::new(silent).unwrap()
    };
    let rest = |noise_level: NoiseLevel, idle: Idle, index: u64| {
        let simulator =
            PressSimulator::new(sphere(30.0 * MM, 60), quiet.clone()).with_noise(noise_level);
        let config = ContactConfig { idle, ..ContactConfig::for_sensor(&quiet, noise_level) };
        let mut stream = Stream::new(3, Purpose::SensorNoise, index);
        converged(touch(&simulator, above(35.0 * MM, 0.2), &config, &mut stream))
    };
    let [one, consecutive] =
        [Idle::OneReading, Idle::Consecutive].map(|idle| rest(NoiseLevel::NONE, idle, 0));
    assert_eq!(one.object_from_sensor, consecutive.object_from_sensor);
    // The same turns and a last reading of Press, unless Press had no command in the last round.
    assert!((one.rounds..=one.rounds + 1).contains(&consecutive.rounds), "{consecutive:?}");
    assert_eq!(one.commands, consecutive.commands);
    // With 20 % the two rules hardly differ, with 40 % they do.
    let noise_level = NoiseLevel::new(0.4).unwrap();
    let rounds =
        |idle: Idle| (0..40).map(|index| rest(noise_level, idle, index).rounds).sum::<usize>();
    let (twice, once) = (rounds(Idle::Consecutive), rounds(Idle::OneReading));
    assert!(twice as f64 > 1.1 * once as f64, "{twice} {once}");
}
