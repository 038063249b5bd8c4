//! Calibration of evidence, learnt on readings held back from training.
//!
//! Trials of every object are recognised twice: by the whole catalogue, and by the catalogue
//! without the object. Temperature and the evidence of "none of these" maximise the likelihood
//! of both kinds of trials (Platt, 1999; Guo et al., 2017). Equation R23 of docs/recogniser.md.

use std::sync::Arc;

use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use rayon::prelude::*;

use super::evidence_fit::{Fit, Sample, sample};
use super::surface_belief::SurfaceBelief;
use crate::model::SurfaceModel;
use crate::model::calibration::{CalibrationBasis, EvidenceCalibration};
use crate::options::SurfaceOptions;

/// Approximate number of trials of all objects together; they take at most a minute.
pub const TRIALS: usize = 400;

/// Maximum number of trials per object, since its held-back readings are few.
const TRIALS_PER_OBJECT_MAX: usize = 40;

/// Readings per trial, about as many as a session needs.
pub const READINGS: usize = 8;

/// Minimum number of held-back readings per object with trials, so that trials differ.
pub const HELD_BACK_MIN: usize = 6;

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
    if model.n_objects() < 2 {
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
            let fit = Fit {
                start: *known,
                with_slope: stage == 2,
                middle: 0.5 * READINGS as f64,
                prior: 0.0,
                weighing: None,
                scale: &options.score,
            };
            *known = fit.run([&with, &without]).0;
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
    let n_objects = model.n_objects();
    let prior: Vec<f64> =
        (0..n_objects).map(|o| f64::from(u8::from(is_known || o != object))).collect();
    let Ok(mut belief) = SurfaceBelief::new(Arc::clone(model), options, Some(&prior)) else {
        return Vec::new();
    };
    let mut samples = Vec::with_capacity(readings.len());
    for reading in readings {
        belief.add(reading, sensor);
        let negligible = options.score.negligible;
        samples.extend(sample(&belief, Some(object), is_known, negligible));
    }
    samples
}

#[cfg(test)]
mod tests {
    use palpate_core::pose::Pose;
    use palpate_core::reading::SensorId;

    use super::*;

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
}
