//! Calibration: how far the recogniser's evidence can be believed, learnt on readings that
//! had no part in the maps.
//!
//! Trials of every object are recognised; with the object's own evidence left out the same
//! trial is one of an object that the catalogue does not know. Temperature and the evidence of
//! "none of these" are those under which both kinds of trials were the likeliest (Platt, 1999;
//! Guo et al., 2017).

use rayon::prelude::*;

use super::usual::Counted;
use super::{HybridBelief, HybridOptions, usual};
use crate::log_prob::log_sum_exp;
use crate::model::surface::{EvidenceCalibration, EvidenceStage, SurfaceModel};
use crate::reading::Reading;
use crate::rng::{Purpose, Stream};
use crate::sensor::SensorDescription;
use std::sync::Arc;

/// Trials of all objects together, about.
const TRIALS: usize = 400;

/// Trials of an object at most: its held-back readings are few.
const TRIALS_PER_OBJECT_MAX: usize = 40;

/// Readings of a trial.
const READINGS: usize = 8;

/// Fewer held-back readings of an object make no trials.
pub const HELD_BACK_MIN: usize = 6;

/// Readings of one object that had no part in its map, and the sensor that took them.
#[derive(Clone, Copy, Debug)]
pub struct HeldBack<'a> {
    /// The readings; poses in one frame.
    pub readings: &'a [Reading],
    /// Their sensor.
    pub sensor: &'a SensorDescription,
}

/// What one trial's touches said after one of them.
struct Sample {
    stage: usize,
    counted: Counted,
    own: f64,
    /// How well the object usually explains its own touches, ln a touch.
    own_usual: f64,
    /// ln evidence of all other objects, likeliest first, cut where it no longer matters, and
    /// how well they usually explain their own.
    others: Vec<[f64; 2]>,
}

/// Learns the calibration of a model from `held_back` readings, one set an object in the
/// model's order. The default where there are too few: no object has [`HELD_BACK_MIN`]
/// readings, or there is only one object.
#[must_use]
pub fn calibrate(
    model: &Arc<SurfaceModel>,
    held_back: &[HeldBack<'_>],
    options: HybridOptions,
    seed: u64,
) -> EvidenceCalibration {
    let usable: Vec<usize> =
        (0..held_back.len()).filter(|o| held_back[*o].readings.len() >= HELD_BACK_MIN).collect();
    if model.maps().len() < 2 || usable.is_empty() {
        return EvidenceCalibration::default();
    }
    let per_object = TRIALS.div_ceil(usable.len()).min(TRIALS_PER_OBJECT_MAX);
    let trials: Vec<(usize, usize)> =
        usable.iter().flat_map(|o| (0..per_object).map(move |trial| (*o, trial))).collect();
    let samples: Vec<Vec<Sample>> = trials
        .par_iter()
        .map(|(object, trial)| {
            let index = (object * TRIALS_PER_OBJECT_MAX + trial) as u64;
            let mut stream = Stream::new(seed, Purpose::ReadingChoice, index);
            run_trial(model, *object, &held_back[*object], options, &mut stream)
        })
        .collect();
    let samples: Vec<Sample> = samples.into_iter().flatten().collect();
    let mut calibration = EvidenceCalibration::default();
    for (stage, known) in calibration.stages.iter_mut().enumerate() {
        let of_stage: Vec<&Sample> = samples.iter().filter(|s| s.stage == stage).collect();
        if !of_stage.is_empty() {
            *known = fit(&of_stage, *known, stage == 2);
        }
    }
    calibration
}

fn run_trial(
    model: &Arc<SurfaceModel>,
    object: usize,
    held_back: &HeldBack<'_>,
    options: HybridOptions,
    stream: &mut Stream,
) -> Vec<Sample> {
    let mut left: Vec<&Reading> = held_back.readings.iter().collect();
    let Ok(mut belief) = HybridBelief::new(Arc::clone(model), options, None) else {
        return Vec::new();
    };
    let mut samples = Vec::with_capacity(READINGS);
    for _ in 0..READINGS.min(held_back.readings.len()) {
        let reading = left.swap_remove(stream.index(left.len()));
        belief.add(reading, held_back.sensor);
        let Some(stage) = belief.stage.checked_sub(1) else { continue };
        let evidence = |o: usize| belief.objects[o].log_evidence;
        let mut likely: Vec<(f64, usize)> =
            (0..model.maps().len()).filter(|o| *o != object).map(|o| (evidence(o), o)).collect();
        likely.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let best = likely[0].0;
        likely.retain(|(log, _)| *log > best - 60.0);
        let others = likely.iter().map(|(log, o)| [*log, belief.usual_score(*o)]).collect();
        let (counted, own_usual) = (belief.counted(), belief.usual_score(object));
        samples.push(Sample { stage, counted, own: evidence(object), own_usual, others });
    }
    samples
}

/// The likeliest stage by coordinate descent from a start; the loss is smooth and the
/// parameters are few.
fn fit(samples: &[&Sample], start: EvidenceStage, with_slope: bool) -> EvidenceStage {
    let build = |p: [f64; 3]| EvidenceStage {
        temperature: p[0].exp(),
        unknown: p[1],
        unknown_per_touch: if with_slope { p[2] } else { 0.0 },
    };
    let mut at = [start.temperature.ln(), start.unknown, start.unknown_per_touch];
    let mut steps = [0.5, 4.0, 2.0];
    let mut best = loss(samples, &build(at));
    for _pass in 0..200 {
        let mut moved = false;
        for axis in 0..if with_slope { 3 } else { 2 } {
            for sign in [1.0, -1.0] {
                let mut tried = at;
                tried[axis] += sign * steps[axis];
                // Evidence is never believed more than it says, and never less than a tenth.
                tried[0] = tried[0].clamp(0.0, 10.0f64.ln());
                if axis == 2 {
                    // The slope turns about the middle of the trials, not about no touch.
                    tried[1] -= sign * steps[2] * 0.5 * READINGS as f64;
                }
                let found = loss(samples, &build(tried));
                if found < best {
                    (best, at, moved) = (found, tried, true);
                }
            }
        }
        if !moved {
            steps = steps.map(|step| 0.5 * step);
            if steps[0] < 1e-3 {
                break;
            }
        }
    }
    build(at)
}

/// Mean −ln probability of the truth, over trials of known objects and the same trials as
/// ones of an unknown object, weighed alike.
fn loss(samples: &[&Sample], stage: &EvidenceStage) -> f64 {
    let each = |sample: &&Sample| {
        let heat = |log: f64| log / stage.temperature;
        let others = log_sum_exp(sample.others.iter().map(|other| heat(other[0])));
        let own = heat(sample.own);
        let [unknown_with, unknown] = [Some(sample.own), None].map(|own| {
            let unusual =
                if sample.stage == 2 { sample.unusual(own, stage.temperature) } else { 0.0 };
            heat(stage.log_unknown(sample.counted.touches) + unusual)
        });
        let with = log_sum_exp([own, others, unknown_with].into_iter());
        let without = log_sum_exp([others, unknown].into_iter());
        (with - own) + (without - unknown)
    };
    samples.iter().map(each).sum::<f64>() / samples.len() as f64
}

impl Sample {
    /// [`usual::unusual`] beside the other objects and, when its evidence is given, the own one.
    fn unusual(&self, own: Option<f64>, temperature: f64) -> f64 {
        let n = self.others.len();
        let others = self.others.iter().map(|other| other[0]).enumerate();
        let all = others.chain(own.map(|log| (n, log)));
        usual::unusual(self.counted, all, temperature, |at| {
            self.others.get(at).map_or(self.own_usual, |other| other[1])
        })
    }
}
