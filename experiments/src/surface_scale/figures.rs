//! Figures and rows of a catalogue of some size.

use serde::Serialize;

use super::LETTER;
use crate::object_sessions::Recogniser;
use crate::objects::TestObject;
use crate::played::{Played, Step, report_wrong};
use crate::report::Report;
use crate::statistics::mean;

/// Figures of a catalogue.
#[derive(Serialize)]
pub(super) struct InCatalogue<T> {
    pub(super) objects: usize,
    #[serde(flatten)]
    pub(super) figures: T,
}

pub(super) fn report_catalogue(
    report: &mut Report,
    prefix: &str,
    count: usize,
    recogniser: &Recogniser,
    played: &Played,
) {
    let readings = played.steps.iter().map(|step| step.readings).max().unwrap_or(0);
    for readings in 1..=readings {
        report.labelled(
            &[("method", if prefix.is_empty() { "surface" } else { "literal" })],
            InCatalogue { objects: count, figures: played.figures(readings) },
        );
    }
    let mut state = |key: &str, value: f64| report.summarise(&format!("{prefix}{key}"), value);
    for readings in [1, 2, 3, 4, 6, 10].into_iter().filter(|n| *n <= readings) {
        state(&format!("accuracy_{count}_at_{readings}"), played.accuracy(readings));
    }
    if let Some(cpu_ms) = played.cpu_ms {
        state(&format!("ms_per_touch_{count}"), cpu_ms);
    }
    state(&format!("wall_ms_per_touch_{count}"), mean(&played.wall_ms()));
    state(&format!("bytes_{count}"), recogniser.bytes() as f64);
    state(&format!("trials_{count}"), played.after(1).count() as f64);
}

/// Adds the accuracy of trials with letters and with all other objects: flat letters of one size
/// share most of their surface.
pub(super) fn report_letters(
    report: &mut Report,
    count: usize,
    objects: &[TestObject],
    played: &Played,
) {
    for (kind, letters) in [("letters", true), ("others", false)] {
        for readings in [4, 6] {
            let of_kind = |step: &&Step| objects[step.object].name.starts_with(LETTER) == letters;
            let steps = played.after(readings).filter(of_kind);
            let right: Vec<f64> = steps.map(|step| f64::from(u8::from(step.is_right()))).collect();
            if !right.is_empty() {
                report.summarise(&format!("{kind}_accuracy_{count}_at_{readings}"), mean(&right));
            }
        }
    }
}

/// Adds a row for each trial that names the wrong object after four or more readings.
pub(super) fn report_late_wrong(
    report: &mut Report,
    method: &str,
    count: usize,
    objects: &[TestObject],
    played: &Played,
) {
    let late = played.steps.iter().filter(|step| step.readings >= 4);
    report_wrong(report, &[("method", method), ("objects", &count.to_string())], objects, late);
}

/// The resident memory of this process, bytes; Linux only.
pub(super) fn resident_bytes() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kilobytes: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kilobytes * 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_is_in_memory() {
        let bytes = resident_bytes().unwrap();
        assert!((1e6..1e11).contains(&bytes), "{bytes}");
    }
}
