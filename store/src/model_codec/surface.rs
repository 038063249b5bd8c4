//! Conversion between trained surfaces and blocks: one shared, and two for each object.
//!
//! The shared block holds the appearance space and the calibration of evidence; one that was fitted
//! to sessions is in a block of its own (`calibration`). An object has one block for its touches
//! and one for its symmetry. The look-up structures (voxels, pairs)
//! are rebuilt from the touches when a block is read: they are derived, and ten times as
//! large. Metres, object frames; drawn in `docs/formats.md`.

use std::sync::Arc;

use glam::Vec3;
use palpate_core::sensor::TaxelGrid;
use palpate_core::symmetry::Symmetry;
use palpate_core::vocabulary::discriminant::Discriminant;
use palpate_recogniser::model::agreement::{N_AXES, StoredFeature};
use palpate_recogniser::model::appearance::raw_dimension;
use palpate_recogniser::model::map::{PATCHES_MAX, SurfaceLayout};
use palpate_recogniser::model::{AppearanceSpace, SurfaceMap, SurfacePatch};
use palpate_recogniser::model::{
    CalibrationBasis, EvidenceCalibration, EvidenceStage, SurfaceModel,
};
use rayon::prelude::*;
use uuid::Uuid;

use super::calibration::{self, CALIBRATION_BLOCK};
use super::reader::Reader;
use super::symmetry::{symmetry_block_name, symmetry_from_block, symmetry_to_block};
use super::writer::{put_counts, put_floats, put_singles};
use super::{CodecError, FORM, count};

/// Name of the block with the appearance space and the calibration.
pub const SURFACE_BLOCK: &str = "surface";
/// Form of that block. Form 1 did not contain the data behind the calibration, and compared
/// the evidence of "none of these" with the sum of all objects' instead of their mean.
const SHARED_FORM: u32 = 2;
/// Calibration stored in form 1 when nothing could be learnt.
const NOT_LEARNT_IN_FORM_1: [f64; 9] = [1.0, 0.0, 0.0, 1.2, 0.0, 0.0, 2.5, 13.0, 8.5];
/// Maximum number of objects behind a calibration.
const OBJECTS_MAX: u32 = 1 << 20;
/// Maximum number of background features.
const ANYWHERE_MAX: u32 = 1 << 16;
/// Number of values of a patch beside its feature.
const PATCH_SINGLES: usize = 11;
/// Number of values of a layout beside the paired patches.
const LAYOUT_SINGLES: usize = 4;

/// Name of the block with an object's surface.
#[must_use]
pub fn surface_block_name(object: Uuid) -> String {
    format!("{SURFACE_BLOCK}/{object}")
}

/// The blocks of one object.
pub(super) struct ObjectBlocks<'block> {
    pub(super) surface: &'block [u8],
    /// Missing in old versions: the object is read as one without symmetry.
    pub(super) symmetry: Option<&'block [u8]>,
}

/// The blocks of a catalogue's surfaces. `objects` are the ids of its objects, in its order.
pub(super) fn to_blocks(model: &SurfaceModel, objects: &[Uuid]) -> Vec<(String, Vec<u8>)> {
    let shared = (SURFACE_BLOCK.to_owned(), shared_to_block(model));
    let calibration = calibration::to_block(&model.calibration);
    let calibration = calibration.map(|block| (CALIBRATION_BLOCK.to_owned(), block));
    let maps = objects.iter().zip(model.maps()).flat_map(|(object, map)| {
        let symmetry = (symmetry_block_name(*object), symmetry_to_block(map.symmetry()));
        [(surface_block_name(*object), map_to_block(map)), symmetry]
    });
    std::iter::once(shared).chain(calibration).chain(maps).collect()
}

/// The surfaces of a shared block, of the `calibration` that was fitted to sessions if there is
/// one, and of the objects' blocks, in the catalogue's order.
pub(super) fn from_blocks<'block>(
    shared: &[u8],
    calibration: Option<&[u8]>,
    objects: impl Iterator<Item = Result<ObjectBlocks<'block>, CodecError>>,
) -> Result<SurfaceModel, CodecError> {
    let blocks: Vec<ObjectBlocks<'_>> = objects.collect::<Result<_, _>>()?;
    let (space, trained) = shared_from_block(shared, blocks.len())?;
    let calibration = calibration.map(calibration::from_block).transpose()?.unwrap_or(trained);
    let maps = blocks.par_iter().map(|block| {
        let symmetry = block.symmetry.map(symmetry_from_block).transpose()?;
        let map = map_from_block(block.surface)?;
        Ok::<_, CodecError>(Arc::new(map.with_symmetry(symmetry.unwrap_or(Symmetry::NONE))))
    });
    Ok(SurfaceModel::new(space, calibration, maps.collect::<Result<_, _>>()?))
}

fn shared_to_block(model: &SurfaceModel) -> Vec<u8> {
    let (space, grid) = (&model.space, model.space.grid());
    // A calibration of sessions is in its own block, which replaces that of this one.
    let calibration = match model.calibration.basis {
        CalibrationBasis::Sessions { .. } => EvidenceCalibration::default(),
        CalibrationBasis::HeldBack { .. }
        | CalibrationBasis::OneObject
        | CalibrationBasis::FewReadings => model.calibration,
    };
    let Discriminant { mean, axes } = space.projection();
    let mut block = Vec::new();
    let counts = [grid.rows, grid.cols, mean.len(), axes.len(), space.anywhere().len()].map(count);
    put_counts(&mut block, &[SHARED_FORM]);
    put_counts(&mut block, &counts);
    put_floats(&mut block, &[grid.pitch, grid.taxel_width]);
    for stage in &calibration.stages {
        put_floats(&mut block, &[stage.temperature, stage.unknown, stage.unknown_per_touch]);
    }
    put_counts(&mut block, &basis_to_counts(calibration.basis));
    put_floats(&mut block, mean);
    axes.iter().for_each(|axis| put_floats(&mut block, axis));
    block.extend(space.anywhere().iter().flatten().flat_map(|value| value.to_le_bytes()));
    block
}

fn basis_to_counts(basis: CalibrationBasis) -> [u32; 2] {
    match basis {
        CalibrationBasis::HeldBack { objects } => [0, count(objects)],
        CalibrationBasis::OneObject => [1, 0],
        CalibrationBasis::FewReadings | CalibrationBasis::Sessions { .. } => [2, 0],
    }
}

fn basis_from_block(reader: &mut Reader<'_>) -> Result<CalibrationBasis, CodecError> {
    let kind = reader.count("what the calibration rests on", 0, 2)?;
    let objects = reader.count("objects of the calibration", 0, OBJECTS_MAX)?;
    Ok(match kind {
        0 => CalibrationBasis::HeldBack { objects },
        1 => CalibrationBasis::OneObject,
        _ => CalibrationBasis::FewReadings,
    })
}

/// A calibration of form 1, of a catalogue of `n_objects`.
fn calibration_of_form_1(stages: [EvidenceStage; 3], n_objects: usize) -> EvidenceCalibration {
    let numbers = stages.map(|s| [s.temperature, s.unknown, s.unknown_per_touch]);
    if numbers.as_flattened() == NOT_LEARNT_IN_FORM_1 {
        let alone = CalibrationBasis::OneObject;
        let basis = if n_objects < 2 { alone } else { CalibrationBasis::FewReadings };
        return EvidenceCalibration { basis, ..EvidenceCalibration::default() };
    }
    let held_against_mean = |stage: EvidenceStage| EvidenceStage {
        unknown: stage.unknown - stage.temperature * (n_objects.max(1) as f64).ln(),
        ..stage
    };
    let basis = CalibrationBasis::HeldBack { objects: 0 };
    let stages = stages.map(held_against_mean);
    EvidenceCalibration { stages, basis, ..EvidenceCalibration::default() }
}

fn shared_from_block(
    block: &[u8],
    n_objects: usize,
) -> Result<(AppearanceSpace, EvidenceCalibration), CodecError> {
    let (mut reader, form) = Reader::of_forms(block, SHARED_FORM)?;
    let rows = reader.count("rows", 1, 1024)?;
    let cols = reader.count("cols", 1, 1024)?;
    let n_values = reader.count("values of a feature", 1, 1 << 20)?;
    let n_axes = reader.count("axes", 1, N_AXES as u32)?;
    let n_anywhere = reader.count("features anywhere", 1, ANYWHERE_MAX)?;
    let sizes = reader.floats("pitch and width", 2)?;
    let grid = TaxelGrid { rows, cols, pitch: sizes[0], taxel_width: sizes[1] };
    let stages = reader.floats("calibration", 9)?;
    let stage = |n: usize| EvidenceStage {
        temperature: stages[3 * n],
        unknown: stages[3 * n + 1],
        unknown_per_touch: stages[3 * n + 2],
    };
    let stages = [stage(0), stage(1), stage(2)];
    let calibration = match form {
        FORM => calibration_of_form_1(stages, n_objects),
        _ => {
            let basis = basis_from_block(&mut reader)?;
            EvidenceCalibration { stages, basis, ..EvidenceCalibration::default() }
        }
    };
    let mean = reader.floats("mean", n_values)?;
    let axes = (0..n_axes).map(|_| reader.floats("axes", n_values)).collect::<Result<_, _>>()?;
    let anywhere = features(&mut reader, n_anywhere)?;
    reader.end()?;
    let is_usable = grid.pitch > 0.0
        && grid.taxel_width > 0.0
        && calibration.stages.iter().all(|stage| stage.temperature > 0.0)
        && n_values == raw_dimension(&grid);
    if !is_usable {
        return Err(CodecError::Surface);
    }
    Ok((AppearanceSpace::new(grid, Discriminant { mean, axes }, anywhere), calibration))
}

fn map_to_block(map: &SurfaceMap) -> Vec<u8> {
    let (layout, patches) = (map.layout(), map.patches());
    let mut block = Vec::with_capacity(64 + patches.len() * (4 * PATCH_SINGLES + N_AXES));
    put_counts(&mut block, &[FORM, count(patches.len()), count(layout.pair_patches_max)]);
    put_floats(&mut block, &map.origin_in_training().to_array());
    let SurfaceLayout { voxel, reach, pair_distance_min, pair_distance_edge, .. } = layout;
    put_singles(&mut block, &[voxel, reach, pair_distance_min, pair_distance_edge]);
    for patch in patches {
        for vector in [patch.position, patch.normal, patch.direction] {
            put_singles(&mut block, &vector.to_array());
        }
        put_singles(&mut block, &[patch.elongation, patch.normal_deviation]);
    }
    block.extend(patches.iter().flat_map(|patch| patch.feature).flat_map(i8::to_le_bytes));
    block
}

fn map_from_block(block: &[u8]) -> Result<SurfaceMap, CodecError> {
    let mut reader = Reader::new(block)?;
    let n_patches = reader.count("patches", 1, PATCHES_MAX as u32)?;
    let pair_patches_max = reader.count("paired patches", 0, PATCHES_MAX as u32)?;
    let origin = reader.floats("origin", 3)?;
    let [voxel, reach, pair_distance_min, pair_distance_edge] =
        reader.singles(LAYOUT_SINGLES)?.try_into().map_err(|_| CodecError::Surface)?;
    let singles = reader.singles(n_patches * PATCH_SINGLES)?;
    if let Some(found) = singles.iter().find(|value| !value.is_finite()) {
        return Err(CodecError::Finite { field: "patches", found: f64::from(*found) });
    }
    let features = features(&mut reader, n_patches)?;
    reader.end()?;
    let lengths = [voxel, reach, pair_distance_edge];
    let usable = lengths.iter().all(|length| (1e-5..=1.0).contains(length));
    if !usable || !(0.0..=1.0).contains(&pair_distance_min) {
        return Err(CodecError::Surface);
    }
    let patch = |(numbers, feature): (&[f32; PATCH_SINGLES], StoredFeature)| {
        let [x, y, z, nx, ny, nz, dx, dy, dz, elongation, normal_deviation] = *numbers;
        SurfacePatch {
            position: Vec3::new(x, y, z),
            normal: Vec3::new(nx, ny, nz),
            direction: Vec3::new(dx, dy, dz),
            elongation,
            normal_deviation,
            feature,
        }
    };
    let numbers = singles.as_chunks::<PATCH_SINGLES>().0;
    let patches = numbers.iter().zip(features).map(patch).collect();
    let layout =
        SurfaceLayout { voxel, reach, pair_patches_max, pair_distance_min, pair_distance_edge };
    Ok(SurfaceMap::new([origin[0], origin[1], origin[2]].into(), patches, layout))
}

fn features(reader: &mut Reader<'_>, n: usize) -> Result<Vec<StoredFeature>, CodecError> {
    let bytes = reader.take(n, N_AXES)?.as_chunks::<N_AXES>().0;
    Ok(bytes.iter().map(|feature| feature.map(|byte| i8::from_le_bytes([byte]))).collect())
}

#[cfg(test)]
pub(super) mod tests {
    use glam::DVec3;
    use palpate_core::rng::{Purpose, Stream};
    use palpate_core::symmetry::AxisOrder;

    use super::*;
    use crate::model_codec::tests::check_length;

    /// Surfaces of two objects.
    pub(in crate::model_codec) fn model() -> SurfaceModel {
        let grid = TaxelGrid { rows: 6, cols: 7, pitch: 0.002, taxel_width: 0.0018 };
        let n_values = raw_dimension(&grid);
        let axis = |n: usize| (0..n_values).map(|value| (value * n) as f64 / 9.0).collect();
        let projection =
            Discriminant { mean: vec![0.5; n_values], axes: (1..=3).map(axis).collect() };
        let anywhere = vec![[1, -2, 3, 0, 0, 0, 127, -128], [0; N_AXES]];
        let mut calibration = EvidenceCalibration::default();
        calibration.stages[2].temperature = 1.75;
        calibration.basis = CalibrationBasis::HeldBack { objects: 2 };
        let space = AppearanceSpace::new(grid, projection, anywhere);
        let maps = vec![Arc::new(map(40, 1).with_symmetry(half_turn())), Arc::new(map(15, 2))];
        SurfaceModel::new(space, calibration, maps)
    }

    fn half_turn() -> Symmetry {
        Symmetry::through([0.0, 0.001, 0.0].into(), &[(DVec3::Z, AxisOrder::Finite(2))])
    }

    fn map(n: usize, seed: u64) -> SurfaceMap {
        let mut stream = Stream::new(seed, Purpose::Shape, 0);
        let patch = |index: usize| {
            let normal = stream.direction();
            SurfacePatch {
                position: (0.04 * normal).as_vec3(),
                normal: normal.as_vec3(),
                direction: normal.any_orthonormal_vector().as_vec3(),
                elongation: 0.25,
                normal_deviation: 0.125,
                feature: [index as i8; N_AXES],
            }
        };
        let layout = SurfaceLayout { pair_patches_max: 20, ..SurfaceLayout::default() };
        SurfaceMap::new([0.1, 0.2, 0.3].into(), (0..n).map(patch).collect(), layout)
    }

    #[test]
    fn surfaces_and_their_lookup_are_restored_bit_by_bit() {
        let objects = [Uuid::from_u128(1), Uuid::from_u128(2)];
        let blocks = to_blocks(&model(), &objects);
        let names: Vec<&str> = blocks.iter().map(|(name, _)| name.as_str()).collect();
        let [first, second] =
            objects.map(|object| [surface_block_name(object), symmetry_block_name(object)]);
        assert_eq!(names, ["surface", &first[0], &first[1], &second[0], &second[1]]);
        let parts = blocks[1..]
            .chunks(2)
            .map(|object| Ok(ObjectBlocks { surface: &object[0].1, symmetry: Some(&object[1].1) }));
        assert_eq!(from_blocks(&blocks[0].1, None, parts), Ok(model()));
    }

    #[test]
    fn objects_stored_without_a_symmetry_have_none() {
        let blocks = to_blocks(&model(), &[Uuid::from_u128(1), Uuid::from_u128(2)]);
        let parts = blocks[1..]
            .chunks(2)
            .map(|object| Ok(ObjectBlocks { surface: &object[0].1, symmetry: None }));
        let found = from_blocks(&blocks[0].1, None, parts).unwrap();
        assert_eq!(model().maps()[0].symmetry(), &half_turn());
        assert!(found.maps().iter().all(|map| map.symmetry().is_none()));
    }

    #[test]
    fn a_cut_or_longer_block_is_refused() {
        check_length(&shared_to_block(&model()), |block| shared_from_block(block, 2));
        check_length(&map_to_block(&map(12, 3)), map_from_block);
    }

    /// The shared block in form 1, without the data behind the calibration.
    fn in_form_1(model: &SurfaceModel) -> Vec<u8> {
        let mut block = shared_to_block(model);
        block[0] = 1;
        // After six counts, two sizes and nine numbers of the calibration.
        block.drain(112..120);
        block
    }

    #[test]
    fn the_data_behind_a_calibration_is_restored() {
        for basis in [CalibrationBasis::OneObject, CalibrationBasis::FewReadings] {
            let mut model = model();
            model.calibration.basis = basis;
            let (_, found) = shared_from_block(&shared_to_block(&model), 2).unwrap();
            assert_eq!(found, model.calibration);
        }
    }

    #[test]
    fn a_calibration_of_form_1_gives_the_same_evidence() {
        let block = in_form_1(&model());
        let (_, found) = shared_from_block(&block, 20).unwrap();
        assert_eq!(found.basis, CalibrationBasis::HeldBack { objects: 0 });
        let (stage, stored) = (found.stages[2], model().calibration.stages[2]);
        // Compared with the mean of twenty objects instead of their sum.
        let sums = stored.unknown / stored.temperature - 20f64.ln();
        assert!((stage.unknown / stage.temperature - sums).abs() < 1e-12, "{stage:?}");
        assert_eq!(
            shared_from_block(&[3, 0, 0, 0], 20),
            Err(CodecError::Form { found: 3, newest: 2 })
        );
    }

    #[test]
    fn an_unlearnt_calibration_of_form_1_is_recognised() {
        let mut model = model();
        let numbers = NOT_LEARNT_IN_FORM_1.as_chunks::<3>().0;
        for (stage, [temperature, unknown, unknown_per_touch]) in
            model.calibration.stages.iter_mut().zip(numbers)
        {
            *stage = EvidenceStage {
                temperature: *temperature,
                unknown: *unknown,
                unknown_per_touch: *unknown_per_touch,
            };
        }
        let block = in_form_1(&model);
        let basis = |n_objects| shared_from_block(&block, n_objects).unwrap().1.basis;
        assert_eq!(basis(1), CalibrationBasis::OneObject);
        assert_eq!(basis(2), CalibrationBasis::FewReadings);
    }

    #[test]
    fn invalid_surfaces_are_refused() {
        let block = map_to_block(&map(12, 3));
        let with = |at: usize, bytes: &[u8]| {
            let mut block = block.clone();
            block[at..at + bytes.len()].copy_from_slice(bytes);
            map_from_block(&block).unwrap_err()
        };
        // After three counts and the origin: the layout, then the first patch.
        assert_eq!(with(36, &0f32.to_le_bytes()), CodecError::Surface);
        let nan = with(52, &f32::NAN.to_le_bytes());
        assert!(matches!(nan, CodecError::Finite { field: "patches", .. }));
        let mut other = model();
        other.calibration.stages[1].temperature = 0.0;
        assert_eq!(shared_from_block(&shared_to_block(&other), 2), Err(CodecError::Surface));
    }
}
