//! A trained model: the parts of a version, in the catalogue's order.

use std::sync::Arc;

use palpate_dissertation::appearance::model::AppearanceModel;
use palpate_dissertation::geometric::model::GeometricModel;
use palpate_dissertation::sva::model::SvaModel;
use palpate_recogniser::model::SurfaceModel;

/// The parts of one version, all with the same objects.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainedModel {
    /// The vocabulary, and the pair maps of chapter 5 if trained.
    pub sva: Arc<SvaModel>,
    /// The occupancy maps of chapter 3, if trained.
    pub geometric: Option<Arc<GeometricModel>>,
    /// The appearance histograms of chapter 4, if trained.
    pub appearance: Option<Arc<AppearanceModel>>,
    /// The surfaces of the service's own recogniser, if trained.
    pub surface: Option<Arc<SurfaceModel>>,
}
