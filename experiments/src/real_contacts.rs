//! Points felt by a real hand, against meshes: recognition from positions alone.
//!
//! Data: contact points of an iCub (robotology/visual-tactile-localization), `meas*.off`, and the
//! meshes of its objects, not part of this project. The hand's kinematics are off by about a
//! centimetre. A session is some of the points in random order, sent as contacts without normals
//! that state a deviation; the catalogue holds all meshes of the folder. The pose is not known, so
//! what is stated is the distance of the points from the mesh in the pose found, and how far the
//! poses of different sessions are apart.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, ensure};
use clap::Args;
use glam::DVec3;
use palpate_core::belief::answer::PoseMode;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::SensorId;
use palpate_core::reading::point_contact::{ContactNumbers, PointContact};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::units::{DEG, MM};
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::model::SurfaceModel;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_sim::mesh::{Mesh, MeshFormat};
use palpate_sim::plot::{Line, Panel, svg};
use palpate_sim::press::PressSimulator;
use rayon::prelude::*;
use serde::Serialize;

use crate::arguments::{TouchSet, count};
use crate::objects::{self, TestObject};
use crate::report::{Outcome, Progress, Report};
use crate::statistics::{mean, median};
use crate::trained::train_calibrated;

/// Files of points, and the mesh of the object that was touched.
const FELT: [(&str, &str); 6] = [
    ("measRobot_exp", "robot"),
    ("measCleaner_exp", "spray"),
    ("measCylinder_exp", "cylinder"),
    ("measRobot_sim", "robot"),
    ("measClenear_sim", "spray"),
    ("measHelmet_sim", "helmet"),
];

/// Numbers of contacts whose figures are stated.
const STATED_AT: [usize; 4] = [5, 10, 20, 30];

/// Arguments of `real-contacts`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct RealContacts {
    /// The folder of meshes and points.
    #[arg(long, value_name = "DIR")]
    pub data: PathBuf,
    /// Seed of training and of the orders of points.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Sessions with each file of points.
    #[arg(long, default_value_t = 20, value_parser = count)]
    pub trials: usize,
    /// Stated standard deviations of a position, millimetres.
    #[arg(long, value_delimiter = ',', default_value = "3,10")]
    pub deviation_mm: Vec<f64>,
    /// The readings of each object.
    #[command(flatten)]
    #[serde(flatten)]
    pub touches: TouchSet,
}

/// Meshes of the folder, with what was learnt from them.
struct Catalogue {
    objects: Vec<TestObject>,
    simulators: Vec<PressSimulator>,
    model: Arc<SurfaceModel>,
}

/// The answer of a session after some number of contacts.
struct Step {
    /// Place of the touched object among all, by probability; 1 is first.
    rank: usize,
    probability: f64,
    unknown: f64,
    /// Median distance of the contacts from the touched object in its likeliest pose, metres.
    residual: Option<f64>,
    pose: Option<Pose>,
}

/// Figures of all sessions with one file and one stated deviation.
#[derive(Serialize)]
struct Row {
    deviation_mm: f64,
    contacts: usize,
    sessions: usize,
    accuracy: f64,
    rank_mean: f64,
    probability_mean: f64,
    unknown_mean: f64,
    residual_mm_median: f64,
    pose_spread_mm_median: f64,
    pose_spread_deg_median: f64,
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When files cannot be read, or meshes not be touched or learnt.
pub fn run(config: &RealContacts, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let catalogue = learn(config, progress)?;
    let (mut report, mut lines) = (Report::default(), Vec::new());
    for (done, (file, object)) in FELT.into_iter().enumerate() {
        progress("sessions", done, FELT.len());
        let points = points(&config.data.join(format!("{file}.off")))?;
        let touched = catalogue.objects.iter().position(|known| known.name == object);
        let touched = touched.with_context(|| format!("there is no mesh {object}.off"))?;
        for deviation_mm in &config.deviation_mm {
            let session = |trial| play(config, &catalogue, &points, touched, *deviation_mm, trial);
            let sessions: Vec<Vec<Step>> =
                (0..config.trials).into_par_iter().map(session).collect::<anyhow::Result<_>>()?;
            let mut line = Vec::new();
            for contacts in STATED_AT.into_iter().filter(|n| *n <= points.len()) {
                let row = row(&sessions, contacts, *deviation_mm);
                line.push((contacts as f64, row.rank_mean));
                let key = format!("{file}_at_{contacts}_with_{deviation_mm}_mm");
                report.summarise(&format!("rank_{key}"), row.rank_mean);
                report.summarise(&format!("residual_mm_{key}"), row.residual_mm_median);
                report.labelled(&[("points", file), ("object", object)], row);
            }
            lines.push(Line { name: format!("{file}, {deviation_mm} mm"), points: line });
        }
    }
    let title = format!("rank of the right object among {}", catalogue.objects.len());
    let (x, y) = ("contacts".to_owned(), "mean rank".to_owned());
    Ok(Outcome { report, plot: svg(&[Panel { title, x, y, lines }]), pictures: Vec::new() })
}

/// Learns all meshes of the folder, in metres.
fn learn(config: &RealContacts, progress: Progress<'_>) -> anyhow::Result<Catalogue> {
    let sensor: &SensorDescription = &config.touches.sensor;
    let mut names: Vec<String> = std::fs::read_dir(&config.data)
        .with_context(|| format!("cannot read {}", config.data.display()))?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "off"))
        .filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned()))
        .filter(|name| !name.starts_with("meas"))
        .collect();
    names.sort();
    ensure!(!names.is_empty(), "{} holds no meshes, expected .off", config.data.display());
    let (mut objects, mut readings) = (Vec::new(), Vec::new());
    for (done, name) in names.iter().enumerate() {
        progress("touching meshes", done, names.len());
        let bytes = std::fs::read(config.data.join(format!("{name}.off")))?;
        let mesh = Mesh::from_bytes(MeshFormat::Off, &bytes, 1.0)
            .with_context(|| format!("{name}.off is not a usable mesh"))?;
        let mesh = mesh.translated(-mesh.centroid());
        let object = TestObject { name: name.clone(), mesh };
        let (n, seed) = (config.touches.train_readings, 2 * config.seed);
        readings.push(objects::touch(&object, sensor, n, seed)?);
        objects.push(object);
    }
    let symmetries = objects::symmetries(&objects);
    let surface = SurfaceConfig::default();
    let model = train_calibrated(&readings, &symmetries, sensor, &surface, config.seed)?;
    let simulator = |object: &TestObject| PressSimulator::new(object.mesh.clone(), sensor.clone());
    let simulators = objects.iter().map(simulator).collect();
    Ok(Catalogue { objects, simulators, model })
}

/// The vertices of an OFF file without faces, metres.
fn points(path: &Path) -> anyhow::Result<Vec<DVec3>> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut words = text.split_whitespace();
    ensure!(words.next() == Some("OFF"), "{} does not begin with OFF", path.display());
    let numbers: Vec<f64> = words
        .map(|word| word.parse().with_context(|| format!("{word:?} in {}", path.display())))
        .collect::<anyhow::Result<_>>()?;
    let (counts, coordinates) = numbers.split_at_checked(3).context("no counts after OFF")?;
    let points: Vec<DVec3> =
        coordinates.chunks_exact(3).map(|p| DVec3::new(p[0], p[1], p[2])).collect();
    ensure!(points.len() == counts[0] as usize, "{} ends early", path.display());
    Ok(points)
}

/// A session of points in random order.
fn play(
    config: &RealContacts,
    catalogue: &Catalogue,
    points: &[DVec3],
    touched: usize,
    deviation_mm: f64,
    trial: usize,
) -> anyhow::Result<Vec<Step>> {
    let mut stream = Stream::new(config.seed, Purpose::ReadingChoice, trial as u64);
    let options = SurfaceOptions::default();
    let mut belief = SurfaceBelief::new(Arc::clone(&catalogue.model), options, None)?;
    let (mut rest, mut felt, mut steps) = (points.to_vec(), Vec::new(), Vec::new());
    let most = STATED_AT[STATED_AT.len() - 1];
    while !rest.is_empty() && felt.len() < most {
        let point = rest.swap_remove(stream.index(rest.len()));
        felt.push(point);
        belief.add_contact(&contact(point, deviation_mm * MM)?);
        steps.push(step(catalogue, &belief, &felt, touched));
    }
    Ok(steps)
}

/// A contact without a normal.
fn contact(position: DVec3, deviation: f64) -> anyhow::Result<PointContact> {
    let numbers = ContactNumbers {
        touched: true,
        position: position.to_array(),
        position_deviation: deviation,
        normal: None,
        normal_deviation: None,
        force: None,
    };
    Ok(PointContact::new(SensorId(1), numbers)?)
}

fn step(catalogue: &Catalogue, belief: &SurfaceBelief, felt: &[DVec3], touched: usize) -> Step {
    let answer = belief.answer(32);
    let probability = answer.probabilities[touched];
    let is_of = |mode: &&PoseMode| mode.object == ObjectIdx(touched as u32);
    let pose = answer.modes.iter().find(is_of).map(|mode| mode.session_from_object);
    let residual = pose.map(|pose| {
        let object_from_session = pose.inverse();
        let distance = |point: &DVec3| {
            let point = object_from_session * *point;
            let (nearest, _) = catalogue.simulators[touched].nearest(point);
            nearest.distance(point)
        };
        median(&felt.iter().map(distance).collect::<Vec<f64>>())
    });
    let rank = 1 + answer.probabilities.iter().filter(|other| **other > probability).count();
    Step { rank, probability, unknown: answer.unknown, residual, pose }
}

fn row(sessions: &[Vec<Step>], contacts: usize, deviation_mm: f64) -> Row {
    let steps: Vec<&Step> = sessions.iter().filter_map(|steps| steps.get(contacts - 1)).collect();
    let mean_of = |value: &dyn Fn(&Step) -> f64| {
        mean(&steps.iter().map(|step| value(step)).collect::<Vec<f64>>())
    };
    let poses: Vec<Pose> = steps.iter().filter_map(|step| step.pose).collect();
    let pairs: Vec<(Pose, Pose)> = poses
        .iter()
        .enumerate()
        .flat_map(|(n, one)| poses[n + 1..].iter().map(move |other| (*one, *other)))
        .collect();
    let shifts: Vec<f64> = pairs.iter().map(|(a, b)| a.distance_to(b) / MM).collect();
    let turns: Vec<f64> = pairs.iter().map(|(a, b)| a.angle_to(b) / DEG).collect();
    let residuals: Vec<f64> = steps.iter().filter_map(|step| Some(step.residual? / MM)).collect();
    Row {
        deviation_mm,
        contacts,
        sessions: steps.len(),
        accuracy: mean_of(&|step| f64::from(u8::from(step.rank == 1))),
        rank_mean: mean_of(&|step| step.rank as f64),
        probability_mean: mean_of(&|step| step.probability),
        unknown_mean: mean_of(&|step| step.unknown),
        residual_mm_median: median(&residuals),
        pose_spread_mm_median: median(&shifts),
        pose_spread_deg_median: median(&turns),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;
    use palpate_sim::shapes;

    /// A folder with meshes and points of the built-in objects under the names of the data.
    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let names = ["robot", "spray", "cylinder", "helmet"];
        let meshes: Vec<Mesh> = ["hammer", "mug", "pliers", "hand"]
            .map(|shape| shapes::example(shape).unwrap())
            .to_vec();
        for (name, mesh) in names.iter().zip(&meshes) {
            std::fs::write(folder.path().join(format!("{name}.off")), off(mesh)).unwrap();
        }
        for (file, object) in FELT {
            let mesh = &meshes[names.iter().position(|name| *name == object).unwrap()];
            let mut stream = Stream::new(7, Purpose::Sampling, 0);
            let felt: String = (0..40)
                .map(|_| {
                    let [a, b, c] = mesh.corners(stream.index(mesh.triangles().len()));
                    let at = (a + b + c) / 3.0 + DVec3::splat(0.3);
                    format!("{} {} {}\n", at.x, at.y, at.z)
                })
                .collect();
            let path = folder.path().join(format!("{file}.off"));
            std::fs::write(path, format!("OFF\n40 0 0\n\n{felt}")).unwrap();
        }
        folder
    }

    fn off(mesh: &Mesh) -> String {
        let n = mesh.triangles().len();
        let corners = (0..n).flat_map(|face| mesh.corners(face));
        let points: String = corners.map(|p| format!("{} {} {}\n", p.x, p.y, p.z)).collect();
        let faces: String = (0..n)
            .map(|face| format!("3 {} {} {}\n", 3 * face, 3 * face + 1, 3 * face + 2))
            .collect();
        format!("OFF\n{} {n} 0\n{points}{faces}", 3 * n)
    }

    #[test]
    fn exact_points_of_an_object_rank_it_first() {
        let folder = folder();
        let config = RealContacts {
            data: folder.path().to_owned(),
            seed: 1,
            trials: 2,
            deviation_mm: vec![1.0],
            touches: TouchSet { train_readings: 300, ..defaults() },
        };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        let mean_rank: f64 = FELT
            .iter()
            .map(|(file, _)| summary[&format!("rank_{file}_at_30_with_1_mm")] / 6.0)
            .sum();
        assert!(mean_rank < 1.6, "{summary:?}");
        assert!(summary["residual_mm_measRobot_exp_at_30_with_1_mm"] < 2.0, "{summary:?}");
    }

    #[test]
    fn files_that_end_early_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("short.off");
        std::fs::write(&path, "OFF\n2 0 0\n0 0 1\n").unwrap();
        assert!(points(&path).err().unwrap().to_string().contains("ends early"));
    }
}
