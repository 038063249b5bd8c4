//! Conversion between trained appearance and blocks: the vocabulary, each object, and the report.
//!
//! The vocabulary's block depends on no object's histogram, and an object's on no other
//! object: versions that share a vocabulary, or an object, share its block bit by bit. A
//! version without the vocabulary's block has no appearance. Drawn in `docs/formats.md`.

use std::sync::Arc;

use palpate_core::object::ObjectIdx;
use palpate_core::vocabulary::bag::{ClassHistogram, Clustering};
use palpate_core::vocabulary::choice::ClassCount;
use palpate_core::vocabulary::discriminant::Discriminant;
use palpate_core::vocabulary::gmm::{Component, Mixture};
use palpate_core::vocabulary::kmeans::KMeans;
use palpate_core::vocabulary::pca::Pca;
use palpate_dissertation::appearance::model::{
    AppearanceModel, AppearanceReport, AppearanceSource, AppearanceVocabulary, NearDuplicate,
    ObjectAppearance, ReadingClasses,
};
use uuid::Uuid;

use super::reader::Reader;
use super::writer::{put_counts, put_floats};
use super::{CodecError, FORM, count};
use crate::descriptor_code::{DESCRIPTORS, descriptor_code};

/// Name of the block with the appearance vocabulary.
pub const APPEARANCE_BLOCK: &str = "appearance";
/// Name of the block with calibration and report.
pub const APPEARANCE_REPORT_BLOCK: &str = "appearance_report";
/// Code of clients' own features, beside those of descriptors.
const EXTERNAL: u32 = 0;
/// Codes of clusterings.
const MIXTURE: u32 = 1;
const K_MEANS: u32 = 2;
/// Maximum length of a feature.
const VALUES_MAX: u32 = 1 << 20;
/// Maximum number of classes.
const CLASSES_MAX: u32 = 1 << 16;
/// Maximum number of objects and readings.
const MANY: u32 = 1 << 24;

/// Name of the block with an object's appearance.
#[must_use]
pub fn appearance_block_name(object: Uuid) -> String {
    format!("{APPEARANCE_BLOCK}/{object}")
}

/// The blocks of a catalogue's appearance. `objects` are the ids of its objects, in its order.
pub(super) fn to_blocks(model: &AppearanceModel, objects: &[Uuid]) -> Vec<(String, Vec<u8>)> {
    let vocabulary = (APPEARANCE_BLOCK.to_owned(), vocabulary_to_block(&model.vocabulary));
    let report = (APPEARANCE_REPORT_BLOCK.to_owned(), report_to_block(model));
    let parts = objects
        .iter()
        .zip(&model.objects)
        .map(|(object, part)| (appearance_block_name(*object), object_to_block(part)));
    [vocabulary, report].into_iter().chain(parts).collect()
}

/// The appearance of the shared blocks and the objects' blocks, in the catalogue's order.
pub(super) fn from_blocks<'block>(
    vocabulary: &[u8],
    report: &[u8],
    objects: impl Iterator<Item = Result<&'block [u8], CodecError>>,
) -> Result<AppearanceModel, CodecError> {
    let vocabulary = Arc::new(vocabulary_from_block(vocabulary)?);
    let expected = vocabulary.n_classes();
    let object = |block: Result<&'block [u8], CodecError>| {
        let object = object_from_block(block?)?;
        match object.histogram.mass.len() {
            found if found == expected => Ok(Arc::new(object)),
            found => Err(CodecError::Classes { expected, found }),
        }
    };
    let objects: Vec<Arc<ObjectAppearance>> = objects.map(object).collect::<Result<_, _>>()?;
    let (smoothing, exponent, report) = report_from_block(report)?;
    let (expected, found) = (objects.len(), report.confusion.len());
    if expected != found {
        return Err(CodecError::Report { expected, found });
    }
    Ok(AppearanceModel { vocabulary, objects, smoothing, exponent, report })
}

fn vocabulary_to_block(vocabulary: &AppearanceVocabulary) -> Vec<u8> {
    let (pca, axes) = (&vocabulary.pca, &vocabulary.discriminant);
    let [descriptor, rows, cols] = match vocabulary.source {
        AppearanceSource::Image { descriptor, rows, cols } => {
            [descriptor_code(descriptor), count(rows), count(cols)]
        }
        AppearanceSource::External { .. } => [EXTERNAL, 0, 0],
    };
    let clustering = match &vocabulary.clustering {
        Clustering::Mixture(_) => MIXTURE,
        Clustering::KMeans(_) => K_MEANS,
    };
    let n_axes = axes.as_ref().map_or(0, |axes| axes.axes.len());
    let mut block = Vec::new();
    put_counts(&mut block, &[FORM, descriptor, rows, cols]);
    put_counts(&mut block, &[count(pca.dimension()), count(pca.n_components()), count(n_axes)]);
    put_counts(&mut block, &[clustering, count(vocabulary.n_classes())]);
    put_counts(&mut block, &[count(vocabulary.choices.len())]);
    for values in [pca.mean(), pca.components(), pca.variances(), &[pca.total_variance()]] {
        put_floats(&mut block, values);
    }
    if let Some(axes) = axes {
        put_floats(&mut block, &axes.mean);
        axes.axes.iter().for_each(|axis| put_floats(&mut block, axis));
    }
    match &vocabulary.clustering {
        Clustering::Mixture(mixture) => {
            for Component { weight, mean, covariance } in mixture.components() {
                put_floats(&mut block, &[*weight]);
                put_floats(&mut block, mean);
                put_floats(&mut block, covariance);
            }
        }
        Clustering::KMeans(KMeans { centers, cost }) => {
            put_floats(&mut block, &[*cost]);
            centers.iter().for_each(|center| put_floats(&mut block, center));
        }
    }
    for ClassCount { n_classes, accuracy, reliability } in &vocabulary.choices {
        put_counts(&mut block, &[count(*n_classes)]);
        put_floats(&mut block, &[*accuracy, *reliability]);
    }
    block
}

fn vocabulary_from_block(block: &[u8]) -> Result<AppearanceVocabulary, CodecError> {
    let mut reader = Reader::new(block)?;
    let descriptor = reader.count("descriptor", EXTERNAL, DESCRIPTORS.len() as u32)?;
    let shape = [reader.count("rows", 0, 1024)?, reader.count("cols", 0, 1024)?];
    let dimension = reader.count("values of a feature", 1, VALUES_MAX)?;
    let n_components = reader.count("principal components", 1, VALUES_MAX)?;
    let n_axes = reader.count("discriminant axes", 0, VALUES_MAX)?;
    let clustering = reader.count("clustering", MIXTURE, K_MEANS)? as u32;
    let n_classes = reader.count("classes", 1, CLASSES_MAX)?;
    let n_choices = reader.count("candidates", 0, MANY)?;
    let source = match descriptor.checked_sub(1) {
        Some(place) => {
            let [rows, cols] = shape;
            AppearanceSource::Image { descriptor: DESCRIPTORS[place], rows, cols }
        }
        None => AppearanceSource::External { dimension },
    };
    let mean = reader.floats("mean", dimension)?;
    let components = reader.floats("principal components", n_components * dimension)?;
    let variances = reader.floats("variances", n_components)?;
    let total = reader.floats("variance", 1)?[0];
    let pca = Pca::from_parts(mean, components, variances, total).ok_or(CodecError::Appearance)?;
    let discriminant = match n_axes {
        0 => None,
        _ => Some(discriminant(&mut reader, n_components, n_axes)?),
    };
    let reduced = if n_axes == 0 { n_components } else { n_axes };
    let clustering = match clustering {
        MIXTURE => mixture(&mut reader, reduced, n_classes)?,
        _ => k_means(&mut reader, reduced, n_classes)?,
    };
    let choices = (0..n_choices).map(|_| choice(&mut reader)).collect::<Result<_, _>>()?;
    reader.end()?;
    let vocabulary = AppearanceVocabulary { source, pca, discriminant, clustering, choices };
    if vocabulary.is_consistent() { Ok(vocabulary) } else { Err(CodecError::Appearance) }
}

fn discriminant(
    reader: &mut Reader<'_>,
    dimension: usize,
    n_axes: usize,
) -> Result<Discriminant, CodecError> {
    let mean = reader.floats("mean of the objects", dimension)?;
    let axes = (0..n_axes).map(|_| reader.floats("discriminant axes", dimension));
    Ok(Discriminant { mean, axes: axes.collect::<Result<_, _>>()? })
}

fn mixture(
    reader: &mut Reader<'_>,
    dimension: usize,
    n_classes: usize,
) -> Result<Clustering, CodecError> {
    let component = |_| {
        let weight = reader.floats("weight", 1)?[0];
        let mean = reader.floats("centre of a class", dimension)?;
        let covariance = reader.floats("covariance", dimension.saturating_mul(dimension))?;
        Ok(Component { weight, mean, covariance })
    };
    let components = (0..n_classes).map(component).collect::<Result<_, CodecError>>()?;
    Ok(Clustering::Mixture(Mixture::new(components)?))
}

fn k_means(
    reader: &mut Reader<'_>,
    dimension: usize,
    n_classes: usize,
) -> Result<Clustering, CodecError> {
    let cost = reader.floats("cost", 1)?[0];
    let centers = (0..n_classes).map(|_| reader.floats("centre of a class", dimension));
    Ok(Clustering::KMeans(KMeans { centers: centers.collect::<Result<_, _>>()?, cost }))
}

fn choice(reader: &mut Reader<'_>) -> Result<ClassCount, CodecError> {
    let n_classes = reader.count("classes of a candidate", 1, CLASSES_MAX)?;
    let scores = reader.floats("scores of a candidate", 2)?;
    Ok(ClassCount { n_classes, accuracy: scores[0], reliability: scores[1] })
}

fn object_to_block(object: &ObjectAppearance) -> Vec<u8> {
    let ObjectAppearance { histogram, joint, held_back } = object;
    let mut block = Vec::new();
    put_counts(&mut block, &[FORM, count(histogram.mass.len()), count(held_back.len())]);
    put_floats(&mut block, &histogram.mass);
    put_floats(&mut block, joint);
    for reading in held_back {
        put_counts(&mut block, &[count(reading.shares.len())]);
        reading.shares.iter().for_each(|shares| put_floats(&mut block, shares));
    }
    block
}

fn object_from_block(block: &[u8]) -> Result<ObjectAppearance, CodecError> {
    let mut reader = Reader::new(block)?;
    let n_classes = reader.count("classes", 1, CLASSES_MAX)?;
    let n_held_back = reader.count("readings held back", 0, MANY)?;
    let mass = shares(&mut reader, "histogram", n_classes)?;
    let joint = shares(&mut reader, "joint densities", n_classes)?;
    let mut reading = |_| {
        let n_features = reader.count("features of a reading", 0, MANY)?;
        let one = |_| shares(&mut reader, "shares", n_classes);
        Ok(ReadingClasses { shares: (0..n_features).map(one).collect::<Result<_, _>>()? })
    };
    let held_back = (0..n_held_back).map(&mut reading).collect::<Result<_, CodecError>>()?;
    reader.end()?;
    Ok(ObjectAppearance { histogram: ClassHistogram { mass }, joint, held_back })
}

/// Finite numbers of at least 0, one per class.
fn shares(
    reader: &mut Reader<'_>,
    field: &'static str,
    n_classes: usize,
) -> Result<Vec<f64>, CodecError> {
    let values = reader.floats(field, n_classes)?;
    if values.iter().all(|value| *value >= 0.0) { Ok(values) } else { Err(CodecError::Appearance) }
}

fn report_to_block(model: &AppearanceModel) -> Vec<u8> {
    let AppearanceModel { smoothing, exponent, report, .. } = model;
    let n_duplicates = count(report.near_duplicates.len());
    let mut block = Vec::new();
    put_counts(&mut block, &[FORM, count(report.confusion.len()), count(report.n_readings)]);
    put_counts(&mut block, &[n_duplicates]);
    put_floats(&mut block, &[*smoothing, *exponent, report.accuracy]);
    let rows = report.confusion.iter().chain(&report.affinity);
    rows.for_each(|row| put_floats(&mut block, row));
    for NearDuplicate { first, second, affinity } in &report.near_duplicates {
        put_counts(&mut block, &[first.0, second.0]);
        put_floats(&mut block, &[*affinity]);
    }
    block
}

/// Smoothing, exponent and report.
fn report_from_block(block: &[u8]) -> Result<(f64, f64, AppearanceReport), CodecError> {
    let mut reader = Reader::new(block)?;
    let n_objects = reader.count("objects", 1, MANY)?;
    let n_readings = reader.count("readings of a trial", 1, MANY)?;
    let n_duplicates = reader.count("near duplicates", 0, u32::MAX)?;
    let header = reader.floats("smoothing, exponent and accuracy", 3)?;
    if header[0] <= 0.0 || header[1] <= 0.0 {
        return Err(CodecError::Appearance);
    }
    let mut matrix = |field| -> Result<Vec<Vec<f64>>, CodecError> {
        (0..n_objects).map(|_| reader.floats(field, n_objects)).collect()
    };
    let (confusion, affinity) = (matrix("confusion")?, matrix("affinity")?);
    let last = n_objects as u32 - 1;
    let mut duplicate = |_| {
        let mut object = || reader.count("object", 0, last).map(|place| ObjectIdx(place as u32));
        let (first, second) = (object()?, object()?);
        let affinity = reader.floats("affinity", 1)?[0];
        Ok(NearDuplicate { first, second, affinity })
    };
    let near_duplicates =
        (0..n_duplicates).map(&mut duplicate).collect::<Result<_, CodecError>>()?;
    reader.end()?;
    let accuracy = header[2];
    let report = AppearanceReport { n_readings, confusion, affinity, accuracy, near_duplicates };
    Ok((header[0], header[1], report))
}

#[cfg(test)]
pub(super) mod tests;
