//! Tests of presses into an elastic covering, by formulas and by symmetry.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::SensorId;
use palpate_core::units::MM;

use super::*;
use crate::mesh::Mesh;
use crate::mesh::tests_support::{cuboid, sphere};
use crate::press::{Load, Physics, PressConfig, PressSimulator};

fn simulator(mesh: Mesh, sensor: SensorDescription, config: CoveringConfig) -> PressSimulator {
    let physics = Physics::ElasticCovering(config);
    let press = PressConfig { physics, ..PressConfig::for_sensor(&sensor) };
    PressSimulator::with_config(mesh, sensor, press)
}

/// A sensor that looks down (-z of the object) from `height` above the object's origin.
fn looking_down(height: f64) -> Pose {
    Pose::from_parts(DQuat::from_rotation_x(PI), DVec3::new(0.0, 0.0, height))
}

/// The same covering over taxels of equal gain.
fn without_gains(config: CoveringConfig) -> CoveringConfig {
    CoveringConfig { gain_spread: 0.0, ..config }
}

fn pressures(simulator: &PressSimulator, pose: Pose) -> Vec<f64> {
    match simulator.press(pose).load {
        Load::Pressures(pressures) => pressures,
        Load::Displacements(_) => panic!("an elastic covering gives pressures"),
    }
}

#[test]
fn a_ball_drawn_from_its_mesh_has_hertzs_force() {
    let sensor = SensorDescription::tekscan_26x26();
    let config = CoveringConfig::half_space(&sensor);
    let simulator = simulator(sphere(30.0 * MM, 300), sensor, config);
    let (travel, radius) = (0.5 * MM, 30.0 * MM);
    let heights = simulator.heights(looking_down(30.0 * MM), 1.0 * MM);
    let surface = simulator.covering.as_ref().unwrap().surface_pressures(&heights, travel);
    let step = simulator.imaging.step();
    let force = surface.iter().sum::<f64>() * step * step;
    let hertz = 4.0 / 3.0 * config.contact_modulus() * radius.sqrt() * travel.powf(1.5);
    assert!((force / hertz - 1.0).abs() < 0.03, "{force} N for {hertz} N");
}

#[test]
fn a_uniform_press_on_a_layer_follows_the_force_curve() {
    // A plate over 60 mm of covering, 1 mm deep: 20 kPa · 1 / 2.54 = 7.87 kPa. Nearly
    // incompressible rubber flows out at the plate's edge, so under the usual 28 mm of
    // covering it is up to an eighth less.
    let plate = cuboid(DVec3::new(80.0 * MM, 80.0 * MM, 10.0 * MM));
    let sensor = SensorDescription::digitacts_6x6();
    let expected = sensor.parameters().force_curve.pressure(1.0 * MM);
    let physics = Physics::ElasticCovering(without_gains(CoveringConfig::bonded_layer(&sensor)));
    let image = |padding| {
        let press = PressConfig { physics, padding, ..PressConfig::for_sensor(&sensor) };
        let simulator = PressSimulator::with_config(plate.clone(), sensor.clone(), press);
        pressures(&simulator, looking_down(4.0 * MM))
    };
    assert!(image(12).iter().all(|pressure| (pressure / expected - 1.0).abs() < 0.005));
    let usual = image(4);
    assert!(usual.iter().all(|pressure| (0.85..1.0).contains(&(pressure / expected))));
}

#[test]
fn a_symmetric_body_gives_a_symmetric_image() {
    let sensor = SensorDescription::digitacts_6x6();
    let post = cuboid(DVec3::new(3.0 * MM, 3.0 * MM, 10.0 * MM));
    for config in [CoveringConfig::half_space(&sensor), CoveringConfig::bonded_layer(&sensor)] {
        let simulator = simulator(post.clone(), sensor.clone(), without_gains(config));
        let image = pressures(&simulator, looking_down(4.0 * MM));
        let strongest = image.iter().copied().fold(0.0, f64::max);
        for (taxel, pressure) in image.iter().enumerate() {
            let (row, col) = (taxel / 6, taxel % 6);
            for mirrored in [row * 6 + 5 - col, (5 - row) * 6 + col, col * 6 + row] {
                assert!((pressure - image[mirrored]).abs() < 0.02 * strongest);
            }
        }
        // Off centre by 4 mm and −2 mm in the sensor, which looks down with y turned over.
        let place = looking_down(4.0 * MM).translation + DVec3::new(-4.0 * MM, -2.0 * MM, 0.0);
        let image = pressures(&simulator, Pose::from_parts(DQuat::from_rotation_x(PI), place));
        let strongest = (0..36).max_by(|a, b| image[*a].total_cmp(&image[*b])).unwrap();
        let (row, col) = (strongest / 6, strongest % 6);
        assert!((1..=2).contains(&row) && (4..=5).contains(&col), "row {row}, column {col}");
    }
}

#[test]
fn halving_the_cells_hardly_changes_the_image() {
    let sensor = SensorDescription::digitacts_6x6();
    for config in [CoveringConfig::half_space(&sensor), CoveringConfig::bonded_layer(&sensor)] {
        let physics = Physics::ElasticCovering(CoveringConfig { tolerance: 1e-4, ..config });
        let image = |sub_samples| {
            let drawn = PressConfig { physics, sub_samples, ..PressConfig::for_sensor(&sensor) };
            let ball = sphere(15.0 * MM, 120);
            let simulator = PressSimulator::with_config(ball, sensor.clone(), drawn);
            pressures(&simulator, looking_down(13.5 * MM))
        };
        let (coarse, fine) = (image(2), image(4));
        let strongest = fine.iter().copied().fold(0.0, f64::max);
        for (a, b) in coarse.iter().zip(&fine) {
            assert!((a - b).abs() < 0.03 * strongest, "{:?}: {a} and {b}", config.base);
        }
    }
}

#[test]
fn free_air_reads_zero_and_deep_presses_are_clamped() {
    let sensor = SensorDescription::digitacts_6x6();
    let config = CoveringConfig::bonded_layer(&sensor);
    let plate = cuboid(DVec3::new(80.0 * MM, 80.0 * MM, 10.0 * MM));
    let simulator = simulator(plate, sensor.clone(), config);
    assert!(pressures(&simulator, looking_down(20.0 * MM)).iter().all(|p| p.abs() < 1e-12));
    let thickness = sensor.parameters().covering_thickness;
    let (full, beyond) = (
        pressures(&simulator, looking_down(5.0 * MM - thickness)),
        pressures(&simulator, looking_down(0.0)),
    );
    for (a, b) in full.iter().zip(&beyond) {
        assert!((a / b - 1.0).abs() < 1e-6);
    }
}

#[test]
fn gains_follow_the_seed_and_the_given_spread() {
    let sensor = SensorDescription::tekscan_26x26();
    let config = CoveringConfig::half_space(&sensor);
    let drawn = gains(676, &config);
    assert_eq!(drawn, gains(676, &config));
    assert_ne!(drawn, gains(676, &CoveringConfig { gain_seed: 2, ..config }));
    let mean = drawn.iter().sum::<f64>() / 676.0;
    let spread = (drawn.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / 676.0).sqrt();
    // The deviation of the mean of 676 is 0.4 %, of the spread 0.3 %.
    assert!((mean - 1.0).abs() < 0.015 && (spread - 0.1).abs() < 0.01, "{mean}, {spread}");
}

#[test]
fn readings_are_quantised_and_clipped_at_saturation() {
    let sensor = SensorDescription::digitacts_6x6();
    let config =
        CoveringConfig { young_modulus: 1e6, noise: 0.0, ..CoveringConfig::half_space(&sensor) };
    let simulator = simulator(sphere(20.0 * MM, 60), sensor, config);
    let read = |index| {
        let mut stream = Stream::new(5, Purpose::SensorNoise, index);
        simulator.read(SensorId(1), looking_down(18.5 * MM), &mut stream)
    };
    assert_eq!(read(0), read(1)); // no noise, and nothing else is drawn
    let image = read(0).image().pressures.clone();
    assert!((image.iter().copied().fold(0.0, f64::max) - 20e3).abs() < 1e-9);
    for pressure in image {
        let steps = pressure / config.quantisation;
        assert!((steps - steps.round()).abs() < 1e-9, "{pressure}");
    }
}

#[test]
fn solver_tolerance_is_below_one_converter_step() {
    let sensor = SensorDescription::digitacts_6x6();
    let knight = crate::shapes::example("chess_knight").unwrap();
    for config in [CoveringConfig::half_space(&sensor), CoveringConfig::bonded_layer(&sensor)] {
        let image = |tolerance| {
            let config = CoveringConfig { tolerance, ..config };
            let simulator = simulator(knight.clone(), sensor.clone(), config);
            let (_, high) = simulator.mesh().bounds();
            pressures(&simulator, looking_down(high.z - 1.5 * MM))
        };
        let exact = image(1e-8);
        assert!(exact.iter().copied().fold(0.0, f64::max) > 1e3);
        for (found, exact) in image(config.tolerance).iter().zip(&exact) {
            assert!((found - exact).abs() < config.quantisation, "{found} for {exact}");
        }
    }
}
