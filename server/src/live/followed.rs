//! Followers of a session whose readings another server took.

use std::sync::atomic::Ordering;

use palpate_schemas::SessionEvent;

use super::trace::Point;
use super::{Live, LiveError, POSES, answer};
use crate::clock::now_ms;
use crate::compute::{ComputeError, Urgency};

impl Live {
    /// Marks that the followers are to hear what other servers added; `false` if another task has
    /// marked it and not begun.
    pub(crate) fn is_first_to_hear(&self) -> bool {
        !self.is_hearing.swap(true, Ordering::AcqRel)
    }

    /// Forms the belief after what other servers added, and tells it to the followers.
    pub(crate) async fn tell_followers(&self) -> Result<(), LiveError> {
        let mut state = self.turns.insist().await;
        // What comes from now on may come after the look below.
        self.is_hearing.store(false, Ordering::Release);
        let length = self.length()?;
        if length == 0 || state.remembered(length).is_some() {
            return Ok(());
        }
        let place = self.tools.pool.place_in_time().await.map_err(|_| ComputeError::Stopped)?;
        let folding = self.folding(Vec::new());
        let asking = (place, Urgency::Reading);
        let answer = self.ask(&mut state, folding, asking, length, answer(POSES)).await?;
        let belief = self.shown(length, &answer);
        state.remember(&belief);
        let last = self.tools.store.journal().entry(self.session.id, length - 1)?;
        let at_ms = last.map_or_else(now_ms, |entry| entry.received_at_ms);
        self.tools.traces.note(self.session.id, [Point::of(&belief, at_ms)]);
        self.tools.notices.belief(&belief, at_ms);
        self.count(&state);
        self.publish(SessionEvent::Belief { belief });
        Ok(())
    }
}
