//! Section 5.5.2 and figure 5.4: raised letters by spatially varying appearance.
//!
//! Letters are mapped from 192 presses of the rig and looked for in 192 others. Presses come from
//! the plan both times (`planned`, as printed: every test press has its twin in training), from
//! jittered poses in the tests alone (`jittered`), or from two sets of jittered poses
//! (`both_jittered`). A trial draws the letter's pose (±10 mm, any angle) and presents test
//! presses without replacement. Methods see the same readings; `methods` lists them. Errors of
//! pose count only when the letter is right, and are inertial distances modulo its symmetry.

mod figures;
mod methods;

use std::path::PathBuf;

use clap::Args;
use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;
use palpate_sim::rig::Rig;
use rayon::prelude::*;
use serde::Serialize;

use crate::arguments::count;
use crate::letter_presses::{LetterShape, RaisedLetters, font_of, rig};
use crate::letters_geometric::{LetterNoise, letters_named};
use crate::report::{Outcome, Progress, Report};
use methods::{METHODS, Trained};

/// Numbers of readings after which methods answer.
const ANSWERS_AT: [usize; 14] = [1, 2, 3, 5, 7, 9, 12, 15, 20, 25, 30, 35, 40, 46];

/// Maximum offset of the letter from its trained place along x and y, metres.
const REACH: f64 = 10.0 * MM;

/// Arguments of `letters-sva`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct LettersSva {
    /// AEIOU, capitals, all, or any letters.
    #[arg(long, default_value = "AEIOU", value_parser = letters_named)]
    pub letters: String,
    /// First seed.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Number of seeds. Each is a sensor, its noise and its trials.
    #[arg(long, default_value_t = 5, value_parser = count)]
    pub seeds: usize,
    /// Trials per letter and seed.
    #[arg(long, default_value_t = 5, value_parser = count)]
    pub trials: usize,
    /// Readings per trial, at most 192.
    #[arg(long, default_value_t = 46, value_parser = count)]
    pub readings: usize,
    /// Noise of the presses.
    #[arg(long, default_value_t = LetterNoise::Physical, value_enum)]
    pub noise: LetterNoise,
    /// A TrueType or OpenType font [default: Quicksand Bold].
    #[arg(long, value_name = "PATH")]
    pub font: Option<PathBuf>,
}

/// Poses of the presses of training and tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Presses {
    Planned,
    Jittered,
    BothJittered,
}

impl Presses {
    const ALL: [Self; 3] = [Self::Planned, Self::Jittered, Self::BothJittered];

    fn name(self) -> &'static str {
        match self {
            Self::Planned => "planned",
            Self::Jittered => "jittered",
            Self::BothJittered => "both_jittered",
        }
    }

    /// The presses of training and of tests.
    fn drawn(self, letters: &RaisedLetters, rig: &Rig, seed: u64) -> [Vec<Vec<Reading>>; 2] {
        match self {
            Self::Planned => [letters.session(rig, 0), letters.session(rig, 1)],
            Self::Jittered => [letters.session(rig, 0), letters.jittered(rig, seed, 1)],
            Self::BothJittered => [letters.jittered(rig, seed, 0), letters.jittered(rig, seed, 1)],
        }
    }
}

/// A method's answer after some readings of a trial.
struct Step {
    presses: Presses,
    method: usize,
    seed: u64,
    letter: usize,
    readings: usize,
    named: usize,
    probability: f64,
    /// Inertial error of the pose, metres; `None` if the letter is wrong.
    error: Option<f64>,
}

/// Runs the experiment.
///
/// # Errors
/// When the font or a letter cannot be used, or training fails.
pub fn run(config: &LettersSva, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let letters = RaisedLetters::of_font(&config.letters, &font_of(config.font.as_deref())?)?;
    let shapes: Vec<LetterShape> = letters.letters().iter().map(LetterShape::of).collect();
    let mut report = Report::default();
    let mut steps = Vec::new();
    let mut done = 0;
    for seed in (0..config.seeds as u64).map(|idx| config.seed + idx) {
        let rig = rig(config.noise.of_rig(), seed);
        for presses in Presses::ALL {
            let [train, test] = presses.drawn(&letters, &rig, seed);
            for (method, named) in METHODS.iter().enumerate() {
                let label = format!("seed {seed}, {}, {}", presses.name(), named.name);
                progress(&label, done, config.seeds * Presses::ALL.len() * METHODS.len());
                done += 1;
                let trained = named.train(&train, rig.sensor(), letters.letters(), seed)?;
                if let Some(kept) = trained.classes_kept() {
                    let key = format!("{}_{}_classes_kept_mean", presses.name(), named.name);
                    report.summarise(&key, kept);
                }
                let lab = Lab { config, shapes: &shapes, test: &test, presses, method, seed };
                steps.extend(lab.play(&trained)?);
            }
        }
    }
    figures::report(&mut report, config, &steps);
    let plot = figures::plot(config, &steps);
    Ok(Outcome { report, plot, pictures: Vec::new() })
}

/// The trials of one method, seed and kind of presses.
struct Lab<'a> {
    config: &'a LettersSva,
    shapes: &'a [LetterShape],
    test: &'a [Vec<Reading>],
    presses: Presses,
    method: usize,
    seed: u64,
}

impl Lab<'_> {
    fn play(&self, trained: &Trained) -> anyhow::Result<Vec<Step>> {
        let trials = (0..self.shapes.len() * self.config.trials).into_par_iter();
        let played: anyhow::Result<Vec<Vec<Step>>> =
            trials.map(|trial| self.trial(trained, trial)).collect();
        Ok(played?.into_iter().flatten().collect())
    }

    fn trial(&self, trained: &Trained, trial: usize) -> anyhow::Result<Vec<Step>> {
        let letter = trial / self.config.trials;
        let (session_from_object, readings) = self.drawn(letter, trial as u64);
        let mut belief = trained.begin()?;
        let mut steps = Vec::new();
        for (idx, reading) in readings.iter().enumerate() {
            belief.add(reading)?;
            if !ANSWERS_AT.contains(&(idx + 1)) {
                continue;
            }
            let answer = belief.answer();
            let named = answer.best_object().map_or(0, |object| object.0 as usize);
            let mode = answer.modes.iter().find(|mode| mode.object.0 as usize == letter);
            let shape = &self.shapes[letter];
            let error = mode
                .filter(|_| named == letter)
                .map(|mode| shape.error(&mode.session_from_object, &session_from_object));
            let probability = answer.probabilities.get(named).copied().unwrap_or(0.0);
            let (presses, method, seed) = (self.presses, self.method, self.seed);
            let readings = idx + 1;
            let step = Step { presses, method, seed, letter, readings, named, probability, error };
            steps.push(step);
        }
        Ok(steps)
    }

    /// The pose of a trial, and its readings in the session frame: the same for every method.
    fn drawn(&self, letter: usize, trial: u64) -> (Pose, Vec<Reading>) {
        let mut poses = Stream::new(self.seed, Purpose::ObjectPose, trial);
        let place = DVec3::new(poses.uniform(-REACH, REACH), poses.uniform(-REACH, REACH), 0.0);
        let turn = DQuat::from_rotation_z(poses.uniform(0.0, std::f64::consts::TAU));
        let session_from_object = Pose::from_parts(turn, place);
        let mut choice = Stream::new(self.seed, Purpose::ReadingChoice, trial);
        let mut left: Vec<&Reading> = self.test[letter].iter().collect();
        let readings = (0..self.config.readings.min(left.len()))
            .map(|_| left.swap_remove(choice.index(left.len())).moved_by(session_from_object))
            .collect();
        (session_from_object, readings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn a_small_run_recognises_letters_as_printed() {
        let config = LettersSva {
            letters: "AEI".to_owned(),
            seed: 101,
            seeds: 1,
            trials: 2,
            readings: 30,
            ..defaults()
        };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        // Chance is a third; one of six trials may be wrong.
        assert!(summary["planned_as_printed_accuracy_at_30"] > 0.8, "{summary:?}");
        assert!(summary["planned_sva_in_plane_accuracy_at_30"] > 0.8, "{summary:?}");
        // Bins of 0.95 mm and 40°: half a bin of angle is 3 mm on a letter of 25 mm.
        let error = summary["planned_as_printed_inertial_error_mm_mean_at_30"];
        assert!((0.1..4.0).contains(&error), "{summary:?}");
        let kept = summary["planned_as_printed_classes_kept_mean"];
        assert!((1.0..10.0).contains(&kept), "{kept}");
        for presses in Presses::ALL {
            for method in &METHODS {
                let key = format!("{}_{}_accuracy_at_20", presses.name(), method.name);
                assert!(summary.contains_key(&key), "{key}");
            }
        }
        assert!(outcome.plot.contains("polyline"));
    }
}
