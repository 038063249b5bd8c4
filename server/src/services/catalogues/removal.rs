//! Removal of unneeded versions and catalogues.
//!
//! A version is needed while it is current or has an alias, while a session that began with it is kept (its
//! belief must be replayable), and while an unfinished job extends, recalibrates or compares it. An operation that
//! starts to use a version read-locks `using` from the look-up until its record is stored; a
//! removal write-locks it, so that no operation starts to need the removed version.

use palpate_store::catalogue::Catalogue;
use palpate_store::entity::{Job, Session};

use super::{CatalogueError, Catalogues, number};
use crate::cause::Cause;
use crate::wire::recalibration::JobRequest;

impl Catalogues {
    /// Read-locked while an operation starts to need a version.
    pub(crate) async fn using(&self) -> tokio::sync::RwLockReadGuard<'_, ()> {
        self.using.read().await
    }

    /// Removes a version that is not needed.
    pub(crate) async fn remove_version(
        &self,
        name: &str,
        version: &str,
    ) -> Result<(), CatalogueError> {
        let (_unused, _alone) = (self.using.write().await, self.alone().await?);
        let catalogue = self.find(name)?;
        let version = self.manifest(&catalogue, number(version)?)?.version;
        let what = format!("version {version} of catalogue {name:?}");
        if catalogue.current == Some(version) {
            let by = "new sessions use it: make another version current first".to_owned();
            return Err(Cause::Needed { what, by }.into());
        }
        if let Some((alias, _)) = catalogue.aliases.iter().find(|(_, named)| **named == version) {
            let by = format!("the alias {alias:?} names it: let it name another version first");
            return Err(Cause::Needed { what, by }.into());
        }
        self.expect_unused(&what, &catalogue, Some(version))?;
        self.removing.remove_version(catalogue.id, version).await?;
        self.damaged.remove(&(catalogue.id, version));
        tracing::info!(catalogue.id = %catalogue.id, version, "Removed {what}");
        Ok(())
    }

    /// Removes a catalogue that is not needed, with all its versions.
    pub(crate) async fn remove(&self, name: &str) -> Result<(), Cause> {
        let (_unused, _alone) = (self.using.write().await, self.alone().await?);
        let catalogue = self.find(name)?;
        let what = format!("catalogue {name:?}");
        self.expect_unused(&what, &catalogue, None)?;
        self.removing.remove(catalogue.id).await?;
        self.damaged.retain(|(id, _), _| *id != catalogue.id);
        tracing::info!(catalogue.id = %catalogue.id, "Removed {what}");
        Ok(())
    }

    /// Refuses if sessions or trainings need a version, or any version of a catalogue.
    fn expect_unused(
        &self,
        what: &str,
        catalogue: &Catalogue,
        version: Option<u32>,
    ) -> Result<(), Cause> {
        let needed = |by: String| Err(Cause::Needed { what: what.to_owned(), by });
        let uses = |session: &Session| {
            session.catalogue == catalogue.id && version.is_none_or(|v| v == session.version)
        };
        let (mut first, mut n, mut after) = (None, 0, None);
        loop {
            let page = self.store.sessions().list_whole(after, SESSIONS_PER_PAGE)?;
            for session in page.items.iter().filter(|session| uses(session)) {
                n += 1;
                first.get_or_insert(session.id);
            }
            after = page.next;
            if after.is_none() {
                break;
            }
        }
        if let Some(first) = first {
            let sessions = if n == 1 { "session" } else { "sessions" };
            return needed(format!(
                "{n} {sessions} began with it, first {first}: delete them first"
            ));
        }
        let jobs = self.store.jobs().list_whole(None, usize::MAX - 1)?.items;
        let trains = |job: &&Job| !job.state.is_final() && job.catalogue == catalogue.name;
        let extends = |job: &&Job| {
            version.is_none_or(|version| {
                let asked = serde_json::from_str::<JobRequest>(&job.request);
                asked.is_ok_and(|asked| asked.needs(version))
            })
        };
        match jobs.iter().filter(trains).find(extends) {
            Some(job) => needed(format!("job {} needs it: cancel it first", job.id)),
            None => Ok(()),
        }
    }
}

/// Number of sessions per read.
const SESSIONS_PER_PAGE: usize = 256;
