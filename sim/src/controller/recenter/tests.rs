//! Tests of re-centring, on rays at bodies of known shape.

use palpate_core::rng::Purpose;

use super::*;
use crate::controller::touch;
use crate::mesh::Mesh;
use crate::mesh::tests_support::{cuboid, sphere, tube};
use crate::sampler::rays::{RayConfig, draw_ray};

fn simulator(mesh: Mesh) -> PressSimulator {
    PressSimulator::new(mesh, SensorDescription::digitacts_6x6())
}

fn config(simulator: &PressSimulator, rule: Recenter, shifts_max: usize) -> RecenterConfig {
    let config = RecenterConfig::for_sensor(simulator.sensor(), NoiseLevel::NONE);
    let approach_max = RayConfig::around(simulator.mesh()).approach_max();
    let contact = ContactConfig { approach_max, ..config.contact };
    RecenterConfig { contact, rule, shifts_max, ..config }
}

/// Starts of the rays of `seed`, and the results of their touches.
fn landings(
    simulator: &PressSimulator,
    config: &RecenterConfig,
    (n, seed): (u64, u64),
) -> Vec<(Pose, Landing)> {
    let rays = RayConfig::around(simulator.mesh());
    (0..n)
        .map(|index| {
            let mut stream = Stream::new(seed, Purpose::Sampling, index);
            let start = draw_ray(&rays, &mut stream);
            (start, touch_recentered(simulator, start, config, &mut stream))
        })
        .collect()
}

/// Number of rests with a mean pressure of at least `weak_below`.
fn n_valid(landings: &[(Pose, Landing)], config: &RecenterConfig) -> usize {
    landings.iter().filter(|(_, landing)| mean(landing) >= config.weak_below).count()
}

#[test]
fn contact_offset_is_the_mean_of_pressure_above_the_threshold() {
    let sensor = SensorDescription::digitacts_6x6();
    let mut pressures = vec![500.0; 36];
    // Columns 4 and 5 are at x = 3 and 5 mm, row 1 at y = −3 mm; weights 1 and 3 kPa.
    (pressures[10], pressures[11]) = (2000.0, 4000.0);
    let offset = contact_offset(&sensor, &pressures, 1000.0);
    assert!(offset.distance(DVec3::new(4.5 * MM, -3.0 * MM, 0.0)) < 1e-12, "{offset}");
    assert_eq!(contact_offset(&sensor, &pressures, 5000.0), DVec3::ZERO);
}

#[test]
fn without_shifts_recentering_is_a_plain_touch() {
    let simulator = simulator(cuboid(DVec3::new(60.0 * MM, 30.0 * MM, 20.0 * MM)));
    let config = config(&simulator, Recenter::Always, 0);
    for (index, (start, landing)) in landings(&simulator, &config, (30, 1)).iter().enumerate() {
        let mut stream = Stream::new(1, Purpose::Sampling, index as u64);
        assert_eq!(draw_ray(&RayConfig::around(simulator.mesh()), &mut stream), *start);
        match (touch(&simulator, *start, &config.contact, &mut stream), landing) {
            (Outcome::Converged(expected), Landing::Converged { contact, shifts }) => {
                assert_eq!((&expected, *shifts), (contact, 0));
            }
            (Outcome::Missed, Landing::Missed { .. })
            | (Outcome::NoConvergence, Landing::NoConvergence) => {}
            (expected, found) => panic!("{expected:?} and {found:?}"),
        }
    }
}

#[test]
fn a_centered_contact_with_a_ball_needs_no_turn() {
    // The surface of a ball of 25 mm faces the sensor where it is foremost along the ray. A
    // contact off by 1.5 mm needs a turn of 1.5 / 25 rad = 3.4°; the centre of pressure of
    // few taxels adds as much again.
    let simulator = simulator(sphere(25.0 * MM, 60));
    let turns = |config: &RecenterConfig| -> Vec<f64> {
        let landings = landings(&simulator, config, (60, 2));
        let turn = |(start, landing): &(Pose, Landing)| match landing {
            Landing::Converged { contact, .. } => {
                start.turn(DVec3::Z).angle_between(contact.object_from_sensor.turn(DVec3::Z))
            }
            other => panic!("{other:?}"),
        };
        landings.iter().map(turn).collect()
    };
    let centered = turns(&config(&simulator, Recenter::Always, 6));
    assert!(centered.iter().all(|turn| *turn < 7f64.to_radians()), "{centered:?}");
    let as_they_come = turns(&config(&simulator, Recenter::Always, 0));
    let far = as_they_come.iter().filter(|turn| **turn > 10f64.to_radians()).count();
    assert!(far > 20, "{far} of 60 turn far");
}

#[test]
fn recentering_raises_the_number_of_valid_contacts() {
    let bodies = [
        ("box", cuboid(DVec3::new(60.0 * MM, 30.0 * MM, 20.0 * MM)), 1.1),
        ("rod", tube(40, |ring| (5.0 * MM, (f64::from(ring) - 19.5) * 2.0 * MM)), 1.5),
    ];
    for (name, mesh, factor) in bodies {
        let simulator = simulator(mesh);
        for seed in [3, 4] {
            let valid = |rule, shifts_max| {
                let config = config(&simulator, rule, shifts_max);
                n_valid(&landings(&simulator, &config, (150, seed)), &config)
            };
            let (without, needed) = (valid(Recenter::Always, 0), valid(Recenter::WhenNeeded, 3));
            let enough = factor * without as f64;
            assert!(needed as f64 > enough, "{name}: {needed} with and {without} without");
        }
    }
}

#[test]
fn a_miss_reports_the_length_of_free_air() {
    let simulator = simulator(sphere(10.0 * MM, 24));
    let config = config(&simulator, Recenter::WhenNeeded, 3);
    let start = Pose::from_parts(DQuat::IDENTITY, DVec3::new(0.04, 0.0, -0.1));
    let mut stream = Stream::new(1, Purpose::SensorNoise, 0);
    match touch_recentered(&simulator, start, &config, &mut stream) {
        Landing::Missed { miss, shifts: 0 } => {
            assert_eq!(miss.travel.to_bits(), config.contact.approach_max.to_bits());
            assert_eq!(miss.object_from_sensor, advanced(start, miss.travel));
            assert_eq!(miss.pressures.len(), 36);
            let threshold = config.contact.contact_threshold;
            assert!(miss.pressures.iter().all(|pressure| *pressure < threshold));
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn carry_receives_lift_and_shift_and_may_refuse() {
    let simulator = simulator(sphere(25.0 * MM, 60));
    let config = config(&simulator, Recenter::Always, 1);
    // 8 mm off the ball's middle: the first contact is near the array's edge at x < 0.
    let start = Pose::from_parts(DQuat::IDENTITY, DVec3::new(8.0 * MM, 0.0, -0.1));
    let touch_within = |n_followed: usize| {
        let mut stream = Stream::new(1, Purpose::SensorNoise, 0);
        let mut poses = Vec::new();
        let landing =
            touch_recentered_carried(&simulator, start, &config, &mut stream, &mut |pose| {
                poses.push(pose);
                poses.len() <= n_followed
            });
        (landing, poses)
    };
    let (landing, poses) = touch_within(usize::MAX);
    assert!(matches!(landing, Landing::Converged { shifts: 1, .. }), "{landing:?}");
    let at = |index: usize| poses[index].translation;
    assert!((at(0).z - at(1).z - config.lift).abs() < 1e-12);
    let shift = at(2) - at(1);
    assert!(shift.x < -2.0 * MM && shift.y.abs() < 1.0 * MM && shift.z.abs() < 1e-12, "{shift}");
    for n_followed in 0..4 {
        assert_eq!(touch_within(n_followed), (Landing::Unreachable, poses[..=n_followed].to_vec()));
    }
}
