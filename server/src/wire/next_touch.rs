//! Conversion of next touches: checked requests, and answers.

use std::time::Duration;

use glam::DVec3;
use palpate_recogniser::next_touch::{Approach, NextTouchOptions, Ranked, Ranking, Workspace};
use palpate_schemas as wire;
use palpate_store::entity::Sensor;
use uuid::Uuid;

use crate::wire::Invalid;
use crate::wire::{INTEGER_MAX, count, number, outside, reading, sensor, within};

/// Default number of approaches in an answer.
const N: u32 = 5;
/// Maximum number of approaches in a request and in an answer.
const N_MAX: usize = 1000;
/// Default time of the evaluation, milliseconds.
const DEADLINE_MS: u32 = 100;
/// Maximum time of the evaluation, milliseconds.
const DEADLINE_MS_MAX: u64 = 10_000;
/// Maximum length of an approach and radius of a workspace, metres.
const REACH_MAX: f64 = 10.0;
/// The largest cost.
const COST_MAX: f64 = 1e9;
/// Largest coordinate of a workspace's centre, metres.
const POSITION_MAX: f64 = 1e6;

/// A checked request.
#[derive(Clone, Debug)]
pub(crate) struct Question {
    pub(crate) approaches: Option<Vec<Approach>>,
    pub(crate) options: NextTouchOptions,
    pub(crate) n: usize,
    pub(crate) deadline: Duration,
}

/// Checks a robot's request. `sensor` is the named one, if it exists.
pub(crate) fn question(
    asked: &wire::AskNextTouches,
    sensor: Option<&Sensor>,
) -> Result<Question, Invalid> {
    let sensor = sensor.ok_or_else(|| reading::no_sensor("/sensor", &asked.sensor))?;
    let grid = sensor.description.grid();
    let n = within("/n", u64::from(asked.n.unwrap_or(N)), 1, N_MAX as u64)?;
    let deadline_ms = u64::from(asked.deadline_ms.unwrap_or(DEADLINE_MS));
    let deadline_ms = within("/deadline_ms", deadline_ms, 1, DEADLINE_MS_MAX)?;
    let options = NextTouchOptions {
        // For an oblong array the narrow side: it covers both orientations.
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

fn approaches(candidates: &[wire::TouchCandidate]) -> Result<Vec<Approach>, Invalid> {
    if candidates.is_empty() || candidates.len() > N_MAX {
        let n = candidates.len();
        let detail = format!("{n} candidates came, expected 1 to {N_MAX}, or none at all");
        return Err(Invalid::field("/candidates", detail));
    }
    let have_costs = candidates[0].cost.is_some();
    let one = |(index, candidate): (usize, &wire::TouchCandidate)| {
        let at = |field: &str| format!("/candidates/{index}/{field}");
        if candidate.cost.is_some() != have_costs {
            let detail = "expected a cost with all candidates or with none";
            return Err(Invalid::field(at("cost"), detail));
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

fn workspace(given: &wire::TouchWorkspace) -> Result<Workspace, Invalid> {
    for (axis, value) in given.center.iter().enumerate() {
        let at = format!("/workspace/center/{axis}");
        number(&at, *value, -POSITION_MAX, POSITION_MAX)?;
    }
    let radius = positive("/workspace/radius", given.radius, REACH_MAX, " m")?;
    Ok(Workspace { center: DVec3::from_array(given.center), radius })
}

fn positive(pointer: &str, found: f64, max: f64, unit: &str) -> Result<f64, Invalid> {
    if found > 0.0 && found <= max {
        return Ok(found);
    }
    let expected = format!("above 0 and at most {max}{unit}");
    Err(outside(pointer, found, [0.0, max], &expected))
}

/// The answer in its wire form: the best `question.n`.
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
        complete: ranking.is_complete,
        touches: ranking.ranked.iter().take(question.n).map(touch).collect(),
    }
}
