//! Tests of the inverse sensor model against its definition and hand-computed values.

use glam::DQuat;
use proptest::prelude::*;

use super::*;
use palpate_core::pose::Pose;
use palpate_core::reading::SensorId;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::{KPA, MM};

const SENSOR: fn() -> SensorDescription = SensorDescription::digitacts_6x6;

/// Presses of random images from random poses over the plane, pressing down.
fn presses(seed: u64, n: usize) -> Vec<Reading> {
    let mut stream = Stream::new(seed, Purpose::Sampling, 0);
    let down = DQuat::from_rotation_x(std::f64::consts::PI);
    (0..n)
        .map(|_| {
            let turn = DQuat::from_rotation_z(stream.uniform(-3.0, 3.0));
            let place = 10.0 * MM * DVec3::new(stream.normal(), stream.normal(), 0.0);
            let image: Vec<Option<f64>> =
                (0..36).map(|_| Some(stream.uniform(0.0, 10.0) * KPA)).collect();
            Reading::new(SensorId(0), &SENSOR(), &image, Pose::from_parts(turn * down, place))
                .unwrap()
        })
        .collect()
}

fn plane(readings: &[Reading]) -> GridShape {
    shape_around(readings, &SENSOR(), 1.5 * MM, 4.0 * MM, Some(0.0)).unwrap()
}

/// Equation 3.6 as defined, without a reach.
fn naive(readings: &[Reading], shape: &GridShape, model: &InverseModel, cell: usize) -> f64 {
    let mut sum = logit(model.prior);
    for reading in readings {
        for (point, class) in model.classified(reading, &SENSOR()).taxels() {
            let apart = *point - shape.center(cell);
            let squared = if shape.is_planar() {
                apart.truncate().length_squared()
            } else {
                apart.length_squared()
            };
            let spread = SENSOR().parameters().point_spread;
            sum += model.evidence(*class, squared, spread, 2.0 * MM);
        }
    }
    sum
}

#[test]
fn evidence_matches_hand_computed_values() {
    // Prior ½, κ 0.6, d = σ/2: weight 0.6·exp(−½) = 0.363918, so Pr = 0.681959 in contact
    // and its log-odds ln(1.363918/0.636082) = 0.762790; no contact is the opposite.
    let model = InverseModel::default();
    let at = |class| model.evidence(class, 1.0 * MM * MM, 2.0 * MM, 2.0 * MM);
    assert!((at(ContactClass::InContact) - 0.762_790).abs() < 1e-5);
    assert!((at(ContactClass::NoContact) + 0.762_790).abs() < 1e-5);
    assert!(at(ContactClass::Unknown).abs() < 1e-12);
    // As printed, σ one pitch: peak 1.128379, d = 0, prior 0.2: above 1, so it is clamped.
    let printed = InverseModel::literal(0.2);
    let clamped = printed.evidence(ContactClass::InContact, 0.0, 2.0 * MM, 2.0 * MM);
    assert!((clamped - (logit(1.0 - 1e-6) - logit(0.2))).abs() < 1e-9);
    // d = 2σ√2, so exp(−1): weight 0.415107, Pr = 0.2·(1 − 0.415107) = 0.116979.
    let miss = printed.evidence(ContactClass::NoContact, 32.0 * MM * MM, 2.0 * MM, 2.0 * MM);
    assert!((miss - (logit(0.116_979) - logit(0.2))).abs() < 1e-5, "{miss}");
}

#[test]
fn planar_and_solid_maps_are_the_naive_sum() {
    let readings = presses(1, 12);
    let model = InverseModel { log_odds_max: f64::INFINITY, ..InverseModel::default() };
    let solid = shape_around(&readings, &SENSOR(), 3.0 * MM, 4.0 * MM, None).unwrap();
    for shape in [plane(&readings), solid] {
        let map = map_occupancy(&readings, &SENSOR(), shape, &model);
        for cell in (0..shape.n_cells()).step_by(7) {
            let (found, expected) =
                (f64::from(map.log_odds()[cell]), naive(&readings, &shape, &model, cell));
            // Evidence beyond the reach is left out: 12·36 taxels of less than 1e-4.
            assert!((found - expected).abs() < 6e-3, "cell {cell}: {found}, {expected}");
        }
    }
}

#[test]
fn order_of_readings_and_threads_do_not_matter() {
    let mut readings = presses(2, 40);
    let (shape, model) = (plane(&readings), InverseModel::default());
    let map = map_occupancy(&readings, &SENSOR(), shape, &model);
    readings.reverse();
    readings.swap(3, 20);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let again = one.install(|| map_occupancy(&readings, &SENSOR(), shape, &model));
    assert_eq!(map, again);
}

#[test]
fn log_odds_stay_within_the_limit() {
    let readings = vec![presses(3, 1).remove(0); 50];
    let map = map_occupancy(&readings, &SENSOR(), plane(&readings), &InverseModel::default());
    let largest = map.log_odds().iter().fold(0.0f32, |max, value| max.max(value.abs()));
    assert!((largest - 8.0).abs() < 1e-6);
}

#[test]
fn the_reach_of_a_solid_map_covers_depth() {
    // Pressed 2.54 mm deep everywhere, the contact lies that far inside the sensor.
    let image = [Some(20.0 * KPA); 36];
    let reading = Reading::new(SensorId(0), &SENSOR(), &image, Pose::IDENTITY).unwrap();
    let readings = [reading];
    let shape = shape_around(&readings, &SENSOR(), 0.5 * MM, 3.0 * MM, None).unwrap();
    let map = map_occupancy(&readings, &SENSOR(), shape, &InverseModel::default());
    let at = |z: f64| map.log_odds_at(DVec3::new(1.0 * MM, 1.0 * MM, z));
    assert!(at(-2.54 * MM) > at(-MM) && at(-2.54 * MM) > at(-4.0 * MM));
}

proptest! {
    #[test]
    fn merged_maps_are_the_map_of_all_readings(seed in 0u64..50, cut in 1usize..9) {
        let readings = presses(seed, 10);
        let unlimited = f64::INFINITY;
        let model = InverseModel { prior: 0.3, log_odds_max: unlimited, ..InverseModel::default() };
        let map = |part: &[Reading]| map_occupancy(part, &SENSOR(), plane(&readings), &model);
        let merged = map(&readings[..cut]).merge(&map(&readings[cut..])).unwrap();
        for (all, merged) in map(&readings).log_odds().iter().zip(merged.log_odds()) {
            prop_assert!((all.clamp(-8.0, 8.0) - merged).abs() < 1e-4, "{} {}", all, merged);
        }
    }
}
