//! Tests of the density of a stated pose prior.

use std::f64::consts::PI;

use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::DEG;

use super::*;
use crate::test_support::single as in_single;

/// A hypothesis of a pose away from the origin.
fn seen(object: Option<u32>, deviation: [f64; 2]) -> PoseHypothesis {
    let rotation = DQuat::from_scaled_axis(DVec3::new(0.3, -0.5, 0.8));
    PoseHypothesis {
        object: object.map(ObjectIdx),
        session_from_object: Pose::from_parts(rotation, DVec3::new(0.1, 0.2, 0.3)),
        covariance: PoseHypothesis::diagonal(deviation[0], deviation[1]),
        weight: 2.0,
    }
}

fn stated(prior: &PosePrior, n_objects: usize) -> StatedPrior {
    let even = vec![(1.0 / n_objects as f64).ln(); n_objects];
    let statement = Statement::new(prior, &even, 0.04).unwrap();
    StatedPrior::new(Arc::new(statement), DVec3::ZERO, &SurfaceOptions::default())
}

fn of(hypotheses: Vec<PoseHypothesis>) -> PosePrior {
    PosePrior { hypotheses, ..PosePrior::default() }
}

fn at(pose: &Pose) -> InversePose {
    let (rotation, translation) = in_single(pose);
    InversePose::new(rotation, translation)
}

#[test]
fn the_peak_is_that_of_a_gaussian_over_the_uniform_prior() {
    let deviation = [10e-3, 10.0 * DEG];
    let prior = stated(&of(vec![seen(None, deviation)]), 2);
    let found = prior.log_density(1, &at(&seen(None, deviation).session_from_object));
    // σ² = 10² + 3² mm², 0.17453² + 0.12² rad²; 0.064 m³ · 8π² over (2π)³ σ_p³ σ_r³, and the
    // volume of rotations is 1 − 3 σ_r²/12 of that of their vectors.
    let (p, r) = ((1e-4f64 + 9e-6).powf(1.5), (0.174_53f64.powi(2) + 0.0144).powf(1.5));
    let peak = 0.064 * 8.0 * PI * PI / (TAU.powi(3) * p * r) / (1.0 - 0.25 * r.powf(2.0 / 3.0));
    assert!((f64::from(found) - (0.9 * peak + 0.1).ln()).abs() < 0.02, "{found} {peak}");
}

#[test]
fn the_density_is_one_in_the_mean_over_all_poses() {
    // Wide enough to be met by chance: 60 mm and 0.8 rad in a cube of 0.4 m about its mean.
    for (object, expected) in [(0, 1.0), (1, 1.0)] {
        let mut hypothesis = seen(Some(0), [0.06, 0.8]);
        // Correlated: a turn about z goes with a shift along x.
        (hypothesis.covariance[(0, 5)], hypothesis.covariance[(5, 0)]) = (0.03, 0.03);
        let center = hypothesis.session_from_object.translation;
        let prior = stated(&of(vec![hypothesis, seen(None, [0.05, 1.2])]), 3);
        let mut stream = Stream::new(1, Purpose::ObjectPose, 0);
        let n = 200_000;
        let mut sum = 0.0;
        for _ in 0..n {
            let place = DVec3::from_array([0; 3].map(|_| stream.uniform(-0.2, 0.2)));
            let pose = Pose::from_parts(stream.rotation(), center + place);
            sum += f64::from(prior.log_density(object, &at(&pose)).exp());
        }
        let mean = sum / f64::from(n);
        assert!((mean - expected).abs() < 0.06, "object {object}: {mean}");
    }
}

#[test]
fn names_and_classes_move_the_objects_by_bayes() {
    // 0.9 · (0.1 · ¼ + 0.9) + 0.1 · ¼ of the named one, 0.9 · 0.1 · ¼ + 0.1 · ¼ of the others.
    let share = |prior: &PosePrior| {
        let even = vec![0.25f64.ln(); 4];
        let found = Statement::new(prior, &even, 0.04).unwrap().log_objects;
        found.iter().map(|log| log.exp()).collect::<Vec<f64>>()
    };
    let found = share(&of(vec![seen(Some(2), [0.01, 0.2])]));
    assert!((found[2] - (0.9 * (0.025 + 0.9) + 0.025)).abs() < 1e-12, "{found:?}");
    assert!((found[0] - (0.9 * 0.025 + 0.025)).abs() < 1e-12);
    assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    // A detector that weighs two objects 3 : 1.
    let class_weights = vec![(ObjectIdx(1), 3.0), (ObjectIdx(3), 1.0)];
    let found = share(&PosePrior { class_weights, ..PosePrior::default() });
    assert!((found[1] - (0.9 * 0.75 + 0.025)).abs() < 1e-12 && (found[0] - 0.025).abs() < 1e-12);
    // A pose of any object says nothing about which it is.
    let found = share(&of(vec![seen(None, [0.01, 0.2])]));
    assert!(found.iter().all(|p| (p - 0.25).abs() < 1e-12), "{found:?}");
}

#[test]
fn an_object_that_is_ruled_out_stays_so() {
    let log_prior = [0.5f64.ln(), 0.5f64.ln(), f64::NEG_INFINITY];
    let named = of(vec![seen(Some(2), [0.01, 0.2])]);
    let found = Statement::new(&named, &log_prior, 0.04).unwrap().log_objects;
    assert!(found[2] == f64::NEG_INFINITY && (found[0] - 0.5f64.ln()).abs() < 1e-12, "{found:?}");
    let class_weights = vec![(ObjectIdx(2), 1.0)];
    let nothing = PosePrior { class_weights, ..PosePrior::default() };
    assert!(Statement::new(&nothing, &log_prior, 0.04).is_err());
}

#[test]
fn a_workspace_is_denser_by_its_volume_and_has_an_end() {
    let high = DVec3::new(0.2, 0.2, 0.16);
    let workspace = Some(Workspace { low: DVec3::ZERO, high });
    let prior = stated(&PosePrior { workspace, ..PosePrior::default() }, 2);
    let log = |x: f64| {
        let pose = Pose::from_parts(DQuat::IDENTITY, DVec3::new(x, 0.1, 0.1));
        f64::from(prior.log_density(0, &at(&pose)))
    };
    // 0.064/0.0064 = 10.
    assert!((log(0.1) - (0.9 * 10.0 + 0.1f64).ln()).abs() < 1e-5);
    assert!((log(0.3) - 0.1f64.ln()).abs() < 1e-5, "outside the statement is wrong");
    // An unknown object is subject to the same.
    let unknown = prior.log_unknown(Vec3::new(0.1, 0.1, 0.08), 100.0);
    assert!((unknown - (0.9 * 10.0 + 0.1f64).ln()).abs() < 1e-3, "{unknown}");
    assert!((prior.log_unknown(Vec3::splat(0.9), 100.0) - 0.1f64.ln()).abs() < 1e-6);
}

#[test]
fn drift_and_a_move_before_the_first_touch_loosen_a_statement() {
    let prior = of(vec![seen(None, [1e-3, 0.01])]);
    let log = |stated: &StatedPrior, x: f64| {
        let mut pose = seen(None, [1e-3, 0.01]).session_from_object;
        pose.translation.x += x;
        stated.log_density(0, &at(&pose))
    };
    let still = stated(&prior, 2);
    let drifted = still.drifted([0.02f64.powi(2), 0.1]);
    assert!(log(&still, 0.03) < log(&drifted, 0.03) - 5.0);
    assert!(log(&still, 0.0) > log(&drifted, 0.0) + 3.0);
    let mut statement = (*still.statement).clone();
    statement.loosen(&Looseness { position: 0.02, angle: 0.1f64.sqrt() });
    let moved = StatedPrior::new(Arc::new(statement), DVec3::ZERO, &SurfaceOptions::default());
    assert!((log(&moved, 0.03) - log(&drifted, 0.03)).abs() < 1e-4);
}

#[test]
fn draws_spread_as_the_hypothesis_does() {
    let prior = stated(&of(vec![seen(None, [0.01, 0.2])]), 1);
    let drawn = prior.draws(0, 0, 400);
    let mean = &drawn.poses[0].0;
    let square = |q: &Quat| f64::from(q.angle_between(*mean)).powi(2);
    let variance = drawn.poses.iter().map(|(q, _)| square(q)).sum::<f64>() / 1_200.0;
    // 0.2² + 0.12² rad² about each axis.
    assert!((variance / 0.0544 - 1.0).abs() < 0.1, "{variance}");
}
