//! Trained models ↔ blocks: one for the vocabulary, one for each object's map, and where
//! geometry was trained the blocks of `geometry`.
//!
//! Blocks are raw little-endian arrays behind a short header, drawn in `docs/formats.md`.
//! That a block is whole is checked before it comes here (envelope and hash); here it is
//! checked that its numbers make a model. A map's block does not know its place in the
//! catalogue, so versions share the maps of objects that were not trained again.

mod geometry;
mod reader;

use std::sync::Arc;

use palpate_core::descriptor::DescriptorKind;
use palpate_core::model::geometry::ClassTableError;
use palpate_core::model::{Catalogue, MapPatch, ObjectMap};
use palpate_core::occupancy::GridError;
use palpate_core::patch_pair::distance::DistanceBinsError;
use palpate_core::patch_pair::index::Posting;
use palpate_core::patch_pair::{DistanceBins, PairIndex};
use palpate_core::vocabulary::{AssociationRule, MAX_CLASSES, Vocabulary};
use reader::Reader;
use thiserror::Error;
use uuid::Uuid;

pub use geometry::{GEOMETRY_BLOCK, geometry_block_name};

/// The name of the vocabulary's block.
pub const VOCABULARY_BLOCK: &str = "vocabulary";
/// The number of the form that is written today.
const FORM: u32 = 1;

/// The name of the block with an object's map.
#[must_use]
pub fn map_block_name(object: Uuid) -> String {
    format!("map/{object}")
}

/// Why a block is not the part of a model it should be.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CodecError {
    /// The block was written by a newer Palpate.
    #[error("block has form {found}, this version of Palpate knows {FORM}")]
    Form {
        /// The form's number.
        found: u32,
    },
    /// The block ends early or goes on for too long.
    #[error("block has {found} bytes, expected {expected}")]
    Length {
        /// What its header says, at least.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// A number of the header is out of range.
    #[error("{field} is {found}, expected {low} to {high}")]
    Count {
        /// The number's name.
        field: &'static str,
        /// What was found.
        found: u32,
        /// The smallest possible.
        low: u32,
        /// The largest possible.
        high: u32,
    },
    /// A number is infinite or not a number.
    #[error("{field} holds {found}, expected finite numbers")]
    Finite {
        /// The array's name.
        field: &'static str,
        /// What was found.
        found: f64,
    },
    /// The distance bins are not a range.
    #[error(transparent)]
    Distances(#[from] DistanceBinsError),
    /// The index's arrays do not fit together or name patches that are not there.
    #[error("offsets and postings of the pair index do not fit together")]
    Index,
    /// The catalogue's blocks do not include one that its manifest's objects need.
    #[error("block {name} is missing")]
    Missing {
        /// The block's name.
        name: String,
    },
    /// A grid of occupancy or force is not one.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The table of class probabilities is not one.
    #[error(transparent)]
    ClassTable(#[from] ClassTableError),
    /// A taxel's gain is not one.
    #[error("gain is {found}, expected a finite number above 0")]
    Gain {
        /// What was found.
        found: f64,
    },
    /// A map was built over another vocabulary.
    #[error("map has {found} classes, expected the vocabulary's {expected}")]
    Classes {
        /// Classes of the vocabulary.
        expected: usize,
        /// Classes of the map.
        found: usize,
    },
}

/// The blocks of a model: names and contents. `objects` are the ids of the model's objects,
/// in its order.
#[must_use]
pub fn model_to_blocks(model: &Catalogue, objects: &[Uuid]) -> Vec<(String, Vec<u8>)> {
    let vocabulary = (VOCABULARY_BLOCK.to_owned(), vocabulary_to_block(model));
    let maps = objects
        .iter()
        .zip(&model.objects)
        .map(|(object, map)| (map_block_name(*object), map_to_block(map)));
    let geometry = model.geometry.iter().flat_map(|model| geometry::to_blocks(model, objects));
    std::iter::once(vocabulary).chain(maps).chain(geometry).collect()
}

/// The model of a version's blocks. `objects` are the ids of its objects, in its order;
/// other blocks are left alone. Without the block [`GEOMETRY_BLOCK`] the model has no
/// geometry.
///
/// # Errors
/// [`CodecError`] names what is missing or does not fit.
pub fn model_from_blocks(
    blocks: &[(String, Vec<u8>)],
    objects: &[Uuid],
) -> Result<Catalogue, CodecError> {
    let find = |name: &str| {
        let found = blocks.iter().find(|(candidate, _)| *candidate == name);
        found.map(|(_, content)| content.as_slice())
    };
    let block = |name: String| find(&name).ok_or(CodecError::Missing { name });
    let (vocabulary, association) = vocabulary_from_block(block(VOCABULARY_BLOCK.to_owned())?)?;
    let map = |object: &Uuid| {
        let map = map_from_block(block(map_block_name(*object))?)?;
        let (expected, found) = (vocabulary.n_classes(), map.index().n_classes());
        if expected == found {
            Ok(Arc::new(map))
        } else {
            Err(CodecError::Classes { expected, found })
        }
    };
    let maps = objects.iter().map(map).collect::<Result<_, _>>()?;
    let geometry = find(GEOMETRY_BLOCK).map(|shared| {
        let block = |object: &Uuid| block(geometry_block_name(*object));
        geometry::from_blocks(shared, objects.iter().map(block))
    });
    let geometry = geometry.transpose()?.map(Arc::new);
    Ok(Catalogue { vocabulary, association, objects: maps, geometry })
}

/// The block of a model's vocabulary and association rule.
#[must_use]
pub fn vocabulary_to_block(model: &Catalogue) -> Vec<u8> {
    let vocabulary = &model.vocabulary;
    let mut block = Vec::new();
    for number in [
        FORM,
        descriptor_code(vocabulary.descriptor),
        count(vocabulary.rows),
        count(vocabulary.cols),
        count(vocabulary.mean.len()),
        count(vocabulary.n_classes()),
        count(model.association.max_classes),
    ] {
        block.extend_from_slice(&number.to_le_bytes());
    }
    let medoids = vocabulary.medoids.iter().flatten();
    for value in std::iter::once(&model.association.threshold)
        .chain(&vocabulary.mean)
        .chain(medoids)
        .chain(&vocabulary.spreads)
    {
        block.extend_from_slice(&value.to_le_bytes());
    }
    block
}

/// The vocabulary and association rule of a block.
///
/// # Errors
/// [`CodecError`] says which number is wrong.
pub fn vocabulary_from_block(block: &[u8]) -> Result<(Vocabulary, AssociationRule), CodecError> {
    let mut reader = Reader::new(block)?;
    let descriptor = match reader.count("descriptor", 1, 2)? {
        1 => DescriptorKind::Vectorize,
        _ => DescriptorKind::Mnti,
    };
    let rows = reader.count("rows", 1, 1024)?;
    let cols = reader.count("cols", 1, 1024)?;
    let n_values = reader.count("values of a feature", 1, 1 << 20)?;
    let n_classes = reader.count("classes", 1, MAX_CLASSES as u32)?;
    let max_classes = reader.count("classes of a feature", 1, MAX_CLASSES as u32)?;
    let threshold = reader.floats("threshold", 1)?[0];
    let mean = reader.floats("mean", n_values)?;
    let medoids = (0..n_classes).map(|_| reader.floats("medoids", n_values));
    let medoids = medoids.collect::<Result<_, _>>()?;
    let spreads = reader.floats("spreads", n_classes)?;
    reader.end()?;
    let vocabulary = Vocabulary { descriptor, rows, cols, mean, medoids, spreads };
    Ok((vocabulary, AssociationRule { threshold, max_classes }))
}

/// The block of an object's map.
#[must_use]
pub fn map_to_block(map: &ObjectMap) -> Vec<u8> {
    let index = map.index();
    let (patches, postings) = (map.patches(), index.postings());
    let bytes = 64 + patches.len() * 28 + index.offsets().len() * 4 + postings.len() * 6;
    let mut block = Vec::with_capacity(bytes);
    for number in [
        FORM,
        count(patches.len()),
        count(index.n_classes()),
        u32::from(index.distances().n()),
        count(postings.len()),
    ] {
        block.extend_from_slice(&number.to_le_bytes());
    }
    let [x, y, z] = map.origin_in_training().to_array();
    for value in [index.distances().min(), index.distances().max(), x, y, z] {
        block.extend_from_slice(&value.to_le_bytes());
    }
    for patch in patches {
        let [nx, ny, nz] = patch.normal;
        let [x, y, z] = patch.position;
        for value in [x, y, z, nx, ny, nz, patch.normal_confidence] {
            block.extend_from_slice(&value.to_le_bytes());
        }
    }
    for offset in index.offsets() {
        block.extend_from_slice(&offset.to_le_bytes());
    }
    for posting in postings {
        for number in [posting.first, posting.second, posting.weight] {
            block.extend_from_slice(&number.to_le_bytes());
        }
    }
    block
}

/// The map of a block.
///
/// # Errors
/// [`CodecError`] says which number is wrong.
pub fn map_from_block(block: &[u8]) -> Result<ObjectMap, CodecError> {
    let mut reader = Reader::new(block)?;
    let n_patches = reader.count("patches", 0, 1 << 16)?;
    let n_classes = reader.count("classes", 1, MAX_CLASSES as u32)?;
    let n_bins = reader.count("distance bins", 1, u32::from(u16::MAX))?;
    let n_postings = reader.count("postings", 0, u32::MAX)?;
    let header = reader.floats("distances and origin", 5)?;
    let distances = DistanceBins::new(header[0], header[1], n_bins as u16)?;
    let patches = reader
        .take(n_patches, 28)?
        .as_chunks::<28>()
        .0
        .iter()
        .map(patch)
        .collect::<Result<_, _>>()?;
    let n_offsets = n_classes * (n_classes + 1) / 2 * n_bins + 1;
    let offsets = reader.take(n_offsets, 4)?.as_chunks::<4>().0;
    let offsets = offsets.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();
    let postings = reader.take(n_postings, 6)?.as_chunks::<6>().0.iter().map(posting).collect();
    reader.end()?;
    let origin = [header[2], header[3], header[4]];
    PairIndex::from_parts(n_classes, distances, offsets, postings, n_patches)
        .and_then(|index| ObjectMap::from_parts(origin.into(), patches, index))
        .ok_or(CodecError::Index)
}

fn patch(bytes: &[u8; 28]) -> Result<MapPatch, CodecError> {
    let mut values = [0.0_f32; 7];
    for (value, bytes) in values.iter_mut().zip(bytes.as_chunks::<4>().0) {
        *value = f32::from_le_bytes(*bytes);
        if !value.is_finite() {
            return Err(CodecError::Finite { field: "patches", found: f64::from(*value) });
        }
    }
    let [x, y, z, nx, ny, nz, normal_confidence] = values;
    Ok(MapPatch { position: [x, y, z], normal: [nx, ny, nz], normal_confidence })
}

fn posting(bytes: &[u8; 6]) -> Posting {
    let [f0, f1, s0, s1, w0, w1] = *bytes;
    Posting {
        first: u16::from_le_bytes([f0, f1]),
        second: u16::from_le_bytes([s0, s1]),
        weight: u16::from_le_bytes([w0, w1]),
    }
}

fn descriptor_code(descriptor: DescriptorKind) -> u32 {
    match descriptor {
        DescriptorKind::Vectorize => 1,
        DescriptorKind::Mnti => 2,
    }
}

fn count(n: usize) -> u32 {
    u32::try_from(n).expect("a model's counts fit into 32 bits: a map has at most 65,536 patches")
}

#[cfg(test)]
mod tests {
    use palpate_core::patch::Patch;
    use palpate_core::rng::{Purpose, Stream};
    use palpate_core::vocabulary::{Association, ClassIdx};

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

    fn model() -> Catalogue {
        let medoid = |class: usize| (0..36).map(|value| (value * class) as f64 / 7.0).collect();
        Catalogue {
            vocabulary: Vocabulary {
                descriptor: DescriptorKind::Mnti,
                rows: 6,
                cols: 7,
                mean: vec![0.25; 36],
                medoids: (0..3).map(medoid).collect(),
                spreads: vec![0.1, 0.2, 0.3],
            },
            association: AssociationRule { threshold: 0.75, max_classes: 4 },
            objects: vec![Arc::new(map(30, 1)), Arc::new(map(12, 2))],
            geometry: None,
        }
    }

    const OBJECTS: [Uuid; 2] = [Uuid::from_u128(1), Uuid::from_u128(2)];

    #[test]
    fn a_model_comes_back_bit_by_bit() {
        let blocks = model_to_blocks(&model(), &OBJECTS);
        assert_eq!(blocks.len(), 3);
        assert_eq!(model_from_blocks(&blocks, &OBJECTS), Ok(model()));
    }

    #[test]
    fn a_model_with_geometry_comes_back_and_needs_the_geometry_of_every_object() {
        let geometry = Some(Arc::new(geometry::tests::model()));
        let model = Catalogue { geometry, ..model() };
        let blocks = model_to_blocks(&model, &OBJECTS);
        assert_eq!(model_from_blocks(&blocks, &OBJECTS), Ok(model));
        let missing = model_from_blocks(&blocks[..5], &OBJECTS).unwrap_err();
        assert_eq!(missing, CodecError::Missing { name: geometry_block_name(OBJECTS[1]) });
    }

    #[test]
    fn an_object_may_be_left_out_or_be_in_another_place() {
        let blocks = model_to_blocks(&model(), &OBJECTS);
        let turned = model_from_blocks(&blocks, &[OBJECTS[1]]).unwrap();
        assert_eq!(turned.objects, [Arc::clone(&model().objects[1])]);
        let missing = model_from_blocks(&blocks[..2], &OBJECTS).unwrap_err();
        assert_eq!(missing, CodecError::Missing { name: map_block_name(OBJECTS[1]) });
    }

    #[test]
    fn a_cut_or_longer_block_is_refused() {
        for block in [vocabulary_to_block(&model()), map_to_block(&map(12, 3))] {
            let decodes = |block: &[u8]| {
                vocabulary_from_block(block).is_ok() || map_from_block(block).is_ok()
            };
            assert!(decodes(&block));
            for length in 0..block.len() {
                assert!(!decodes(&block[..length]), "{length} of {}", block.len());
            }
            assert!(!decodes(&[block, vec![0]].concat()));
        }
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let block = map_to_block(&map(12, 3));
        let with = |at: usize, bytes: &[u8]| {
            let mut block = block.clone();
            block[at..at + bytes.len()].copy_from_slice(bytes);
            map_from_block(&block).unwrap_err()
        };
        assert_eq!(with(0, &9u32.to_le_bytes()), CodecError::Form { found: 9 });
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
        other.vocabulary.medoids.pop();
        other.vocabulary.spreads.pop();
        let error = model_from_blocks(&model_to_blocks(&other, &OBJECTS), &OBJECTS).unwrap_err();
        assert_eq!(error, CodecError::Classes { expected: 2, found: 3 });
    }
}
