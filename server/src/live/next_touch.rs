//! The best next touches of a session, by its present belief.

use std::time::Instant;

use palpate_schemas as wire;
use palpate_schemas::Method;

use super::error::LiveError;
use super::{Live, Tools};
use crate::asker::Asker;
use crate::clock::now_ms;
use crate::live::belief::SessionBelief;
use crate::wire::next_touch::{Question, next_touches};
use crate::wire::session::options;

impl Live {
    /// The best next touches. `begun` is the time of the request, from which its deadline counts.
    pub(crate) async fn next_touches(
        &self,
        tools: &Tools<'_>,
        question: Question,
        begun: Instant,
    ) -> Result<wire::NextTouches, LiveError> {
        let (session, method) = (self.session.id, options(&self.session).method);
        if method != Method::Surface {
            return Err(LiveError::NoNextTouches { session, method: method.name() });
        }
        let mut state = self.turns.take().await?;
        let status = self.status(tools.store, now_ms())?;
        if let Some(end) = status.end {
            return Err(LiveError::Ended { session, end });
        }
        let length = status.length;
        let place = tools.pool.place()?;
        let asker = Asker::current();
        let ask = move |belief: &SessionBelief| {
            let mut is_late = || begun.elapsed() >= question.deadline || asker.is_gone();
            (belief.next_touches(&question, &mut is_late), question)
        };
        let (ranking, question) =
            self.ask(&mut state, self.folding(tools, Vec::new()), place, length, ask).await?;
        let ranking = ranking.ok_or(LiveError::NoTouch { session })?;
        Ok(next_touches(session, length, &ranking, &question))
    }
}
