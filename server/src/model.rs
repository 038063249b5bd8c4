//! A version of a catalogue in memory: the values of core and store that sessions recognise by.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::symmetry::Symmetry;
use palpate_dissertation::appearance::model::AppearanceModel;
use palpate_dissertation::geometric::PreparedGeometry;
use palpate_dissertation::geometric::model::GeometricModel;
use palpate_dissertation::sva::model::ObjectMap;
use palpate_recogniser::model::SurfaceModel;
use palpate_store::catalogue::VersionObject;
use palpate_store::model::TrainedModel;
use palpate_store::model_codec::ModelPart;
use thiserror::Error;
use uuid::Uuid;

/// A loaded version: the part that a method needs, or all parts.
pub(crate) struct Model {
    pub(crate) catalogue: Uuid,
    pub(crate) name: String,
    pub(crate) version: u32,
    pub(crate) core: Arc<TrainedModel>,
    pub(crate) objects: Vec<VersionObject>,
    /// Origin of each object's frame in its training frame, metres.
    pub(crate) origins_in_model: Arc<[DVec3]>,
    /// The symmetries of its objects; empty where no method of the part reports poses modulo
    /// symmetry.
    pub(crate) symmetries: Arc<[Symmetry]>,
    /// Geometry shared by sessions.
    pub(crate) prepared: Option<PreparedGeometry>,
}

/// A version that was trained without a part of the model.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("version {version} of catalogue {catalogue:?} {}", lacking(*.part))]
pub(crate) struct NoPart {
    pub(crate) part: ModelPart,
    pub(crate) catalogue: String,
    pub(crate) version: u32,
}

impl Model {
    /// The geometry of its objects with the look-up tables of sessions.
    pub(crate) fn prepared(&self) -> Result<&PreparedGeometry, NoPart> {
        self.prepared.as_ref().ok_or_else(|| self.lacks(ModelPart::Geometric))
    }

    /// The geometry of its objects.
    pub(crate) fn geometric(&self) -> Result<&Arc<GeometricModel>, NoPart> {
        self.core.geometric.as_ref().ok_or_else(|| self.lacks(ModelPart::Geometric))
    }

    /// The appearance of its objects.
    pub(crate) fn appearance(&self) -> Result<&Arc<AppearanceModel>, NoPart> {
        self.core.appearance.as_ref().ok_or_else(|| self.lacks(ModelPart::Appearance))
    }

    /// The surfaces of its objects.
    pub(crate) fn surface(&self) -> Result<&Arc<SurfaceModel>, NoPart> {
        self.core.surface.as_ref().ok_or_else(|| self.lacks(ModelPart::Surface))
    }

    /// The maps of pairs of touches, one per object.
    pub(crate) fn sva(&self) -> Result<&[Arc<ObjectMap>], NoPart> {
        let maps = self.core.sva.objects.as_slice();
        if maps.len() == self.objects.len() {
            return Ok(maps);
        }
        Err(self.lacks(ModelPart::Sva))
    }

    /// The index of an object in the model, by its id or its name in training.
    pub(crate) fn find(&self, reference: &str) -> Option<usize> {
        match Uuid::parse_str(reference) {
            Ok(id) => self.objects.iter().position(|object| object.id == id),
            Err(_) => self.objects.iter().position(|object| object.name == reference),
        }
    }

    fn lacks(&self, part: ModelPart) -> NoPart {
        NoPart { part, catalogue: self.name.clone(), version: self.version }
    }
}

/// The name of a part for people and metrics.
pub(crate) fn part_name(part: ModelPart) -> &'static str {
    match part {
        ModelPart::Sva => "sva",
        ModelPart::Geometric => "geometric",
        ModelPart::Appearance => "appearance",
        ModelPart::Surface => "surface",
    }
}

/// The missing part of a version, and the remedy, in words.
fn lacking(part: ModelPart) -> &'static str {
    match part {
        ModelPart::Sva => {
            "has no pair maps: it was trained with `\"sva\": false`, use the methods \
             `appearance…`"
        }
        ModelPart::Geometric => {
            "has no geometry: train one with `\"geometric\": {\"kind\": \"planar\"}` or `solid`"
        }
        ModelPart::Appearance => "has no appearance: train one with `\"appearance\": {}`",
        ModelPart::Surface => {
            "was trained without surfaces: train it again, or use the method `sva`"
        }
    }
}
