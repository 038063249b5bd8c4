//! Round trips of appearance blocks, and refusals of invalid ones.

use palpate_core::descriptor::DescriptorKind;
use palpate_core::vocabulary::gmm::MixtureError;

use super::*;
use crate::model_codec::tests::check_damage;

const OBJECTS: [Uuid; 2] = [Uuid::from_u128(1), Uuid::from_u128(2)];

fn component(weight: f64, mean: [f64; 2]) -> Component {
    Component { weight, mean: mean.to_vec(), covariance: vec![2.0, 0.5, 0.5, 1.0] }
}

/// Two objects, three classes; features of three values, two components.
pub(in crate::model_codec) fn model() -> AppearanceModel {
    let components = vec![1.0, 0.0, 0.0, 0.0, 0.6, 0.8];
    let pca = Pca::from_parts(vec![0.1, 0.2, 0.3], components, vec![4.0, 1.0], 5.5).unwrap();
    // Thirds do not sum to 1 exactly; they must be restored unchanged.
    let weights = [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0 - 1e-14];
    let means = [[0.0, 0.0], [3.0, -1.0], [-2.0, 4.0]];
    let parts = weights.iter().zip(means).map(|(weight, mean)| component(*weight, mean));
    let vocabulary = AppearanceVocabulary {
        source: AppearanceSource::Image { descriptor: DescriptorKind::Mr8, rows: 6, cols: 7 },
        pca,
        discriminant: None,
        clustering: Clustering::Mixture(Mixture::new(parts.collect()).unwrap()),
        choices: vec![ClassCount { n_classes: 3, accuracy: 0.9, reliability: 0.7 }],
    };
    let object = |mass: [f64; 3], n_held_back: usize| {
        let reading = ReadingClasses { shares: vec![vec![0.5, 0.25, 0.25], vec![0.0, 1.0, 0.0]] };
        Arc::new(ObjectAppearance {
            histogram: ClassHistogram { mass: mass.to_vec() },
            joint: vec![0.25, 0.5, 0.25],
            held_back: vec![reading; n_held_back],
        })
    };
    let near = NearDuplicate { first: ObjectIdx(0), second: ObjectIdx(1), affinity: 0.97 };
    AppearanceModel {
        vocabulary: Arc::new(vocabulary),
        objects: vec![object([4.0, 2.0, 0.5], 2), object([1.0, 0.0, 7.5], 0)],
        smoothing: 1.0,
        exponent: 0.375,
        report: AppearanceReport {
            n_readings: 20,
            confusion: vec![vec![0.75, 0.25], vec![0.0, 0.0]],
            affinity: vec![vec![1.0, 0.97], vec![0.97, 1.0]],
            accuracy: 0.875,
            near_duplicates: vec![near],
        },
    }
}

/// Clients' features, discriminant axes and k-means: the other branches of the format.
fn other_model() -> AppearanceModel {
    let mean = vec![0.0; 2];
    let vocabulary = AppearanceVocabulary {
        source: AppearanceSource::External { dimension: 3 },
        discriminant: Some(Discriminant { mean, axes: vec![vec![1.0, -1.0]] }),
        clustering: Clustering::KMeans(KMeans {
            centers: vec![vec![-1.0], vec![0.0], vec![1.5]],
            cost: 2.5,
        }),
        ..(*model().vocabulary).clone()
    };
    AppearanceModel { vocabulary: Arc::new(vocabulary), ..model() }
}

fn decoded(blocks: &[(String, Vec<u8>)]) -> Result<AppearanceModel, CodecError> {
    let objects = blocks[2..].iter().map(|(_, block)| Ok(block.as_slice()));
    from_blocks(&blocks[0].1, &blocks[1].1, objects)
}

#[test]
fn appearance_is_restored_bit_by_bit() {
    for model in [model(), other_model()] {
        let blocks = to_blocks(&model, &OBJECTS);
        let names: Vec<&str> = blocks.iter().map(|(name, _)| name.as_str()).collect();
        let object = "appearance/00000000-0000-0000-0000-000000000001";
        assert_eq!(names[..3], [APPEARANCE_BLOCK, APPEARANCE_REPORT_BLOCK, object]);
        let back = decoded(&blocks).unwrap();
        assert_eq!(back, model);
        assert_eq!(to_blocks(&back, &OBJECTS), blocks);
    }
}

#[test]
fn block_lengths_follow_the_format() {
    let hash = |block: &[u8]| blake3::hash(block).to_hex()[..16].to_owned();
    let lengths = |model: &AppearanceModel| -> Vec<(usize, String)> {
        to_blocks(model, &OBJECTS).iter().map(|(_, b)| (b.len(), hash(b))).collect()
    };
    // Vocabulary: 10 counts; 3 + 6 + 2 + 1 numbers; 3 classes of 1 + 2 + 4; a candidate.
    // Report: 4 counts, 3 numbers, 2 matrices of 4, a pair. Objects: 3 counts, 2 × 3 numbers,
    // 2 readings of a count and 2 × 3 numbers.
    let expected = [
        (40 + 96 + 168 + 20, "fdaecbd7143f959f"),
        (16 + 24 + 64 + 16, "71255134e5429bc7"),
        (12 + 48 + 2 * (4 + 48), "7d49c05cd7cbd598"),
        (12 + 48, "2df8f1ec29ff53a3"),
    ];
    assert_eq!(lengths(&model()), expected.map(|(length, hash)| (length, hash.to_owned())));
    // 2 + 2 numbers of the axis; a cost and 3 centres.
    let other = lengths(&other_model());
    assert_eq!(other[0], (40 + 96 + 32 + 32 + 20, "69aa26937fe2c5fd".to_owned()));
}

#[test]
fn cut_longer_and_changed_blocks_never_panic() {
    for model in [model(), other_model()] {
        let is_valid = |model: AppearanceModel| model.vocabulary.is_consistent();
        check_damage(&to_blocks(&model, &OBJECTS), decoded, is_valid);
    }
}

#[test]
fn invalid_blocks_are_refused_by_fault() {
    let with = |place: usize, at: usize, bytes: &[u8]| {
        let mut all = to_blocks(&model(), &OBJECTS);
        all[place].1[at..at + bytes.len()].copy_from_slice(bytes);
        decoded(&all).unwrap_err()
    };
    assert_eq!(with(0, 0, &7u32.to_le_bytes()), CodecError::Form { found: 7, newest: 1 });
    let clustering = with(0, 28, &3u32.to_le_bytes());
    assert!(matches!(clustering, CodecError::Count { field: "clustering", .. }), "{clustering}");
    // The first class's weight, then the variance of all features.
    let weight = MixtureError::Weight { component: 0, found: 0.0 };
    assert_eq!(with(0, 40 + 96, &0f64.to_le_bytes()), CodecError::Mixture(weight));
    assert_eq!(with(0, 40 + 88, &(-1f64).to_le_bytes()), CodecError::Appearance);
    // An object's mass, the exponent, an object of a pair.
    assert_eq!(with(2, 12, &(-1f64).to_le_bytes()), CodecError::Appearance);
    assert_eq!(with(1, 24, &0f64.to_le_bytes()), CodecError::Appearance);
    let pair = with(1, 16 + 24 + 64, &2u32.to_le_bytes());
    assert!(matches!(pair, CodecError::Count { field: "object", high: 1, .. }), "{pair}");
    let mut fewer = to_blocks(&model(), &OBJECTS);
    fewer.pop();
    assert_eq!(decoded(&fewer), Err(CodecError::Report { expected: 1, found: 2 }));
}
