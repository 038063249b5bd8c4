//! The hybrid recogniser: hypotheses are proposed, verified by every touch, and refined.
//!
//! Beyond the dissertation (sections 5.6.3–5.6.6 and 6.1 name the idea). A pair of touches
//! proposes poses of every object that is not out of the question (`propose`), each touch
//! scores each surviving hypothesis (`score`), the best are refined (`refine`) and what is one
//! pose is merged (`hypothesis`). The cost of a touch grows with the hypotheses, not with the
//! touches before it. Objects are worked on side by side; the number of threads does not
//! change a bit.

pub mod calibrate;
mod carried;
mod evidence;
mod hypothesis;
pub mod options;
mod outlook;
mod pattern;
mod propose;
mod refine;
mod score;
mod sighting;
#[cfg(test)]
mod test_support;
mod usual;

use std::sync::Arc;

use glam::{DQuat, DVec3};
use rayon::prelude::*;

pub use options::HybridOptions;
pub use outlook::Expected;

use crate::belief::answer::{Answer, PoseMode};
use crate::log_prob::{entropy_bits, log_sum_exp, normalize};
use crate::model::ObjectIdx;
use crate::model::surface::SurfaceModel;
use crate::pose::Pose;
use crate::reading::{Looseness, Reading};
use crate::recognise::{RecogniseError, log_prior};
use crate::sensor::SensorDescription;
use crate::surface::SurfaceMap;
use crate::surface::touch::observe_touch;
use carried::Carried;
use evidence::{Evidence, Known};
use hypothesis::{Hypothesis, merge};
use pattern::{Miss, Pattern};
use propose::{Proposal, partners, propose};
use score::{Kernel, Turned};
use sighting::Sighting;

/// Fewer objects are worked on one after the other: sharing them out would take longer.
const OBJECTS_PER_THREAD: usize = 16;

/// The share of the pairs of touches whose geometry says nothing.
const PAIR_OUTLIERS: f32 = 0.03;

/// Of the stored pairs whose cells a query visits, what their geometry weighs in the mean.
const VISITED_WEIGHT: f32 = 0.03;

/// No object is ruled out for good when what is known is carried over.
const SURE: f64 = 1e-12;

/// A pose more probable than this is likelier than not.
const LIKELY: f64 = 0.5;

/// A belief over the identity and pose of one object, from the readings so far.
#[derive(Clone, Debug)]
pub struct HybridBelief {
    model: Arc<SurfaceModel>,
    options: HybridOptions,
    kernel: Kernel,
    log_prior: Vec<f64>,
    /// The first touch: poses are relative to it, since single precision ends somewhere.
    anchor: DVec3,
    touches: Vec<Sighting>,
    /// Of all presses: what they say of free and occupied space.
    patterns: Vec<Pattern>,
    /// Presses that met nothing, before there was an anchor.
    misses: Vec<Miss>,
    objects: Vec<ObjectState>,
    /// What the objects' evidence is of: 0 nothing, 1 looks, 2 a pair, 3 hypotheses.
    stage: usize,
    n_readings: usize,
    /// The probability that it is none of them, before the touches.
    unknown: f64,
    /// Whether the object may have moved since its first touch.
    may_have_moved: bool,
}

/// What is believed of one object.
#[derive(Clone, Debug, Default)]
struct ObjectState {
    /// Best first.
    hypotheses: Vec<Hypothesis>,
    /// ln of the evidence of the touches for the object, before the prior.
    log_evidence: f64,
    /// What the first pair of touches said.
    pair: PairEvidence,
    /// Where it was before it may have moved.
    carried: Carried,
}

/// What a pair of touches says of an object without asking for a pose.
#[derive(Clone, Copy, Debug, Default)]
struct PairEvidence {
    geometry: f32,
    evidence: f32,
    looks: f32,
}

impl HybridBelief {
    /// The belief before any reading. `prior` weighs the objects; `None` is even.
    ///
    /// # Errors
    /// [`RecogniseError::Prior`] when the weights do not fit the catalogue.
    pub fn new(
        model: Arc<SurfaceModel>,
        options: HybridOptions,
        prior: Option<&[f64]>,
    ) -> Result<Self, RecogniseError> {
        let n_objects = model.maps.len();
        Ok(Self {
            log_prior: log_prior(prior, n_objects)?,
            objects: vec![ObjectState::default(); n_objects],
            kernel: Kernel::new(&options),
            anchor: DVec3::ZERO,
            touches: Vec::new(),
            patterns: Vec::new(),
            misses: Vec::new(),
            stage: 0,
            n_readings: 0,
            unknown: options.unknown,
            may_have_moved: false,
            model,
            options,
        })
    }

    /// Takes a reading into account. A press that touched nothing says where the object is not.
    pub fn add(&mut self, reading: &Reading, sensor: &SensorDescription) {
        self.n_readings += 1;
        let Some(touch) = observe_touch(reading, sensor, &self.model.space) else {
            self.add_miss(reading, sensor);
            return;
        };
        if self.touches.is_empty() && !self.may_have_moved {
            self.anchor = touch.position;
        }
        if self.touches.is_empty() {
            let misses = std::mem::take(&mut self.misses);
            self.patterns.extend(misses.iter().map(|miss| miss.pattern(self.anchor)));
        }
        self.patterns.push(Pattern::of_touch(reading, sensor, self.anchor));
        let (space, scale) = (&self.model.space, &self.options.scale);
        let sighting = Sighting::new(&touch, self.anchor, space, scale).from_base(reading.base());
        self.touches.push(sighting.weighed(&self.touches));
        match self.touches.len() {
            1 => {
                self.compare_looks();
                self.follow();
            }
            2 => {
                self.follow();
                self.propose(&[0], f64::INFINITY);
                self.compare_pairs();
            }
            _ => {
                self.verify();
                self.propose_in_doubt();
                self.refine();
                self.weigh();
            }
        }
        self.bound();
    }

    /// The object may have moved since the last touch, by deviations of `motion`: which one it
    /// is stays as probable, its pose becomes loose by so much.
    pub fn loosen(&mut self, motion: &Looseness) {
        self.may_have_moved |= !self.touches.is_empty();
        if self.touches.is_empty() {
            self.misses.clear();
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
            state.log_evidence = 0.0;
        }
        self.touches.clear();
        self.patterns.clear();
        self.stage = 0;
    }

    /// Lays the poses of before a motion onto the touches since.
    fn follow(&mut self) {
        let (objects, evidence) = self.parts();
        for_each_object(objects, evidence.maps, |state, map| {
            let ObjectState { hypotheses, carried, .. } = state;
            let known = Known { map, carried };
            for hypothesis in &mut *hypotheses {
                let score = evidence.score(known, &hypothesis.pose(), f32::NEG_INFINITY);
                hypothesis.score = score.unwrap_or(f32::NEG_INFINITY);
                evidence.settle(hypothesis, known);
            }
            merge(hypotheses, evidence.options);
        });
    }

    /// A press that met nothing makes poses less likely that had something there.
    fn add_miss(&mut self, reading: &Reading, sensor: &SensorDescription) {
        if self.touches.is_empty() {
            self.misses.push(Miss { reading: reading.clone(), sensor: sensor.clone() });
            return;
        }
        self.patterns.push(Pattern::of_miss(reading, sensor, self.anchor));
        self.judge_newest_pattern();
        if self.stage == 3 {
            self.weigh();
        }
    }

    /// What the newest press says of free and occupied space scores every hypothesis.
    fn judge_newest_pattern(&mut self) {
        let (objects, evidence) = self.parts();
        for_each_object(objects, evidence.maps, |state, map| {
            for hypothesis in &mut state.hypotheses {
                hypothesis.score += evidence.newest_pattern(map, &hypothesis.pose());
            }
            merge(&mut state.hypotheses, evidence.options);
        });
    }

    /// After one touch only its appearance tells objects apart.
    fn compare_looks(&mut self) {
        self.stage = 1;
        let touch = &self.touches[0];
        for_each_object(&mut self.objects, &self.model.maps, |state, map| {
            let sum: f32 = map.patches().iter().map(|patch| touch.appearance(&patch.feature)).sum();
            state.log_evidence = f64::from((sum / map.patches().len() as f32).ln());
        });
    }

    /// After two touches the density of stored pairs like theirs does, better than any pose.
    fn compare_pairs(&mut self) {
        // Two touches at one and the same place are no pair: what the first one said stays.
        if self.objects.iter().all(|state| state.pair.looks <= 0.0) {
            return;
        }
        self.stage = 2;
        let n_objects = self.objects.len().max(1) as f32;
        let sum: f32 = self.objects.iter().map(|state| state.pair.geometry).sum();
        let usual = VISITED_WEIGHT * sum / n_objects;
        for state in &mut self.objects {
            let pair = &state.pair;
            let fits = if usual > 0.0 { pair.evidence / usual } else { 0.0 };
            let total = (1.0 - PAIR_OUTLIERS) * fits + PAIR_OUTLIERS * pair.looks;
            state.log_evidence = f64::from(total.max(f32::MIN_POSITIVE).ln());
        }
    }

    /// The newest touch scores every hypothesis.
    fn verify(&mut self) {
        let (objects, evidence) = self.parts();
        for_each_object(objects, evidence.maps, |state, map| {
            for hypothesis in &mut state.hypotheses {
                hypothesis.score += evidence.newest(map, &hypothesis.pose());
            }
            merge(&mut state.hypotheses, evidence.options);
        });
        self.weigh();
    }

    /// Proposes poses unless one object is certain and explains the touches well.
    fn propose_in_doubt(&mut self) {
        let n = self.touches.len();
        let best = self.objects.iter().filter_map(|o| Some(o.hypotheses.first()?.score));
        let best = best.fold(f32::NEG_INFINITY, f32::max);
        let poor = f64::from(best) < f64::from(self.options.poor) * self.counted();
        let share = self.share_of_best_pose();
        if !poor && n > 3 && share >= self.options.certain {
            return;
        }
        let budget = &self.options.budget;
        let n_partners = match (poor, share > LIKELY) {
            (true, _) => budget.partners_if_poor,
            (false, false) => budget.partners,
            (false, true) => budget.partners_if_likely,
        };
        let partners = partners(&self.touches, n_partners);
        let reach = if poor { f64::INFINITY } else { f64::from(self.options.drop_between) };
        self.propose(&partners, reach);
    }

    /// The probability of the likeliest object in its likeliest pose.
    fn share_of_best_pose(&self) -> f64 {
        let shares = self.probabilities().into_iter().zip(&self.objects).map(|(p, state)| {
            let best = state.hypotheses.first().map_or(f64::NEG_INFINITY, |h| h.score.into());
            p * (best - state.log_evidence).exp()
        });
        shares.fold(0.0, f64::max)
    }

    /// The newest touch and each partner propose poses of the objects that are at most
    /// `reach` (ln) less likely than the best.
    fn propose(&mut self, partners: &[usize], reach: f64) {
        let (bar, refining) = match self.touches.len() {
            0..=2 => (f64::NEG_INFINITY, f64::INFINITY),
            _ => (
                self.bar(reach, self.options.budget.objects),
                self.bar(f64::from(self.options.drop_between), self.options.budget.refined_objects),
            ),
        };
        let (objects, evidence) = self.parts();
        let (touches, options) = (evidence.touches, evidence.options);
        let [earlier @ .., newest] = touches else { return };
        for_each_object(objects, evidence.maps, |state, map| {
            if state.log_evidence < bar {
                return;
            }
            let known = Known { map, carried: &state.carried };
            for partner in partners {
                let pair = [newest, &earlier[*partner]];
                let Some(proposed) = propose(map, pair, options) else { continue };
                state.pair = PairEvidence {
                    geometry: proposed.geometry,
                    evidence: proposed.evidence,
                    looks: proposed.looks[0] * proposed.looks[1],
                };
                let mut new = Vec::with_capacity(proposed.proposals.len());
                let mut bar = f32::NEG_INFINITY;
                for Proposal { rotation, translation } in proposed.proposals {
                    let pose = Turned::new(rotation, translation);
                    let Some(score) = evidence.score(known, &pose, bar) else { continue };
                    bar = bar.max(score - options.drop_within);
                    new.push(Hypothesis { rotation, translation, score });
                }
                if touches.len() > 2 && state.log_evidence >= refining {
                    merge(&mut new, options);
                    new.truncate(options.budget.refined_proposals);
                    for hypothesis in &mut new {
                        evidence.settle(hypothesis, known);
                    }
                }
                state.hypotheses.extend(new);
            }
            merge(&mut state.hypotheses, options);
        });
    }

    /// The least log-evidence of the `n` likeliest objects, at most `reach` below the best.
    fn bar(&self, reach: f64, n: usize) -> f64 {
        let mut logs: Vec<f64> = self.objects.iter().map(|state| state.log_evidence).collect();
        logs.sort_unstable_by(|a, b| b.total_cmp(a));
        let best = logs.first().copied().unwrap_or(f64::NEG_INFINITY);
        let last = logs.get(n.saturating_sub(1)).copied();
        last.unwrap_or(f64::NEG_INFINITY).max(best - reach)
    }

    /// Refines the best hypotheses of all objects, at most three each.
    fn refine(&mut self) {
        let mut best: Vec<(f32, usize, usize)> = Vec::new();
        for (object, state) in self.objects.iter().enumerate() {
            let first = state.hypotheses.iter().take(3).enumerate();
            best.extend(first.map(|(index, hypothesis)| (hypothesis.score, object, index)));
        }
        best.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
        let top = best.first().map_or(0.0, |best| best.0);
        best.retain(|found| found.0 > top - self.options.drop_between);
        best.truncate(self.options.budget.refined);
        let (objects, evidence) = self.parts();
        for (_, object, index) in best {
            let ObjectState { hypotheses, carried, .. } = &mut objects[object];
            let known = Known { map: &evidence.maps[object], carried };
            evidence.settle(&mut hypotheses[index], known);
        }
        for state in objects {
            merge(&mut state.hypotheses, evidence.options);
        }
    }

    /// What changes with a touch, and what it is judged by.
    fn parts(&mut self) -> (&mut [ObjectState], Evidence<'_>) {
        let evidence = Evidence {
            maps: &self.model.maps,
            kernel: &self.kernel,
            touches: &self.touches,
            patterns: &self.patterns,
            options: &self.options,
        };
        (&mut self.objects, evidence)
    }

    /// Sums up what the hypotheses of each object say, and that all touches fit nowhere.
    fn weigh(&mut self) {
        // Without a pair there is no pose yet: what the first touch looked like stays.
        if self.objects.iter().all(|state| state.hypotheses.is_empty()) {
            return;
        }
        self.stage = 3;
        let floor = f64::from(self.kernel.floor()) * self.counted();
        for state in &mut self.objects {
            let scores = state.hypotheses.iter().map(|h| f64::from(h.score));
            state.log_evidence = log_sum_exp(scores.chain([floor]));
        }
    }

    /// Keeps the hypotheses of all objects together within the budget.
    fn bound(&mut self) {
        let total: usize = self.objects.iter().map(|state| state.hypotheses.len()).sum();
        if total <= self.options.budget.total {
            return;
        }
        let all = self.objects.iter().flat_map(|state| &state.hypotheses);
        let mut scores: Vec<f32> = all.map(|hypothesis| hypothesis.score).collect();
        scores.sort_unstable_by(|a, b| b.total_cmp(a));
        let bar = scores[self.options.budget.total];
        for state in &mut self.objects {
            state.hypotheses.retain(|hypothesis| hypothesis.score > bar);
        }
    }

    /// The probability of each object, then of none of them.
    fn probabilities(&self) -> Vec<f64> {
        if self.stage == 0 {
            let logs = self.log_prior.iter().map(|log| log + (1.0 - self.unknown).ln());
            return normalize(&logs.chain([self.unknown.ln()]).collect::<Vec<f64>>());
        }
        let stage = self.model.calibration.stage(self.stage);
        let known = (1.0 - self.unknown).ln() + (self.objects.len() as f64).ln();
        let both = self.objects.iter().zip(&self.log_prior);
        let logs =
            both.map(|(state, prior)| state.log_evidence / stage.temperature + prior + known);
        let unknown = (stage.log_unknown(self.counted()) + self.unusual()) / stage.temperature;
        normalize(&logs.chain([unknown + self.unknown.ln()]).collect::<Vec<f64>>())
    }

    /// How much better (ln) "none of these" explains the touches than it does beside an object
    /// that explains its own as well as most: more where the touches look like an object that
    /// should explain them better.
    fn unusual(&self) -> f64 {
        if self.stage < 3 {
            return 0.0;
        }
        let temperature = self.model.calibration.stage(3).temperature;
        let logs = self.objects.iter().map(|state| state.log_evidence);
        usual::excess(logs.enumerate(), temperature, |object| self.usual_score(object))
            * self.counted()
    }

    /// How well an object usually explains its own touches, ln a touch.
    fn usual_score(&self, object: usize) -> f64 {
        let (map, space) = (&self.model.maps[object], &self.model.space);
        let find = || usual::usual_score(map, space, &self.kernel, &self.options);
        f64::from(map.usual_score(find))
    }

    /// How many touches there are, by what they count.
    fn counted(&self) -> f64 {
        self.touches.iter().map(|touch| f64::from(touch.weight)).sum()
    }

    /// The belief as an answer with at most `n_modes` poses.
    #[must_use]
    pub fn answer(&self, n_modes: usize) -> Answer {
        let mut probabilities = self.probabilities();
        let entropy_bits = entropy_bits(&probabilities);
        let unknown = probabilities.pop().unwrap_or(0.0);
        let mut poses: Vec<(f64, usize, &Hypothesis)> = Vec::new();
        for (object, state) in self.objects.iter().enumerate() {
            let total = log_sum_exp(state.hypotheses.iter().map(|h| f64::from(h.score)));
            let share = |h: &Hypothesis| probabilities[object] * (f64::from(h.score) - total).exp();
            poses.extend(state.hypotheses.iter().take(n_modes).map(|h| (share(h), object, h)));
        }
        poses.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        poses.truncate(n_modes);
        let mode = |(weight, object, hypothesis): (f64, usize, &Hypothesis)| {
            let map = &self.model.maps[object];
            let mut refined = *hypothesis;
            if self.touches.len() > 2 {
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
        Answer { probabilities, unknown, modes, entropy_bits, n_readings: self.n_readings }
    }

    fn session_from_object(&self, hypothesis: &Hypothesis) -> Pose {
        let rotation = DQuat::from_array(hypothesis.rotation.to_array().map(f64::from));
        Pose::from_parts(rotation, self.anchor + hypothesis.translation.as_dvec3())
    }

    /// How many readings were added.
    #[must_use]
    pub fn n_readings(&self) -> usize {
        self.n_readings
    }
}

/// Works on every object, many of them side by side.
fn for_each_object(
    objects: &mut [ObjectState],
    maps: &[Arc<SurfaceMap>],
    work: impl Fn(&mut ObjectState, &SurfaceMap) + Send + Sync,
) {
    if objects.len() < 2 * OBJECTS_PER_THREAD {
        objects.iter_mut().zip(maps).for_each(|(state, map)| work(state, map));
    } else {
        let both = objects.par_iter_mut().zip(maps).with_min_len(OBJECTS_PER_THREAD);
        both.for_each(|(state, map)| work(state, map));
    }
}
