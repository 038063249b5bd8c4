//! The fleet: the open sessions, those that need attention first, and changes of many at once.

use palpate_schemas::{AcknowledgeSessions, CloseSessions, Fleet, FleetChanged, FleetQuery};

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;
use crate::retry::Repeat;

impl Client {
    /// Returns a page of the open sessions, those that need attention first.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn fleet(&self, query: &FleetQuery) -> Result<Fleet, Error> {
        let request = Request::get(["v1", "fleet"])
            .query("limit", query.limit)
            .query("cursor", query.cursor.as_deref())
            .query("needed", query.needed)
            .query("search", query.search.as_deref())
            .query("trace", query.trace);
        self.send(request).await
    }

    /// Records that somebody has seen the alarms of sessions, and mutes them if asked to.
    ///
    /// # Errors
    /// [`Error`]; what fails for one session is in its result.
    pub async fn acknowledge_sessions(
        &self,
        asked: &AcknowledgeSessions,
    ) -> Result<FleetChanged, Error> {
        let path = ["v1", "fleet", "acknowledgements"];
        self.send(Request::post(path).json(asked).repeat(Repeat::Harmless)).await
    }

    /// Closes sessions without stating their true objects.
    ///
    /// # Errors
    /// [`Error`]; what fails for one session is in its result.
    pub async fn close_sessions(&self, asked: &CloseSessions) -> Result<FleetChanged, Error> {
        let path = ["v1", "fleet", "closings"];
        self.send(Request::post(path).json(asked).repeat(Repeat::Harmless)).await
    }
}
