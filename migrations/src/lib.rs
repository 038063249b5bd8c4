//! Upgrades of the stored layout: one numbered, frozen file for each change of it.
//!
//! A migration knows keys as bytes and the envelope, never today's records: the forms that it
//! reads and writes stay as they were when it was released. It writes in small commits, each
//! of which leaves a database from which it can resume, and the layout's number last. It runs
//! while the database's lock is held, so there is no other writer. Not here: downgrades. An
//! older Palpate refuses a newer layout.

mod layout;
mod m0002_journal_entries;
mod raw;

use palpate_store::engine::{CommitError, Engine, EngineError};
use palpate_store::envelope::EnvelopeError;
use thiserror::Error;

pub use layout::layout;

/// One change of the layout.
struct Migration {
    /// The layout that it produces, from the one before.
    to: u32,
    /// Description for the log.
    what: &'static str,
    run: fn(&dyn Engine) -> Result<u64, MigrateError>,
}

/// All migrations, in order. Layout 1 was the first.
const MIGRATIONS: [Migration; 1] = [Migration {
    to: 2,
    what: "journal entries of schemas 1 to 3 become schema 4",
    run: m0002_journal_entries::run,
}];

/// The layout that [`migrate`] produces.
pub const NEWEST: u32 = MIGRATIONS[MIGRATIONS.len() - 1].to;

/// Result of a migration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Migrated {
    /// Layout before.
    pub from: u32,
    /// Layout after.
    pub to: u32,
    /// Number of records rewritten.
    pub n_records: u64,
}

/// Error of an incomplete migration. Completed commits stay, and it can be run again.
#[derive(Debug, Error)]
pub enum MigrateError {
    /// There is data but no layout number.
    #[error("the database has data but no layout number: it is damaged or not Palpate's")]
    NoLayout,
    /// The database was written by a newer Palpate.
    #[error(
        "the database has layout {found}, this version of Palpate knows up to {NEWEST}: use a \
         newer version"
    )]
    TooNew {
        /// The database's layout.
        found: u32,
    },
    /// A record is damaged.
    #[error("the record under key {key} is damaged: {source}")]
    Damaged {
        /// Its key in hexadecimal.
        key: String,
        /// The fault.
        source: EnvelopeError,
    },
    /// A record is undamaged but not of the expected form.
    #[error("the record under key {key} cannot be understood as schema {schema}")]
    Unreadable {
        /// Its key in hexadecimal.
        key: String,
        /// Its schema.
        schema: u16,
    },
    /// Another writer changed the database at the same time.
    #[error("the database was written by someone else at the same time")]
    Changed,
    /// The engine failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

impl From<CommitError> for MigrateError {
    fn from(error: CommitError) -> Self {
        match error {
            CommitError::Conflict { .. } => Self::Changed,
            CommitError::Engine(error) => Self::Engine(error),
        }
    }
}

/// Migrates a database to the newest layout. Does nothing to an empty database or one that
/// has it. Blocks.
///
/// # Errors
/// [`MigrateError`]; a repeated call resumes.
pub fn migrate(engine: &dyn Engine) -> Result<Migrated, MigrateError> {
    let Some(from) = layout(engine)? else {
        return Ok(Migrated { from: NEWEST, to: NEWEST, n_records: 0 });
    };
    if from > NEWEST {
        return Err(MigrateError::TooNew { found: from });
    }
    let mut n_records = 0;
    for migration in MIGRATIONS.iter().filter(|migration| migration.to > from) {
        let Migration { to, what, run } = migration;
        tracing::info!("Migrating the database to layout {to}: {what}");
        n_records += run(engine)?;
        layout::set(engine, *to)?;
    }
    Ok(Migrated { from, to: NEWEST, n_records })
}
