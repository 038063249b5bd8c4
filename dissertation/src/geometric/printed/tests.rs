//! Tests of the printed filters as beliefs, on hand-drawn maps.

use super::*;
use crate::filter::particle::ParticleOptions;
use crate::geometric::TableBudget;
use crate::geometric::model::GeometricMap;
use crate::occupancy::{ClassTable, GridShape, OccupancyGrid};
use palpate_core::reading::SensorId;
use palpate_core::units::{DEG, KPA};

/// The height of the maps' plane in the object frames.
const HEIGHT: f64 = 3.0 * MM;

/// A bar and a block of 1 mm cells about their object's origin, 4 × 20 mm and 16 × 16 mm.
fn model() -> Arc<GeometricModel> {
    let map = |half: [f64; 2]| {
        let min = DVec3::new(-15.0 * MM, -15.0 * MM, HEIGHT);
        let shape = GridShape::new(min, 1.0 * MM, [30, 30, 1]).unwrap();
        let log_odds = |cell| {
            let at: DVec3 = shape.center(cell);
            if at.x.abs() < half[0] && at.y.abs() < half[1] { 6.0 } else { -6.0 }
        };
        let log_odds = (0..shape.n_cells()).map(log_odds).collect();
        let occupancy = OccupancyGrid::from_parts(shape, 0.5, log_odds).unwrap();
        Arc::new(GeometricMap { occupancy, mosaic: None })
    };
    let maps = vec![map([2.0 * MM, 10.0 * MM]), map([8.0 * MM, 8.0 * MM])];
    Arc::new(GeometricModel { table: ClassTable::literal(), gains: Vec::new(), maps })
}

fn prepared() -> PreparedGeometry {
    PreparedGeometry::new(model())
}

const TRUTH: [f64; 3] = [2.0 * MM, -3.0 * MM, 40.0 * DEG];

fn session_from_plane() -> Pose {
    Pose::from_parts(DQuat::from_rotation_x(0.7), DVec3::new(0.3, -0.2, 0.1))
}

/// Presses on the bar, which lies at [`TRUTH`] in the plane.
fn presses(sensor: &SensorDescription) -> Vec<Reading> {
    let [x, y, angle] = TRUTH;
    let plane_from_bar = Pose::from_parts(DQuat::from_rotation_z(angle), DVec3::new(x, y, 0.0));
    let press = |k: usize| {
        let place = 6.0 * MM * DVec3::new((k % 3) as f64 - 1.0, (k / 3) as f64 - 1.0, 0.0);
        let turn = DQuat::from_rotation_z(k as f64) * DQuat::from_rotation_x(PI);
        let plane_from_sensor = Pose::from_parts(turn, place);
        let image: Vec<Option<f64>> = (0..36)
            .map(|taxel| {
                let (x, y) = sensor.grid().center(taxel / 6, taxel % 6);
                let at = plane_from_bar.inverse() * (plane_from_sensor * DVec3::new(x, y, 0.0));
                let touched = at.x.abs() < 2.0 * MM && at.y.abs() < 10.0 * MM;
                Some(if touched { 10.0 * KPA } else { 0.0 })
            })
            .collect();
        let session_from_sensor = session_from_plane() * plane_from_sensor;
        Reading::new(SensorId(0), sensor, &image, session_from_sensor).unwrap()
    };
    (0..9).map(press).collect()
}

fn prior(half_angle: f64) -> PosePrior {
    PosePrior::Planar {
        session_from_plane: session_from_plane(),
        center: [0.0; 2],
        half_extent: 10.0 * MM,
        angle: 0.0,
        half_angle,
    }
}

fn filters() -> [PrintedFilter; 2] {
    let particles = ParticleOptions::literal(8_000);
    [PrintedFilter::Histogram { n: [20, 20, 36] }, PrintedFilter::Particles(particles)]
}

fn belief(filter: &PrintedFilter, log_prior: &[f64]) -> PrintedBelief {
    let sensor = SensorDescription::digitacts_6x6();
    let mut belief = PrintedBelief::new(&prepared(), &prior(PI), filter, 1, log_prior).unwrap();
    presses(&sensor).iter().for_each(|press| belief.add(press, &sensor));
    belief
}

#[test]
fn both_filters_locate_the_bar_in_its_plane() {
    for filter in filters() {
        let belief = belief(&filter, &[0.5_f64.ln(); 2]);
        let answer = belief.answer(3, 9);
        assert_eq!(answer.best_object(), Some(ObjectIdx(0)), "{filter:?}");
        assert!(answer.probabilities[0] > 0.99, "{:?}", answer.probabilities);
        let found = session_from_plane().inverse() * answer.modes[0].session_from_object;
        // The pressed face, at the height of the map, lies in the plane.
        assert!((found.translation.z + HEIGHT).abs() < 1e-9, "{found:?}");
        let [x, y, angle] = TRUTH;
        let off = (found.translation.truncate() - DVec2::new(x, y)).length();
        assert!(off < 2.0 * MM, "{filter:?}: {off}");
        // The bar is the same after half a turn.
        let along = found.turn(DVec3::X);
        let off = (along.y.atan2(along.x) - angle + PI / 2.0).rem_euclid(PI) - PI / 2.0;
        assert!(off.abs() < 12.0 * DEG, "{filter:?}: {off}");
    }
}

#[test]
fn marginals_sum_to_one_and_peak_at_the_truth() {
    for filter in filters() {
        let belief = belief(&filter, &[0.5_f64.ln(); 2]);
        let marginals = belief.marginals(ObjectIdx(0)).unwrap();
        let names: Vec<&str> = marginals.axes.iter().map(|axis| axis.axis).collect();
        assert_eq!(names, ["x", "y", "theta"]);
        for axis in &marginals.axes {
            assert!((axis.probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{}", axis.axis);
        }
        let x = &marginals.axes[0];
        let width = (x.high - x.low) / x.probabilities.len() as f64;
        let mean: f64 = x.probabilities.iter().enumerate().map(|(bin, p)| p * bin as f64).sum();
        let mean = x.low + (mean + 0.5) * width;
        assert!((mean - TRUTH[0]).abs() < 1.5 * MM, "{filter:?}: {mean}");
        let plane = marginals.plane.unwrap();
        assert!((plane.probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    }
    assert!(belief(&filters()[0], &[0.0; 2]).marginals(ObjectIdx(2)).is_none());
}

#[test]
fn the_prior_over_objects_weighs_the_answer() {
    let sensor = SensorDescription::digitacts_6x6();
    for filter in filters() {
        let log_prior = [0.25_f64.ln(), 0.75_f64.ln()];
        let mut belief =
            PrintedBelief::new(&prepared(), &prior(PI), &filter, 1, &log_prior).unwrap();
        let found = belief.answer(1, 0).probabilities;
        // Particles of 8,000 that name an object: 4,000 ± 45.
        assert!((found[1] - 0.75).abs() < 0.02, "{found:?}");
        let certain =
            PrintedBelief::new(&prepared(), &prior(PI), &filter, 1, &[f64::NEG_INFINITY, 0.0]);
        let mut certain = certain.unwrap();
        for press in presses(&sensor) {
            belief.add(&press, &sensor);
            certain.add(&press, &sensor);
        }
        assert_eq!(belief.answer(1, 9).best_object(), Some(ObjectIdx(0)));
        assert_eq!(certain.answer(1, 9).best_object(), Some(ObjectIdx(1)));
    }
}

#[test]
fn unsupported_options_of_printed_filters_are_refused() {
    let new = |prior: &PosePrior, filter: &PrintedFilter| {
        PrintedBelief::new(&prepared(), prior, filter, 1, &[0.0; 2]).map(drop)
    };
    let bounded = PosePrior::Bounded {
        session_from_object: Pose::IDENTITY,
        half_extent: DVec3::splat(0.01),
        half_angle: 0.3,
    };
    for filter in filters() {
        assert_eq!(new(&prior(1.0), &filter), Err(GeometricError::EveryTurn { found: 1.0 }));
        assert_eq!(new(&bounded, &filter), Err(GeometricError::NotSolid));
    }
}

#[test]
fn histograms_of_equal_bins_share_planes_and_count_them_once() {
    let budget = TableBudget::new(usize::MAX);
    let prepared = PreparedGeometry::within(model(), Arc::clone(&budget));
    let histogram = PrintedFilter::Histogram { n: [20, 20, 36] };
    let foretold = PrintedBelief::memory(&prepared, &prior(PI), &histogram).unwrap();
    assert_eq!((foretold.missing, budget.used()), (foretold.tables, 0));
    let new = || PrintedBelief::new(&prepared, &prior(PI), &histogram, 1, &[0.0; 2]).unwrap();
    let (a, b) = (new(), new());
    assert_eq!(budget.used(), foretold.tables);
    assert_eq!(PrintedBelief::memory(&prepared, &prior(PI), &histogram).unwrap().missing, 0);
    let finer = PrintedFilter::Histogram { n: [40, 40, 36] };
    let other = PrintedBelief::new(&prepared, &prior(PI), &finer, 1, &[0.0; 2]).unwrap();
    assert!(budget.used() > foretold.tables);
    drop((a, b, other));
    assert_eq!(budget.used(), 0);
}
