//! How well an object's map explains touches of its own: what "none of these" is held against.
//!
//! A small object, or one that looks like no other, explains its touches far better than a
//! large plain one; an object that is not in the catalogue and merely resembles it explains
//! them worse than usual. Measured on the map itself, each touch without its own patch.

use glam::{DVec3, Quat, Vec3};
use rayon::prelude::*;

use super::options::SurfaceOptions;
use super::score::Kernel;
use super::sighting::Sighting;
use super::turned::Turned;
use crate::model::SurfaceModel;
use crate::surface::appearance::unstored;
use crate::surface::{AppearanceSpace, SurfaceMap, Touch};

/// So many touches of a map say how well it usually explains its own.
const SAMPLES: usize = 48;

/// How well most maps explain a touch of their own, ln.
const MOST: f64 = 12.0;

/// The part of what an object explains better than most that counts for "none of these".
const SHARE: f64 = 0.8;

/// Objects less likely than this, beside the best, have no say.
const LEAST: f64 = 0.01;

/// The touches that evidence is of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Counted {
    /// How many there are, by what they count.
    pub(super) touches: f64,
    /// How much less well (ln) any object explains them since sensors stood unsteadily, or are
    /// loosely placed.
    pub(super) unsteadiness: f64,
}

/// How much better (ln) "none of these" explains touches than it does beside an object that
/// explains its own as well as most: more where the touches look like an object that should
/// explain them better, less where they would look unlikely of any.
pub(super) fn unusual(
    counted: Counted,
    evidence: impl Iterator<Item = (usize, f64)> + Clone,
    temperature: f64,
    usual_score: impl Fn(usize) -> f64,
) -> f64 {
    excess(evidence, temperature, usual_score) * counted.touches - counted.unsteadiness
}

/// How much better than [`MOST`] the objects that touches may be of explain their own, ln a
/// touch, in the mean over what their evidence (ln, with the object) says at a temperature.
fn excess(
    evidence: impl Iterator<Item = (usize, f64)> + Clone,
    temperature: f64,
    usual_score: impl Fn(usize) -> f64,
) -> f64 {
    let best = evidence.clone().map(|(_, log)| log).fold(f64::NEG_INFINITY, f64::max);
    let (mut sum, mut total) = (0.0, 0.0);
    for (object, log) in evidence {
        let weight = ((log - best) / temperature).exp();
        if weight >= LEAST {
            sum += weight * (usual_score(object) - MOST);
            total += weight;
        }
    }
    if total > 0.0 { SHARE * sum / total } else { 0.0 }
}

/// Finds how well each object usually explains its own touches, side by side, for
/// `SurfaceBelief`s with these options: else the first session that asks waits for it.
pub fn prepare(model: &SurfaceModel, options: &SurfaceOptions) {
    let kernel = Kernel::new(options);
    model.maps().par_iter().for_each(|map| {
        map.usual_score(|| usual_score(map, &model.space, &kernel, options));
    });
}

/// Mean score (ln) of touches of the object under its true pose.
pub(super) fn usual_score(
    map: &SurfaceMap,
    space: &AppearanceSpace,
    kernel: &Kernel,
    options: &SurfaceOptions,
) -> f32 {
    let patches = map.patches();
    let n = SAMPLES.min(patches.len());
    let pose = Turned::new(Quat::IDENTITY, Vec3::ZERO);
    let score = |sample: usize| {
        let index = sample * patches.len() / n;
        let patch = &patches[index];
        let touch = Touch {
            position: patch.position.as_dvec3(),
            normal: patch.normal.as_dvec3(),
            direction: patch.direction.as_dvec3(),
            elongation: f64::from(patch.elongation),
            evenness: 1.0,
            feature: unstored(&patch.feature),
        };
        let sighting = Sighting::new(&touch, DVec3::ZERO, space, &options.scale);
        kernel.score_without(map, &pose, &sighting, index)
    };
    (0..n).map(score).sum::<f32>() / n.max(1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::test_support::{map_of, places, space};

    #[test]
    fn the_excess_is_that_of_the_objects_that_it_may_be() {
        let usual = |object: usize| [14.0, 10.0, f64::NAN][object];
        let excess = |logs: [f64; 3]| excess(logs.into_iter().enumerate(), 2.0, usual);
        // Alone, 2 above most: 0.8 · 2; the third is too unlikely to be asked.
        assert!((excess([50.0, 0.0, 0.0]) - 1.6).abs() < 1e-9);
        // As likely as the other, 2 below most: nothing.
        assert!(excess([50.0, 50.0, 0.0]).abs() < 1e-9);
        // 2 ln 3 less at a temperature of 2 is a third: 0.8 · (2 − 2/3)/(4/3).
        let third = excess([50.0, 50.0 - 2.0 * 3f64.ln(), 0.0]);
        assert!((third - 0.8).abs() < 1e-9, "{third}");
    }

    #[test]
    fn none_of_these_is_held_to_what_each_touch_counts_and_spared_what_unsteady_ones_cost() {
        let unusual = |touches, unsteadiness| {
            let counted = Counted { touches, unsteadiness };
            unusual(counted, [(0, 50.0)].into_iter(), 2.0, |_| 14.0)
        };
        assert!((unusual(3.0, 0.0) - 4.8).abs() < 1e-9);
        assert!((unusual(3.0, 2.5) - 2.3).abs() < 1e-9);
    }

    #[test]
    fn a_map_explains_its_own_touches_by_the_others_and_remembers_how_well() {
        let options = SurfaceOptions::default();
        let kernel = Kernel::new(&options);
        let score = |n: usize| usual_score(&map_of(&places(n, 0)), &space(), &kernel, &options);
        // One patch has no other: what is left is the share of outliers, 1 %.
        assert!((score(1) - 0.01f32.ln()).abs() < 1e-5);
        assert!((6.0..14.0).contains(&score(500)), "{}", score(500));
        let map = map_of(&places(20, 0));
        let [first, second] = [3.0, 4.0].map(|score| map.usual_score(|| score));
        assert!((first - second).abs() < 1e-9, "found once");
        assert_eq!(map, map_of(&places(20, 0)), "knowing it is no difference");
    }
}
