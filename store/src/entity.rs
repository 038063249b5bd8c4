//! What the database knows by id: sensors, objects, jobs and sessions.
//!
//! These are the values the repositories give and take, with core's checked types inside;
//! [`crate::record`] turns them into stored bytes. Times are milliseconds since 1970.

use palpate_core::pose::Pose;
use palpate_core::reading::Looseness;
use palpate_core::sensor::SensorDescription;
use uuid::Uuid;

/// A sensor that robots may send readings of.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// Its id.
    pub id: Uuid,
    /// Its unique name.
    pub name: String,
    /// The preset it was made from.
    pub preset: Option<String>,
    /// Its geometry and response.
    pub description: SensorDescription,
    /// Whether readings of it exist; its geometry is immutable from then on.
    pub used: bool,
    /// When it was added.
    pub created_at_ms: u64,
}

/// An object to recognise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    /// Its id.
    pub id: Uuid,
    /// Its unique name.
    pub name: String,
    /// What people say about it.
    pub description: String,
    /// Counts changes; the `ETag` of the resource.
    pub revision: u64,
    /// When it was added.
    pub created_at_ms: u64,
    /// When it was last changed.
    pub updated_at_ms: u64,
}

/// Where a job stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobState {
    /// Waits for its turn.
    Queued,
    /// Is being worked on.
    Running,
    /// Is done.
    Succeeded,
    /// Ended with an error.
    Failed,
    /// Was cancelled.
    Cancelled,
}

impl JobState {
    /// Whether nothing more will happen.
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
    /// The name of the catalogue it trains.
    pub catalogue: String,
    /// The request as the server writes it down (JSON), for the job to be taken up again.
    pub request: String,
    /// Where it stands.
    pub state: JobState,
    /// What it is doing.
    pub stage: String,
    /// How much of the stage is done.
    pub done: u64,
    /// How much there is to do in the stage.
    pub total: u64,
    /// Whether someone asked for it to stop.
    pub cancel_requested: bool,
    /// The version it made.
    pub version: Option<u32>,
    /// Why it failed.
    pub error: Option<String>,
    /// When it was asked for.
    pub created_at_ms: u64,
    /// When work on it began.
    pub started_at_ms: Option<u64>,
    /// When it ended.
    pub finished_at_ms: Option<u64>,
}

/// How a session recognises.
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

/// A session: one object being touched.
#[derive(Clone, Debug, PartialEq)]
pub struct Session {
    /// Its id.
    pub id: Uuid,
    /// The catalogue it recognises with.
    pub catalogue: Uuid,
    /// The version it pins.
    pub version: u32,
    /// How it recognises.
    pub method: Method,
    /// The sensors whose readings it takes.
    pub sensors: Vec<Uuid>,
    /// The frame all its poses are given in.
    pub frame_id: String,
    /// Prior probabilities of objects; empty is uniform.
    pub prior: Vec<(Uuid, f64)>,
    /// The seed of its random streams.
    pub seed: u64,
    /// How long it lives without a reading.
    pub time_to_live_ms: u64,
    /// Further options as the server writes them down (JSON); may be empty.
    pub options: String,
    /// When it began.
    pub created_at_ms: u64,
    /// When it was closed.
    pub closed_at_ms: Option<u64>,
}

/// A reading as it came, in the driver's order, so that what is derived can be derived anew.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredReading {
    /// The sensor that took it.
    pub sensor: Uuid,
    /// Where the sensor was (in training: `object_from_sensor`); `None` when it was not known.
    pub session_from_sensor: Option<Pose>,
    /// Pressures in pascal in the driver's order; `None` is a taxel without a value.
    pub pressures: Vec<Option<f64>>,
    /// The robot's own time stamp, nanoseconds of its own clock.
    pub stamp_ns: Option<i64>,
    /// The number of the sensor's calibration that the pressures, which are stored as they
    /// came, are to be corrected with; 0 is none.
    pub calibration: u32,
    /// The client's own code of the press: finite numbers.
    pub feature: Option<Vec<f64>>,
    /// How far the sensor came along its +z with nothing in touch, metres; 0 when nobody said.
    pub approach: f64,
    /// How far the object may have moved since the reading before, when it may.
    pub object_moved: Option<Looseness>,
}

impl StoredReading {
    /// Whether a robot sent the same: the calibration is the service's own note.
    #[must_use]
    pub fn is_repeated_by(&self, other: &Self) -> bool {
        *self == Self { calibration: self.calibration, ..other.clone() }
    }
}

/// A robot's own number of a reading; with it a repeated request is recognised.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct ReadingId {
    /// The robot, at most [`crate::journal::ROBOT_BYTES_MAX`] bytes.
    pub robot: String,
    /// Its number.
    pub seq: u64,
}
