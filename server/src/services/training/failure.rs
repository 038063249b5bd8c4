//! Errors of jobs, in words for the user.

use palpate_core::reading::ReadingError;
use palpate_core::training::TrainingError;
use palpate_core::units::Shown;
use palpate_dissertation::appearance::train::AppearanceTrainError;
use palpate_dissertation::geometric::train::GeometricTrainError;
use palpate_dissertation::occupancy::GridError;
use palpate_dissertation::occupancy::grid::CELLS_MAX;
use palpate_dissertation::sva::train::SvaTrainError;
use palpate_sim::mesh::MeshError;
use palpate_sim::rig::PlanarError;
use palpate_sim::sampler::SampleError;
use thiserror::Error;

use crate::cause::Cause;
use crate::model::NoPart;
use crate::services::catalogues::CatalogueError;
use crate::services::recalibration::RecalibrationError;
use crate::services::shadow::ShadowError;

/// Error of a training, a recalibration or a comparison.
#[derive(Debug, Error)]
pub(crate) enum TrainingFailure {
    #[error("it was told to stop")]
    Stopped,
    #[error(transparent)]
    NoPart(#[from] NoPart),
    #[error("object {object:?} has no data: upload a mesh or readings")]
    NoData { object: String },
    #[error("object {object:?} has readings of several sensors, expected one")]
    Sensors { object: String },
    #[error("object {object:?}: {source}")]
    Mesh { object: String, source: MeshError },
    #[error("object {object:?}: {source}")]
    Reading { object: String, source: ReadingError },
    #[error("object {object:?}: {source}; its mesh is {} mm large", Shown(*size * 1e3))]
    Sampling { object: String, size: f64, source: SampleError },
    #[error(
        "object {object:?}: none of {n_readings} readings of sensor {sensor:?} touched anything: \
         {meant}"
    )]
    NothingTouched { object: String, sensor: String, n_readings: usize, meant: String },
    #[error(
        "object {object:?} was touched by sensor {sensor:?} with {}×{} taxels, expected {}×{} as \
         the catalogue's other sensors: {hint}", found[0], found[1], expected[0], expected[1]
    )]
    Shape { object: String, sensor: String, expected: [usize; 2], found: [usize; 2], hint: String },
    #[error("nothing could be learnt of any of {n_objects} objects; the first: {first}")]
    NothingLeft { n_objects: usize, first: String },
    #[error("object {object:?}: {source}")]
    Mapping { object: String, source: SvaTrainError },
    #[error("object {object:?}: {source}")]
    Surface { object: String, source: TrainingError },
    #[error("object {object:?}: {source}")]
    Geometric { object: String, source: GeometricTrainError },
    #[error("object {object:?}: {source}")]
    Planar { object: String, source: PlanarError },
    #[error("object {object:?}: {source} with cells of {} mm", cell * 1e3)]
    Grid { object: String, cell: f64, source: GridError },
    #[error(
        "object {object:?} brings the maps to {found} cells of {} mm, expected at most \
         {CELLS_MAX} for all objects: choose larger cells", cell * 1e3
    )]
    Cells { object: String, cell: f64, found: usize },
    #[error(
        "object {object:?} has readings without poses, which pair maps, surfaces and geometry \
         need: train with `\"sva\": false` and `appearance`"
    )]
    NoPoses { object: String },
    #[error(
        "object {object:?} has no readings with features: features of clients cannot be simulated"
    )]
    NoFeatures { object: String },
    #[error("object {object:?} has features of {found} values, expected {expected} as the others")]
    FeatureLength { object: String, expected: usize, found: usize },
    #[error("object {object:?}: {source}")]
    Appearance { object: String, source: AppearanceTrainError },
    #[error(transparent)]
    AppearanceVocabulary(#[from] AppearanceTrainError),
    #[error(transparent)]
    Vocabulary(#[from] SvaTrainError),
    #[error("{source} ({n_touches} readings touched anything)")]
    Space { n_touches: usize, source: TrainingError },
    #[error(transparent)]
    Maps(#[from] GeometricTrainError),
    #[error(transparent)]
    Recalibration(RecalibrationError),
    #[error(transparent)]
    Shadow(ShadowError),
    #[error(transparent)]
    Catalogue(#[from] CatalogueError),
    #[error(transparent)]
    Cause(Cause),
}

impl<E: Into<Cause>> From<E> for TrainingFailure {
    fn from(error: E) -> Self {
        Self::Cause(error.into())
    }
}

impl From<RecalibrationError> for TrainingFailure {
    fn from(error: RecalibrationError) -> Self {
        match error {
            RecalibrationError::Stopped => Self::Stopped,
            error => Self::Recalibration(error),
        }
    }
}

impl From<ShadowError> for TrainingFailure {
    fn from(error: ShadowError) -> Self {
        match error {
            ShadowError::Stopped => Self::Stopped,
            error => Self::Shadow(error),
        }
    }
}

impl TrainingFailure {
    /// Name of the object at fault, if there is one.
    pub(super) fn object(&self) -> Option<&str> {
        match self {
            Self::NoData { object }
            | Self::Sensors { object }
            | Self::Mesh { object, .. }
            | Self::Reading { object, .. }
            | Self::Sampling { object, .. }
            | Self::NothingTouched { object, .. }
            | Self::Shape { object, .. }
            | Self::Mapping { object, .. }
            | Self::Surface { object, .. }
            | Self::Geometric { object, .. }
            | Self::Planar { object, .. }
            | Self::Grid { object, .. }
            | Self::Cells { object, .. }
            | Self::NoPoses { object }
            | Self::NoFeatures { object }
            | Self::FeatureLength { object, .. }
            | Self::Appearance { object, .. } => Some(object),
            Self::Stopped
            | Self::NoPart(_)
            | Self::NothingLeft { .. }
            | Self::Recalibration(_)
            | Self::Shadow(_)
            | Self::AppearanceVocabulary(_)
            | Self::Vocabulary(_)
            | Self::Space { .. }
            | Self::Maps(_)
            | Self::Catalogue(_)
            | Self::Cause(_) => None,
        }
    }
}
