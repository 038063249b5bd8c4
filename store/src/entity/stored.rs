//! Objects, jobs and sessions as they are stored.

mod sensor;

use uuid::Uuid;

use super::{Job, JobState, Labels, Method, Object, Session};
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{IdV1, Record, code, coded, read, write};

/// Id, name, description, revision, times of creation and of the last change. The labels follow
/// in schema 2.
type ObjectRecordV1 = (IdV1, String, String, u64, u64, u64);

fn object(stored: ObjectRecordV1) -> Object {
    let (id, name, description, revision, created_at_ms, updated_at_ms) = stored;
    let (id, labels) = (Uuid::from_bytes(id), Labels::new());
    Object { id, name, description, labels, revision, created_at_ms, updated_at_ms }
}

impl Record for Object {
    const KIND: Kind = Kind::Object;
    const SCHEMA: u16 = 2;

    fn to_payload(&self) -> Vec<u8> {
        let Self { id, name, description, labels, revision, created_at_ms, updated_at_ms } = self;
        let known = (
            id.into_bytes(),
            name.clone(),
            description.clone(),
            revision,
            created_at_ms,
            updated_at_ms,
        );
        write(&(known, labels))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (known, labels): (ObjectRecordV1, Labels) = read(payload)?;
        Ok(Self { labels, ..object(known) })
    }

    fn from_older(schema: u16, payload: &[u8]) -> Result<Self, RecordError> {
        match schema {
            1 => Ok(object(read(payload)?)),
            found => Err(RecordError::Schema { found, known: Self::SCHEMA }),
        }
    }
}

const JOB_STATES: [JobState; 5] = [
    JobState::Queued,
    JobState::Running,
    JobState::Succeeded,
    JobState::Failed,
    JobState::Cancelled,
];

impl Record for Job {
    const KIND: Kind = Kind::Job;
    const SCHEMA: u16 = 2;

    fn to_payload(&self) -> Vec<u8> {
        let progress = (&self.stage, self.done, self.total, self.cancel_requested);
        let outcome = (self.version, &self.error);
        let times = (self.created_at_ms, self.started_at_ms, self.finished_at_ms);
        let state = code(&JOB_STATES, &self.state);
        let id = self.id.as_bytes();
        let known = (id, &self.catalogue, &self.request, state, progress, outcome, times);
        write(&(known, &self.report))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (known, report): (JobRecordV1, Option<String>) = read(payload)?;
        Ok(Self { report, ..job(known)? })
    }

    fn from_older(schema: u16, payload: &[u8]) -> Result<Self, RecordError> {
        match schema {
            1 => job(read(payload)?),
            found => Err(RecordError::Schema { found, known: Self::SCHEMA }),
        }
    }
}

/// Stage, done, total, whether its cancellation was requested.
type JobProgressV1 = (String, u64, u64, bool);
/// Version and error.
type JobOutcomeV1 = (Option<u32>, Option<String>);
/// Times of the request, the start and the end.
type JobTimesV1 = (u64, Option<u64>, Option<u64>);
/// Id, catalogue, request, state, and the above. The report follows in schema 2.
type JobRecordV1 = (IdV1, String, String, u8, JobProgressV1, JobOutcomeV1, JobTimesV1);

fn job(stored: JobRecordV1) -> Result<Job, RecordError> {
    let (id, catalogue, request, state, progress, outcome, times) = stored;
    let (stage, done, total, cancel_requested) = progress;
    let (version, error) = outcome;
    let (created_at_ms, started_at_ms, finished_at_ms) = times;
    Ok(Job {
        id: Uuid::from_bytes(id),
        catalogue,
        request,
        state: coded(&JOB_STATES, "state", state)?,
        stage,
        done,
        total,
        cancel_requested,
        version,
        error,
        report: None,
        created_at_ms,
        started_at_ms,
        finished_at_ms,
    })
}

const METHODS: [Method; 4] = [Method::Surface, Method::Sva, Method::Appearance, Method::Geometric];

impl Record for Session {
    const KIND: Kind = Kind::Session;

    fn to_payload(&self) -> Vec<u8> {
        let (id, catalogue) = (self.id.as_bytes(), self.catalogue.as_bytes());
        let method = code(&METHODS, &self.method);
        let sensors: Vec<IdV1> = self.sensors.iter().map(|id| id.into_bytes()).collect();
        let prior = self.prior.iter().map(|(id, weight)| (id.into_bytes(), *weight));
        let prior: Vec<(IdV1, f64)> = prior.collect();
        let times = (self.time_to_live_ms, &self.options, self.created_at_ms, self.closed_at_ms);
        let from = (id, catalogue, self.version, method, sensors, &self.frame_id, prior);
        // Always true: method and options determine whether objects move.
        write(&(from, true, self.seed, times))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (from, unused, seed, times) = read(payload)?;
        let _: bool = unused;
        let (id, catalogue, version, method, sensors, frame_id, prior) = from;
        let sensors: Vec<IdV1> = sensors;
        let prior: Vec<(IdV1, f64)> = prior;
        let (time_to_live_ms, options, created_at_ms, closed_at_ms) = times;
        Ok(Self {
            id: Uuid::from_bytes(id),
            catalogue: Uuid::from_bytes(catalogue),
            version,
            method: coded(&METHODS, "method", method)?,
            sensors: sensors.into_iter().map(Uuid::from_bytes).collect(),
            frame_id,
            prior: prior.into_iter().map(|(id, weight)| (Uuid::from_bytes(id), weight)).collect(),
            seed,
            time_to_live_ms,
            options,
            created_at_ms,
            closed_at_ms,
        })
    }
}
