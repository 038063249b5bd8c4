//! Checking a whole database: every record for itself, and whether they fit together.
//!
//! Pairs come in ascending order of their keys, from an engine or a snapshot, and are looked at
//! once; what is kept of them is small (ids, counts, hashes), so memory does not grow with the
//! size of models. `records` puts pieces together and opens them, `relations` knows what names
//! what. Damage is what users miss; leftovers are what a crash leaves, and harmless.

mod records;
mod relations;

use std::collections::BTreeMap;

use thiserror::Error;

use crate::engine::{Engine, EngineError, Pair};
use crate::pieces;
use records::Assembly;
use relations::Relations;

/// No more findings are kept; the rest is counted.
pub const FINDINGS_MAX: usize = 1000;
/// How many pairs are read at once.
const PAIRS_PER_READ: usize = 1024;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Something that users stored is not whole.
    Damage,
    /// Something that nobody names, as a crash leaves it: harmless, and may be removed.
    Leftover,
}

/// Something that is not as it should be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// What kind of record, such as `journal entry`.
    pub space: &'static str,
    /// Its key in words, such as `session 0198… entry 7`.
    pub key: String,
    /// What is wrong.
    pub fault: String,
    /// What users notice.
    pub means: &'static str,
}

/// What a check found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// The number of the layout, if its record is whole.
    pub layout: Option<u32>,
    /// How many records there are of each kind.
    pub records: BTreeMap<&'static str, u64>,
    /// The first [`FINDINGS_MAX`] findings.
    pub findings: Vec<Finding>,
    /// How many of all findings are damage.
    pub n_damaged: u64,
    /// How many of all findings are leftovers.
    pub n_leftovers: u64,
    /// Versions that cannot be recognised with: catalogue, number, and why.
    pub damaged_versions: Vec<(uuid::Uuid, u32, String)>,
    /// Keys under which leftovers lie.
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

/// A check under way.
#[derive(Default)]
pub struct Checker {
    report: Report,
    assembly: Assembly,
    relations: Relations,
}

impl Checker {
    /// Looks at the next pair; keys ascend.
    pub fn pair(&mut self, key: &[u8], value: &[u8]) {
        self.assembly.pair(key, value, &mut self.relations, &mut self.report);
    }

    /// What was found, when there are no more pairs.
    #[must_use]
    pub fn finish(mut self) -> Report {
        self.assembly.end(&mut self.relations, &mut self.report);
        self.relations.end(&mut self.report);
        self.report
    }
}

/// Why leftovers were not removed.
#[derive(Debug, Error)]
pub enum CollectError {
    /// Something is damaged, and what it named cannot be told from what nobody names.
    #[error("{n_damaged} records are damaged: what they name is not known, so nothing is removed")]
    Damaged {
        /// How many.
        n_damaged: u64,
    },
    /// The engine failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

/// Checks all that an engine holds. Blocks. Nobody may write meanwhile, else what is written
/// looks torn.
///
/// # Errors
/// The engine's.
pub fn check(engine: &dyn Engine) -> Result<Report, EngineError> {
    let mut checker = Checker::default();
    let mut after: Option<Vec<u8>> = None;
    loop {
        let page: Vec<Pair> = engine.scan(&[], after.as_deref(), PAIRS_PER_READ)?;
        for (key, value) in &page {
            checker.pair(key, value);
        }
        match page.into_iter().last() {
            Some((last, _)) => after = Some(last),
            None => return Ok(checker.finish()),
        }
    }
}

/// Removes the leftovers of a report.
///
/// # Errors
/// [`CollectError`]; nothing is removed where something is damaged.
pub async fn collect(engine: &dyn Engine, report: &Report) -> Result<u64, CollectError> {
    if report.n_damaged > 0 {
        return Err(CollectError::Damaged { n_damaged: report.n_damaged });
    }
    for key in &report.leftovers {
        pieces::remove_all(engine, key).await?;
    }
    Ok(report.leftovers.len() as u64)
}
