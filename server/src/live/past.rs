//! Earlier beliefs: after the first entries of a session's journal.
//!
//! They never change, so they need no turn at the session.

use palpate_core::belief::answer::Answer;
use palpate_schemas as wire;

use super::error::LiveError;
use super::memory::{Memory, Start};
use super::{Live, Tools};
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::compute::Place;

impl Live {
    /// The belief after the first `at` entries of the session's journal; `None` when that
    /// revision is known.
    pub(crate) async fn belief_at(
        &self,
        tools: &Tools<'_>,
        poses: usize,
        at: u64,
        known_revision: Option<u64>,
    ) -> Result<Option<wire::Belief>, LiveError> {
        self.check_revision(tools, "?at", at)?;
        if known_revision == Some(at) {
            return Ok(None);
        }
        let place = tools.pool.place()?;
        // Does not wait for a fold in progress.
        let start = self.turns.try_take().and_then(|state| start(&state.memory, at));
        Ok(Some(self.past(tools, place, at, poses, start).await?))
    }

    /// Refuses a future revision.
    pub(super) fn check_revision(
        &self,
        tools: &Tools<'_>,
        field: &str,
        revision: u64,
    ) -> Result<(), LiveError> {
        let newest = self.status(tools.store, now_ms())?.length;
        if revision <= newest {
            return Ok(());
        }
        let detail = format!("came {revision}, but the session's revision is {newest}");
        Err(Cause::field(field, detail).into())
    }

    /// The belief of a revision, folded from `start`, or else from nothing.
    pub(super) async fn past(
        &self,
        tools: &Tools<'_>,
        place: Place,
        revision: u64,
        poses: usize,
        start: Option<Start>,
    ) -> Result<wire::Belief, LiveError> {
        let folding = self.folding(tools, Vec::new());
        let work = move || -> Result<Answer, LiveError> {
            Ok(folding.past(revision as usize, start)?.answer(poses))
        };
        let answer = place.run_long(work).await??;
        Ok(self.shown(revision, &answer))
    }
}

/// The order of a revision's readings, and the newest belief in memory on the way to it;
/// `None` when the revision is not in memory.
pub(super) fn start(memory: &Memory, revision: u64) -> Option<Start> {
    let length = revision as usize;
    (memory.chronicle.len() >= length).then(|| {
        let order = memory.chronicle.order_at(length);
        let begin = memory.before(&order);
        (order, begin)
    })
}
