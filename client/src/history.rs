//! A session's history: readings, retraction, replay, explanation.

use palpate_schemas::{
    BeliefDetail, ExplainQuery, Explanation, PageQuery, ReadingRetracted, Replay, ReplayQuery,
    SessionReadingPage,
};
use uuid::Uuid;

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;
use crate::retry::Repeat;

impl Client {
    /// Returns a page of a session's readings in the order of arrival.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn session_readings(
        &self,
        session: Uuid,
        page: &PageQuery,
    ) -> Result<SessionReadingPage, Error> {
        let path = ["v1", "sessions", &session.to_string(), "readings"];
        self.send(Request::get(path).page(page)).await
    }

    /// Retracts a reading by its number within the session, and returns the belief without it.
    /// Retracting it again returns the first answer.
    ///
    /// # Errors
    /// [`Error`]; status 410 if the session has ended.
    pub async fn retract_reading(
        &self,
        session: Uuid,
        number: u32,
        detail: BeliefDetail,
    ) -> Result<ReadingRetracted, Error> {
        let path = ["v1", "sessions", &session.to_string(), "readings", &number.to_string()];
        self.retract(Request::delete(path), detail).await
    }

    /// Retracts a reading by its robot and `seq`.
    ///
    /// # Errors
    /// [`Error`]; status 410 if the session has ended.
    pub async fn retract_robot_reading(
        &self,
        session: Uuid,
        robot: &str,
        seq: u64,
        detail: BeliefDetail,
    ) -> Result<ReadingRetracted, Error> {
        let (session, seq) = (session.to_string(), seq.to_string());
        let path = ["v1", "sessions", &session, "readings", robot, &seq];
        self.retract(Request::delete(path), detail).await
    }

    /// Returns the answer of a session at each revision.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn replay(&self, session: Uuid, query: ReplayQuery) -> Result<Replay, Error> {
        let path = ["v1", "sessions", &session.to_string(), "replay"];
        let request = Request::get(path)
            .query("upto", query.upto)
            .query("after", query.after)
            .query("limit", query.limit)
            .query("poses", query.poses);
        self.send(request).await
    }

    /// Returns the contribution of each reading to a session's belief, and which readings disagree.
    ///
    /// # Errors
    /// [`Error`]; status 409 if the belief rests on too many readings.
    pub async fn explain(&self, session: Uuid, query: ExplainQuery) -> Result<Explanation, Error> {
        let path = ["v1", "sessions", &session.to_string(), "explain"];
        self.send(Request::get(path).query("at", query.at)).await
    }

    async fn retract(
        &self,
        request: Request,
        detail: BeliefDetail,
    ) -> Result<ReadingRetracted, Error> {
        let request = request.query("belief", Some(detail_name(detail)));
        // Unlike other deletions, a repeated one returns the first answer.
        self.send(request.repeat(Repeat::Harmless)).await
    }
}

/// Name of a belief detail in a query.
pub(crate) fn detail_name(detail: BeliefDetail) -> &'static str {
    match detail {
        BeliefDetail::Full => "full",
        BeliefDetail::Top => "top",
        BeliefDetail::None => "none",
    }
}
