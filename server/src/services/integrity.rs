//! Check of all records after every start, during service.
//!
//! Damaged versions are excluded from recognition; other damage is logged. The engine has
//! already checked its content against the last writes. Damage found here was there before it
//! was written, or accepted by `palpate fsck --accept`. Content of a cluster that is fetched when
//! it is used is checked then; here its presence and its length are.

use std::sync::Arc;

use palpate_store::database::Database;
use palpate_store::engine::{EngineError, Found};
use palpate_store::fsck::{Checker, Report, Severity};
use tokio::sync::watch;

use crate::services::catalogues::Catalogues;

/// Number of pairs per read.
const PAIRS_PER_READ: usize = 1024;
/// Maximum number of damaged records named in the log; the count includes all.
const NAMED_MAX: usize = 20;

/// Starts the check on a separate thread; it ends when the server stops.
///
/// # Errors
/// The operating system's error when it gives no thread.
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

/// The findings in the present database; `None` when the server stops before the end.
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
        let page = cut.next_here(PAIRS_PER_READ)?;
        if page.is_empty() {
            return Ok(Some(checker.finish()));
        }
        for (key, found) in &page {
            match found {
                Found::Value(value) => checker.pair(key, value),
                Found::Elsewhere(length) => checker.elsewhere(key, *length),
            }
        }
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
