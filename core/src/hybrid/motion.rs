//! An object that moves: once, as a client says; a little between any two touches, as a session
//! is told; or so, though nobody said it.
//!
//! What nobody said is tried when even the best explanation is poor: that the object moves
//! between touches by about as much as section 4.4.2.4 perturbs it is held against that it
//! rests. Which object it is and where it is now are then answered as of one that moves. "None of
//! these" keeps its weight: an object that moves explains touches of an unknown one as well.

use super::carried::{self, Carried};
use super::evidence::{Evidence, Known};
use super::hypothesis::{Hypothesis, merge};
use super::{HybridBelief, HybridOptions, ObjectState, PairEvidence, for_each_object};
use crate::log_prob::log_sum_exp;
use crate::reading::Looseness;
use crate::units::{DEG, MM};

/// No object is ruled out for good when what is known is carried over.
const SURE: f64 = 1e-12;

/// How far an object moves between touches when nobody said that it does: up to 8 mm and 10°, a
/// length drawn evenly up to its maximum, as deviations along and about each axis.
const UNTOLD: Looseness = Looseness { position: 8.0 / 3.0 * MM, angle: 10.0 / 3.0 * DEG };

/// The share of sessions in which it does.
const UNTOLD_SHARE: f64 = 0.02;

/// Touches from which motion can be told from rest.
const TOUCHES_MIN: usize = 4;

/// So many objects, the likeliest ones, are asked whether they move.
const OBJECTS_MAX: usize = 16;

/// What a touch of an object says (ln) of which no pose is known: what an earlier touch is taken
/// to have said as far as the motion took its weight.
const ANYWHERE_ON_IT: f64 = 5.0;

impl HybridBelief {
    /// The object may have moved since the last touch, by deviations of `motion`: which one it
    /// is stays as probable, its pose becomes loose by so much.
    pub fn loosen(&mut self, motion: &Looseness) {
        if self.touches.is_empty() {
            self.witness_motion();
            self.objects.iter_mut().for_each(|state| state.carried.loosen(motion));
            return;
        }
        let mut probabilities = self.probabilities();
        self.unknown = probabilities.pop().unwrap_or(0.0).clamp(SURE, 1.0 - SURE);
        let known: f64 = probabilities.iter().sum();
        let share = |p: f64| (p / known.max(f64::MIN_POSITIVE)).max(SURE).ln();
        self.log_prior = probabilities.into_iter().map(share).collect();
        for state in &mut self.objects {
            state.carried = Carried::of(&state.hypotheses, motion);
            state.hypotheses.truncate(carried::POSES_MAX);
            let best = state.hypotheses.first().map_or(0.0, |best| best.score);
            state.hypotheses.iter_mut().for_each(|hypothesis| hypothesis.score -= best);
            (state.log_evidence, state.standing) = (0.0, 0.0);
            state.pair = PairEvidence::default();
        }
        self.witness_motion();
        self.set_at_rest();
        self.stage = 0;
    }

    /// Takes note of a motion: what was touched before it is elsewhere now.
    pub(super) fn witness_motion(&mut self) {
        if self.touches.is_empty() {
            self.misses.clear();
        } else {
            self.may_have_moved = true;
            self.touches.clear();
            self.patterns.clear();
        }
    }

    /// Lays the poses of before a motion onto the touches since.
    pub(super) fn follow(&mut self) {
        self.judge_by_all(|evidence, hypothesis, known| evidence.settle(hypothesis, known));
    }

    /// Every touch scores every hypothesis: what each says changes as the object moves.
    pub(super) fn judge_anew(&mut self) {
        self.judge_by_all(|_, _, _| ());
        self.weigh();
    }

    /// Scores every hypothesis by all touches, and does with it what is to be done `then`.
    fn judge_by_all(
        &mut self,
        then: impl Fn(&Evidence<'_>, &mut Hypothesis, Known<'_>) + Sync + Send,
    ) {
        let (objects, evidence) = self.parts();
        for_each_object(objects, evidence.maps, |state, map| {
            let ObjectState { hypotheses, carried, .. } = state;
            let known = Known { map, carried };
            for hypothesis in &mut *hypotheses {
                let score = evidence.score(known, &hypothesis.pose(), f32::NEG_INFINITY);
                hypothesis.score = score.unwrap_or(f32::NEG_INFINITY);
                then(&evidence, hypothesis, known);
            }
            merge(hypotheses, evidence.options);
        });
    }

    /// An object that moves between touches has moved before the newest one: what was felt and
    /// what was free before says less of where it is.
    pub(super) fn age(&mut self) {
        let Some(motion) = self.options.motion else { return };
        let n = self.touches.len();
        for (index, touch) in self.touches.iter_mut().enumerate() {
            touch.age(n - 1 - index, &motion);
        }
        self.patterns.iter_mut().for_each(|pattern| pattern.age(n, &motion));
    }

    /// Takes the object to move from now on if its touches say so, and nobody has.
    pub(super) fn doubt_rest(&mut self) {
        let n = self.touches.len();
        if self.options.motion.is_some() || self.stage < 3 || n < TOUCHES_MIN || !self.is_poor() {
            return;
        }
        let mut moving = self.clone();
        moving.set_restless();
        moving.judge_anew();
        moving.propose_of_likeliest(OBJECTS_MAX);
        moving.refine();
        moving.weigh();
        let gain = moving.log_evidence() - self.log_evidence();
        let temperature = self.model.calibration.stage(3).temperature;
        if gain / temperature + moving.log_untold_motion() > 0.0 {
            *self = moving;
        }
    }

    /// What is added to the evidence of objects that move untold, beside that of "none of these":
    /// how seldom they do, and what touches are taken to say as far as the motion took their
    /// weight.
    pub(super) fn log_untold_motion(&self) -> f64 {
        if !self.is_restless {
            return 0.0;
        }
        let faded = self.counted().touches - self.n_counted();
        let temperature = self.model.calibration.stage(3).temperature;
        ANYWHERE_ON_IT * faded / temperature + (UNTOLD_SHARE / (1.0 - UNTOLD_SHARE)).ln()
    }

    /// What it did unasked is settled with the touches that said so: whether it goes on is asked
    /// of those to come.
    fn set_at_rest(&mut self) {
        if self.is_restless {
            self.is_restless = false;
            self.options.motion = None;
        }
    }

    /// The object moves though nobody said so.
    pub(super) fn set_restless(&mut self) {
        self.is_restless = true;
        self.options = HybridOptions { motion: Some(UNTOLD), ..self.options };
        self.age();
    }

    /// ln evidence that it is one of the known objects.
    fn log_evidence(&self) -> f64 {
        let both = self.objects.iter().zip(&self.log_prior);
        log_sum_exp(both.map(|(state, prior)| state.log_evidence + prior))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hybrid::test_support::{belief_over, places, seen, some_pose};

    #[test]
    fn after_a_told_motion_what_was_untold_before_is_not_held_against_the_object_again() {
        let places = places(200, 0);
        let mut belief = belief_over(std::slice::from_ref(&places), HybridOptions::default());
        belief.touches = [5, 50, 90, 120].map(|touch| seen(&places[touch], &some_pose(3))).to_vec();
        belief.stage = 3;
        belief.set_restless();
        let known = belief.probabilities()[0];
        belief.loosen(&UNTOLD);
        assert!((belief.probabilities()[0] - known).abs() < 1e-9);
        assert_eq!((belief.is_restless, belief.options.motion), (false, None));
        // A motion that the session was told of from the beginning goes on.
        belief.options.motion = Some(UNTOLD);
        belief.touches = vec![seen(&places[5], &some_pose(3))];
        belief.loosen(&UNTOLD);
        assert_eq!(belief.options.motion, Some(UNTOLD));
    }
}
