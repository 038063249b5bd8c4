//! What a session is doing, and what keeps it open and ends it: leases, expiry, the truth.

use std::time::Duration;

use palpate_schemas as wire;
use palpate_store::entity::Session;

use uuid::Uuid;

use crate::catalogues::Model;
use crate::refusal::Refusal;
use crate::wire::session::{TTL_MAX, options, written};
use crate::wire::{time, within};

/// What a session is doing, beside what is stored under its id.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Status {
    /// How many entries its journal has: its revision.
    pub(crate) length: u64,
    /// Readings that count.
    pub(crate) n_readings: u64,
    /// Readings that are withdrawn.
    pub(crate) n_retracted: u64,
    /// When and why it ended; `None` while it is open.
    pub(crate) end: Option<End>,
    /// When it expires, or has expired, if nothing new comes; `None` when it never does.
    pub(crate) expires_at_ms: Option<u64>,
    pub(crate) leased_until_ms: Option<u64>,
}

/// When and why a session ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct End {
    pub(crate) at_ms: u64,
    pub(crate) reason: EndReason,
}

/// Why a session takes no more readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EndReason {
    Closed,
    Expired,
}

impl std::fmt::Display for End {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let at = time(self.at_ms);
        match self.reason {
            EndReason::Closed => write!(formatter, "was closed at {at}"),
            EndReason::Expired => write!(
                formatter,
                "expired at {at}: no reading arrived within its time to live, and no lease kept it open"
            ),
        }
    }
}

impl Status {
    /// How many readings are stored, those that are withdrawn included.
    pub(crate) fn n_stored(&self) -> u64 {
        self.n_readings + self.n_retracted
    }
}

/// How long a lease keeps a session open, checked.
pub(crate) fn lease(asked: wire::ExtendSession) -> Result<Duration, Refusal> {
    within("/seconds", u64::from(asked.seconds), 1, TTL_MAX).map(Duration::from_secs)
}

/// Keeps a session open until then at least; a lease that lasts longer stays as it is.
pub(crate) fn set_lease(session: &mut Session, until_ms: u64, key: Option<Uuid>) {
    let mut options = options(session);
    if options.leased_until_ms < Some(until_ms) {
        (options.leased_until_ms, options.leased_by) = (Some(until_ms), key);
    }
    session.options = written(&options);
}

/// The key that opened a session; `None` when that was not recorded, or nobody was asked for one.
pub(crate) fn opened_by(session: &Session) -> Option<Uuid> {
    options(session).opened_by
}

/// Notes what a session's object was; whether it was not known before.
pub(crate) fn set_truth(session: &mut Session, truth: &wire::Truth) -> Result<bool, Refusal> {
    let mut options = options(session);
    match &options.truth {
        Some(before) if before.object == truth.object => Ok(false),
        Some(before) => Err(Refusal::OtherTruth {
            session: session.id,
            before: before.name.clone().unwrap_or_else(|| "none of these".to_owned()),
        }),
        None => {
            options.truth = Some(truth.clone());
            session.options = written(&options);
            Ok(true)
        }
    }
}

/// The object that a client names as the truth: its place in the model, `None` when it was none
/// of the catalogue's. `Ok(None)` when nothing is said.
pub(crate) fn told_truth(
    asked: &wire::CloseSession,
    model: &Model,
) -> Result<Option<Option<usize>>, Refusal> {
    match (&asked.object, asked.none_of_these.unwrap_or(false)) {
        (None, false) => Ok(None),
        (None, true) => Ok(Some(None)),
        (Some(_), true) => {
            let detail = "came with `object`, expected one of the two";
            Err(Refusal::field("/none_of_these", detail))
        }
        (Some(reference), false) => match model.find(reference) {
            Some(object) => Ok(Some(Some(object))),
            None => {
                let (name, version) = (&model.name, model.version);
                let detail = format!(
                    "version {version} of catalogue {name:?} does not know {reference:?}; of an \
                     object that it does not know say `\"none_of_these\": true`"
                );
                Err(Refusal::field("/object", detail))
            }
        },
    }
}
