//! Object motion: one announced move, announced drift between touches, or unannounced drift.
//!
//! Unannounced drift is a hypothesis beside rest. Once the best explanation at rest is poor, three
//! beliefs start that assume drift of one amplitude each and take every reading. The answer is
//! their mixture with rest, weighed by evidence and prior. Rest always stays in the mixture;
//! drift is dropped when rest explains the touches well and drift is improbable. The weight of
//! "none of these" is unchanged, because drift explains the touches of unknown objects too.

use super::carried::{self, Carried};
use super::evidence::{Evidence, Known};
use super::hypothesis::{Hypothesis, merge};
use super::placement::HALF;
use super::{ObjectState, SurfaceBelief, for_each_object, is_impossible};
use palpate_core::reading::Looseness;

/// What is known rules no object out for good when it is carried over; a prior of zero does.
const SURE: f64 = 1e-12;

/// Amplitudes of unannounced drift. Chosen: a factor of about four apart, they span 1 to 10 mm.
pub(super) const AMPLITUDES: usize = 3;

/// The prior of unannounced drift, shared evenly by its amplitudes. Chosen: fixtures seldom fail.
const UNTOLD_SHARE: f64 = 0.02;

/// Touches from which motion can be told from rest: three fix a pose. Derived.
const TOUCHES_MIN: usize = 4;

/// Objects of which a belief that does not lead proposes poses, likeliest first. Chosen: bounds
/// its cost.
pub(super) const OBJECTS_MAX: usize = 16;

/// Beliefs that share the budget of hypotheses: rest and each amplitude.
const BUDGET_PART: usize = AMPLITUDES + 1;

/// Drift less probable than this is dropped while rest explains the touches well. Chosen: it
/// then changes no stated probability by more than a thousandth.
const NEGLIGIBLE: f64 = 1e-3;

impl SurfaceBelief {
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
        for (log_prior, p) in self.log_prior.iter_mut().zip(probabilities) {
            if !is_impossible(*log_prior) {
                *log_prior = share(p);
            }
        }
        self.set_at_rest();
        for state in &mut self.objects {
            state.carried = Carried::of(&state.hypotheses, motion);
            state.hypotheses.truncate(carried::POSES_MAX);
            let best = state.hypotheses.first().map_or(0.0, |best| best.score);
            state.hypotheses.iter_mut().for_each(|hypothesis| hypothesis.score -= best);
            state.forget_evidence();
        }
        self.witness_motion();
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
        for_each_object(objects, evidence.maps, evidence.stop, |state, map| {
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

    /// Begins to believe, beside rest, that the object moves when rest explains its touches
    /// poorly, and gives motion up when rest explains them well and is all but sure.
    pub(super) fn doubt_rest(&mut self) {
        let is_told = self.options.motion.is_some();
        if is_told || self.stage < 3 || self.touches.len() < TOUCHES_MIN {
            return;
        }
        let is_poor = self.is_poor();
        if is_poor && self.moving.is_empty() {
            let partners = self.options.budget.partners_if_poor;
            let mut all = self.all_moving();
            for moving in &mut all {
                moving.judge_anew();
                moving.propose_of_likeliest(OBJECTS_MAX, partners);
                moving.refine();
                moving.weigh();
                moving.bound();
            }
            self.moving = all;
        } else if !is_poor && !self.moving.is_empty() {
            let moves: f64 = self.joint().iter().skip(1).map(|row| known(row)).sum();
            if moves < NEGLIGIBLE {
                self.moving = Vec::new();
            }
        }
    }

    /// What would be believed by the touches so far if the object moved, by each amplitude; poses
    /// are those at rest, not judged anew.
    pub(super) fn all_moving(&self) -> Vec<Self> {
        let moving = |motion| {
            let mut moving = Self { moving: Vec::new(), ..self.clone() };
            moving.set_restless(motion);
            moving
        };
        self.amplitudes().into_iter().map(moving).collect()
    }

    /// How far an object may move untold: from where motion differs from a touch's own deviation
    /// to where a touch halves what the one before it said, and the middle of both (ln). Turns
    /// carry the rim of a usual object of the catalogue as far.
    fn amplitudes(&self) -> [Looseness; AMPLITUDES] {
        let mut radii: Vec<f32> = self.model.maps().iter().map(|map| map.radius()).collect();
        radii.sort_unstable_by(f32::total_cmp);
        let usual = radii.get(radii.len() / 2).copied().unwrap_or_default().max(HALF);
        let (least, most) = (self.options.scale.across, HALF);
        [least, (least * most).sqrt(), most].map(|position| Looseness {
            position: f64::from(position),
            angle: f64::from(position / usual),
        })
    }

    /// This belief, and those of an object that moves.
    pub(super) fn beliefs(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(&self.moving)
    }

    /// ln of how probable each of the beliefs is before the touches.
    pub(super) fn log_shares(&self) -> impl Iterator<Item = f64> + use<> {
        let n = self.moving.len();
        let rests = if n == 0 { 0.0 } else { (1.0 - UNTOLD_SHARE).ln() };
        let moves = (UNTOLD_SHARE / n.max(1) as f64).ln();
        std::iter::once(rests).chain(std::iter::repeat_n(moves, n))
    }

    /// Which of the beliefs of a moving object is likelier than any other; `None` when it rests.
    pub(super) fn leader_index(&self) -> Option<usize> {
        if self.moving.is_empty() {
            return None;
        }
        let joint = self.joint();
        let best = joint.iter().skip(1).map(|row| known(row)).enumerate();
        let best = best.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        best.filter(|(_, share)| *share > known(&joint[0])).map(|(index, _)| index)
    }

    /// The likeliest of the beliefs.
    pub(super) fn leader(&self) -> &Self {
        self.leader_index().map_or(self, |index| &self.moving[index])
    }

    /// What touches of an object of which no pose is known say (ln) as far as the motion took
    /// their weight: that they are about it, not anywhere in the workspace.
    pub(super) fn log_faded(&self, object: usize) -> f64 {
        if !self.is_restless {
            return 0.0;
        }
        let faded = self.counted().touches - self.n_counted();
        let radius = f64::from(self.model.maps()[object].radius().max(HALF));
        let about = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
        faded * (f64::from(self.options.scale.workspace) / about).ln().max(0.0)
    }

    /// What it did unasked is settled with the touches that said so: it is where the likeliest of
    /// the beliefs has it, and whether it goes on is asked of those to come.
    fn set_at_rest(&mut self) {
        if let Some(index) = self.leader_index() {
            self.objects = std::mem::take(&mut self.moving[index].objects);
        }
        self.moving = Vec::new();
    }

    /// The object moves though nobody said so.
    fn set_restless(&mut self, motion: Looseness) {
        self.is_restless = true;
        self.options.motion = Some(motion);
        self.options.budget.total /= BUDGET_PART;
        self.age();
    }
}

/// The probability that it is any of the known objects, in one belief.
fn known(row: &[f64]) -> f64 {
    row.split_last().map_or(0.0, |(_, known)| known.iter().sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::SurfaceOptions;
    use crate::belief::test_support::{belief_over, places, seen, some_pose};
    use palpate_core::units::MM;

    const MOTION: Looseness = Looseness { position: 8.0 / 3.0 * MM, angle: 0.06 };

    /// After four touches of the first of two objects, with no pose known.
    fn touched() -> SurfaceBelief {
        let objects = [places(200, 0), places(200, 1)];
        let mut belief = belief_over(&objects, SurfaceOptions::default());
        belief.touches =
            [5, 50, 90, 120].map(|touch| seen(&objects[0][touch], &some_pose(3))).to_vec();
        belief.stage = 3;
        belief
    }

    #[test]
    fn after_a_told_motion_what_was_untold_before_is_not_held_against_the_object_again() {
        let mut belief = touched();
        belief.moving = belief.all_moving();
        let known = belief.probabilities()[0];
        belief.loosen(&MOTION);
        assert!((belief.probabilities()[0] - known).abs() < 1e-9);
        assert_eq!((belief.moving.len(), belief.options.motion), (0, None));
        // A motion that the session was told of from the beginning goes on.
        belief.options.motion = Some(MOTION);
        belief.touches = vec![seen(&places(200, 0)[5], &some_pose(3))];
        belief.loosen(&MOTION);
        assert_eq!(belief.options.motion, Some(MOTION));
    }

    #[test]
    fn rest_and_motion_are_weighed_by_their_evidence_and_either_may_lead() {
        let mut belief = touched();
        belief.moving = belief.all_moving();
        let shares: Vec<f64> = belief.log_shares().map(f64::exp).collect();
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12 && shares.len() == 4);
        assert!(belief.leader_index().is_none(), "nothing says that it moves");
        let temperature = belief.model.calibration.stage(3).temperature;
        let explain = |belief: &mut SurfaceBelief, log: f64| {
            belief.objects.iter_mut().for_each(|state| state.log_evidence = log);
        };
        explain(&mut belief.moving[1], 20.0 * temperature);
        assert_eq!(belief.leader_index(), Some(1));
        let sum: f64 = belief.probabilities().iter().sum();
        assert!((sum - 1.0).abs() < 1e-9);
        // It goes back: 20 at rest and 20 in motion differ by how seldom objects move, and by
        // what touches are taken to say that motion took the weight of.
        explain(&mut belief, 40.0 * temperature);
        assert_eq!(belief.leader_index(), None);
    }

    #[test]
    fn motion_is_dropped_when_rest_is_all_but_sure_and_explains_the_touches_well() {
        let mut belief = touched();
        belief.doubt_rest();
        assert_eq!(belief.moving.len(), AMPLITUDES, "no pose explains the touches");
        let (rotation, translation) = crate::belief::test_support::single(&some_pose(3));
        let score = 100.0;
        belief.objects[0].hypotheses = vec![Hypothesis { rotation, translation, score }];
        belief.doubt_rest();
        assert_eq!(belief.moving.len(), AMPLITUDES, "well explained, but not yet sure");
        belief.weigh();
        belief.moving.iter_mut().flat_map(|m| &mut m.objects).for_each(|o| o.log_evidence = 0.0);
        belief.doubt_rest();
        assert!(belief.moving.is_empty());
    }

    #[test]
    fn amplitudes_reach_from_a_touchs_deviation_to_what_halves_the_one_before() {
        let amplitudes = touched().amplitudes().map(|motion| motion.position / MM);
        let expected = [0.7, 7f64.sqrt(), 10.0];
        assert!(amplitudes.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4));
        // Half axes of 40, 30 and 20 mm: the rim of a turn by 10 mm is 40 mm away.
        let turn = touched().amplitudes()[2].angle;
        assert!((turn - 0.25).abs() < 0.02, "{turn}");
    }
}
