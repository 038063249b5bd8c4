//! Conversion between core and stored records: the frozen structs.
//!
//! A struct that ends in `V1` never changes; a new field makes a `V2` with the next schema
//! number, and decoding converts any of them to today's type. Payloads are bincode 2.0.1's
//! `legacy` form (fixed-width little-endian, u64 lengths); readings' pressures are raw
//! little-endian f64, NaN for a missing taxel. Journal entries, calibrations and access
//! records have their own files.

mod access;
mod calibration;
mod journal_entry;

use bincode::config::{self, Configuration, Fixint, Limit, LittleEndian};
use bincode::{Decode, Encode};
use palpate_core::sensor::{
    ForceCurve, ImageOrder, SensorDescription, SensorParameters, TaxelGrid,
};
use uuid::Uuid;

use crate::catalogue::{BlockEntry, Catalogue, Manifest, Switch, VersionObject};
use crate::entity::{Job, JobState, Method, Object, Sensor, Session};
use crate::envelope::{self, Kind};
use crate::error::RecordError;
use crate::mesh::{MeshFormat, MeshInfo, MeshUnit};

/// Schema number of every record that has only one.
pub const SCHEMA: u16 = 1;
/// Maximum length of a bincode payload.
const PAYLOAD_LIMIT: usize = 64 << 20;
const CONFIG: Configuration<LittleEndian, Fixint, Limit<PAYLOAD_LIMIT>> =
    config::legacy().with_limit::<PAYLOAD_LIMIT>();

/// A value with a stored form.
pub trait Record: Sized {
    /// Kind in its envelope.
    const KIND: Kind;
    /// Schema number with which it is written.
    const SCHEMA: u16 = SCHEMA;

    /// Its payload.
    fn to_payload(&self) -> Vec<u8>;

    /// The value of a payload of [`Record::SCHEMA`].
    ///
    /// # Errors
    /// [`RecordError`] when the payload is not such a value.
    fn from_payload(payload: &[u8]) -> Result<Self, RecordError>;

    /// The value of a payload of an earlier schema.
    ///
    /// # Errors
    /// [`RecordError`] when there was no such schema, or the payload is not of it.
    fn from_older(schema: u16, _payload: &[u8]) -> Result<Self, RecordError> {
        Err(RecordError::Schema { found: schema, known: Self::SCHEMA })
    }
}

/// The stored bytes of a value.
pub fn encode<T: Record>(value: &T) -> Vec<u8> {
    envelope::seal(T::KIND, T::SCHEMA, &value.to_payload())
}

/// The value of stored bytes.
///
/// # Errors
/// [`RecordError`] names the damage, or the newer schema.
pub fn decode<T: Record>(bytes: &[u8]) -> Result<T, RecordError> {
    let opened = envelope::open(T::KIND, bytes)?;
    match opened.schema {
        schema if schema == T::SCHEMA => T::from_payload(opened.payload),
        older if older < T::SCHEMA => T::from_older(older, opened.payload),
        found => Err(RecordError::Schema { found, known: T::SCHEMA }),
    }
}

fn write<T: Encode>(stored: &T) -> Vec<u8> {
    bincode::encode_to_vec(stored, CONFIG).expect("the repositories bound what they store")
}

fn read<T: Decode<()>>(payload: &[u8]) -> Result<T, RecordError> {
    let (stored, consumed) = bincode::decode_from_slice(payload, CONFIG)
        .map_err(|error| RecordError::Decode { detail: error.to_string() })?;
    if consumed != payload.len() {
        return Err(RecordError::Trailing { consumed, length: payload.len() });
    }
    Ok(stored)
}

/// Stored form of an id.
type IdV1 = [u8; 16];

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
    /// Always true: method and options determine whether objects move.
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

/// Length of a journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub(crate) struct JournalHeadV1 {
    pub(crate) next: u64,
}

/// Position in a journal of a robot's reading number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub(crate) struct JournalRobotV1 {
    pub(crate) seq: u64,
}

/// The journal entry that withdraws another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub(crate) struct JournalRetractionV1 {
    pub(crate) seq: u64,
}

/// The id of a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub(crate) struct NameV1 {
    pub(crate) id: IdV1,
}

/// The latest time, milliseconds since 1970.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub(crate) struct ClockV1 {
    pub(crate) latest_ms: u64,
}

/// The layout number of the database and its creator.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub(crate) struct LayoutV1 {
    pub(crate) layout: u32,
    pub(crate) made_by: String,
}

/// A record stored without conversion.
trait Plain: Encode + Decode<()> {
    const KIND: Kind;
}

impl Plain for JournalHeadV1 {
    const KIND: Kind = Kind::JournalHead;
}

impl Plain for JournalRobotV1 {
    const KIND: Kind = Kind::JournalRobot;
}

impl Plain for JournalRetractionV1 {
    const KIND: Kind = Kind::JournalRetraction;
}

impl Plain for NameV1 {
    const KIND: Kind = Kind::Name;
}

impl Plain for ClockV1 {
    const KIND: Kind = Kind::Clock;
}

impl Plain for LayoutV1 {
    const KIND: Kind = Kind::Layout;
}

impl<T: Plain> Record for T {
    const KIND: Kind = T::KIND;

    fn to_payload(&self) -> Vec<u8> {
        write(self)
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        read(payload)
    }
}

#[derive(Encode, Decode)]
struct MeshRecordV1 {
    upload: IdV1,
    format: u8,
    unit: u8,
    length: u64,
    hash: [u8; 32],
    uploaded_at_ms: u64,
}

const MESH_FORMATS: [MeshFormat; 4] =
    [MeshFormat::Stl, MeshFormat::Obj, MeshFormat::Ply, MeshFormat::Off];
const MESH_UNITS: [MeshUnit; 4] =
    [MeshUnit::Metre, MeshUnit::Millimetre, MeshUnit::Centimetre, MeshUnit::Inch];

impl Record for MeshInfo {
    const KIND: Kind = Kind::Mesh;

    fn to_payload(&self) -> Vec<u8> {
        write(&MeshRecordV1 {
            upload: self.upload.into_bytes(),
            format: code(&MESH_FORMATS, &self.format),
            unit: code(&MESH_UNITS, &self.unit),
            length: self.length,
            hash: self.hash,
            uploaded_at_ms: self.uploaded_at_ms,
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let stored: MeshRecordV1 = read(payload)?;
        Ok(Self {
            upload: Uuid::from_bytes(stored.upload),
            format: coded(&MESH_FORMATS, "format", stored.format)?,
            unit: coded(&MESH_UNITS, "unit", stored.unit)?,
            length: stored.length,
            hash: stored.hash,
            uploaded_at_ms: stored.uploaded_at_ms,
        })
    }
}

#[derive(Encode, Decode)]
struct CatalogueRecordV1 {
    id: IdV1,
    name: String,
    latest: u32,
    current: Option<u32>,
    revision: u64,
    history: Vec<(u32, u64)>,
    created_at_ms: u64,
}

impl Record for Catalogue {
    const KIND: Kind = Kind::Catalogue;

    fn to_payload(&self) -> Vec<u8> {
        write(&CatalogueRecordV1 {
            id: self.id.into_bytes(),
            name: self.name.clone(),
            latest: self.latest,
            current: self.current,
            revision: self.revision,
            history: self.history.iter().map(|switch| (switch.version, switch.at_ms)).collect(),
            created_at_ms: self.created_at_ms,
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let stored: CatalogueRecordV1 = read(payload)?;
        let switch = |(version, at_ms)| Switch { version, at_ms };
        Ok(Self {
            id: Uuid::from_bytes(stored.id),
            name: stored.name,
            latest: stored.latest,
            current: stored.current,
            revision: stored.revision,
            history: stored.history.into_iter().map(switch).collect(),
            created_at_ms: stored.created_at_ms,
        })
    }
}

#[derive(Encode, Decode)]
struct VersionRecordV1 {
    catalogue: IdV1,
    version: u32,
    job: Option<IdV1>,
    parameters: String,
    objects: Vec<(IdV1, String)>,
    blocks: Vec<(String, [u8; 32], u64)>,
    created_at_ms: u64,
}

impl Record for Manifest {
    const KIND: Kind = Kind::Version;

    fn to_payload(&self) -> Vec<u8> {
        let object = |object: &VersionObject| (object.id.into_bytes(), object.name.clone());
        let block = |block: &BlockEntry| (block.name.clone(), block.hash, block.length);
        write(&VersionRecordV1 {
            catalogue: self.catalogue.into_bytes(),
            version: self.version,
            job: self.job.map(Uuid::into_bytes),
            parameters: self.parameters.clone(),
            objects: self.objects.iter().map(object).collect(),
            blocks: self.blocks.iter().map(block).collect(),
            created_at_ms: self.created_at_ms,
        })
    }

    fn from_payload(payload: &[u8]) -> Result<Self, RecordError> {
        let stored: VersionRecordV1 = read(payload)?;
        let object = |(id, name)| VersionObject { id: Uuid::from_bytes(id), name };
        let block = |(name, hash, length)| BlockEntry { name, hash, length };
        Ok(Self {
            catalogue: Uuid::from_bytes(stored.catalogue),
            version: stored.version,
            job: stored.job.map(Uuid::from_bytes),
            parameters: stored.parameters,
            objects: stored.objects.into_iter().map(object).collect(),
            blocks: stored.blocks.into_iter().map(block).collect(),
            created_at_ms: stored.created_at_ms,
        })
    }
}

/// The code of `value`: its index in `all`.
fn code<T: PartialEq>(all: &[T], value: &T) -> u8 {
    let place = all.iter().position(|candidate| candidate == value);
    place.and_then(|place| u8::try_from(place).ok()).expect("all values are listed")
}

fn coded<T: Copy>(all: &[T], field: &'static str, found: u8) -> Result<T, RecordError> {
    all.get(usize::from(found)).copied().ok_or(RecordError::Code { field, found })
}
