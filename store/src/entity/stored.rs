//! Sensors, objects, jobs and sessions as they are stored.

use bincode::{Decode, Encode};
use palpate_core::sensor::{
    ForceCurve, ImageOrder, SensorDescription, SensorParameters, TaxelGrid,
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

#[derive(Encode, Decode)]
struct ObjectRecordV1 {
    id: IdV1,
    name: String,
    description: String,
    revision: u64,
    created_at_ms: u64,
    updated_at_ms: u64,
}

impl Record for Object {
    const KIND: Kind = Kind::Object;

    fn to_payload(&self) -> Vec<u8> {
        write(&ObjectRecordV1 {
            id: self.id.into_bytes(),
            name: self.name.clone(),
            description: self.description.clone(),
            revision: self.revision,
            created_at_ms: self.created_at_ms,
            updated_at_ms: self.updated_at_ms,
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let stored: ObjectRecordV1 = read(payload)?;
        Ok(Self {
            id: Uuid::from_bytes(stored.id),
            name: stored.name,
            description: stored.description,
            revision: stored.revision,
            created_at_ms: stored.created_at_ms,
            updated_at_ms: stored.updated_at_ms,
        })
    }
}

#[derive(Encode, Decode)]
struct JobRecordV1 {
    id: IdV1,
    catalogue: String,
    request: String,
    state: u8,
    stage: String,
    done: u64,
    total: u64,
    cancel_requested: bool,
    version: Option<u32>,
    error: Option<String>,
    created_at_ms: u64,
    started_at_ms: Option<u64>,
    finished_at_ms: Option<u64>,
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
        write(&JobRecordV1 {
            id: self.id.into_bytes(),
            catalogue: self.catalogue.clone(),
            request: self.request.clone(),
            state: code(&JOB_STATES, &self.state),
            stage: self.stage.clone(),
            done: self.done,
            total: self.total,
            cancel_requested: self.cancel_requested,
            version: self.version,
            error: self.error.clone(),
            created_at_ms: self.created_at_ms,
            started_at_ms: self.started_at_ms,
            finished_at_ms: self.finished_at_ms,
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let stored: JobRecordV1 = read(payload)?;
        Ok(Self {
            id: Uuid::from_bytes(stored.id),
            catalogue: stored.catalogue,
            request: stored.request,
            state: coded(&JOB_STATES, "state", stored.state)?,
            stage: stored.stage,
            done: stored.done,
            total: stored.total,
            cancel_requested: stored.cancel_requested,
            version: stored.version,
            error: stored.error,
            created_at_ms: stored.created_at_ms,
            started_at_ms: stored.started_at_ms,
            finished_at_ms: stored.finished_at_ms,
        })
    }
}

#[derive(Encode, Decode)]
struct SessionRecordV1 {
    id: IdV1,
    catalogue: IdV1,
    version: u32,
    method: u8,
    sensors: Vec<IdV1>,
    frame_id: String,
    prior: Vec<(IdV1, f64)>,
    /// Always true: whether objects move is said by the method and the options.
    unused: bool,
    seed: u64,
    time_to_live_ms: u64,
    options: String,
    created_at_ms: u64,
    closed_at_ms: Option<u64>,
}

const METHODS: [Method; 4] = [Method::Surface, Method::Sva, Method::Appearance, Method::Geometric];

impl Record for Session {
    const KIND: Kind = Kind::Session;

    fn to_payload(&self) -> Vec<u8> {
        write(&SessionRecordV1 {
            id: self.id.into_bytes(),
            catalogue: self.catalogue.into_bytes(),
            version: self.version,
            method: code(&METHODS, &self.method),
            sensors: self.sensors.iter().map(|id| id.into_bytes()).collect(),
            frame_id: self.frame_id.clone(),
            prior: self.prior.iter().map(|(id, weight)| (id.into_bytes(), *weight)).collect(),
            unused: true,
            seed: self.seed,
            time_to_live_ms: self.time_to_live_ms,
            options: self.options.clone(),
            created_at_ms: self.created_at_ms,
            closed_at_ms: self.closed_at_ms,
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let stored: SessionRecordV1 = read(payload)?;
        let prior = stored.prior.into_iter().map(|(id, weight)| (Uuid::from_bytes(id), weight));
        Ok(Self {
            id: Uuid::from_bytes(stored.id),
            catalogue: Uuid::from_bytes(stored.catalogue),
            version: stored.version,
            method: coded(&METHODS, "method", stored.method)?,
            sensors: stored.sensors.into_iter().map(Uuid::from_bytes).collect(),
            frame_id: stored.frame_id,
            prior: prior.collect(),
            seed: stored.seed,
            time_to_live_ms: stored.time_to_live_ms,
            options: stored.options,
            created_at_ms: stored.created_at_ms,
            closed_at_ms: stored.closed_at_ms,
        })
    }
}
