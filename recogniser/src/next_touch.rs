//! Where to touch next: approaches ranked by what their outcome is expected to say.
//!
//! Beyond the dissertation (`docs/equations.md`). Under every hypothesis of a belief an
//! approach meets some part of the object's map, or misses (`footprint`); how well these
//! outcomes tell the hypotheses apart is the information (`information`). Identity counts
//! first, the pose a tenth of it, and both by how probable a contact is. Poses of approaches
//! are `session_from_sensor`, the sensor moves along its own +z. Pure: the caller's
//! `should_stop` bounds the time. Not here: controllers, which re-centre.

mod candidates;
mod footprint;
mod information;
#[cfg(test)]
mod tests;

use glam::DVec3;
use thiserror::Error;

use crate::belief::{Expected, SurfaceBelief};
use candidates::own_approaches;
use footprint::{Hand, Met, Ray, meet};
use information::{Outcome, Scatter, information};
use palpate_core::log_prob::entropy_bits;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;

/// What a bit about the pose is worth beside one about the identity: knowing the pose is what
/// makes the next touch worth more.
const POSE_WORTH: f64 = 0.1;

/// A press that a robot can make: from a pose along its own +z until it feels something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Where the sensor starts.
    pub session_from_sensor: Pose,
    /// How far it goes at most, metres.
    pub reach: f64,
    /// What it costs the robot to try, in any unit, above 0.
    pub cost: Option<f64>,
}

/// A ball in which the object lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workspace {
    /// Its middle, session frame, metres.
    pub center: DVec3,
    /// Its radius, metres, above 0.
    pub radius: f64,
}

/// What is considered, and what the robot can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NextTouchOptions {
    /// About how many objects in poses are told apart.
    pub n_hypotheses: usize,
    /// How many approaches of our own are considered when none are given.
    pub n_approaches: usize,
    /// Half the width of the sensor's array, metres.
    pub half_width: f64,
    /// Whether the robot centres a first contact before it presses.
    pub recenters: bool,
    /// Where the object lies, as far as is known without a touch.
    pub workspace: Option<Workspace>,
    /// Decides what is drawn at random.
    pub seed: u64,
}

impl Default for NextTouchOptions {
    fn default() -> Self {
        Self {
            n_hypotheses: 200,
            n_approaches: 48,
            half_width: 6.0 * MM,
            recenters: true,
            workspace: None,
            seed: 0,
        }
    }
}

/// An approach and what it is worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ranked {
    /// Its place among the approaches that were given, or among our own.
    pub index: usize,
    /// The approach.
    pub approach: Approach,
    /// Expected information on which object it is, bits.
    pub identity_bits: f64,
    /// Expected information on its pose given which object it is, bits.
    pub pose_bits: f64,
    /// The probability of a valid contact.
    pub contact_probability: f64,
}

impl Ranked {
    /// What approaches are ranked by: bits on the identity and a tenth of those on the pose,
    /// times the probability of a contact, for the cost if there is one.
    #[must_use]
    pub fn worth(&self) -> f64 {
        let bits = self.identity_bits + POSE_WORTH * self.pose_bits;
        self.contact_probability * bits / self.approach.cost.unwrap_or(1.0)
    }
}

/// Approaches, best first.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranking {
    /// Those that were evaluated.
    pub ranked: Vec<Ranked>,
    /// Uncertainty about the identity now, "none of these" included, bits.
    pub entropy_bits: f64,
    /// How many there were to evaluate.
    pub n_approaches: usize,
}

impl Ranking {
    /// Whether all approaches were evaluated.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.ranked.len() == self.n_approaches
    }
}

/// Why nothing can be ranked.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum NextTouchError {
    /// Nothing says where the object is.
    #[error("nothing was touched yet, expected a workspace in which the object lies")]
    NoTouch,
}

/// Also when it is surely none of the known objects, they are where approaches are drawn from.
const KNOWN_MIN: f64 = 1e-9;

/// Ranks `given` approaches, or our own when there are none, by what is expected of them.
///
/// `should_stop` is asked before every approach but the first; what was evaluated until then
/// is ranked. Equal arguments that evaluate equally many give equal answers.
///
/// # Errors
/// [`NextTouchError::NoTouch`] before the first touch without a workspace.
pub fn rank(
    belief: &SurfaceBelief,
    given: Option<&[Approach]>,
    options: &NextTouchOptions,
    should_stop: &mut dyn FnMut() -> bool,
) -> Result<Ranking, NextTouchError> {
    let mut stream = Stream::new(options.seed, Purpose::NextTouch, 0);
    let n_touches = belief.n_touches();
    let shares = belief.shares();
    let unknown = shares.last().copied().unwrap_or(0.0);
    let mut expected = match (n_touches, options.workspace) {
        (0, None) => return Err(NextTouchError::NoTouch),
        (0, Some(workspace)) => anywhere_in(belief, &workspace, options.n_hypotheses, &mut stream),
        _ => belief.expected(options.n_hypotheses, &mut stream),
    };
    let total: f64 = expected.iter().map(|expected| expected.probability).sum();
    if total > 0.0 {
        let known = (1.0 - unknown).max(KNOWN_MIN);
        expected.iter_mut().for_each(|e| e.probability *= known / total);
    }
    let own;
    let approaches = match given {
        Some(given) => given,
        None => {
            own = own_approaches(belief.model(), &expected, options, &mut stream);
            own.as_slice()
        }
    };
    let hand = Hand { half_width: options.half_width as f32, recenters: options.recenters };
    let scatter = scatter(n_touches);
    let mut ranked = Vec::with_capacity(approaches.len());
    for (index, approach) in approaches.iter().enumerate() {
        if index > 0 && should_stop() {
            break;
        }
        let outcomes = outcomes(belief, &expected, approach, &hand);
        let bits = information(&outcomes, unknown as f32, &scatter);
        ranked.push(Ranked {
            index,
            approach: *approach,
            identity_bits: bits.identity,
            pose_bits: bits.pose,
            contact_probability: contact_probability(&outcomes),
        });
    }
    ranked.sort_by(|a, b| b.worth().total_cmp(&a.worth()).then(a.index.cmp(&b.index)));
    let entropy_bits = entropy_bits(&shares);
    Ok(Ranking { ranked, entropy_bits, n_approaches: approaches.len() })
}

/// What an approach meets under each hypothesis.
fn outcomes(
    belief: &SurfaceBelief,
    expected: &[Expected],
    approach: &Approach,
    hand: &Hand,
) -> Vec<Outcome> {
    let start = approach.session_from_sensor.translation;
    let direction = approach.session_from_sensor.turn(DVec3::Z);
    let outcome = |expected: &Expected| {
        let session_from_object = expected.session_from_object;
        let object_from_session = session_from_object.inverse();
        let ray = Ray {
            start: (object_from_session * start).as_vec3(),
            direction: object_from_session.turn(direction).as_vec3(),
            reach: approach.reach as f32,
        };
        let map = &belief.model().maps()[expected.object.0 as usize];
        let turn = session_from_object.rotation.as_quat();
        let met = meet(map, &ray, hand).map(|(met, _)| Met {
            position: turn * (met.position - ray.start),
            normal: turn * met.normal,
            ..met
        });
        let probability = expected.probability as f32;
        Outcome { object: expected.object, probability, met }
    };
    expected.iter().map(outcome).collect()
}

/// The probability of a contact if the object is a known one.
fn contact_probability(outcomes: &[Outcome]) -> f64 {
    let total: f32 = outcomes.iter().map(|outcome| outcome.probability).sum();
    let met = outcomes.iter().filter_map(|o| Some(o.probability * o.met?.contact));
    // A sum of nothing is −0.
    let contact = met.fold(0.0, |sum, contact| sum + contact);
    if total > 0.0 { f64::from(contact / total) } else { 0.0 }
}

/// How far outcomes scatter: poses of a single touch stand for all that lie between them.
fn scatter(n_touches: usize) -> Scatter {
    let mm = MM as f32;
    let (position, normal) = if n_touches < 2 { (4.0 * mm, 0.35) } else { (2.5 * mm, 0.25) };
    Scatter { position, normal, appearance: 4.0 }
}

/// Every object in poses drawn from those that keep it in the workspace.
fn anywhere_in(
    belief: &SurfaceBelief,
    workspace: &Workspace,
    n: usize,
    stream: &mut Stream,
) -> Vec<Expected> {
    let mut shares = belief.shares();
    shares.pop();
    let per_object = (n / shares.len().max(1)).max(1);
    let mut expected = Vec::with_capacity(per_object * shares.len());
    for (object, share) in shares.into_iter().enumerate() {
        let radius = f64::from(candidates::radius_of(&belief.model().maps()[object]));
        let room = (workspace.radius - radius).max(0.0);
        for _ in 0..per_object {
            let off = room * stream.uniform(0.0, 1.0).cbrt() * stream.direction();
            let session_from_object = Pose::from_parts(stream.rotation(), workspace.center + off);
            let probability = share / per_object as f64;
            let object = ObjectIdx(object as u32);
            expected.push(Expected { object, session_from_object, probability });
        }
    }
    expected
}
