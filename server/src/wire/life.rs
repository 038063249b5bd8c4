//! Conversion of a session's status: leases, expiry, end and truth.

use std::time::Duration;

use palpate_core::pose::Pose;
use palpate_schemas as wire;
use palpate_store::entity::Session;
use thiserror::Error;
use uuid::Uuid;

use crate::model::Model;
use crate::wire::Invalid;
use crate::wire::reading::pose;
use crate::wire::session::{TTL_MAX, options, written};
use crate::wire::{NONE_OF_THESE, time, within};

/// Status of a session, beside its stored record.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Status {
    /// Number of journal entries: the revision.
    pub(crate) length: u64,
    /// Number of readings that count.
    pub(crate) n_readings: u64,
    /// Number of withdrawn readings.
    pub(crate) n_retracted: u64,
    /// Time of the last entry, or else of the session's start.
    pub(crate) changed_at_ms: u64,
    /// Time and reason of the end; `None` while it is open.
    pub(crate) end: Option<End>,
    /// Time of expiry without new readings, past or future; `None` for never.
    pub(crate) expires_at_ms: Option<u64>,
    /// The same as a running time, which decides.
    pub(crate) expires_ran_ms: Option<u64>,
    pub(crate) leased_until_ms: Option<u64>,
    pub(crate) leased_ran_ms: Option<u64>,
}

/// Time and reason of a session's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct End {
    pub(crate) at_ms: u64,
    /// Running time of the end.
    pub(crate) ran_ms: u64,
    pub(crate) reason: EndReason,
}

/// Reason for which a session accepts no readings.
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
    /// Number of stored readings, withdrawn ones included.
    pub(crate) fn n_stored(&self) -> u64 {
        self.n_readings + self.n_retracted
    }
}

/// The checked duration of a lease.
pub(crate) fn lease(asked: wire::ExtendSession) -> Result<Duration, Invalid> {
    within("/seconds", u64::from(asked.seconds), 1, TTL_MAX).map(Duration::from_secs)
}

/// Keeps a session open for a time from now on.
pub(crate) fn set_lease(session: &mut Session, now_ms: u64, lease_ms: u64, key: Option<Uuid>) {
    let mut options = options(session);
    options.leased_at_ms = Some(now_ms);
    options.leased_until_ms = Some(now_ms.saturating_add(lease_ms));
    options.leased_by = key;
    session.options = written(&options);
}

/// Records that somebody has seen a session's alarms, and until when further ones are muted; a
/// mute that is not named stays.
pub(crate) fn set_acknowledged(session: &mut Session, at_ms: u64, muted_until_ms: Option<u64>) {
    let mut options = options(session);
    options.acknowledged_at_ms = Some(at_ms);
    if let Some(until) = muted_until_ms {
        options.muted_until_ms = (until > at_ms).then_some(until);
    }
    session.options = written(&options);
}

/// The key that opened a session; `None` when it was not recorded or keys are not required.
pub(crate) fn opened_by(session: &Session) -> Option<Uuid> {
    options(session).opened_by
}

/// A session whose object or pose is known to have been another one.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("session {session} was already closed with {before} as the truth")]
pub(crate) struct OtherTruth {
    session: Uuid,
    before: String,
}

/// The truth about a session, as a client states it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ReportedTruth {
    /// Index of the object in the model; `None` for an object outside the catalogue.
    pub(crate) object: Option<usize>,
    /// Pose of its frame.
    pub(crate) session_from_object: Option<Pose>,
}

/// Records a session's true object, and its pose if that was not known; whether the object was
/// unknown before.
pub(crate) fn set_truth(session: &mut Session, truth: &wire::Truth) -> Result<bool, OtherTruth> {
    let mut options = options(session);
    let other = |before: String| Err(OtherTruth { session: session.id, before });
    let is_new = match &options.truth {
        Some(before) if before.object != truth.object => {
            return other(format!("{:?}", before.name.as_deref().unwrap_or(NONE_OF_THESE)));
        }
        Some(wire::Truth { pose: Some(before), .. }) => {
            return match truth.pose {
                Some(pose) if pose != *before => other("another pose".to_owned()),
                _ => Ok(false),
            };
        }
        Some(_) if truth.pose.is_none() => return Ok(false),
        Some(_) => false,
        None => true,
    };
    options.truth = Some(truth.clone());
    session.options = written(&options);
    Ok(is_new)
}

/// The truth stated by a client; `Ok(None)` when none is stated.
pub(crate) fn reported_truth(
    asked: &wire::CloseSession,
    model: &Model,
) -> Result<Option<ReportedTruth>, Invalid> {
    if asked.pose.is_some() && asked.object.is_none() {
        let detail = "came without `object`, expected a pose with the object that has it";
        return Err(Invalid::field("/pose", detail));
    }
    let session_from_object = asked.pose.as_ref().map(|given| pose("/pose", given)).transpose()?;
    match (&asked.object, asked.none_of_these.unwrap_or(false)) {
        (None, false) => Ok(None),
        (None, true) => Ok(Some(ReportedTruth::default())),
        (Some(_), true) => {
            let detail = "came with `object`, expected one of the two";
            Err(Invalid::field("/none_of_these", detail))
        }
        (Some(reference), false) => match model.find(reference) {
            Some(object) => Ok(Some(ReportedTruth { object: Some(object), session_from_object })),
            None => {
                let (name, version) = (&model.name, model.version);
                let detail = format!(
                    "version {version} of catalogue {name:?} does not know {reference:?}; of an \
                     object that it does not know say `\"none_of_these\": true`"
                );
                Err(Invalid::field("/object", detail))
            }
        },
    }
}
