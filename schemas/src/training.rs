//! Catalogues on the wire: versions, training requests and their reports.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::appearance::{AppearanceSummary, AppearanceTraining};
use crate::belief::UncalibratedReason;
use crate::coupling::SensorKnowledge;
use crate::descriptor::Descriptor;
use crate::geometry::{GeometricReport, GeometricTraining, VersionReference};
use crate::labels::{Labels, LabelsSchema};
use crate::recalibration::RecalibrationReport;
use crate::symmetry::{SymmetryAxis, SymmetryBy};
use crate::warning::Warning;

/// A catalogue: a named series of trained versions, one of which new sessions use.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct Catalogue {
    /// Unique name of the catalogue. Requests that name none use `default`.
    pub name: String,
    /// The version that new sessions use; null until a training has succeeded.
    pub current: Option<CurrentVersion>,
    /// Number of the newest version; 0 if there is none.
    pub latest_version: u32,
    /// Names of further versions, such as `candidate`, and the versions that they name.
    #[serde(default)]
    pub aliases: BTreeMap<String, u32>,
    /// Its labels.
    #[serde(default)]
    #[schema(value_type = LabelsSchema)]
    pub labels: Labels,
    /// Past and present current versions, newest first; at most 100 entries.
    pub history: Vec<CurrentVersion>,
}

/// A page of catalogues.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct CataloguePage {
    /// The catalogues, sorted by name.
    pub items: Vec<Catalogue>,
    /// The cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// The version that new sessions use, and since when.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct CurrentVersion {
    /// Number of the version.
    pub version: u32,
    /// Number of switches of this catalogue. Its value is the `ETag`.
    pub revision: u32,
    /// When the version became current.
    #[schema(format = DateTime)]
    pub changed_at: String,
}

/// The version to make current.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SetCurrent {
    /// Number of a version of this catalogue.
    #[schema(minimum = 1)]
    pub version: u32,
}

/// The version that an alias names.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SetAlias {
    /// Number of a version of this catalogue.
    #[schema(minimum = 1)]
    pub version: u32,
}

/// A version of a catalogue: one trained model. It never changes.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct CatalogueVersion {
    /// The catalogue's name.
    pub catalogue: String,
    /// Number of the version, from 1.
    pub version: u32,
    /// Whether new sessions use the version.
    pub is_current: bool,
    /// When the version was trained.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// The job that trained or recalibrated the version; null if it was merged.
    pub job: Option<Uuid>,
    /// The two versions merged into this one; empty if it was trained.
    pub merged_from: Vec<VersionReference>,
    /// The training request, with defaults; that of the version before for a recalibrated one.
    pub training: StartTraining,
    /// The training report.
    pub report: TrainingReport,
    /// Why the version cannot be used, if its stored data is damaged; null if no damage is known.
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

/// Report of a training: results and cost.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct TrainingReport {
    /// The objects in the version.
    pub objects: Vec<ObjectReport>,
    /// Number of appearance classes in the vocabulary of the pair maps; 0 without pair maps.
    pub n_classes: u32,
    /// Memory of the pair index, in bytes.
    pub index_bytes: u64,
    /// Memory of all surfaces, in bytes; 0 without surfaces.
    #[serde(default)]
    pub surface_bytes: u64,
    /// Duration of the training, in seconds.
    pub seconds: f64,
    /// Seed of all random choices.
    pub seed: u64,
    /// Summary of the appearance part; null if not requested.
    #[serde(default)]
    pub appearance: Option<AppearanceSummary>,
    /// Objects that could not be trained, with reasons. They are not in the version.
    #[serde(default)]
    pub skipped: Vec<SkippedObject>,
    /// Probable mistakes in the training as a whole. Those of one object are in its own `warnings`.
    #[serde(default)]
    pub warnings: Vec<Warning>,
    /// Whether the probabilities of `surface` were calibrated on held-back readings or on ended
    /// sessions; null without surfaces, and for versions trained before this was reported.
    #[serde(default)]
    pub calibrated: Option<bool>,
    /// Number of objects whose readings the calibration was fitted to; that of the extended
    /// version, if its calibration is kept.
    #[serde(default)]
    pub calibrated_on: u32,
    /// Why the probabilities are not calibrated; null if they are, or if it is unknown.
    #[serde(default)]
    pub uncalibrated_reason: Option<UncalibratedReason>,
    /// Trust in the description of the sensor that pressed the meshes: with `measured` the version
    /// and its calibration hold for exactly the described sensor, with `data_sheet` and `unknown` for
    /// every sensor that the description may stand for, with `commissioned` for those that the
    /// passport of the sensor leaves open. Null if no mesh was pressed, and for versions
    /// trained before this was reported, whose meshes were pressed as with `measured`.
    #[serde(default)]
    pub sensor_knowledge: Option<SensorKnowledge>,
    /// The recalibration that made the version from an earlier one; null if it was trained.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recalibration: Option<RecalibrationReport>,
}

/// An object that the training skipped.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
pub struct SkippedObject {
    /// The object's id.
    pub id: Uuid,
    /// Name of the object when it was skipped.
    pub name: String,
    /// Why the object could not be trained.
    pub reason: String,
}

/// Training report of one object.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ObjectReport {
    /// The object's id.
    pub id: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// Number of readings the object was trained from.
    pub n_readings: u32,
    /// Trust in the description of the sensor that pressed its mesh; null if robots touched it.
    #[serde(default)]
    pub sensor_knowledge: Option<SensorKnowledge>,
    /// Number of patches in the map; 0 without pair maps.
    pub n_patches: u32,
    /// Memory of the pair index, in bytes.
    pub index_bytes: u64,
    /// Origin of the object frame in the mesh frame (or in the frame of the training readings), in
    /// metres. The axes are the same: `mesh point = object point + origin`. Zeros without pair maps
    /// and surfaces.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub origin_in_mesh: [f64; 3],
    /// Report of the surface; null without one.
    #[serde(default)]
    pub surface: Option<SurfaceReport>,
    /// Report of the contact map; null if not requested.
    #[serde(default)]
    pub geometric: Option<GeometricReport>,
    /// Symmetry axes in the object frame, highest order first; empty if there are none or if the
    /// touches cannot tell. Null without surfaces.
    #[serde(default)]
    pub symmetry: Option<Vec<SymmetryAxis>>,
    /// Source of `symmetry`; null without surfaces.
    #[serde(default)]
    pub symmetry_by: Option<SymmetryBy>,
    /// Approximate number of further touches that would settle an `undetermined` symmetry; null
    /// otherwise.
    #[serde(default)]
    pub symmetry_touches_needed: Option<u32>,
    /// Probable mistakes in the training data, such as positions in millimetres or too few touches.
    #[serde(default)]
    pub warnings: Vec<Warning>,
}

/// Report of an object's surface, as `surface` uses it.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct SurfaceReport {
    /// Number of touches kept.
    pub n_patches: u32,
    /// Number of touch pairs that propose poses.
    pub n_pairs: u32,
    /// Memory of the surface, in bytes.
    pub bytes: u64,
}

/// Trained map of one object, with one page of its patches.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ObjectMap {
    /// The object's id.
    pub id: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// Origin of the object frame in the mesh frame (or in the frame of the training readings), in
    /// metres. The axes are the same: `mesh point = object point + origin`.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub origin_in_mesh: [f64; 3],
    /// Distances between patches whose pairs are indexed.
    pub distances: MapDistances,
    /// Number of patch pairs in the index.
    pub n_postings: u64,
    /// Memory of the index, in bytes.
    pub index_bytes: u64,
    /// Number of patches on all pages together.
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
    /// Smallest distance in metres.
    pub min: f64,
    /// End of the last bin in metres.
    pub max: f64,
    /// Number of bins.
    pub n_bins: u32,
}

/// A patch: a trained piece of an object's surface, in the object frame.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct MapPatch {
    /// Position in metres.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub position: [f64; 3],
    /// Outward normal, a unit vector.
    #[schema(value_type = Vec<f64>, min_items = 3, max_items = 3)]
    pub normal: [f64; 3],
    /// Confidence of the normal, 0 to 1: how well the contact determined it.
    pub normal_confidence: f64,
    /// Likeliest appearance class, from 0; null if the patch is in no pair.
    #[serde(default)]
    pub class: Option<u32>,
}

/// Training request.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StartTraining {
    /// Ids or names of the objects. Default: every object that has a mesh or readings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 10_000)]
    pub objects: Option<Vec<String>>,
    /// Id or name of the sensor that touches meshes in simulation. Objects with readings of their
    /// own are trained from those. Default: `digitacts-6x6`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor: Option<String>,
    /// Trust in that sensor's description, which decides how meshes are pressed. Default:
    /// `commissioned` if the sensor has a passport, else that of the catalogue's current version if
    /// this sensor pressed it (with the warning `knowledge_kept` if the sensor states another),
    /// else that of the sensor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor_knowledge: Option<SensorKnowledge>,
    /// Number of simulated readings per object that has only a mesh, 20 to 20000. Default: 1000.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 20, maximum = 20_000)]
    pub readings_per_object: Option<u32>,
    /// Number of simulated readings for the surface of such an object, `readings_per_object` to 20000.
    /// The first `readings_per_object` of them also train everything else. A surface keeps at most 1000
    /// touches, spread evenly, and recognises better if it can choose from more. Default: 2400, or
    /// `readings_per_object` if that is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 20, maximum = 20_000)]
    pub surface_readings_per_object: Option<u32>,
    /// Seed of all random choices, at most 2⁵³ − 1. Default: 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 9_007_199_254_740_991_u64)]
    pub seed: Option<u64>,
    /// Number of appearance classes, 2 to 255. Default: 25.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 2, maximum = 255)]
    pub n_classes: Option<u32>,
    /// Descriptor that turns a press into a feature. Default: `mnti`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub descriptor: Option<Descriptor>,
    /// Distances of the touch pairs to learn. Default: from 8 mm to the object's size.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_range: Option<DistanceRange>,
    /// Contact maps for the methods `geometric…`. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometric: Option<GeometricTraining>,
    /// Training options for the methods `appearance…`. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub appearance: Option<AppearanceTraining>,
    /// Whether to learn the surfaces that `surface` needs. Default: the value of `sva`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<bool>,
    /// Whether to learn the pair maps that `sva` needs. Set false for readings without poses, which
    /// only train `appearance`, or, with `surface` true, for large catalogues. Default: true.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sva: Option<bool>,
    /// Version of the same catalogue to extend. Its vocabularies and objects are kept bit for bit;
    /// only `objects` are trained (default: those it does not know). `sensor_knowledge`, `n_classes`,
    /// `descriptor`, `distance_range`, `geometric`, `appearance`, `surface` and `sva` are taken
    /// from that version and must not be given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1)]
    pub extend: Option<u32>,
    /// Whether to make the version current as soon as it is trained. Default: true.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub activate: Option<bool>,
    /// Whether one object that cannot be trained fails the training. If false, the object is
    /// skipped and listed under `skipped` in the report. A training left without objects always
    /// fails. Default: false.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strict: Option<bool>,
}

/// A range of distances between touches, in 40 steps.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct DistanceRange {
    /// Smallest distance in metres.
    pub min: f64,
    /// Largest distance in metres. Default: the largest in the training data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
}
