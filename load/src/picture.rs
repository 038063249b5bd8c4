//! Picture of a run: throughput and latency against the offered rate.

use palpate_sim::plot::{Line, Panel, svg};

use super::report::LoadReport;
use super::step::StepReport;

/// Throughput and latency of the steps against the rate, as SVG. The soak, a longer
/// measurement on a full server, is not among the points.
#[must_use]
pub fn picture(report: &LoadReport) -> String {
    let mut steps: Vec<&StepReport> = report.steps.iter().collect();
    steps.sort_by(|a, b| a.rate.total_cmp(&b.rate));
    let line = |name: &str, value: &dyn Fn(&StepReport) -> f64| Line {
        name: name.to_owned(),
        points: steps.iter().map(|step| (step.rate, value(step))).collect(),
    };
    let x = "requests due a second".to_owned();
    let throughput = Panel {
        title: "answered with success".to_owned(),
        x: x.clone(),
        y: "a second".to_owned(),
        lines: vec![
            line("accepted", &|step| step.accepted_per_s),
            line("readings", &|step| step.readings_per_s),
        ],
    };
    let latency = |name: &str, of: &dyn Fn(&super::Latency) -> f64| {
        line(name, &|step| step.accepted_latency.as_ref().map_or(f64::NAN, of))
    };
    let waiting = Panel {
        title: "accepted requests, from when they were due".to_owned(),
        x,
        y: "milliseconds".to_owned(),
        lines: vec![
            latency("p99", &|latency| latency.p99_ms),
            latency("p90", &|latency| latency.p90_ms),
            latency("p50", &|latency| latency.p50_ms),
        ],
    };
    svg(&[throughput, waiting])
}
