//! Training readings of one object, and the checks that every training shares.

use thiserror::Error;

use crate::object::MapError;
use crate::reading::Reading;
use crate::rng::Stream;
use crate::sensor::SensorDescription;

/// Readings of one object by one sensor.
#[derive(Clone, Copy, Debug)]
pub struct TrainingSet<'a> {
    /// The readings; poses are `object_from_sensor` in the training frame.
    pub readings: &'a [Reading],
    /// The sensor of the readings.
    pub sensor: &'a SensorDescription,
}

/// Error of readings that cannot be used for training.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum TrainingError {
    /// No reading touched an object.
    #[error("no training reading touched anything, expected at least one")]
    NothingTouched,
    /// No two touches are of one place, so that nothing tells how alike such touches are.
    #[error(
        "hardly any two readings touched one place of an object: touch more densely, or some places \
         again"
    )]
    NoPlaces,
    /// All touches look alike, so that there is nothing to learn an appearance from.
    #[error(
        "all readings that touched an object look alike: touch different places, and check that the \
         driver sends new images"
    )]
    Alike,
    /// The images of one catalogue have different shapes.
    #[error(
        "image of {found_rows}×{found_cols} taxels, expected {rows}×{cols} as the catalogue's other sensors"
    )]
    Shape {
        /// Rows of the vocabulary.
        rows: usize,
        /// Columns of the vocabulary.
        cols: usize,
        /// Rows of the image.
        found_rows: usize,
        /// Columns of the image.
        found_cols: usize,
    },
    /// The readings of one object do not make a map.
    #[error(transparent)]
    Map(#[from] MapError),
}

/// Checks that all images have `rows` × `cols` taxels.
///
/// # Errors
/// [`TrainingError::Shape`] for the first image that differs.
pub fn check_shapes(readings: &[&Reading], rows: usize, cols: usize) -> Result<(), TrainingError> {
    let other =
        readings.iter().map(|r| r.image()).find(|image| (image.rows, image.cols) != (rows, cols));
    match other {
        Some(image) => {
            let (found_rows, found_cols) = (image.rows, image.cols);
            Err(TrainingError::Shape { rows, cols, found_rows, found_cols })
        }
        None => Ok(()),
    }
}

/// Draws up to `n` of the items without replacement and keeps their order.
pub fn subsample<T: Clone>(items: &[T], n: usize, stream: &mut Stream) -> Vec<T> {
    let mut left = n.min(items.len());
    let mut chosen = Vec::with_capacity(left);
    for (index, item) in items.iter().enumerate() {
        if stream.index(items.len() - index) < left {
            chosen.push(item.clone());
            left -= 1;
        }
    }
    chosen
}
