//! Forwarding: what a cell brings to the central service, and what it fetches from there.

use palpate_schemas::{
    EntriesForwarded, ForwardEntries, ForwardSession, Forwarding, PageQuery, SensorPackage,
    Session, VersionPackage,
};
use uuid::Uuid;

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;
use crate::retry::Repeat;

impl Client {
    /// Creates a session of a cell under its id, or finds it.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn forward_session(
        &self,
        id: Uuid,
        session: &ForwardSession,
    ) -> Result<Session, Error> {
        self.send(Request::put(["v1", "sessions", &id.to_string()]).json(session)).await
    }

    /// Appends entries of a cell's session, each once.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn forward_entries(
        &self,
        session: Uuid,
        entries: &ForwardEntries,
    ) -> Result<EntriesForwarded, Error> {
        let path = ["v1", "sessions", &session.to_string(), "forwarded"];
        self.send(Request::post(path).json(entries).repeat(Repeat::Harmless)).await
    }

    /// Returns what a server has to forward, and the state of its line.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn forwarding(&self) -> Result<Forwarding, Error> {
        self.send(Request::get(["v1", "forwarding"])).await
    }

    /// Returns a version as a package.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn version_package(
        &self,
        catalogue: &str,
        version: u32,
    ) -> Result<VersionPackage, Error> {
        let version = version.to_string();
        self.send(Request::get(["v1", "catalogues", catalogue, "versions", &version, "package"]))
            .await
    }

    /// Returns a block of a version.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn version_block(
        &self,
        catalogue: &str,
        version: u32,
        hash: &str,
    ) -> Result<Vec<u8>, Error> {
        let version = version.to_string();
        let path = ["v1", "catalogues", catalogue, "versions", &version, "blocks", hash];
        self.send_for_file(Request::get(path)).await
    }

    /// Returns a sensor with a page of its calibrations as a package.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn sensor_package(
        &self,
        sensor: &str,
        page: &PageQuery,
    ) -> Result<SensorPackage, Error> {
        let request = Request::get(["v1", "sensors", sensor, "package"])
            .query("limit", page.limit)
            .query("cursor", page.cursor.as_deref());
        self.send(request).await
    }
}
