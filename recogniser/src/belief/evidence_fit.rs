//! Fit of the map from evidence to probability: the evidence of trials, and the parameters that
//! maximise the likelihood of their truth. Equation R23 of docs/recogniser.md.

use palpate_core::log_prob::log_sum_exp;

use super::object::ObjectBelief;
use super::posterior::counted;
use super::surface_belief::SurfaceBelief;
use crate::model::calibration::EvidenceStage;
use crate::observe::observation::Says;
use crate::options::ScoreScale;
use crate::verify::null_model::{self, Counted};

/// Cap on the temperature: evidence counts at least a tenth of its value.
const TEMPERATURE_MAX: f64 = 10.0;

/// Initial steps of the descent in ln temperature, evidence, and evidence per touch.
const STEPS: [f64; 3] = [0.5, 4.0, 2.0];

/// The descent ends when the step in ln temperature is below this, or after this many passes.
const STEP_MIN: f64 = 1e-3;
const PASSES_MAX: usize = 200;

/// Share in the belief from which a kind of evidence is a sample of its stage.
const DECIDES: f64 = 0.5;

/// Evidence of a trial's touches for one object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Evidence {
    /// ln evidence, without the prior.
    pub(super) log: f64,
    pub(super) log_prior: f64,
    /// Self-match score of the object, ln per touch.
    pub(super) self_match: f64,
    /// What touches that lack appearance, or a normal too, lose under it (ln).
    pub(super) lost: f64,
}

/// Evidence of one trial after one of its touches.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    /// Index of the calibrated stage.
    pub(super) stage: usize,
    pub(super) counted: Counted,
    /// Evidence of the true object, if the catalogue has it.
    pub(super) own: Option<Evidence>,
    /// Evidence of the other objects, likeliest first, without negligible ones.
    pub(super) others: Vec<Evidence>,
}

/// The evidence of a belief's touches. `object` is the touched one, which the catalogue has if
/// it `is_known`; `None` for an object that it lacks. `None` before there is any evidence.
pub(super) fn sample(
    belief: &SurfaceBelief,
    object: Option<usize>,
    is_known: bool,
    negligible: f64,
) -> Option<Sample> {
    let (common, rest) = belief.at_rest();
    let kind = rest.kinds().into_iter().find(|kind| kind.share > DECIDES)?;
    let stage = kind.stage.calibrated()?;
    let counted = counted(common, &rest);
    let evidence = |o: usize| Evidence {
        log: kind.logs[o],
        log_prior: common.prior.log_objects[o],
        self_match: common.self_match(o, Says::All),
        lost: common.lost(o, counted.lacking),
    };
    let likely = likeliest(&kind.logs, rest.objects, object, negligible);
    let own = object.filter(|_| is_known).map(evidence);
    let others = likely.into_iter().map(evidence).collect();
    Some(Sample { stage, counted, own, others })
}

/// All objects but `own`, likeliest first, without those of negligible evidence.
fn likeliest(
    logs: &[f64],
    objects: &[ObjectBelief],
    own: Option<usize>,
    negligible: f64,
) -> Vec<usize> {
    let log = |o: usize| logs[o];
    let is_other = |o: &usize| Some(*o) != own && !objects[*o].is_ruled_out;
    let mut likely: Vec<usize> = (0..objects.len()).filter(is_other).collect();
    likely.sort_by(|a, b| log(*b).total_cmp(&log(*a)).then(a.cmp(b)));
    let best = likely.first().map_or(f64::NEG_INFINITY, |o| log(*o));
    likely.retain(|o| log(*o) > best - negligible);
    likely
}

/// A fit of one stage.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit<'a> {
    /// Start of the descent, and mean of the prior.
    pub(super) start: EvidenceStage,
    /// Whether the evidence per touch is fitted.
    pub(super) with_slope: bool,
    /// Number of touches in the middle of the trials.
    pub(super) middle: f64,
    /// Weight of the prior, whose deviations are [`STEPS`]: 1/(2n) for n sessions, 0 without a
    /// prior.
    pub(super) prior: f64,
    /// Temperature by which objects are weighed where touches lack something, if it is not that of
    /// the stage.
    pub(super) weighing: Option<f64>,
    pub(super) scale: &'a ScoreScale,
}

impl Fit<'_> {
    /// The parameters of the stage that minimise the loss, and the loss, by coordinate descent from
    /// the start: it is smooth and the parameters are few. `samples` are those of known
    /// objects, then of unknown ones.
    pub(super) fn run(&self, samples: [&[&Sample]; 2]) -> (EvidenceStage, f64) {
        let build = |p: [f64; 3]| EvidenceStage {
            temperature: p[0].exp(),
            unknown: p[1],
            unknown_per_touch: if self.with_slope { p[2] } else { 0.0 },
        };
        let start = self.start;
        let mut at = [start.temperature.ln(), start.unknown, start.unknown_per_touch];
        let mut steps = STEPS;
        let mut best = self.loss(samples, &build(at));
        for _pass in 0..PASSES_MAX {
            let mut moved = false;
            for axis in 0..if self.with_slope { 3 } else { 2 } {
                for sign in [1.0, -1.0] {
                    let mut tried = at;
                    tried[axis] += sign * steps[axis];
                    // The temperature is at least 1, so that evidence never counts more than its
                    // value.
                    tried[0] = tried[0].clamp(0.0, TEMPERATURE_MAX.ln());
                    if axis == 2 {
                        // A change of the slope pivots about the middle of the trials, not about
                        // zero touches.
                        tried[1] -= sign * steps[2] * self.middle;
                    }
                    let found = self.loss(samples, &build(tried));
                    if found < best {
                        (best, at, moved) = (found, tried, true);
                    }
                }
            }
            if !moved {
                steps = steps.map(|step| 0.5 * step);
                if steps[0] < STEP_MIN {
                    break;
                }
            }
        }
        (build(at), best)
    }

    /// Mean −ln probability of the truth, averaged over trials of known objects and over trials
    /// of unknown objects with equal weight, whatever their numbers; and the prior.
    fn loss(&self, samples: [&[&Sample]; 2], stage: &EvidenceStage) -> f64 {
        let mean = |samples: &[&Sample]| {
            let all = samples.iter().map(|sample| sample.surprise(stage, self));
            all.sum::<f64>() / samples.len() as f64
        };
        samples.into_iter().map(mean).sum::<f64>() + self.prior * self.distance(stage)
    }

    /// Squared distance of a stage from the start, in deviations of the prior.
    fn distance(&self, stage: &EvidenceStage) -> f64 {
        let start = &self.start;
        let off = [
            (stage.temperature / start.temperature).ln(),
            stage.log_unknown(self.middle) - start.log_unknown(self.middle),
            stage.unknown_per_touch - start.unknown_per_touch,
        ];
        off.iter().zip(STEPS).map(|(off, deviation)| (off / deviation).powi(2)).sum()
    }
}

impl Sample {
    /// −ln probability of the truth when "none of these" is as probable as all objects together
    /// before the touches.
    fn surprise(&self, stage: &EvidenceStage, fit: &Fit<'_>) -> f64 {
        let heat = |of: &Evidence| of.log / stage.temperature + of.log_prior;
        let unknown = stage.log_unknown(self.counted.touches) + self.correction(stage, fit);
        let unknown = unknown / stage.temperature;
        let known = self.own.iter().chain(&self.others).map(heat);
        let all = log_sum_exp(known.chain([unknown]));
        all - self.own.as_ref().map_or(unknown, heat)
    }

    /// The correction of equations R13 and R13a beside the objects of the catalogue.
    fn correction(&self, stage: &EvidenceStage, fit: &Fit<'_>) -> f64 {
        let all: Vec<&Evidence> = self.own.iter().chain(&self.others).collect();
        let logs = all.iter().map(|of| of.log).enumerate();
        let temperature = fit.weighing.unwrap_or(stage.temperature);
        let lack = match self.counted.lacking {
            [0.0, 0.0] => 0.0,
            _ => null_model::lack(logs.clone(), temperature, |at| all[at].lost),
        };
        if self.stage != 2 {
            return -lack;
        }
        let self_match = |at: usize| all[at].self_match;
        null_model::correction(self.counted, logs, temperature, fit.scale, self_match) - lack
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::rng::{Purpose, Stream};

    use super::*;
    use crate::model::EvidenceCalibration;
    use crate::options::SurfaceOptions;

    const TEMPERATURE: f64 = 2.5;
    const UNKNOWN: f64 = 12.0;

    /// A trial after two touches with one object. Its ln likelihood ratios are about 3 if it is
    /// the touched object, else about −3, with a spread that makes them calibrated; its evidence
    /// is these ratios times [`TEMPERATURE`].
    fn sample(is_known: bool, stream: &mut Stream) -> Sample {
        let ratio = if is_known { 3.0 } else { -3.0 } + 6f64.sqrt() * stream.normal();
        let evidence = Evidence {
            log: UNKNOWN + TEMPERATURE * ratio,
            log_prior: 0.0,
            self_match: 12.0,
            lost: 0.0,
        };
        let counted = Counted { touches: 2.0, loss: 0.0, lacking: [0.0; 2] };
        let (own, others) =
            if is_known { (Some(evidence), vec![]) } else { (None, vec![evidence]) };
        Sample { stage: 1, counted, own, others }
    }

    fn samples(is_known: bool, n: usize) -> Vec<Sample> {
        let mut stream = Stream::new(5, Purpose::Sampling, u64::from(is_known));
        (0..n).map(|_| sample(is_known, &mut stream)).collect()
    }

    fn fitted(known: &[Sample], unknown: &[Sample], prior: f64) -> EvidenceStage {
        let (known, unknown): (Vec<&Sample>, Vec<&Sample>) =
            (known.iter().collect(), unknown.iter().collect());
        let scale = SurfaceOptions::default().score;
        let fit = Fit {
            start: EvidenceCalibration::default().stages[1],
            with_slope: false,
            middle: 0.0,
            prior,
            weighing: None,
            scale: &scale,
        };
        fit.run([&known, &unknown]).0
    }

    fn learnt(known: &[Sample], unknown: &[Sample]) -> EvidenceStage {
        fitted(known, unknown, 0.0)
    }

    #[test]
    fn temperature_and_evidence_of_none_of_these_are_found() {
        let found = learnt(&samples(true, 4_000), &samples(false, 4_000));
        assert!((found.temperature - TEMPERATURE).abs() < 0.15, "{found:?}");
        assert!((found.unknown - UNKNOWN).abs() < 0.5, "{found:?}");
    }

    #[test]
    fn the_two_kinds_of_trials_weigh_alike() {
        let (even, uneven) = (samples(false, 4_000), samples(false, 1_000));
        let known = samples(true, 4_000);
        let [even, uneven] = [even, uneven].map(|unknown| learnt(&known, &unknown));
        assert!((even.unknown - uneven.unknown).abs() < 0.7, "{even:?} {uneven:?}");
    }

    #[test]
    fn a_catalogue_of_twins_needs_the_calibration_of_one() {
        // Twenty objects with equal evidence, each with a twentieth of the prior.
        let spread = |sample: &Sample| {
            let of =
                |evidence: &Evidence| vec![Evidence { log_prior: -20f64.ln(), ..*evidence }; 20];
            Sample { others: sample.others.iter().flat_map(of).collect(), ..sample.clone() }
        };
        let (known, unknown) = (samples(true, 500), samples(false, 500));
        let many: Vec<Sample> = unknown.iter().map(spread).collect();
        let (one, many) = (learnt(&known, &unknown), learnt(&known, &many));
        assert!((one.unknown - many.unknown).abs() < 1e-2, "{one:?} {many:?}");
        assert!((one.temperature - many.temperature).abs() < 1e-2, "{one:?} {many:?}");
    }

    #[test]
    fn few_trials_leave_a_stage_near_its_start() {
        let (known, unknown) = (samples(true, 400), samples(false, 400));
        let start = EvidenceCalibration::default().stages[1];
        let moved = |n: f64| fitted(&known, &unknown, 0.5 / n).unknown - start.unknown;
        // The prior of one session outweighs the trials, that of a thousand does not.
        assert!(moved(1.0) > 0.0 && moved(1.0) < 0.5 * moved(1_000.0), "{}", moved(1.0));
        assert!((moved(1_000.0) - UNKNOWN).abs() < 1.0, "{}", moved(1_000.0));
    }
}
