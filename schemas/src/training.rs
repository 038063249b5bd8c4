//! Catalogues on the wire: their versions, the jobs that train them, and what came out.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::appearance::{AppearanceSummary, AppearanceTraining};
use crate::belief::UncalibratedReason;
use crate::geometry::{GeometryReport, GeometryTraining, VersionReference};
use crate::symmetry::{SymmetryAxis, SymmetryBy};
use crate::warning::Warning;

/// A named line of trained models, one of whose versions new sessions use.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Catalogue {
    /// The catalogue's unique name; `default` when nobody names another.
    pub name: String,
    /// What new sessions use; null until a training has succeeded.
    pub current: Option<CurrentVersion>,
    /// The number of its newest version; 0 before there is one.
    pub latest_version: u32,
    /// What was current when, newest first; at most 100 entries.
    pub history: Vec<CurrentVersion>,
}

/// A page of catalogues.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct CataloguePage {
    /// The catalogues in the order of their names.
    pub items: Vec<Catalogue>,
    /// The cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// Which version new sessions use, and since when.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct CurrentVersion {
    /// The version.
    pub version: u32,
    /// Counts the switches of this catalogue; its value is the `ETag`.
    pub revision: u32,
    /// When it was switched.
    #[schema(format = DateTime)]
    pub changed_at: String,
}

/// Which version new sessions are to use.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SetCurrent {
    /// A version of this catalogue.
    #[schema(minimum = 1)]
    pub version: u32,
}

/// One trained model. It never changes.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct CatalogueVersion {
    /// The catalogue's name.
    pub catalogue: String,
    /// The version, from 1.
    pub version: u32,
    /// Whether new sessions use it.
    pub is_current: bool,
    /// When it was trained.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// The job that trained it; null when it was merged.
    pub job: Option<Uuid>,
    /// The two versions whose maps were merged into it; empty when it was trained.
    pub merged_from: Vec<VersionReference>,
    /// What was asked for, defaults filled in.
    pub training: StartTraining,
    /// What came out.
    pub report: TrainingReport,
    /// Why it cannot be recognised with, when what is stored of it is damaged; null when
    /// nothing is known to be.
    #[serde(default)]
    pub damage: Option<String>,
}

/// A page of versions.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct CatalogueVersionPage {
    /// The versions, oldest first.
    pub items: Vec<CatalogueVersion>,
    /// The cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// What a training made, and what it cost.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct TrainingReport {
    /// The objects that it knows.
    pub objects: Vec<ObjectReport>,
    /// Number of appearance classes in the vocabulary of pair maps; 0 without pair maps.
    pub n_classes: u32,
    /// Memory of the pair index, in bytes.
    pub index_bytes: u64,
    /// Memory of all surfaces, in bytes; 0 without surfaces.
    #[serde(default)]
    pub surface_bytes: u64,
    /// How long the training took, in seconds.
    pub seconds: f64,
    /// The seed of all its random choices.
    pub seed: u64,
    /// What was learnt for the methods `appearance…`; null when nothing was asked for.
    #[serde(default)]
    pub appearance: Option<AppearanceSummary>,
    /// Objects that nothing could be learnt of, and why. They are not in the version.
    #[serde(default)]
    pub skipped: Vec<SkippedObject>,
    /// What is probably a mistake in the training as a whole; those of one object are in its own
    /// `warnings`.
    #[serde(default)]
    pub warnings: Vec<Warning>,
    /// Whether the probabilities of `surface` were calibrated on readings that were held back;
    /// null without surfaces, and of versions that were trained before this was reported.
    #[serde(default)]
    pub calibrated: Option<bool>,
    /// How many objects the readings are of that the calibration was learnt on: those of the
    /// extended version, when it is kept.
    #[serde(default)]
    pub calibrated_on: u32,
    /// Why the probabilities are not calibrated; null when they are, or it is not known.
    #[serde(default)]
    pub uncalibrated_reason: Option<UncalibratedReason>,
}

/// An object that a training left out.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct SkippedObject {
    /// The object's id.
    pub id: Uuid,
    /// The object's name when it was left out.
    pub name: String,
    /// Why nothing could be learnt of it.
    pub reason: String,
}

/// What a training made of one object.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ObjectReport {
    /// The object's id.
    pub id: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// How many readings it was trained from.
    pub n_readings: u32,
    /// How many patches its map has; 0 without pair maps.
    pub n_patches: u32,
    /// Memory of its pair index, in bytes.
    pub index_bytes: u64,
    /// Where the origin of the object's frame is in its mesh (or in the frame of its training
    /// readings), in metres: the axes are the same. `mesh point = object point + origin`.
    /// Zeros without pair maps and surfaces.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub origin_in_mesh: [f64; 3],
    /// Its surface; null when none was learnt.
    #[serde(default)]
    pub surface: Option<SurfaceReport>,
    /// What was learnt of its geometry; null when nothing was asked for.
    #[serde(default)]
    pub geometry: Option<GeometryReport>,
    /// Which turns leave it as it is: axes in the object frame, highest order first, empty when
    /// it only looks like itself or when touches cannot tell. Null when it was not sought:
    /// without surfaces.
    #[serde(default)]
    pub symmetry: Option<Vec<SymmetryAxis>>,
    /// What `symmetry` was decided by; null when it was not sought.
    #[serde(default)]
    pub symmetry_by: Option<SymmetryBy>,
    /// About how many more touches would settle a symmetry that is `undetermined`; else null.
    #[serde(default)]
    pub symmetry_touches_needed: Option<u32>,
    /// What is probably a mistake in what it was trained from, such as positions in millimetres
    /// or too few touches.
    #[serde(default)]
    pub warnings: Vec<Warning>,
}

/// The surface of an object, as the method `surface` knows it.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SurfaceReport {
    /// How many touches it keeps.
    pub n_patches: u32,
    /// How many pairs of them propose poses.
    pub n_pairs: u32,
    /// Its memory, in bytes.
    pub bytes: u64,
}

/// The trained map of one object, a page of its patches at a time.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ObjectMap {
    /// The object's id.
    pub id: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// Where the origin of the object's frame is in its mesh (or in the frame of its training
    /// readings), in metres: the axes are the same. `mesh point = object point + origin`.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub origin_in_mesh: [f64; 3],
    /// The distances between patches whose pairs are indexed.
    pub distances: MapDistances,
    /// How many pairs of patches the index lists.
    pub n_postings: u64,
    /// Memory of the index, in bytes.
    pub index_bytes: u64,
    /// How many patches the map has, on all pages together.
    pub n_patches: u32,
    /// The patches in the order of training.
    #[schema(max_items = 1000)]
    pub patches: Vec<MapPatch>,
    /// The cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// A range of distances in bins of equal width.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct MapDistances {
    /// The smallest distance in metres.
    pub min: f64,
    /// The end of the last bin in metres.
    pub max: f64,
    /// How many bins.
    pub n_bins: u32,
}

/// A trained piece of an object's surface, in the object frame.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct MapPatch {
    /// Its position in metres.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub position: [f64; 3],
    /// The outward normal, of length 1.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub normal: [f64; 3],
    /// How well the contact fixed the normal, 0 to 1.
    pub normal_confidence: f64,
    /// The class of appearance that it most likely belongs to, from 0; null when it is in no
    /// pair.
    #[serde(default)]
    pub class: Option<u32>,
}

/// What to train.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StartTraining {
    /// Ids or names of the objects; when not given, every object that has a mesh or readings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 10_000)]
    pub objects: Option<Vec<String>>,
    /// Id or name of the sensor that touches meshes in simulation; `digitacts-6x6` when not
    /// given. Objects with readings of their own are trained from those.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor: Option<String>,
    /// Simulated readings for an object with a mesh only, 20 to 20000; 1000 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 20, maximum = 20_000)]
    pub readings_per_object: Option<u32>,
    /// The seed of all random choices, up to 2⁵³ − 1; 1 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 9_007_199_254_740_991_u64)]
    pub seed: Option<u64>,
    /// Number of appearance classes, 2 to 255; 25 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 2, maximum = 255)]
    pub n_classes: Option<u32>,
    /// How a press becomes a feature; `mnti` when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub descriptor: Option<Descriptor>,
    /// Which pairs of touches to learn, by their distance; from 8 mm to the object's size
    /// when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_range: Option<DistanceRange>,
    /// What to learn for the methods `geometric…`; nothing when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometry: Option<GeometryTraining>,
    /// What to learn for the methods `appearance…`; nothing when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub appearance: Option<AppearanceTraining>,
    /// Whether to learn the surfaces that `surface` needs; when not given, as `pair_maps`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surfaces: Option<bool>,
    /// Whether to learn the maps of pairs of touches that `sva` needs; true when not given.
    /// False suits readings without poses, of which only `appearance` is learnt, and large
    /// catalogues for `surface` alone, with `surfaces`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pair_maps: Option<bool>,
    /// A version of the same catalogue to add to: its vocabularies and what it knows of its
    /// objects are kept bit by bit, only `objects` (those it does not know, when not given)
    /// are trained. How they are trained is the version's matter: `n_classes`, `descriptor`,
    /// `distance_range`, `geometry`, `appearance`, `surfaces` and `pair_maps` must not be given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1)]
    pub extend: Option<u32>,
    /// Whether new sessions use the version as soon as it is trained; true when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub activate: Option<bool>,
    /// Whether an object that nothing can be learnt of fails the training; when false (not
    /// given), it is left out and named in the report's `skipped`. A training that is left
    /// without objects fails either way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strict: Option<bool>,
}

/// How a press becomes a feature.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Descriptor {
    /// The pressures themselves: neither turns nor shifts are removed.
    Vectorize,
    /// Histograms of gradients, turned to the dominant orientation.
    Sift,
    /// Largest responses of oriented filters in four windows: several features a press, so not
    /// for methods that give each touch one appearance (`sva`, `sva_literal`).
    Mr8,
    /// The image turned to its principal axes.
    MomentNormalized,
    /// Fourier magnitudes of rings: does not change when the press is turned.
    PolarFourier,
    /// `polar_fourier` with each row divided by the root of its radius.
    PolarFourierRw,
    /// `polar_fourier` without the relations of neighbouring rings.
    PolarFourierNi,
    /// `polar_fourier` and what tells a press from its mirror image.
    PolarFourierSigned,
    /// Fourier magnitudes of the image turned to its principal axes: changes little when the
    /// press is turned or shifted.
    Mnti,
    /// Derivatives at the centre along the gradient: a control.
    Steerable,
    /// Responses of round filters: a control.
    Schmid,
    /// Strengths of spatial frequencies without place and direction, for large arrays.
    PolarSpectrum,
}

/// A range of distances between touches, in 40 steps.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DistanceRange {
    /// The smallest distance in metres.
    pub min: f64,
    /// The largest distance in metres; the largest that is trained when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
}

/// Long work: a training.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Job {
    /// The job's id.
    pub id: Uuid,
    /// The catalogue that it trains.
    pub catalogue: String,
    /// How far it is.
    pub state: JobState,
    /// What it does at the moment; null unless it runs.
    pub stage: Option<JobStage>,
    /// Steps done of this stage.
    pub done: u32,
    /// Steps of this stage; 0 when not known.
    pub total: u32,
    /// Seconds until the stage is done, as far as can be told.
    pub eta_s: Option<f64>,
    /// What was asked for, defaults filled in.
    pub training: StartTraining,
    /// The version that it made; null unless it succeeded.
    pub version: Option<u32>,
    /// Why it failed or was cancelled; null otherwise.
    pub reason: Option<String>,
    /// When it was asked for.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// When it began.
    #[schema(format = DateTime)]
    pub started_at: Option<String>,
    /// When it ended.
    #[schema(format = DateTime)]
    pub finished_at: Option<String>,
}

/// A page of jobs.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct JobPage {
    /// The jobs, oldest first.
    pub items: Vec<Job>,
    /// The cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// How far a job is.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// It waits for the jobs before it.
    Queued,
    /// It is being done.
    Running,
    /// It is done; `version` is what it made.
    Succeeded,
    /// It could not be done; `reason` says why.
    Failed,
    /// Somebody cancelled it.
    Cancelled,
}

impl JobState {
    /// Its name, as on the wire.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }

    /// Whether the job will change no more.
    #[must_use]
    pub fn is_final(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }
}

/// What a running training does.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobStage {
    /// Touching meshes in simulation; steps are readings.
    Sampling,
    /// Learning the appearance classes.
    Vocabulary,
    /// Building the objects' maps; steps are objects.
    Mapping,
    /// Learning the objects' surfaces, then how far they can be believed; steps are objects
    /// and one for the latter.
    Surface,
    /// Learning maps of contact and pressure; steps are objects.
    Geometry,
    /// Learning classes of appearance, then the objects' histograms; steps are the candidates
    /// for the number of classes and the objects.
    Appearance,
    /// Writing the version.
    Storing,
}
