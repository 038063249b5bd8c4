//! `geometric` with solid maps: accuracy by the size of the box of poses.
//!
//! Not in the dissertation, which says that its techniques generalise to three dimensions. Every
//! box has its own trials: the object's pose is drawn uniformly from the box, and touches are
//! those of the training sampler with a seed that training never saw.

use std::sync::Arc;

use clap::Args;
use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::training::TrainingSet;
use palpate_core::units::{DEG, MM};
use palpate_dissertation::geometric::train::{GeometricConfig, map_geometry};
use palpate_dissertation::geometric::{
    AdaptiveOptions, GeometricBelief, GeometricFilter, GeometricOptions, PosePrior,
    PreparedGeometry,
};
use palpate_sim::plot::{Line, Panel, svg};
use rayon::prelude::*;
use serde::Serialize;

use crate::arguments::{ObjectSet, count};
use crate::objects;
use crate::report::{Outcome, Progress, Report};
use crate::statistics::median;

/// Half extents in millimetres and half angles in degrees of the boxes.
const BOXES: [[f64; 2]; 3] = [[5.0, 10.0], [10.0, 17.0], [14.0, 26.0]];

/// Arguments of `solid-geometry`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct SolidGeometry {
    /// The objects that are touched.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Trials per object and box.
    #[arg(long, default_value_t = 5, value_parser = count)]
    pub trials: usize,
    /// Training readings per object.
    #[arg(long, default_value_t = 400, value_parser = count)]
    pub train_readings: usize,
    /// Readings per trial.
    #[arg(long, default_value_t = 10, value_parser = count)]
    pub readings: usize,
    /// Boxes: half extent along each axis, metres, and half angle about each, radians.
    #[arg(skip = BOXES.map(|[place, turn]| [place * MM, turn * DEG]).to_vec())]
    #[serde(skip)]
    pub boxes: Vec<[f64; 2]>,
}

/// One trial at one number of readings.
struct Step {
    is_right: bool,
    /// Probability of the object that was named.
    stated: f64,
    /// Error of the best pose when the object is right: position (m) and angle (rad).
    error: Option<[f64; 2]>,
}

/// Runs the experiment; gives the report and its plot.
///
/// # Errors
/// When objects cannot be loaded or touched, or training fails.
pub fn run(config: &SolidGeometry, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let sensor = SensorDescription::digitacts_6x6();
    let objects = config.objects.load()?;
    let touch_all = |n: usize, seed: u64| -> anyhow::Result<Vec<Vec<Reading>>> {
        let touch = |object| objects::touch(object, &sensor, n, seed);
        objects.iter().map(touch).collect()
    };
    progress("touching objects", 0, 2);
    let train = touch_all(config.train_readings, 2 * config.seed)?;
    let test = touch_all(10 * config.readings, 2 * config.seed + 1)?;
    progress("training", 1, 2);
    let sets: Vec<TrainingSet<'_>> =
        train.iter().map(|readings| TrainingSet { readings, sensor: &sensor }).collect();
    let origins = vec![DVec3::ZERO; sets.len()];
    let model = map_geometry(&sets, &origins, &GeometricConfig::solid())?;
    let prepared = PreparedGeometry::new(Arc::new(model));
    let mut lines = Vec::new();
    for (done, [half, turn]) in config.boxes.iter().enumerate() {
        progress("trials", done, config.boxes.len());
        let trials: anyhow::Result<Vec<Vec<Step>>> = (0..config.trials * objects.len())
            .into_par_iter()
            .map(|trial| play(config, &prepared, &sensor, &test, [*half, *turn], trial))
            .collect();
        lines.push(summarise(&mut report, config, [*half, *turn], &trials?));
    }
    let panel = |title: &str, y: &str, at: usize| Panel {
        title: title.to_owned(),
        x: "readings".to_owned(),
        y: y.to_owned(),
        lines: lines
            .iter()
            .map(|(name, points)| Line { name: name.clone(), points: points[at].clone() })
            .collect(),
    };
    let panels = [panel("objects", "share right", 0), panel("position", "median error (mm)", 1)];
    Ok(Outcome { report, plot: svg(&panels), pictures: Vec::new() })
}

/// The true pose of an object in a trial, and the box of poses that the filter knows: `half` (m) to
/// each side along each axis, `turn` (rad) about each.
pub(crate) fn placed(seed: u64, [half, turn]: [f64; 2], trial: usize) -> (Pose, PosePrior) {
    let mut stream = Stream::new(seed, Purpose::ObjectPose, trial as u64);
    let middle = Pose::from_parts(stream.rotation(), 0.3 * stream.direction());
    let mut along = |reach: f64| stream.uniform(-reach, reach);
    let moved = DVec3::new(along(half), along(half), along(half));
    let turned = DQuat::from_scaled_axis(DVec3::new(along(turn), along(turn), along(turn)));
    let truth = Pose::from_parts(turned * middle.rotation, middle.translation + moved);
    let prior = PosePrior::Bounded {
        session_from_object: middle,
        half_extent: DVec3::splat(half),
        half_angle: turn,
    };
    (truth, prior)
}

/// One trial: the object lies somewhere in the box.
fn play(
    config: &SolidGeometry,
    prepared: &PreparedGeometry,
    sensor: &SensorDescription,
    test: &[Vec<Reading>],
    bounds: [f64; 2],
    trial: usize,
) -> anyhow::Result<Vec<Step>> {
    let object = trial % test.len();
    let (truth, pose) = placed(config.seed, bounds, trial);
    let filter = GeometricFilter::Adaptive(AdaptiveOptions::default());
    let mut belief =
        GeometricBelief::new(prepared, GeometricOptions { pose, filter, seed: 1 }, None)?;
    let mut choice = Stream::new(config.seed, Purpose::ReadingChoice, trial as u64);
    let mut steps = Vec::with_capacity(config.readings);
    for _ in 0..config.readings {
        let reading = &test[object][choice.index(test[object].len())];
        belief.add(&reading.moved_by(truth), sensor)?;
        let answer = belief.answer(1);
        let named = answer.best_object().map_or(usize::MAX, |object| object.0 as usize);
        let best = answer.modes.first().filter(|mode| mode.object.0 as usize == object);
        let error = best.map(|mode| {
            let found = &mode.session_from_object;
            [found.distance_to(&truth), found.angle_to(&truth)]
        });
        let stated = answer.probabilities.get(named).copied().unwrap_or(0.0);
        steps.push(Step { is_right: named == object, stated, error });
    }
    Ok(steps)
}

/// A plotted line's name with its points: share right, and error of position.
type Plotted = (String, [Vec<(f64, f64)>; 2]);

#[derive(Serialize)]
struct AfterReadings {
    half_extent_mm: f64,
    half_angle_deg: f64,
    readings: usize,
    accuracy: f64,
    stated: f64,
    position_error_mm_median: f64,
    angle_error_deg_median: f64,
}

fn summarise(
    report: &mut Report,
    config: &SolidGeometry,
    [half, turn]: [f64; 2],
    trials: &[Vec<Step>],
) -> Plotted {
    let name = format!("{:.0}_mm_{:.0}_deg", half / MM, turn / DEG);
    let mut points = [Vec::new(), Vec::new()];
    for n in 1..=config.readings {
        let steps = || trials.iter().map(|steps| &steps[n - 1]);
        let share = |is: &dyn Fn(&Step) -> f64| steps().map(is).sum::<f64>() / trials.len() as f64;
        let accuracy = share(&|step| f64::from(u8::from(step.is_right)));
        let stated = share(&|step| step.stated);
        let errors = |axis: usize, unit: f64| -> Vec<f64> {
            steps().filter_map(|step| step.error.map(|error| error[axis] / unit)).collect()
        };
        let (moved, turned) = (median(&errors(0, MM)), median(&errors(1, DEG)));
        report.row(AfterReadings {
            half_extent_mm: half / MM,
            half_angle_deg: turn / DEG,
            readings: n,
            accuracy,
            stated,
            position_error_mm_median: moved,
            angle_error_deg_median: turned,
        });
        points[0].push((n as f64, accuracy));
        points[1].push((n as f64, moved));
        if n == config.readings {
            let mut state =
                |key: &str, value: f64| report.summarise(&format!("{name}_{key}"), value);
            state(&format!("accuracy_at_{n}"), accuracy);
            state(&format!("stated_at_{n}"), stated);
            state(&format!("position_error_mm_median_at_{n}"), moved);
            state(&format!("angle_error_deg_median_at_{n}"), turned);
        }
    }
    (name, points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn a_small_box_is_resolved() {
        let config = SolidGeometry {
            seed: 101,
            trials: 1,
            train_readings: 200,
            readings: 6,
            boxes: vec![[5.0 * MM, 10.0 * DEG]],
            ..defaults()
        };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        assert!(summary["5_mm_10_deg_accuracy_at_6"] >= 0.7, "{summary:?}");
        assert!(summary["5_mm_10_deg_position_error_mm_median_at_6"] < 5.0, "{summary:?}");
        assert_eq!(outcome.plot.matches("polyline").count(), 2);
    }
}
