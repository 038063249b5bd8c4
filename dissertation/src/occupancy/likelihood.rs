//! Likelihood of a press under a pose of an object: equations 3.7–3.8 over its taxels.
//!
//! Source: section 3.3.2. A press is classified once, in the frame of its pose, and then
//! looked up under any number of hypotheses. The taxels are taken as independent, as printed;
//! an exponent below 1 (in the filters) tempers that. Log domain, natural logarithms.

use glam::DVec3;

use super::classify::{ContactClass, WeakPress, classify_reading};
use super::grid::OccupancyGrid;
use super::table::ClassTable;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;

/// A press as contact classes at points.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassifiedPress(Vec<(DVec3, ContactClass)>);

impl ClassifiedPress {
    /// Bytes of the taxels.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.0.capacity() * size_of::<(DVec3, ContactClass)>()
    }

    /// Classifies a reading. A touching taxel's point lies on the surface, at z =
    /// −displacement in the sensor frame; any other's on the covering, at z = 0. Points in
    /// the frame of the reading's pose, metres, row-major.
    #[must_use]
    pub fn new(
        reading: &Reading,
        sensor: &SensorDescription,
        threshold: f64,
        weak: WeakPress,
    ) -> Self {
        let (grid, curve) = (sensor.grid(), &sensor.parameters().force_curve);
        let classes = classify_reading(reading, threshold, weak);
        let taxels = classes.into_iter().enumerate().map(|(taxel, class)| {
            let (x, y) = grid.center(taxel / grid.cols, taxel % grid.cols);
            let z = match class {
                ContactClass::InContact => -curve.displacement(reading.image().pressures[taxel]),
                ContactClass::NoContact | ContactClass::Unknown => 0.0,
            };
            (reading.session_from_sensor() * DVec3::new(x, y, z), class)
        });
        Self(taxels.collect())
    }

    /// A press of given points and classes.
    #[must_use]
    pub fn from_taxels(taxels: Vec<(DVec3, ContactClass)>) -> Self {
        Self(taxels)
    }

    /// The taxels' points (metres) and classes.
    #[must_use]
    pub fn taxels(&self) -> &[(DVec3, ContactClass)] {
        &self.0
    }

    /// The same press in another frame.
    #[must_use]
    pub fn moved_by(&self, other_from_this: Pose) -> Self {
        Self(self.0.iter().map(|(point, class)| (other_from_this * *point, *class)).collect())
    }
}

/// ln Pr(press | the object at a pose): the sum over the taxels of ln Pr(class | log-odds),
/// with the log-odds interpolated at the taxel's position in the object.
///
/// `press` is in the session frame, `map` in the object's.
#[must_use]
pub fn log_likelihood(
    press: &ClassifiedPress,
    map: &OccupancyGrid,
    table: &ClassTable,
    session_from_object: &Pose,
) -> f64 {
    let object_from_session = session_from_object.inverse();
    let taxel = |(point_in_session, class): &(DVec3, ContactClass)| {
        let log_odds = map.log_odds_at(object_from_session * *point_in_session);
        table.probability(*class, log_odds).ln()
    };
    press.0.iter().map(taxel).sum()
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::occupancy::GridShape;

    #[test]
    fn the_likelihood_of_two_taxels_matches_a_hand_computed_value() {
        // Two cells of 1 m: log-odds −2 at x = 0.5 and +2 at x = 1.5, the object turned by 90°
        // and moved to (3, 0): object x is session y, object y is 3 − session x.
        let shape = GridShape::new(DVec3::ZERO, 1.0, [2, 1, 1]).unwrap();
        let map = OccupancyGrid::from_parts(shape, 0.5, vec![-2.0, 2.0]).unwrap();
        let turned = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let session_from_object = Pose::from_parts(turned, DVec3::new(3.0, 0.0, 0.0));
        let press = ClassifiedPress::from_taxels(vec![
            (DVec3::new(2.5, 1.25, 0.0), ContactClass::InContact), // object (1.25, 0.5): log-odds 1
            (DVec3::new(2.5, 0.5, 0.0), ContactClass::NoContact),  // object (0.5, 0.5): −2
        ]);
        // Pr(occupied) 0.731059 and 0.119203: 0.0333 + 0.9·0.731059 = 0.691286 and
        // 0.0333 + 0.9·0.880797 = 0.826051; the logs sum to −0.369202 − 0.191099.
        let found = log_likelihood(&press, &map, &ClassTable::literal(), &session_from_object);
        assert!((found + 0.560_301).abs() < 2e-4, "{found}");
    }
}
