//! The surface recogniser: hypotheses are proposed, verified by every touch, and refined.
//!
//! Beyond the dissertation (sections 5.6.3–5.6.6 and 6.1 say what is wanted). A pair of touches
//! proposes poses of every object that is not out of the question (`propose`), in a large
//! catalogue of those that one table of all pairs lists (`shortlist`), each touch
//! scores each surviving hypothesis (`score`), the best are refined (`refine`) and what is one
//! pose is merged (`hypothesis`). The cost of a touch grows with the hypotheses, not with the
//! touches before it. Objects are worked on side by side; the number of threads does not
//! change a bit.

mod answer;
pub mod calibrate;
mod carried;
mod conclusions;
#[cfg(test)]
mod density;
mod evidence;
mod fit;
mod hypothesis;
mod motion;
pub mod options;
mod outlook;
mod pair_fit;
mod partners;
mod pattern;
mod placement;
mod propose;
mod refine;
mod score;
mod search;
mod shortlist;
mod sighting;
mod stated;
mod steadiness;
mod stretch;
#[cfg(test)]
mod test_support;
mod turned;
mod usual;

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

pub use conclusions::NotConclusions;
pub use options::SurfaceOptions;
pub use outlook::Expected;
pub use usual::prepare;

use crate::model::SurfaceModel;
use crate::surface::SurfaceMap;
use crate::surface::joint_pairs::TOUCHES_PER_OBJECT;
use crate::surface::touch::observe_touch;
use carried::Carried;
use evidence::Evidence;
use hypothesis::{Hypothesis, merge};
use palpate_core::belief::{MismatchError, log_prior};
use palpate_core::log_prob::log_sum_exp;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::stop::Stop;
use partners::in_turn;
use pattern::{Miss, Pattern};
use score::Kernel;
use sighting::Sighting;

/// Fewer objects are worked on one after the other: sharing them out would take longer.
const OBJECTS_PER_THREAD: usize = 16;

/// The share of the pairs of touches whose geometry says nothing.
const PAIR_OUTLIERS: f32 = 0.03;

/// Of the stored pairs whose cells a query visits, what their geometry weighs in the mean.
const VISITED_WEIGHT: f32 = 0.03;

/// A belief over the identity and pose of one object, from the readings so far.
#[derive(Clone, Debug)]
pub struct SurfaceBelief {
    model: Arc<SurfaceModel>,
    options: SurfaceOptions,
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
    /// Whether this belief assumes unannounced motion between touches (`motion`).
    is_restless: bool,
    /// Beliefs that assume unannounced motion, one for each amplitude; empty while rest explains
    /// the touches well.
    moving: Vec<Self>,
    stop: Stop,
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
    /// ln of how dense the table of all objects' pairs says its pairs are about those of the
    /// touches, beside other objects.
    standing: f64,
    /// Where it was before it may have moved.
    carried: Carried,
    /// Its prior is zero: it has no part in the search.
    is_ruled_out: bool,
}

/// What a pair of touches says of an object without asking for a pose.
#[derive(Clone, Copy, Debug, Default)]
struct PairEvidence {
    geometry: f32,
    evidence: f32,
    looks: f32,
}

impl ObjectState {
    /// Before any touch, of an object with this prior (ln).
    fn new(log_prior: f64) -> Self {
        let mut state = Self { is_ruled_out: is_impossible(log_prior), ..Self::default() };
        state.forget_evidence();
        state
    }

    /// As if nothing had been touched: no evidence for or against it, unless it is ruled out.
    fn forget_evidence(&mut self) {
        let log = if self.is_ruled_out { f64::NEG_INFINITY } else { 0.0 };
        (self.log_evidence, self.standing) = (log, log);
        self.pair = PairEvidence::default();
    }

    /// Bytes behind its lists.
    fn bytes(&self) -> usize {
        self.hypotheses.capacity() * size_of::<Hypothesis>() + self.carried.bytes()
    }
}

impl SurfaceBelief {
    /// The belief before any reading. `prior` weighs the objects; `None` is even. An object with
    /// a weight of zero is searched for as little as one that the catalogue does not have.
    ///
    /// # Errors
    /// [`MismatchError::Prior`] when the weights do not fit the catalogue.
    pub fn new(
        model: Arc<SurfaceModel>,
        options: SurfaceOptions,
        prior: Option<&[f64]>,
    ) -> Result<Self, MismatchError> {
        let log_prior = log_prior(prior, model.maps().len())?;
        Ok(Self {
            objects: log_prior.iter().map(|log| ObjectState::new(*log)).collect(),
            log_prior,
            kernel: Kernel::new(&options),
            anchor: DVec3::ZERO,
            touches: Vec::new(),
            patterns: Vec::new(),
            misses: Vec::new(),
            stage: 0,
            n_readings: 0,
            unknown: options.unknown,
            may_have_moved: false,
            is_restless: false,
            moving: Vec::new(),
            stop: Stop::never(),
            model,
            options,
        })
    }

    /// Bytes of memory that this belief has for itself, without the model that it shares.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let objects: usize = self.objects.iter().map(ObjectState::bytes).sum();
        let patterns: usize = self.patterns.iter().map(Pattern::bytes).sum();
        let moving: usize = self.moving.iter().map(Self::bytes).sum();
        size_of::<Self>()
            + moving
            + self.log_prior.capacity() * size_of::<f64>()
            + self.touches.capacity() * size_of::<Sighting>()
            + self.patterns.capacity() * size_of::<Pattern>()
            + patterns
            + self.misses.iter().map(Miss::bytes).sum::<usize>()
            + self.objects.capacity() * size_of::<ObjectState>()
            + objects
    }

    /// From now on, long loops unwind once `stop` is asked for ([`Stop::check`]).
    pub fn heed(&mut self, stop: &Stop) {
        self.stop = stop.clone();
        self.moving.iter_mut().for_each(|moving| moving.heed(stop));
    }

    /// Takes a reading into account. A press that touched nothing says where the object is not.
    pub fn add(&mut self, reading: &Reading, sensor: &SensorDescription) {
        let leader = self.leader_index();
        self.take(reading, sensor, leader.is_none());
        for (index, moving) in self.moving.iter_mut().enumerate() {
            moving.take(reading, sensor, leader == Some(index));
        }
        self.doubt_rest();
    }

    /// Takes a reading into one of the beliefs of the mixture. The one that `leads` searches in
    /// full, the others with a small budget.
    fn take(&mut self, reading: &Reading, sensor: &SensorDescription, leads: bool) {
        if !self.witness(reading, sensor) {
            self.judge_miss();
            return;
        }
        match self.touches.len() {
            1 => {
                self.compare_looks();
                self.follow();
            }
            2 => {
                self.follow();
                let shares = self.take_census(&[0], true);
                let asked = in_turn(&[0], shares.as_deref(), 2, &self.options);
                self.propose(&asked, f64::INFINITY, self.n_listed_for_pair());
                self.compare_pairs();
            }
            _ => {
                self.verify();
                self.propose_in_doubt(leads);
                self.refine();
                self.weigh();
            }
        }
        self.bound();
    }

    /// Takes note of a reading without concluding anything; whether it touched something.
    fn witness(&mut self, reading: &Reading, sensor: &SensorDescription) -> bool {
        self.n_readings += 1;
        let Some(touch) = observe_touch(reading, sensor, &self.model.space) else {
            if self.touches.is_empty() {
                self.misses.push(Miss { reading: reading.clone(), sensor: sensor.clone() });
            } else {
                let pattern = Pattern::of_miss(reading, sensor, self.anchor);
                self.patterns.push(pattern.after(self.touches.len()));
            }
            return false;
        };
        if self.touches.is_empty() && !self.may_have_moved {
            self.anchor = touch.position;
        }
        if self.touches.is_empty() {
            let misses = std::mem::take(&mut self.misses);
            self.patterns.extend(misses.iter().map(|miss| miss.pattern(self.anchor)));
        }
        let pattern = Pattern::of_touch(reading, sensor, self.anchor);
        self.patterns.push(pattern.after(self.touches.len() + 1));
        let (space, scale) = (&self.model.space, &self.options.scale);
        let sighting = Sighting::new(&touch, self.anchor, space, scale).with_base(reading.base());
        self.touches.push(sighting.weighed(&self.touches));
        self.age();
        true
    }

    /// A press that met nothing makes poses less likely that had something there.
    fn judge_miss(&mut self) {
        if self.touches.is_empty() {
            return;
        }
        self.judge_newest_pattern();
        if self.stage == 3 {
            self.weigh();
        }
    }

    /// What the newest press says of free and occupied space scores every hypothesis.
    fn judge_newest_pattern(&mut self) {
        let (objects, evidence) = self.parts();
        for_each_object(objects, evidence.maps, evidence.stop, |state, map| {
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
        let n_compared = self.n_listed().map_or(usize::MAX, |_| TOUCHES_PER_OBJECT);
        for_each_object(&mut self.objects, self.model.maps(), &self.stop, |state, map| {
            let mut looks = Vec::new();
            let n_compared = n_compared.min(map.patches().len());
            touch.appearances(map.features(), 0..n_compared, &mut looks);
            state.log_evidence = f64::from((looks.iter().sum::<f32>() / n_compared as f32).ln());
        });
    }

    /// After two touches the density of stored pairs like theirs does, better than any pose.
    fn compare_pairs(&mut self) {
        // Two touches at one and the same place are no pair: what the first one said stays.
        if self.objects.iter().all(|state| state.pair.looks <= 0.0) {
            return;
        }
        self.stage = 2;
        let n_objects = self.n_searched().max(1) as f32;
        let sum: f32 = self.objects.iter().map(|state| state.pair.geometry).sum();
        let usual = VISITED_WEIGHT * sum / n_objects;
        for state in searched(&mut self.objects) {
            let pair = &state.pair;
            let fits = if usual > 0.0 { pair.evidence / usual } else { 0.0 };
            let total = (1.0 - PAIR_OUTLIERS) * fits + PAIR_OUTLIERS * pair.looks;
            state.log_evidence = f64::from(total.max(f32::MIN_POSITIVE).ln());
        }
    }

    /// The newest touch scores every hypothesis.
    fn verify(&mut self) {
        if self.options.motion.is_some() {
            self.judge_anew();
            return;
        }
        let (objects, evidence) = self.parts();
        for_each_object(objects, evidence.maps, evidence.stop, |state, map| {
            for hypothesis in &mut state.hypotheses {
                hypothesis.score += evidence.newest(map, &hypothesis.pose());
            }
            merge(&mut state.hypotheses, evidence.options);
        });
        self.weigh();
    }

    /// What changes with a touch, and what it is judged by.
    fn parts(&mut self) -> (&mut [ObjectState], Evidence<'_>) {
        let evidence = Evidence {
            maps: self.model.maps(),
            kernel: &self.kernel,
            touches: &self.touches,
            patterns: &self.patterns,
            options: &self.options,
            stop: &self.stop,
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
        let lost = |touch| f64::from(self.kernel.floor_of(touch));
        let floor: f64 = self.touches.iter().map(lost).sum();
        for state in searched(&mut self.objects) {
            let scores = state.hypotheses.iter().map(|h| f64::from(h.score));
            state.log_evidence = log_sum_exp(scores.chain([floor]));
        }
    }

    /// How many objects are not ruled out.
    fn n_searched(&self) -> usize {
        self.objects.iter().filter(|state| !state.is_ruled_out).count()
    }

    /// How many readings were added.
    #[must_use]
    pub fn n_readings(&self) -> usize {
        self.n_readings
    }
}

/// Whether a prior (ln) rules an object out.
fn is_impossible(log_prior: f64) -> bool {
    log_prior == f64::NEG_INFINITY
}

/// The objects that are not ruled out.
fn searched(objects: &mut [ObjectState]) -> impl Iterator<Item = &mut ObjectState> {
    objects.iter_mut().filter(|state| !state.is_ruled_out)
}

/// Works on every object that is not ruled out, many of them side by side.
fn for_each_object(
    objects: &mut [ObjectState],
    maps: &[Arc<SurfaceMap>],
    stop: &Stop,
    work: impl Fn(&mut ObjectState, &SurfaceMap) + Send + Sync,
) {
    let work = |state: &mut ObjectState, map: &SurfaceMap| {
        stop.check();
        if !state.is_ruled_out {
            work(state, map);
        }
    };
    if objects.len() < 2 * OBJECTS_PER_THREAD {
        objects.iter_mut().zip(maps).for_each(|(state, map)| work(state, map));
    } else {
        let both = objects.par_iter_mut().zip(maps).with_min_len(OBJECTS_PER_THREAD);
        both.for_each(|(state, map)| work(state, map));
    }
}
