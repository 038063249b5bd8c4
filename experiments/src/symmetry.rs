//! Symmetries from touches alone and from the mesh: true and false axes, seed by seed.
//!
//! Ten solids and the same ten with a handle or a notch (`bodies`) are touched by the training
//! sampler. Symmetry is discovered from the first touches of each seed, as in a training by a
//! robot without the mesh; rows `mesh` hold the decisions of a training with the mesh. The truth
//! is the symmetry by construction. An axis is false unless every rotation about it that it
//! claims is a symmetry; a finer order than the truth is false, too.

mod bodies;

use std::time::Instant;

use clap::Args;
use glam::DVec3;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::symmetry::{AxisOrder, Finding, Symmetry, SymmetryAxis};
use palpate_core::training::TrainingSet;
use palpate_core::units::DEG;
use palpate_recogniser::train::find_symmetry;
use palpate_sim::plot::{Line, Panel, svg};
use palpate_sim::symmetry::of_mesh;
use serde::Serialize;

use crate::arguments::{ObjectSet, count};
use crate::objects::{self, TestObject};
use crate::report::{Outcome, Progress, Report};
use crate::statistics::median;
use bodies::{Body, bodies};

/// Tolerance within which two axes are the same, rad; touches determine them to about a degree.
const SAME_AXIS: f64 = 5.0 * DEG;

/// Number of touches from which true symmetries are expected to be found.
const EXPECTED_FROM: usize = 300;

/// Arguments of `symmetry`. Without a set of objects it takes twenty solids of known symmetry.
#[derive(Args, Clone, Debug, Serialize)]
pub struct SymmetryTrials {
    /// The objects that are touched.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// Seed of the solids and of the first touches; the others follow.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Number of seeds of touches.
    #[arg(long, default_value_t = 6)]
    pub seeds: u64,
    /// Touches of each map, ascending.
    #[arg(long, default_values_t = [100, 150, 300, 1_000], value_delimiter = ',', value_parser = count)]
    pub touches: Vec<usize>,
}

/// Result on one map.
struct Trial {
    object: usize,
    touches: usize,
    /// `None` if the symmetry is undetermined.
    orders: Option<Vec<AxisOrder>>,
    n_false: usize,
    is_whole: bool,
    ms: f64,
}

/// Runs the experiment.
///
/// # Errors
/// When objects cannot be loaded or touched.
pub fn run(config: &SymmetryTrials, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let one_core = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let sensor = SensorDescription::digitacts_6x6();
    let bodies = load(config)?;
    let mut report = Report::default();
    let (mut trials, mut n_exact) = (Vec::new(), 0);
    let most = config.touches.iter().copied().max().unwrap_or(0);
    for (object, body) in bodies.iter().enumerate() {
        let begun = Instant::now();
        let truth = of_mesh(&body.object.mesh);
        let by_mesh = Trial::new(object, 0, &Finding::Settled(truth.clone()), &truth, begun);
        n_exact += usize::from(by_mesh.orders.as_ref() == Some(&body.orders));
        report_trial(&mut report, &body.object, "mesh", None, &by_mesh);
        for index in 0..config.seeds {
            progress("objects", trials.len(), bodies.len() * config.seeds as usize * 4);
            let seed = config.seed.wrapping_mul(1_000).wrapping_add(index);
            let readings = objects::touch(&body.object, &sensor, most, seed)?;
            for n in &config.touches {
                let begun = Instant::now();
                let found = one_core.install(|| find(&readings[..*n], &sensor));
                let trial = Trial::new(object, *n, &found, &truth, begun);
                report_trial(&mut report, &body.object, "touches", Some(seed), &trial);
                trials.push(trial);
            }
        }
    }
    report.summarise("mesh_exact", n_exact as f64 / bodies.len() as f64);
    summarise(&mut report, config, &bodies, &trials);
    let plot = svg(&[panel(config, &bodies, &trials)]);
    Ok(Outcome { report, plot, pictures: Vec::new() })
}

fn load(config: &SymmetryTrials) -> anyhow::Result<Vec<Body>> {
    if !config.objects.is_named() {
        return bodies(config.seed);
    }
    let objects = config.objects.load()?;
    let known = |object: TestObject| {
        let orders = of_mesh(&object.mesh).axes.iter().map(|axis| axis.order).collect();
        Body { object, orders }
    };
    Ok(objects.into_iter().map(known).collect())
}

fn find(readings: &[Reading], sensor: &SensorDescription) -> Finding {
    find_symmetry(&TrainingSet { readings, sensor }, DVec3::ZERO)
}

impl Trial {
    fn new(
        object: usize,
        touches: usize,
        found: &Finding,
        truth: &Symmetry,
        begun: Instant,
    ) -> Self {
        let ms = begun.elapsed().as_secs_f64() * 1e3;
        let Finding::Settled(found) = found else {
            return Self { object, touches, orders: None, n_false: 0, is_whole: false, ms };
        };
        let n_false = found.axes.iter().filter(|axis| !is_true(axis, truth)).count();
        let orders: Vec<AxisOrder> = found.axes.iter().map(|axis| axis.order).collect();
        let same = orders.iter().eq(truth.axes.iter().map(|axis| &axis.order));
        Self { object, touches, orders: Some(orders), n_false, is_whole: same && n_false == 0, ms }
    }
}

/// Whether the truth has every turn of an axis that was found, and no finer ones about a round
/// axis were taken for it.
fn is_true(found: &SymmetryAxis, truth: &Symmetry) -> bool {
    let round: Vec<&SymmetryAxis> =
        truth.axes.iter().filter(|axis| axis.order == AxisOrder::Continuous).collect();
    if round.len() > 1 {
        return found.order == AxisOrder::Continuous;
    }
    let sine = |axis: &SymmetryAxis| axis.direction.cross(found.direction).length();
    let same = |axis: &&SymmetryAxis| sine(axis) < SAME_AXIS.sin();
    match (round.first(), found.order) {
        (Some(axis), AxisOrder::Continuous) => same(axis),
        (Some(axis), AxisOrder::Finite(order)) => {
            let across = axis.direction.dot(found.direction).abs() < SAME_AXIS.sin();
            order == 2 && across && truth.axes.len() > 1
        }
        (None, AxisOrder::Continuous) => false,
        (None, AxisOrder::Finite(order)) => truth.axes.iter().filter(same).any(
            |axis| matches!(axis.order, AxisOrder::Finite(known) if known.is_multiple_of(order)),
        ),
    }
}

#[derive(Serialize)]
struct Found {
    seed: Option<u64>,
    touches: usize,
    false_axes: usize,
    whole: bool,
    ms: f64,
}

fn report_trial(
    report: &mut Report,
    object: &TestObject,
    seen: &str,
    seed: Option<u64>,
    trial: &Trial,
) {
    let orders = trial.orders.as_ref().map(|orders| {
        let names: Vec<String> = orders.iter().map(|order| order_name(*order)).collect();
        names.join(" ")
    });
    let orders = orders.unwrap_or_else(|| "undetermined".to_owned());
    let Trial { touches, n_false: false_axes, is_whole: whole, ms, .. } = *trial;
    report.labelled(
        &[("object", &object.name), ("seen", seen), ("orders", &orders)],
        Found { seed, touches, false_axes, whole, ms },
    );
}

fn order_name(order: AxisOrder) -> String {
    match order {
        AxisOrder::Finite(n) => n.to_string(),
        AxisOrder::Continuous => "round".to_owned(),
    }
}

fn share<'a>(trials: impl Iterator<Item = &'a Trial>, of: impl Fn(&Trial) -> bool) -> f64 {
    let (mut n, mut n_of) = (0.0, 0.0);
    for trial in trials {
        n += 1.0;
        n_of += f64::from(u8::from(of(trial)));
    }
    n_of / f64::max(n, 1.0)
}

fn summarise(report: &mut Report, config: &SymmetryTrials, bodies: &[Body], trials: &[Trial]) {
    let n_false: usize = trials.iter().map(|trial| trial.n_false).sum();
    report.summarise("false_axes", n_false as f64);
    let is_symmetric = |trial: &&Trial| !bodies[trial.object].orders.is_empty();
    let many = trials.iter().filter(|trial| trial.touches >= EXPECTED_FROM);
    report.summarise("found_expected", share(many.filter(is_symmetric), |trial| trial.is_whole));
    let most = config.touches.iter().copied().max().unwrap_or(0);
    let agree = |object: usize| {
        let mut of = trials.iter().filter(|t| t.object == object && t.touches == most);
        let first = of.next().map(|trial| &trial.orders);
        of.all(|trial| Some(&trial.orders) == first)
    };
    let n_agree = (0..bodies.len()).filter(|object| agree(*object)).count();
    report.summarise("seeds_agree", n_agree as f64 / bodies.len() as f64);
    for n in &config.touches {
        let of_size = || trials.iter().filter(|trial| trial.touches == *n);
        report.summarise(&format!("undetermined_{n}"), share(of_size(), |t| t.orders.is_none()));
        let found = share(of_size().filter(is_symmetric), |trial| trial.is_whole);
        report.summarise(&format!("found_{n}"), found);
    }
    let times: Vec<f64> = trials.iter().filter(|t| t.touches == most).map(|t| t.ms).collect();
    report.summarise("ms_median", median(&times));
    report.summarise("ms_max", times.iter().copied().fold(0.0, f64::max));
}

fn panel(config: &SymmetryTrials, bodies: &[Body], trials: &[Trial]) -> Panel {
    let line = |name: &str, symmetric: bool, of: &dyn Fn(&Trial) -> bool| {
        let at = |n: &usize| {
            let group = trials.iter().filter(|trial| {
                trial.touches == *n && bodies[trial.object].orders.is_empty() != symmetric
            });
            (*n as f64, share(group, of))
        };
        Line { name: name.to_owned(), points: config.touches.iter().map(at).collect() }
    };
    Panel {
        title: "symmetry from touches alone".to_owned(),
        x: "touches".to_owned(),
        y: "share of trainings".to_owned(),
        lines: vec![
            line("symmetric: found", true, &|trial| trial.is_whole),
            line("symmetric: undetermined", true, &|trial| trial.orders.is_none()),
            line("handle or notch: undetermined", false, &|trial| trial.orders.is_none()),
            line("handle or notch: false", false, &|trial| trial.n_false > 0),
        ],
    }
}

#[cfg(test)]
mod tests {
    use palpate_sim::shapes;

    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn a_small_run_is_exact_by_the_mesh_and_claims_nothing_false() {
        let folder = std::env::temp_dir().join(format!("palpate-symmetry-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for name in ["wine_glass", "hand"] {
            let mesh = shapes::example(name).unwrap();
            std::fs::write(folder.join(format!("{name}.stl")), mesh.to_stl_bytes()).unwrap();
        }
        let config = SymmetryTrials {
            objects: ObjectSet { meshes: Some(folder.clone()), ..defaults() },
            seed: 101,
            seeds: 1,
            touches: vec![60, 1_000],
        };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        let summary = &outcome.report.summary;
        for (key, expected) in [
            ("false_axes", 0.0),
            ("seeds_agree", 1.0),
            ("mesh_exact", 1.0),
            ("undetermined_60", 1.0),
        ] {
            assert!((summary[key] - expected).abs() < 1e-12, "{key}: {summary:?}");
        }
        // The mesh and two sizes of map, of two objects.
        assert_eq!(outcome.report.rows.len(), 3 * 2);
        assert!(outcome.plot.contains("polyline"));
    }

    #[test]
    fn an_axis_is_true_when_the_object_has_all_its_turns() {
        use AxisOrder::{Continuous, Finite};
        let through = |axes: &[(DVec3, AxisOrder)]| Symmetry::through(DVec3::ZERO, axes);
        let can = through(&[(DVec3::Z, Continuous), (DVec3::X, Finite(2))]);
        let nut = through(&[(DVec3::Z, Finite(6))]);
        let ball = through(&DVec3::AXES.map(|axis| (axis, Continuous)));
        for (truth, direction, order, expected) in [
            (&can, DVec3::Z, Continuous, true),
            (&can, DVec3::Y, Finite(2), true),
            (&can, DVec3::Z, Finite(28), false),
            (&can, DVec3::X, Continuous, false),
            (&nut, DVec3::Z, Finite(3), true),
            (&nut, DVec3::Z, Finite(6), true),
            (&nut, DVec3::Z, Finite(4), false),
            (&nut, DVec3::X, Finite(2), false),
            (&nut, DVec3::Z, Continuous, false),
            (&ball, DVec3::ONE.normalize(), Continuous, true),
            (&ball, DVec3::Z, Finite(28), false),
            (&Symmetry::NONE, DVec3::Z, Finite(2), false),
        ] {
            let axis = SymmetryAxis { point: DVec3::ZERO, direction, order };
            assert_eq!(is_true(&axis, truth), expected, "{direction} {order:?} of {truth:?}");
        }
    }
}
