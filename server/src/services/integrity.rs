//! Checks all records once after every start, while the service serves: damaged versions are
//! kept from being recognised with, and everything else that is damaged is said in the log.
//!
//! The engine has already held what is there against what was written last. What is found here
//! was damaged before it was written, or accepted by `palpate fsck --accept`.

use std::sync::Arc;

use palpate_store::database::Database;
use palpate_store::engine::EngineError;
use palpate_store::fsck::{Checker, Report, Severity};
use tokio::sync::watch;

use crate::services::catalogues::Catalogues;

/// How many pairs are read at once.
const PAIRS_PER_READ: usize = 1024;
/// How many damaged records are named in the log; the count has all.
const NAMED_MAX: usize = 20;

/// Starts the check on a thread of its own; it ends when the server stops.
///
/// # Errors
/// What the operating system says when it gives no thread.
pub(crate) fn check(
    store: Database,
    catalogues: Arc<Catalogues>,
    stopping: watch::Receiver<bool>,
) -> std::io::Result<()> {
    let checking = move || match report(&store, &stopping) {
        Ok(Some(report)) => tell(&report, &catalogues),
        Ok(None) => {}
        Err(error) => tracing::error!(%error, "Cannot check the database: {error}"),
    };
    std::thread::Builder::new().name("integrity".to_owned()).spawn(checking).map(drop)
}

/// What a check of the database as it is now finds; `None` when the server stops before.
fn report(
    store: &Database,
    stopping: &watch::Receiver<bool>,
) -> Result<Option<Report>, EngineError> {
    let mut cut = store.cut()?;
    let mut checker = Checker::default();
    loop {
        if *stopping.borrow() {
            return Ok(None);
        }
        let page = cut.next(PAIRS_PER_READ)?;
        if page.is_empty() {
            return Ok(Some(checker.finish()));
        }
        page.iter().for_each(|(key, value)| checker.pair(key, value));
    }
}

fn tell(report: &Report, catalogues: &Catalogues) {
    metrics::gauge!("palpate_records_damaged").set(report.n_damaged as f64);
    let damaged = report.findings.iter().filter(|finding| finding.severity == Severity::Damage);
    for finding in damaged.take(NAMED_MAX) {
        let (space, key) = (finding.space, &finding.key);
        tracing::error!("Damaged {space} {key}: {}; {}", finding.fault, finding.means);
    }
    for (catalogue, version, reason) in &report.damaged_versions {
        catalogues.quarantine(*catalogue, *version, reason.clone());
    }
    let (n_damaged, n_leftovers) = (report.n_damaged, report.n_leftovers);
    tracing::info!("Checked all records: {n_damaged} damaged, {n_leftovers} leftovers");
}
