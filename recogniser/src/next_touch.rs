//! Next touches: approaches ranked by their expected information.
//!
//! Under every sample of the posterior an approach meets some part of the object's map, or
//! misses (`footprint`); the information measures how well these outcomes distinguish the
//! samples (`information`). The rank is the information on the identity plus a tenth of that on
//! the pose, times the probability of a contact (equations R25 to R27). Poses of approaches are
//! `session_from_sensor`; the sensor moves along its own +z. Pure: the caller's `should_stop`
//! bounds the time. Not here: controllers, which re-centre.

mod ahead;
mod candidates;
mod footprint;
mod information;
pub mod interest;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use glam::DVec3;
use thiserror::Error;

use crate::belief::{PoseSample, SurfaceBelief};
use crate::model::SurfaceMap;
use candidates::own_approaches;
use footprint::{ExpectedContact, Hand, Ray, meet};
use information::{Bits, Likeness, Outcome, Scatter, Shares};
use palpate_core::log_prob::entropy_bits;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;

/// Weight of a bit on the pose relative to one on the identity: a known pose makes the next
/// touch more informative.
const POSE_WORTH: f64 = 0.1;

/// Deviations of an outcome's place and normal while no pose is known: poses from a single touch
/// represent all poses between them. Metres, rad.
const SCATTER_OF_ONE: (f32, f32) = (4.0 * MM as f32, 0.35);

/// Deviations of an outcome's place and normal later: metres, rad.
const SCATTER_OF_POSES: (f32, f32) = (2.5 * MM as f32, 0.25);

/// Variance of an outcome's appearance, relative to that between two touches of one place.
const SCATTER_OF_APPEARANCE: f32 = 4.0;

/// A press that a robot can make: from a pose along its own +z until contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Start pose of the sensor.
    pub session_from_sensor: Pose,
    /// Maximum distance along the approach, metres.
    pub reach: f64,
    /// Cost of the attempt, in any unit, above 0.
    pub cost: Option<f64>,
}

/// A ball in which the object lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workspace {
    /// Its centre, session frame, metres.
    pub center: DVec3,
    /// Its radius, metres, above 0.
    pub radius: f64,
}

/// Options of the ranking, and abilities of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NextTouchOptions {
    /// Approximate number of posterior samples.
    pub n_hypotheses: usize,
    /// Number of own approaches if none are given.
    pub n_approaches: usize,
    /// Half the width of the sensor's array, metres.
    pub half_width: f64,
    /// Whether the robot centres a first contact before it presses.
    pub recenters: bool,
    /// Ball in which the object lies, if known before any touch.
    pub workspace: Option<Workspace>,
    /// Seed of all random draws.
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

/// An approach with its expected information.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ranked {
    /// Index among the given approaches, or among our own.
    pub index: usize,
    /// The approach.
    pub approach: Approach,
    /// Expected information on the object's identity, bits.
    pub identity_bits: f64,
    /// Expected information on the object's pose given its identity, bits.
    pub pose_bits: f64,
    /// The probability of a valid contact.
    pub contact_probability: f64,
    /// The expected worth of the best press after this one; 0 where none was looked for.
    pub later_worth: f64,
}

impl Ranked {
    /// The rank: bits on the identity and a tenth of those on the pose, times the probability of a
    /// contact, per cost if there is one. Equation R27 of docs/recogniser.md.
    #[must_use]
    pub fn worth(&self) -> f64 {
        let bits = Bits { identity: self.identity_bits, pose: self.pose_bits };
        worth(bits, self.contact_probability, self.approach.cost)
    }
}

/// Equation R27 of docs/recogniser.md.
fn worth(bits: Bits, contact_probability: f64, cost: Option<f64>) -> f64 {
    contact_probability * (bits.identity + POSE_WORTH * bits.pose) / cost.unwrap_or(1.0)
}

/// Approaches, best first.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranking {
    /// The approaches that were evaluated.
    pub ranked: Vec<Ranked>,
    /// Uncertainty about the identity now, "none of these" included, bits.
    pub entropy_bits: f64,
    /// Whether there was time for all approaches, and for the presses after the best of them.
    pub is_complete: bool,
}

/// Reason for which no approach can be ranked.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum NextTouchError {
    /// The object's place is unknown.
    #[error("nothing was touched yet, expected a workspace in which the object lies")]
    NoTouch,
}

/// Least total probability of the known objects: approaches are drawn from them even if the
/// object is certainly none of them.
const KNOWN_MIN: f64 = 1e-9;

/// Ranks `given` approaches, or our own if there are none, by equation R27, and the best of them by
/// equation R27b, unless nothing was touched yet or an approach has a cost.
///
/// `should_stop` is called before every approach but the first, and before every press of the best
/// whose next ones are looked at; what was evaluated until then is ranked, by equation R27 alone if
/// it was not all. Equal arguments give equal answers if both are complete.
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
    let posterior = belief.posterior();
    let unknown = posterior.last().copied().unwrap_or(0.0);
    let mut samples = match (n_touches, options.workspace) {
        (0, None) => return Err(NextTouchError::NoTouch),
        (0, Some(workspace)) => anywhere_in(belief, &workspace, options.n_hypotheses, &mut stream),
        _ => belief.samples(options.n_hypotheses, &mut stream),
    };
    let maps = belief.model().maps();
    let total: f64 = samples.iter().map(|sample| sample.probability).sum();
    if total > 0.0 {
        let known = (1.0 - unknown).max(KNOWN_MIN);
        samples.iter_mut().for_each(|s| s.probability *= known / total);
    }
    let own;
    let approaches = match given {
        Some(given) => given,
        None => {
            own = own_approaches(maps, &samples, options, &mut stream);
            own.as_slice()
        }
    };
    let hand = Hand { half_width: options.half_width as f32, recenters: options.recenters };
    let scatter = scatter(belief.posed() as f32);
    let known = samples.iter().map(|sample| (sample.object, sample.probability as f32));
    let shares = Shares::new(known, unknown as f32);
    let likeness = |approach: &Approach| {
        let outcomes = outcomes(maps, &samples, approach, &hand);
        Likeness::of(&outcomes, unknown as f32, &scatter)
    };
    let mut ranked = Vec::with_capacity(approaches.len());
    for (index, approach) in approaches.iter().enumerate() {
        if index > 0 && should_stop() {
            break;
        }
        let likeness = likeness(approach);
        let bits = likeness.information(&shares);
        ranked.push(Ranked {
            index,
            approach: *approach,
            identity_bits: bits.identity,
            pose_bits: bits.pose,
            contact_probability: likeness.contact_probability(&shares),
            later_worth: 0.0,
        });
    }
    ranked.sort_by(|a, b| b.worth().total_cmp(&a.worth()).then(a.index.cmp(&b.index)));
    let mut is_complete = ranked.len() == approaches.len();
    if is_complete && n_touches > 0 && approaches.iter().all(|approach| approach.cost.is_none()) {
        let best = ranked.iter().take(ahead::SECONDS);
        let best: Vec<Likeness> = best.map(|ranked| likeness(&ranked.approach)).collect();
        match ahead::later_worths(&best, &shares, should_stop) {
            Some(later) => look_ahead(&mut ranked, &later),
            None => is_complete = false,
        }
    }
    let entropy_bits = entropy_bits(&posterior);
    Ok(Ranking { ranked, entropy_bits, is_complete })
}

/// The outcome of an approach under each sample.
fn outcomes(
    maps: &[Arc<SurfaceMap>],
    samples: &[PoseSample],
    approach: &Approach,
    hand: &Hand,
) -> Vec<Outcome> {
    let of = |sample: &PoseSample| outcome(&maps[sample.index()], sample, approach, hand);
    samples.iter().map(of).collect()
}

/// The outcome of an approach under a sample, whose object has this map.
fn outcome(map: &SurfaceMap, sample: &PoseSample, approach: &Approach, hand: &Hand) -> Outcome {
    let start = approach.session_from_sensor.translation;
    let direction = approach.session_from_sensor.turn(DVec3::Z);
    let session_from_object = sample.session_from_object;
    let object_from_session = session_from_object.inverse();
    let ray = Ray {
        start: (object_from_session * start).as_vec3(),
        direction: object_from_session.turn(direction).as_vec3(),
        reach: approach.reach as f32,
    };
    let turn = session_from_object.rotation.as_quat();
    let met = meet(map, &ray, hand).map(|(met, _)| ExpectedContact {
        position: turn * (met.position - ray.start),
        normal: turn * met.normal,
        ..met
    });
    Outcome { object: sample.object, probability: sample.probability as f32, met }
}

/// Orders the first approaches by what they and the best press after them tell. Equation R27b of
/// docs/recogniser.md.
fn look_ahead(ranked: &mut [Ranked], later_worths: &[f64]) {
    let firsts = &mut ranked[..later_worths.len()];
    for (ranked, later_worth) in firsts.iter_mut().zip(later_worths) {
        ranked.later_worth = *later_worth;
    }
    let both = |ranked: &Ranked| ranked.worth() + ranked.later_worth;
    // Equal ones stay in their order.
    firsts.sort_by(|a, b| both(b).total_cmp(&both(a)));
}

/// Scatter of outcomes where poses explain the touches with probability `posed`.
fn scatter(posed: f32) -> Scatter {
    let mean = |one: f32, poses: f32| (1.0 - posed) * one + posed * poses;
    let (one, poses) = (SCATTER_OF_ONE, SCATTER_OF_POSES);
    let (position, normal) = (mean(one.0, poses.0), mean(one.1, poses.1));
    Scatter { position, normal, appearance: SCATTER_OF_APPEARANCE }
}

/// Samples of every object in random poses within the workspace.
fn anywhere_in(
    belief: &SurfaceBelief,
    workspace: &Workspace,
    n: usize,
    stream: &mut Stream,
) -> Vec<PoseSample> {
    let mut shares = belief.posterior();
    shares.pop();
    let per_object = (n / shares.len().max(1)).max(1);
    let mut samples = Vec::with_capacity(per_object * shares.len());
    for (object, share) in shares.into_iter().enumerate() {
        let radius = f64::from(belief.model().reach(object));
        let room = (workspace.radius - radius).max(0.0);
        for _ in 0..per_object {
            let off = room * stream.uniform(0.0, 1.0).cbrt() * stream.direction();
            let session_from_object = Pose::from_parts(stream.rotation(), workspace.center + off);
            let probability = share / per_object as f64;
            let object = ObjectIdx(object as u32);
            samples.push(PoseSample { object, session_from_object, probability });
        }
    }
    samples
}
