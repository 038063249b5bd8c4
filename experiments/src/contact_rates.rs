//! Throughput of the simulated sensor on one core: presses and converged readings per second.
//!
//! One press is one image at one pose; one converged reading is a whole touch of the training
//! sampler, from approach to both controllers idle, with the attempts that failed.

use std::hint::black_box;
use std::ops::ControlFlow;
use std::time::Instant;

use clap::Args;
use palpate_core::pose::Pose;
use palpate_core::reading::SensorId;
use palpate_core::sensor::SensorDescription;
use palpate_sim::plot::{Line, Panel, svg};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SamplerConfig, sample};
use serde::Serialize;

use crate::arguments::{ObjectSet, count};
use crate::report::{Outcome, Progress, Report};
use crate::statistics::median;

/// Arguments of `contact-rates`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct ContactRates {
    /// The objects that are touched.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Touches per object.
    #[arg(long, default_value_t = 300, value_parser = count)]
    pub touches: usize,
}

/// Runs the experiment on a single thread.
///
/// # Errors
/// When objects cannot be loaded or touched.
pub fn run(config: &ContactRates, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| run_on_one_core(config, progress))
}

#[derive(Serialize)]
struct Rates {
    triangles: usize,
    presses_per_second: f64,
    converged_readings_per_second: f64,
}

fn run_on_one_core(config: &ContactRates, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let mut points: [Vec<(f64, f64)>; 2] = [Vec::new(), Vec::new()];
    let objects = config.objects.load()?;
    let n_objects = objects.len();
    for (done, object) in objects.into_iter().enumerate() {
        progress("touching objects", done, n_objects);
        let triangles = object.mesh.triangles().len();
        let simulator = PressSimulator::new(object.mesh, SensorDescription::digitacts_6x6());
        let sampler = SamplerConfig::for_simulator(&simulator);
        let started = Instant::now();
        let mut go_on = |_, _| ControlFlow::Continue(());
        let id = SensorId(0);
        let readings = sample(&simulator, id, config.touches, config.seed, &sampler, &mut go_on)?;
        let converged_readings_per_second = readings.len() as f64 / started.elapsed().as_secs_f64();

        let poses: Vec<Pose> = readings.iter().map(|r| r.session_from_sensor()).collect();
        let started = Instant::now();
        for pose in &poses {
            black_box(simulator.press(*pose));
        }
        let presses_per_second = poses.len() as f64 / started.elapsed().as_secs_f64();
        report.labelled(
            &[("object", &object.name)],
            Rates { triangles, presses_per_second, converged_readings_per_second },
        );
        points[0].push((triangles as f64, presses_per_second));
        points[1].push((triangles as f64, converged_readings_per_second));
    }
    for (key, points) in ["presses_per_second_median", "converged_readings_per_second_median"]
        .into_iter()
        .zip(&mut points)
    {
        report.summarise(key, median(&points.iter().map(|point| point.1).collect::<Vec<_>>()));
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    let [presses, readings] = points;
    let panel = Panel {
        title: "one core".to_owned(),
        x: "triangles of the object".to_owned(),
        y: "a second".to_owned(),
        lines: vec![
            Line { name: "presses".to_owned(), points: presses },
            Line { name: "converged readings".to_owned(), points: readings },
        ],
    };
    Ok(Outcome { report, plot: svg(&[panel]), pictures: Vec::new() })
}
