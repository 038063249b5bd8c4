//! Features of training sets, split into training and held-out readings.

use super::{AppearanceSet, AppearanceTrainError};
use crate::appearance::model::AppearanceSource;
use palpate_core::contact::touches;
use palpate_core::descriptor::{DescriptorKind, FeatureMatrix};
use palpate_core::reading::TactileImage;

/// The features of one object's readings with contact, one matrix per reading.
pub(super) struct Split {
    /// Readings of the histograms.
    pub(super) training: Vec<FeatureMatrix>,
    /// Readings for choice, calibration and report.
    pub(super) held_back: Vec<FeatureMatrix>,
}

impl Split {
    /// All features of the training readings.
    pub(super) fn training_features(&self) -> impl Iterator<Item = &[f64]> {
        self.training.iter().flat_map(FeatureMatrix::rows)
    }
}

/// The source of the sets' features.
pub(super) fn source_of(
    sets: &[AppearanceSet<'_>],
    descriptor: DescriptorKind,
) -> Result<AppearanceSource, AppearanceTrainError> {
    let of_set = |set: &AppearanceSet<'_>| match set {
        AppearanceSet::Readings(set) => {
            let image = set.readings.iter().find(|r| touches(r, set.sensor))?.image();
            Some(AppearanceSource::Image { descriptor, rows: image.rows, cols: image.cols })
        }
        AppearanceSet::Features(features) => {
            features.first().map(|f| AppearanceSource::External { dimension: f.len() })
        }
    };
    sets.iter().find_map(of_set).ok_or(AppearanceTrainError::NothingTouched)
}

/// Describes the readings of a set with contact, and holds out an even share of them: every
/// m-th in order, so that both parts cover the whole object.
pub(super) fn split(
    set: &AppearanceSet<'_>,
    source: AppearanceSource,
    held_back_share: f64,
) -> Result<Split, AppearanceTrainError> {
    let features = match (set, source) {
        (AppearanceSet::Readings(set), AppearanceSource::Image { descriptor, rows, cols }) => {
            let images: Vec<&TactileImage> = set
                .readings
                .iter()
                .filter(|reading| touches(reading, set.sensor))
                .map(|reading| reading.image())
                .collect();
            check_shapes(&images, rows, cols)?;
            by_reading(&descriptor.plan(rows, cols).describe(&images), images.len())
        }
        (AppearanceSet::Features(features), AppearanceSource::External { dimension }) => {
            check_features(features, dimension)?;
            features
                .iter()
                .map(|feature| FeatureMatrix::from_parts(dimension, feature.clone(), vec![0]))
                .collect()
        }
        _ => return Err(AppearanceTrainError::MixedSources),
    };
    let (mut training, mut held_back) = (Vec::new(), Vec::new());
    for (index, reading) in features.into_iter().enumerate() {
        let passed = |n: usize| (n as f64 * held_back_share).floor();
        if passed(index + 1) > passed(index) {
            held_back.push(reading);
        } else {
            training.push(reading);
        }
    }
    Ok(Split { training, held_back })
}

/// One matrix for each reading.
fn by_reading(features: &FeatureMatrix, n_readings: usize) -> Vec<FeatureMatrix> {
    let mut values = vec![Vec::new(); n_readings];
    for (row, owner) in features.rows().zip(features.owners()) {
        values[*owner].extend_from_slice(row);
    }
    let dimension = features.dimension();
    values
        .into_iter()
        .map(|values| {
            let owners = vec![0; values.len() / dimension];
            FeatureMatrix::from_parts(dimension, values, owners)
        })
        .collect()
}

fn check_shapes(
    images: &[&TactileImage],
    rows: usize,
    cols: usize,
) -> Result<(), AppearanceTrainError> {
    match images.iter().find(|image| (image.rows, image.cols) != (rows, cols)) {
        None => Ok(()),
        Some(image) => Err(AppearanceTrainError::Shape {
            rows,
            cols,
            found_rows: image.rows,
            found_cols: image.cols,
        }),
    }
}

fn check_features(features: &[Vec<f64>], dimension: usize) -> Result<(), AppearanceTrainError> {
    let fits = |f: &Vec<f64>| f.len() == dimension && f.iter().all(|value| value.is_finite());
    match features.iter().position(|feature| dimension == 0 || !fits(feature)) {
        None => Ok(()),
        Some(feature) => Err(AppearanceTrainError::Feature { feature, dimension }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fifth_reading_is_held_out() {
        let features: Vec<Vec<f64>> = (0..12).map(|n| vec![f64::from(n)]).collect();
        let source = AppearanceSource::External { dimension: 1 };
        let found = split(&AppearanceSet::Features(&features), source, 0.2).unwrap();
        let held: Vec<f64> = found.held_back.iter().map(|reading| reading.row(0)[0]).collect();
        assert_eq!(held, [4.0, 9.0]);
        assert_eq!(found.training.len(), 10);
    }

    #[test]
    fn features_of_wrong_length_or_not_finite_are_refused() {
        let source = AppearanceSource::External { dimension: 2 };
        for wrong in [vec![1.0], vec![1.0, f64::NAN]] {
            let features = [vec![0.0, 1.0], wrong];
            let found = split(&AppearanceSet::Features(&features), source, 0.2);
            let expected = AppearanceTrainError::Feature { feature: 1, dimension: 2 };
            assert_eq!(found.err(), Some(expected));
        }
    }
}
