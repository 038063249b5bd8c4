//! A trained model: the parts that a version's recognisers need, in the catalogue's order.

use std::sync::Arc;

use palpate_dissertation::appearance::model::AppearanceModel;
use palpate_dissertation::geometric::model::GeometricModel;
use palpate_dissertation::sva::model::SvaModel;
use palpate_recogniser::model::SurfaceModel;

/// The parts of one version; all count the same objects.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainedModel {
    /// The vocabulary, and the pair maps of chapter 5 where they were trained.
    pub sva: Arc<SvaModel>,
    /// The occupancy maps of chapter 3, where they were trained.
    pub geometric: Option<Arc<GeometricModel>>,
    /// The appearance histograms of chapter 4, where they were trained.
    pub appearance: Option<Arc<AppearanceModel>>,
    /// The surfaces of the service's own recogniser, where they were trained.
    pub surface: Option<Arc<SurfaceModel>>,
}
