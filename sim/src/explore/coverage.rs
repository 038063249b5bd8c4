//! The touched share of an object's surface, the measure by which strategies are compared.

use glam::DVec3;
use palpate_core::rng::{Purpose, Stream};

use super::Touch;
use crate::press::PressSimulator;

/// Number of points that represent the surface.
const N_POINTS: usize = 2000;

impl Touch {
    /// Position of the sensor at rest, metres in the object's frame; the object may have
    /// moved since.
    #[must_use]
    pub fn place_in_object(&self) -> DVec3 {
        self.session_from_object.inverse() * self.reading.session_from_sensor().translation
    }
}

/// The share of the object's surface, by area, within `radius` (metres) of one of
/// `places_in_object` (metres), 0 to 1.
///
/// Estimated from 2,000 uniform points, always the same: a deviation of at most 0.011.
#[must_use]
pub fn covered_share(simulator: &PressSimulator, places_in_object: &[DVec3], radius: f64) -> f64 {
    let mut stream = Stream::new(0, Purpose::Exploration, 0);
    let is_covered = |_: &usize| {
        let point = simulator.surface().draw(None, &mut stream).point;
        let near = |place: &DVec3| place.distance_squared(point) <= radius * radius;
        places_in_object.iter().any(near)
    };
    (0..N_POINTS).filter(is_covered).count() as f64 / N_POINTS as f64
}
