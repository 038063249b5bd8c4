//! Figure 4.20 again: letters learnt in simulation, recognised with another sensor.
//!
//! There is no physical sensor here, so a differently simulated one stands in its place.
//! Learning takes presses of solid letters by the imaging model of chapter 2 without any
//! noise (`sim::press`). Tests take the planned presses of the rig (`sim::rig`), whose array
//! has unequal gains, drift, noise and steps, lies at a tilt and off its place, and answers
//! with the square of the indentation. The remedies of section 4.4.4.3.2 come one by one:
//! noise in training, the square root of every value in tests, a small blur in tests.

use anyhow::Context as _;
use palpate_core::descriptor::DescriptorKind;
use palpate_core::model::appearance::AppearanceRule;
use palpate_core::patch::touches;
use palpate_core::reading::{Reading, SensorId, TactileImage};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::{ForceCurve, SensorDescription, SensorParameters};
use palpate_core::train::appearance::AppearanceConfig;
use palpate_core::units::MM;
use palpate_sim::letters::Letter;
use palpate_sim::press::PressSimulator;
use palpate_sim::rig::{INDENTATION, LetterField, Rig, RigNoise, rig_sensor};
use rayon::prelude::*;
use serde_json::json;

use crate::appearance_trials::{Evidence, Point, accuracy_at, line, mean_of, train};
use crate::letter_presses::{RaisedLetters, place_on};
use crate::object_trials::panel;
use crate::plot::{Line, svg};
use crate::report::{Outcome, Progress, Report};

/// Counts of readings.
const COUNTS: [usize; 11] = [1, 2, 3, 5, 8, 10, 15, 20, 30, 40, 60];

/// How thick the solid letters are, metres: thicker than the covering.
const THICKNESS: f64 = 3.0 * MM;

/// Noise in training: the total width as a part of what is observed (about 30 % in print).
const TRAINING_NOISE: f64 = 0.3;

/// Weight of each of the four neighbours in the small blur; the taxel itself has 1.
const BLUR: f64 = 0.15;

/// Streams of simulated training, apart from the rig's.
const STREAM_BASE: u64 = 1 << 61;

/// What to run.
#[derive(Clone, Debug)]
pub struct SimToReal {
    /// The letters.
    pub letters: String,
    /// The first seed: a seed is a sensor, its noise and its trials.
    pub seed: u64,
    /// How many seeds from the first on.
    pub seeds: usize,
    /// Simulated presses a letter.
    pub training_presses: usize,
    /// Trials a letter and seed.
    pub trials: usize,
    /// Candidates for the number of classes.
    pub n_classes: Vec<usize>,
}

impl Default for SimToReal {
    /// The five vowels on five sensors.
    fn default() -> Self {
        Self {
            letters: "AEIOU".to_owned(),
            seed: 1,
            seeds: 5,
            training_presses: 600,
            trials: 50,
            n_classes: vec![24],
        }
    }
}

/// How readings are treated before they are learnt or recognised.
#[derive(Clone, Copy, Debug)]
struct Bridge {
    name: &'static str,
    key: &'static str,
    noise_in_training: bool,
    square_root: bool,
    blur: bool,
    /// Tests take the simulator of training, not the rig: what could be had at best.
    same_sensor: bool,
}

/// The remedies one by one, and the bound.
const BRIDGES: [Bridge; 5] = {
    let none = Bridge {
        name: "as it comes",
        key: "plain_",
        noise_in_training: false,
        square_root: false,
        blur: false,
        same_sensor: false,
    };
    let noise =
        Bridge { name: "noise in training", key: "noise_", noise_in_training: true, ..none };
    let root = Bridge { name: "and square root", key: "root_", square_root: true, ..noise };
    let blur = Bridge { name: "and blur", key: "", blur: true, ..root };
    [
        none,
        noise,
        root,
        blur,
        Bridge { name: "same sensor", key: "same_", same_sensor: true, ..none },
    ]
};

/// Runs the experiment.
///
/// # Errors
/// When a letter does not exist or presses cannot be learnt from.
pub fn run(config: &SimToReal, command: String, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let letters = RaisedLetters::new(&config.letters)?;
    let simulated = rig_sensor();
    let real = squared(&simulated)?;
    progress("pressing simulated letters", 0, config.seeds + 1);
    let training = presses(&letters, &simulated, config, 0)?;
    let same = presses(&letters, &simulated, config, 1)?;
    let kinds =
        [DescriptorKind::PolarFourier, DescriptorKind::Mnti, DescriptorKind::MomentNormalized];
    let mut curves: Vec<Vec<Vec<Point>>> = vec![Vec::new(); kinds.len() * BRIDGES.len()];
    for index in 0..config.seeds {
        let seed = config.seed + index as u64;
        progress(&format!("sensor {seed}"), index + 1, config.seeds + 1);
        let rig = Rig::new(SensorId(0), &real, RigNoise::physical(), seed);
        let test = on_rig(&letters, &rig);
        for (bridge_idx, bridge) in BRIDGES.iter().enumerate() {
            let learnt = if bridge.noise_in_training {
                noisy(&training, &simulated, seed)?
            } else {
                training.clone()
            };
            let tested = if bridge.same_sensor {
                same.clone()
            } else {
                bridged(&test, &simulated, *bridge)?
            };
            for (kind_idx, kind) in kinds.iter().enumerate() {
                let appearance = AppearanceConfig {
                    descriptor: *kind,
                    n_classes: config.n_classes.clone(),
                    held_back_share: 1.0 / 11.0,
                    ..AppearanceConfig::default()
                };
                let model = train(&learnt, &simulated, &appearance, seed)?;
                let rule = AppearanceRule::Divergence;
                let evidence = Evidence::of(&model, &tested, &simulated, rule);
                let curve = evidence.drawn(&COUNTS, config.trials, seed);
                curves[bridge_idx * kinds.len() + kind_idx].push(curve);
            }
        }
    }
    let mut report = Report::new("sim-to-real", command, config.seed);
    let mut lines: Vec<Vec<Line>> = kinds.iter().map(|_| Vec::new()).collect();
    for (cell, curves) in curves.iter().enumerate() {
        let (bridge, kind) = (BRIDGES[cell / kinds.len()], kinds[cell % kinds.len()]);
        let curve = mean_of(curves);
        rows(&mut report, &bridge, kind, &config.letters, &curve);
        lines[cell % kinds.len()].push(line(bridge.name, &curve));
    }
    let panels: Vec<_> =
        kinds.iter().zip(lines).map(|(kind, lines)| panel(kind.name(), lines)).collect();
    Ok(Outcome { report, plot: svg(&panels), pictures: Vec::new() })
}

/// The sensor with a pressure that grows with the square of the indentation.
fn squared(sensor: &SensorDescription) -> anyhow::Result<SensorDescription> {
    let parameters = sensor.parameters().clone();
    let (thickness, saturation) = (parameters.covering_thickness, parameters.saturation);
    let knot =
        |n: u32| (f64::from(n) / 16.0 * thickness, (f64::from(n) / 16.0).powi(2) * saturation);
    let force_curve = ForceCurve::new((0..=16).map(knot).collect())?;
    Ok(SensorDescription::new(SensorParameters { force_curve, ..parameters })?)
}

/// Presses of solid letters anywhere on their faces, through the imaging model.
fn presses(
    letters: &RaisedLetters,
    sensor: &SensorDescription,
    config: &SimToReal,
    set: u64,
) -> anyhow::Result<Vec<Vec<Reading>>> {
    let ideal = SensorParameters { noise: 0.0, quantisation: 0.0, ..sensor.parameters().clone() };
    let sensor = SensorDescription::new(ideal)?;
    let of_letter = |letter: &Letter| {
        let simulator = PressSimulator::new(letter.solid(THICKNESS), sensor.clone());
        let top = simulator.mesh().vertices().iter().map(|at| at.z).fold(f64::MIN, f64::max);
        let depth = INDENTATION * sensor.parameters().covering_thickness - top;
        let index = STREAM_BASE | u64::from(u32::from(letter.symbol())) << 8 | set;
        let mut stream = Stream::new(config.seed, Purpose::Sampling, index);
        let mut press = || {
            let pose = place_on(letter, &mut stream).object_from_sensor(depth);
            simulator.read(SensorId(0), pose, &mut stream)
        };
        (0..config.training_presses).map(|_| press()).collect()
    };
    Ok(letters.letters().par_iter().map(of_letter).collect())
}

/// Both repetitions of the rig's plan, without presses that touch nothing.
fn on_rig(letters: &RaisedLetters, rig: &Rig) -> Vec<Vec<Reading>> {
    let of_letter = |letter: &Letter| {
        let field = LetterField::new(letter, rig.sensor());
        let all = (0..2).flat_map(|repetition| rig.session(&field, repetition));
        all.filter(|reading| touches(reading, rig.sensor())).collect()
    };
    letters.letters().iter().map(of_letter).collect()
}

/// Training readings with uniform noise of a part of their own largest value.
fn noisy(
    readings: &[Vec<Reading>],
    sensor: &SensorDescription,
    seed: u64,
) -> anyhow::Result<Vec<Vec<Reading>>> {
    let mut stream = Stream::new(seed, Purpose::SensorNoise, STREAM_BASE);
    changed(readings, sensor, |image| {
        let half = 0.5 * TRAINING_NOISE * image.max();
        image.pressures.iter().map(|p| (p + stream.uniform(-half, half)).max(0.0)).collect()
    })
}

/// Test readings after the remedies that a bridge takes.
fn bridged(
    readings: &[Vec<Reading>],
    sensor: &SensorDescription,
    bridge: Bridge,
) -> anyhow::Result<Vec<Vec<Reading>>> {
    let saturation = sensor.parameters().saturation;
    changed(readings, sensor, |image| {
        let root = |p: &f64| {
            if bridge.square_root { saturation * (p.max(0.0) / saturation).sqrt() } else { *p }
        };
        let pressures: Vec<f64> = image.pressures.iter().map(root).collect();
        if bridge.blur { blurred(&pressures, image.rows, image.cols) } else { pressures }
    })
}

/// Readings with other pressures, at their places.
fn changed(
    readings: &[Vec<Reading>],
    sensor: &SensorDescription,
    mut change: impl FnMut(&TactileImage) -> Vec<f64>,
) -> anyhow::Result<Vec<Vec<Reading>>> {
    let mut one = |reading: &Reading| {
        let pressures: Vec<Option<f64>> = change(reading.image()).into_iter().map(Some).collect();
        let pose = reading.session_from_sensor();
        Reading::new(reading.sensor(), sensor, &pressures, pose).context("a changed image fits")
    };
    readings.iter().map(|readings| readings.iter().map(&mut one).collect()).collect()
}

/// Each taxel's weighted mean with its neighbours along rows and columns.
fn blurred(pressures: &[f64], rows: usize, cols: usize) -> Vec<f64> {
    let at = |taxel: usize| {
        let (row, col) = (taxel / cols, taxel % cols);
        let neighbours = [
            (row > 0).then(|| taxel - cols),
            (row + 1 < rows).then(|| taxel + cols),
            (col > 0).then(|| taxel - 1),
            (col + 1 < cols).then(|| taxel + 1),
        ];
        let (mut sum, mut weight) = (pressures[taxel], 1.0);
        for neighbour in neighbours.into_iter().flatten() {
            sum += BLUR * pressures[neighbour];
            weight += BLUR;
        }
        sum / weight
    };
    (0..rows * cols).map(at).collect()
}

fn rows(
    report: &mut Report,
    bridge: &Bridge,
    kind: DescriptorKind,
    symbols: &str,
    curve: &[Point],
) {
    let symbol = |letter: usize| symbols.chars().nth(letter).map(String::from);
    for point in curve {
        report.row(vec![
            ("bridge", json!(bridge.name)),
            ("method", json!(kind.name())),
            ("readings", json!(point.readings)),
            ("accuracy", json!(point.accuracy)),
            ("stated_probability_mean", json!(point.stated)),
        ]);
    }
    for readings in [10, 40] {
        if let Some(accuracy) = accuracy_at(curve, readings) {
            let key = format!("{}_{}accuracy_at_{readings}", kind.name(), bridge.key);
            report.summarise(&key, accuracy);
        }
    }
    for (truth, named, trials) in
        curve.iter().filter(|point| point.readings == 40).flat_map(|point| &point.confusions)
    {
        report.row(vec![
            ("bridge", json!(bridge.name)),
            ("method", json!(kind.name())),
            ("readings", json!(40)),
            ("letter", json!(symbol(*truth))),
            ("confused_with", json!(symbol(*named))),
            ("trials", json!(trials)),
        ]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_run_states_every_remedy() {
        let config = SimToReal {
            letters: "EIO".to_owned(),
            seed: 101,
            seeds: 1,
            training_presses: 80,
            trials: 4,
            n_classes: vec![8],
        };
        let outcome = run(&config, "test".to_owned(), &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        for key in ["", "plain_", "noise_", "root_"] {
            assert!(summary.contains_key(&format!("mnti_{key}accuracy_at_40")), "{summary:?}");
        }
        assert!(summary["polar_fourier_same_accuracy_at_40"] > 0.6, "{summary:?}");
        assert_eq!(outcome.plot.matches("<polyline").count(), 15);
    }

    #[test]
    fn the_square_root_undoes_the_square() {
        let simulated = rig_sensor();
        let real = squared(&simulated).unwrap();
        let thickness = simulated.parameters().covering_thickness;
        for share in [0.25, 0.5, 1.0] {
            let pressure = real.parameters().force_curve.pressure(share * thickness);
            let saturation = simulated.parameters().saturation;
            let undone = saturation * (pressure / saturation).sqrt();
            let expected = simulated.parameters().force_curve.pressure(share * thickness);
            assert!((undone / expected - 1.0).abs() < 1e-9, "{undone} and {expected}");
        }
    }

    #[test]
    fn a_blur_keeps_what_is_even_and_lowers_a_peak() {
        assert!(blurred(&[3.0; 6], 2, 3).iter().all(|value| (value - 3.0).abs() < 1e-12));
        // A corner with two neighbours: 1 / (1 + 2 · 0.15).
        assert!((blurred(&[1.0, 0.0, 0.0, 0.0], 2, 2)[0] - 1.0 / 1.3).abs() < 1e-12);
    }
}
