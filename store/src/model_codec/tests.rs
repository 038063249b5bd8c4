//! Round trips of a whole model.

use palpate_core::descriptor::DescriptorKind;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::vocabulary::{Association, ClassIdx};
use palpate_dissertation::patch::Patch;
use palpate_recogniser::model::{CalibrationBasis, EvidenceCalibration, SurfaceModel};

use super::*;

fn map(n_patches: usize, seed: u64) -> ObjectMap {
    let mut stream = Stream::new(seed, Purpose::Sampling, 0);
    let patches: Vec<Patch> = (0..n_patches)
        .map(|patch| Patch {
            position: stream.direction() * 0.04,
            normal: stream.direction(),
            normal_confidence: 0.5,
            classes: vec![
                Association { class: ClassIdx((patch % 3) as u8), weight: 0.75 },
                Association { class: ClassIdx(((patch + 1) % 3) as u8), weight: 0.25 },
            ],
        })
        .collect();
    let distances = DistanceBins::new(0.008, 0.08, 40).unwrap();
    ObjectMap::build(&patches, [0.1, 0.2, 0.3].into(), 3, distances).unwrap()
}

fn model() -> TrainedModel {
    let medoid = |class: usize| (0..36).map(|value| (value * class) as f64 / 7.0).collect();
    let vocabulary = Vocabulary {
        descriptor: DescriptorKind::Mnti,
        rows: 6,
        cols: 7,
        mean: vec![0.25; 36],
        medoids: (0..3).map(medoid).collect(),
        spreads: vec![0.1, 0.2, 0.3],
    };
    let association = AssociationRule { threshold: 0.75, max_classes: 4 };
    let objects = vec![Arc::new(map(30, 1)), Arc::new(map(12, 2))];
    TrainedModel {
        sva: Arc::new(SvaModel { vocabulary, association, objects }),
        geometric: None,
        appearance: None,
        surface: None,
    }
}

const OBJECTS: [Uuid; 2] = [Uuid::from_u128(1), Uuid::from_u128(2)];

#[test]
fn a_model_is_restored_bit_by_bit() {
    let blocks = model_to_blocks(&model(), &OBJECTS);
    assert_eq!(blocks.len(), 3);
    assert_eq!(model_from_blocks(&blocks, &OBJECTS), Ok(model()));
}

#[test]
fn a_calibration_of_sessions_has_a_block_of_its_own() {
    let trained = surface::tests::model();
    let basis = CalibrationBasis::Sessions { sessions: 30, objects: 2 };
    let fitted = EvidenceCalibration { width: 1.4, basis, ..trained.calibration };
    let recalibrated = trained.clone().with_calibration(fitted);
    let blocks = |surface: SurfaceModel| {
        model_to_blocks(&TrainedModel { surface: Some(Arc::new(surface)), ..model() }, &OBJECTS)
    };
    let (before, after) = (blocks(trained), blocks(recalibrated));
    assert!(before.iter().all(|(name, _)| name != CALIBRATION_BLOCK));
    let own = after.iter().find(|(name, _)| name == CALIBRATION_BLOCK).unwrap();
    // With the blocks of before, the one block makes the model of after.
    let both: Vec<_> = before.into_iter().chain([own.clone()]).collect();
    for blocks in [&after, &both] {
        let found = model_from_blocks(blocks, &OBJECTS).unwrap().surface.unwrap();
        assert_eq!(found.calibration, fitted);
    }
}

#[test]
fn geometry_is_restored_and_needs_every_objects_block() {
    let geometric = Some(Arc::new(geometry::tests::model()));
    let model = TrainedModel { geometric, ..model() };
    let blocks = model_to_blocks(&model, &OBJECTS);
    assert_eq!(model_from_blocks(&blocks, &OBJECTS), Ok(model));
    let missing = model_from_blocks(&blocks[..5], &OBJECTS).unwrap_err();
    assert_eq!(missing, CodecError::Missing { name: geometry_block_name(OBJECTS[1]) });
}

#[test]
fn appearance_is_restored_with_and_without_maps() {
    let appearance = Some(Arc::new(appearance::tests::model()));
    let (mean, medoids, spreads) = (Vec::new(), Vec::new(), Vec::new());
    let trained = (*model().sva).clone();
    let nothing = Vocabulary { mean, medoids, spreads, ..trained.vocabulary.clone() };
    let without = SvaModel { vocabulary: nothing, objects: Vec::new(), ..trained.clone() };
    for sva in [trained, without] {
        let (sva, appearance) = (Arc::new(sva), appearance.clone());
        let model = TrainedModel { sva, appearance, ..model() };
        let blocks = model_to_blocks(&model, &OBJECTS);
        assert_eq!(model_from_blocks(&blocks, &OBJECTS), Ok(model));
        let last = blocks.len() - 1;
        let missing = model_from_blocks(&blocks[..last], &OBJECTS).unwrap_err();
        assert_eq!(missing, CodecError::Missing { name: appearance_block_name(OBJECTS[1]) });
    }
}

#[test]
fn surfaces_are_restored_and_need_every_objects_block() {
    let surface = Some(Arc::new(surface::tests::model()));
    let model = TrainedModel { surface, ..model() };
    let blocks = model_to_blocks(&model, &OBJECTS);
    assert_eq!(model_from_blocks(&blocks, &OBJECTS), Ok(model));
    let missing = model_from_blocks(&blocks[..6], &OBJECTS).unwrap_err();
    assert_eq!(missing, CodecError::Missing { name: surface_block_name(OBJECTS[1]) });
}

#[test]
fn objects_may_be_omitted_or_reordered() {
    let blocks = model_to_blocks(&model(), &OBJECTS);
    let turned = model_from_blocks(&blocks, &[OBJECTS[1]]).unwrap();
    assert_eq!(turned.sva.objects, [Arc::clone(&model().sva.objects[1])]);
    let missing = model_from_blocks(&blocks[..2], &OBJECTS).unwrap_err();
    assert_eq!(missing, CodecError::Missing { name: map_block_name(OBJECTS[1]) });
}

/// Checks that a block is read, but neither cut nor longer.
#[track_caller]
pub(super) fn check_length<T>(block: &[u8], decode: impl Fn(&[u8]) -> Result<T, CodecError>) {
    assert!(decode(block).is_ok());
    for length in 0..block.len() {
        assert!(decode(&block[..length]).is_err(), "{length} of {}", block.len());
    }
    assert!(decode(&[block, &[0]].concat()).is_err());
}

/// Checks that blocks of another length are refused, and that blocks with a changed byte are
/// refused or make a valid model.
#[track_caller]
pub(super) fn check_damage<T>(
    blocks: &[(String, Vec<u8>)],
    decode_all: impl Fn(&[(String, Vec<u8>)]) -> Result<T, CodecError>,
    is_valid: impl Fn(T) -> bool,
) {
    for (place, (name, block)) in blocks.iter().enumerate() {
        let decode = |block: &[u8]| {
            let mut all = blocks.to_vec();
            all[place].1 = block.to_vec();
            decode_all(&all)
        };
        check_length(block, decode);
        for (at, value) in (0..block.len()).flat_map(|at| [(at, 0), (at, 0x7f), (at, 0xff)]) {
            let mut changed = block.clone();
            changed[at] = value;
            assert!(decode(&changed).ok().is_none_or(&is_valid), "{name}: {value} at {at}");
        }
    }
}

#[test]
fn a_cut_or_longer_block_is_refused() {
    check_length(&vocabulary_to_block(&model().sva), vocabulary_from_block);
    check_length(&map_to_block(&map(12, 3)), map_from_block);
}

#[test]
fn invalid_blocks_are_refused_by_fault() {
    let block = map_to_block(&map(12, 3));
    let with = |at: usize, bytes: &[u8]| {
        let mut block = block.clone();
        block[at..at + bytes.len()].copy_from_slice(bytes);
        map_from_block(&block).unwrap_err()
    };
    assert_eq!(with(0, &9u32.to_le_bytes()), CodecError::Form { found: 9, newest: 1 });
    assert!(matches!(with(8, &0u32.to_le_bytes()), CodecError::Count { field: "classes", .. }));
    assert!(matches!(with(20, &9f64.to_le_bytes()), CodecError::Distances(_)));
    let nan = with(60, &f32::NAN.to_le_bytes());
    assert!(matches!(nan, CodecError::Finite { field: "patches", .. }));
    // The last posting's first patch.
    assert_eq!(with(block.len() - 6, &12u16.to_le_bytes()), CodecError::Index);
    // The first offset.
    assert_eq!(with(60 + 12 * 28, &1u32.to_le_bytes()), CodecError::Index);
}

#[test]
fn a_map_over_another_vocabulary_is_refused() {
    let mut other = model();
    let vocabulary = &mut Arc::make_mut(&mut other.sva).vocabulary;
    vocabulary.medoids.pop();
    vocabulary.spreads.pop();
    let error = model_from_blocks(&model_to_blocks(&other, &OBJECTS), &OBJECTS).unwrap_err();
    assert_eq!(error, CodecError::Classes { expected: 2, found: 3 });
}
