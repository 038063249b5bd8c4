//! What a belief states: probabilities of the objects and of none of them, and poses.

use glam::DQuat;

use super::answer::{Share, distinct, scale, shares};
use super::hypothesis::Hypothesis;
use super::sighting::Sighting;
use super::usual::Counted;
use super::{HybridBelief, refine, usual};
use crate::belief::answer::{Answer, PoseMode};
use crate::belief::orbits::merge_orbits;
use crate::log_prob::{entropy_bits, normalize};
use crate::model::ObjectIdx;
use crate::pose::Pose;

/// Poses less probable than this are answered as they were when they lost: nobody moves by them.
const LIKELY_ENOUGH: f64 = 1e-3;

impl HybridBelief {
    /// The probability of each object, then of none of them.
    pub(super) fn probabilities(&self) -> Vec<f64> {
        if self.stage == 0 {
            let logs = self.log_prior.iter().map(|log| log + (1.0 - self.unknown).ln());
            return normalize(&logs.chain([self.unknown.ln()]).collect::<Vec<f64>>());
        }
        let stage = self.model.calibration.stage(self.stage);
        let known = (1.0 - self.unknown).ln() + (self.objects.len() as f64).ln();
        let both = self.objects.iter().zip(&self.log_prior);
        let untold = self.log_untold_motion();
        let logs = both
            .map(|(state, prior)| state.log_evidence / stage.temperature + untold + prior + known);
        let counted = self.counted().touches;
        let unknown = (stage.log_unknown(counted) + self.unusual()) / stage.temperature;
        normalize(&logs.chain([unknown + self.unknown.ln()]).collect::<Vec<f64>>())
    }

    /// What "none of these" is held against, once there are poses.
    fn unusual(&self) -> f64 {
        if self.stage < 3 {
            return 0.0;
        }
        let temperature = self.model.calibration.stage(3).temperature;
        let logs = self.objects.iter().map(|state| state.log_evidence).enumerate();
        usual::unusual(self.counted(), logs, temperature, |object| self.usual_score(object))
    }

    /// How well an object usually explains its own touches, ln a touch.
    pub(super) fn usual_score(&self, object: usize) -> f64 {
        let (map, space) = (&self.model.maps()[object], &self.model.space);
        let find = || usual::usual_score(map, space, &self.kernel, &self.options);
        f64::from(map.usual_score(find))
    }

    /// The touches, by what they count and how unsteady and loosely placed they are.
    pub(super) fn counted(&self) -> Counted {
        let counts = |touch: &Sighting| f64::from(touch.counts(!self.is_restless));
        let loss = |touch| counts(touch) * f64::from(touch.loss(!self.is_restless));
        let touches = self.touches.iter().map(counts).sum();
        Counted { touches, unsteadiness: self.touches.iter().map(loss).sum() }
    }

    /// How many touches there are, by what they count.
    pub(super) fn n_counted(&self) -> f64 {
        self.touches.iter().map(|touch| f64::from(touch.weight)).sum()
    }

    /// The belief as an answer with at most `n_modes` poses. Poses that look alike by the
    /// object's symmetry are one.
    #[must_use]
    pub fn answer(&self, n_modes: usize) -> Answer {
        let mut probabilities = self.probabilities();
        let entropy_bits = entropy_bits(&probabilities);
        let unknown = probabilities.pop().unwrap_or(0.0);
        let mut poses = Vec::new();
        for (object, state) in self.objects.iter().enumerate() {
            let symmetry = self.model.maps()[object].symmetry();
            poses.extend(shares(
                object,
                probabilities[object],
                &state.hypotheses,
                symmetry,
                n_modes,
            ));
        }
        let poses = distinct(poses, self.model.maps(), n_modes, &self.options);
        let mode = |Share { share: weight, object, hypothesis }: Share| {
            let map = &self.model.maps()[object];
            let mut refined = hypothesis;
            if self.touches.len() > 2 && weight > LIKELY_ENOUGH {
                refine::refine(&mut refined, map, &self.touches, &self.kernel, &self.options);
            }
            let (kernel, options) = (&self.kernel, &self.options);
            PoseMode {
                object: ObjectIdx(object as u32),
                session_from_object: self.session_from_object(&refined),
                covariance: refine::covariance(&refined, map, &self.touches, kernel, options)
                    + self.objects[object].carried.covariance(self.touches.len()),
                weight,
            }
        };
        let modes = poses.into_iter().map(mode).collect();
        let symmetry = |object: ObjectIdx| self.model.maps()[object.0 as usize].symmetry();
        let modes = merge_orbits(modes, symmetry, &scale(&self.options));
        Answer { probabilities, unknown, modes, entropy_bits, n_readings: self.n_readings }
    }

    pub(super) fn session_from_object(&self, hypothesis: &Hypothesis) -> Pose {
        let rotation = DQuat::from_array(hypothesis.rotation.to_array().map(f64::from));
        Pose::from_parts(rotation, self.anchor + hypothesis.translation.as_dvec3())
    }
}
