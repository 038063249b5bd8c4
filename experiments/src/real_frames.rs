//! Real frames of a 28 × 50 array without poses: recognition from one frame and from ten.
//!
//! Data: `frames.csv` of Gandarias et al. (2019), 18 objects of 30 frames each, not part of this
//! project. Frames carry the number of their picture, which follows the order in which they were
//! taken. Since successive frames resemble each other, folds are split by time: an object's
//! frames form three runs of ten, and models of two runs are tested on the third.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::Args;
use palpate_core::descriptor::DescriptorKind;
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::{
    Coupling, ForceCurve, ImageOrder, SensorDescription, SensorParameters, TaxelGrid,
};
use palpate_core::units::{KPA, MM};
use palpate_dissertation::appearance::model::AppearanceRule;
use palpate_dissertation::appearance::train::{
    AppearanceConfig, ClusteringMethod, DiscriminantConfig,
};
use palpate_sim::plot::{Panel, svg};
use serde::Serialize;

use crate::appearance_trials::{Confused, Evidence, Point, accuracy_at, line, mean_of, train};
use crate::arguments::count;
use crate::report::{Outcome, Progress, Report};

/// Arguments of `real-frames`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct RealFrames {
    /// The folder that holds frames.csv.
    #[arg(long, value_name = "DIR")]
    pub data: PathBuf,
    /// Seed of clusterings and draws.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Runs that an object's frames are cut into. Each is tested once.
    #[arg(long, default_value_t = 3, value_parser = count)]
    pub folds: usize,
    /// Trials per object and fold.
    #[arg(long, default_value_t = 50, value_parser = count)]
    pub trials: usize,
}

/// A configuration of learning, with its name in the rows and its prefix in the summary.
struct Method {
    name: &'static str,
    key: &'static str,
    config: AppearanceConfig,
}

/// `docs/results/real-frames.md` explains the methods.
fn methods() -> Vec<Method> {
    let spectrum = AppearanceConfig {
        descriptor: DescriptorKind::PolarSpectrum,
        discriminant: Some(DiscriminantConfig { n_axes: 17, shrinkage: 0.1 }),
        clustering: ClusteringMethod::PerObject,
        ..AppearanceConfig::default()
    };
    let bag = |descriptor| AppearanceConfig {
        descriptor,
        clustering: ClusteringMethod::SharedMixture,
        n_classes: vec![36],
        ..AppearanceConfig::default()
    };
    let method = |name, key, config| Method { name, key, config };
    let discriminant = |descriptor| AppearanceConfig { descriptor, ..spectrum.clone() };
    vec![
        method("polar_spectrum, per object", "", spectrum.clone()),
        method("polar_spectrum, bag", "spectrum_bag_", bag(DescriptorKind::PolarSpectrum)),
        method("mnti, per object", "mnti_per_object_", discriminant(DescriptorKind::Mnti)),
        method("mnti, bag", "mnti_bag_", bag(DescriptorKind::Mnti)),
        method("polar_fourier, bag", "pf_bag_", bag(DescriptorKind::PolarFourier)),
    ]
}

/// The array of the data, Tekscan's 6077: 1.9 mm between taxels, 0 to 34 kPa in 8 bits.
/// Covering and point spread are not known and play no role here.
fn array() -> anyhow::Result<SensorDescription> {
    let saturation = 34.0 * KPA;
    let parameters = SensorParameters {
        layout: None,
        grid: TaxelGrid { rows: 28, cols: 50, pitch: 1.9 * MM, taxel_width: 1.4 * MM },
        covering_thickness: 1.0 * MM,
        point_spread: 1.0 * MM,
        force_curve: ForceCurve::new(vec![(0.0, 0.0), (1.0 * MM, saturation)])?,
        saturation,
        noise: 0.0,
        quantisation: saturation / 255.0,
        image_order: ImageOrder::default(),
        coupling: Coupling::default(),
    };
    Ok(SensorDescription::new(parameters)?)
}

/// An object's frames in the order in which they were taken.
struct Recorded {
    name: String,
    readings: Vec<Reading>,
}

/// Reads `frames.csv`: object, split, picture, rows, columns, then the taxels row by row.
fn load(path: &Path, sensor: &SensorDescription) -> anyhow::Result<Vec<Recorded>> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut frames = Vec::new();
    for (number, line) in text.lines().enumerate().skip(1) {
        let frame = frame(line, sensor);
        frames.push(frame.with_context(|| format!("{}, line {}", path.display(), number + 1))?);
    }
    frames.sort_by(|a, b| (&a.0, a.1).cmp(&(&b.0, b.1)));
    let of_object = |same: &[(String, u32, Reading)]| Recorded {
        name: same[0].0.clone(),
        readings: same.iter().map(|(_, _, reading)| reading.clone()).collect(),
    };
    Ok(frames.chunk_by(|a, b| a.0 == b.0).map(of_object).collect())
}

/// The object, the number of the picture and the reading of a line.
fn frame(line: &str, sensor: &SensorDescription) -> anyhow::Result<(String, u32, Reading)> {
    let fields: Vec<&str> = line.split(',').collect();
    let [object, _split, picture, _rows, _cols, taxels @ ..] = fields.as_slice() else {
        bail!("{} fields, expected object, split, picture, rows, columns and taxels", fields.len());
    };
    let digits: String = picture.chars().filter(char::is_ascii_digit).collect();
    let number = digits.parse().with_context(|| {
        format!("picture {picture:?} has no number, expected one like pen12.jpg")
    })?;
    let step = sensor.parameters().quantisation;
    let pressure = |value: &&str| {
        let value: f64 = value.parse().with_context(|| format!("taxel {value:?} is no number"))?;
        Ok(Some(step * value))
    };
    let pressures: Vec<Option<f64>> = taxels.iter().map(pressure).collect::<anyhow::Result<_>>()?;
    let reading = Reading::new(SensorId(0), sensor, &pressures, Pose::IDENTITY)?;
    Ok(((*object).to_owned(), number, reading))
}

/// Runs the experiment.
///
/// # Errors
/// When the frames cannot be read, or an object has too few of them.
pub fn run(config: &RealFrames, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let sensor = array()?;
    let objects = load(&config.data.join("frames.csv"), &sensor)?;
    let run_of = |n: usize, fold: usize| n * fold / config.folds..n * (fold + 1) / config.folds;
    let mut report = Report::default();
    let mut lines = Vec::new();
    let methods = methods();
    for (done, method) in methods.iter().enumerate() {
        progress(method.name, done, methods.len());
        let mut curves = Vec::new();
        for fold in 0..config.folds {
            let tested = |object: &Recorded| run_of(object.readings.len(), fold);
            let test: Vec<Vec<Reading>> =
                objects.iter().map(|object| object.readings[tested(object)].to_vec()).collect();
            let rest = |object: &Recorded| {
                let tested = tested(object);
                let (before, after) =
                    (&object.readings[..tested.start], &object.readings[tested.end..]);
                [before, after].concat()
            };
            let training: Vec<Vec<Reading>> = objects.iter().map(rest).collect();
            let model = train(&training, &sensor, &method.config, config.seed)?;
            let evidence = Evidence::of(&model, &test, &sensor, AppearanceRule::Divergence);
            let counts: Vec<usize> = (1..=evidence.n_readings_min()).collect();
            let seed = config.seed + fold as u64;
            curves.push(evidence.drawn(&counts, config.trials, seed));
        }
        let curve = mean_of(&curves);
        rows(&mut report, method, &objects, &curve);
        lines.push(line(method.name, &curve));
    }
    let title = format!("{} objects, real frames of 28 × 50 taxels", objects.len());
    let (x, y) = ("frames".to_owned(), "right (%)".to_owned());
    let plot = svg(&[Panel { title, x, y, lines }]);
    Ok(Outcome { report, plot, pictures: Vec::new() })
}

fn rows(report: &mut Report, method: &Method, objects: &[Recorded], curve: &[Point]) {
    for point in curve {
        report.labelled(&[("method", method.name)], point);
    }
    for readings in [1, 10] {
        if let Some(accuracy) = accuracy_at(curve, readings) {
            report.summarise(&format!("{}accuracy_at_{readings}", method.key), accuracy);
        }
    }
    for (truth, named, trials) in curve.iter().take(1).flat_map(|point| &point.confusions) {
        report.labelled(
            &[
                ("method", method.name),
                ("object", &objects[*truth].name),
                ("confused_with", &objects[*named].name),
            ],
            Confused { readings: 1, trials: *trials },
        );
    }
}
