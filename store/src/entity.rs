//! Entities with an id: sensors, objects, jobs and sessions.
//!
//! The repositories take and return these values, with core's checked types inside;
//! [`crate::record`] converts them to stored bytes. Times are milliseconds since 1970.

mod stored;

use std::collections::BTreeMap;

use palpate_core::pose::Pose;
use palpate_core::reading::Looseness;
use palpate_core::reading::point_contact::ContactNumbers;
use palpate_core::sensor::{SensorDescription, SensorFamily, SensorKnowledge, StatedRanges};
use uuid::Uuid;

/// What people call a thing by, for searches: keys and their values.
pub type Labels = BTreeMap<String, String>;

/// A sensor of robots' readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// Its id.
    pub id: Uuid,
    /// Its unique name.
    pub name: String,
    /// The preset it was created from.
    pub preset: Option<String>,
    /// Its geometry and response.
    pub description: SensorDescription,
    /// The owner's trust in the description.
    pub knowledge: SensorKnowledge,
    /// Ranges that the owner states for what the description leaves open.
    pub ranges: StatedRanges,
    /// Its labels.
    pub labels: Labels,
    /// Whether it has readings; its geometry is immutable from then on.
    pub used: bool,
    /// Time of creation.
    pub created_at_ms: u64,
}

impl Sensor {
    /// The sensors that the description may stand for, at a level of knowledge.
    #[must_use]
    pub fn family(&self, knowledge: SensorKnowledge) -> SensorFamily {
        SensorFamily::within(self.description.clone(), knowledge, &self.ranges)
    }
}

/// An object to recognise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    /// Its id.
    pub id: Uuid,
    /// Its unique name.
    pub name: String,
    /// Description for people.
    pub description: String,
    /// Its labels.
    pub labels: Labels,
    /// Number of changes; the `ETag` of the resource.
    pub revision: u64,
    /// Time of creation.
    pub created_at_ms: u64,
    /// Time of the last change.
    pub updated_at_ms: u64,
}

/// State of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobState {
    /// It waits for its turn.
    Queued,
    /// It is being worked on.
    Running,
    /// It is done.
    Succeeded,
    /// It ended with an error.
    Failed,
    /// It was cancelled.
    Cancelled,
}

impl JobState {
    /// Whether the state is final.
    #[must_use]
    pub fn is_final(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }
}

/// A training of a catalogue, as a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Job {
    /// Its id.
    pub id: Uuid,
    /// Name of the catalogue to train.
    pub catalogue: String,
    /// The request as the server writes it (JSON), from which the job can be resumed.
    pub request: String,
    /// State of the job.
    pub state: JobState,
    /// Present stage.
    pub stage: String,
    /// Objects whose touches were kept when a stop of the server interrupted it last.
    pub done: u64,
    /// Unused: 0.
    pub total: u64,
    /// Whether its cancellation was requested.
    pub cancel_requested: bool,
    /// The resulting version.
    pub version: Option<u32>,
    /// Error message of a failed job.
    pub error: Option<String>,
    /// What it found, as the server writes it (JSON), unless that is in the version.
    pub report: Option<String>,
    /// Time of the request.
    pub created_at_ms: u64,
    /// Time of the start.
    pub started_at_ms: Option<u64>,
    /// Time of the end.
    pub finished_at_ms: Option<u64>,
}

/// Recognition method of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The default: proposals verified and refined.
    Surface,
    /// The sparse voting of section 5.4.
    Sva,
    /// Bags of features, without poses.
    Appearance,
    /// Occupancy maps alone.
    Geometric,
}

/// A session, in which one object is touched.
#[derive(Clone, Debug, PartialEq)]
pub struct Session {
    /// Its id.
    pub id: Uuid,
    /// Catalogue of the session.
    pub catalogue: Uuid,
    /// Version of the catalogue, fixed at the start.
    pub version: u32,
    /// Recognition method.
    pub method: Method,
    /// Sensors whose readings the session accepts.
    pub sensors: Vec<Uuid>,
    /// Frame of all its poses.
    pub frame_id: String,
    /// Prior probabilities of objects; empty is uniform.
    pub prior: Vec<(Uuid, f64)>,
    /// Seed of its random streams.
    pub seed: u64,
    /// Lifetime without a reading.
    pub time_to_live_ms: u64,
    /// Further options as the server writes them (JSON); may be empty.
    pub options: String,
    /// Time of the start.
    pub created_at_ms: u64,
    /// Time of the closing.
    pub closed_at_ms: Option<u64>,
}

/// A reading as received, in the driver's order, so that derived values can be recomputed.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredReading {
    /// The sensor of the reading.
    pub sensor: Uuid,
    /// Pose of the sensor (in training: `object_from_sensor`); `None` when unknown.
    pub session_from_sensor: Option<Pose>,
    /// Pressures in pascal in the driver's order; `None` is a taxel without a value.
    pub pressures: Vec<Option<f64>>,
    /// The robot's own time stamp, nanoseconds of its clock.
    pub stamp_ns: Option<i64>,
    /// Number of the sensor's calibration with which the uncorrected pressures are to be
    /// corrected; 0 for none.
    pub calibration: u32,
    /// The client's own feature of the press: finite numbers.
    pub feature: Option<Vec<f64>>,
    /// Length of the sensor's free path along its +z, metres; 0 when not stated.
    pub approach: f64,
    /// Possible motion of the object since the previous reading.
    pub object_moved: Option<Looseness>,
    /// The contact of a reading without an image; then there are no pressures and no pose.
    pub contact: Option<ContactNumbers>,
    /// Shear of three-axis taxels in pascal, along the sensor's +x and +y, in the driver's order;
    /// `None` is a taxel without a value.
    pub shear: Option<Vec<Option<[f64; 2]>>>,
}

impl StoredReading {
    /// Whether a robot sent the same reading; the service adds the calibration.
    #[must_use]
    pub fn is_repeated_by(&self, other: &Self) -> bool {
        *self == Self { calibration: self.calibration, ..other.clone() }
    }
}

/// A robot's own number of a reading, which identifies repeated requests.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct ReadingId {
    /// The robot, at most [`crate::journal::ROBOT_BYTES_MAX`] bytes.
    pub robot: String,
    /// The number.
    pub seq: u64,
}
