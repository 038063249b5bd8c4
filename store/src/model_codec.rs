//! Conversion between trained models and blocks.
//!
//! There is one block for the vocabulary, one for each object's map, those of `geometry`,
//! `appearance` and `surface` if these were trained, and with surfaces one for the symmetry
//! of each object. Blocks are raw little-endian arrays after a short header, drawn in
//! `docs/formats.md`. Envelope and hash are checked before; here the numbers are checked. A
//! map's block does not contain its position in the catalogue, so versions share the maps of
//! objects that were not trained again.

mod appearance;
mod calibration;
mod geometry;
mod part;
mod reader;
mod surface;
mod symmetry;
mod writer;

use std::sync::Arc;

use palpate_core::object::MapPatch;
use palpate_core::vocabulary::gmm::MixtureError;
use palpate_core::vocabulary::{AssociationRule, MAX_CLASSES, Vocabulary};
use palpate_dissertation::geometric::model::ClassTableError;
use palpate_dissertation::occupancy::GridError;
use palpate_dissertation::patch_pair::distance::DistanceBinsError;
use palpate_dissertation::patch_pair::index::Posting;
use palpate_dissertation::patch_pair::{DistanceBins, PairIndex};
use palpate_dissertation::sva::model::{ObjectMap, SvaModel};
use reader::Reader;
use thiserror::Error;
use uuid::Uuid;
use writer::{put_counts, put_floats, put_singles};

use crate::descriptor_code::{DESCRIPTORS, descriptor_code};
use crate::model::TrainedModel;
pub use appearance::{APPEARANCE_BLOCK, APPEARANCE_REPORT_BLOCK, appearance_block_name};
pub use calibration::{CALIBRATION_BLOCK, to_block as calibration_to_block};
pub use geometry::{GEOMETRY_BLOCK, geometry_block_name};
pub use part::ModelPart;
pub use surface::{SURFACE_BLOCK, surface_block_name};
pub use symmetry::{symmetry_block_name, symmetry_from_block, symmetry_to_block};

/// Name of the vocabulary's block.
pub const VOCABULARY_BLOCK: &str = "vocabulary";
/// Form number of most blocks.
const FORM: u32 = 1;

/// Name of the block with an object's map.
#[must_use]
pub fn map_block_name(object: Uuid) -> String {
    format!("map/{object}")
}

/// Error of a block that is not the expected part of a model.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CodecError {
    /// The block was written by a newer Palpate.
    #[error("block has form {found}, this version of Palpate knows {newest}")]
    Form {
        /// The block's form.
        found: u32,
        /// Newest known form.
        newest: u32,
    },
    /// The block is too short or too long.
    #[error("block has {found} bytes, expected {expected}")]
    Length {
        /// Length according to the header, at least.
        expected: usize,
        /// Length of the block.
        found: usize,
    },
    /// A number of the header is out of range.
    #[error("{field} is {found}, expected {low} to {high}")]
    Count {
        /// The number's name.
        field: &'static str,
        /// The number.
        found: u32,
        /// The smallest possible.
        low: u32,
        /// The largest possible.
        high: u32,
    },
    /// A number is not finite.
    #[error("{field} holds {found}, expected finite numbers")]
    Finite {
        /// The array's name.
        field: &'static str,
        /// The number.
        found: f64,
    },
    /// The distance bins are not a valid range.
    #[error(transparent)]
    Distances(#[from] DistanceBinsError),
    /// The index's arrays are inconsistent or name patches that do not exist.
    #[error("offsets and postings of the pair index do not fit together")]
    Index,
    /// The catalogue lacks a block that its manifest's objects need.
    #[error("block {name} is missing")]
    Missing {
        /// The block's name.
        name: String,
    },
    /// A grid of occupancy or force is not valid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The table of class probabilities is not valid.
    #[error(transparent)]
    ClassTable(#[from] ClassTableError),
    /// A taxel's gain is not valid.
    #[error("gain is {found}, expected a finite number above 0")]
    Gain {
        /// The gain.
        found: f64,
    },
    /// The classes of appearance are not a valid mixture.
    #[error(transparent)]
    Mixture(#[from] MixtureError),
    /// The parts of an appearance vocabulary, or of an object's appearance, are inconsistent.
    #[error("the parts of the appearance model do not fit together")]
    Appearance,
    /// The parts of a surface, or the parts shared by all surfaces, are inconsistent.
    #[error("the parts of the surfaces do not fit together")]
    Surface,
    /// An axis of symmetry is not valid.
    #[error("an axis has the order 1 or a direction that is not of norm 1")]
    Symmetry,
    /// The report has another number of objects than the model.
    #[error("report of {found} objects, expected the model's {expected}")]
    Report {
        /// Number of objects of the model.
        expected: usize,
        /// Number of objects of the report.
        found: usize,
    },
    /// A map was built over another vocabulary.
    #[error("map has {found} classes, expected the vocabulary's {expected}")]
    Classes {
        /// Number of classes of the vocabulary.
        expected: usize,
        /// Number of classes of the map.
        found: usize,
    },
}

/// The blocks of a model: names and contents. `objects` are the ids of the model's objects,
/// in its order.
#[must_use]
pub fn model_to_blocks(model: &TrainedModel, objects: &[Uuid]) -> Vec<(String, Vec<u8>)> {
    let vocabulary = (VOCABULARY_BLOCK.to_owned(), vocabulary_to_block(&model.sva));
    let maps = objects
        .iter()
        .zip(&model.sva.objects)
        .map(|(object, map)| (map_block_name(*object), map_to_block(map)));
    let geometry = model.geometric.iter().flat_map(|model| geometry::to_blocks(model, objects));
    let appearance =
        model.appearance.iter().flat_map(|model| appearance::to_blocks(model, objects));
    let surface = model.surface.iter().flat_map(|model| surface::to_blocks(model, objects));
    let shared = std::iter::once(vocabulary);
    shared.chain(maps).chain(geometry).chain(appearance).chain(surface).collect()
}

/// The model of a version's blocks. `objects` are the ids of its objects, in its order; other
/// blocks are ignored. Without the block [`GEOMETRY_BLOCK`] the model has no geometry,
/// without [`APPEARANCE_BLOCK`] no appearance, without [`SURFACE_BLOCK`] no surfaces; without
/// a map of any object it has no maps.
///
/// # Errors
/// [`CodecError`] names the missing or inconsistent part.
pub fn model_from_blocks(
    blocks: &[(String, Vec<u8>)],
    objects: &[Uuid],
) -> Result<TrainedModel, CodecError> {
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
    let has_maps = objects.iter().any(|object| find(&map_block_name(*object)).is_some());
    let mapped = if has_maps { objects } else { &[] };
    let maps = mapped.iter().map(map).collect::<Result<_, _>>()?;
    let geometry = find(GEOMETRY_BLOCK).map(|shared| {
        let block = |object: &Uuid| block(geometry_block_name(*object));
        geometry::from_blocks(shared, objects.iter().map(block))
    });
    let geometry = geometry.transpose()?.map(Arc::new);
    let appearance = find(APPEARANCE_BLOCK).map(|shared| {
        let report = block(APPEARANCE_REPORT_BLOCK.to_owned())?;
        let block = |object: &Uuid| block(appearance_block_name(*object));
        appearance::from_blocks(shared, report, objects.iter().map(block))
    });
    let appearance = appearance.transpose()?.map(Arc::new);
    let surface = find(SURFACE_BLOCK).map(|shared| {
        let surface = |object: &Uuid| {
            Ok(surface::ObjectBlocks {
                surface: block(surface_block_name(*object))?,
                symmetry: find(&symmetry_block_name(*object)),
            })
        };
        surface::from_blocks(shared, find(CALIBRATION_BLOCK), objects.iter().map(surface))
    });
    let surface = surface.transpose()?.map(Arc::new);
    let sva = Arc::new(SvaModel { vocabulary, association, objects: maps });
    Ok(TrainedModel { sva, geometric: geometry, appearance, surface })
}

/// The block of a model's vocabulary and association rule.
#[must_use]
pub fn vocabulary_to_block(model: &SvaModel) -> Vec<u8> {
    let vocabulary = &model.vocabulary;
    let mut block = Vec::new();
    let counts = [
        vocabulary.rows,
        vocabulary.cols,
        vocabulary.mean.len(),
        vocabulary.n_classes(),
        model.association.max_classes,
    ];
    put_counts(&mut block, &[FORM, descriptor_code(vocabulary.descriptor)]);
    put_counts(&mut block, &counts.map(count));
    put_floats(&mut block, &[model.association.threshold]);
    put_floats(&mut block, &vocabulary.mean);
    vocabulary.medoids.iter().for_each(|medoid| put_floats(&mut block, medoid));
    put_floats(&mut block, &vocabulary.spreads);
    block
}

/// The vocabulary and association rule of a block; a model without maps has no classes.
///
/// # Errors
/// [`CodecError`] names the invalid number.
pub fn vocabulary_from_block(block: &[u8]) -> Result<(Vocabulary, AssociationRule), CodecError> {
    let mut reader = Reader::new(block)?;
    let code = reader.count("descriptor", 1, DESCRIPTORS.len() as u32)?;
    let descriptor = DESCRIPTORS[code - 1];
    let rows = reader.count("rows", 1, 1024)?;
    let cols = reader.count("cols", 1, 1024)?;
    let n_values = reader.count("values of a feature", 0, 1 << 20)?;
    let n_classes = reader.count("classes", 0, MAX_CLASSES as u32)?;
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
    let distances = index.distances();
    let n_bins = u32::from(distances.n());
    let (n_patches, n_postings) = (count(patches.len()), count(postings.len()));
    put_counts(&mut block, &[FORM, n_patches, count(index.n_classes()), n_bins, n_postings]);
    put_floats(&mut block, &[distances.min(), distances.max()]);
    put_floats(&mut block, &map.origin_in_training().to_array());
    for patch in patches {
        put_singles(&mut block, &patch.position);
        put_singles(&mut block, &patch.normal);
        put_singles(&mut block, &[patch.normal_confidence]);
    }
    put_counts(&mut block, index.offsets());
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
/// [`CodecError`] names the invalid number.
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

fn count(n: usize) -> u32 {
    u32::try_from(n).expect("a model's counts fit into 32 bits: a map has at most 65,536 patches")
}

#[cfg(test)]
mod tests;
