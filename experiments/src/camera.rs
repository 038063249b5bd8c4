//! A camera's word: touches needed with and without a stated pose prior, and what a lie costs.
//!
//! Ten objects of ours, and on demand a thousand (families, as `surface-scale --thousand`). Every
//! session is played by the same touches without a statement and with each of `SAYINGS`: poses
//! off by deviations that the camera states, a deviation that it understates, a wrong object at
//! the right pose, a wrong pose in a tenth of the sessions or in all, and a detector's weights. A
//! statement has one hypothesis and the default share of lies. Unknown objects are the same
//! sessions with the true object ruled out.

mod sayings;

use std::sync::Arc;

use clap::Args;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::symmetry::Symmetry;
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::model::SurfaceModel;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_sim::plot::{Line, Panel, svg};
use rayon::prelude::*;
use serde::Serialize;

use crate::arguments::{ObjectSet, TouchSet, count};
use crate::object_sessions::Sessions;
use crate::objects;
use crate::report::{Outcome, Progress, Report};
use crate::statistics::{mean, median};
use crate::surface_scale::families;
use crate::trained::train_calibrated;
use sayings::{SAYINGS, Saying};

/// Numbers of touches whose accuracy is stated.
const STATED_AT: [usize; 5] = [1, 2, 3, 4, 6];

/// Touches of a session.
const READINGS: usize = 6;

/// Probability of the true object from which a session counts as decided.
const SURE: f64 = 0.95;

/// Least probability of the true object that counts, so that one session does not decide a mean.
const PROBABILITY_MIN: f64 = 1e-6;

/// Arguments of `camera`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct Camera {
    /// The objects that are touched.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// Also a catalogue of this many objects: procedural ones and families, as those of
    /// `surface-scale --thousand`. A thousand take about 20 minutes of processor time and 1 GB.
    #[arg(long, default_value_t = 0)]
    pub families: usize,
    /// Sessions with the catalogue of families.
    #[arg(long, default_value_t = 200, value_parser = count)]
    pub families_sessions: usize,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Trials per object.
    #[arg(long, default_value_t = 20, value_parser = count)]
    pub trials: usize,
    /// The readings of each object.
    #[command(flatten)]
    #[serde(flatten)]
    pub touches: TouchSet,
}

/// A catalogue with the touches of its sessions.
struct Catalogue<'a> {
    model: Arc<SurfaceModel>,
    sessions: Sessions<'a>,
    n_sessions: usize,
    with_unknown: bool,
}

/// The belief after a touch.
#[derive(Clone, Copy)]
struct Step {
    is_right: bool,
    probability: f64,
    unknown: f64,
    /// Error of the likeliest pose of the true object, metres; `None` without one.
    position: Option<f64>,
    ms: f64,
}

impl Step {
    /// −ln of the probability of the true object.
    fn surprise(&self) -> f64 {
        -self.probability.max(PROBABILITY_MIN).ln()
    }
}

/// The sessions of one saying.
struct Heard {
    /// Touches of each session, in order.
    known: Vec<Vec<Step>>,
    /// The same with the true object ruled out; empty where that was not played.
    unknown: Vec<Vec<Step>>,
}

#[derive(Serialize)]
struct Row {
    objects: usize,
    readings: usize,
    sessions: usize,
    accuracy: f64,
    probability_mean: f64,
    /// Mean −ln of the probability of the true object.
    surprise_mean: f64,
    unknown_mean: f64,
    posed: f64,
    position_error_mm_median: f64,
    touch_ms_mean: f64,
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When objects cannot be loaded or touched, or training fails.
pub fn run(config: &Camera, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let sensor = &config.touches.sensor;
    let objects = config.objects.load()?;
    let touch = |n, seed| objects::touch_all(&objects, sensor, n, seed, progress);
    let train = touch(config.touches.train_readings, 2 * config.seed)?;
    let test = touch(config.touches.test_readings, 2 * config.seed + 1)?;
    progress("training", 0, 1);
    let symmetries = objects::symmetries(&objects);
    let surface = SurfaceConfig::default();
    let model = train_calibrated(&train, &symmetries, sensor, &surface, config.seed)?;
    drop(train);
    let n_sessions = config.trials * objects.len();
    let sessions =
        Sessions::undisturbed(&config.touches.sensor, &test, &symmetries, config.seed, READINGS);
    let few = Catalogue { model, sessions, n_sessions, with_unknown: true };
    let mut panels = vec![played(&few, &mut report, progress)?];
    if config.families > 0 {
        drop(few);
        let learnt =
            families(config.families, config.seed, &config.touches, &mut report, progress)?;
        let (model, test) = (Arc::new(learnt.model), learnt.test);
        let symmetries = vec![Symmetry::NONE; test.len()];
        let sessions = Sessions::undisturbed(
            &config.touches.sensor,
            &test,
            &symmetries,
            config.seed,
            READINGS,
        );
        let n_sessions = config.families_sessions;
        let many = Catalogue { model, sessions, n_sessions, with_unknown: false };
        panels.push(played(&many, &mut report, progress)?);
    }
    Ok(Outcome { report, plot: svg(&panels), pictures: Vec::new() })
}

/// Plays all sayings with a catalogue; returns its panel.
fn played(
    of: &Catalogue<'_>,
    report: &mut Report,
    progress: Progress<'_>,
) -> anyhow::Result<Panel> {
    palpate_recogniser::belief::prepare(&of.model, &SurfaceOptions::default());
    let n_objects = of.model.maps().len();
    let mut lines = Vec::new();
    for (done, saying) in SAYINGS.iter().enumerate() {
        progress(&format!("sayings, {n_objects} objects"), done, SAYINGS.len());
        let heard = of.hear(*saying)?;
        summarise(report, n_objects, *saying, &heard);
        let share = |n: usize| mean(&of_step(&heard.known, n, |s| f64::from(u8::from(s.is_right))));
        let points = (1..=READINGS).map(|n| (n as f64, share(n))).collect();
        lines.push(Line { name: saying.name().to_owned(), points });
    }
    let title = format!("{n_objects} objects, by what a camera says");
    Ok(Panel { title, x: "touches".to_owned(), y: "share right".to_owned(), lines })
}

impl Catalogue<'_> {
    fn hear(&self, saying: Saying) -> anyhow::Result<Heard> {
        let n_objects = self.model.maps().len();
        let one = |session: usize| {
            // With more objects than sessions, these are spread over the catalogue.
            let (object, trial) = if self.n_sessions < n_objects {
                (session * n_objects / self.n_sessions, 0)
            } else {
                (session % n_objects, session / n_objects)
            };
            let known = self.session(saying, object, trial, session, false)?;
            let unknown = self
                .with_unknown
                .then(|| self.session(saying, object, trial, session, true))
                .transpose()?;
            anyhow::Ok((known, unknown))
        };
        let all: anyhow::Result<Vec<_>> = (0..self.n_sessions).into_par_iter().map(one).collect();
        let (known, unknown): (_, Vec<_>) = all?.into_iter().unzip();
        Ok(Heard { known, unknown: unknown.into_iter().flatten().collect() })
    }

    fn session(
        &self,
        saying: Saying,
        object: usize,
        trial: usize,
        session: usize,
        is_ruled_out: bool,
    ) -> anyhow::Result<Vec<Step>> {
        let n_objects = self.model.maps().len();
        let possible = |other: usize| f64::from(u8::from(!is_ruled_out || other != object));
        let prior: Vec<f64> = (0..n_objects).map(possible).collect();
        let options = SurfaceOptions::default();
        let mut belief = SurfaceBelief::new(Arc::clone(&self.model), options, Some(&prior))?;
        let presented = self.sessions.presented(object, trial);
        let truth = presented[0].session_from_object;
        let mut stream = Stream::new(self.sessions.seed, Purpose::Commissioning, session as u64);
        if let Some(said) = saying.said(object, n_objects, &truth, &mut stream) {
            belief = belief.with_pose_prior(&said)?;
        }
        let mut steps = Vec::with_capacity(presented.len());
        for heard in &presented {
            let began = std::time::Instant::now();
            belief.add(&heard.reading, self.sessions.sensor);
            let answer = belief.answer(8);
            let ms = began.elapsed().as_secs_f64() * 1e3;
            let named = answer.best_object().map(|best| best.0 as usize);
            let mode = answer.modes.iter().find(|mode| mode.object.0 as usize == object);
            let position = mode.map(|mode| mode.session_from_object.distance_to(&truth));
            let probability = answer.probabilities[object];
            let (is_right, unknown) = (named == Some(object), answer.unknown);
            steps.push(Step { is_right, probability, unknown, position, ms });
        }
        Ok(steps)
    }
}

/// A figure of all sessions after `n` touches.
fn of_step(sessions: &[Vec<Step>], n: usize, value: impl Fn(&Step) -> f64) -> Vec<f64> {
    sessions.iter().map(|steps| value(&steps[n - 1])).collect()
}

fn summarise(report: &mut Report, objects: usize, saying: Saying, heard: &Heard) {
    let known = &heard.known;
    for n in 1..=READINGS {
        let posed: Vec<f64> = known.iter().filter_map(|steps| steps[n - 1].position).collect();
        let millimetres: Vec<f64> = posed.iter().map(|error| error * 1e3).collect();
        let row = Row {
            objects,
            readings: n,
            sessions: known.len(),
            accuracy: mean(&of_step(known, n, |s| f64::from(u8::from(s.is_right)))),
            probability_mean: mean(&of_step(known, n, |s| s.probability)),
            surprise_mean: mean(&of_step(known, n, Step::surprise)),
            unknown_mean: mean(&of_step(known, n, |s| s.unknown)),
            posed: posed.len() as f64 / known.len() as f64,
            position_error_mm_median: median(&millimetres),
            touch_ms_mean: mean(&of_step(known, n, |s| s.ms)),
        };
        let key = |figure: &str| format!("{}_{figure}_{objects}_at_{n}", saying.name());
        if STATED_AT.contains(&n) {
            report.summarise(&key("accuracy"), row.accuracy);
            report.summarise(&key("probability"), row.probability_mean);
            report.summarise(&key("surprise"), row.surprise_mean);
        }
        if n == 1 {
            report.summarise(&key("position_error_mm"), row.position_error_mm_median);
        }
        if n == READINGS {
            report.summarise(&key("unknown"), row.unknown_mean);
            if !heard.unknown.is_empty() {
                let unknown = mean(&of_step(&heard.unknown, n, |s| s.unknown));
                report.summarise(&key("unknown_if_unknown"), unknown);
            }
        }
        report.labelled(&[("saying", saying.name())], row);
    }
    let needed: Vec<f64> = known.iter().map(|steps| touches_needed(steps)).collect();
    report.summarise(&format!("{}_touches_needed_{objects}", saying.name()), mean(&needed));
    let all: Vec<f64> = known.iter().flatten().map(|step| step.ms).collect();
    report.summarise(&format!("{}_touch_ms_{objects}", saying.name()), mean(&all));
}

/// The touches from which on the true object stays likelier than [`SURE`]; one more than a session
/// has where it never is.
fn touches_needed(steps: &[Step]) -> f64 {
    let unsure = steps.iter().rposition(|step| step.probability < SURE);
    unsure.map_or(1, |last| last + 2) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn a_session_is_decided_once_it_stays_sure() {
        let step = |probability| Step {
            is_right: true,
            probability,
            unknown: 0.0,
            position: None,
            ms: 1.0,
        };
        let needed = |all: [f64; 3]| touches_needed(&all.map(step));
        assert!((needed([0.99, 0.97, 0.96]) - 1.0).abs() < 1e-12);
        assert!((needed([0.99, 0.90, 0.96]) - 3.0).abs() < 1e-12);
        assert!((needed([0.99, 0.97, 0.5]) - 4.0).abs() < 1e-12, "never");
    }

    #[test]
    fn a_good_camera_needs_fewer_touches() {
        let mut config: Camera = defaults();
        (config.seed, config.trials) = (101, 3);
        (config.touches.train_readings, config.touches.test_readings) = (150, 20);
        let report = run(&config, &|_, _, _| ()).unwrap().report;
        let figure = |key: &str| report.summary[key];
        let (with, without) =
            (figure("named_touches_needed_10"), figure("nothing_touches_needed_10"));
        assert!(with < without - 1.0, "{with} with, {without} without");
        assert_eq!(report.rows.len(), SAYINGS.len() * READINGS);
        assert!(figure("wrong_pose_accuracy_10_at_6") > 0.8);
    }

    /// As with a large catalogue: fewer sessions than objects, none of them of unknown objects.
    #[test]
    fn every_saying_is_played_without_unknown_objects() {
        let config: Camera = defaults();
        let sensor = &config.touches.sensor;
        let objects = config.objects.load().unwrap();
        let touch = |n, seed| objects::touch_all(&objects, sensor, n, seed, &|_, _, _| ()).unwrap();
        let (train, test) = (touch(100, 101), touch(10, 102));
        let (symmetries, surface) = (objects::symmetries(&objects), SurfaceConfig::default());
        let model = train_calibrated(&train, &symmetries, sensor, &surface, 101).unwrap();
        let sessions = Sessions::undisturbed(sensor, &test, &symmetries, 101, READINGS);
        let many = Catalogue { model, sessions, n_sessions: 5, with_unknown: false };
        let mut report = Report::default();
        played(&many, &mut report, &|_, _, _| ()).unwrap();
        assert_eq!(report.rows.len(), SAYINGS.len() * READINGS);
        assert!(report.summary["named_accuracy_10_at_6"] > 0.7, "{:?}", report.summary);
        assert!(!report.summary.contains_key("named_unknown_if_unknown_10_at_6"));
    }
}
