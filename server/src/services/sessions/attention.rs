//! Which open sessions need somebody, and why: one definition for the API, the dashboard, the
//! command line, the metric and the alert.

use std::cmp::Reverse;
use std::fmt;
use std::str::FromStr;

use palpate_schemas::AttentionLevel;
use uuid::Uuid;

use crate::live::trace::Point;

/// Probability from which an object counts as recognised. Chosen: as the dashboard's since the
/// beginning; the stop rule decides for robots, this only sorts a list.
const SURE: f64 = 0.95;
/// Probability from which a changed answer surprises. Chosen: above it somebody may have acted on
/// the answer.
const BELIEVED: f64 = 0.7;
/// Probability of "none of these" that surprises: it is likelier than all objects together.
const NONE: f64 = 0.5;
/// Growth of the entropy by one reading that surprises, bits. Chosen: half a yes-or-no question.
const JUMP_BITS: f64 = 0.5;
/// Number of readings from which a jump surprises. Chosen: the first two may raise the entropy.
const JUMP_READINGS: u32 = 3;
/// Number of newest beliefs among which the answer changes. Chosen: about the touches of one look.
const RECENT: usize = 5;
/// Time for which a change or a jump surprises. Chosen: who did not look in ten minutes sees the
/// present belief; older surprises hide new ones.
const SURPRISE_MS: u64 = 600_000;
/// Time without a reading after which an undecided session is stuck. Chosen: an arm touches every
/// few seconds.
const QUIET_MS: u64 = 60_000;
/// Number of readings without progress after which a session is stuck. Chosen: twice what most
/// objects take.
const IDLE_READINGS: u32 = 8;
/// A session is stuck if its entropy is above the first value and fell by less than the second in
/// that many readings, bits. Chosen: half a yes-or-no question is open, and a tenth is noise.
const IDLE_BITS: f64 = 0.5;
const PROGRESS_BITS: f64 = 0.1;

/// What is known of an open session.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<'a> {
    /// Its newest beliefs, oldest first.
    pub(super) trace: &'a [Point],
    /// Number of readings that count.
    pub(super) n_readings: u64,
    /// When it last changed (ms since 1970).
    pub(super) changed_at_ms: u64,
}

/// What somebody has done about a session's alarms (ms since 1970).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Handled {
    pub(super) acknowledged_at_ms: Option<u64>,
    pub(super) muted_until_ms: Option<u64>,
}

/// A session's state, the reason, and since when it holds (ms since 1970).
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Judgement {
    pub(super) level: AttentionLevel,
    pub(super) reason: String,
    pub(super) since_ms: u64,
}

/// The state of a session at a time.
pub(super) fn judge(seen: Seen<'_>, now: u64) -> Judgement {
    let judgement =
        |level, reason: &str, since_ms| Judgement { level, reason: reason.to_owned(), since_ms };
    if seen.n_readings == 0 {
        return judgement(AttentionLevel::Waiting, "no reading yet", seen.changed_at_ms);
    }
    let Some(last) = seen.trace.last() else {
        let reason = "its belief is not formed yet";
        return judgement(AttentionLevel::Working, reason, seen.changed_at_ms);
    };
    if let Some((reason, since)) = surprise(seen.trace, last, now) {
        return judgement(AttentionLevel::Surprising, &reason, since);
    }
    if let Some(best) = last.best.as_ref().filter(|best| best.probability >= SURE) {
        let sure = |point: &Point| is(point, &best.name, SURE);
        let reason = format!("{} is sure", best.name);
        return judgement(AttentionLevel::Sure, &reason, first_of_run(seen.trace, sure));
    }
    let quiet_since = seen.changed_at_ms.saturating_add(QUIET_MS);
    if now > quiet_since {
        let reason = "undecided, and no reading for more than a minute";
        return judgement(AttentionLevel::Stuck, reason, quiet_since);
    }
    if let Some(since) = without_progress(seen.trace, last) {
        let reason = format!("undecided, and {IDLE_READINGS} readings without progress");
        return judgement(AttentionLevel::Stuck, &reason, since);
    }
    judgement(AttentionLevel::Working, "readings arrive", seen.changed_at_ms)
}

impl Handled {
    /// Whether somebody should look.
    pub(super) fn leaves_needed(&self, judgement: &Judgement, now: u64) -> bool {
        let is_alarm =
            matches!(judgement.level, AttentionLevel::Surprising | AttentionLevel::Stuck);
        let is_known = self.acknowledged_at_ms.is_some_and(|at| at >= judgement.since_ms);
        is_alarm && !is_known && self.muted_until_ms.is_none_or(|until| until <= now)
    }
}

/// The reason for which a belief surprises, and since when.
fn surprise(trace: &[Point], last: &Point, now: u64) -> Option<(String, u64)> {
    if last.unknown >= NONE {
        let since = first_of_run(trace, |point| point.unknown >= NONE);
        return Some(("probably none of the known objects".to_owned(), since));
    }
    if let Some(warning) = &last.warning {
        return Some((warning.clone(), first_of_run(trace, |point| point.warning.is_some())));
    }
    let name = |point: &Point| point.best.as_ref().map(|best| best.name.clone());
    let recent = &trace[trace.len().saturating_sub(RECENT)..];
    let changed = recent.windows(2).rev().find_map(|pair| {
        let other = name(&pair[0]).filter(|other| is(&pair[0], other, BELIEVED))?;
        (Some(&other) != name(&pair[1]).as_ref() && Some(&other) != name(last).as_ref())
            .then_some((format!("the answer was {other} shortly before"), pair[1].at_ms))
    });
    let before = trace.len().checked_sub(2).map(|index| &trace[index]);
    let jump = before.map_or(0.0, |before| last.entropy_bits - before.entropy_bits);
    let jumped = (jump >= JUMP_BITS && last.n_readings >= JUMP_READINGS)
        .then(|| (format!("the newest reading raised the entropy by {jump:.1} bit"), last.at_ms));
    changed.or(jumped).filter(|(_, since)| now < since.saturating_add(SURPRISE_MS))
}

/// Whether an object is believed with at least a probability.
fn is(point: &Point, name: &str, least: f64) -> bool {
    point.best.as_ref().is_some_and(|best| best.name == name && best.probability >= least)
}

/// Time at which the run of beliefs that ends with the last one began: `holds` is true for each of
/// them.
fn first_of_run(trace: &[Point], holds: impl Fn(&Point) -> bool) -> u64 {
    trace.iter().rev().take_while(|point| holds(point)).last().map_or(0, |point| point.at_ms)
}

/// Since when an undecided session makes no progress: the time of the belief that later ones do
/// not improve. An alarm that was acknowledged is raised again after as many readings more.
fn without_progress(trace: &[Point], last: &Point) -> Option<u64> {
    let least = last.n_readings.checked_sub(IDLE_READINGS)?;
    let before = trace.iter().rev().find(|point| point.n_readings <= least)?;
    let fell = before.entropy_bits - last.entropy_bits;
    (last.entropy_bits > IDLE_BITS && fell < PROGRESS_BITS).then_some(before.at_ms)
}

/// Place of a session in the list: those that need attention first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Rank {
    group: u8,
    /// Alarms are listed newest first; other rows stay where they are.
    newest: Reverse<u64>,
    id: Uuid,
}

impl Rank {
    pub(super) fn new(judgement: &Judgement, is_needed: bool, id: Uuid) -> Self {
        let group = match judgement.level {
            AttentionLevel::Surprising if is_needed => 0,
            AttentionLevel::Stuck if is_needed => 1,
            AttentionLevel::Working => 2,
            AttentionLevel::Surprising | AttentionLevel::Stuck => 3,
            AttentionLevel::Waiting => 4,
            AttentionLevel::Sure => 5,
        };
        let newest = Reverse(if is_needed { judgement.since_ms } else { 0 });
        Self { group, newest, id }
    }
}

impl fmt::Display for Rank {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}-{}-{}", self.group, self.newest.0, self.id.simple())
    }
}

impl FromStr for Rank {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let mut parts = text.splitn(3, '-');
        let mut next = || parts.next().ok_or(());
        let group = next()?.parse().map_err(|_| ())?;
        let newest = Reverse(next()?.parse().map_err(|_| ())?);
        let id = Uuid::try_parse(next()?).map_err(|_| ())?;
        Ok(Self { group, newest, id })
    }
}

#[cfg(test)]
mod tests {
    use palpate_schemas::BestObject;

    use super::*;

    /// A belief at each second: an object, its probability and the entropy.
    fn trace(beliefs: &[(&str, f64, f64)]) -> Vec<Point> {
        let point = |(at, (name, probability, entropy_bits)): (usize, &(&str, f64, f64))| Point {
            revision: at as u32 + 1,
            n_readings: at as u32 + 1,
            at_ms: 1000 * (at as u64 + 1),
            best: Some(BestObject {
                object: Uuid::nil(),
                name: (*name).to_owned(),
                probability: *probability,
            }),
            unknown: if *name == "none" { 0.6 } else { 0.0 },
            entropy_bits: *entropy_bits,
            warning: (*name == "off").then(|| "the tool centre is off".to_owned()),
        };
        beliefs.iter().enumerate().map(point).collect()
    }

    fn at(trace: &[Point], now: u64) -> Judgement {
        let changed_at_ms = trace.last().map_or(0, |point| point.at_ms);
        judge(Seen { trace, n_readings: trace.len() as u64, changed_at_ms }, now)
    }

    #[test]
    fn none_of_these_surprises_for_as_long_as_it_is_likely() {
        let judged =
            at(&trace(&[("mug", 0.5, 2.0), ("none", 0.2, 1.0), ("none", 0.1, 1.0)]), 9e8 as u64);
        assert_eq!((judged.level, judged.since_ms), (AttentionLevel::Surprising, 2000));
    }

    #[test]
    fn touches_that_are_off_alike_surprise() {
        let judged = at(&trace(&[("mug", 0.99, 0.1), ("off", 0.99, 0.1)]), 3000);
        assert_eq!(judged.level, AttentionLevel::Surprising);
        assert_eq!(judged.reason, "the tool centre is off");
    }

    #[test]
    fn a_changed_answer_surprises_for_ten_minutes() {
        let changed = trace(&[("mug", 0.8, 1.0), ("tyre", 0.6, 1.2), ("tyre", 0.96, 0.3)]);
        let judged = at(&changed, 4000);
        assert_eq!((judged.level, judged.since_ms), (AttentionLevel::Surprising, 2000));
        assert_eq!(judged.reason, "the answer was mug shortly before");
        let later = at(&changed, 2000 + SURPRISE_MS);
        assert_eq!((later.level, later.since_ms), (AttentionLevel::Sure, 3000));
        let back = trace(&[("mug", 0.8, 1.0), ("tyre", 0.6, 1.2), ("mug", 0.96, 0.3)]);
        assert_eq!(at(&back, 4000).level, AttentionLevel::Sure, "nobody was told otherwise");
    }

    #[test]
    fn a_growing_entropy_surprises_from_the_third_reading() {
        let grew = [("mug", 0.6, 1.0), ("mug", 0.6, 1.6), ("mug", 0.6, 2.2)];
        assert_eq!(at(&trace(&grew[..2]), 2500).level, AttentionLevel::Working);
        let judged = at(&trace(&grew), 3500);
        assert_eq!((judged.level, judged.since_ms), (AttentionLevel::Surprising, 3000));
        assert_eq!(judged.reason, "the newest reading raised the entropy by 0.6 bit");
    }

    #[test]
    fn undecided_sessions_get_stuck_when_quiet_or_idle() {
        let few = trace(&[("mug", 0.4, 2.0), ("mug", 0.5, 1.8)]);
        assert_eq!(at(&few, 2000 + QUIET_MS).level, AttentionLevel::Working);
        let quiet = at(&few, 2001 + QUIET_MS);
        assert_eq!((quiet.level, quiet.since_ms), (AttentionLevel::Stuck, 2000 + QUIET_MS));
        let idle = trace(&[("mug", 0.5, 1.5); 9]);
        let judged = at(&idle, 9500);
        assert_eq!((judged.level, judged.since_ms), (AttentionLevel::Stuck, 1000));
        let mut moving = idle;
        moving[8].entropy_bits = 1.3;
        assert_eq!(at(&moving, 9500).level, AttentionLevel::Working);
    }

    #[test]
    fn sessions_wait_for_readings_and_then_for_their_belief() {
        let waiting = Seen { trace: &[], n_readings: 0, changed_at_ms: 7 };
        assert_eq!(judge(waiting, 9e9 as u64).level, AttentionLevel::Waiting);
        let unknown = Seen { n_readings: 3, ..waiting };
        assert_eq!(judge(unknown, 9e9 as u64).level, AttentionLevel::Working);
    }

    #[test]
    fn an_alarm_is_needed_until_acknowledged_or_while_muted() {
        let alarm = at(&trace(&[("none", 0.2, 1.0)]), 5000);
        let needed = |handled: Handled| handled.leaves_needed(&alarm, 5000);
        let handled = Handled::default();
        assert!(needed(handled));
        assert!(!needed(Handled { acknowledged_at_ms: Some(1000), ..handled }));
        assert!(needed(Handled { acknowledged_at_ms: Some(999), ..handled }), "it is newer");
        assert!(!needed(Handled { muted_until_ms: Some(5001), ..handled }));
        assert!(needed(Handled { muted_until_ms: Some(5000), ..handled }));
        let sure = at(&trace(&[("mug", 0.99, 0.1)]), 5000);
        assert!(!handled.leaves_needed(&sure, 5000));
    }

    #[test]
    fn newest_alarms_are_listed_first_and_cursors_survive() {
        let rank = |level, since_ms, is_needed, id| {
            let judgement = Judgement { level, reason: String::new(), since_ms };
            Rank::new(&judgement, is_needed, Uuid::from_u128(id))
        };
        let listed = [
            rank(AttentionLevel::Surprising, 20, true, 3),
            rank(AttentionLevel::Surprising, 10, true, 1),
            rank(AttentionLevel::Stuck, 30, true, 2),
            rank(AttentionLevel::Working, 90, false, 5),
            rank(AttentionLevel::Working, 50, false, 6),
            rank(AttentionLevel::Surprising, 40, false, 4),
            rank(AttentionLevel::Sure, 40, false, 7),
        ];
        assert!(listed.is_sorted());
        assert!(listed.iter().all(|rank| rank.to_string().parse() == Ok(*rank)));
        assert_eq!("1-2-x".parse::<Rank>(), Err(()));
    }
}
