//! Recalibration from ended sessions whose true object is known: "none of these" and the
//! temperatures, the width of the sensor, and the stop rule. Equations R28 to R31 of
//! docs/recogniser.md.
//!
//! The sessions make two halves. What is fitted to one half is judged on the other, beside the
//! calibration of before; the result is fitted to both. Every number has a prior about the
//! calibration of before, so that few sessions change it little.

use std::cmp::Ordering;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering as Atomic};

use rayon::prelude::*;

use super::evidence_fit::{Fit, Sample};
use super::quality::{Quality, losses, mean, quality};
use super::replay::{PastSession, Task, Trial, replay, tasks};
use super::stop_fit::stop_rule;
use crate::model::SurfaceModel;
use crate::model::calibration::{CalibrationBasis, EvidenceCalibration};
use crate::options::SurfaceOptions;

/// Maximum number of sessions; they take some minutes at most.
pub const SESSIONS_MAX: usize = 300;

/// Minimum number of sessions of known objects, so that each half has ten.
pub const SESSIONS_MIN: usize = 20;

/// Minimum number of readings of a session: three touches have poses.
pub const READINGS_MIN: usize = 3;

/// Widths that are tried beside the one of before.
const WIDTHS: [f64; 5] = [0.7, 1.0, 1.4, 2.0, 2.8];

/// Deviation of the prior of the logarithm of the width.
const WIDTH_DEVIATION: f64 = std::f64::consts::LN_2;

/// Number of standard errors by which the loss must fall.
const ERRORS_MIN: f64 = 2.0;

/// Least fall of the loss, ln.
const GAIN_MIN: f64 = 0.01;

/// The order in which the stages are fitted: the temperature of the last one weighs objects in the
/// others.
const STAGES: [usize; 3] = [2, 0, 1];

/// Receives the numbers of trials done and in all, and may stop the work.
pub type Progress<'a> = dyn Fn(usize, usize) -> ControlFlow<()> + Sync + 'a;

/// A calibration fitted to sessions, and what it is worth.
#[derive(Clone, Debug, PartialEq)]
pub struct Recalibration {
    /// The calibration fitted to all sessions.
    pub calibration: EvidenceCalibration,
    /// Quality of the calibration of before.
    pub before: Quality,
    /// Quality of calibrations fitted to the sessions of the other half.
    pub after: Quality,
    /// Mean fall of the sessions' log loss.
    pub gain: f64,
    /// Its standard error.
    pub gain_error: f64,
}

impl Recalibration {
    /// Whether sessions that a calibration does not know are judged better than before, by more
    /// than chance and by more than nothing. Equation R30.
    #[must_use]
    pub fn is_better(&self) -> bool {
        self.gain > (ERRORS_MIN * self.gain_error).max(GAIN_MIN)
    }
}

/// Fits the calibration of a model to sessions. `None` if `progress` stops it.
#[must_use]
pub fn recalibrate(
    model: &Arc<SurfaceModel>,
    past: &[PastSession<'_>],
    progress: &Progress<'_>,
) -> Option<Recalibration> {
    let (tasks, halves) = (tasks(past), halves(past));
    let widths = widths(model.calibration.width);
    let (done, total) = (AtomicUsize::new(0), (widths.len() + 1) * tasks.len());
    let run = |with_samples: bool, model_of: &(dyn Fn(Task) -> Arc<SurfaceModel> + Sync)| {
        let one = |task: &Task| {
            let now = done.fetch_add(1, Atomic::Relaxed);
            if progress(now, total).is_break() {
                return None;
            }
            Some(replay(&model_of(*task), &past[task.session], *task, with_samples))
        };
        tasks.par_iter().map(one).collect::<Option<Vec<Trial>>>()
    };
    let before = model.calibration;
    let with = |calibration| Arc::new(SurfaceModel::clone(model).with_calibration(calibration));
    // Fitted to the sessions outside the first half, outside the second, and to all.
    let mut fitted: [Option<Fitted>; 3] = [None; 3];
    let mut as_before = Vec::new();
    for width in widths {
        let wide = with(EvidenceCalibration { width, ..before });
        let mut trials = run(true, &|_| Arc::clone(&wide))?;
        for (left_out, best) in fitted.iter_mut().enumerate() {
            let is_in = |trial: &&Trial| halves[trial.task.session] != left_out;
            let n = halves.iter().filter(|half| **half != left_out).count();
            let found = fit(trials.iter().filter(is_in), n, &before, width);
            if best.is_none_or(|best| found.loss < best.loss) {
                *best = Some(found);
            }
        }
        if width.total_cmp(&before.width) == Ordering::Equal {
            trials.iter_mut().for_each(|trial| trial.samples = Vec::new());
            as_before = trials;
        }
    }
    let fitted = fitted.map(|found| found.map_or(before, |found| found.calibration));
    let models = [with(fitted[0]), with(fitted[1])];
    let trials = run(false, &|task| Arc::clone(&models[halves[task.session]]))?;
    let of_half = |half: usize| {
        let is_in = |trial: &&Trial| halves[trial.task.session] == half;
        trials.iter().filter(is_in).collect::<Vec<&Trial>>()
    };
    // No session is judged by a stop rule that was fitted to itself.
    let rules = [1, 0].map(|other| stop_rule(&of_half(other), before.stop));
    let all: Vec<&Trial> = trials.iter().collect();
    let (gain, gain_error) = gain(&as_before, &trials);
    Some(Recalibration {
        calibration: EvidenceCalibration {
            stop: stop_rule(&all, before.stop),
            basis: basis(past),
            ..fitted[2]
        },
        before: quality(&as_before, |_| before.stop),
        after: quality(&trials, |trial| rules[halves[trial.task.session]]),
        gain,
        gain_error,
    })
}

/// A calibration at one width, and its loss.
#[derive(Clone, Copy, Debug)]
struct Fitted {
    calibration: EvidenceCalibration,
    loss: f64,
}

/// Fits the stages to the evidence of `n_sessions` sessions at a width. Equations R28 and R29.
fn fit<'a>(
    trials: impl Iterator<Item = &'a Trial>,
    n_sessions: usize,
    before: &EvidenceCalibration,
    width: f64,
) -> Fitted {
    let scale = SurfaceOptions::default().score;
    let prior = 0.5 / n_sessions.max(1) as f64;
    let samples: Vec<&Sample> = trials.flat_map(|trial| &trial.samples).collect();
    let mut calibration = EvidenceCalibration { width, ..*before };
    let (mut loss, mut weighing) = (0.0, None);
    for stage in STAGES {
        let of_stage = |is_known: bool| -> Vec<&Sample> {
            let is_it = |s: &&&Sample| s.stage == stage && s.own.is_some() == is_known;
            samples.iter().filter(is_it).copied().collect()
        };
        let [with, without] = [true, false].map(of_stage);
        if !with.is_empty() && !without.is_empty() {
            let all = || with.iter().chain(&without).map(|sample| sample.counted.touches);
            let fit = Fit {
                start: before.stages[stage],
                with_slope: stage == 2,
                middle: mean(all()),
                prior,
                weighing,
                scale: &scale,
            };
            let share = all().count() as f64 / samples.len() as f64;
            let (found, found_loss) = fit.run([&with, &without]);
            calibration.stages[stage] = found;
            loss += share * found_loss;
        }
        weighing = Some(calibration.stages[2].temperature);
    }
    loss += prior * ((width / before.width).ln() / WIDTH_DEVIATION).powi(2);
    Fitted { calibration, loss }
}

/// The widths to try, that of before first.
fn widths(before: f64) -> Vec<f64> {
    let others = WIDTHS.into_iter().filter(|width| width.total_cmp(&before) != Ordering::Equal);
    std::iter::once(before).chain(others).collect()
}

/// The half, 0 or 1, of each session: the sessions of every object are shared evenly.
fn halves(past: &[PastSession<'_>]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..past.len()).collect();
    order.sort_by_key(|session| (past[*session].truth, *session));
    let mut halves = vec![0; past.len()];
    order.into_iter().enumerate().for_each(|(rank, session)| halves[session] = rank % 2);
    halves
}

fn basis(past: &[PastSession<'_>]) -> CalibrationBasis {
    let mut objects: Vec<usize> = past.iter().filter_map(|session| session.truth).collect();
    objects.sort_unstable();
    objects.dedup();
    CalibrationBasis::Sessions { sessions: past.len(), objects: objects.len() }
}

/// Mean fall of the sessions' loss, and its standard error.
fn gain(before: &[Trial], after: &[Trial]) -> (f64, f64) {
    let both = losses(before).into_iter().zip(losses(after));
    let falls: Vec<f64> = both.map(|((_, before), (_, after))| before - after).collect();
    let gain = mean(falls.iter().copied());
    let n = falls.len() as f64;
    let variance = falls.iter().map(|fall| (fall - gain).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (gain, (variance / n.max(1.0)).sqrt())
}
