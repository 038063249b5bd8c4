//! Figures 4.7, 4.9 and 4.10: the classes as images, the confusion matrix, the affinity matrix.

use anyhow::Context as _;
use palpate_core::descriptor::DescriptorKind;
use palpate_core::vocabulary::bag::Clustering;
use palpate_dissertation::appearance::model::{
    AppearanceModel, AppearanceReport, AppearanceSource, AppearanceVocabulary,
};
use palpate_sim::plot::grids::{Grid, Legend, grids_svg};

use crate::objects::TestObject;

/// Classes in a row of figure 4.7.
const CLASSES_PER_ROW: usize = 8;

/// The picture of a descriptor: figure 4.7 for Moment-Normalised, whose classes are images, and the
/// matrices of figures 4.9 and 4.10 for the others.
pub(super) fn of(
    descriptor: DescriptorKind,
    objects: &[TestObject],
    model: &AppearanceModel,
) -> anyhow::Result<(String, Vec<u8>)> {
    let name = descriptor.name();
    if descriptor == DescriptorKind::MomentNormalized {
        let drawn = classes(&model.vocabulary).context("the classes are not of images")?;
        return Ok((format!("classes-{name}.svg"), drawn.into_bytes()));
    }
    let names: Vec<String> = objects.iter().map(|object| object.name.clone()).collect();
    let drawn = matrices(&names, &model.report);
    Ok((format!("confusion-{name}.svg"), drawn.into_bytes()))
}

/// The means of a mixture, projected back into images; heaviest first. `None` for other classes,
/// and for features that are not images.
fn classes(vocabulary: &AppearanceVocabulary) -> Option<String> {
    let AppearanceSource::Image { rows, cols, .. } = vocabulary.source else { return None };
    let Clustering::Mixture(mixture) = &vocabulary.clustering else { return None };
    if vocabulary.discriminant.is_some() {
        return None;
    }
    let mut components: Vec<_> = mixture.components().iter().collect();
    components.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    let grids: Vec<Grid> = components
        .into_iter()
        .map(|component| {
            let image = vocabulary.pca.back_project(&component.mean);
            let full = image.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
            Grid {
                title: format!("{:.1} %", 100.0 * component.weight),
                cols,
                values: from_top(&image, rows, cols),
                range: (0.0, full),
                legend: Legend::None,
            }
        })
        .collect();
    Some(grids_svg(&grids, CLASSES_PER_ROW))
}

/// The values of a column-major image whose rows are along +y, row by row from the top.
fn from_top(by_columns: &[f64], rows: usize, cols: usize) -> Vec<f64> {
    let places = (0..rows).rev().flat_map(|row| (0..cols).map(move |col| (row, col)));
    places.map(|(row, col)| by_columns[col * rows + row]).collect()
}

/// Confusion (mean probability) beside affinity (correlation of histograms).
fn matrices(names: &[String], report: &AppearanceReport) -> String {
    let readings = report.n_readings;
    let matrix = |title: String, values: &[Vec<f64>]| Grid {
        title,
        cols: names.len(),
        values: values.iter().flatten().copied().collect(),
        range: (0.0, 1.0),
        legend: Legend::Names(names.to_vec()),
    };
    let confusion = format!("confusion after {readings} readings (%)");
    grids_svg(
        &[
            matrix(confusion, &report.confusion),
            matrix("affinity (%)".to_owned(), &report.affinity),
        ],
        2,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_row_of_an_image_comes_first() {
        // Columns of 3 rows: the first column is 1, 2, 3 from the bottom, the second 4, 5, 6.
        let image = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        assert_eq!(from_top(&image, 3, 2), [3.0, 6.0, 2.0, 5.0, 1.0, 4.0]);
    }

    #[test]
    fn both_matrices_are_drawn_with_every_name() {
        let report = AppearanceReport {
            n_readings: 100,
            confusion: vec![vec![0.9, 0.1], vec![0.2, 0.8]],
            affinity: vec![vec![1.0, 0.5], vec![0.5, 1.0]],
            ..AppearanceReport::default()
        };
        let drawn = matrices(&["mug".to_owned(), "tyre".to_owned()], &report);
        assert!(drawn.contains("confusion after 100 readings"), "{drawn}");
        assert_eq!(drawn.matches(">mug<").count(), 4);
        assert_eq!(drawn.matches(">50<").count(), 2);
    }
}
