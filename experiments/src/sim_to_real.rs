//! Figure 4.20 again: letters learnt in simulation, recognised with another sensor.
//!
//! There is no physical sensor here, so a different simulator replaces it. Learning takes
//! presses of solid letters by the imaging model of chapter 2 without any noise (`sim::press`).
//! Tests take the planned presses of the rig (`sim::rig`): first ideal, then with unequal gains,
//! drift, noise, steps, tilt and misplacement, then with a response that is the square of the
//! indentation. The remedies of section 4.4.4.3.2 come one by one: noise in training, the square
//! root of every value in tests, a small blur in tests.

use std::f64::consts::TAU;

use anyhow::Context as _;
use clap::Args;
use palpate_core::descriptor::DescriptorKind;
use palpate_core::reading::{Reading, SensorId, TactileImage};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::{ForceCurve, SensorDescription, SensorParameters};
use palpate_core::units::{KPA, MM};
use palpate_dissertation::appearance::model::AppearanceRule;
use palpate_dissertation::appearance::train::AppearanceConfig;
use palpate_sim::letters::Letter;
use palpate_sim::plot::{Line, svg};
use palpate_sim::press::PressSimulator;
use palpate_sim::rig::{INDENTATION, PlanarPose, Rig, RigNoise, rig_sensor};
use rayon::prelude::*;
use serde::Serialize;

use crate::appearance_trials::{Confused, Evidence, Point, accuracy_at, line, mean_of, train};
use crate::arguments::count;
use crate::letter_presses::{CONTACT, RaisedLetters};
use crate::letters_geometric::letters_named;
use crate::object_trials::panel;
use crate::report::{Outcome, Progress, Report};

/// Counts of readings.
const COUNTS: [usize; 11] = [1, 2, 3, 5, 8, 10, 15, 20, 30, 40, 60];

/// Thickness of the solid letters, metres; more than that of the covering.
const THICKNESS: f64 = 3.0 * MM;

/// Noise in training: total width as a share of the largest pressure (about 30 % in print).
const TRAINING_NOISE: f64 = 0.3;

/// Weight of each of the four neighbours in the small blur; the taxel itself has 1.
const BLUR: f64 = 0.15;

/// Half the side of the square in which simulated presses are drawn, metres: the extent of the
/// rig's plan.
const REACH: f64 = 10.2 * MM;

/// First index of the streams of simulated training, disjoint from the rig's.
const STREAM_BASE: u64 = 1 << 61;

/// Arguments of `sim-to-real`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct SimToReal {
    /// The letters.
    #[arg(long, default_value = "AEIOU", value_parser = letters_named)]
    pub letters: String,
    /// First seed. Each seed is a sensor, its noise and its trials.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Number of seeds.
    #[arg(long, default_value_t = 3, value_parser = count)]
    pub seeds: usize,
    /// Simulated presses per letter.
    #[arg(long, default_value_t = 600, value_parser = count)]
    pub training_presses: usize,
    /// Trials per letter and seed.
    #[arg(long, default_value_t = 50, value_parser = count)]
    pub trials: usize,
    /// Candidates for the number of classes.
    #[arg(long, default_values_t = [24], value_delimiter = ',', value_parser = count)]
    pub n_classes: Vec<usize>,
}

/// Source of the test readings, and the remedies.
#[derive(Clone, Copy, Debug)]
struct Bridge {
    name: &'static str,
    key: &'static str,
    tested: Tested,
    noise_in_training: bool,
    square_root: bool,
    blur: bool,
}

/// Sensor of the test readings.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Tested {
    /// The simulator of training.
    Same,
    /// The rig's planned presses, ideal: another imaging model.
    IdealRig,
    /// The rig with the errors of a mechanism and of a calibrated array.
    Rig,
    /// The noisy rig with a squared response.
    SquaredRig,
}

/// From the same simulator to the other sensor, and the remedies one by one.
const BRIDGES: [Bridge; 7] = {
    let same = Bridge {
        name: "same simulator",
        key: "same_",
        tested: Tested::Same,
        noise_in_training: false,
        square_root: false,
        blur: false,
    };
    let squared =
        Bridge { name: "squared response", key: "squared_", tested: Tested::SquaredRig, ..same };
    let noise =
        Bridge { name: "and noise in training", key: "noise_", noise_in_training: true, ..squared };
    let root = Bridge { name: "and square root", key: "root_", square_root: true, ..noise };
    [
        same,
        Bridge { name: "ideal rig", key: "ideal_", tested: Tested::IdealRig, ..same },
        Bridge { name: "noisy rig", key: "rig_", tested: Tested::Rig, ..same },
        squared,
        noise,
        root,
        Bridge { name: "and blur", key: "", blur: true, ..root },
    ]
};

/// A mechanism as in section 3.2.3, and an array after the calibration of section 2.2.
fn calibrated() -> RigNoise {
    RigNoise { gain_spread: 0.05, noise: 0.2 * KPA, step: 0.08 * KPA, ..RigNoise::physical() }
}

/// Runs the experiment.
///
/// # Errors
/// When a letter does not exist or presses cannot be learnt from.
pub fn run(config: &SimToReal, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let letters = RaisedLetters::new(&config.letters)?;
    let simulated = rig_sensor();
    progress("pressing simulated letters", 0, config.seeds + 1);
    let training = presses(&letters, &simulated, config, 0)?;
    let same = presses(&letters, &simulated, config, 1)?;
    let kinds =
        [DescriptorKind::PolarFourier, DescriptorKind::Mnti, DescriptorKind::MomentNormalized];
    let mut curves: Vec<Vec<Vec<Point>>> = vec![Vec::new(); kinds.len() * BRIDGES.len()];
    for index in 0..config.seeds {
        let seed = config.seed + index as u64;
        progress(&format!("sensor {seed}"), index + 1, config.seeds + 1);
        for (bridge_idx, bridge) in BRIDGES.iter().enumerate() {
            let tested = bridged(&tests(&letters, *bridge, &same, seed)?, &simulated, *bridge)?;
            let learnt = if bridge.noise_in_training {
                noisy(&training, &simulated, seed)?
            } else {
                training.clone()
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
    let mut report = Report::default();
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

/// Presses of solid letters wherever the array meets them, through the imaging model. Touches
/// centred on a stroke alone would not represent touches beside it.
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
            loop {
                let (x, y) = (stream.uniform(-REACH, REACH), stream.uniform(-REACH, REACH));
                let at = PlanarPose { x, y, angle: stream.uniform(0.0, TAU) };
                let pose = at.object_from_sensor(depth);
                let reading = simulator.read(SensorId(0), pose, &mut stream);
                if reading.image().max() > CONTACT {
                    return reading;
                }
            }
        };
        (0..config.training_presses).map(|_| press()).collect()
    };
    Ok(letters.letters().par_iter().map(of_letter).collect())
}

/// The test readings of a bridge, before its remedies.
fn tests(
    letters: &RaisedLetters,
    bridge: Bridge,
    same: &[Vec<Reading>],
    seed: u64,
) -> anyhow::Result<Vec<Vec<Reading>>> {
    let (sensor, noise) = match bridge.tested {
        Tested::Same => return Ok(same.to_vec()),
        Tested::IdealRig => (rig_sensor(), RigNoise::none()),
        Tested::Rig => (rig_sensor(), calibrated()),
        Tested::SquaredRig => (squared(&rig_sensor())?, calibrated()),
    };
    Ok(letters.planned(&Rig::new(SensorId(0), &sensor, noise, seed), 2))
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

/// The same readings with other pressures.
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
    let symbol = |letter: usize| symbols.chars().nth(letter).map_or(String::new(), String::from);
    for point in curve {
        report.labelled(&[("bridge", bridge.name), ("method", kind.name())], point);
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
        report.labelled(
            &[
                ("bridge", bridge.name),
                ("method", kind.name()),
                ("letter", &symbol(*truth)),
                ("confused_with", &symbol(*named)),
            ],
            Confused { readings: 40, trials: *trials },
        );
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
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        for key in ["", "ideal_", "rig_", "squared_", "noise_", "root_"] {
            assert!(summary.contains_key(&format!("mnti_{key}accuracy_at_40")), "{summary:?}");
        }
        assert!(summary["polar_fourier_same_accuracy_at_40"] > 0.6, "{summary:?}");
        assert_eq!(outcome.plot.matches("<polyline").count(), 21);
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
