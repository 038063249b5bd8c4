//! Tests of the evidence beside a statement: it is the integral over the stated poses.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use nalgebra::{Cholesky, Vector6};
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::{DEG, MM};

use super::*;
use crate::options::SurfaceOptions;
use crate::pose_prior::{PoseHypothesis, PosePrior};
use crate::test_support::{Session, inverse, places, seen, some_pose};
use crate::verify::stated_prior::Statement;

/// Poses by which the integral is computed.
const SAMPLES: usize = 200_000;

/// A pose off another one by these deviations about each axis, and a hypothesis of it.
fn stated(truth: &Pose, [moved, turned]: [f64; 2], stream: &mut Stream) -> PoseHypothesis {
    let mut off = |by: f64| DVec3::from_array([0; 3].map(|_| by * stream.normal()));
    let (moved_by, turned_by) = (off(moved), DQuat::from_scaled_axis(off(turned)));
    PoseHypothesis {
        object: None,
        session_from_object: Pose::from_parts(
            turned_by * truth.rotation,
            truth.translation + moved_by,
        ),
        covariance: PoseHypothesis::diagonal(moved, turned),
        weight: 1.0,
    }
}

fn prior_of(hypothesis: &PoseHypothesis) -> StatedPrior {
    let prior = PosePrior { hypotheses: vec![hypothesis.clone()], ..PosePrior::default() };
    let statement = Statement::new(&prior, &[0.0], 0.04).unwrap();
    StatedPrior::new(Arc::new(statement), DVec3::ZERO, &SurfaceOptions::default())
}

/// The mean of the density of all touches over poses drawn from a hypothesis: R36 as printed.
fn by_samples(session: &Session, hypothesis: &PoseHypothesis, samples: usize) -> f64 {
    let evidence = session.evidence();
    let options = &session.options;
    let wider =
        PoseHypothesis::diagonal(f64::from(options.merge_distance), f64::from(options.merge_angle));
    let factor = Cholesky::new(hypothesis.covariance + wider).unwrap().l();
    let mut stream = Stream::new(3, Purpose::Sampling, 0);
    let mut sum = 0.0;
    for _ in 0..samples {
        let off = factor * Vector6::from_fn(|_, _| stream.normal());
        let turned = DQuat::from_scaled_axis(DVec3::new(off[3], off[4], off[5]));
        let mean = &hypothesis.session_from_object;
        let translation = mean.translation + DVec3::new(off[0], off[1], off[2]);
        let pose = inverse(&Pose::from_parts(turned * mean.rotation, translation));
        let score = |touch| evidence.kernel.score(&evidence.maps[0], &pose, touch);
        sum += f64::from(evidence.touches.iter().map(score).sum::<f32>()).exp();
    }
    sum / samples as f64
}

#[test]
fn the_evidence_of_a_pair_is_the_integral_over_poses() {
    let objects = [places(700, 0)];
    let deviations = [10.0 * MM, 10.0 * DEG];
    let mut offs = Vec::new();
    for index in 0..12 {
        let mut session = Session::over(&objects, SurfaceOptions::default());
        let truth = some_pose(index);
        session.touches = places(2, 100 + index).iter().map(|at| seen(at, &truth)).collect();
        let mut stream = Stream::new(5, Purpose::Perturbation, index);
        let hypothesis = stated(&truth, deviations, &mut stream);
        let prior = prior_of(&hypothesis);
        let evidence = session.evidence();
        let map = &evidence.maps[0];
        let turned = Turned::new(&prior, 2, None);
        let of = Stated { turned: &turned, hypothesis: 0, map, evidence: &evidence };
        let felt = Felt::new(&turned, map, &session.touches);
        let found = of.density_of_pair(&felt[1], &felt[0]);
        offs.push((found / by_samples(&session, &hypothesis, SAMPLES)).ln());
    }
    // The density itself differs by ten between sessions.
    let mean = offs.iter().sum::<f64>() / offs.len() as f64;
    let square = offs.iter().map(|off| off.powi(2)).sum::<f64>() / offs.len() as f64;
    assert!(mean.abs() < 0.3 && square.sqrt() < 0.7, "{offs:?}");
}
