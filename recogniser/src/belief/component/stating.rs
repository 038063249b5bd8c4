//! A component's use of a stated pose prior: it holds until the object may have moved.

use std::f64::consts::LN_2;
use std::sync::Arc;

use palpate_core::log_prob::log_sum_exp;

use super::Component;
use crate::belief::common::Common;
use crate::belief::object::ObjectBelief;
use crate::belief::search::evidence_bar;
use crate::belief::stated_search::{Turned, pair_correction, propose_stated, weigh_stated};
use crate::model::joint_pairs::TOUCHES_PER_OBJECT;
use crate::observe::observation::Observation;
use crate::verify::motion_prior::StatedOf;
use crate::verify::stated_prior::StatedPrior;

/// A statement at the first touch, and as it holds after the drift since.
#[derive(Clone, Debug)]
pub(super) struct Stating {
    first: Arc<StatedPrior>,
    pub(super) now: Arc<StatedPrior>,
}

impl Component {
    /// Takes a statement about the pose at the first touch; `None` once it no longer holds.
    pub(in crate::belief) fn state(&mut self, stated: Option<Arc<StatedPrior>>) {
        self.stated = stated.map(|first| Stating { now: Arc::clone(&first), first });
        self.restate();
    }

    /// Hands the statement to every object.
    pub(super) fn restate(&mut self) {
        if let (Some(stated), Some(drift)) = (&mut self.stated, self.motion.drift())
            && let moves @ 1.. = self.touches.len().saturating_sub(1)
        {
            let variance = |deviation: f64| moves as f64 * deviation.powi(2);
            let variances = [variance(drift.position), variance(drift.angle)];
            stated.now = Arc::new(stated.first.drifted(variances));
        }
        let now = self.stated.as_ref().map(|stated| &stated.now);
        for (index, object) in self.objects.iter_mut().enumerate() {
            let of =
                |prior: &Arc<StatedPrior>| StatedOf { prior: Arc::clone(prior), object: index };
            object.motion_prior.stated = now.map(of);
        }
    }

    /// The evidence of the first touch, or of its pair with the newest, beside the statement. `usual` is the
    /// density of the touches on a usual object over that of touches anywhere.
    pub(super) fn weigh_stated(&mut self, common: &Common, usual: f64) {
        let Some(Stating { now, .. }) = &self.stated else { return };
        let ends: Vec<Observation> = match &self.touches[..] {
            [first, .., newest] => vec![first.clone(), newest.clone()],
            touches => touches.to_vec(),
        };
        let turned = Turned::new(now, ends.len(), patches_max(common));
        weigh_stated(&mut self.objects, &common.evidence(&ends, &[]), &turned, usual);
    }

    /// The evidence of a pair beside the statement: the mean of two estimates, by stored pairs and by
    /// the stated poses. Each misses what the other finds. Equation R36.
    pub(super) fn weigh_stated_pair(&mut self, common: &Common, usual: f64) {
        let Some(stated) = self.stated.as_ref().map(|stated| Arc::clone(&stated.now)) else {
            return;
        };
        let corrected = |object: &ObjectBelief| match object.is_ruled_out {
            true => object.log_evidence,
            false => object.log_evidence + pair_correction(object, &stated),
        };
        let by_pairs: Vec<f64> = self.objects.iter().map(corrected).collect();
        self.weigh_stated(common, usual);
        for (object, by_pairs) in self.objects.iter_mut().zip(by_pairs) {
            object.log_evidence = log_sum_exp([object.log_evidence, by_pairs].into_iter()) - LN_2;
        }
    }

    /// The statement proposes poses of all objects, or of the likeliest of a large catalogue.
    pub(super) fn propose_stated(&mut self, common: &Common) {
        let Some(Stating { now, .. }) = &self.stated else { return };
        if now.n_poses() == 0 {
            return;
        }
        let (options, patches_max) = (&common.options, patches_max(common));
        let n = patches_max.map_or(usize::MAX, |_| options.budget.many.explored);
        let reach = f64::from(options.score.drop_between);
        let evidence_min = evidence_bar(&self.objects, reach, n);
        let turned = Turned::new(now, self.touches.len(), patches_max);
        let evidence = common.evidence(&self.touches, &self.spaces);
        propose_stated(&mut self.objects, &evidence, &turned, evidence_min);
    }
}

/// The patches that are laid onto a touch in a large catalogue; `None` in a small one.
fn patches_max(common: &Common) -> Option<usize> {
    common.model.is_large().then_some(TOUCHES_PER_OBJECT)
}
