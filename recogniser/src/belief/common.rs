//! Parts that all components of a belief share: the model, the options, and the prior.

use std::sync::Arc;

use palpate_core::belief::{MismatchError, log_prior};
use palpate_core::stop::Stop;

use super::object::ObjectBelief;
use super::retrieval::begin_scores;
use crate::model::{SurfaceMap, SurfaceModel};
use crate::observe::observation::{Observation, Says};
use crate::observe::press_space::PressSpace;
use crate::options::SurfaceOptions;
use crate::verify::density::Kernel;
use crate::verify::evidence::Evidence;
use crate::verify::null_model;

/// Parts that all components share.
#[derive(Clone, Debug)]
pub(super) struct Common {
    pub(super) model: Arc<SurfaceModel>,
    pub(super) options: SurfaceOptions,
    pub(super) kernel: Kernel,
    pub(super) prior: Prior,
    pub(super) stop: Stop,
}

/// Probabilities before the touches.
#[derive(Clone, Debug)]
pub(super) struct Prior {
    /// ln prior of each object, given that the object is one of the catalogue's.
    pub(super) log_objects: Vec<f64>,
    /// Prior of "none of these".
    pub(super) unknown: f64,
}

impl Common {
    pub(super) fn new(
        model: Arc<SurfaceModel>,
        options: SurfaceOptions,
        prior: Option<&[f64]>,
    ) -> Result<Self, MismatchError> {
        let log_objects = log_prior(prior, model.n_objects())?;
        let options = options.widened(model.calibration.width);
        Ok(Self {
            kernel: Kernel::new(&options),
            prior: Prior { log_objects, unknown: options.unknown },
            stop: Stop::never(),
            model,
            options,
        })
    }

    /// The objects before any touch.
    pub(super) fn objects(&self) -> Vec<ObjectBelief> {
        let log_priors = &self.prior.log_objects;
        let mut objects = log_priors.iter().map(|log| ObjectBelief::new(*log)).collect::<Vec<_>>();
        begin_scores(&mut objects, log_priors);
        objects
    }

    /// The evidence of observations.
    pub(super) fn evidence<'a>(
        &'a self,
        touches: &'a [Observation],
        spaces: &'a [PressSpace],
    ) -> Evidence<'a> {
        Evidence {
            maps: self.model.maps(),
            kernel: &self.kernel,
            touches,
            spaces,
            options: &self.options,
            stop: &self.stop,
        }
    }

    /// The self-match score of an object by touches that say this much, ln per touch.
    pub(super) fn self_match(&self, object: usize, says: Says) -> f64 {
        let space = &self.model.space;
        let find = |map: &SurfaceMap| {
            null_model::self_match(map, space, &self.kernel, &self.options, says)
        };
        f64::from(self.model.self_match(object, says as usize, find))
    }

    /// What touches that lack appearance, or a normal too, lose under an object (ln): `lacking`
    /// has their numbers by weight. Part of equation R13.
    pub(super) fn lost(&self, object: usize, lacking: [f64; 2]) -> f64 {
        let whole = self.self_match(object, Says::All);
        let less = |says, n: f64| {
            if n > 0.0 { n * (whole - self.self_match(object, says)).max(0.0) } else { 0.0 }
        };
        less(Says::Normal, lacking[0]) + less(Says::Position, lacking[1])
    }
}

/// Computes the self-match scores of all objects, in parallel, for beliefs with these options.
/// Without it the first session that needs them waits.
pub fn prepare(model: &SurfaceModel, options: &SurfaceOptions) {
    null_model::prepare(model, options);
}
