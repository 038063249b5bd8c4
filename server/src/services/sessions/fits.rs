//! Check of a geometric session's memory before anything is allocated.
//!
//! The size of its tables and bins follows from the request, so a request that would take too
//! much memory is refused at its field.

use palpate_dissertation::geometric::{BeliefMemory, GeometricError};
use palpate_schemas::{Method, PosePrior};
use palpate_store::entity::Session;

use super::SessionError;
use crate::cause::Cause;
use crate::limits::megabytes;
use crate::live::belief::{BeliefError, SessionBelief};
use crate::model::Model;
use crate::services::catalogues::CatalogueError;
use crate::wire::geometry::HALF_EXTENT;
use crate::wire::session::{self, Options, options};

/// Inverse of the share of the beliefs' memory that one session's tables may take. Chosen:
/// two sessions with their own tables can work at once.
const TABLES_SHARE: usize = 2;
/// Inverse of the share that one session's own bins may take. Chosen: a session keeps up to
/// five copies of its belief to return to.
const OWN_SHARE: usize = 8;

/// Refuses a session whose belief is impossible, or exceeds the memory of beliefs.
pub(super) fn fits(session: &Session, model: &Model, bytes_max: usize) -> Result<(), SessionError> {
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
            Some(PosePrior::Planar { .. } | PosePrior::Camera { .. }) | None => {
                "/pose_prior/half_extent"
            }
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
    Err(Cause::field(pointer, detail).into())
}

/// The options with the default box of positions.
fn with_usual_box(chosen: &Options) -> Options {
    let mut changed = chosen.clone();
    match &mut changed.pose_prior {
        Some(PosePrior::Planar { half_extent, .. }) => *half_extent = None,
        Some(PosePrior::Bounded { half_extents, .. }) => {
            *half_extents = [HALF_EXTENT; 3];
        }
        Some(PosePrior::Camera { .. }) | None => {}
    }
    changed
}

/// The refusal of an impossible belief, at the field concerned.
fn refused(error: BeliefError) -> SessionError {
    let BeliefError::Geometric(why) = &error else {
        return match error {
            BeliefError::NoPart(error) => CatalogueError::from(error).into(),
            BeliefError::Invalid(error) => error.into(),
            error => Cause::field("/method", error).into(),
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
    Cause::field(pointer, error).into()
}
