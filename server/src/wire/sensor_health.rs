//! Conversion of sensors' health, with its sentences.

use palpate_core::health::day::Day;
use palpate_core::health::presses::{PressSums, TaxelSums};
use palpate_core::health::shifts::CommonShift;
use palpate_core::health::verdict::{Fault, Finding, Health, Severity, judge};
use palpate_core::sensor::SensorDescription;
use palpate_core::units::{MM, Shown};
use palpate_schemas as wire;
use palpate_schemas::{HealthCode, HealthState};
use palpate_store::entity::Sensor;
use palpate_store::sensor_day::SensorDay;

use crate::wire::{count, time};

/// Maximum number of reasons in an answer. Chosen: a connector that breaks takes a row or two.
const REASONS_MAX: usize = 32;
/// Milliseconds of a day.
pub(crate) const DAY_MS: u64 = 86_400_000;
const AXES: [&str; 3] = ["x", "y", "z"];

/// Judges a sensor by its days, oldest first. Only days under its newest calibration count.
pub(crate) fn health(
    sensor: &Sensor,
    calibration: Option<u32>,
    days: &[SensorDay],
    n_waiting: usize,
) -> wire::SensorHealth {
    let counts = || days.iter().filter(|it| it.day.calibration == calibration.unwrap_or(0));
    let counted: Vec<Day> = counts().map(|it| it.day.clone()).collect();
    let found = judge(&counted, &sensor.description);
    let date = |it: &SensorDay| {
        let mut date = time(u64::from(it.day.day) * DAY_MS);
        date.truncate("2026-11-25".len());
        date
    };
    let reasons: Vec<wire::HealthReason> =
        found.findings.iter().take(REASONS_MAX).map(|it| reason(it, &found, sensor)).collect();
    let indices = |taxels: Vec<usize>| taxels.into_iter().map(count).collect();
    wire::SensorHealth {
        sensor: sensor.id,
        name: sensor.name.clone(),
        state: state(&found),
        summary: summary(&found, &reasons),
        reasons,
        n_reasons: count(found.findings.len()),
        calibration,
        first_day: counts().next().map(date),
        last_day: counts().next_back().map(date),
        n_days: count(counts().count()),
        n_sessions: count(counts().map(|it| it.sessions.len()).sum::<usize>()),
        n_presses: counts().map(|it| it.day.presses.n_presses).fold(0, u32::saturating_add),
        n_quiet: counts().map(|it| it.day.presses.n_quiet).fold(0, u32::saturating_add),
        rest: rest(&found, &sensor.description),
        dead: indices(found.dead()),
        stuck: indices(found.stuck()),
        tool_center: found.shift.as_ref().map(tool_center),
        n_waiting: count(n_waiting),
    }
}

/// The warning about a reading of a sensor that is to be commissioned again. `index` is the
/// reading's in its request.
pub(crate) fn warning(index: usize, health: &wire::SensorHealth) -> wire::Warning {
    wire::Warning {
        code: wire::WarningCode::SensorChanged,
        pointer: format!("/readings/{index}/sensor"),
        detail: format!("the sensor {:?} has changed: {}", health.name, health.summary),
    }
}

fn state(found: &Health) -> HealthState {
    match found.severity() {
        Some(severity) => severity_state(severity),
        None if found.is_known() => HealthState::Good,
        None => HealthState::Unknown,
    }
}

fn severity_state(severity: Severity) -> HealthState {
    match severity {
        Severity::Watch => HealthState::Watch,
        Severity::Commission => HealthState::Commission,
    }
}

fn summary(found: &Health, reasons: &[wire::HealthReason]) -> String {
    let first = reasons.first().map_or("", |reason| reason.detail.as_str());
    let others = match found.findings.len() {
        0 | 1 => String::new(),
        2 => " (and one more reason)".to_owned(),
        n => format!(" (and {} more reasons)", n - 1),
    };
    match state(found) {
        HealthState::Unknown => "too little is known: expected ten presses that meet nothing, or \
             three sessions that recognise an object with six touches or more"
            .to_owned(),
        HealthState::Good => "nothing speaks for commissioning the sensor again".to_owned(),
        HealthState::Watch => format!("watch the sensor: {first}{others}"),
        HealthState::Commission => format!("commission the sensor again: {first}{others}"),
    }
}

fn tool_center(found: &CommonShift) -> wire::ToolCenterError {
    let CommonShift { shift, deviation, n_sessions, n_touches } = *found;
    wire::ToolCenterError { shift_m: shift, deviation_m: deviation, n_sessions, n_touches }
}

fn rest(found: &Health, sensor: &SensorDescription) -> Option<wire::SensorRest> {
    let of = |sums: &PressSums, value: fn(&TaxelSums) -> Option<f64>| -> Vec<Option<f64>> {
        sums.taxels.iter().map(value).collect()
    };
    let latest = |taxel: &TaxelSums| (taxel.n_quiet > 0).then_some(taxel.latest);
    let mean = |taxel: &TaxelSums| (taxel.n_quiet > 0).then_some(taxel.mean);
    let change = |first: &PressSums| {
        let both = of(&found.recent, latest).into_iter().zip(of(first, mean));
        both.map(|(now, before)| Some(now? - before?)).collect()
    };
    (found.recent.n_quiet > 0).then(|| wire::SensorRest {
        n_presses: found.recent.n_quiet,
        changes: found.first.as_ref().filter(|first| first.n_quiet > 0).map(change),
        noise: of(&found.recent, TaxelSums::noise),
        described_noise: sensor.parameters().noise,
        contact_floor: sensor.contact_floor(),
        pressures: of(&found.recent, latest),
    })
}

fn reason(finding: &Finding, found: &Health, sensor: &Sensor) -> wire::HealthReason {
    let Finding { fault, severity, value, expected } = *finding;
    let (code, taxel, axis) = match fault {
        Fault::Dead(taxel) => (HealthCode::Dead, Some(taxel), None),
        Fault::Stuck(taxel) => (HealthCode::Stuck, Some(taxel), None),
        Fault::CommonOffset => (HealthCode::CommonOffset, None, None),
        Fault::Offset(taxel) => (HealthCode::Offset, Some(taxel), None),
        Fault::Drift(taxel) => (HealthCode::Drift, Some(taxel), None),
        Fault::Noise(taxel) => (HealthCode::Noise, Some(taxel), None),
        Fault::Gain(taxel) => (HealthCode::Gain, Some(taxel), None),
        Fault::ToolCenter(axis) => (HealthCode::ToolCenter, None, Some(axis)),
    };
    wire::HealthReason {
        code,
        state: severity_state(severity),
        taxel: taxel.map(count),
        axis: axis.map(|axis| AXES[axis].to_owned()),
        value,
        expected,
        detail: sentence(finding, found, sensor),
    }
}

fn sentence(finding: &Finding, found: &Health, sensor: &Sensor) -> String {
    let Finding { fault, value, expected, .. } = *finding;
    let named = |taxel: usize| {
        if sensor.description.listed().is_some() {
            return format!("taxel {taxel}");
        }
        let cols = sensor.description.grid().cols;
        format!("taxel {taxel} (row {}, column {})", taxel / cols, taxel % cols)
    };
    let sums = |taxel: usize| found.recent.taxels.get(taxel).copied().unwrap_or_default();
    let signed = |value: f64| format!("{}{}", if value > 0.0 { "+" } else { "" }, pascal(value));
    match fault {
        Fault::Dead(taxel) => format!(
            "{} answered {} of {} presses that the taxels beside it felt: it is dead",
            named(taxel),
            sums(taxel).n_answered,
            sums(taxel).n_asked
        ),
        Fault::Stuck(taxel) => format!(
            "{} reads {} Pa in all presses, also where those beside it feel a contact: it is stuck",
            named(taxel),
            pascal(value)
        ),
        Fault::CommonOffset => format!(
            "the taxels read {} Pa when nothing is touched, expected within ±{}: was the sensor \
             tared, or has its temperature changed?",
            signed(value),
            pascal(expected)
        ),
        Fault::Offset(taxel) => format!(
            "{} reads {} Pa when nothing is touched, expected within ±{}",
            named(taxel),
            signed(value),
            pascal(expected)
        ),
        Fault::Drift(taxel) => format!(
            "{} has drifted by {} Pa since the first days, measured when nothing is touched, \
             expected within ±{}",
            named(taxel),
            signed(value),
            pascal(expected)
        ),
        Fault::Noise(taxel) => format!(
            "{} has noise of {} Pa when nothing is touched, expected {}",
            named(taxel),
            pascal(value),
            pascal(expected)
        ),
        Fault::Gain(taxel) => format!(
            "{} answers with {:.0} % of what it answered in the first days, relative to the taxels \
             beside it",
            named(taxel),
            100.0 * value / expected
        ),
        Fault::ToolCenter(axis) => tool_sentence(value, axis, found),
    }
}

/// A pressure in words: in whole pascals where these say enough.
fn pascal(value: f64) -> Shown {
    Shown(if value.abs() < 10.0 { value } else { value.round() })
}

fn tool_sentence(value: f64, axis: usize, found: &Health) -> String {
    let Some(CommonShift { deviation, n_sessions, .. }) = found.shift else { return String::new() };
    let cause = if axis == 2 {
        "is the tool centre too long or too short, or the covering of another stiffness than \
         described?"
    } else {
        "is the tool centre right?"
    };
    format!(
        "{n_sessions} recognised sessions fit best with the sensor {:+.1} mm along {} beside its \
         stated pose, ± {:.1} mm: {cause}",
        value / MM,
        AXES[axis],
        deviation[axis] / MM
    )
}
