//! Catalogues of ten to a thousand objects: accuracy, time and memory against size.
//!
//! The objects are those of the smaller catalogues but the letters, then procedural ones
//! (`palpate_sim::shapes::assembled`), then members of the families of both (`families`). Each
//! is touched 2,400 times; to keep a thousand in memory its map has 900 of these touches, and
//! pairs are tabled among 300 (`learnt`). Exponents are slopes of ln time and ln memory over ln objects.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use anyhow::Context as _;
use palpate_core::reading::Reading;
use palpate_core::symmetry::Symmetry;
use palpate_recogniser::belief::prepare;
use palpate_recogniser::model::SurfaceModel;
use palpate_recogniser::model::map::SurfaceLayout;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_sim::plot::{Line, Panel};
use palpate_sim::shapes::assembled;
use serde::Serialize;

use super::figures::resident_bytes;
use super::learnt::{Learnt, learn};
use super::oracle::{self, Examined};
use super::{InCatalogue, LETTER, SurfaceScale};
use crate::families::Families;
use crate::object_sessions::{Recogniser, Sessions};
use crate::objects::TestObject;
use crate::played::{Figures, Played};
use crate::report::{Progress, Report};
use crate::stated::wilson;
use crate::statistics::{mean, quantile};

/// Sizes of the catalogues, and numbers of readings and sessions.
#[derive(Clone, Debug)]
pub(super) struct Growth {
    /// Sizes of the catalogues, ascending; each catalogue contains the previous one.
    pub(super) counts: Vec<usize>,
    /// Number of procedural objects.
    pub(super) assembled: usize,
    /// Training readings per object.
    pub(super) train_readings: usize,
    /// Patches per object.
    pub(super) patches: usize,
    /// Patches per object whose pairs are indexed.
    pub(super) pair_readings: usize,
    /// Test readings per object.
    pub(super) test_readings: usize,
    /// Number of objects from which the appearance space is learnt.
    pub(super) space_objects: usize,
    /// Minimum number of sessions per catalogue; a larger catalogue has one session per object.
    pub(super) sessions: usize,
}

impl Default for Growth {
    fn default() -> Self {
        Self {
            counts: vec![10, 50, 100, 300, 1_000],
            assembled: 500,
            train_readings: 2_400,
            patches: 900,
            pair_readings: 300,
            test_readings: 20,
            space_objects: 100,
            sessions: 500,
        }
    }
}

impl Growth {
    /// Catalogues of at most this many objects, the largest of exactly as many.
    pub(super) fn up_to(largest: usize) -> Self {
        let usual = Self::default();
        let smaller = usual.counts.iter().filter(|count| **count < largest);
        Self { counts: smaller.copied().chain([largest]).collect(), ..usual }
    }

    /// The size of the largest catalogue.
    pub(super) fn largest(&self) -> usize {
        self.counts.last().copied().unwrap_or(0)
    }

    /// Configuration of the maps.
    pub(super) fn surface(&self) -> SurfaceConfig {
        let layout =
            SurfaceLayout { pair_patches_max: self.pair_readings, ..SurfaceLayout::default() };
        SurfaceConfig { patches_max: self.patches, layout }
    }
}

/// Readings per session.
const READINGS: usize = 6;

/// Least size of a smaller catalogue whose wrong answers are examined.
const EXAMINED_MIN: usize = 100;

/// Figures of a catalogue of some size.
struct Measured {
    count: usize,
    accuracy: f64,
    ms: f64,
    bytes: f64,
}

/// Adds the rows and figures of large catalogues; returns their panels.
pub(super) fn run(
    config: &SurfaceScale,
    growth: &Growth,
    parents: Vec<TestObject>,
    report: &mut Report,
    progress: Progress<'_>,
) -> anyhow::Result<Vec<Panel>> {
    progress("growing families", 0, 1);
    let largest = growth.largest();
    let mut objects = Families::new(with_assembled(parents, config, growth)?, config.seed)?;
    let Learnt { model, test, names } = learn(config, growth, &mut objects, report, progress)?;
    prepare(&model, &SurfaceOptions::default());
    if let Some(bytes) = resident_bytes() {
        report.summarise(&format!("rss_bytes_{largest}"), bytes);
    }
    let mut measured = Vec::new();
    for count in &growth.counts {
        let model = Arc::new(model.with_maps(model.maps()[..*count].to_vec()));
        let (figures, played) = measure(config, growth, &model, &test, report, progress)?;
        measured.push(figures);
        if config.oracle > 0 && (*count >= EXAMINED_MIN || *count == largest) {
            let symmetries = vec![Symmetry::NONE; test.len()];
            let sessions = Sessions::undisturbed(
                &config.touches.sensor,
                &test,
                &symmetries,
                config.seed,
                READINGS,
            );
            let (model, sessions) = (&model, &sessions);
            let examined = Examined::new(config, growth.train_readings, model, sessions, &played);
            objects = objects.again()?;
            let these = |wanted: &BTreeSet<usize>| these(&mut objects, &names, wanted);
            oracle::run(&examined, these, report, progress)?;
        }
    }
    let slope = |value: fn(&Measured) -> f64| {
        slope(&measured.iter().map(|m| ((m.count as f64).ln(), value(m).ln())).collect::<Vec<_>>())
    };
    report.summarise("time_exponent", slope(|m| m.ms));
    if let [.., before, last] = &measured[..] {
        let exponent = (last.ms / before.ms).ln() / (last.count as f64 / before.count as f64).ln();
        report.summarise(&format!("time_exponent_{}_to_{}", before.count, last.count), exponent);
    }
    report.summarise("memory_exponent", slope(|m| m.bytes));
    Ok(panels(&measured))
}

/// The parents of families: the given objects without letters, which as solids share most of
/// their surface, and procedural objects.
pub(super) fn with_assembled(
    given: Vec<TestObject>,
    config: &SurfaceScale,
    growth: &Growth,
) -> anyhow::Result<Vec<TestObject>> {
    let mut parents: Vec<TestObject> =
        given.into_iter().filter(|object| !object.name.starts_with(LETTER)).collect();
    for index in 0..growth.assembled {
        let mesh = assembled(config.seed, index as u64)
            .with_context(|| format!("procedural object {index} never hangs together"))?;
        let mesh = mesh.scaled_to_largest_dimension(config.first.size());
        parents.push(TestObject { name: format!("assembled {index}"), mesh });
    }
    Ok(parents)
}

/// The objects at these indices of the catalogue, made again.
fn these(
    objects: &mut Families,
    names: &[String],
    wanted: &BTreeSet<usize>,
) -> anyhow::Result<BTreeMap<usize, TestObject>> {
    let mut found = BTreeMap::new();
    for index in wanted {
        // Objects that were left out are passed by.
        let made = objects.by_ref().find(|object| match object {
            Ok(object) => object.name == names[*index],
            Err(_) => true,
        });
        found.insert(*index, made.context("the families never end")??);
    }
    Ok(found)
}

#[derive(Serialize)]
struct OfFamilies {
    cpu_ms_mean: Option<f64>,
    bytes: usize,
    #[serde(flatten)]
    figures: Figures,
}

/// Plays sessions with a catalogue: on one thread for the time of one core, and, for the
/// largest, again on two threads to measure its slowest answers.
fn measure(
    config: &SurfaceScale,
    growth: &Growth,
    model: &Arc<SurfaceModel>,
    test: &[Vec<Reading>],
    report: &mut Report,
    progress: Progress<'_>,
) -> anyhow::Result<(Measured, Played)> {
    let count = model.maps().len();
    let surface = Recogniser::Surface { model: model.clone(), options: SurfaceOptions::default() };
    let symmetries = vec![Symmetry::NONE; test.len()];
    let mut sessions =
        Sessions::undisturbed(&config.touches.sensor, test, &symmetries, config.seed, READINGS);
    let trials = trials(count, growth.sessions, config.sessions_max);
    let played = sessions.play_these(&surface, trials.iter().copied(), progress)?;
    let wall = mean(&played.wall_ms());
    let ms = played.cpu_ms.unwrap_or(wall);
    for readings in 1..=READINGS {
        report.labelled(
            &[("method", "surface, families")],
            InCatalogue {
                objects: count,
                figures: OfFamilies {
                    cpu_ms_mean: played.cpu_ms,
                    bytes: surface.bytes(),
                    figures: played.figures(readings),
                },
            },
        );
    }
    if count == growth.largest() {
        sessions.threads = 2;
        let shared = sessions.play_these(&surface, trials.iter().copied(), progress)?;
        for readings in [2, 3, 4, READINGS] {
            let key = format!("accuracy_{count}_at_{readings}");
            report.summarise(&key, played.accuracy(readings));
        }
        let right = played.after(READINGS).filter(|step| step.is_right()).count();
        let (low, high) = wilson(right, played.after(READINGS).count());
        report.summarise(&format!("accuracy_{count}_at_{READINGS}_low"), low);
        report.summarise(&format!("accuracy_{count}_at_{READINGS}_high"), high);
        report.summarise(&format!("p99_ms_{count}"), quantile(&shared.wall_ms(), 0.99));
        report.summarise(&format!("ms_per_touch_{count}"), ms);
        report.summarise(&format!("bytes_{count}"), surface.bytes() as f64);
    }
    let (accuracy, bytes) = (played.accuracy(READINGS), surface.bytes() as f64);
    Ok((Measured { count, accuracy, ms, bytes }, played))
}

/// The trials with a catalogue, object and number: at least `least`, one an object in a larger
/// catalogue, at most `most`, of objects evenly chosen.
fn trials(n_objects: usize, least: usize, most: Option<usize>) -> Vec<(usize, usize)> {
    let n = least.max(n_objects).min(most.unwrap_or(usize::MAX));
    match n < n_objects {
        true => (0..n).map(|at| (at * n_objects / n, 0)).collect(),
        false => (0..n).map(|at| (at % n_objects, at / n_objects)).collect(),
    }
}

/// Slope of the least-squares line through points.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |sum, p| (sum.0 + p.0 / n, sum.1 + p.1 / n));
    let (xy, xx) = points
        .iter()
        .fold((0.0, 0.0), |sum, p| (sum.0 + (p.0 - x) * (p.1 - y), sum.1 + (p.0 - x).powi(2)));
    xy / xx
}

fn panels(measured: &[Measured]) -> Vec<Panel> {
    let panel = |title: &str, y: &str, value: fn(&Measured) -> f64| Panel {
        title: title.to_owned(),
        x: "objects (log10)".to_owned(),
        y: y.to_owned(),
        lines: vec![Line {
            name: "surface".to_owned(),
            points: measured.iter().map(|m| ((m.count as f64).log10(), value(m))).collect(),
        }],
    };
    vec![
        panel("recognised after six readings", "share right", |m| m.accuracy),
        panel("time of a reading", "µs on one core (log10)", |m| (m.ms * 1e3).log10()),
        panel("memory", "kB of maps (log10)", |m| (m.bytes / 1e3).log10()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn the_slope_of_a_power_law_is_its_exponent() {
        let point = |n: f64| (n.ln(), (3.0 * n.powf(0.7)).ln());
        assert!((slope(&[10.0, 50.0, 1e3].map(point)) - 0.7).abs() < 1e-12);
    }

    #[test]
    fn small_families_are_learnt_and_recognised() {
        let config = SurfaceScale { seed: 101, oracle: 4, ..defaults() };
        let growth = Growth {
            counts: vec![3, 8],
            assembled: 1,
            train_readings: 200,
            patches: 200,
            pair_readings: 100,
            test_readings: 10,
            space_objects: 3,
            sessions: 6,
        };
        let parents = config.first.load().unwrap().into_iter().take(4).collect();
        let mut report = Report::default();
        let panels = run(&config, &growth, parents, &mut report, &|_, _, _| ()).unwrap();
        let summary = &report.summary;
        assert!(summary["accuracy_8_at_6"] > 0.7, "{summary:?}");
        for key in ["p99_ms_8", "rss_bytes_8", "ms_per_touch_8"] {
            assert!(summary[key].is_finite(), "{key}");
        }
        // The time of this few touches may be below the clock's resolution.
        assert!(summary.contains_key("time_exponent"));
        // The maps have equal size, so that bytes grow linearly with the objects.
        let exponent = summary["memory_exponent"];
        assert!((0.7..1.3).contains(&exponent), "{exponent}");
        let examined: f64 =
            [2, 3, 4, 6].map(|n| summary[&format!("examined_8_at_{n}")]).iter().sum();
        assert_eq!(report.rows.len(), 2 * READINGS + examined as usize);
        let is_share = |key: &str| key.starts_with("lost_by_") && key.ends_with("_8_at_2");
        let shares = summary.iter().filter(|(key, _)| is_share(key)).map(|(_, share)| share);
        assert!((shares.sum::<f64>() - 1.0).abs() < 1e-9, "{summary:?}");
        // With more objects than sessions asked for, each object has its own.
        let trials = |at: usize| report.rows[at]["trials"].clone();
        assert_eq!((trials(0), trials(READINGS)), (6.into(), 8.into()));
        assert_eq!((panels.len(), panels[0].lines[0].points.len()), (3, 2));
    }

    #[test]
    fn trials_are_of_all_objects_or_of_some_evenly_chosen() {
        assert_eq!(trials(2, 3, None), [(0, 0), (1, 0), (0, 1)]);
        assert_eq!(trials(4, 3, None).len(), 4);
        assert_eq!(trials(10, 3, Some(4)), [(0, 0), (2, 0), (5, 0), (7, 0)]);
    }

    #[test]
    fn a_larger_catalogue_adds_to_the_smaller_ones() {
        assert_eq!(Growth::up_to(1_000).counts, Growth::default().counts);
        assert_eq!(Growth::up_to(200).counts, [10, 50, 100, 200]);
        let all = Growth::up_to(10_000).counts;
        assert_eq!(all, [10, 50, 100, 300, 1_000, 10_000]);
    }
}
