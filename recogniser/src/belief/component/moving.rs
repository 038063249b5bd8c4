//! An announced move: the poses of a component become the prior of the touches to come.

use palpate_core::reading::Looseness;

use super::Component;
use crate::belief::places::Places;
use crate::belief::retrieval::begin_scores;
use crate::belief::stage::Stage;
use crate::verify::motion_prior::{self, MotionPrior};

impl Component {
    /// Discards the observations from before a move.
    pub(in crate::belief) fn forget_observations(&mut self) {
        self.touches.clear();
        self.spaces.clear();
        self.state(None);
    }

    /// Turns the poses of `leader`, the likeliest component, into the motion prior of the
    /// touches to come. `log_priors` of the objects are those of after the move.
    pub(in crate::belief) fn move_on(
        &mut self,
        leader: Option<Self>,
        motion: &Looseness,
        log_priors: &[f64],
    ) {
        if let Some(leader) = leader {
            self.objects = leader.objects;
        }
        for object in &mut self.objects {
            object.motion_prior = MotionPrior::new(&object.hypotheses, motion);
            object.hypotheses.truncate(motion_prior::POSES_MAX);
            let best = object.best_score().unwrap_or(0.0);
            object.hypotheses.iter_mut().for_each(|hypothesis| hypothesis.score -= best);
            object.forget_evidence();
        }
        begin_scores(&mut self.objects, log_priors);
        (self.stage, self.places) = (Stage::Prior, Places::default());
    }

    /// Inflates the motion prior for one more move before a touch.
    pub(in crate::belief) fn inflate(&mut self, motion: &Looseness) {
        self.objects.iter_mut().for_each(|object| object.motion_prior.inflate(motion));
    }
}
