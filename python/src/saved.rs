//! A catalogue as bytes, for pickles and files: exact, and read by the same version only.

use std::sync::Arc;

use bincode::{Decode, Encode};
use glam::{DVec3, Vec3};
use palpate_core::belief::answer::StopRule;
use palpate_core::sensor::TaxelGrid;
use palpate_core::symmetry::{AxisOrder, Symmetry, SymmetryAxis};
use palpate_core::vocabulary::discriminant::Discriminant;
use palpate_recogniser::model::agreement::StoredFeature;
use palpate_recogniser::model::map::SurfaceLayout;
use palpate_recogniser::model::{
    AppearanceSpace, CalibrationBasis, EvidenceCalibration, EvidenceStage, SurfaceMap,
    SurfaceModel, SurfacePatch,
};

/// Beginning of the bytes. Another form of them gets another number.
const HEAD: &[u8] = b"palpate catalogue 1\n";
/// Most bytes that are read: far above a catalogue of thousands of objects.
const BYTES_MAX: usize = 4 << 30;

/// A trained catalogue.
#[derive(Decode, Encode)]
pub(crate) struct Saved {
    pub(crate) names: Vec<String>,
    pub(crate) n_readings: Vec<usize>,
    grid: (usize, usize, f64, f64),
    mean: Vec<f64>,
    axes: Vec<Vec<f64>>,
    anywhere: Vec<StoredFeature>,
    stages: [[f64; 3]; 3],
    width: f64,
    excess: f64,
    /// Kind of the basis, objects, sessions.
    basis: (u8, usize, usize),
    maps: Vec<Map>,
}

#[derive(Decode, Encode)]
struct Map {
    origin: [f64; 3],
    layout: (f32, f32, usize, f32, f32),
    patches: Vec<Patch>,
    center: [f64; 3],
    /// Point, direction and order of each axis; 0 is any angle.
    symmetry: Vec<([f64; 3], [f64; 3], u8)>,
}

#[derive(Decode, Encode)]
struct Patch {
    position: [f32; 3],
    normal: [f32; 3],
    direction: [f32; 3],
    elongation: f32,
    normal_deviation: f32,
    feature: StoredFeature,
}

impl Saved {
    /// The catalogue of a model.
    pub(crate) fn of(names: &[String], n_readings: &[usize], model: &SurfaceModel) -> Self {
        let (space, calibration) = (&model.space, &model.calibration);
        let TaxelGrid { rows, cols, pitch, taxel_width } = *space.grid();
        let Discriminant { mean, axes } = space.projection();
        let stage = |it: EvidenceStage| [it.temperature, it.unknown, it.unknown_per_touch];
        let basis = match calibration.basis {
            CalibrationBasis::HeldBack { objects } => (0, objects, 0),
            CalibrationBasis::OneObject => (1, 0, 0),
            CalibrationBasis::FewReadings => (2, 0, 0),
            CalibrationBasis::Sessions { sessions, objects } => (3, objects, sessions),
        };
        Self {
            names: names.to_vec(),
            n_readings: n_readings.to_vec(),
            grid: (rows, cols, pitch, taxel_width),
            mean: mean.clone(),
            axes: axes.clone(),
            anywhere: space.anywhere().to_vec(),
            stages: calibration.stages.map(stage),
            width: calibration.width,
            excess: calibration.stop.excess,
            basis,
            maps: model.maps().iter().map(|map| Map::of(map)).collect(),
        }
    }

    /// The bytes.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let coded = bincode::encode_to_vec(self, bincode::config::standard());
        [HEAD, &coded.expect("numbers, lists and texts can be written")].concat()
    }

    /// The catalogue of bytes; `None` if they are of another version or damaged.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let config = bincode::config::standard().with_limit::<BYTES_MAX>();
        let coded = bytes.strip_prefix(HEAD)?;
        let (saved, read): (Self, usize) = bincode::decode_from_slice(coded, config).ok()?;
        let n = saved.names.len();
        let fits = read == coded.len() && saved.maps.len() == n && saved.n_readings.len() == n;
        fits.then_some(saved)
    }

    /// The model, its look-up structures made anew.
    pub(crate) fn model(&self) -> SurfaceModel {
        let (rows, cols, pitch, taxel_width) = self.grid;
        let projection = Discriminant { mean: self.mean.clone(), axes: self.axes.clone() };
        let grid = TaxelGrid { rows, cols, pitch, taxel_width };
        let space = AppearanceSpace::new(grid, projection, self.anywhere.clone());
        let stage = |[temperature, unknown, unknown_per_touch]: [f64; 3]| EvidenceStage {
            temperature,
            unknown,
            unknown_per_touch,
        };
        let basis = match self.basis {
            (0, objects, _) => CalibrationBasis::HeldBack { objects },
            (1, ..) => CalibrationBasis::OneObject,
            (3, objects, sessions) => CalibrationBasis::Sessions { sessions, objects },
            _ => CalibrationBasis::FewReadings,
        };
        let calibration = EvidenceCalibration {
            stages: self.stages.map(stage),
            width: self.width,
            stop: StopRule { excess: self.excess },
            basis,
        };
        let maps = self.maps.iter().map(|map| Arc::new(map.surface())).collect();
        SurfaceModel::new(space, calibration, maps)
    }
}

impl Map {
    fn of(map: &SurfaceMap) -> Self {
        let SurfaceLayout { voxel, reach, pair_patches_max, pair_distance_min, pair_distance_edge } =
            map.layout();
        let patch = |patch: &SurfacePatch| Patch {
            position: patch.position.to_array(),
            normal: patch.normal.to_array(),
            direction: patch.direction.to_array(),
            elongation: patch.elongation,
            normal_deviation: patch.normal_deviation,
            feature: patch.feature,
        };
        let axis = |axis: &SymmetryAxis| {
            let order = match axis.order {
                AxisOrder::Finite(order) => order,
                AxisOrder::Continuous => 0,
            };
            (axis.point.to_array(), axis.direction.to_array(), order)
        };
        let symmetry = map.symmetry();
        Self {
            origin: map.origin_in_training().to_array(),
            layout: (voxel, reach, pair_patches_max, pair_distance_min, pair_distance_edge),
            patches: map.patches().iter().map(patch).collect(),
            center: symmetry.center.to_array(),
            symmetry: symmetry.axes.iter().map(axis).collect(),
        }
    }

    fn surface(&self) -> SurfaceMap {
        let patch = |patch: &Patch| SurfacePatch {
            position: Vec3::from_array(patch.position),
            normal: Vec3::from_array(patch.normal),
            direction: Vec3::from_array(patch.direction),
            elongation: patch.elongation,
            normal_deviation: patch.normal_deviation,
            feature: patch.feature,
        };
        let (voxel, reach, pair_patches_max, pair_distance_min, pair_distance_edge) = self.layout;
        let layout =
            SurfaceLayout { voxel, reach, pair_patches_max, pair_distance_min, pair_distance_edge };
        let axis = |(point, direction, order): &([f64; 3], [f64; 3], u8)| SymmetryAxis {
            point: DVec3::from_array(*point),
            direction: DVec3::from_array(*direction),
            order: if *order == 0 { AxisOrder::Continuous } else { AxisOrder::Finite(*order) },
        };
        let axes = self.symmetry.iter().map(axis).collect();
        let symmetry = Symmetry { center: DVec3::from_array(self.center), axes };
        let patches = self.patches.iter().map(patch).collect();
        SurfaceMap::new(self.origin.into(), patches, layout).with_symmetry(symmetry)
    }
}
