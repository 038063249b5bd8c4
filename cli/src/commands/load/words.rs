//! Text output of a load run: a line per step and a summary.

use palpate_load::{Growth, LoadReport, StepReport};

/// Header of [`row`].
pub(super) const HEADER: &str = "     due/s  accepted/s  readings/s     429     503   other  \
    errors  unsent |   p50 ms   p90 ms   p99 ms p99.9 ms   max ms | refused p99 |  memory MB";

/// A step as a line.
pub(super) fn row(step: &StepReport) -> String {
    let counts = &step.counts;
    let latency = step.accepted_latency.map_or("        –".repeat(5), |latency| {
        let at = [latency.p50_ms, latency.p90_ms, latency.p99_ms, latency.p999_ms, latency.max_ms];
        at.map(|ms| format!("{ms:9.1}")).concat()
    });
    let refused = step
        .refused_latency
        .map_or("–".to_owned(), |latency| format!("{:.1} ms", latency.p99_ms));
    let memory =
        step.memory.map_or("–".to_owned(), |memory| format!("{:.1}", memory.end_bytes / 1e6));
    let mut row = format!(
        "{:10.1}{:12.1}{:12.1}{:8}{:8}{:8}{:8}{:8} |{latency} | {refused:>11} | {memory:>10}",
        step.rate,
        step.accepted_per_s,
        step.readings_per_s,
        counts.refused_429,
        counts.refused_503,
        counts.other,
        counts.errors,
        counts.not_sent + counts.held_back,
    );
    for message in &step.messages {
        row.push_str("\n           ");
        row.push_str(message);
    }
    row
}

/// The summary of all steps, and the bounds that were exceeded.
pub(super) fn verdict_words(report: &LoadReport, broken: &[String]) -> String {
    let verdict = &report.verdict;
    let mut lines = vec![format!(
        "\npeak: {:.1} readings/s accepted, at {:.1} requests/s due",
        verdict.peak_readings_per_s, verdict.peak_rate
    )];
    lines.push(match (verdict.share_beyond, verdict.is_saturated) {
        (Some(share), true) => format!("beyond saturation: {share:.2} of the peak at the worst"),
        (_, false) => "saturation was not reached: try higher rates with --steps".to_owned(),
        (None, true) => "beyond saturation: not tried; the peak is at the highest rate".to_owned(),
    });
    if let Some(p99_ms) = verdict.p99_ms {
        lines.push(format!("p99 of accepted requests: {p99_ms:.1} ms at the worst"));
    }
    lines.push(match verdict.memory {
        Some(memory) => memory_words(&memory),
        None => "memory: not known; give --pid for a server on this machine".to_owned(),
    });
    if verdict.unexpected > 0 {
        lines.push(format!("{} unexpected answers", verdict.unexpected));
    }
    lines.extend(broken.iter().map(|bound| format!("EXCEEDED: {bound}")));
    lines.join("\n")
}

fn memory_words(memory: &Growth) -> String {
    format!(
        "memory: {:.1} MB at the begin, {:.1} MB at the end ({:+.1} MB), {:.1} MB at most, \
         slope {:+.1} kB/s",
        memory.begin_bytes / 1e6,
        memory.end_bytes / 1e6,
        memory.growth_bytes / 1e6,
        memory.max_bytes / 1e6,
        memory.slope_bytes_per_s / 1e3
    )
}
