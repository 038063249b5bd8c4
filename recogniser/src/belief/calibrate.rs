//! Calibration of evidence, learnt on readings held back from training.
//!
//! Trials of every object are recognised twice: by the whole catalogue, and by the catalogue
//! without the object. Temperature and the evidence of "none of these" maximise the likelihood
//! of both kinds of trials (Platt, 1999; Guo et al., 2017). Equation R23 of docs/recogniser.md.

use std::sync::Arc;

use palpate_core::log_prob::log_sum_exp;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use rayon::prelude::*;

use super::object::ObjectBelief;
use super::posterior::counted;
use super::surface_belief::SurfaceBelief;
use crate::model::SurfaceModel;
use crate::model::calibration::{CalibrationBasis, EvidenceCalibration, EvidenceStage};
use crate::observe::observation::Says;
use crate::options::{ScoreScale, SurfaceOptions};
use crate::verify::null_model::{self, Counted};

/// Approximate number of trials of all objects together; they take at most a minute.
pub const TRIALS: usize = 400;

/// Maximum number of trials per object, since its held-back readings are few.
const TRIALS_PER_OBJECT_MAX: usize = 40;

/// Readings per trial, about as many as a session needs.
pub const READINGS: usize = 8;

/// Minimum number of held-back readings per object with trials, so that trials differ.
pub const HELD_BACK_MIN: usize = 6;

/// Cap on the temperature: evidence counts at least a tenth of its value.
const TEMPERATURE_MAX: f64 = 10.0;

/// Initial steps of the descent in ln temperature, evidence, and evidence per touch.
const STEPS: [f64; 3] = [0.5, 4.0, 2.0];

/// The descent ends when the step in ln temperature is below this, or after this many passes.
const STEP_MIN: f64 = 1e-3;
const PASSES_MAX: usize = 200;

/// Number of runs by one sensor each, per object, that give every trial its own run.
#[must_use]
pub fn runs_per_object(n_objects: usize) -> usize {
    TRIALS.div_ceil(n_objects.max(1)).min(TRIALS_PER_OBJECT_MAX)
}

/// Readings of one object that were not used for its map, and their sensor.
#[derive(Clone, Copy, Debug)]
pub struct HeldBack<'a> {
    /// The readings; poses in one frame.
    pub readings: &'a [Reading],
    /// Their sensor.
    pub sensor: &'a SensorDescription,
    /// Number of consecutive readings taken by one sensor of a family, above 0: a trial uses
    /// one such run. `None`: one sensor took all readings.
    pub run: Option<usize>,
}

/// Evidence of a trial's touches for one object.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Evidence {
    /// ln evidence, without the prior.
    log: f64,
    log_prior: f64,
    /// Self-match score of the object, ln per touch.
    self_match: f64,
}

/// Evidence of one trial after one of its touches.
#[derive(Clone, Debug)]
struct Sample {
    /// Index of the calibrated stage.
    stage: usize,
    counted: Counted,
    /// Evidence of the true object, if the catalogue has it.
    own: Option<Evidence>,
    /// Evidence of the other objects, likeliest first, without negligible ones.
    others: Vec<Evidence>,
}

/// Learns the calibration of a model from `held_back` readings, one set an object in the model's
/// order. Returns the default calibration with the reason if no object has [`HELD_BACK_MIN`]
/// readings or there is only one object.
#[must_use]
pub fn calibrate(
    model: &Arc<SurfaceModel>,
    held_back: &[HeldBack<'_>],
    options: SurfaceOptions,
    seed: u64,
) -> EvidenceCalibration {
    let usable: Vec<usize> =
        (0..held_back.len()).filter(|o| held_back[*o].readings.len() >= HELD_BACK_MIN).collect();
    let without = |basis| EvidenceCalibration { basis, ..EvidenceCalibration::default() };
    if model.maps().len() < 2 {
        return without(CalibrationBasis::OneObject);
    }
    if usable.is_empty() {
        return without(CalibrationBasis::FewReadings);
    }
    let per_object = TRIALS.div_ceil(usable.len()).min(TRIALS_PER_OBJECT_MAX);
    let trials: Vec<(usize, usize)> =
        usable.iter().flat_map(|o| (0..per_object).map(move |trial| (*o, trial))).collect();
    let samples: Vec<Vec<Sample>> = trials
        .par_iter()
        .map(|(object, trial)| {
            let index = (object * TRIALS_PER_OBJECT_MAX + trial) as u64;
            let readings =
                drawn(&held_back[*object], Stream::new(seed, Purpose::ReadingChoice, index));
            let sensor = held_back[*object].sensor;
            let known = [true, false].into_iter();
            known
                .flat_map(|is_known| {
                    run_trial(model, *object, is_known, &readings, sensor, options)
                })
                .collect()
        })
        .collect();
    let samples: Vec<Sample> = samples.into_iter().flatten().collect();
    let mut calibration = without(CalibrationBasis::HeldBack { objects: usable.len() });
    for (stage, known) in calibration.stages.iter_mut().enumerate() {
        let of_stage = |is_known: bool| -> Vec<&Sample> {
            samples.iter().filter(|s| s.stage == stage && s.own.is_some() == is_known).collect()
        };
        let [with, without] = [true, false].map(of_stage);
        if !with.is_empty() && !without.is_empty() {
            *known = fit([&with, &without], *known, stage == 2, &options.score);
        }
    }
    calibration
}

/// The readings of a trial, none of them twice.
fn drawn<'a>(held_back: &HeldBack<'a>, mut stream: Stream) -> Vec<&'a Reading> {
    let all = held_back.readings;
    let of_one_sensor = match held_back.run {
        Some(run) if run < all.len() => {
            let runs: Vec<&[Reading]> = all.chunks_exact(run.max(1)).collect();
            runs[stream.index(runs.len())]
        }
        _ => all,
    };
    let mut left: Vec<&Reading> = of_one_sensor.iter().collect();
    let n = READINGS.min(left.len());
    (0..n).map(|_| left.swap_remove(stream.index(left.len()))).collect()
}

/// Recognises a trial of an object by the whole catalogue, or by the catalogue without it.
fn run_trial(
    model: &Arc<SurfaceModel>,
    object: usize,
    is_known: bool,
    readings: &[&Reading],
    sensor: &SensorDescription,
    options: SurfaceOptions,
) -> Vec<Sample> {
    let n_objects = model.maps().len();
    let prior: Vec<f64> =
        (0..n_objects).map(|o| f64::from(u8::from(is_known || o != object))).collect();
    let Ok(mut belief) = SurfaceBelief::new(Arc::clone(model), options, Some(&prior)) else {
        return Vec::new();
    };
    let mut samples = Vec::with_capacity(readings.len());
    for reading in readings {
        belief.add(reading, sensor);
        let (common, rest) = belief.at_rest();
        let Some(stage) = rest.stage.calibrated() else { continue };
        let evidence = |o: usize| Evidence {
            log: rest.objects[o].log_evidence,
            log_prior: common.prior.log_objects[o],
            self_match: common.self_match(o, Says::All),
        };
        let likely = likeliest(rest.objects, object, options.score.negligible);
        let own = is_known.then(|| evidence(object));
        let others = likely.into_iter().map(evidence).collect();
        samples.push(Sample { stage, counted: counted(common, &rest), own, others });
    }
    samples
}

/// All objects but `own`, likeliest first, without those of negligible evidence.
fn likeliest(objects: &[ObjectBelief], own: usize, negligible: f64) -> Vec<usize> {
    let log = |o: usize| objects[o].log_evidence;
    let is_other = |o: &usize| *o != own && !objects[*o].is_ruled_out;
    let mut likely: Vec<usize> = (0..objects.len()).filter(is_other).collect();
    likely.sort_by(|a, b| log(*b).total_cmp(&log(*a)).then(a.cmp(b)));
    let best = likely.first().map_or(f64::NEG_INFINITY, |o| log(*o));
    likely.retain(|o| log(*o) > best - negligible);
    likely
}

/// Maximum-likelihood parameters of a stage by coordinate descent from a start; the loss is
/// smooth and the parameters are few. `samples` are those of known objects, then of unknown
/// ones.
fn fit(
    samples: [&[&Sample]; 2],
    start: EvidenceStage,
    with_slope: bool,
    scale: &ScoreScale,
) -> EvidenceStage {
    let build = |p: [f64; 3]| EvidenceStage {
        temperature: p[0].exp(),
        unknown: p[1],
        unknown_per_touch: if with_slope { p[2] } else { 0.0 },
    };
    let mut at = [start.temperature.ln(), start.unknown, start.unknown_per_touch];
    let mut steps = STEPS;
    let mut best = loss(samples, &build(at), scale);
    for _pass in 0..PASSES_MAX {
        let mut moved = false;
        for axis in 0..if with_slope { 3 } else { 2 } {
            for sign in [1.0, -1.0] {
                let mut tried = at;
                tried[axis] += sign * steps[axis];
                // The temperature is at least 1, so that evidence never counts more than its value.
                tried[0] = tried[0].clamp(0.0, TEMPERATURE_MAX.ln());
                if axis == 2 {
                    // A change of the slope pivots about the middle of the trials, not about
                    // zero touches.
                    tried[1] -= sign * steps[2] * 0.5 * READINGS as f64;
                }
                let found = loss(samples, &build(tried), scale);
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
    build(at)
}

/// Mean −ln probability of the truth, averaged over trials of known objects and over trials of
/// unknown objects with equal weight, whatever their numbers.
fn loss(samples: [&[&Sample]; 2], stage: &EvidenceStage, scale: &ScoreScale) -> f64 {
    let mean = |samples: &[&Sample]| {
        samples.iter().map(|sample| sample.surprise(stage, scale)).sum::<f64>()
            / samples.len() as f64
    };
    samples.into_iter().map(mean).sum()
}

impl Sample {
    /// −ln probability of the truth when "none of these" is as probable as all objects together
    /// before the touches.
    fn surprise(&self, stage: &EvidenceStage, scale: &ScoreScale) -> f64 {
        let heat = |of: &Evidence| of.log / stage.temperature + of.log_prior;
        let correction =
            if self.stage == 2 { self.correction(stage.temperature, scale) } else { 0.0 };
        let unknown = stage.log_unknown(self.counted.touches) + correction;
        let unknown = unknown / stage.temperature;
        let known = self.own.iter().chain(&self.others).map(heat);
        let all = log_sum_exp(known.chain([unknown]));
        all - self.own.as_ref().map_or(unknown, heat)
    }

    /// [`null_model::correction`] beside the objects of the catalogue.
    fn correction(&self, temperature: f64, scale: &ScoreScale) -> f64 {
        let all: Vec<&Evidence> = self.own.iter().chain(&self.others).collect();
        let logs = all.iter().map(|of| of.log).enumerate();
        null_model::correction(self.counted, logs, temperature, scale, |at| all[at].self_match)
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::pose::Pose;
    use palpate_core::reading::SensorId;

    use super::*;

    const TEMPERATURE: f64 = 2.5;
    const UNKNOWN: f64 = 12.0;

    /// A trial after two touches with one object. Its ln likelihood ratios are about 3 if it is
    /// the touched object, else about −3, with a spread that makes them calibrated; its evidence
    /// is these ratios times [`TEMPERATURE`].
    fn sample(is_known: bool, stream: &mut Stream) -> Sample {
        let ratio = if is_known { 3.0 } else { -3.0 } + 6f64.sqrt() * stream.normal();
        let evidence =
            Evidence { log: UNKNOWN + TEMPERATURE * ratio, log_prior: 0.0, self_match: 12.0 };
        let counted = Counted { touches: 2.0, loss: 0.0, lacking: [0.0; 2] };
        let (own, others) =
            if is_known { (Some(evidence), vec![]) } else { (None, vec![evidence]) };
        Sample { stage: 1, counted, own, others }
    }

    fn samples(is_known: bool, n: usize) -> Vec<Sample> {
        let mut stream = Stream::new(5, Purpose::Sampling, u64::from(is_known));
        (0..n).map(|_| sample(is_known, &mut stream)).collect()
    }

    #[test]
    fn a_trial_has_the_readings_of_one_sensor() {
        // Twenty readings at x = 0 to 19 m, of which each eight are of one sensor; the last
        // four are no whole run.
        let sensor = SensorDescription::digitacts_6x6();
        let reading = |x: u32| {
            let pose = Pose::from_parts(glam::DQuat::IDENTITY, glam::DVec3::X * f64::from(x));
            Reading::new(SensorId(0), &sensor, &[Some(1e3); 36], pose).unwrap()
        };
        let readings: Vec<Reading> = (0..20).map(reading).collect();
        let mut first = [false; 2];
        for trial in 0..40 {
            let held_back = HeldBack { readings: &readings, sensor: &sensor, run: Some(8) };
            let stream = Stream::new(3, Purpose::ReadingChoice, trial);
            let run_of = |r: &&Reading| r.session_from_sensor().translation.x as usize / 8;
            let runs: Vec<usize> = drawn(&held_back, stream).iter().map(run_of).collect();
            assert!(runs.len() == 8 && runs.iter().all(|run| *run == runs[0]), "{runs:?}");
            first[runs[0]] = true;
        }
        assert_eq!(first, [true, true]);
    }

    fn learnt(known: &[Sample], unknown: &[Sample]) -> EvidenceStage {
        let (known, unknown): (Vec<&Sample>, Vec<&Sample>) =
            (known.iter().collect(), unknown.iter().collect());
        let start = EvidenceCalibration::default().stages[1];
        fit([&known, &unknown], start, false, &SurfaceOptions::default().score)
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
}
