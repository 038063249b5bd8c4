//! Symmetry found from touches: which axes, of which order, and how long it takes.
//!
//! Objects and the solid letters I and O are touched by the training sampler; symmetry is
//! discovered from the touches' positions and normals, on one core. For comparison it is also
//! sought on as many points of the mesh itself, with 0.1 mm and 5° of noise: what a sensor
//! without extent would find. Expected are the symmetries that the objects were made with.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context as _;
use glam::DVec3;
use palpate_core::contact::{center_of_pressure, contact_points, normal_constraint};
use palpate_core::model::MapPatch;
use palpate_core::patch::touches;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::symmetry::{AxisOrder, Symmetry};
use palpate_core::units::{DEG, MM};
use palpate_sim::letters::Font;
use palpate_sim::mesh::Mesh;
use serde_json::json;

use crate::objects::{self, TestObject};
use crate::plot::{Line, Panel, svg};
use crate::report::{Outcome, Progress, Report};
use crate::statistics::median;

/// How thick the letters are, metres; their capitals are 25 mm high.
const LETTER_THICKNESS: f64 = 3.0 * MM;

/// The sizes of maps that are compared, besides the whole.
const FEWER: [usize; 2] = [200, 500];

/// What to run.
#[derive(Clone, Debug)]
pub struct SymmetryTrials {
    /// A folder of meshes; `None` for the built-in objects.
    pub meshes: Option<PathBuf>,
    /// Largest dimension of every object, metres.
    pub size: f64,
    /// The seed of the touches.
    pub seed: u64,
    /// Touches an object.
    pub touches: usize,
}

impl Default for SymmetryTrials {
    fn default() -> Self {
        Self { meshes: None, size: 80.0 * MM, seed: 1, touches: 1_000 }
    }
}

/// What is known of an object beforehand.
#[derive(Clone, Copy, PartialEq)]
enum Expected {
    /// It only looks like itself.
    Nothing,
    /// It has an axis of at least this order, continuous included.
    Axis(u8),
    /// Details near what touches resolve decide; it does not count.
    Unsettled,
}

/// The expectation for an object by its name. The built-in gear has 16 teeth, but 5 holes and
/// one key, which touches hardly enter; a chess piece may have 4 sides in some of its rings.
fn expected(name: &str, is_built_in: bool) -> Expected {
    match (name, is_built_in) {
        ("glass" | "wine_glass" | "tire" | "tyre", _) | ("gear", false) => Expected::Axis(8),
        ("letter I" | "letter O" | "screwdriver", _) | ("pliers", true) => Expected::Axis(2),
        ("dragon" | "hand" | "mug" | "hammer" | "chess_knight", _) => Expected::Nothing,
        _ => Expected::Unsettled,
    }
}

/// What was found on one map.
struct Found {
    symmetry: Symmetry,
    seconds: f64,
}

/// Runs the experiment.
///
/// # Errors
/// When objects cannot be loaded or touched.
pub fn run(
    config: &SymmetryTrials,
    command: String,
    progress: Progress<'_>,
) -> anyhow::Result<Outcome> {
    let one_core = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let sensor = SensorDescription::digitacts_6x6();
    let mut objects = objects::load(config.meshes.as_deref(), config.size)?;
    objects.extend(letters()?);
    let mut report = Report::new("symmetry", command, config.seed);
    let mut tally = Tally::default();
    for (done, object) in objects.iter().enumerate() {
        progress("objects", done, objects.len());
        let readings = objects::touch(object, &sensor, config.touches, config.seed)?;
        let touched: Vec<MapPatch> =
            readings.iter().filter_map(|reading| patch_of(reading, &sensor)).collect();
        let on_mesh = points_of(&object.mesh, touched.len(), config.seed);
        let discover = |patches: &[MapPatch]| {
            let started = Instant::now();
            let symmetry = one_core.install(|| Symmetry::of_patches(patches));
            Found { symmetry, seconds: started.elapsed().as_secs_f64() }
        };
        let fewer = FEWER.iter().filter(|n| **n < touched.len());
        let sizes: Vec<usize> = fewer.copied().chain([touched.len()]).collect();
        for n in &sizes {
            let found = discover(&touched[..*n]);
            report.row(row(&object.name, "touches", *n, &found));
            tally.times.push((*n as f64, found.seconds * 1e3));
            if *n == touched.len() {
                tally.count(expected(&object.name, config.meshes.is_none()), &found);
            }
        }
        report.row(row(&object.name, "mesh", on_mesh.len(), &discover(&on_mesh)));
    }
    tally.summarise(&mut report);
    let plot = svg(&[tally.panel()]);
    Ok(Outcome { report, plot, pictures: Vec::new() })
}

/// The letters I and O as solids.
fn letters() -> anyhow::Result<Vec<TestObject>> {
    let font = Font::built_in();
    let solid = |symbol: char| {
        let letter = font.letter(symbol).with_context(|| format!("no letter {symbol}"))?;
        let mesh = letter.solid(LETTER_THICKNESS);
        let mesh = mesh.translated(-mesh.centroid());
        Ok(TestObject { name: format!("letter {symbol}"), mesh })
    };
    ['I', 'O'].into_iter().map(solid).collect()
}

/// The patch of a reading as a map holds it, or `None` when it touched nothing.
fn patch_of(reading: &Reading, sensor: &SensorDescription) -> Option<MapPatch> {
    let object_from_sensor = reading.session_from_sensor();
    let image = reading.image();
    touches(reading, sensor).then(|| MapPatch {
        position: single(object_from_sensor * center_of_pressure(image, sensor)),
        normal: single(object_from_sensor.turn(DVec3::NEG_Z)),
        normal_confidence: normal_constraint(&contact_points(image, sensor)) as f32,
    })
}

/// `n` points spread evenly over a mesh, 0.1 mm and 5° from where they should be.
fn points_of(mesh: &Mesh, n: usize, seed: u64) -> Vec<MapPatch> {
    let mut stream = Stream::new(seed, Purpose::Sampling, u64::MAX);
    let areas: Vec<f64> = (0..mesh.triangles().len()).map(|triangle| mesh.area(triangle)).collect();
    let mut ends: Vec<f64> = areas.clone();
    for triangle in 1..ends.len() {
        ends[triangle] += ends[triangle - 1];
    }
    let total = ends.last().copied().unwrap_or(0.0);
    let point = |_| {
        let place = stream.uniform(0.0, total);
        let triangle = ends.partition_point(|end| *end <= place).min(ends.len() - 1);
        let [a, b, c] = mesh.corners(triangle);
        let (u, v) = (stream.uniform(0.0, 1.0).sqrt(), stream.uniform(0.0, 1.0));
        let bent = DVec3::new(stream.normal(), stream.normal(), stream.normal());
        let normal = (mesh.normal(triangle) + 5.0 * DEG * bent).normalize();
        let at = a * (1.0 - u) + b * (u * (1.0 - v)) + c * (u * v);
        MapPatch {
            position: single(at + normal * 0.1 * MM * stream.normal()),
            normal: single(normal),
            normal_confidence: 1.0,
        }
    };
    (0..n).map(point).collect()
}

fn single(v: DVec3) -> [f32; 3] {
    v.to_array().map(|value| value as f32)
}

fn row<'a>(
    object: &str,
    seen: &str,
    patches: usize,
    found: &Found,
) -> Vec<(&'a str, serde_json::Value)> {
    let axes = &found.symmetry.axes;
    let orders: Vec<String> = axes.iter().take(3).map(|axis| order_name(axis.order)).collect();
    let main = axes.first().map(|axis| axis.direction.to_array());
    vec![
        ("object", json!(object)),
        ("seen", json!(seen)),
        ("patches", json!(patches)),
        ("axes", json!(axes.len())),
        ("orders", json!(orders.join(" "))),
        ("main_axis_x", json!(main.map(|direction| direction[0]))),
        ("main_axis_y", json!(main.map(|direction| direction[1]))),
        ("main_axis_z", json!(main.map(|direction| direction[2]))),
        ("ms", json!(found.seconds * 1e3)),
    ]
}

fn order_name(order: AxisOrder) -> String {
    match order {
        AxisOrder::Finite(n) => n.to_string(),
        AxisOrder::Continuous => "continuous".to_owned(),
    }
}

/// What the summary is made of.
#[derive(Default)]
struct Tally {
    expected: usize,
    found: usize,
    false_axes: usize,
    /// Patches of a map and milliseconds.
    times: Vec<(f64, f64)>,
}

impl Tally {
    fn count(&mut self, expected: Expected, found: &Found) {
        let axes = &found.symmetry.axes;
        match expected {
            Expected::Unsettled => {}
            Expected::Nothing => self.false_axes += axes.len(),
            Expected::Axis(order) => {
                let reaches = |found: &AxisOrder| match found {
                    AxisOrder::Continuous => true,
                    AxisOrder::Finite(found) => *found >= order,
                };
                self.expected += 1;
                self.found += usize::from(axes.iter().any(|axis| reaches(&axis.order)));
            }
        }
    }

    fn summarise(&mut self, report: &mut Report) {
        let most = self.times.iter().map(|time| time.0).fold(0.0, f64::max);
        let whole: Vec<f64> =
            self.times.iter().filter(|time| time.0 > 0.9 * most).map(|time| time.1).collect();
        report.summarise("found_expected", self.found as f64 / self.expected.max(1) as f64);
        report.summarise("false_axes", self.false_axes as f64);
        report.summarise("ms_median", median(&whole));
        report.summarise("ms_max", whole.iter().copied().fold(0.0, f64::max));
        self.times.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    }

    fn panel(&self) -> Panel {
        let lines = [("median", 0.5), ("slowest", 1.0)].map(|(name, share)| {
            let mut points: Vec<(f64, f64)> = Vec::new();
            for n in FEWER.map(|n| n as f64).into_iter().chain([f64::INFINITY]) {
                let low = points.last().map_or(0.0, |point| point.0);
                let group: Vec<&(f64, f64)> =
                    self.times.iter().filter(|time| time.0 > low && time.0 <= n).collect();
                if let Some(last) = group.last() {
                    let times: Vec<f64> = group.iter().map(|time| time.1).collect();
                    points.push((last.0, crate::statistics::quantile(&times, share)));
                }
            }
            Line { name: name.to_owned(), points }
        });
        Panel {
            title: "symmetry, one core".to_owned(),
            x: "patches of the map".to_owned(),
            y: "time (ms)".to_owned(),
            lines: lines.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use palpate_sim::shapes;

    use super::*;

    #[test]
    fn a_small_run_tells_a_glass_from_a_hand() {
        let folder = std::env::temp_dir().join(format!("palpate-symmetry-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for name in ["wine_glass", "hand"] {
            let mesh = shapes::example(name).unwrap();
            std::fs::write(folder.join(format!("{name}.stl")), mesh.to_stl_bytes()).unwrap();
        }
        let config = SymmetryTrials {
            meshes: Some(folder.clone()),
            seed: 101,
            touches: 300,
            ..SymmetryTrials::default()
        };
        let outcome = run(&config, "test".to_owned(), &|_, _, _| ()).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        let summary = &outcome.report.summary;
        assert!((summary["found_expected"] - 1.0).abs() < 1e-12, "{summary:?}");
        assert!(summary["false_axes"].abs() < 1e-12, "{summary:?}");
        // Two sizes of map and the mesh, of two objects and two letters.
        assert_eq!(outcome.report.rows.len(), 3 * 4);
        assert!(outcome.plot.contains("polyline"));
    }
}
