//! Next touches: what a robot asks, checked, and the answer for the wire.

use std::time::Duration;

use glam::DVec3;
use palpate_core::units::Shown;
use palpate_recogniser::next_touch::{Approach, NextTouchOptions, Ranked, Ranking, Workspace};
use palpate_schemas as wire;
use uuid::Uuid;

use crate::refusal::Refusal;
use crate::sensors::Sensors;
use crate::wire::{INTEGER_MAX, count, number, reading, sensor, within};

/// Approaches of an answer when the request does not say.
const N: u32 = 5;
/// The most approaches of a request and of an answer.
const N_MAX: usize = 1000;
/// How long is evaluated when the request does not say, milliseconds.
const DEADLINE_MS: u32 = 100;
/// The longest that may be asked for, milliseconds.
const DEADLINE_MS_MAX: u64 = 10_000;
/// The longest way of an approach and the largest workspace, metres.
const REACH_MAX: f64 = 10.0;
/// The largest cost.
const COST_MAX: f64 = 1e9;
/// The largest coordinate of a workspace's middle, metres.
const POSITION_MAX: f64 = 1e6;

/// What was asked, checked.
#[derive(Clone, Debug)]
pub(crate) struct Question {
    pub(crate) approaches: Option<Vec<Approach>>,
    pub(crate) options: NextTouchOptions,
    pub(crate) n: usize,
    pub(crate) deadline: Duration,
}

/// Checks what a robot asks.
pub(crate) fn question(
    asked: &wire::AskNextTouches,
    sensors: &Sensors,
) -> Result<Question, Refusal> {
    let found = sensors.find(&asked.sensor)?.ok_or_else(|| {
        let detail = format!("there is no sensor {:?}, expected an id or a name", asked.sensor);
        Refusal::field("/sensor", detail)
    })?;
    let grid = found.description.grid();
    let n = within("/n", u64::from(asked.n.unwrap_or(N)), 1, N_MAX as u64)?;
    let deadline_ms = u64::from(asked.deadline_ms.unwrap_or(DEADLINE_MS));
    let deadline_ms = within("/deadline_ms", deadline_ms, 1, DEADLINE_MS_MAX)?;
    let options = NextTouchOptions {
        // Of an oblong array the narrow side: what lies under it is felt either way round.
        half_width: 0.5 * grid.pitch * grid.rows.min(grid.cols) as f64,
        recenters: asked.recenters.unwrap_or(false),
        workspace: asked.workspace.as_ref().map(workspace).transpose()?,
        seed: within("/seed", asked.seed.unwrap_or(0), 0, INTEGER_MAX)?,
        ..NextTouchOptions::default()
    };
    let approaches = asked.candidates.as_deref().map(approaches).transpose()?;
    Ok(Question {
        approaches,
        options,
        n: n as usize,
        deadline: Duration::from_millis(deadline_ms),
    })
}

fn approaches(candidates: &[wire::TouchCandidate]) -> Result<Vec<Approach>, Refusal> {
    if candidates.is_empty() || candidates.len() > N_MAX {
        let n = candidates.len();
        let detail = format!("{n} candidates came, expected 1 to {N_MAX}, or none at all");
        return Err(Refusal::field("/candidates", detail));
    }
    let have_costs = candidates[0].cost.is_some();
    let one = |(index, candidate): (usize, &wire::TouchCandidate)| {
        let at = |field: &str| format!("/candidates/{index}/{field}");
        if candidate.cost.is_some() != have_costs {
            let detail = "expected a cost with all candidates or with none";
            return Err(Refusal::field(at("cost"), detail));
        }
        let cost = candidate.cost.map(|cost| positive(&at("cost"), cost, COST_MAX, ""));
        Ok(Approach {
            session_from_sensor: reading::pose(&at("pose"), &candidate.pose)?,
            reach: positive(&at("reach_m"), candidate.reach_m, REACH_MAX, " m")?,
            cost: cost.transpose()?,
        })
    };
    candidates.iter().enumerate().map(one).collect()
}

fn workspace(given: &wire::TouchWorkspace) -> Result<Workspace, Refusal> {
    for (axis, value) in given.center.iter().enumerate() {
        let at = format!("/workspace/center/{axis}");
        number(&at, *value, -POSITION_MAX, POSITION_MAX)?;
    }
    let radius = positive("/workspace/radius", given.radius, REACH_MAX, " m")?;
    Ok(Workspace { center: DVec3::from_array(given.center), radius })
}

fn positive(pointer: &str, found: f64, max: f64, unit: &str) -> Result<f64, Refusal> {
    if found > 0.0 && found <= max {
        return Ok(found);
    }
    let detail = format!("came {}{unit}, expected above 0 and at most {max}{unit}", Shown(found));
    Err(Refusal::field(pointer, detail))
}

/// An answer for the wire: the best `question.n`.
pub(crate) fn next_touches(
    session: Uuid,
    revision: u64,
    ranking: &Ranking,
    question: &Question,
) -> wire::NextTouches {
    let are_given = question.approaches.is_some();
    let touch = |ranked: &Ranked| wire::NextTouch {
        pose: sensor::pose(&ranked.approach.session_from_sensor),
        reach_m: ranked.approach.reach,
        candidate: are_given.then_some(count(ranked.index)),
        information_bits: ranked.identity_bits,
        pose_bits: ranked.pose_bits,
        contact_probability: ranked.contact_probability,
        bits_per_cost: ranked.approach.cost.map(|_| ranked.worth()),
    };
    wire::NextTouches {
        session,
        revision: count(revision),
        entropy_bits: ranking.entropy_bits,
        evaluated: count(ranking.ranked.len()),
        complete: ranking.is_complete(),
        touches: ranking.ranked.iter().take(question.n).map(touch).collect(),
    }
}
