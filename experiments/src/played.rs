//! Answers of a recogniser in all trials, and their rows in the report.

use palpate_core::units::{DEG, MM};
use serde::Serialize;

use crate::objects::TestObject;
use crate::report::Report;
use crate::statistics::{mean, median, quantile};

/// Error of a stated pose.
#[derive(Clone, Copy, Debug)]
pub struct PoseError {
    /// Distance of the origins, metres.
    pub translation: f64,
    /// Angle modulo the object's symmetry, rad.
    pub angle: f64,
    /// Angle between the orientations, without symmetry, rad.
    pub plain_angle: f64,
}

/// A recogniser's answer after one reading of one trial.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// The true object.
    pub object: usize,
    /// The trial, from 0 for each object.
    pub trial: usize,
    /// Readings so far.
    pub readings: usize,
    /// The object that was named.
    pub named: usize,
    /// Its stated probability.
    pub probability: f64,
    /// The stated probability of "none of these".
    pub unknown: f64,
    /// Error of the pose, when the right object was named.
    pub error: Option<PoseError>,
    /// Wall time of the reading, answer included, milliseconds.
    pub wall_ms: f64,
}

impl Step {
    /// Whether the right object was named.
    #[must_use]
    pub fn is_right(&self) -> bool {
        self.named == self.object
    }
}

/// All steps of some trials.
pub struct Played {
    /// Steps in the order of trials, then objects, then readings.
    pub steps: Vec<Step>,
    /// Mean processor time of a reading, answer included, milliseconds; with one thread it is
    /// that of one core. `None` if the system does not report it.
    pub cpu_ms: Option<f64>,
}

/// Figures of all trials after some number of readings: the columns of a row.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Figures {
    readings: usize,
    trials: usize,
    accuracy: f64,
    stated_probability_mean: f64,
    unknown_mean: f64,
    position_error_mm_mean: f64,
    position_error_mm_median: f64,
    position_error_mm_p90: f64,
    angle_error_deg_mean: f64,
    angle_error_deg_median: f64,
    plain_angle_error_deg_median: f64,
    wall_ms_mean: f64,
    wall_ms_median: f64,
    wall_ms_p90: f64,
    wall_ms_p99: f64,
}

/// A trial that names the wrong object.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Wrong {
    /// After this many readings.
    pub readings: usize,
    /// The trial, from 0 for each object.
    pub trial: usize,
    /// The stated probability of the wrong object.
    pub stated_probability: f64,
}

impl Played {
    /// Figures of all trials after some number of readings.
    #[must_use]
    pub fn figures(&self, readings: usize) -> Figures {
        let of = |value: fn(&Step) -> f64| self.after(readings).map(value).collect::<Vec<f64>>();
        let (stated, times) = (of(|step| step.probability), of(|step| step.wall_ms));
        let moved = self.errors(readings, |error| error.translation / MM);
        let angle = self.errors(readings, |error| error.angle / DEG);
        Figures {
            readings,
            trials: stated.len(),
            accuracy: self.accuracy(readings),
            stated_probability_mean: mean(&stated),
            unknown_mean: self.unknown(readings),
            position_error_mm_mean: mean(&moved),
            position_error_mm_median: median(&moved),
            position_error_mm_p90: quantile(&moved, 0.9),
            angle_error_deg_mean: mean(&angle),
            angle_error_deg_median: median(&angle),
            plain_angle_error_deg_median: median(&self.errors(readings, |e| e.plain_angle / DEG)),
            wall_ms_mean: mean(&times),
            wall_ms_median: median(&times),
            wall_ms_p90: quantile(&times, 0.9),
            wall_ms_p99: quantile(&times, 0.99),
        }
    }

    /// The steps after this many readings.
    pub fn after(&self, readings: usize) -> impl Iterator<Item = &Step> {
        self.steps.iter().filter(move |step| step.readings == readings)
    }

    /// The share of trials that are right after this many readings.
    #[must_use]
    pub fn accuracy(&self, readings: usize) -> f64 {
        mean(
            &self
                .after(readings)
                .map(|step| f64::from(u8::from(step.is_right())))
                .collect::<Vec<_>>(),
        )
    }

    /// The mean probability of "none of these" after this many readings.
    #[must_use]
    pub fn unknown(&self, readings: usize) -> f64 {
        mean(&self.after(readings).map(|step| step.unknown).collect::<Vec<_>>())
    }

    /// A measure of the errors of pose after this many readings.
    pub fn errors(&self, readings: usize, of: impl Fn(&PoseError) -> f64) -> Vec<f64> {
        self.after(readings).filter_map(|step| step.error.as_ref().map(&of)).collect()
    }

    /// Wall time of each reading, milliseconds.
    #[must_use]
    pub fn wall_ms(&self) -> Vec<f64> {
        self.steps.iter().map(|step| step.wall_ms).collect()
    }
}

/// Adds a row for each of the steps that names the wrong object. `labels` come first.
pub fn report_wrong<'a>(
    report: &mut Report,
    labels: &[(&str, &str)],
    objects: &[TestObject],
    steps: impl Iterator<Item = &'a Step>,
) {
    for step in steps.filter(|step| !step.is_right()) {
        let names = [("object", step.object), ("confused_with", step.named)]
            .map(|(key, at)| (key, objects[at].name.as_str()));
        let (readings, trial, stated_probability) = (step.readings, step.trial, step.probability);
        let wrong = Wrong { readings, trial, stated_probability };
        report.labelled(&[labels, &names].concat(), wrong);
    }
}
