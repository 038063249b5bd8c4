//! Calls about sessions: readings in, beliefs out.

use palpate_schemas::{
    AddReadings, AskNextTouches, Belief, BeliefQuery, CloseSession, CreateSession, ExtendSession,
    Marginals, MarginalsQuery, NextTouches, PageQuery, ReadingsAdded, ReadingsQuery, Session,
    SessionPage, SessionState, SessionsQuery,
};
use uuid::Uuid;

use crate::client::Client;
use crate::error::Error;
use crate::history::detail_name;
use crate::objects::repeat_of;
use crate::request::Request;
use crate::retry::Repeat;

impl Client {
    /// Begins a session.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn create_session(&self, session: &CreateSession) -> Result<Session, Error> {
        self.send(Request::post(["v1", "sessions"]).json(session)).await
    }

    /// A page of the sessions.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn sessions(&self, query: &SessionsQuery) -> Result<SessionPage, Error> {
        let page = PageQuery { limit: query.limit, cursor: query.cursor.clone() };
        let state = query.state.map(|state| match state {
            SessionState::Open => "open",
            SessionState::Closed => "closed",
        });
        self.send(Request::get(["v1", "sessions"]).page(&page).query("state", state)).await
    }

    /// Keeps a session open for so many seconds from now on, though nothing comes.
    ///
    /// # Errors
    /// [`Error`]; status 410 when it has ended.
    pub async fn extend_session(&self, id: Uuid, seconds: u32) -> Result<Session, Error> {
        let path = ["v1", "sessions", &id.to_string(), "lease"];
        let asked = ExtendSession { seconds };
        self.send(Request::post(path).json(&asked).repeat(Repeat::Harmless)).await
    }

    /// A session.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn session(&self, id: Uuid) -> Result<Session, Error> {
        self.send(Request::get(["v1", "sessions", &id.to_string()])).await
    }

    /// Closes a session; its belief can still be read.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn close_session(&self, id: Uuid) -> Result<Session, Error> {
        self.close_session_with(id, &CloseSession::default()).await
    }

    /// Closes a session, also one that has ended, and says what its object was: the session's
    /// `truth` tells how right its belief was.
    ///
    /// # Errors
    /// [`Error`]; status 409 when something else was said before.
    pub async fn close_session_with(
        &self,
        id: Uuid,
        truth: &CloseSession,
    ) -> Result<Session, Error> {
        let path = ["v1", "sessions", &id.to_string(), "close"];
        self.send(Request::post(path).json(truth).repeat(Repeat::Harmless)).await
    }

    /// Removes a session with its readings.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn delete_session(&self, id: Uuid) -> Result<(), Error> {
        self.send_for_nothing(Request::delete(["v1", "sessions", &id.to_string()])).await
    }

    /// Adds 1 to 1000 readings and answers the belief after them. Repeated after a lost
    /// connection only if every reading has its robot's number.
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

    /// What is known of a session's object, or was at its revision `query.at`.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn belief(&self, session: Uuid, query: BeliefQuery) -> Result<Belief, Error> {
        let path = ["v1", "sessions", &session.to_string(), "belief"];
        self.send(Request::get(path).query("poses", query.poses).query("at", query.at)).await
    }

    /// How probable each value of each coordinate of an object's pose is; of the likeliest
    /// object if `query` names none.
    ///
    /// # Errors
    /// [`Error`]; status 409 when the session's method keeps no probabilities of poses.
    pub async fn marginals(
        &self,
        session: Uuid,
        query: &MarginalsQuery,
    ) -> Result<Marginals, Error> {
        let path = ["v1", "sessions", &session.to_string(), "marginals"];
        self.send(Request::get(path).query("object", query.object.as_ref())).await
    }

    /// Where to touch next: the robot's candidates, or the service's own, best first.
    ///
    /// # Errors
    /// [`Error`]; status 409 when the session's method does not say, or nothing was touched
    /// yet and no workspace is given.
    pub async fn next_touches(
        &self,
        session: Uuid,
        question: &AskNextTouches,
    ) -> Result<NextTouches, Error> {
        let path = ["v1", "sessions", &session.to_string(), "next-touches"];
        self.send(Request::post(path).json(question).repeat(Repeat::Harmless)).await
    }
}
