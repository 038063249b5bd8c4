//! Readings held out of an object's surface, on which its probabilities are calibrated.
//!
//! Every training of surfaces splits its readings here, so that trainings of the same readings
//! with the same seed agree bit for bit, wherever they run.

use std::sync::Arc;

use palpate_core::reading::Reading;

use super::calibrate::{HeldBack, READINGS, calibrate, runs_per_object};
use crate::model::SurfaceModel;
use crate::options::SurfaceOptions;

/// One reading in this many is held out.
const HELD_BACK: usize = 10;

/// Minimum number of readings of an object for holding any out: smaller surfaces need them all.
const READINGS_MIN: usize = 100;

/// An object's readings: those of its surface, and the held-out ones.
#[derive(Clone, Debug, PartialEq)]
pub struct Split {
    /// The readings that the surface is learnt from.
    pub kept: Vec<Reading>,
    /// The readings that the calibration is learnt from.
    pub held_back: Vec<Reading>,
}

/// Whether the reading at an index among an object's `n` is held out.
#[must_use]
pub fn is_held_back(index: usize, n: usize) -> bool {
    n >= READINGS_MIN && index < n && index % HELD_BACK == HELD_BACK - 1
}

/// Splits an object's readings in their order.
#[must_use]
pub fn split(readings: &[Reading]) -> Split {
    let (mut kept, mut held_back) = (Vec::new(), Vec::new());
    for (index, reading) in readings.iter().enumerate() {
        let side = if is_held_back(index, readings.len()) { &mut held_back } else { &mut kept };
        side.push(reading.clone());
    }
    Split { kept, held_back }
}

/// Number of runs of [`READINGS`] touches, each by one sensor of a family, that are held out of a
/// mesh with `n_touches` touches in a training of `n_objects`. Chosen: at least two, so that
/// trials differ in the sensor, and at most half as many touches as the object is trained from,
/// so that these cost at most half as much again.
#[must_use]
pub fn n_runs(n_objects: usize, n_touches: usize) -> usize {
    runs_per_object(n_objects).min(n_touches / (2 * READINGS)).max(2)
}

/// The model with a calibration learnt on held-out readings ([`calibrate`]).
#[must_use]
pub fn calibrated(
    model: Arc<SurfaceModel>,
    held_back: &[HeldBack<'_>],
    seed: u64,
) -> Arc<SurfaceModel> {
    let calibration = calibrate(&model, held_back, SurfaceOptions::default(), seed);
    Arc::new(Arc::unwrap_or_clone(model).with_calibration(calibration))
}

#[cfg(test)]
mod tests {
    use palpate_core::pose::Pose;
    use palpate_core::reading::SensorId;
    use palpate_core::sensor::SensorDescription;

    use super::*;

    fn readings(n: usize) -> Vec<Reading> {
        let sensor = SensorDescription::digitacts_6x6();
        let reading = |index: usize| {
            let image = [Some(index as f64); 36];
            Reading::new(SensorId(0), &sensor, &image, Pose::IDENTITY).unwrap()
        };
        (0..n).map(reading).collect()
    }

    #[test]
    fn a_tenth_is_held_back_of_a_hundred_and_nothing_of_fewer() {
        let split_of = |n| {
            let Split { kept, held_back } = split(&readings(n));
            (kept.len(), held_back.len())
        };
        assert_eq!(split_of(99), (99, 0));
        assert_eq!(split_of(100), (90, 10));
        // The tenth, the twentieth, …: indices 9 and 19.
        let held_back = split(&readings(100)).held_back;
        assert!((held_back[0].image().max() - 9.0).abs() < 1e-12);
        assert!((held_back[1].image().max() - 19.0).abs() < 1e-12);
    }

    #[test]
    fn runs_are_at_least_two_and_at_most_half_of_the_touches() {
        // 400 trials over 2 objects, at most 40 each; 1000 / 16 = 62.
        assert_eq!(n_runs(2, 1_000), 40);
        // 400 / 100 = 4 of at most 62.
        assert_eq!(n_runs(100, 1_000), 4);
        // 100 / 16 = 6, and 20 / 16 = 1 becomes 2.
        assert_eq!([n_runs(2, 100), n_runs(2, 20)], [6, 2]);
    }
}
