//! The belief about one object, and work on all objects in parallel.

use std::sync::Arc;

use palpate_core::stop::Stop;
use rayon::prelude::*;

use crate::model::SurfaceMap;
use crate::propose::proposals::PairEvidence;
use crate::verify::evidence::Known;
use crate::verify::hypothesis::Hypothesis;
use crate::verify::motion_prior::MotionPrior;

/// Objects per thread; fewer are processed sequentially, since distributing them would take longer.
const OBJECTS_PER_THREAD: usize = 16;

/// The belief about one object.
#[derive(Clone, Debug, Default)]
pub(super) struct ObjectBelief {
    /// Hypotheses, best first.
    pub(super) hypotheses: Vec<Hypothesis>,
    /// ln L_o of equation R17, before the prior.
    pub(super) log_evidence: f64,
    /// Evidence of the first pair of touches.
    pub(super) pair: PairEvidence,
    /// z_o of equation R19.
    pub(super) retrieval_score: f64,
    /// Prior of its pose after an announced move.
    pub(super) motion_prior: MotionPrior,
    /// Whether its prior is zero, so that it is excluded from the search.
    pub(super) is_ruled_out: bool,
}

impl ObjectBelief {
    /// The belief before any touch about an object with this prior (ln).
    pub(super) fn new(log_prior: f64) -> Self {
        let mut object = Self { is_ruled_out: is_impossible(log_prior), ..Self::default() };
        object.forget_evidence();
        object
    }

    /// Resets the evidence to 0 unless the object is ruled out.
    pub(super) fn forget_evidence(&mut self) {
        let log = if self.is_ruled_out { f64::NEG_INFINITY } else { 0.0 };
        (self.log_evidence, self.retrieval_score) = (log, log);
        self.pair = PairEvidence::default();
    }

    /// The object in the form in which its poses are scored.
    pub(super) fn known<'a>(&'a self, map: &'a SurfaceMap) -> Known<'a> {
        Known { map, prior: &self.motion_prior }
    }

    /// The score of its best hypothesis.
    pub(super) fn best_score(&self) -> Option<f32> {
        Some(self.hypotheses.first()?.score)
    }

    /// Heap bytes of its lists.
    pub(super) fn bytes(&self) -> usize {
        self.hypotheses.capacity() * size_of::<Hypothesis>() + self.motion_prior.bytes()
    }
}

/// Whether a prior (ln) rules an object out.
pub(super) fn is_impossible(log_prior: f64) -> bool {
    log_prior == f64::NEG_INFINITY
}

/// The objects that are not ruled out.
pub(super) fn searched(objects: &mut [ObjectBelief]) -> impl Iterator<Item = &mut ObjectBelief> {
    objects.iter_mut().filter(|object| !object.is_ruled_out)
}

/// The number of objects that are not ruled out.
pub(super) fn n_searched(objects: &[ObjectBelief]) -> usize {
    objects.iter().filter(|object| !object.is_ruled_out).count()
}

/// Processes every object that is not ruled out, in parallel if they are many. Results do not
/// depend on the number of threads.
pub(super) fn for_each_object(
    objects: &mut [ObjectBelief],
    maps: &[Arc<SurfaceMap>],
    stop: &Stop,
    work: impl Fn(&mut ObjectBelief, &SurfaceMap) + Send + Sync,
) {
    let work = |object: &mut ObjectBelief, map: &SurfaceMap| {
        stop.check();
        if !object.is_ruled_out {
            work(object, map);
        }
    };
    if objects.len() < 2 * OBJECTS_PER_THREAD {
        objects.iter_mut().zip(maps).for_each(|(object, map)| work(object, map));
    } else {
        let both = objects.par_iter_mut().zip(maps).with_min_len(OBJECTS_PER_THREAD);
        both.for_each(|(object, map)| work(object, map));
    }
}
