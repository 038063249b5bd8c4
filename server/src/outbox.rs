//! The outbox of a cell: what a forwarder brings from this server to the central service, and what it
//! brings back.
//!
//! The forwarder sends over HTTP, which this crate does not do; it runs in the same process. It
//! takes waiting sessions from here, tells what became of them, and hands over versions and sensors.

use std::time::Duration;

use palpate_schemas as wire;
use palpate_store::catalogue::BlockEntry;
use palpate_store::catalogue::Manifest;
use thiserror::Error;
use uuid::Uuid;

use crate::app::App;
use crate::refusal::Refusal;
use crate::services::catalogues::packages;
use crate::services::sessions::OutgoingSession;

/// The outbox of a running server. Cheap to clone.
#[derive(Clone)]
pub struct Outbox(App);

/// Error of the cell's own server: its store is full or damaged, or it is overloaded.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct OutboxError(String);

impl From<Refusal> for OutboxError {
    fn from(refusal: Refusal) -> Self {
        Self(refusal.to_string())
    }
}

/// A waiting session, as it was when it was read.
#[derive(Clone, Debug)]
pub struct Outgoing {
    /// Its id.
    pub id: Uuid,
    session: OutgoingSession,
}

impl Outgoing {
    /// The request that creates it at the central service.
    #[must_use]
    pub fn request(&self) -> &wire::ForwardSession {
        &self.session.request
    }

    /// Number of its readings and retractions.
    #[must_use]
    pub fn n_entries(&self) -> u64 {
        self.session.n_entries
    }

    /// How to close it; `None` while it is open.
    #[must_use]
    pub fn closing(&self) -> Option<&wire::CloseSession> {
        self.session.closing.as_ref()
    }
}

/// A version of the central service that is being taken over.
#[derive(Clone, Debug)]
pub struct Incoming {
    name: String,
    manifest: Manifest,
    /// The blocks to fetch.
    missing: Vec<BlockEntry>,
}

impl Incoming {
    /// Hashes of the blocks to fetch, in hexadecimal.
    #[must_use]
    pub fn missing(&self) -> Vec<String> {
        self.missing.iter().map(|block| packages::hex(&block.hash)).collect()
    }
}

impl Outbox {
    pub(crate) fn new(app: App) -> Self {
        Self(app)
    }

    /// Waits for a change of a session, for at most a time.
    pub async fn changed(&self, at_most: Duration) {
        let _ = tokio::time::timeout(at_most, self.0.outgoing.wake.notified()).await;
    }

    /// Up to `limit` waiting sessions after `after`, oldest first.
    #[must_use]
    pub fn waiting(&self, after: Option<Uuid>, limit: usize) -> Vec<Uuid> {
        self.0.outgoing.page(after, limit)
    }

    /// A waiting session; `None` if it was deleted.
    ///
    /// # Errors
    /// [`OutboxError`].
    pub async fn session(&self, id: Uuid) -> Result<Option<Outgoing>, OutboxError> {
        let found = self.0.apart(move |app| app.sessions.outgoing(id)).await?;
        Ok(found.map(|session| Outgoing { id, session }))
    }

    /// Entries of a session from a number on, as many as one request takes.
    ///
    /// # Errors
    /// [`OutboxError`].
    pub async fn entries(
        &self,
        id: Uuid,
        from: u64,
    ) -> Result<Vec<wire::ForwardedEntry>, OutboxError> {
        Ok(self.0.apart(move |app| app.sessions.outgoing_entries(id, from)).await?)
    }

    /// Notes how many entries of a session still wait.
    pub fn still_waits(&self, id: Uuid, n_entries: u64) {
        self.0.outgoing.still_waits(id, n_entries);
    }

    /// Notes that all of a session is at the central service; of an ended one durably.
    ///
    /// # Errors
    /// [`OutboxError`].
    pub async fn forwarded(&self, sent: &Outgoing) -> Result<(), OutboxError> {
        let noted = self.0.sessions.note_forwarded(sent.id, &sent.session).await;
        noted.map_err(|error| Refusal::from(error).into())
    }

    /// Notes that the central service refused a session.
    pub fn refused(&self, id: Uuid, reason: String) {
        self.0.outgoing.refused(id, reason);
    }

    /// Notes an answer of the central service.
    pub fn answered(&self) {
        self.0.outgoing.answered();
    }

    /// Notes that the central service cannot be used; whether it could until now.
    #[must_use]
    pub fn failed(&self, error: String) -> bool {
        self.0.outgoing.failed(error)
    }

    /// The state of forwarding.
    #[must_use]
    pub fn state(&self) -> wire::Forwarding {
        self.0.outgoing.shown()
    }

    /// What to fetch of a version that is current at the central service; `None` if it is current
    /// here as well.
    ///
    /// # Errors
    /// [`OutboxError`], also for a package that this version of Palpate cannot read.
    pub async fn incoming(
        &self,
        package: &wire::VersionPackage,
    ) -> Result<Option<Incoming>, OutboxError> {
        let manifest = packages::unpacked(package).map_err(Refusal::from)?;
        let name = package.catalogue.clone();
        let found = self.0.apart(move |app| {
            if app.catalogues.is_current(&name, &manifest)? {
                return Ok::<_, Refusal>(None);
            }
            let missing = app.catalogues.missing_blocks(&manifest)?;
            Ok(Some(Incoming { name, manifest, missing }))
        });
        Ok(found.await?)
    }

    /// Stores the first missing block of a version.
    ///
    /// # Errors
    /// [`OutboxError`], also when the content does not have its hash.
    pub async fn block(&self, incoming: &mut Incoming, content: &[u8]) -> Result<(), OutboxError> {
        if let Some(block) = incoming.missing.first() {
            let adopted = self.0.catalogues.adopt_block(block, content).await;
            adopted.map_err(|error| OutboxError(error.to_string()))?;
            incoming.missing.remove(0);
        }
        Ok(())
    }

    /// Takes a version over whose blocks are there, and makes it current.
    ///
    /// # Errors
    /// [`OutboxError`].
    pub async fn adopt(&self, incoming: &Incoming) -> Result<(), OutboxError> {
        let adopted = self.0.catalogues.adopt(&incoming.name, &incoming.manifest).await;
        adopted.map_err(|error| OutboxError(error.to_string()))
    }

    /// Notes the current version of a catalogue at the central service, and what is wrong, if
    /// anything is.
    pub fn followed(&self, name: &str, current_there: Option<u32>, problem: Option<String>) {
        let current_here = self.0.catalogues.current(name).ok().flatten();
        let name = name.to_owned();
        let followed = wire::FollowedCatalogue { name, current_there, current_here, problem };
        self.0.outgoing.catalogue(followed);
    }

    /// Takes a sensor over with its calibrations, and notes how it differs, if it does.
    ///
    /// # Errors
    /// [`OutboxError`].
    pub async fn sensor(&self, package: &wire::SensorPackage) -> Result<(), OutboxError> {
        let adopted = self.0.sensors.adopt(package).await;
        let problem = adopted.map_err(|error| OutboxError(error.to_string()))?;
        self.0.outgoing.sensor(&package.name, problem);
        Ok(())
    }
}
