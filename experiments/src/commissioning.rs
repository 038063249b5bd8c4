//! Mistakes of a set-up, found by touches of a known object.
//!
//! Every draw touches one object with a sensor of the family of a data sheet, so that the world is
//! not the description, and sends the touches with none, one or two mistakes. The object's pose
//! is stated in every other draw.

use std::ops::ControlFlow;

use anyhow::Context as _;
use clap::Args;
use palpate_commissioning::commission::{Findings, Setup, commission};
use palpate_commissioning::estimate::Verdict;
use palpate_commissioning::mistakes::{Kind, Mistake};
use palpate_core::pose::Pose;
use palpate_core::reading::SensorId;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::{SensorDescription, SensorFamily, SensorKnowledge};
use palpate_core::stop::Stop;
use palpate_core::units::{DEG, MM};
use palpate_sim::plot::svg;
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SamplerConfig, sample};
use rayon::prelude::*;
use serde::Serialize;

use crate::arguments::{ObjectSet, count};
use crate::objects::TestObject;
use crate::report::{Outcome, Progress, Report};
use crate::statistics::median;

/// Every fifth draw has no mistake.
const RIGHT_EVERY: usize = 5;

/// Arguments of `commissioning`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct CommissioningTrials {
    /// The objects to touch.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectSet,
    /// Seed of everything random.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Draws of mistakes.
    #[arg(long, default_value_t = 200, value_parser = count)]
    pub draws: usize,
    /// Touches of the object in each draw.
    #[arg(long, default_value_t = 20, value_parser = count)]
    pub touches: usize,
}

/// One draw with what was found.
struct Draw {
    object: String,
    is_placed: bool,
    mistake: Mistake,
    findings: Findings,
}

/// The row of a draw.
#[derive(Serialize)]
struct Row {
    draw: usize,
    is_placed: bool,
    found: bool,
    offset_error_mm: f64,
    turn_error_deg: f64,
    offset_deviation_mm: f64,
    residual_before: f64,
    residual_after: f64,
    looseness_mm: f64,
    order_probability: f64,
}

/// Runs the experiment; gives the report and an empty plot.
///
/// # Errors
/// When objects cannot be loaded or touched.
pub fn run(config: &CommissioningTrials, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let objects = config.objects.load()?;
    let described = SensorDescription::digitacts_6x6();
    let simulators: Vec<PressSimulator> = objects
        .iter()
        .map(|object| PressSimulator::new(object.mesh.clone(), described.clone()))
        .collect();
    progress("draws", 0, config.draws);
    let draws: Vec<Draw> = (0..config.draws)
        .into_par_iter()
        .map(|index| {
            let at = index % objects.len();
            draw(config, &objects[at], &simulators[at], index)
        })
        .collect::<anyhow::Result<_>>()?;
    let mut report = Report::default();
    for (index, draw) in draws.iter().enumerate() {
        report_draw(&mut report, index, draw);
    }
    summarise(&mut report, &draws);
    Ok(Outcome { report, plot: svg(&[]), pictures: Vec::new() })
}

/// Touches an object with one set-up and commissions it.
fn draw(
    config: &CommissioningTrials,
    object: &TestObject,
    described: &PressSimulator,
    index: usize,
) -> anyhow::Result<Draw> {
    let mut stream = Stream::new(config.seed, Purpose::Commissioning, 100 + index as u64);
    let n_mistakes =
        if index.is_multiple_of(RIGHT_EVERY) { 0 } else { 1 + index / RIGHT_EVERY % 2 };
    let mistake = Mistake::draw(n_mistakes, &mut stream);
    let family = SensorFamily::new(described.sensor().clone(), SensorKnowledge::DataSheet);
    let built = described.with_sensor(family.draw(&mut stream), &mut stream);
    let sampler = SamplerConfig::for_simulator(&built);
    let mut go_on = |_: usize, _: usize| ControlFlow::Continue(());
    let seed = stream.bits();
    let readings = sample(&built, SensorId(0), config.touches, seed, &sampler, &mut go_on)
        .with_context(|| format!("cannot touch {} {} times", object.name, config.touches))?;
    let session_from_object =
        Pose::from_parts(stream.rotation(), stream.direction() * stream.uniform(0.2, 0.7));
    let touches: Vec<_> = readings
        .iter()
        .map(|reading| mistake.sent(reading, session_from_object, described.sensor()))
        .collect();
    let is_placed = stream.index(2) == 0;
    let setup = Setup {
        object: described,
        session_from_object: is_placed.then_some(session_from_object),
        touches: &touches,
        seed: config.seed,
        stop: &Stop::never(),
    };
    let findings = commission(&setup)?;
    Ok(Draw { object: object.name.clone(), is_placed, mistake, findings })
}

impl Draw {
    fn has_found(&self, kind: Kind) -> bool {
        let (found, made) = (&self.findings, &self.mistake);
        match kind {
            Kind::PressureUnit => {
                found.pressure_unit.verdict() == Verdict::Wrong
                    && found.pressure_unit.value == made.pressure
            }
            Kind::PositionUnit => {
                found.position_unit.verdict() == Verdict::Wrong
                    && found.position_unit.value == made.convention.unit
            }
            Kind::Mirror | Kind::Transposition | Kind::Rotation => {
                found.image_order.verdict() == Verdict::Wrong
                    && found.image_order.value == made.order
            }
            Kind::QuaternionOrder => found.quaternion.verdict() == Verdict::Wrong,
            Kind::InvertedPose => found.direction.verdict() == Verdict::Wrong,
            Kind::ToolCenter => found.tool.verdict == Verdict::Wrong,
        }
    }

    /// Errors of the tool centre: offset (m) and turn (rad).
    fn tool_errors(&self) -> (f64, f64) {
        let (found, made) = (self.findings.tool.sent_from_true, self.mistake.tool);
        (found.distance_to(&made), found.angle_to(&made))
    }

    /// Findings that call for a correction where nothing is wrong.
    fn false_alarms(&self) -> Vec<&'static str> {
        if self.mistake.kinds.is_empty() { self.findings.wrong() } else { Vec::new() }
    }
}

fn report_draw(report: &mut Report, index: usize, draw: &Draw) {
    let (offset, turn) = draw.tool_errors();
    let kinds: Vec<String> = draw.mistake.kinds.iter().map(|kind| format!("{kind:?}")).collect();
    let (made, wrong) = (kinds.join("+"), draw.findings.wrong().join("+"));
    let labels =
        [("object", draw.object.as_str()), ("mistakes", made.as_str()), ("called_wrong", &wrong)];
    let deviations = draw.findings.tool.offset.map(|estimate| estimate.deviation);
    report.labelled(
        &labels,
        Row {
            draw: index,
            is_placed: draw.is_placed,
            found: draw.mistake.kinds.iter().all(|kind| draw.has_found(*kind)),
            offset_error_mm: offset / MM,
            turn_error_deg: turn / DEG,
            offset_deviation_mm: deviations.iter().map(|d| d * d).sum::<f64>().sqrt() / MM,
            residual_before: draw.findings.residual.0,
            residual_after: draw.findings.residual.1,
            looseness_mm: draw.findings.looseness / MM,
            order_probability: draw.findings.image_order.probability,
        },
    );
}

fn summarise(report: &mut Report, draws: &[Draw]) {
    let share = |kinds: &[Kind]| {
        let mut results = Vec::new();
        for draw in draws {
            let made = draw.mistake.kinds.iter().filter(|kind| kinds.contains(kind));
            results.extend(made.map(|kind| f64::from(u8::from(draw.has_found(*kind)))));
        }
        results.iter().sum::<f64>() / results.len() as f64
    };
    for kind in Kind::ALL {
        let name = kind.name().replace('-', "_");
        report.summarise(&format!("found_{name}"), share(&[kind]));
    }
    report.summarise("found_unit", share(&[Kind::PressureUnit, Kind::PositionUnit]));
    let errors: Vec<(f64, f64)> = draws.iter().map(Draw::tool_errors).collect();
    let offsets: Vec<f64> = errors.iter().map(|error| error.0 / MM).collect();
    let turns: Vec<f64> = errors.iter().map(|error| error.1 / DEG).collect();
    report.summarise("tcp_error_mm_median", median(&offsets));
    report.summarise("tcp_error_deg_median", median(&turns));
    let right: Vec<&Draw> = draws.iter().filter(|draw| draw.mistake.kinds.is_empty()).collect();
    let alarms = right.iter().filter(|draw| !draw.false_alarms().is_empty()).count();
    report.summarise("false_alarms", alarms as f64 / right.len().max(1) as f64);
    report.summarise("right_set_ups", right.len() as f64);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::defaults;

    #[test]
    fn a_small_run_states_what_is_found() {
        let config = CommissioningTrials { seed: 3, draws: 3, ..defaults() };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        assert_eq!(outcome.report.rows.len(), 3);
        // The first draw has no mistake, the others one each.
        assert!(summary["false_alarms"].abs() < 1e-12, "{summary:?}");
        assert!(summary["tcp_error_mm_median"] < 0.5, "{summary:?}");
        let found = outcome.report.rows.iter().filter(|row| row["found"] == true).count();
        assert!(found >= 2, "{:?}", outcome.report.rows);
    }
}
