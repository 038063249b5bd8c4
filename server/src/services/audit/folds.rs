//! Repetitions in the audit log: equal requests with equal outcomes are counted in one entry
//! for an hour.
//!
//! Counts are kept in memory and stored by [`super::Audit::store`] periodically, so that
//! repetitions cost no writes of their own.

use std::collections::HashMap;

use palpate_store::audit::AuditEntry;

use crate::client::Client;

/// Time in which an entry collects repetitions, in milliseconds from its first request.
pub(super) const FOLD_MS: u64 = 3_600_000;
/// Maximum number of collecting entries; unchanged ones are forgotten above it.
const FOLDS_MAX: usize = 100_000;

/// The properties that requests counted in one entry share.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Alike {
    pub(super) client: Option<Client>,
    pub(super) operation: &'static str,
    pub(super) status: u16,
    /// The path, if it distinguishes requests.
    pub(super) resource: Option<String>,
}

/// Entries that collect repetitions.
#[derive(Debug, Default)]
pub(super) struct Folds(HashMap<Alike, Fold>);

#[derive(Debug)]
struct Fold {
    entry: AuditEntry,
    has_news: bool,
}

impl Folds {
    /// Counts a request in the entry of its repetitions; `false` when there is none.
    pub(super) fn again(&mut self, alike: &Alike, now_ms: u64) -> bool {
        let Some(fold) = self.0.get_mut(alike).filter(|fold| takes(&fold.entry, now_ms)) else {
            return false;
        };
        fold.entry.n = fold.entry.n.saturating_add(1);
        fold.entry.last_at_ms = fold.entry.last_at_ms.max(now_ms);
        fold.has_news = true;
        true
    }

    /// Registers an entry that was just stored.
    pub(super) fn first(&mut self, alike: Alike, entry: AuditEntry) {
        if self.0.len() >= FOLDS_MAX {
            self.0.retain(|_, fold| fold.has_news);
        }
        if self.0.len() < FOLDS_MAX {
            self.0.insert(alike, Fold { entry, has_news: false });
        }
    }

    /// The entries with unsaved counts. Those that no longer collect are forgotten.
    pub(super) fn news(&mut self, now_ms: u64) -> Vec<AuditEntry> {
        let news = self
            .0
            .values_mut()
            .filter_map(|fold| std::mem::take(&mut fold.has_news).then(|| fold.entry.clone()));
        let news = news.collect();
        self.0.retain(|_, fold| takes(&fold.entry, now_ms));
        news
    }
}

fn takes(entry: &AuditEntry, now_ms: u64) -> bool {
    now_ms < entry.at_ms.saturating_add(FOLD_MS)
}
