//! A component of the belief: the state after the readings under one model of the object's motion.
//!
//! [`Component::add`] is the algorithm: observe, propose, verify, refine, weigh.

use palpate_core::log_prob::log_sum_exp;
use palpate_core::reading::Looseness;

use super::common::Common;
use super::first_touch::weigh_appearance;
use super::motion::Motion;
use super::object::{ObjectBelief, n_searched, searched};
use super::places::{NEGLIGIBLE, Places};
use super::positions::{self, propose_by_positions};
use super::posterior::{Explained, n_weighed, posterior};
use super::retrieval::{n_candidates, retrieval_bar, retrieve};
use super::search::{
    Scope, add_scores, best_explanation, best_to_refine, bound, evidence_bar, merge_all,
    propose_poses, score_anew, settle_chosen,
};
use super::stage::Stage;
use crate::model::joint_pairs::TOUCHES_PER_OBJECT;
use crate::observe::inverse_pose::InversePose;
use crate::observe::observation::{Observation, Says};
use crate::observe::press_space::PressSpace;
use crate::propose::partners::{Partner, in_turn, partners};
use crate::refine::likeness::look_alike;
use crate::refine::settle::settle;
use crate::verify::evidence::Known;
use crate::verify::hypothesis::Hypothesis;
use stating::Stating;

/// Probability above which a pose is likelier than not.
const LIKELY: f64 = 0.5;

/// Deviation of the normal (rad) above which a touch proposes no poses once existing ones
/// explain the touches.
const UNSTEADY: f32 = 0.3;

/// Places from which a certain pose ends the search.
const CERTAIN_FROM: usize = 4;

/// Cap on the objects that get proposals from a component that does not lead, likeliest first;
/// it bounds the cost.
const OBJECTS_MAX: usize = 16;

/// Divisor of the hypothesis budget for a drifting component: rest and three amplitudes share it.
const BUDGET_PART: usize = 4;

/// Observations from one reading.
#[derive(Clone, Debug)]
pub(super) struct Observed {
    /// The touch; `None` when the press met nothing.
    pub(super) touch: Option<Observation>,
    /// The space of the press, after that of misses before there was an anchor.
    pub(super) spaces: Vec<PressSpace>,
}

/// State after the readings under one model of motion.
#[derive(Clone, Debug)]
pub(super) struct Component {
    motion: Motion,
    stage: Stage,
    places: Places,
    touches: Vec<Observation>,
    /// Spaces of all presses.
    spaces: Vec<PressSpace>,
    objects: Vec<ObjectBelief>,
    /// What the session states about the pose, while it holds.
    stated: Option<Stating>,
}

impl Component {
    /// The component before any reading.
    pub(super) fn new(motion: Motion, common: &Common) -> Self {
        let (touches, spaces) = (Vec::new(), Vec::new());
        let (objects, stated) = (common.objects(), None);
        let (stage, places) = (Stage::Prior, Places::default());
        Self { motion, stage, places, touches, spaces, objects, stated }
    }

    /// Adds a reading. A component that `leads` searches in full, the others with a small budget.
    pub(super) fn add(&mut self, common: &Common, observed: &Observed, leads: bool) {
        self.observe(observed);
        if observed.touch.is_none() {
            self.verify_miss(common);
            return;
        }
        let n = self.touches.len();
        match n {
            1 => {
                self.weigh_appearance(common);
                self.places = Places::first(self.stage, &self.objects);
                self.follow(common);
                self.propose_stated(common);
            }
            2 => {
                self.follow(common);
                self.propose_by_first_pair(common);
                self.propose_stated(common);
                self.weigh_first_pair(common);
            }
            _ => {
                self.verify(common);
                let asked_first = self.weigh_another_pair(common);
                // A place that was felt before proposes nothing new.
                if f64::from(self.touches[n - 1].novelty) >= NEGLIGIBLE {
                    self.propose_in_doubt(common, leads, asked_first);
                    self.refine(common);
                    self.weigh(common);
                }
            }
        }
        self.bound(common);
    }

    /// Adds the observations of a reading without any search.
    pub(super) fn observe(&mut self, observed: &Observed) {
        self.spaces.extend(observed.spaces.iter().cloned());
        if let Some(touch) = &observed.touch {
            self.touches.push(touch.clone());
            self.discount();
        }
    }

    /// Discounts earlier observations: an object that drifts has moved before the newest touch.
    fn discount(&mut self) {
        let Some(drift) = self.motion.drift() else { return };
        let n = self.touches.len();
        for (index, touch) in self.touches.iter_mut().enumerate() {
            touch.discount(n - 1 - index, drift);
        }
        self.spaces.iter_mut().for_each(|space| space.discount(n, drift));
        self.restate();
    }

    /// A copy with the observations so far under a drifting object; its poses are those of this
    /// component and keep their scores.
    pub(super) fn drifting(&self, drift: Looseness) -> Self {
        let mut drifting = Self { motion: Motion::Unannounced(drift), ..self.clone() };
        drifting.discount();
        drifting
    }

    /// Searches as a drifting component does when it starts.
    pub(super) fn start(&mut self, common: &Common) {
        self.score_anew(common);
        self.propose_for_likeliest(common, common.options.budget.partners_if_poor);
        self.refine(common);
        self.weigh(common);
        self.bound(common);
    }

    /// Scores every hypothesis by the space of a press that met nothing.
    fn verify_miss(&mut self, common: &Common) {
        if self.touches.is_empty() {
            return;
        }
        let evidence = common.evidence(&self.touches, &self.spaces);
        let press = |known: Known<'_>, pose: &InversePose| evidence.newest_press(known.map, pose);
        add_scores(&mut self.objects, &evidence, press);
        if self.stage == Stage::Poses {
            self.weigh(common);
        }
    }

    /// The evidence of one touch, unless it lacks appearance.
    fn weigh_appearance(&mut self, common: &Common) {
        if self.touches[0].says != Says::All {
            return;
        }
        self.stage = Stage::Appearance;
        let patches_max = if common.model.is_large() { TOUCHES_PER_OBJECT } else { usize::MAX };
        let evidence = common.evidence(&self.touches, &self.spaces);
        weigh_appearance(&mut self.objects, &evidence, patches_max);
        self.weigh_stated(common, 1.0);
    }

    /// Lays the poses of before a move onto the touches since.
    fn follow(&mut self, common: &Common) {
        let evidence = common.evidence(&self.touches, &self.spaces);
        score_anew(&mut self.objects, &evidence, |hypothesis, known| {
            settle(&evidence, hypothesis, known);
        });
    }

    /// Scores every hypothesis by the newest touch or, if the object drifts, by all touches,
    /// since the weight of each then changes with every touch.
    fn verify(&mut self, common: &Common) {
        if self.motion.drift().is_some() {
            self.score_anew(common);
        } else {
            let evidence = common.evidence(&self.touches, &self.spaces);
            let newest = |known: Known<'_>, pose: &InversePose| evidence.newest(known.map, pose);
            add_scores(&mut self.objects, &evidence, newest);
            self.weigh(common);
        }
    }

    fn score_anew(&mut self, common: &Common) {
        let evidence = common.evidence(&self.touches, &self.spaces);
        score_anew(&mut self.objects, &evidence, |_, _| ());
        self.weigh(common);
    }

    /// Proposes poses unless one is certain and explains the touches well: of all objects in
    /// doubt or, if another component leads, of the likeliest few. A pair counts once in R19, so
    /// `asked_first` leaves out that with the first touch.
    fn propose_in_doubt(&mut self, common: &Common, leads: bool, asked_first: bool) {
        let (n, options) = (self.explained().n_places(), &common.options);
        let probabilities = posterior(common, &self.explained());
        let share = self.share_of_best_pose(common, &probabilities);
        // An object may be left behind for a better one, but not for one that is itself rejected.
        let is_rejected = probabilities.last().is_some_and(|unknown| *unknown > LIKELY);
        let poor = self.is_poor(common);
        if !poor && n >= CERTAIN_FROM && share >= options.certain {
            return;
        }
        // The proposals of an unsteady touch are hardly worth their cost; the next touch will do.
        let newest = self.touches.last().map_or(0.0, |touch| touch.steadiness.normal_variance);
        if !poor && n >= CERTAIN_FROM && newest > UNSTEADY.powi(2) {
            return;
        }
        if !leads {
            self.propose_for_likeliest(common, 1);
            return;
        }
        let budget = &options.budget;
        let is_large = common.model.is_large();
        let n_partners = match (is_large, poor || is_rejected, share > LIKELY) {
            (_, false, true) => budget.partners_if_likely,
            (true, _, _) => budget.many.partners,
            (false, true, _) => budget.partners_if_poor,
            (false, false, false) => budget.partners,
        };
        let mut partners = partners(&self.touches, n_partners);
        partners.retain(|index| !(asked_first && *index == 0));
        let shares = self.retrieve(common, &partners);
        let asked = in_turn(&partners, shares.as_deref(), n, options);
        let reach =
            if poor || is_rejected { f64::INFINITY } else { f64::from(options.score.drop_between) };
        let is_open = poor || share <= LIKELY;
        let least = is_large.then(|| {
            let n_objects = n_searched(&self.objects);
            retrieval_bar(&self.objects, n_candidates(budget, n_objects, n, is_open))
        });
        let scope = Scope::in_doubt(&self.objects, reach, least, is_large, options);
        self.propose(common, &asked, &scope);
        if positions::are_needed(&self.touches) {
            let evidence = common.evidence(&self.touches, &self.spaces);
            propose_by_positions(&mut self.objects, &evidence, &scope);
        }
        if is_open {
            self.propose_stated(common);
        }
    }

    /// The newest touch and some partners propose poses of the likeliest objects.
    fn propose_for_likeliest(&mut self, common: &Common, n_partners: usize) {
        let partners = partners(&self.touches, n_partners);
        let bar = |n| evidence_bar(&self.objects, f64::INFINITY, n);
        let reach = bar(1) - bar(OBJECTS_MAX);
        let asked = in_turn(&partners, None, self.touches.len(), &common.options);
        let is_large = common.model.is_large();
        let scope = Scope::in_doubt(&self.objects, reach, None, is_large, &common.options);
        self.propose(common, &asked, &scope);
    }

    /// The newest touch and each partner propose poses of the objects in scope.
    fn propose(&mut self, common: &Common, partners: &[Partner], scope: &Scope) {
        let evidence = common.evidence(&self.touches, &self.spaces);
        propose_poses(&mut self.objects, &evidence, partners, scope);
    }

    /// Looks the newest touch up in the joint table with each partner; `None` without a table.
    fn retrieve(&mut self, common: &Common, partners: &[usize]) -> Option<Vec<f32>> {
        let options = &common.options;
        retrieve(&mut self.objects, &common.model, &self.touches, partners, options)
    }

    fn refine(&mut self, common: &Common) {
        let chosen = best_to_refine(&self.objects, &common.options);
        let evidence = common.evidence(&self.touches, &self.spaces);
        settle_chosen(&mut self.objects, &evidence, &chosen);
        merge_all(&mut self.objects, &common.options);
    }

    /// The evidence of three and more touches: the sum over poses and over the case that all
    /// touches fit nowhere. Equation R17 of docs/recogniser.md, k = 3.
    fn weigh(&mut self, common: &Common) {
        // Without a pair there is no pose yet: the evidence of the first touch stays.
        if self.objects.iter().all(|object| object.hypotheses.is_empty()) {
            return;
        }
        self.stage = Stage::Poses;
        let lost = |touch| f64::from(common.kernel.floor_of(touch));
        let floor: f64 = self.touches.iter().map(lost).sum();
        for object in searched(&mut self.objects) {
            let scores = object.hypotheses.iter().map(|h| f64::from(h.score));
            object.log_evidence = log_sum_exp(scores.chain([floor]));
        }
    }

    fn bound(&mut self, common: &Common) {
        let total = common.options.budget.total;
        let part = if self.motion.is_unannounced() { BUDGET_PART } else { 1 };
        bound(&mut self.objects, total / part);
    }

    /// Whether even the best hypothesis explains the touches poorly.
    pub(super) fn is_poor(&self, common: &Common) -> bool {
        let expected = |touch: &Observation| f64::from(touch.weight * touch.expected_loss());
        let lost: f64 = self.touches.iter().map(expected).sum();
        let least = f64::from(common.options.score.poor) * n_weighed(&self.touches) - lost;
        f64::from(best_explanation(&self.objects)) < least
    }

    /// The probability of the likeliest object in its likeliest pose, or in one that looks alike.
    fn share_of_best_pose(&self, common: &Common, probabilities: &[f64]) -> f64 {
        let shares = self.objects.iter().zip(probabilities).enumerate();
        let Some((object, (belief, p))) = shares.max_by(|a, b| a.1.1.total_cmp(b.1.1)) else {
            return 0.0;
        };
        let Some(best) = belief.hypotheses.first() else { return 0.0 };
        let (options, symmetry) = (&common.options, common.model.symmetry(object));
        let alike = belief.hypotheses.iter().filter(|other| {
            other.score > best.score - options.score.alike_within
                && look_alike(best, other, symmetry, options)
        });
        let share = |h: &Hypothesis| (f64::from(h.score) - belief.log_evidence).exp();
        self.places.several() * p * alike.map(share).sum::<f64>()
    }

    /// Restores the conclusions of a checkpoint from the same observations.
    pub(super) fn conclude(&mut self, stage: Stage, objects: Vec<ObjectBelief>, places: Places) {
        (self.stage, self.objects, self.places) = (stage, objects, places);
        self.restate();
    }

    /// The inputs of the posterior.
    pub(super) fn explained(&self) -> Explained<'_> {
        let Self { motion, stage, places, touches, objects, .. } = self;
        let (stage, motion) = (*stage, *motion);
        let stated = self.stated.as_ref().map(|stated| &*stated.now);
        Explained { stage, places, motion, touches, objects, stated }
    }

    /// Spaces of all presses.
    pub(super) fn spaces(&self) -> &[PressSpace] {
        &self.spaces
    }

    /// Probability that its poses explain the touches: before two places are felt, only those that
    /// a statement or a move gave.
    pub(super) fn posed(&self) -> f64 {
        let is_given = |object: &ObjectBelief| !object.motion_prior.poses.is_empty();
        let is_given = self.stated.is_some() || self.objects.iter().any(is_given);
        if is_given { 1.0 } else { self.places.several() }
    }

    /// Heap bytes of its lists.
    pub(super) fn bytes(&self) -> usize {
        self.touches.capacity() * size_of::<Observation>()
            + self.spaces.capacity() * size_of::<PressSpace>()
            + self.spaces.iter().map(PressSpace::bytes).sum::<usize>()
            + self.objects.capacity() * size_of::<ObjectBelief>()
            + self.objects.iter().map(ObjectBelief::bytes).sum::<usize>()
            + self.places.bytes()
    }
}

mod moving;
mod pairing;
mod stating;
#[cfg(test)]
mod tests;
