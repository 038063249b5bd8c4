//! The judgement of a sensor's days: whether it is to be commissioned again, and why.
//!
//! The newest days are judged by themselves, taxels at rest by their values of late, and against
//! the first days under the same calibration. A taxel at rest beyond the contact floor is felt as a contact, and a tool centre
//! that is a millimetre off is what a session warns of; half of either is worth watching.

use super::day::Day;
use super::presses::{PressSums, TaxelSums};
use super::shifts::{CommonShift, ShiftSums};
use crate::sensor::SensorDescription;
use crate::units::MM;

/// Number of presses that met nothing, at which a window of days ends, and its maximum number of
/// days. Chosen: the mean of as many is certain to a seventh of the noise.
const WINDOW_PRESSES: u32 = 50;
const WINDOW_DAYS: usize = 3;
/// Number of sessions at which the window of shifts ends, and its maximum number of days. Chosen:
/// as many sessions outvote one wrong one.
const WINDOW_SESSIONS: u32 = 10;
const WINDOW_SHIFT_DAYS: usize = 7;
/// Number of presses that met nothing from which a taxel's rest is judged. Chosen: its value of
/// late is then certain to a third of the described noise, which is a fifteenth of the contact
/// floor.
const REST_MIN: u32 = 10;
/// Number of pairs of successive presses that met nothing from which noise is judged. Derived: its estimate is then
/// within a third at two deviations.
const NOISE_MIN: u32 = 20;
/// Number of presses that the neighbours felt from which a taxel's answers are judged. Chosen.
const ASKED_MIN: u32 = 10;
/// Share of answers up to which a taxel is dead. Chosen: one contact in twenty may seem to be
/// answered by noise and cross-talk.
const ANSWERS_MAX: f64 = 0.05;
/// Certainty of a shift, in standard deviations. Chosen: as for the warning of a session.
const DEVIATIONS_MIN: f64 = 4.0;
/// Standard deviation of a taxel at rest, in contact floors. Derived: at 0.2 the floor is five
/// deviations, as described; at 0.4 one press in 160 is felt where nothing is, by each taxel.
const NOISE: Limit = Limit { watch: 0.2, commission: 0.4 };
/// Noise below this many described deviations is as described. Chosen.
const NOISE_RATIO: f64 = 1.5;
/// Offset at rest, and its change, in contact floors. Derived: beyond the floor a taxel is felt.
const REST: Limit = Limit { watch: 0.5, commission: 1.0 };
/// Relative change of a taxel's answers beside its neighbours'. Chosen: factors of usable taxels
/// are within a half.
const GAIN: Limit = Limit { watch: 0.3, commission: 0.6 };
/// Shift of the tool centre, metres. Chosen: sessions warn of a millimetre.
const SHIFT: Limit = Limit { watch: 0.5 * MM, commission: 1.0 * MM };
/// Number of sessions from which the tool centre is judged. Chosen: one session may have named
/// another object than was there.
const SESSIONS_MIN: u32 = 3;

/// A value's limits.
#[derive(Clone, Copy, Debug)]
struct Limit {
    watch: f64,
    commission: f64,
}

impl Limit {
    /// The severity of a value beyond a limit, and that limit.
    fn of(self, value: f64) -> Option<(Severity, f64)> {
        match value.abs() {
            size if size > self.commission => Some((Severity::Commission, self.commission)),
            size if size > self.watch => Some((Severity::Watch, self.watch)),
            _ => None,
        }
    }
}

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// It is worth watching.
    Watch,
    /// The sensor is to be commissioned again.
    Commission,
}

/// Kind of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    /// The taxel never answers while those beside it do.
    Dead(usize),
    /// The taxel always has the same value, although those beside it do not.
    Stuck(usize),
    /// All taxels read the same without contact, and not 0.
    CommonOffset,
    /// The taxel reads something without contact, and did from the first days on.
    Offset(usize),
    /// The taxel's reading without contact has changed.
    Drift(usize),
    /// The taxel's noise.
    Noise(usize),
    /// The taxel's answers beside its neighbours' have changed.
    Gain(usize),
    /// All touches are off along an axis of the sensor frame: x, y or z.
    ToolCenter(usize),
}

/// A deviation from what is expected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finding {
    /// The fault.
    pub fault: Fault,
    /// Its severity.
    pub severity: Severity,
    /// The value found: Pa, m, or a ratio.
    pub value: f64,
    /// The value expected; of an offset, a drift and a shift the limit of its size.
    pub expected: f64,
}

/// A sensor's health.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Health {
    /// The findings, worst kinds first.
    pub findings: Vec<Finding>,
    /// Sums of the newest days; none without a press.
    pub recent: PressSums,
    /// Sums of the first days under the same calibration, if they are others.
    pub first: Option<PressSums>,
    /// The shift that recognised sessions agree on.
    pub shift: Option<CommonShift>,
}

impl Health {
    /// The severest finding.
    #[must_use]
    pub fn severity(&self) -> Option<Severity> {
        self.findings.iter().map(|finding| finding.severity).max()
    }

    /// Whether there is enough to judge by.
    #[must_use]
    pub fn is_known(&self) -> bool {
        let shift = self.shift.is_some_and(|shift| shift.n_sessions >= SESSIONS_MIN);
        !self.findings.is_empty() || self.recent.n_quiet >= REST_MIN || shift
    }

    /// Taxels of one fault.
    fn taxels(&self, of: impl Fn(Fault) -> Option<usize>) -> Vec<usize> {
        self.findings.iter().filter_map(|finding| of(finding.fault)).collect()
    }

    /// Taxels that never answer.
    #[must_use]
    pub fn dead(&self) -> Vec<usize> {
        self.taxels(|fault| if let Fault::Dead(taxel) = fault { Some(taxel) } else { None })
    }

    /// Taxels that always have the same value.
    #[must_use]
    pub fn stuck(&self) -> Vec<usize> {
        self.taxels(|fault| if let Fault::Stuck(taxel) = fault { Some(taxel) } else { None })
    }
}

/// Judges a sensor by its days, which ascend. Days of earlier calibrations than the last say
/// nothing.
#[must_use]
pub fn judge(days: &[Day], sensor: &SensorDescription) -> Health {
    let Some(newest) = days.last() else { return Health::default() };
    let days: Vec<&Day> = days.iter().filter(|day| day.calibration == newest.calibration).collect();
    let (recent, n_recent) = pressed(days.iter().rev().copied());
    let earlier = &days[..days.len() - n_recent];
    let first = Some(pressed(earlier.iter().copied()).0).filter(|sums| sums.n_presses > 0);
    let shift = shifted(&days);
    let mut findings = taxel_findings(&recent, first.as_ref(), sensor);
    findings.extend(shift.iter().flat_map(tool_findings));
    findings.sort_by(|a, b| b.severity.cmp(&a.severity).then(a.fault.cmp(&b.fault)));
    Health { findings, recent, first, shift }
}

/// Sums of the first of `days` that have enough presses without contact, the earlier ones first,
/// and the number of those days.
fn pressed<'a>(days: impl Iterator<Item = &'a Day>) -> (PressSums, usize) {
    let (mut window, mut n_quiet) = (Vec::new(), 0_u32);
    for day in days.take(WINDOW_DAYS) {
        window.push(day);
        n_quiet = n_quiet.saturating_add(day.presses.n_quiet);
        if n_quiet >= WINDOW_PRESSES {
            break;
        }
    }
    window.sort_by_key(|day| day.day);
    let mut sums = PressSums::default();
    window.iter().for_each(|day| sums.merge(&day.presses));
    (sums, window.len())
}

fn shifted(days: &[&Day]) -> Option<CommonShift> {
    let mut sums = ShiftSums::default();
    for day in days.iter().rev().take(WINDOW_SHIFT_DAYS) {
        sums.merge(&day.shifts);
        if sums.n_sessions >= WINDOW_SESSIONS {
            break;
        }
    }
    sums.common()
}

fn tool_findings(found: &CommonShift) -> Vec<Finding> {
    let of = |axis: usize| {
        let (value, deviation) = (found.shift[axis], found.deviation[axis]);
        let is_certain = value.abs() > DEVIATIONS_MIN * deviation;
        let (severity, expected) = SHIFT.of(value).filter(|_| is_certain)?;
        Some(Finding { fault: Fault::ToolCenter(axis), severity, value, expected })
    };
    if found.n_sessions < SESSIONS_MIN { Vec::new() } else { (0..3).filter_map(of).collect() }
}

fn taxel_findings(
    recent: &PressSums,
    first: Option<&PressSums>,
    sensor: &SensorDescription,
) -> Vec<Finding> {
    let limits = Limits { floor: sensor.contact_floor(), noise: sensor.parameters().noise };
    let (latest, mean) = (|sums: &TaxelSums| sums.latest, |sums: &TaxelSums| sums.mean);
    let common = common_offset(recent, latest);
    let mut findings = Vec::new();
    if let Some((severity, expected)) = REST.of(common / limits.floor) {
        let (fault, value) = (Fault::CommonOffset, common);
        findings.push(Finding { fault, severity, value, expected: expected * limits.floor });
    }
    // What all taxels have in common is said once.
    let common = if findings.is_empty() { 0.0 } else { common };
    let common_before = first.filter(|_| !findings.is_empty());
    let common_before = common_before.map_or(0.0, |first| common_offset(first, mean));
    for (taxel, now) in recent.taxels.iter().enumerate() {
        let before = first.and_then(|first| first.taxels.get(taxel));
        if let Some(silent) = limits.silent(taxel, now) {
            findings.push(silent);
            continue;
        }
        let is_known = |sums: &TaxelSums| sums.n_quiet >= REST_MIN;
        let value = is_known(now).then_some(now.latest - common);
        let earlier = before.filter(|sums| is_known(sums)).map(|sums| sums.mean - common_before);
        findings.extend(value.and_then(|value| limits.rest(taxel, value, earlier)));
        findings.extend(limits.noise(taxel, now));
        findings.extend(before.and_then(|before| gain(taxel, now, before)));
    }
    findings
}

/// The median of the taxels at rest, Pa; 0 when too few are known.
fn common_offset(sums: &PressSums, value: fn(&TaxelSums) -> f64) -> f64 {
    let known = sums.taxels.iter().filter(|taxel| taxel.n_quiet >= REST_MIN);
    let mut means: Vec<f64> = known.map(value).collect();
    let middle = means.len() / 2;
    if means.is_empty() {
        return 0.0;
    }
    *means.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// What taxels are judged by.
struct Limits {
    floor: f64,
    /// The described noise.
    noise: f64,
}

impl Limits {
    /// A taxel that does not answer: dead, or stuck at a value.
    fn silent(&self, taxel: usize, now: &TaxelSums) -> Option<Finding> {
        if now.n_asked < ASKED_MIN {
            return None;
        }
        let (severity, expected) = (Severity::Commission, now.around / f64::from(now.n_asked));
        let value = now.own / f64::from(now.n_asked);
        let is_still = now.high - now.low <= self.floor;
        let answers = f64::from(now.n_answered) / f64::from(now.n_asked);
        let fault = match (is_still, value.abs() > self.floor) {
            (true, true) => Fault::Stuck(taxel),
            _ if answers <= ANSWERS_MAX => Fault::Dead(taxel),
            _ => return None,
        };
        Some(Finding { fault, severity, value, expected })
    }

    /// A taxel's value at rest, or its change since the first days if that is most of it.
    fn rest(&self, taxel: usize, value: f64, before: Option<f64>) -> Option<Finding> {
        let change = before.map(|before| value - before).filter(|change| {
            2.0 * change.abs() > value.abs() || REST.of(value / self.floor).is_none()
        });
        let (fault, value) = match change {
            Some(change) => (Fault::Drift(taxel), change),
            None => (Fault::Offset(taxel), value),
        };
        let (severity, expected) = REST.of(value / self.floor)?;
        Some(Finding { fault, severity, value, expected: expected * self.floor })
    }

    fn noise(&self, taxel: usize, now: &TaxelSums) -> Option<Finding> {
        let value = now.noise().filter(|_| now.n_steps >= NOISE_MIN)?;
        let (severity, _) = NOISE.of(value / self.floor)?;
        let (fault, expected) = (Fault::Noise(taxel), self.noise);
        (value > NOISE_RATIO * expected).then_some(Finding { fault, severity, value, expected })
    }
}

fn gain(taxel: usize, now: &TaxelSums, before: &TaxelSums) -> Option<Finding> {
    let known = |sums: &TaxelSums| sums.gain().filter(|_| sums.n_asked >= ASKED_MIN);
    let (value, expected) = (known(now)?, known(before).filter(|gain| *gain > 0.0)?);
    let (severity, _) = GAIN.of(value / expected - 1.0)?;
    Some(Finding { fault: Fault::Gain(taxel), severity, value, expected })
}

#[cfg(test)]
mod tests;
