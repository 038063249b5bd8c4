//! Section 3.4 again: raised letters by geometry, accuracy and errors against readings.
//!
//! A seed determines a sensor (its gains), its noise and its trials. Training takes the rig's
//! first repetition of 192 presses a letter; a trial draws a pose (±10 mm along x and y, any
//! angle) and presses of the second repetition without replacement. All methods see the same
//! readings. Poses count only when the letter is right, as in the dissertation; errors are
//! modulo the letter's symmetry. The methods are listed in `methods`.

mod beliefs;
mod figures;
mod methods;
mod pictures;
mod timing;
mod trials;

use std::path::PathBuf;

use anyhow::{Context as _, bail};
use clap::{Args, ValueEnum};
use glam::DVec3;
use palpate_core::metric::{Inertia, Symmetry, SymmetryOrder};
use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::SensorDescription;
use palpate_core::training::TrainingSet;
use palpate_dissertation::geometric::model::GeometricModel;
use palpate_dissertation::geometric::train::{GeometricConfig, map_geometry};
use palpate_dissertation::occupancy::{ClassifiedPress, InverseModel, SpreadForm};
use palpate_sim::letters::{Letter, RotationOrder, SYMBOLS};
use palpate_sim::rig::{LetterField, Rig, RigNoise, rig_sensor};
use serde::Serialize;

use crate::arguments::count;
use crate::letter_presses::font_of;
use crate::report::{Outcome, Progress, Report};
use figures::Plotted;
use methods::{METHODS, Prepared};

/// Arguments of `letters-geometric`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct LettersGeometric {
    /// AEIOU, capitals, all, or any letters.
    #[arg(long, default_value = "AEIOU", value_parser = letters_named)]
    pub letters: String,
    /// First seed.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Number of seeds. Each is a sensor, its noise and its trials.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub seeds: usize,
    /// Trials per letter and seed.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub trials: usize,
    /// Readings per trial, at most 192.
    #[arg(long, default_value_t = 46)]
    pub readings: usize,
    /// Noise of the presses.
    #[arg(long, default_value_t = LetterNoise::Physical, value_enum)]
    pub noise: LetterNoise,
    /// Form of equations 3.3 to 3.5 that makes the maps.
    #[arg(long, default_value_t = LetterMaps::Corrected, value_enum)]
    pub maps: LetterMaps,
    /// A TrueType or OpenType font [default: Quicksand Bold].
    #[arg(long, value_name = "PATH")]
    pub font: Option<PathBuf>,
    /// Only the method of this name, or those whose names begin with it. May be repeated.
    #[arg(long, value_delimiter = ',', value_name = "NAME")]
    pub method: Vec<String>,
}

/// The noise of the letter rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum LetterNoise {
    /// Noise of a real rig and array.
    Physical,
    /// More of everything, with stuck values.
    Harsh,
    /// Families other than the default method assumes: drifting places, slips, bent responses,
    /// crosstalk between rows.
    Unmatched,
}

impl LetterNoise {
    /// Parameters of the noise.
    #[must_use]
    pub fn of_rig(self) -> RigNoise {
        match self {
            Self::Physical => RigNoise::physical(),
            Self::Harsh => RigNoise::harsh(),
            Self::Unmatched => RigNoise::unmatched(),
        }
    }
}

/// Form of equations 3.3 to 3.5 that makes the maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum LetterMaps {
    /// As the service makes them (`docs/equations.md`).
    Corrected,
    /// Corrected, but with the printed exponent of equation 3.4, which is twice the spread.
    PrintedSpread,
    /// Corrected, but with the printed prior: the share of the modelled area that letters cover.
    CoveredPrior,
    /// Equations 3.3 to 3.5 as printed, with that prior and log-odds without a limit.
    AsPrinted,
}

impl LetterMaps {
    /// Whether the prior is the covered area.
    fn needs_area(self) -> bool {
        matches!(self, Self::CoveredPrior | Self::AsPrinted)
    }

    /// Planar maps in this form; `covered` is the share of the modelled area that letters cover.
    fn geometry(self, covered: f64) -> GeometricConfig {
        let corrected = InverseModel::default();
        let inverse = match self {
            Self::Corrected => corrected,
            Self::PrintedSpread => InverseModel { spread: SpreadForm::AsPrinted, ..corrected },
            Self::CoveredPrior => InverseModel { prior: covered, ..corrected },
            Self::AsPrinted => InverseModel::literal(covered),
        };
        GeometricConfig { inverse, ..GeometricConfig::planar() }
    }
}

/// The letters of a name: AEIOU, capitals, all, or any letters, each once.
///
/// # Errors
/// When a character is not a letter from A to Z or a to z, or is repeated.
pub fn letters_named(name: &str) -> Result<String, String> {
    match name {
        "capitals" => return Ok(SYMBOLS.chars().filter(char::is_ascii_uppercase).collect()),
        "all" => return Ok(SYMBOLS.to_owned()),
        _ => {}
    }
    let distinct = name.chars().enumerate().all(|(idx, c)| !name[..idx].contains(c));
    if name.len() >= 2 && distinct && name.chars().all(|c| c.is_ascii_alphabetic()) {
        return Ok(name.to_owned());
    }
    Err("expected capitals, all, or two or more different letters such as AEIOU".to_owned())
}

/// A letter with the data of its presses and of its errors.
struct TestLetter {
    symbol: char,
    area: f64,
    field: LetterField,
    symmetry: Symmetry,
}

impl TestLetter {
    fn new(letter: &Letter, sensor: &SensorDescription) -> Self {
        let order = match (letter.symbol(), letter.rotation_order()) {
            // Equation 3.21: an O has no angle.
            ('O', _) | (_, RotationOrder::Continuous) => SymmetryOrder::Continuous,
            (_, RotationOrder::Finite(n)) => SymmetryOrder::Finite(n),
        };
        let through = letter.centroid().extend(0.0);
        Self {
            symbol: letter.symbol(),
            area: letter.area(),
            field: LetterField::new(letter, sensor),
            symmetry: Symmetry { order, axis: DVec3::Z, through },
        }
    }
}

/// Sensor, model and test readings of one seed.
struct Lab {
    seed: u64,
    sensor: SensorDescription,
    inverse: InverseModel,
    model: GeometricModel,
    test: Vec<Vec<Reading>>,
    inertias: Vec<Inertia>,
}

impl Lab {
    fn new(config: &LettersGeometric, letters: &[TestLetter], seed: u64) -> anyhow::Result<Self> {
        let rig = Rig::new(SensorId(1), &rig_sensor(), config.noise.of_rig(), seed);
        let train: Vec<Vec<Reading>> =
            letters.iter().map(|letter| rig.session(&letter.field, 0)).collect();
        let test = letters.iter().map(|letter| rig.session(&letter.field, 1)).collect();
        let sensor = rig.sensor().clone();
        let sets: Vec<TrainingSet<'_>> =
            train.iter().map(|readings| TrainingSet { readings, sensor: &sensor }).collect();
        let origins = vec![DVec3::ZERO; sets.len()];
        let covered = if config.maps.needs_area() {
            covered_share(&map_geometry(&sets, &origins, &GeometricConfig::planar())?, letters)
        } else {
            f64::NAN
        };
        let geometry = config.maps.geometry(covered);
        let model = map_geometry(&sets, &origins, &geometry)?;
        let inertias = model.maps.iter().zip(letters).map(|(map, letter)| {
            palpate_dissertation::occupancy::grid::inertia(&map.occupancy)
                .with_context(|| format!("the map of {} has no occupied cell", letter.symbol))
        });
        let inertias = inertias.collect::<anyhow::Result<_>>()?;
        let inverse = geometry.inverse;
        Ok(Self { seed, sensor, inverse, model, test, inertias })
    }

    /// The classes of a press's taxels, by the form that made the maps.
    fn classified(&self, reading: &Reading) -> ClassifiedPress {
        self.inverse.classified(reading, &self.sensor)
    }
}

/// Section 3.2.1: the mean area of the letters over the mean area of their maps.
fn covered_share(model: &GeometricModel, letters: &[TestLetter]) -> f64 {
    let modelled = model.maps.iter().map(|map| {
        let shape = map.occupancy.shape();
        let [x, y, _] = shape.n();
        (x * y) as f64 * shape.cell() * shape.cell()
    });
    letters.iter().map(|letter| letter.area).sum::<f64>() / modelled.sum::<f64>()
}

/// Runs the experiment; gives the report, its plot and the maps of the first seed.
///
/// # Errors
/// When the font or a letter cannot be used, or training fails.
pub fn run(config: &LettersGeometric, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let letters = load(config)?;
    let chosen = |name: &str| {
        let is_name = |wanted: &str| METHODS.iter().any(|method| method.name == wanted);
        let wants = |wanted: &String| {
            name == wanted || (name.starts_with(wanted.as_str()) && !is_name(wanted))
        };
        config.method.is_empty() || config.method.iter().any(wants)
    };
    let methods: Vec<_> = METHODS.iter().filter(|method| chosen(method.name)).collect();
    if methods.is_empty() {
        bail!("no method begins with {:?}", config.method);
    }
    let mut steps = Vec::new();
    let mut pictures = Vec::new();
    for seed_idx in 0..config.seeds {
        let lab = Lab::new(config, &letters, config.seed + seed_idx as u64)?;
        if seed_idx == 0 {
            pictures = pictures::of_lab(&letters, &lab);
            timing::updates(&mut report, config, &lab);
            if config.maps.needs_area() {
                report.summarise("covered_share", lab.inverse.prior);
            }
        }
        for (method_idx, method) in methods.iter().enumerate() {
            let label = format!("seed {}, {}", lab.seed, method.name);
            progress(&label, seed_idx * methods.len() + method_idx, config.seeds * methods.len());
            let prepared = Prepared::new(method, &lab);
            steps.extend(trials::run(config, &letters, &lab, (method_idx, &prepared)));
        }
    }
    figures::report(&mut report, config, &methods, &letters, &steps);
    let plotted = Plotted { config, methods: &methods, steps: &steps };
    let translation = plotted.translation().into_bytes();
    pictures.push(("letters-geometric-translation.svg".to_owned(), translation));
    let plot = plotted.plot();
    Ok(Outcome { report, plot, pictures })
}

fn load(config: &LettersGeometric) -> anyhow::Result<Vec<TestLetter>> {
    let font = font_of(config.font.as_deref())?;
    let letter = |symbol: char| {
        let letter = font.letter(symbol).with_context(|| format!("the font has no {symbol}"))?;
        Ok(TestLetter::new(letter, &rig_sensor()))
    };
    config.letters.chars().map(letter).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn letters_are_named_or_listed() {
        assert_eq!(letters_named("capitals").unwrap().len(), 26);
        assert_eq!(letters_named("all").unwrap().len(), 52);
        assert_eq!(letters_named("ATz").unwrap(), "ATz");
        assert!(letters_named("AA").is_err() && letters_named("A").is_err());
        assert!(letters_named("A1").is_err());
    }

    #[test]
    fn a_small_run_recognises_letters_and_reports_every_key() {
        let config = LettersGeometric {
            letters: "AEI".to_owned(),
            seed: 101,
            seeds: 2,
            trials: 2,
            readings: 25,
            method: ["histogram-10000", "histogram-10000-sp", "particles-1000-options"]
                .map(str::to_owned)
                .to_vec(),
            ..defaults()
        };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        // All are right from the fourth reading on; the page's goal allows 12.
        let (median, worst) =
            (summary["literal_readings_to_100_median"], summary["literal_readings_to_100_worst"]);
        assert!(median <= worst && worst <= 12.0, "{summary:?}");
        // Bins are 0.8 mm and 22.5° wide; an error of one bin is 1.6 mm or more.
        let inertial = summary["literal_inertial_error_mm_mean_at_20"];
        assert!((0.3..1.6).contains(&inertial), "{summary:?}");
        // The bins that the sparse filter leaves out do not change the answer.
        for readings in [1, 3, 5, 9, 20] {
            let [all, sparse] = ["literal", "sparse"]
                .map(|method| summary[&format!("{method}_accuracy_at_{readings}")]);
            assert!((all - sparse).abs() < 1e-9, "{summary:?}");
        }
        // One of 12 trials may be wrong.
        assert!(summary["particles_1000_options_accuracy_at_20"] > 0.9, "{summary:?}");
        assert!(summary["literal_standard_error_at_3"] >= 0.0, "{summary:?}");
        assert!(summary.contains_key("update_ms_exhaustive_median"));
        // Three maps, presses, contact classes, translational errors.
        assert_eq!(outcome.pictures.len(), 6);
    }
}
