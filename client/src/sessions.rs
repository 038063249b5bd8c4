//! Sessions: readings in, beliefs out.

use palpate_schemas::{
    AddReadings, AskNextTouches, Belief, BeliefQuery, CloseSession, CreateSession, ExtendSession,
    Marginals, MarginalsQuery, NextTouches, PageQuery, ReadingsAdded, ReadingsQuery, Session,
    SessionOrder, SessionPage, SessionState, SessionsQuery,
};
use uuid::Uuid;

use crate::client::Client;
use crate::error::Error;
use crate::history::detail_name;
use crate::objects::repeat_of;
use crate::request::Request;
use crate::retry::Repeat;

impl Client {
    /// Creates a session.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn create_session(&self, session: &CreateSession) -> Result<Session, Error> {
        self.send(Request::post(["v1", "sessions"]).json(session)).await
    }

    /// Returns a page of the sessions that fit the query.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn sessions(&self, query: &SessionsQuery) -> Result<SessionPage, Error> {
        let page = PageQuery { limit: query.limit, cursor: query.cursor.clone() };
        let state = query.state.map(|state| match state {
            SessionState::Open => "open",
            SessionState::Closed => "closed",
        });
        let order = query.order.map(|order| match order {
            SessionOrder::Oldest => "oldest",
            SessionOrder::Newest => "newest",
        });
        let request = Request::get(["v1", "sessions"])
            .page(&page)
            .query("state", state)
            .query("order", order)
            .query("catalogue", query.catalogue.as_ref())
            .query("method", query.method.map(|method| method.name()))
            .query("robot", query.robot.as_ref())
            .query("object", query.object.as_ref())
            .query("none_of_these", query.none_of_these)
            .query("with_truth", query.with_truth)
            .query("since", query.since.as_ref())
            .query("until", query.until.as_ref())
            .query("labels", query.labels.as_ref())
            .query("cell", query.cell.as_ref());
        self.send(request).await
    }

    /// Keeps a session open for `seconds` from now without new readings.
    ///
    /// # Errors
    /// [`Error`]; status 410 if it has ended.
    pub async fn extend_session(&self, id: Uuid, seconds: u32) -> Result<Session, Error> {
        let path = ["v1", "sessions", &id.to_string(), "lease"];
        let asked = ExtendSession { seconds };
        self.send(Request::post(path).json(&asked).repeat(Repeat::Harmless)).await
    }

    /// Returns a session.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn session(&self, id: Uuid) -> Result<Session, Error> {
        self.send(Request::get(["v1", "sessions", &id.to_string()])).await
    }

    /// Closes a session. Its belief can still be read.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn close_session(&self, id: Uuid) -> Result<Session, Error> {
        self.close_session_with(id, &CloseSession::default()).await
    }

    /// Closes a session and reports its true object, even after its end. The session's `truth`
    /// holds the result.
    ///
    /// # Errors
    /// [`Error`]; status 409 if another truth is already recorded.
    pub async fn close_session_with(
        &self,
        id: Uuid,
        truth: &CloseSession,
    ) -> Result<Session, Error> {
        let path = ["v1", "sessions", &id.to_string(), "close"];
        self.send(Request::post(path).json(truth).repeat(Repeat::Harmless)).await
    }

    /// Deletes a session with its readings.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn delete_session(&self, id: Uuid) -> Result<(), Error> {
        self.send_for_nothing(Request::delete(["v1", "sessions", &id.to_string()])).await
    }

    /// Adds 1 to 1000 readings and returns the belief after them. Retried after a lost connection
    /// only if every reading has `robot` and `seq`.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn add_readings(
        &self,
        session: Uuid,
        readings: &AddReadings,
        query: ReadingsQuery,
    ) -> Result<ReadingsAdded, Error> {
        let detail = query.belief.map(detail_name);
        let request = Request::post(["v1", "sessions", &session.to_string(), "readings"])
            .query("belief", detail)
            .json(readings)
            .repeat(repeat_of(&readings.readings));
        self.send(request).await
    }

    /// Returns the belief of a session, now or at revision `query.at`.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn belief(&self, session: Uuid, query: BeliefQuery) -> Result<Belief, Error> {
        let path = ["v1", "sessions", &session.to_string(), "belief"];
        self.send(Request::get(path).query("poses", query.poses).query("at", query.at)).await
    }

    /// Returns the marginals of an object's pose; of the likeliest object if `query` names none.
    ///
    /// # Errors
    /// [`Error`]; status 409 if the session's method has no pose distribution.
    pub async fn marginals(
        &self,
        session: Uuid,
        query: &MarginalsQuery,
    ) -> Result<Marginals, Error> {
        let path = ["v1", "sessions", &session.to_string(), "marginals"];
        self.send(Request::get(path).query("object", query.object.as_ref())).await
    }

    /// Ranks the next touches: the robot's candidates, or approaches that the service generates.
    ///
    /// # Errors
    /// [`Error`]; status 409 if the session's method cannot, or if there is neither a touch nor a
    /// workspace yet.
    pub async fn next_touches(
        &self,
        session: Uuid,
        question: &AskNextTouches,
    ) -> Result<NextTouches, Error> {
        let path = ["v1", "sessions", &session.to_string(), "next-touches"];
        self.send(Request::post(path).json(question).repeat(Repeat::Harmless)).await
    }
}
