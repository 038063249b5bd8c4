//! The database: opened once, with all its repositories.

mod clock;
mod sharing;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use thiserror::Error;
use uuid::Uuid;

use crate::access::AccessKey;
use crate::amended::Amended;
use crate::audit::{AuditLog, RingSizes};
use crate::calibration::Calibrations;
use crate::catalogue::Catalogues;
use crate::engine::opening::OpenError;
use crate::engine::{
    Commit, CommitError, Compacted, Cut, Engine, EngineError, EngineStats, Expected,
};
use crate::entity::{Job, Object, Sensor, Session};
use crate::error::{RecordError, StoreError};
use crate::holding::{self, Holding, Who};
use crate::journal::{Journal, JournalSpaces};
use crate::key::{self, Space};
use crate::memory::MemoryEngine;
use crate::mesh::Meshes;
use crate::pieces;
use crate::record::{self, LayoutV1};
use crate::robot::RobotHolders;
use crate::running::Runs;
use crate::sensor_day::SensorDays;
use crate::table::Table;
use crate::webhook::{Deliveries, Webhook};

/// The layout of keys and records in this version of Palpate.
pub const LAYOUT: u32 = 2;

/// The whole database. Cheap to clone.
#[derive(Clone)]
pub struct Database {
    engine: Arc<dyn Engine>,
    runs: Arc<Mutex<Runs>>,
}

/// Error of a database that could not be opened.
#[derive(Debug, Error)]
pub enum DatabaseError {
    /// The engine could not be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The database was written by a newer Palpate.
    #[error(
        "the database has layout {found} (made by {made_by}), this version of Palpate \
         knows up to {LAYOUT}: use a newer version"
    )]
    TooNew {
        /// The database's layout.
        found: u32,
        /// Its creator.
        made_by: String,
    },
    /// The database was written by an older Palpate and must be migrated.
    #[error(
        "the database has layout {found}, this version of Palpate needs {LAYOUT}: \
         take a copy of the folder, then migrate it: `palpate migrate --data DIR`, or start with \
         `--migrate`"
    )]
    TooOld {
        /// The database's layout.
        found: u32,
    },
    /// There is data but no layout number.
    #[error("the database has data but no layout number: it is damaged or not Palpate's")]
    NoLayout,
    /// The layout record is damaged.
    #[error("the database's layout record is damaged: {source}")]
    Damaged {
        /// The fault.
        #[from]
        source: RecordError,
    },
    /// The engine failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

impl Database {
    /// A database in memory, lost with the process.
    ///
    /// # Panics
    /// Never: an empty memory engine does not fail.
    #[must_use]
    pub fn in_memory() -> Self {
        Self::with_engine(Arc::new(MemoryEngine::new())).expect("an empty engine does not fail")
    }

    /// The database of an engine; an empty one gets today's layout number. Blocks.
    ///
    /// # Errors
    /// [`DatabaseError`] unless the engine has today's layout.
    pub fn with_engine(engine: Arc<dyn Engine>) -> Result<Self, DatabaseError> {
        let head = key::space(Space::Layout);
        if let Some(bytes) = engine.get(&head)? {
            let LayoutV1 { layout: found, made_by } = record::decode(&bytes)?;
            return match found {
                LAYOUT => Ok(Self::running_from(engine)),
                newer if newer > LAYOUT => Err(DatabaseError::TooNew { found, made_by }),
                _ => Err(DatabaseError::TooOld { found }),
            };
        }
        if !engine.scan(&[], None, 1)?.is_empty() {
            return Err(DatabaseError::NoLayout);
        }
        let made_by = concat!("palpate ", env!("CARGO_PKG_VERSION")).to_owned();
        let layout = record::encode(&LayoutV1 { layout: LAYOUT, made_by });
        let commit = Commit::new().expect(head.clone(), Expected::Absent).put(head, layout);
        match engine.commit(commit).wait() {
            Ok(()) => Ok(Self::running_from(engine)),
            Err(CommitError::Conflict { .. }) => Self::with_engine(engine),
            Err(CommitError::Engine(error)) => Err(error.into()),
        }
    }

    /// A handle to the same database for operations that must work on a full disk: its writes
    /// may use the last of the reserve.
    #[must_use]
    pub fn essential(&self) -> Self {
        let engine = Arc::new(Amended::essential(Arc::clone(&self.engine)));
        Self { engine, runs: Arc::clone(&self.runs) }
    }

    /// The same database, whose commits count to the account that `who` names at the time.
    #[must_use]
    pub fn with_accounts(self, who: Who) -> Self {
        Self { engine: Arc::new(Amended::accounted(self.engine, who)), ..self }
    }

    /// Bytes that each API key holds; the nil id for writes without a key.
    #[must_use]
    pub fn held(&self) -> BTreeMap<Uuid, u64> {
        self.engine.held()
    }

    /// Shows what each key holds of each thing to `look`. Blocks, for the longer the more things
    /// there are.
    ///
    /// # Errors
    /// The engine's.
    pub fn holdings(&self, look: impl FnMut(Holding)) -> Result<(), EngineError> {
        holding::each(&*self.engine, look)
    }

    /// The key that asked for a job, where that was counted.
    ///
    /// # Errors
    /// The engine's.
    pub fn job_writer(&self, job: Uuid) -> Result<Option<Uuid>, EngineError> {
        holding::writer_of(&*self.engine, &key::id(Space::Job, job))
    }

    /// All sensors.
    #[must_use]
    pub fn sensors(&self) -> Table<Sensor> {
        Table::new(Arc::clone(&self.engine))
    }

    /// The calibrations of sensors.
    #[must_use]
    pub fn calibrations(&self) -> Calibrations {
        Calibrations::new(Arc::clone(&self.engine))
    }

    /// What sessions say about sensors, by day.
    #[must_use]
    pub fn sensor_days(&self) -> SensorDays {
        SensorDays::new(Arc::clone(&self.engine))
    }

    /// All objects. Remove one with [`Database::remove_object`].
    #[must_use]
    pub fn objects(&self) -> Table<Object> {
        Table::new(Arc::clone(&self.engine))
    }

    /// The meshes of objects.
    #[must_use]
    pub fn meshes(&self) -> Meshes {
        Meshes::new(Arc::clone(&self.engine))
    }

    /// The training readings of objects, by object id.
    #[must_use]
    pub fn training(&self) -> Journal {
        let spaces = JournalSpaces {
            head: Space::TrainingHead,
            entries: Space::Training,
            robots: Space::TrainingRobot,
            retractions: None,
        };
        Journal::new(Arc::clone(&self.engine), spaces)
    }

    /// All jobs.
    #[must_use]
    pub fn jobs(&self) -> Table<Job> {
        Table::new(Arc::clone(&self.engine))
    }

    /// All catalogues.
    #[must_use]
    pub fn catalogues(&self) -> Catalogues {
        Catalogues::new(Arc::clone(&self.engine))
    }

    /// All sessions. Remove one with [`Database::remove_session`].
    #[must_use]
    pub fn sessions(&self) -> Table<Session> {
        Table::new(Arc::clone(&self.engine))
    }

    /// The journals of sessions, by session id.
    #[must_use]
    pub fn journal(&self) -> Journal {
        let spaces = JournalSpaces {
            head: Space::JournalHead,
            entries: Space::Journal,
            robots: Space::JournalRobot,
            retractions: Some(Space::JournalRetraction),
        };
        Journal::new(Arc::clone(&self.engine), spaces)
    }

    /// All API keys.
    #[must_use]
    pub fn keys(&self) -> Table<AccessKey> {
        Table::new(Arc::clone(&self.engine))
    }

    /// All webhooks.
    #[must_use]
    pub fn webhooks(&self) -> Table<Webhook> {
        Table::new(Arc::clone(&self.engine))
    }

    /// The deliveries of events to webhooks.
    #[must_use]
    pub fn deliveries(&self) -> Deliveries {
        Deliveries::new(Arc::clone(&self.engine))
    }

    /// Waits until reads see what other servers committed before this call.
    ///
    /// # Errors
    /// The engine's.
    pub async fn catch_up(&self) -> Result<(), EngineError> {
        self.engine.catch_up().await
    }

    /// The names of robots and the keys that own them.
    #[must_use]
    pub fn robots(&self) -> RobotHolders {
        RobotHolders::new(Arc::clone(&self.engine))
    }

    /// The audit log; each ring keeps the given number of its newest entries. Entries of
    /// essential operations are written on a full disk too. Open it once. Blocks.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub fn audit(
        &self,
        sizes: RingSizes,
        is_essential: fn(&str) -> bool,
    ) -> Result<AuditLog, StoreError> {
        AuditLog::open(Arc::clone(&self.engine), sizes, is_essential)
    }

    /// Removes an object, then its mesh and training readings; `false` when there was none.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub async fn remove_object(&self, id: Uuid) -> Result<bool, StoreError> {
        let removed = self.objects().remove(id).await?;
        self.meshes().remove(id).await?;
        self.training().remove(id).await?;
        for space in [Space::Object, Space::MeshFile, Space::Training] {
            holding::release(&*self.engine, &key::id(space, id)).await?;
        }
        Ok(removed)
    }

    /// Removes a session, then its journal; `false` when there was none.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub async fn remove_session(&self, id: Uuid) -> Result<bool, StoreError> {
        let removed = self.sessions().remove(id).await?;
        self.journal().remove(id).await?;
        holding::release(&*self.engine, &key::id(Space::Session, id)).await?;
        Ok(removed)
    }

    /// Removes a sensor, then its calibrations and days; `false` when there was none.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] and the engine's.
    pub async fn remove_sensor(&self, id: Uuid) -> Result<bool, StoreError> {
        let removed = self.sensors().remove(id).await?;
        for space in [Space::Calibration, Space::SensorDay] {
            pieces::remove_all(&*self.engine, &key::id(space, id)).await?;
        }
        holding::release(&*self.engine, &key::id(Space::Sensor, id)).await?;
        Ok(removed)
    }

    /// The database at this moment, readable during later writes. Blocks.
    ///
    /// # Errors
    /// The engine's.
    pub fn cut(&self) -> Result<Box<dyn Cut>, EngineError> {
        self.engine.cut()
    }

    /// Frees the space of removed and replaced records. Blocks.
    ///
    /// # Errors
    /// The engine's.
    pub fn compact(&self) -> Result<Compacted, EngineError> {
        self.engine.compact()
    }

    /// Statistics of the engine.
    ///
    /// # Errors
    /// The engine's.
    pub fn stats(&self) -> Result<EngineStats, EngineError> {
        self.engine.stats()
    }
}
