//! Questions about the present belief of a session: the belief itself, the marginals of a pose,
//! the best next touches, and its comparison with the truth.

use std::time::Instant;

use palpate_core::belief::answer::Answer;
use palpate_core::object::ObjectIdx;
use palpate_core::symmetry::Symmetry;
use palpate_schemas as wire;
use palpate_schemas::Method;

use super::belief::ObjectMarginals;
use super::folding::{Answered, Fold};
use super::history::ReplayQuestion;
use super::trace::{Point, TRACE_MAX};
use super::{Live, LiveError, POSES, answer};
use crate::asker::Asker;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::compute::{ComputeError, Place, Size, Urgency};
use crate::wire::belief::knows_symmetry;
use crate::wire::life::ReportedTruth;
use crate::wire::next_touch::{Question, next_touches};
use crate::wire::session::options;
use crate::wire::{geometry, sensor};

/// Number of revisions up to which all beliefs of a trace are formed again. Chosen: a replay folds
/// a session from its beginning.
const RECALLED_MAX: u64 = 512;

impl Live {
    /// The present belief.
    pub(crate) async fn belief(&self, poses: usize) -> Result<wire::Belief, LiveError> {
        let (revision, answer) = self.present(answer(poses)).await?;
        Ok(self.shown(revision, &answer))
    }

    /// The distribution of each coordinate of an object's pose (the likeliest object's if
    /// none is named).
    pub(crate) async fn marginals(
        &self,
        object: Option<&str>,
    ) -> Result<wire::Marginals, LiveError> {
        let (session, object) =
            (self.session.id, object.map(|reference| self.object(reference)).transpose()?);
        let ask = move |fold: &Fold| fold.belief.marginals(object);
        let (revision, found) = self.present(ask).await?;
        let ObjectMarginals { object, probability, marginals } =
            found.ok_or(LiveError::NoMarginals { session })?;
        let object = &self.model.objects[object.0 as usize];
        Ok(geometry::marginals(session, revision, object, probability, &marginals))
    }

    /// The best next touches. `begun` is the time of the request, from which its deadline counts.
    pub(crate) async fn next_touches(
        &self,
        question: Question,
        begun: Instant,
    ) -> Result<wire::NextTouches, LiveError> {
        let (session, method) = (self.session.id, options(&self.session).method);
        if method != Method::Surface {
            return Err(LiveError::NoNextTouches { session, method: method.name() });
        }
        let mut state = self.turns.take().await?;
        let status = self.status(now_ms())?;
        if let Some(end) = status.end {
            return Err(LiveError::Ended { session, end });
        }
        let length = status.length;
        let place = self.tools.pool.place()?;
        let (folding, place) = (self.folding(Vec::new()), (place, Urgency::Question));
        let belief =
            self.ask(&mut state, folding, place, length, |fold: &Fold| fold.belief.clone()).await?;
        // The session's readings do not wait for the answer.
        drop(state);
        let place = self.tools.pool.place_in_time().await.map_err(|_| ComputeError::Stopped)?;
        let asker = Asker::current();
        let rank = move || {
            let mut is_late = || begun.elapsed() >= question.deadline || asker.is_gone();
            (belief.next_touches(&question, &mut is_late), question)
        };
        let (ranking, question) = place.run_as((Urgency::Question, Size::Large), rank).await?;
        let ranking = ranking.ok_or(LiveError::NoTouch { session })?;
        Ok(next_touches(session, length, &ranking, &question))
    }

    /// Compares the belief with the truth.
    pub(crate) async fn judge(&self, told: ReportedTruth) -> Result<wire::Truth, LiveError> {
        let truth = told.object;
        let mut state = self.turns.insist().await;
        let length = self.length()?;
        let place = self.tools.pool.place()?;
        let (folding, place) = (self.folding(Vec::new()), (place, Urgency::Reading));
        let poses = told.session_from_object.map_or(0, |_| POSES);
        let answer = self.ask(&mut state, folding, place, length, answer(poses)).await?.answer;
        let probability = match truth {
            Some(object) => answer.probabilities[object],
            None => answer.unknown,
        };
        let others = answer.probabilities.iter().enumerate();
        let others = others.filter(|(object, _)| Some(*object) != truth).map(|(_, p)| *p);
        let unknown = truth.map(|_| answer.unknown);
        let was_right = others.chain(unknown).all(|other| probability > other);
        let errors = self.pose_errors(&answer, told);
        let object = truth.map(|object| &self.model.objects[object]);
        Ok(wire::Truth {
            object: object.map(|object| object.id),
            name: object.map(|object| object.name.clone()),
            probability,
            was_right,
            pose: told.session_from_object.map(|pose| sensor::pose(&pose)),
            position_error: errors.map(|(position, _)| position),
            angle_error: errors.map(|(_, angle)| angle),
        })
    }

    /// Distance (m) and angle (rad, up to symmetry) of the likeliest pose of the true object from
    /// its true pose. `None` if no true pose was reported, or the belief has no pose of the object.
    fn pose_errors(&self, answer: &Answer, told: ReportedTruth) -> Option<(f64, f64)> {
        let (object, pose) = (told.object?, told.session_from_object?);
        let mode = answer.modes.iter().find(|mode| mode.object.0 as usize == object)?;
        let known = self.model.symmetries.get(object);
        let method = options(&self.session).method;
        let none = Symmetry::NONE;
        let symmetry = known.filter(|_| knows_symmetry(method)).unwrap_or(&none);
        Some(symmetry.distance(&mode.session_from_object, &pose))
    }

    /// The answer after the session's end, which nothing waits for.
    pub(crate) async fn concluded(&self, place: Place) -> Result<Answered, LiveError> {
        let mut state = self.turns.insist().await;
        let length = self.length()?;
        let (folding, place) = (self.folding(Vec::new()), (place, Urgency::Question));
        self.ask(&mut state, folding, place, length, answer(POSES)).await
    }

    /// The belief after the session's end in short, which nothing waits for.
    pub(crate) async fn last_point(&self, place: Place) -> Result<Point, LiveError> {
        let length = self.length()?;
        let answer = self.concluded(place).await?;
        let at_ms = self.status(now_ms())?.changed_at_ms;
        Ok(Point::of(&self.shown(length, &answer), at_ms))
    }

    /// Forms the newest beliefs of the trace that are not known: of a session without a trace all
    /// that it keeps, else the present one.
    pub(crate) async fn recall(&self) -> Result<(), LiveError> {
        let (id, journal) = (self.session.id, self.tools.store.journal());
        let length = self.length()?;
        let from = length.saturating_sub(TRACE_MAX as u64);
        let entries = journal.entries(id, from, TRACE_MAX)?;
        let at_ms = |revision: u32| {
            let entry = entries.iter().find(|entry| entry.seq + 1 == u64::from(revision));
            entry.map_or_else(now_ms, |entry| entry.received_at_ms)
        };
        if self.tools.traces.revision(id) > 0 || length > RECALLED_MAX {
            let belief = self.belief(0).await?;
            let at_ms = at_ms(belief.revision);
            self.tools.traces.note(id, [Point::of(&belief, at_ms)]);
            return self.announce(&belief, at_ms).await;
        }
        let mut after = from;
        loop {
            let limit = TRACE_MAX as u64;
            let question = ReplayQuestion { upto: Some(length), after, limit, poses: 0 };
            let replay = self.replay(question).await?;
            let steps = replay.steps.iter().map(|step| Point {
                revision: step.revision,
                n_readings: step.n_readings,
                at_ms: at_ms(step.revision),
                best: step.best.clone(),
                unknown: step.unknown,
                entropy_bits: step.entropy_bits,
                warning: None,
            });
            let newest = Point::of(&replay.belief, at_ms(replay.belief.revision));
            self.tools.traces.note(id, steps.chain([newest]));
            match replay.next_after {
                Some(next) => after = u64::from(next),
                None => return self.announce(&replay.belief, at_ms(replay.belief.revision)).await,
            }
        }
    }

    /// Queues the webhook event of a belief without poses; forms the poses first if there is one.
    async fn announce(&self, belief: &wire::Belief, at_ms: u64) -> Result<(), LiveError> {
        if self.tools.notices.is_news(belief) {
            self.tools.notices.belief(&self.belief(POSES).await?, at_ms);
        }
        Ok(())
    }

    /// A question's answer by the present belief, and its revision.
    async fn present<T: Send + 'static>(
        &self,
        question: impl FnOnce(&Fold) -> T + Send + 'static,
    ) -> Result<(u64, T), LiveError> {
        let mut state = self.turns.take().await?;
        let length = self.length()?;
        let place = self.tools.pool.place()?;
        let (folding, place) = (self.folding(Vec::new()), (place, Urgency::Reading));
        Ok((length, self.ask(&mut state, folding, place, length, question).await?))
    }

    fn object(&self, reference: &str) -> Result<ObjectIdx, LiveError> {
        let found = self.model.find(reference).ok_or_else(|| {
            let (name, version) = (&self.model.name, self.model.version);
            let detail =
                format!("version {version} of catalogue {name:?} does not know {reference:?}");
            Cause::field("?object", detail)
        })?;
        Ok(ObjectIdx(found as u32))
    }
}
