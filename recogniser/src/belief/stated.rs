//! What a belief states: probabilities of the objects and of none of them, and poses.

use glam::DQuat;

use super::answer::{Share, distinct, scale, shares};
use super::hypothesis::Hypothesis;
use super::sighting::Sighting;
use super::usual::Counted;
use super::{SurfaceBelief, refine, usual};
use palpate_core::belief::answer::{Answer, PoseMode};
use palpate_core::belief::orbits::merge_orbits;
use palpate_core::log_prob::{entropy_bits, normalize};
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;

/// Poses less probable than this are answered as they were when they lost: nobody moves by them.
const LIKELY_ENOUGH: f64 = 1e-3;

impl SurfaceBelief {
    /// The probability of each object, then of none of them, whether it rests or moves: the prior
    /// times the evidence, which is of each object by itself. How many objects there are changes
    /// the odds of none of them as little before a touch as after it.
    pub(super) fn probabilities(&self) -> Vec<f64> {
        let mut joint = self.joint().into_iter();
        let mut all = joint.next().unwrap_or_default();
        for moving in joint {
            all.iter_mut().zip(moving).for_each(|(sum, p)| *sum += p);
        }
        all
    }

    /// The same as if this were the only belief.
    pub(super) fn own_probabilities(&self) -> Vec<f64> {
        normalize(&self.logs())
    }

    /// The probability of each object, then of none of them, in each of the beliefs.
    pub(super) fn joint(&self) -> Vec<Vec<f64>> {
        let both = self.beliefs().zip(self.log_shares());
        let logs =
            both.flat_map(|(belief, share)| belief.logs().into_iter().map(move |log| log + share));
        let all = normalize(&logs.collect::<Vec<f64>>());
        all.chunks(self.objects.len() + 1).map(<[f64]>::to_vec).collect()
    }

    /// ln of how probable each object is, then none of them, but for a common number.
    fn logs(&self) -> Vec<f64> {
        if self.stage == 0 {
            let logs = self.log_prior.iter().map(|log| log + (1.0 - self.unknown).ln());
            return logs.chain([self.unknown.ln()]).collect();
        }
        let stage = self.model.calibration.stage(self.stage);
        let known = (1.0 - self.unknown).ln();
        let logs =
            self.objects.iter().zip(&self.log_prior).enumerate().map(|(n, (state, prior))| {
                (state.log_evidence + self.log_faded(n)) / stage.temperature + prior + known
            });
        let counted = self.counted().touches;
        let unknown = (stage.log_unknown(counted) + self.unusual()) / stage.temperature;
        logs.chain([unknown + self.unknown.ln()]).collect()
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
        for (belief, (of, joint)) in self.beliefs().zip(self.joint()).enumerate() {
            for (object, state) in of.objects.iter().enumerate() {
                let symmetry = self.model.maps()[object].symmetry();
                let (place, hypotheses) = ([belief, object], &state.hypotheses);
                poses.extend(shares(place, joint[object], hypotheses, symmetry, n_modes));
            }
        }
        let poses = distinct(poses, self.model.maps(), n_modes, &self.options);
        let mode = |Share { share: weight, belief, object, hypothesis }: Share| {
            let of = self.beliefs().nth(belief).unwrap_or(self);
            let (touches, kernel, options) = (&of.touches, &of.kernel, &of.options);
            let map = &self.model.maps()[object];
            let mut refined = hypothesis;
            if touches.len() > 2 && weight > LIKELY_ENOUGH {
                refine::refine(&mut refined, map, touches, kernel, options);
            }
            PoseMode {
                object: ObjectIdx(object as u32),
                session_from_object: self.session_from_object(&refined),
                covariance: refine::covariance(&refined, map, touches, kernel, options)
                    + of.objects[object].carried.covariance(touches.len()),
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
