//! The posterior of one component over the objects and "none of these" (equation R18).

use palpate_core::log_prob::{log_sum_exp, normalize};

use super::common::Common;
use super::motion::Motion;
use super::object::ObjectBelief;
use super::places::{Kind, Places};
use super::stage::Stage;
use crate::observe::observation::{Observation, Says};
use crate::observe::placement::HALF;
use crate::verify::null_model::{self, Counted};
use crate::verify::stated_prior::StatedPrior;

/// Inputs of a component's posterior.
#[derive(Clone, Copy)]
pub(super) struct Explained<'a> {
    pub(super) stage: Stage,
    pub(super) places: &'a Places,
    pub(super) motion: Motion,
    pub(super) touches: &'a [Observation],
    pub(super) objects: &'a [ObjectBelief],
    /// What the session states about the pose.
    pub(super) stated: Option<&'a StatedPrior>,
}

impl Explained<'_> {
    /// The kinds of evidence, with their shares in the belief.
    pub(super) fn kinds(&self) -> Vec<Kind> {
        self.places.kinds(self.stage, self.objects)
    }

    /// The number of places that the touches show, to the nearest.
    pub(super) fn n_places(&self) -> usize {
        self.touches.iter().map(|touch| touch.novelty).sum::<f32>().round() as usize
    }
}

/// ln probability of each object, then of "none of these", up to a common constant: the mean of
/// the probabilities by each kind of evidence.
///
/// Equations R17a and R18 of docs/recogniser.md.
pub(super) fn log_posterior(common: &Common, of: &Explained<'_>) -> Vec<f64> {
    let kinds = of.kinds();
    let by: Vec<Vec<f64>> = kinds.iter().map(|kind| log_posterior_by(common, of, kind)).collect();
    if let [only] = &by[..] {
        return only.clone();
    }
    let totals: Vec<f64> = by.iter().map(|logs| log_sum_exp(logs.iter().copied())).collect();
    let total: f64 = kinds.iter().zip(&totals).map(|(kind, log)| kind.share * log).sum();
    let mean = |n: usize| {
        let all = kinds.iter().zip(&by).zip(&totals);
        total + log_sum_exp(all.map(|((kind, logs), log)| kind.share.ln() + logs[n] - log))
    };
    (0..=of.objects.len()).map(mean).collect()
}

/// ln probability by one kind of evidence. Equation R18.
fn log_posterior_by(common: &Common, of: &Explained<'_>, kind: &Kind) -> Vec<f64> {
    let prior = &common.prior;
    let known = (1.0 - prior.unknown).ln();
    let Some(stage) = kind.stage.calibrated() else {
        let logs = prior.log_objects.iter().map(|log| log + known);
        return logs.chain([prior.unknown.ln()]).collect();
    };
    let stage = &common.model.calibration.stages[stage];
    let logs = kind.logs.iter().zip(&prior.log_objects).enumerate().map(|(n, (log, prior))| {
        (log + log_discounted(common, of, n)) / stage.temperature + prior + known
    });
    let counted = counted(common, of);
    let unknown = stage.log_unknown(counted.touches)
        + null_correction(common, kind, counted)
        + stated_unknown(of);
    let unknown = unknown / stage.temperature;
    logs.chain([unknown + prior.unknown.ln()]).collect()
}

/// The probability of each object, then of "none of these", by this component alone.
pub(super) fn posterior(common: &Common, of: &Explained<'_>) -> Vec<f64> {
    normalize(&log_posterior(common, of))
}

/// What the stated place of the object adds to the evidence of "none of these". Equation R34.
fn stated_unknown(of: &Explained<'_>) -> f64 {
    let Some(stated) = of.stated else { return 0.0 };
    let n: f32 = of.touches.iter().map(|touch| touch.novelty).sum();
    let sum: glam::Vec3 = of.touches.iter().map(|touch| touch.novelty * touch.position).sum();
    stated.log_unknown(sum / n.max(1.0), n.max(1.0).into())
}

/// The correction of equation R13: once there are poses, and for touches without appearance from
/// the first pair on.
fn null_correction(common: &Common, of: &Kind, counted: Counted) -> f64 {
    if of.stage == Stage::Appearance {
        return 0.0;
    }
    let temperature = common.model.calibration.stages[2].temperature;
    let logs = of.logs.iter().copied().enumerate();
    let lack = match counted.lacking {
        [0.0, 0.0] => 0.0,
        lacking => null_model::lack(logs.clone(), temperature, |o| common.lost(o, lacking)),
    };
    if of.stage != Stage::Poses {
        return -lack;
    }
    let self_match = |object| common.self_match(object, Says::All);
    let scale = &common.options.score;
    null_model::correction(counted, logs, temperature, scale, self_match) - lack
}

/// Number of touches, by their weight in the evidence of "none of these", and their losses.
pub(super) fn counted(common: &Common, of: &Explained<'_>) -> Counted {
    let is_announced = !of.motion.is_unannounced();
    let loose_loss = common.options.score.loose_loss;
    let counts = |touch: &Observation| f64::from(touch.counts(is_announced));
    let loss = |touch| counts(touch) * f64::from(touch.loss(is_announced, loose_loss));
    let touches = of.touches.iter().map(counts).sum();
    let lacking = [Says::Normal, Says::Position].map(|says| {
        // The sum of an empty iterator is −0.
        let of_kind = of.touches.iter().filter(|touch| touch.says == says);
        of_kind.map(counts).fold(0.0, |sum, weight| sum + weight)
    });
    Counted { touches, loss: of.touches.iter().map(loss).sum(), lacking }
}

/// The number of touches by weight.
pub(super) fn n_weighed(touches: &[Observation]) -> f64 {
    touches.iter().map(|touch| f64::from(touch.weight)).sum()
}

/// Evidence (ln) for an object from the weight that touches lost by unannounced drift: the
/// density of a touch about the object relative to that anywhere in the workspace. Part of
/// equation R16.
fn log_discounted(common: &Common, of: &Explained<'_>, object: usize) -> f64 {
    if !of.motion.is_unannounced() {
        return 0.0;
    }
    let discounted = counted(common, of).touches - n_weighed(of.touches);
    let radius = f64::from(common.model.radius(object).max(HALF));
    let about = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
    discounted * (f64::from(common.options.scale.workspace) / about).ln().max(0.0)
}
