//! Tests of presses, on bodies whose images can be computed by hand.

use glam::{DQuat, DVec3};
use palpate_core::rng::Purpose;
use palpate_core::sensor::{Coupling, CoveringEdge, TaxelGrid};

use super::*;
use crate::mesh::tests_support::{cuboid, sphere};

/// A sensor that looks down (-z of the object) from `height` above the object's origin.
fn looking_down(height: f64) -> Pose {
    let rotation = DQuat::from_rotation_x(std::f64::consts::PI);
    Pose::from_parts(rotation, DVec3::new(0.0, 0.0, height))
}

fn displacements(press: &Press) -> &[f64] {
    match &press.load {
        Load::Displacements(displacements) => displacements,
        Load::Pressures(_) => panic!("the point spread gives displacements"),
    }
}

#[test]
fn a_plate_pressed_one_millimetre_displaces_every_taxel_by_one() {
    let plate = cuboid(DVec3::new(80.0 * MM, 80.0 * MM, 10.0 * MM));
    for name in palpate_core::sensor::Preset::NAMES {
        let sensor = SensorDescription::preset_named(name).unwrap();
        if sensor.radius().is_some() {
            continue;
        }
        let simulator = PressSimulator::new(plate.clone(), sensor);
        let press = simulator.press(looking_down(4.0 * MM)); // the top is at 5 mm
        assert!((press.max_penetration - 1.0 * MM).abs() < 1e-9);
        for displacement in displacements(&press) {
            assert!((displacement - 1.0 * MM).abs() < 1e-9, "{name}: {displacement}");
        }
    }
}

#[test]
fn free_air_gives_an_image_of_zeros() {
    let simulator =
        PressSimulator::new(cuboid(DVec3::splat(0.02)), SensorDescription::digitacts_6x6());
    let press = simulator.press(looking_down(20.0 * MM));
    assert!(press.max_penetration < 0.0);
    assert!(displacements(&press).iter().all(|d| d.abs() < 1e-15));
}

#[test]
fn heights_of_a_sphere_follow_the_formula() {
    // A sphere of radius 30 mm; the sensor's origin is 29 mm above its centre, so the
    // surface above (x, y) is at z = 29 − √(30² − x² − y²) mm in front of the covering.
    let simulator = PressSimulator::new(sphere(30.0 * MM, 160), SensorDescription::digitacts_6x6());
    let heights = simulator.heights(looking_down(29.0 * MM), 14.0 * MM);
    assert!((heights.lowest() + 1.0 * MM).abs() < 0.02 * MM, "{}", heights.lowest());
    for (x, y, z) in heights.points() {
        let expected = 29.0 * MM - (0.03f64.powi(2) - x * x - y * y).sqrt();
        // The mesh lies inside the sphere by the sagitta of its edges, below 0.02 mm.
        assert!((z - expected).abs() < 0.05 * MM, "at {x}, {y}: {z} for {expected}");
    }
}

#[test]
fn indentations_from_elsewhere_press_as_an_object_does() {
    // The same sphere: its indentation at the middle of each cell, by the formula.
    let simulator = PressSimulator::new(sphere(30.0 * MM, 160), SensorDescription::digitacts_6x6());
    let press = simulator.press(looking_down(29.0 * MM));
    let (rows, cols, side) = simulator.cells();
    assert_eq!((rows, cols), (32, 32));
    let middle = |index: usize| (index as f64 - 15.5) * side;
    let indentation = |at: usize| {
        let (x, y) = (middle(at % cols), middle(at / cols));
        (0.03f64.powi(2) - x * x - y * y).sqrt() - 29.0 * MM
    };
    let indentations: Vec<f64> = (0..rows * cols).map(indentation).collect();
    let given = simulator.press_of(&indentations);
    assert!((given.max_penetration - press.max_penetration).abs() < 0.03 * MM);
    for (given, drawn) in displacements(&given).iter().zip(displacements(&press)) {
        // The mesh lies inside the sphere, as above.
        assert!((given - drawn).abs() < 0.02 * MM, "{given} for {drawn}");
    }
    let free = simulator.press_of(&vec![0.0; rows * cols]);
    assert!(displacements(&free).iter().all(|d| d.abs() < 1e-15));
}

#[test]
fn images_of_deep_presses_are_clamped_to_the_covering() {
    let plate = cuboid(DVec3::new(80.0 * MM, 80.0 * MM, 10.0 * MM));
    let simulator = PressSimulator::new(plate, SensorDescription::digitacts_6x6());
    let press = simulator.press(looking_down(0.0));
    assert!((press.max_penetration - 5.0 * MM).abs() < 1e-9);
    assert!(displacements(&press).iter().all(|d| (d - 2.54 * MM).abs() < 1e-9));
}

#[test]
fn an_image_follows_the_object_along_columns_and_rows() {
    // A post under the taxels of large x: columns rise with x, and it is at small y.
    let post = cuboid(DVec3::new(3.0 * MM, 3.0 * MM, 10.0 * MM));
    let simulator = PressSimulator::new(post, SensorDescription::digitacts_6x6());
    // Looking down turns y over: the sensor's y is the object's −y.
    let pose = Pose::from_parts(
        DQuat::from_rotation_x(std::f64::consts::PI),
        DVec3::new(-4.0 * MM, -2.0 * MM, 4.0 * MM),
    );
    let press = simulator.press(pose); // the post is at x = +4, y = −2 in the sensor
    let strongest =
        (0..36).max_by(|&a, &b| displacements(&press)[a].total_cmp(&displacements(&press)[b]));
    // Columns at −5 −3 −1 1 3 5: x = 4 lies between 4 and 5; rows: y = −2 between 1 and 2.
    let (row, col) = (strongest.unwrap() / 6, strongest.unwrap() % 6);
    assert!((1..=2).contains(&row) && (4..=5).contains(&col), "row {row}, column {col}");
}

/// The displacements (mm) of the first row of taxels under a plate pressed 1 mm in.
fn first_row_under_a_plate(coupling: Coupling) -> Vec<f64> {
    let known = SensorDescription::digitacts_6x6().parameters().clone();
    let sensor = SensorDescription::new(SensorParameters { coupling, ..known }).unwrap();
    let plate = cuboid(DVec3::new(80.0 * MM, 80.0 * MM, 10.0 * MM));
    let press = PressSimulator::new(plate, sensor).press(looking_down(4.0 * MM));
    displacements(&press)[..6].iter().map(|d| d / MM).collect()
}

#[test]
fn the_edge_of_the_covering_decides_what_taxels_near_it_feel() {
    let margin = Some(0.0);
    let row = |edge| first_row_under_a_plate(Coupling { edge, margin, ..Coupling::default() });
    assert!(row(CoveringEdge::Continues).iter().all(|d| (d - 1.0).abs() < 1e-9));
    // The corner taxel is 1 mm from both ends, σ = 3.48 mm: along each axis it keeps the
    // mean of Φ over its width, about Φ(1/3.48) = 0.613 of 1, less what is lost at the far
    // end (11 mm, 0.1 %). Together 0.375.
    let lost = row(CoveringEdge::LosesForce);
    assert!((lost[0] - 0.375).abs() < 0.01, "{lost:?}");
    assert!(lost[2] > lost[1] && lost[1] > lost[0], "{lost:?}");
    // No force is lost: the mean over the array is 1.
    let kept = mean_under_a_plate(Coupling {
        edge: CoveringEdge::ConservesForce,
        margin,
        ..Coupling::default()
    });
    assert!((kept - 1.0).abs() < 0.01, "{kept}");
}

/// The mean displacement (mm) of all taxels under a plate pressed 1 mm in.
fn mean_under_a_plate(coupling: Coupling) -> f64 {
    let known = SensorDescription::digitacts_6x6().parameters().clone();
    let grid = TaxelGrid { taxel_width: known.grid.pitch, ..known.grid };
    let known = SensorParameters { grid, coupling, ..known };
    let sensor = SensorDescription::new(known).unwrap();
    let plate = cuboid(DVec3::new(80.0 * MM, 80.0 * MM, 10.0 * MM));
    let press = PressSimulator::new(plate, sensor).press(looking_down(4.0 * MM));
    displacements(&press).iter().sum::<f64>() / 36.0 / MM
}

#[test]
fn uneven_gains_scale_each_taxel_of_a_drawn_sensor() {
    let known = SensorDescription::digitacts_6x6().parameters().clone();
    let coupling = Coupling { gain_spread: 0.1, ..Coupling::default() };
    let silent = SensorParameters { noise: 0.0, quantisation: 0.0, coupling, ..known };
    let sensor = SensorDescription::new(silent).unwrap();
    let plate = cuboid(DVec3::new(80.0 * MM, 80.0 * MM, 10.0 * MM));
    let even = PressSimulator::new(plate, sensor.clone());
    let uneven = even.with_sensor(sensor, &mut Stream::new(5, Purpose::SensorFamily, 0));
    let felt = |simulator: &PressSimulator| {
        let press = simulator.press(looking_down(4.0 * MM));
        simulator.pressures(&press, &mut Stream::new(5, Purpose::SensorNoise, 0))
    };
    let gains = taxel_gains(36, 0.1, &mut Stream::new(5, Purpose::SensorFamily, 0));
    for ((even, uneven), gain) in felt(&even).into_iter().zip(felt(&uneven)).zip(gains) {
        assert!((uneven - gain * even).abs() < 1e-6, "{even} Pa, {uneven} Pa, {gain}");
    }
}

#[test]
fn hysteresis_scales_a_whole_press_within_its_bound() {
    let known = SensorDescription::digitacts_6x6().parameters().clone();
    let coupling = Coupling { hysteresis: 0.2, ..Coupling::default() };
    let silent = SensorParameters { noise: 0.0, quantisation: 0.0, coupling, ..known };
    let plate = cuboid(DVec3::new(80.0 * MM, 80.0 * MM, 10.0 * MM));
    let simulator = PressSimulator::new(plate, SensorDescription::new(silent).unwrap());
    let press = simulator.press(looking_down(4.0 * MM));
    let mut stream = Stream::new(5, Purpose::SensorNoise, 0);
    let factors: Vec<f64> = (0..50)
        .map(|_| {
            let felt = simulator.pressures(&press, &mut stream);
            assert!(felt.iter().all(|p| (p - felt[0]).abs() < 1e-6), "{felt:?}");
            felt[0] / (20_000.0 / 2.54)
        })
        .collect();
    assert!(factors.iter().all(|factor| (0.8..=1.2).contains(factor)), "{factors:?}");
    assert!(factors.iter().any(|f| *f < 0.9) && factors.iter().any(|f| *f > 1.1));
}

#[test]
fn neighbours_read_their_share_of_a_taxel() {
    let known = SensorDescription::digitacts_6x6().parameters().clone();
    let coupling = Coupling { cross_talk: 0.1, ..Coupling::default() };
    let silent = SensorParameters { noise: 0.0, quantisation: 0.0, coupling, ..known };
    let sensor = SensorDescription::new(silent).unwrap();
    let simulator = PressSimulator::new(cuboid(DVec3::splat(0.02)), sensor);
    let mut load = vec![0.0; 36];
    load[7] = 1.0 * MM; // second row, second column; 20 kPa over 2.54 mm
    let press = Press { max_penetration: 1.0 * MM, load: Load::Displacements(load) };
    let mut stream = Stream::new(5, Purpose::SensorNoise, 0);
    let felt = simulator.pressures(&press, &mut stream);
    let own = 20_000.0 / 2.54;
    assert!((felt[7] - own).abs() < 1e-6);
    for beside in [1, 6, 8, 13] {
        assert!((felt[beside] - 0.1 * own).abs() < 1e-6, "{felt:?}");
    }
    assert!(felt[0].abs() < 1e-12 && felt[14].abs() < 1e-12, "not diagonally");
}

#[test]
fn equal_streams_give_equal_readings() {
    let sensor = SensorDescription::digitacts_6x6();
    let simulator = PressSimulator::new(sphere(20.0 * MM, 40), sensor);
    let read = |index| {
        let mut stream = Stream::new(5, Purpose::SensorNoise, index);
        simulator.read(SensorId(1), looking_down(19.0 * MM), &mut stream)
    };
    assert_eq!(read(0), read(0));
    assert_ne!(read(0), read(1));
}

#[test]
fn a_closed_mesh_that_is_inside_out_is_turned() {
    let mesh = cuboid(DVec3::splat(0.02)).inside_out();
    let simulator = PressSimulator::new(mesh, SensorDescription::digitacts_6x6());
    assert!(simulator.mesh().signed_volume() > 0.0);
}
