//! Skins: touches until an object is recognised, by sensors with ever less of an image.
//!
//! The catalogue is learnt from presses of the flat 6 × 6 array. It is then recognised by that
//! array, by curved fingertips of 24 and 12 taxels, by a single row of eight taxels and by a single
//! taxel (presses by the training sampler), and by contacts without an image: places drawn evenly
//! from the surface, with errors of position and normal that the contact states, as of a
//! force–torque sensor on a probe, and the same without normals, as of a bumper. Fingertips also
//! recognise by catalogues that were learnt from their own presses. Objects are the ten built-in
//! ones and, in the larger catalogue, those of `surface-scale`.

use std::sync::Arc;

use anyhow::Context as _;
use clap::Args;
use glam::DVec3;
use palpate_core::pose::Pose;
use palpate_core::reading::point_contact::{ContactNumbers, PointContact};
use palpate_core::reading::{Felt, Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::{SensorDescription, SensorParameters, TaxelGrid};
use palpate_core::units::MM;
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::model::SurfaceModel;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_sim::mesh::Mesh;
use palpate_sim::plot::{Line, Panel, svg};
use palpate_sim::shapes;
use rayon::prelude::*;
use serde::Serialize;

use crate::arguments::{TouchSet, count};
use crate::objects::{self, TestObject};
use crate::report::{Outcome, Progress, Report};
use crate::statistics::mean;
use crate::surface_scale;
use crate::trained::train_calibrated;

/// Maximum distance of an object from the session's origin along each axis, metres.
const REACH: f64 = 200.0 * MM;

/// Standard deviation of a contact's position, metres: an arm and a probe of 2 mm.
const POSITION: f64 = 1.0 * MM;

/// Standard deviation of a contact's normal, rad: a force–torque sensor under light load.
const NORMAL: f64 = 0.2;

/// Share of right sessions at which an object counts as recognised.
const RIGHT: f64 = 0.95;

/// Arguments of `skins`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct Skins {
    /// Sizes of catalogues; 10 is the built-in objects.
    #[arg(long = "objects", default_values_t = [10, 100], value_delimiter = ',', value_parser = count)]
    #[serde(rename = "objects")]
    pub counts: Vec<usize>,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Trials per object.
    #[arg(long, default_value_t = 5, value_parser = count)]
    pub trials: usize,
    /// The readings of each object.
    #[command(flatten)]
    #[serde(flatten)]
    pub touches: TouchSet,
    /// Touches per trial.
    #[arg(long, default_value_t = 30, value_parser = count)]
    pub readings: usize,
}

/// A sensor of the experiment.
#[derive(Clone, Debug)]
enum Skin {
    /// Taxels that press, recognised by the common catalogue.
    Array(Box<SensorDescription>),
    /// Taxels that press, recognised by a catalogue of their own.
    Own(Box<SensorDescription>),
    /// Contacts without an image, with or without normals.
    Contacts { normals: bool },
}

/// The skins with their keys.
fn skins(trained: &SensorDescription) -> anyhow::Result<Vec<(&'static str, Skin)>> {
    let like = |rows, cols| {
        let grid = TaxelGrid { rows, cols, ..*trained.grid() };
        let parameters = SensorParameters { grid, ..trained.parameters().clone() };
        Ok::<_, anyhow::Error>(Skin::Array(Box::new(SensorDescription::new(parameters)?)))
    };
    let preset = |name| {
        let found = SensorDescription::preset_named(name);
        Ok::<_, anyhow::Error>(Box::new(found.with_context(|| format!("no preset {name}"))?))
    };
    let (curved, icub) = (preset("fingertip-curved-24")?, preset("icub-fingertip-12")?);
    Ok(vec![
        ("flat_6x6", Skin::Array(Box::new(trained.clone()))),
        ("fingertip_24", Skin::Own(curved.clone())),
        ("fingertip_24_by_flat", Skin::Array(curved)),
        ("fingertip_12", Skin::Own(icub.clone())),
        ("fingertip_12_by_flat", Skin::Array(icub)),
        ("row_1x8", like(1, 8)?),
        ("taxel_1x1", like(1, 1)?),
        ("contacts", Skin::Contacts { normals: true }),
        ("positions", Skin::Contacts { normals: false }),
    ])
}

/// A catalogue and its objects.
struct Catalogue {
    objects: Arc<Vec<TestObject>>,
    model: Arc<SurfaceModel>,
}

/// Figures of all sessions of a skin after some number of touches.
#[derive(Serialize)]
struct Row {
    objects: usize,
    touches: usize,
    sessions: usize,
    accuracy: f64,
    unknown_mean: f64,
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When objects cannot be made, touched or learnt.
pub fn run(config: &Skins, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let (mut report, mut panels) = (Report::default(), Vec::new());
    for n in &config.counts {
        let catalogue = learn(config, *n, progress)?;
        let mut lines = Vec::new();
        for (key, skin) in skins(&config.touches.sensor)? {
            let own = match &skin {
                Skin::Own(sensor) => Some(learn_again(config, &catalogue, sensor, key, progress)?),
                Skin::Array(_) | Skin::Contacts { .. } => None,
            };
            let known = own.as_ref().unwrap_or(&catalogue);
            let played = play(config, known, &skin, key, progress)?;
            lines.push(add(&mut report, config, *n, key, &played));
        }
        let (x, y) = ("touches".to_owned(), "share right".to_owned());
        panels.push(Panel { title: format!("{n} objects"), x, y, lines });
    }
    Ok(Outcome { report, plot: svg(&panels), pictures: Vec::new() })
}

/// Learns `n` objects from presses of the trained sensor.
fn learn(config: &Skins, n: usize, progress: Progress<'_>) -> anyhow::Result<Catalogue> {
    let size = shapes::LARGEST_DIMENSION;
    let candidates = match n {
        0..=10 => objects::generated(&shapes::NAMES[..n], size)?,
        _ => surface_scale::own_objects(n, size)?,
    };
    let (mut kept, mut readings) = (Vec::new(), Vec::new());
    for object in candidates {
        if kept.len() == n {
            break;
        }
        progress("touching objects", kept.len(), n);
        let (sensor, seed) = (&config.touches.sensor, 2 * config.seed);
        // An object that cannot be touched often enough is replaced by the next one.
        if let Ok(touched) = objects::touch(&object, sensor, config.touches.train_readings, seed) {
            readings.push(touched);
            kept.push(object);
        }
    }
    anyhow::ensure!(kept.len() == n, "{} objects can be touched, expected {n}", kept.len());
    let (surface, symmetries) = (SurfaceConfig::default(), objects::symmetries(&kept));
    let sensor = &config.touches.sensor;
    let model = train_calibrated(&readings, &symmetries, sensor, &surface, config.seed)?;
    Ok(Catalogue { objects: Arc::new(kept), model })
}

/// Learns the objects of a catalogue from presses of another sensor.
fn learn_again(
    config: &Skins,
    known: &Catalogue,
    sensor: &SensorDescription,
    key: &str,
    progress: Progress<'_>,
) -> anyhow::Result<Catalogue> {
    let mut readings = Vec::new();
    for (index, object) in known.objects.iter().enumerate() {
        progress(&format!("touching objects with {key}"), index, known.objects.len());
        let n = config.touches.train_readings;
        readings.push(objects::touch(object, sensor, n, 2 * config.seed)?);
    }
    let symmetries = objects::symmetries(&known.objects);
    let surface = SurfaceConfig::default();
    let model = train_calibrated(&readings, &symmetries, sensor, &surface, config.seed)?;
    Ok(Catalogue { objects: Arc::clone(&known.objects), model })
}

/// What each session named after each touch, and its probability of "none of these".
type Played = Vec<Vec<(bool, f64)>>;

fn play(
    config: &Skins,
    catalogue: &Catalogue,
    skin: &Skin,
    key: &str,
    progress: Progress<'_>,
) -> anyhow::Result<Played> {
    let mut played = Vec::new();
    for (index, object) in catalogue.objects.iter().enumerate() {
        progress(key, index, catalogue.objects.len());
        let presses = match skin {
            Skin::Array(sensor) | Skin::Own(sensor) => {
                let (n, seed) = (config.touches.test_readings, 2 * config.seed + 1);
                // A sensor that this object escapes feels it in no session.
                objects::touch(object, sensor, n, seed).unwrap_or_default()
            }
            Skin::Contacts { .. } => Vec::new(),
        };
        let session = |trial: usize| {
            let at = (trial * catalogue.objects.len() + index) as u64;
            let mut stream = Stream::new(config.seed, Purpose::ObjectPose, at);
            let position = DVec3::from_array([0; 3].map(|_| stream.uniform(-REACH, REACH)));
            let pose = Pose::from_parts(stream.rotation(), position);
            let mut stream = Stream::new(config.seed, Purpose::ReadingChoice, at);
            let felt = felt(config, skin, &object.mesh, &presses, &pose, &mut stream)?;
            recognise(catalogue, skin, &felt, index)
        };
        let sessions: anyhow::Result<Vec<_>> =
            (0..config.trials).into_par_iter().map(session).collect();
        played.extend(sessions?);
    }
    Ok(played)
}

/// What a session feels of an object in a pose.
fn felt(
    config: &Skins,
    skin: &Skin,
    mesh: &Mesh,
    presses: &[Reading],
    pose: &Pose,
    stream: &mut Stream,
) -> anyhow::Result<Vec<Felt>> {
    match skin {
        Skin::Array(_) | Skin::Own(_) => {
            let mut rest: Vec<usize> = (0..presses.len()).collect();
            let n = config.readings.min(rest.len());
            let mut next = || rest.swap_remove(stream.index(rest.len()));
            Ok((0..n).map(|_| Felt::Press(presses[next()].moved_by(*pose))).collect())
        }
        Skin::Contacts { normals } => {
            let surface = Faces::of(mesh);
            let contact = |_| Ok(Felt::Contact(surface.contact(pose, *normals, stream)?));
            (0..config.readings).map(contact).collect()
        }
    }
}

/// The faces of a mesh with the sums of their areas.
struct Faces<'a> {
    mesh: &'a Mesh,
    sums: Vec<f64>,
}

impl<'a> Faces<'a> {
    fn of(mesh: &'a Mesh) -> Self {
        let mut sum = 0.0;
        let areas = (0..mesh.triangles().len()).map(|face| {
            let [a, b, c] = mesh.corners(face);
            sum += (b - a).cross(c - a).length();
            sum
        });
        Self { mesh, sums: areas.collect() }
    }

    /// A contact anywhere on the surface, with errors of the stated deviations.
    fn contact(
        &self,
        pose: &Pose,
        normals: bool,
        stream: &mut Stream,
    ) -> anyhow::Result<PointContact> {
        let wanted = stream.uniform(0.0, self.sums.last().copied().unwrap_or(0.0));
        let face = self.sums.partition_point(|sum| *sum < wanted).min(self.sums.len() - 1);
        let [a, b, c] = self.mesh.corners(face);
        let (mut u, mut v) = (stream.uniform(0.0, 1.0), stream.uniform(0.0, 1.0));
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let mut off = |deviation: f64| {
            deviation * DVec3::new(stream.normal(), stream.normal(), stream.normal())
        };
        let position = *pose * (a + u * (b - a) + v * (c - a)) + off(POSITION);
        let normal = pose.turn((b - a).cross(c - a).normalize_or(DVec3::Z)) + off(NORMAL);
        let normal = normal.normalize_or(DVec3::Z);
        let numbers = ContactNumbers {
            touched: true,
            position: position.to_array(),
            position_deviation: POSITION,
            normal: normals.then_some(normal.to_array()),
            normal_deviation: normals.then_some(NORMAL),
            force: None,
        };
        Ok(PointContact::new(SensorId(1), numbers)?)
    }
}

/// Whether the right object was named after each touch, and the probability of "none of these".
fn recognise(
    catalogue: &Catalogue,
    skin: &Skin,
    felt: &[Felt],
    object: usize,
) -> anyhow::Result<Vec<(bool, f64)>> {
    let options = SurfaceOptions::default();
    let mut belief = SurfaceBelief::new(Arc::clone(&catalogue.model), options, None)?;
    let mut steps = Vec::with_capacity(felt.len());
    for felt in felt {
        match (felt, skin) {
            (Felt::Press(reading), Skin::Array(sensor) | Skin::Own(sensor)) => {
                belief.add(reading, sensor);
            }
            (Felt::Contact(contact), _) => belief.add_contact(contact),
            (Felt::Press(_), Skin::Contacts { .. }) => unreachable!("contacts have no image"),
        }
        let answer = belief.answer(1);
        let named = answer.best_object().is_some_and(|named| named.0 as usize == object);
        steps.push((named, answer.unknown));
    }
    Ok(steps)
}

/// Adds the rows and figures of a skin; gives its line of the plot.
fn add(report: &mut Report, config: &Skins, objects: usize, key: &str, played: &Played) -> Line {
    let mut points = Vec::with_capacity(config.readings);
    for touches in 1..=config.readings {
        let at = |session: &Vec<(bool, f64)>| session.get(touches - 1).copied();
        let right = |session| at(session).map_or(0.0, |(right, _)| f64::from(u8::from(right)));
        let accuracy = mean(&played.iter().map(right).collect::<Vec<_>>());
        let unknown: Vec<f64> = played.iter().filter_map(|s| Some(at(s)?.1)).collect();
        let (sessions, unknown_mean) = (played.len(), mean(&unknown));
        let row = Row { objects, touches, sessions, accuracy, unknown_mean };
        report.labelled(&[("skin", key)], row);
        points.push((touches as f64, accuracy));
        if touches % 10 == 0 {
            report.summarise(&format!("accuracy_{objects}_at_{touches}_{key}"), accuracy);
        }
    }
    report.summarise(&format!("touches_to_95_{objects}_{key}"), touches_to(&points, RIGHT));
    Line { name: key.to_owned(), points }
}

/// The touches from which the share of right sessions stays at least `share`; not a number if it
/// does not.
fn touches_to(points: &[(f64, f64)], share: f64) -> f64 {
    let below = points.iter().rposition(|(_, right)| *right < share);
    let first = below.map_or(0, |last| last + 1);
    points.get(first).map_or(f64::NAN, |(touches, _)| *touches)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn touches_count_from_where_the_share_stays() {
        let points = |shares: [f64; 4]| [1.0, 2.0, 3.0, 4.0].into_iter().zip(shares).collect();
        let to = |shares| {
            let points: Vec<(f64, f64)> = points(shares);
            touches_to(&points, 0.95)
        };
        assert!((to([0.5, 0.96, 0.9, 0.97]) - 4.0).abs() < 1e-12);
        assert!((to([0.96, 0.96, 0.95, 1.0]) - 1.0).abs() < 1e-12);
        assert!(to([1.0, 1.0, 1.0, 0.9]).is_nan());
    }

    #[test]
    fn every_skin_gives_figures_of_every_catalogue() {
        let plain: Skins = defaults();
        let touches = TouchSet { train_readings: 150, test_readings: 12, ..plain.touches.clone() };
        let config = Skins { counts: vec![3], trials: 1, readings: 10, touches, ..plain };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let figures = &outcome.report.summary;
        let plain = ["flat_6x6", "row_1x8", "taxel_1x1", "contacts", "positions"];
        let curved =
            ["fingertip_24", "fingertip_12", "fingertip_24_by_flat", "fingertip_12_by_flat"];
        for key in plain.into_iter().chain(curved) {
            assert!(figures.contains_key(&format!("touches_to_95_3_{key}")), "{figures:?}");
            let accuracy = figures[&format!("accuracy_3_at_10_{key}")];
            assert!((0.0..=1.0).contains(&accuracy), "{key}: {accuracy}");
        }
        assert!(figures["accuracy_3_at_10_flat_6x6"] > 0.6, "{figures:?}");
        assert!(figures["accuracy_3_at_10_contacts"] > 0.3, "{figures:?}");
        assert!(figures["accuracy_3_at_10_fingertip_24"] > 0.6, "{figures:?}");
        assert_eq!(outcome.report.rows.len(), 9 * 10);
    }
}
