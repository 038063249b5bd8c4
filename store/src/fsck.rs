//! Check of a whole database: each record, and the relations between records.
//!
//! Pairs come in ascending order of their keys, from an engine or a snapshot, and are visited
//! once; only ids, counts and hashes are kept, so memory does not grow with the size of
//! models. `records` assembles and opens records, `relations` knows the references between
//! them. Damage is lost data; leftovers are harmless traces of a crash.

mod records;
mod relations;

use std::collections::BTreeMap;

use thiserror::Error;

use crate::engine::{self, Engine, EngineError};
use crate::pieces;
use records::{Assembly, Value};
use relations::Relations;

/// Maximum number of findings kept; further ones are only counted.
pub const FINDINGS_MAX: usize = 1000;
/// Number of pairs per read.
const PAIRS_PER_READ: usize = 1024;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Stored data is damaged or missing.
    Damage,
    /// An unreferenced record, as after a crash: harmless, and removable.
    Leftover,
}

/// A fault in the database.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Severity.
    pub severity: Severity,
    /// Kind of the record, such as `journal entry`.
    pub space: &'static str,
    /// The key in words, such as `session 0198… entry 7`.
    pub key: String,
    /// The fault.
    pub fault: String,
    /// Consequence for users.
    pub means: &'static str,
}

/// Result of a check.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// The layout number, if its record is undamaged.
    pub layout: Option<u32>,
    /// Number of records of each kind.
    pub records: BTreeMap<&'static str, u64>,
    /// The first [`FINDINGS_MAX`] findings.
    pub findings: Vec<Finding>,
    /// Number of damage findings.
    pub n_damaged: u64,
    /// Number of leftover findings.
    pub n_leftovers: u64,
    /// Unusable versions: catalogue, number, and reason.
    pub damaged_versions: Vec<(uuid::Uuid, u32, String)>,
    /// Keys of leftovers.
    leftovers: Vec<Vec<u8>>,
}

impl Report {
    fn add(&mut self, finding: Finding) {
        match finding.severity {
            Severity::Damage => self.n_damaged += 1,
            Severity::Leftover => self.n_leftovers += 1,
        }
        if self.findings.len() < FINDINGS_MAX {
            self.findings.push(finding);
        }
    }
}

/// A check in progress.
#[derive(Default)]
pub struct Checker {
    report: Report,
    assembly: Assembly,
    relations: Relations,
}

impl Checker {
    /// Visits the next pair; keys ascend.
    pub fn pair(&mut self, key: &[u8], value: &[u8]) {
        self.assembly.pair(key, &Value::Read(value), &mut self.relations, &mut self.report);
    }

    /// Visits the next key, whose value of this length is large content that was not read: its
    /// presence and its length are checked.
    pub fn elsewhere(&mut self, key: &[u8], length: usize) {
        let value = Value::Elsewhere(length);
        self.assembly.pair(key, &value, &mut self.relations, &mut self.report);
    }

    /// Completes the check after the last pair.
    #[must_use]
    pub fn finish(mut self) -> Report {
        self.assembly.end(&mut self.relations, &mut self.report);
        self.relations.end(&mut self.report);
        self.report
    }
}

/// Error of leftovers that were not removed.
#[derive(Debug, Error)]
pub enum CollectError {
    /// Damage prevents the search for unreferenced records.
    #[error("{n_damaged} records are damaged: what they name is not known, so nothing is removed")]
    Damaged {
        /// Number of damage findings.
        n_damaged: u64,
    },
    /// The engine failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

/// Checks all pairs of an engine. Blocks. Concurrent writes would look torn, so there must be
/// none.
///
/// # Errors
/// The engine's.
pub fn check(engine: &dyn Engine) -> Result<Report, EngineError> {
    let mut checker = Checker::default();
    for page in engine::pages(engine, &[], None, PAIRS_PER_READ) {
        for (key, value) in &page? {
            checker.pair(key, value);
        }
    }
    Ok(checker.finish())
}

/// Removes the leftovers of a report.
///
/// # Errors
/// [`CollectError`]; nothing is removed if there is damage.
pub async fn collect(engine: &dyn Engine, report: &Report) -> Result<u64, CollectError> {
    if report.n_damaged > 0 {
        return Err(CollectError::Damaged { n_damaged: report.n_damaged });
    }
    for key in &report.leftovers {
        pieces::remove_all(engine, key).await?;
    }
    Ok(report.leftovers.len() as u64)
}
