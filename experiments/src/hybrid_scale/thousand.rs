//! Catalogues of ten to a thousand objects: what accuracy, time and memory do as they grow.
//!
//! The objects are families (`families`) grown from those of the smaller catalogues. To keep a
//! thousand in memory each is touched 300 times and pairs are tabled among 300 touches. The
//! appearance space is learnt from the first hundred objects; every other object is touched,
//! mapped and its readings dropped. Exponents are slopes of ln time and ln memory over ln objects.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::hybrid::HybridOptions;
use palpate_core::model::surface::{EvidenceCalibration, SurfaceModel};
use palpate_core::reading::Reading;
use palpate_core::surface::SurfaceMap;
use palpate_core::surface::map::SurfaceLayout;
use palpate_core::symmetry::Symmetry;
use palpate_core::train::TrainingSet;
use palpate_core::train::surface::{SurfaceConfig, learn_space, map_surface};
use serde_json::json;

use super::HybridScale;
use crate::families::families;
use crate::object_sessions::{Recogniser, Sessions};
use crate::objects::{self, TestObject};
use crate::plot::{Line, Panel};
use crate::report::{Progress, Report};
use crate::statistics::{mean, quantile};

/// Sizes of catalogues; each is the beginning of the next.
const COUNTS: [usize; 5] = [10, 50, 100, 300, 1_000];

/// Readings that an object is learnt from.
const TRAIN_READINGS: usize = 300;

/// Readings that an object is tested with.
const TEST_READINGS: usize = 20;

/// Objects that the appearance space is learnt from.
const SPACE_OBJECTS: usize = 100;

/// Sessions with each catalogue; with a thousand objects not every object has one.
const SESSIONS: usize = 500;

/// Readings a session.
const READINGS: usize = 6;

/// How the maps of large catalogues are made.
fn surface_config() -> SurfaceConfig {
    let layout = SurfaceLayout { pair_patches_max: 300, ..SurfaceLayout::default() };
    SurfaceConfig { patches_max: TRAIN_READINGS, layout }
}

/// What a catalogue of some size measured.
struct Measured {
    count: usize,
    accuracy: f64,
    ms: f64,
    bytes: f64,
}

/// Adds the rows and figures of large catalogues; gives their panels.
pub(super) fn run(
    config: &HybridScale,
    parents: Vec<TestObject>,
    report: &mut Report,
    progress: Progress<'_>,
) -> anyhow::Result<Vec<Panel>> {
    progress("growing families", 0, 1);
    let largest = COUNTS[COUNTS.len() - 1];
    let objects = families(parents, largest, config.seed)?;
    let (model, test) = learn(config, &objects, progress)?;
    drop(objects);
    if let Some(bytes) = resident_bytes() {
        report.summarise(&format!("rss_bytes_{largest}"), bytes);
    }
    let mut measured = Vec::new();
    for count in COUNTS {
        let maps = model.maps[..count].to_vec();
        let model = SurfaceModel { maps, ..model.clone() };
        measured.push(measure(config, model, &test, report, progress)?);
    }
    let slope = |value: fn(&Measured) -> f64| {
        let points = measured.iter().map(|m| ((m.count as f64).ln(), value(m).ln()));
        slope(&points.collect::<Vec<_>>())
    };
    report.summarise("time_exponent", slope(|m| m.ms));
    report.summarise("memory_exponent", slope(|m| m.bytes));
    Ok(panels(&measured))
}

/// The model of all objects, and their test readings.
fn learn(
    config: &HybridScale,
    objects: &[TestObject],
    progress: Progress<'_>,
) -> anyhow::Result<(SurfaceModel, Vec<Vec<Reading>>)> {
    let sensor = &config.sensor;
    let touch = |index: usize, n: usize, seed: u64| {
        progress("touching objects", index, objects.len());
        objects::touch(&objects[index], sensor, n, seed)
    };
    let train = |index: usize| touch(index, TRAIN_READINGS, 2 * config.seed);
    let first: Vec<Vec<Reading>> =
        (0..SPACE_OBJECTS.min(objects.len())).map(train).collect::<anyhow::Result<_>>()?;
    let sets: Vec<TrainingSet<'_>> =
        first.iter().map(|readings| TrainingSet { readings, sensor }).collect();
    let space = learn_space(&sets, config.seed)?;
    let map = |readings: &[Reading]| {
        let set = TrainingSet { readings, sensor };
        map_surface(&set, &space, &surface_config(), Some(DVec3::ZERO)).map(Arc::new)
    };
    let mut maps: Vec<Arc<SurfaceMap>> =
        first.iter().map(|readings| map(readings)).collect::<Result<_, _>>()?;
    drop(first);
    for index in maps.len()..objects.len() {
        maps.push(map(&train(index)?)?);
    }
    let test = (0..objects.len())
        .map(|index| touch(index, TEST_READINGS, 2 * config.seed + 1))
        .collect::<anyhow::Result<_>>()?;
    Ok((SurfaceModel { space, calibration: EvidenceCalibration::default(), maps }, test))
}

/// Plays sessions with a catalogue: on one thread for the time of one core, and the largest
/// again on two threads for its slowest answers.
fn measure(
    config: &HybridScale,
    model: SurfaceModel,
    test: &[Vec<Reading>],
    report: &mut Report,
    progress: Progress<'_>,
) -> anyhow::Result<Measured> {
    let count = model.maps.len();
    let hybrid = Recogniser::Hybrid { model: Arc::new(model), options: HybridOptions::default() };
    let mut sessions = Sessions {
        sensor: &config.sensor,
        test,
        symmetries: &vec![Symmetry::NONE; test.len()],
        seed: config.seed,
        readings: READINGS,
        threads: 1,
    };
    let played = sessions.play(&hybrid, count, SESSIONS, progress)?;
    let wall = mean(&played.wall_ms());
    let ms = played.cpu_ms.unwrap_or(wall);
    for readings in 1..=READINGS {
        let times: Vec<f64> = played.after(readings).map(|step| step.wall_ms).collect();
        report.row(vec![
            ("method", json!("hybrid, 300 touches")),
            ("objects", json!(count)),
            ("readings", json!(readings)),
            ("trials", json!(times.len())),
            ("accuracy", json!(played.accuracy(readings))),
            ("cpu_ms_mean", json!(played.cpu_ms)),
            ("wall_ms_mean", json!(mean(&times))),
            ("wall_ms_p99", json!(quantile(&times, 0.99))),
            ("bytes", json!(hybrid.bytes())),
        ]);
    }
    if count == COUNTS[COUNTS.len() - 1] {
        sessions.threads = 2;
        let shared = sessions.play(&hybrid, count, SESSIONS, progress)?;
        for readings in [2, 3, 4, READINGS] {
            let key = format!("accuracy_{count}_at_{readings}");
            report.summarise(&key, played.accuracy(readings));
        }
        report.summarise(&format!("p99_ms_{count}"), quantile(&shared.wall_ms(), 0.99));
        report.summarise(&format!("ms_per_touch_{count}"), ms);
        report.summarise(&format!("bytes_{count}"), hybrid.bytes() as f64);
    }
    Ok(Measured { count, accuracy: played.accuracy(READINGS), ms, bytes: hybrid.bytes() as f64 })
}

/// The slope of the line through points with the least squares.
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
            name: "hybrid, 300 touches an object".to_owned(),
            points: measured.iter().map(|m| ((m.count as f64).log10(), value(m))).collect(),
        }],
    };
    vec![
        panel("recognised after six readings", "share right", |m| m.accuracy),
        panel("time of a reading", "µs on one core (log10)", |m| (m.ms * 1e3).log10()),
        panel("memory", "kB of maps (log10)", |m| (m.bytes / 1e3).log10()),
    ]
}

/// The resident memory of this process, bytes; Linux only.
fn resident_bytes() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kilobytes: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kilobytes * 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_a_power_law_is_its_exponent() {
        let points: Vec<(f64, f64)> =
            COUNTS.map(|n| ((n as f64).ln(), (3.0 * (n as f64).powf(0.7)).ln())).to_vec();
        assert!((slope(&points) - 0.7).abs() < 1e-12);
    }

    #[test]
    fn this_process_is_in_memory() {
        let bytes = resident_bytes().unwrap();
        assert!((1e6..1e11).contains(&bytes), "{bytes}");
    }
}
