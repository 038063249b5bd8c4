//! Figure 5.2 again: similarity of touches of the dragon against their distance.
//!
//! Every pair of 1,000 training readings, binned by the distance between the sensor positions in
//! element widths; the last bin holds all pairs 15 or more apart. Exhaustive (section 5.3.3) is
//! the upper bound: no feature that is invariant to rotation and translation can keep more.
//! Similarity is the cosine of the descriptors and, since all touches have much in common, the
//! cosine after their mean is subtracted, which is what vocabularies compare
//! (`docs/equations.md`, 5.3.2).

use anyhow::Context as _;
use clap::Args;
use palpate_core::descriptor::exhaustive::Exhaustive;
use palpate_core::descriptor::{DescriptorKind, affinity, normalize};
use palpate_core::reading::{Reading, TactileImage};
use palpate_core::sensor::SensorDescription;
use palpate_sim::plot::{Line, Panel, svg};
use rayon::prelude::*;
use serde::Serialize;

use crate::arguments::{ObjectSet, count};
use crate::objects::touch;
use crate::report::{Outcome, Progress, Report};

/// Descriptors that are compared.
const DESCRIPTORS: [DescriptorKind; 4] = [
    DescriptorKind::Vectorize,
    DescriptorKind::MomentNormalized,
    DescriptorKind::PolarFourier,
    DescriptorKind::Mnti,
];

/// Distance of the last bin: this many element widths or more.
const FAR: usize = 15;

/// Distance, in element widths, up to which two readings may overlap: the array's width.
const OVERLAP: usize = 6;

/// Arguments of `consistency`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct Consistency {
    /// The objects that are touched.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// The object that is touched.
    #[arg(long, default_value = "dragon", value_name = "NAME")]
    pub object: String,
    /// Seed of its touches.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Number of touches.
    #[arg(long, default_value_t = 1_000, value_parser = count)]
    pub readings: usize,
}

/// Sum of the similarities of the pairs at one distance, and their number.
#[derive(Clone, Copy, Default)]
struct Bin {
    sum: f64,
    n: usize,
}

/// Runs the experiment.
///
/// # Errors
/// When there is no such object, or it cannot be touched often enough.
pub fn run(config: &Consistency, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let objects = config.objects.load()?;
    let object = objects
        .iter()
        .find(|object| object.name == config.object)
        .with_context(|| format!("no object is called {}", config.object))?;
    let sensor = SensorDescription::digitacts_6x6();
    progress("touching", 0, DESCRIPTORS.len() + 2);
    let readings = touch(object, &sensor, config.readings, 2 * config.seed)?;
    let images: Vec<&TactileImage> = readings.iter().map(Reading::image).collect();
    let (rows, cols) = (sensor.grid().rows, sensor.grid().cols);
    let mut profiles: Vec<Profile> = Vec::new();
    let mut relative: Vec<Profile> = Vec::new();
    for (done, kind) in DESCRIPTORS.iter().enumerate() {
        progress(kind.name(), done + 1, DESCRIPTORS.len() + 2);
        let features = kind.plan(rows, cols).describe(&images);
        let alike = |a: usize, b: usize| affinity(features.row(a), features.row(b));
        profiles.push((kind.name().to_owned(), profile(&readings, &sensor, alike)));
        let mean = features.mean();
        let centered: Vec<Vec<f64>> = features.rows().map(|row| without(row, &mean)).collect();
        let alike = |a: usize, b: usize| affinity(&centered[a], &centered[b]);
        relative.push((format!("{}_relative", kind.name()), profile(&readings, &sensor, alike)));
    }
    progress("exhaustive", DESCRIPTORS.len() + 1, DESCRIPTORS.len() + 2);
    let exhaustive = Exhaustive::new(rows, cols);
    let alike = |a: usize, b: usize| exhaustive.similarity(images[a], images[b]);
    let bound = profile(&readings, &sensor, alike);
    let mut report = Report::default();
    profiles.push(("exhaustive".to_owned(), bound.clone()));
    state(&mut report, &profiles, &bound);
    state(&mut report, &relative, &bound);
    let scaled =
        profiles.iter().map(|(name, bins)| (name.clone(), scaled(bins))).collect::<Vec<_>>();
    let plot = svg(&[
        panel(&format!("touches of the {}", config.object), &means(&profiles)),
        panel("scaled: 1 at no distance, 0 far", &scaled),
        panel("descriptors without their mean", &means(&relative)),
    ]);
    Ok(Outcome { report, plot, pictures: Vec::new() })
}

/// A comparator's name and its similarities at each distance.
type Profile = (String, Vec<Bin>);

/// A descriptor without the mean, scaled to norm 1.
fn without(descriptor: &[f64], mean: &[f64]) -> Vec<f64> {
    let mut left: Vec<f64> =
        descriptor.iter().zip(mean).map(|(value, mean)| value - mean).collect();
    normalize(&mut left);
    left
}

/// The bin of a pair of readings, by the distance (m) of the sensor's places.
fn bin(a: &Reading, b: &Reading, pitch: f64) -> usize {
    let (a, b) = (a.session_from_sensor().translation, b.session_from_sensor().translation);
    ((a.distance(b) / pitch) as usize).min(FAR)
}

/// Similarity of pairs against distance, in bins of one element width.
fn profile(
    readings: &[Reading],
    sensor: &SensorDescription,
    alike: impl Fn(usize, usize) -> f64 + Sync,
) -> Vec<Bin> {
    let pitch = sensor.grid().pitch;
    let of_first = |first: usize| {
        let mut bins = [Bin::default(); FAR + 1];
        for second in 0..first {
            let bin = &mut bins[bin(&readings[first], &readings[second], pitch)];
            bin.sum += alike(first, second);
            bin.n += 1;
        }
        bins
    };
    let parts: Vec<[Bin; FAR + 1]> = (0..readings.len()).into_par_iter().map(of_first).collect();
    let mut total = vec![Bin::default(); FAR + 1];
    for part in &parts {
        for (total, bin) in total.iter_mut().zip(part) {
            total.sum += bin.sum;
            total.n += bin.n;
        }
    }
    total
}

impl Bin {
    /// The mean; NaN for no pair.
    fn mean(self) -> f64 {
        self.sum / self.n as f64
    }
}

/// Row of the report: mean similarity of the pairs of touches at one distance.
#[derive(Serialize)]
struct Level {
    distance_elements_from: usize,
    correlation: f64,
    pairs: usize,
}

/// Adds a row for each bin, and the summary: mean similarity near, at the end of the overlap and
/// far; share of the drop within the overlap; Pearson correlation of the profile with
/// Exhaustive's.
fn state(report: &mut Report, profiles: &[Profile], bound: &[Bin]) {
    for (name, bins) in profiles {
        for (distance, bin) in bins.iter().enumerate() {
            report.labelled(
                &[("comparator", name)],
                Level { distance_elements_from: distance, correlation: bin.mean(), pairs: bin.n },
            );
        }
    }
    for (name, bins) in profiles {
        let level = |at: usize| bins[at].mean();
        for at in [0, OVERLAP, FAR] {
            report.summarise(&format!("{name}_at_{at}"), level(at));
        }
        let share = (level(0) - level(OVERLAP)) / (level(0) - level(FAR));
        report.summarise(&format!("{name}_drop_within_overlap"), share);
        report.summarise(&format!("{name}_pearson_with_exhaustive"), pearson(bins, bound));
    }
}

/// Pearson's correlation of two profiles.
fn pearson(a: &[Bin], b: &[Bin]) -> f64 {
    let values = |bins: &[Bin]| -> Vec<f64> { bins.iter().map(|bin| bin.mean()).collect() };
    palpate_core::sensor::spread_fit::pearson(&values(a), &values(b))
}

fn means(profiles: &[Profile]) -> Vec<(String, Vec<f64>)> {
    let of = |(name, bins): &Profile| (name.clone(), bins.iter().map(|bin| bin.mean()).collect());
    profiles.iter().map(of).collect()
}

/// Means of a profile, shifted and scaled to 1 in the first bin and 0 in the last; NaN, which is
/// not drawn, if the profile hardly falls.
fn scaled(bins: &[Bin]) -> Vec<f64> {
    let (near, far) = (bins[0].mean(), bins[FAR].mean());
    let range = if near - far > 2e-3 { near - far } else { f64::NAN };
    let scale = |bin: &Bin| (bin.mean() - far) / range;
    bins.iter().map(scale).map(|value| if value < 0.0 { 0.0 } else { value }).collect()
}

fn panel(title: &str, profiles: &[(String, Vec<f64>)]) -> Panel {
    let lines = profiles.iter().map(|(name, means)| Line {
        name: name.clone(),
        points: means.iter().enumerate().map(|(at, mean)| (at as f64, *mean)).collect(),
    });
    let (x, y) = ("distance (element widths)".to_owned(), "correlation".to_owned());
    Panel { title: title.to_owned(), x, y, lines: lines.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn near_touches_are_more_alike_than_far_ones() {
        let config = Consistency { seed: 101, readings: 200, ..defaults() };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        for name in ["vectorize", "moment_normalized", "polar_fourier", "mnti", "exhaustive"] {
            let at = |distance: usize| summary[&format!("{name}_at_{distance}")];
            assert!(at(0) > at(FAR), "{name}: {summary:?}");
            assert!((0.0..=1.0).contains(&at(FAR)));
        }
        assert!(summary["exhaustive_at_15"] > summary["vectorize_at_15"], "{summary:?}");
        assert!((summary["exhaustive_pearson_with_exhaustive"] - 1.0).abs() < 1e-9);
        assert!(summary["mnti_relative_at_0"] > summary["mnti_relative_at_15"] + 0.1);
        let missing = Consistency { object: "unicorn".to_owned(), ..config };
        assert!(run(&missing, &|_, _, _| ()).is_err());
    }
}
