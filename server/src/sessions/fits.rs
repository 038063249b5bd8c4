//! Whether a session by geometry can be had, told before anything is made for it.
//!
//! The size of its tables and bins follows from what the client chose, so a choice that would
//! take too much memory is refused at its field.

use palpate_dissertation::geometric::{BeliefMemory, GeometricError};
use palpate_schemas::{Method, PosePrior};
use palpate_store::entity::Session;

use crate::belief::{BeliefError, SessionBelief};
use crate::catalogues::Model;
use crate::refusal::{Refusal, megabytes};
use crate::wire::geometry::HALF_EXTENT;
use crate::wire::session::{self, Options, options};

/// The share of the memory of beliefs that one session's tables may take. Chosen: two sessions
/// with tables of their own can work at once.
const TABLES_SHARE: usize = 2;
/// The share that one session's own bins may take. Chosen: a session keeps up to five copies
/// of its belief to go back to.
const OWN_SHARE: usize = 8;

/// Refuses a session whose belief cannot be had, or not within the memory of beliefs.
pub(super) fn fits(session: &Session, model: &Model, bytes_max: usize) -> Result<(), Refusal> {
    let memory = SessionBelief::memory(session, model).map_err(refused)?;
    let Some(memory) = memory else { return Ok(()) };
    let (tables_max, own_max) = (bytes_max / TABLES_SHARE, bytes_max / OWN_SHARE);
    let fits = |memory: BeliefMemory| memory.tables <= tables_max && memory.own <= own_max;
    if fits(memory) {
        return Ok(());
    }
    let would_fit = |changed: Options| {
        let changed = Session { options: session::written(&changed), ..session.clone() };
        SessionBelief::memory(&changed, model).is_ok_and(|memory| memory.is_some_and(fits))
    };
    let chosen = options(session);
    let pointer = if would_fit(with_usual_box(&chosen)) {
        match &chosen.pose_prior {
            Some(PosePrior::Bounded { .. }) => "/pose_prior/half_extents",
            Some(PosePrior::Planar { .. }) | None => "/pose_prior/half_extent",
        }
    } else if would_fit(session::with_usual_size(&chosen)) {
        if chosen.method == Method::GeometricParticles { "/particles" } else { "/bins" }
    } else {
        "/method"
    };
    let (what, needed, share, max) = match memory.tables > tables_max {
        true => ("tables", memory.tables, "half", tables_max),
        false => ("bins", memory.own, "an eighth", own_max),
    };
    let (needed, max) = (megabytes(needed as u64), megabytes(max as u64));
    let detail = format!(
        "the session's {what} would take {needed} of memory, expected at most {max}, which is \
         {share} of `--belief-memory-mb`"
    );
    Err(Refusal::field(pointer, detail))
}

/// The options with the box of positions that a session has when it does not say.
fn with_usual_box(chosen: &Options) -> Options {
    let mut changed = chosen.clone();
    match &mut changed.pose_prior {
        Some(PosePrior::Planar { half_extent, .. }) => *half_extent = None,
        Some(PosePrior::Bounded { half_extents, .. }) => {
            *half_extents = [HALF_EXTENT; 3];
        }
        None => {}
    }
    changed
}

/// Why a belief cannot be had, at the field that says so.
fn refused(error: BeliefError) -> Refusal {
    let BeliefError::Geometric(why) = &error else {
        return match error {
            BeliefError::Refused(refusal) => refusal,
            error => Refusal::field("/method", error),
        };
    };
    let pointer = match why {
        GeometricError::Range { field: "half_extent", .. } => "/pose_prior/half_extent",
        GeometricError::Range { field: "half_extent x", .. } => "/pose_prior/half_extents/0",
        GeometricError::Range { field: "half_extent y", .. } => "/pose_prior/half_extents/1",
        GeometricError::Range { field: "half_extent z", .. } => "/pose_prior/half_extents/2",
        GeometricError::Range { field: "half_angle", .. } | GeometricError::EveryTurn { .. } => {
            "/pose_prior/half_angle"
        }
        _ => "/method",
    };
    Refusal::field(pointer, error)
}
