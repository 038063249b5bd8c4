//! Sensors, objects, jobs and sessions as they are stored.

use bincode::{Decode, Encode};
use palpate_core::sensor::{
    Coupling, ForceCurve, ImageOrder, SensorDescription, SensorParameters, TaxelGrid,
};
use uuid::Uuid;

use super::{Job, JobState, Method, Object, Sensor, Session};
use crate::envelope::Kind;
use crate::error::RecordError;
use crate::record::{IdV1, Record, code, coded, read, write};

#[derive(Encode, Decode)]
struct SensorRecordV1 {
    id: IdV1,
    name: String,
    preset: Option<String>,
    rows: u32,
    cols: u32,
    pitch: f64,
    taxel_width: f64,
    covering_thickness: f64,
    point_spread: f64,
    force_curve: Vec<(f64, f64)>,
    saturation: f64,
    noise: f64,
    quantisation: f64,
    /// Transposed, rows reversed, columns reversed.
    image_order: [bool; 3],
    used: bool,
    created_at_ms: u64,
}

impl Record for Sensor {
    const KIND: Kind = Kind::Sensor;

    fn to_payload(&self) -> Vec<u8> {
        let parameters = self.description.parameters();
        let order = parameters.image_order;
        write(&SensorRecordV1 {
            id: self.id.into_bytes(),
            name: self.name.clone(),
            preset: self.preset.clone(),
            // A description has at most 128 of each.
            rows: parameters.grid.rows as u32,
            cols: parameters.grid.cols as u32,
            pitch: parameters.grid.pitch,
            taxel_width: parameters.grid.taxel_width,
            covering_thickness: parameters.covering_thickness,
            point_spread: parameters.point_spread,
            force_curve: parameters.force_curve.knots().to_vec(),
            saturation: parameters.saturation,
            noise: parameters.noise,
            quantisation: parameters.quantisation,
            image_order: [order.transposed, order.rows_reversed, order.cols_reversed],
            used: self.used,
            created_at_ms: self.created_at_ms,
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let stored: SensorRecordV1 = read(payload)?;
        let [transposed, rows_reversed, cols_reversed] = stored.image_order;
        let description = SensorDescription::new(SensorParameters {
            grid: TaxelGrid {
                rows: stored.rows as usize,
                cols: stored.cols as usize,
                pitch: stored.pitch,
                taxel_width: stored.taxel_width,
            },
            covering_thickness: stored.covering_thickness,
            point_spread: stored.point_spread,
            force_curve: ForceCurve::new(stored.force_curve)?,
            saturation: stored.saturation,
            noise: stored.noise,
            quantisation: stored.quantisation,
            image_order: ImageOrder { transposed, rows_reversed, cols_reversed },
            coupling: Coupling::default(),
        })?;
        Ok(Self {
            id: Uuid::from_bytes(stored.id),
            name: stored.name,
            preset: stored.preset,
            description,
            used: stored.used,
            created_at_ms: stored.created_at_ms,
        })
    }
}

impl Record for Object {
    const KIND: Kind = Kind::Object;

    fn to_payload(&self) -> Vec<u8> {
        let Self { id, name, description, revision, created_at_ms, updated_at_ms } = self;
        write(&(id.as_bytes(), name, description, revision, created_at_ms, updated_at_ms))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (id, name, description, revision, created_at_ms, updated_at_ms) = read(payload)?;
        let id = Uuid::from_bytes(id);
        Ok(Self { id, name, description, revision, created_at_ms, updated_at_ms })
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

    fn to_payload(&self) -> Vec<u8> {
        let progress = (&self.stage, self.done, self.total, self.cancel_requested);
        let outcome = (self.version, &self.error);
        let times = (self.created_at_ms, self.started_at_ms, self.finished_at_ms);
        let state = code(&JOB_STATES, &self.state);
        let id = self.id.as_bytes();
        write(&(id, &self.catalogue, &self.request, state, progress, outcome, times))
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let (id, catalogue, request, state, progress, outcome, times) = read(payload)?;
        let (stage, done, total, cancel_requested) = progress;
        let (version, error) = outcome;
        let (created_at_ms, started_at_ms, finished_at_ms) = times;
        Ok(Self {
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
            created_at_ms,
            started_at_ms,
            finished_at_ms,
        })
    }
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
