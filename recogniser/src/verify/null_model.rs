//! The null model: correction of "none of these" by the objects' self-match scores.
//!
//! A small or distinctive object explains its touches far better than a large plain one; touches
//! of an unknown object that merely resembles it score lower than its own touches (equations R12
//! and R13).

use glam::{DVec3, Quat};
use rayon::prelude::*;

use super::density::Kernel;
use crate::model::appearance::AppearanceSpace;
use crate::model::{SurfaceMap, SurfaceModel};
use crate::observe::inverse_pose::InversePose;
use crate::observe::observation::{Observation, Says};
use crate::observe::touch::{PointDeviations, Touch};
use crate::options::{ScoreScale, SurfaceOptions};

/// Number of patches on which a map's self-match score is measured.
const SAMPLES: usize = 48;

/// Share of the best object's weight below which an object is ignored.
const LEAST: f64 = 0.01;

/// The touches in the evidence of "none of these".
#[derive(Clone, Copy, Debug)]
pub(crate) struct Counted {
    /// Their number by weight.
    pub(crate) touches: f64,
    /// Total loss of score (ln) under every object because touches are unsteady or loosely placed.
    pub(crate) loss: f64,
    /// The number by weight of touches without appearance, and of those without a normal either.
    pub(crate) lacking: [f64; 2],
}

/// Correction (ln) of the evidence of "none of these": higher if the touches resemble an object
/// that should explain them better, lower if touches lose under every object. `evidence` has
/// objects with their ln evidence.
///
/// Equation R13 of docs/recogniser.md.
pub(crate) fn correction(
    counted: Counted,
    evidence: impl Iterator<Item = (usize, f64)> + Clone,
    temperature: f64,
    scale: &ScoreScale,
    self_match: impl Fn(usize) -> f64,
) -> f64 {
    excess(evidence, temperature, scale, self_match) * counted.touches - counted.loss
}

/// Mean excess (ln per touch) of the self-match scores over the typical one, weighted by the
/// objects' evidence.
fn excess(
    evidence: impl Iterator<Item = (usize, f64)> + Clone,
    temperature: f64,
    scale: &ScoreScale,
    self_match: impl Fn(usize) -> f64,
) -> f64 {
    let best = evidence.clone().map(|(_, log)| log).fold(f64::NEG_INFINITY, f64::max);
    let (mut sum, mut total) = (0.0, 0.0);
    for (object, log) in evidence {
        let weight = ((log - best) / temperature).exp();
        if weight >= LEAST {
            sum += weight * (self_match(object) - scale.self_match);
            total += weight;
        }
    }
    if total > 0.0 { scale.self_match_share * sum / total } else { 0.0 }
}

/// What touches without appearance, or without a normal either, lose (ln) under the objects in
/// question against presses with an image: the mean of `lost`, weighted by the objects' evidence.
/// The last term of equation R13.
pub(crate) fn lack(
    evidence: impl Iterator<Item = (usize, f64)> + Clone,
    temperature: f64,
    lost: impl Fn(usize) -> f64,
) -> f64 {
    let best = evidence.clone().map(|(_, log)| log).fold(f64::NEG_INFINITY, f64::max);
    let (mut sum, mut total) = (0.0, 0.0);
    for (object, log) in evidence {
        let weight = ((log - best) / temperature).exp();
        if weight >= LEAST {
            sum += weight * lost(object);
            total += weight;
        }
    }
    if total > 0.0 { sum / total } else { 0.0 }
}

/// Computes the self-match scores of all objects, in parallel, for beliefs with these options.
/// Without it the first session that needs them waits.
pub(crate) fn prepare(model: &SurfaceModel, options: &SurfaceOptions) {
    let options = &options.widened(model.calibration.width);
    let kernel = Kernel::new(options);
    let find = |map: &SurfaceMap| self_match(map, &model.space, &kernel, options, Says::All);
    (0..model.maps().len()).into_par_iter().for_each(|index| {
        model.self_match(index, Says::All as usize, find);
    });
}

/// Mean score (ln) of the object's own patches under its true pose, each without itself, by touches
/// that say this much.
///
/// Equation R12 of docs/recogniser.md.
pub(crate) fn self_match(
    map: &SurfaceMap,
    space: &AppearanceSpace,
    kernel: &Kernel,
    options: &SurfaceOptions,
    says: Says,
) -> f32 {
    let point = match says {
        Says::All => None,
        Says::Normal => Some(PointDeviations { position: 0.0, normal: Some(0.0) }),
        Says::Position => Some(PointDeviations { position: 0.0, normal: None }),
    };
    let patches = map.patches();
    let n = SAMPLES.min(patches.len());
    let pose = InversePose::new(Quat::IDENTITY, glam::Vec3::ZERO);
    let score = |sample: usize| {
        let index = sample * patches.len() / n;
        let whole = Touch::of_patch(&patches[index]);
        let touch = match point {
            None => whole,
            Some(_) => Touch { elongation: 0.0, point, ..whole },
        };
        let observation = Observation::new(&touch, DVec3::ZERO, space, &options.scale);
        kernel.score_without(map, &pose, &observation, index)
    };
    (0..n).map(score).sum::<f32>() / n.max(1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::EvidenceCalibration;
    use crate::test_support::{map_of, model_of, places, space};

    #[test]
    fn the_excess_is_weighed_by_the_evidence() {
        let usual = |object: usize| [14.0, 10.0, f64::NAN][object];
        let scale = SurfaceOptions::default().score;
        let excess = |logs: [f64; 3]| excess(logs.into_iter().enumerate(), 2.0, &scale, usual);
        // A dominant object, 2 above the typical score: 0.8 · 2; the third is too unlikely to
        // count.
        assert!((excess([50.0, 0.0, 0.0]) - 1.6).abs() < 1e-9);
        // Equally likely with another 2 below the typical score: no excess.
        assert!(excess([50.0, 50.0, 0.0]).abs() < 1e-9);
        // 2 ln 3 less at a temperature of 2 is a third: 0.8 · (2 − 2/3)/(4/3).
        let third = excess([50.0, 50.0 - 2.0 * 3f64.ln(), 0.0]);
        assert!((third - 0.8).abs() < 1e-9, "{third}");
    }

    #[test]
    fn unsteady_touches_spare_none_of_these() {
        let scale = SurfaceOptions::default().score;
        let correction = |touches, loss| {
            let counted = Counted { touches, loss, lacking: [0.0; 2] };
            correction(counted, [(0, 50.0)].into_iter(), 2.0, &scale, |_| 14.0)
        };
        assert!((correction(3.0, 0.0) - 4.8).abs() < 1e-9);
        assert!((correction(3.0, 2.5) - 2.3).abs() < 1e-9);
    }

    #[test]
    fn a_map_explains_its_own_touches_by_the_others() {
        let options = SurfaceOptions::default();
        let kernel = Kernel::new(&options);
        let score =
            |n: usize| self_match(&map_of(&places(n, 0)), &space(), &kernel, &options, Says::All);
        // A single patch has no other: only the share of outliers, 1 %, remains.
        assert!((score(1) - 0.01f32.ln()).abs() < 1e-5);
        assert!((6.0..14.0).contains(&score(500)), "{}", score(500));
    }

    #[test]
    fn a_score_is_found_once_for_each_width() {
        let model = model_of(&[places(20, 0)]);
        let [first, second] = [3.0, 4.0].map(|score| model.self_match(0, 0, |_| score));
        assert!((first - second).abs() < 1e-9, "found once");
        let wider = EvidenceCalibration { width: 2.0, ..model.calibration };
        let wider = SurfaceModel::clone(&model).with_calibration(wider);
        assert!((wider.self_match(0, 0, |_| 4.0) - 4.0).abs() < 1e-9);
        let alike = model_of(&[places(20, 0)]);
        assert_eq!(model, alike, "knowing it is no difference");
    }
}
