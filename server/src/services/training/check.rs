//! Checks of readings before training: contact, and equal array shapes of all objects.

use palpate_schemas::FeatureSource;

use super::material::Material;
use super::{Plan, TrainingFailure};

/// The materials; those that cannot be trained as failures that name their objects.
pub(super) fn usable(
    plan: &Plan,
    materials: Vec<Material>,
) -> Vec<Result<Material, TrainingFailure>> {
    if !needs_images(plan) {
        return materials.into_iter().map(Ok).collect();
    }
    let touched: Vec<Result<Material, TrainingFailure>> =
        materials.into_iter().map(touched).collect();
    let Some(expected) = expected_shape(plan, &touched) else { return touched };
    touched.into_iter().map(|material| shaped(material?, expected)).collect()
}

/// Whether anything is trained from images.
fn needs_images(plan: &Plan) -> bool {
    let from_images = |source| source == FeatureSource::Images;
    plan.sva
        || plan.surface
        || plan.appearance.as_ref().is_some_and(|settings| from_images(settings.source))
}

/// Fails when no reading has contact.
fn touched(material: Material) -> Result<Material, TrainingFailure> {
    if material.touched.n_touches > 0 {
        return Ok(material);
    }
    Err(TrainingFailure::NothingTouched {
        object: material.object.name.clone(),
        sensor: material.sensor().name.clone(),
        n_readings: material.touched.n_readings,
        meant: material.touched.meant(&material.sensor().description),
    })
}

/// Rows and columns of all images: those of the extended version, or those of most objects,
/// the first of equals.
fn expected_shape(
    plan: &Plan,
    materials: &[Result<Material, TrainingFailure>],
) -> Option<[usize; 2]> {
    if let Some(base) = &plan.base {
        let vocabulary = &base.model.core.sva.vocabulary;
        return Some([vocabulary.rows, vocabulary.cols]);
    }
    let shapes: Vec<[usize; 2]> = materials.iter().flatten().map(shape).collect();
    let n_of = |shape: &[usize; 2]| shapes.iter().filter(|other| *other == shape).count();
    let most = shapes.iter().map(n_of).max()?;
    shapes.iter().find(|shape| n_of(shape) == most).copied()
}

fn shape(material: &Material) -> [usize; 2] {
    [material.grid().rows, material.grid().cols]
}

fn shaped(material: Material, expected: [usize; 2]) -> Result<Material, TrainingFailure> {
    let found = shape(&material);
    if found == expected {
        return Ok(material);
    }
    let (object, sensor) = (material.object.name.clone(), material.sensor().name.clone());
    let hint = if material.has_mesh() {
        format!(
            "name a sensor of {}×{} taxels that touches meshes (`sensor`, `--sensor`)",
            expected[0], expected[1]
        )
    } else {
        format!(
            "train it in a catalogue of its own, or let {sensor:?} touch the meshes (`sensor`, \
             `--sensor`)"
        )
    };
    Err(TrainingFailure::Shape { object, sensor, expected, found, hint })
}
