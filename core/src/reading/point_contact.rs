//! A contact without an image: where a sensor felt a surface, or that it felt none there.
//!
//! Bumpers, force–torque sensors and single taxels report contacts of this kind. Position and
//! normal are in the session frame (in which they were felt; nothing transforms them). Their
//! standard deviations are the sensor's own; the robot's base and the object's motion add to
//! them. The numbers of a [`PointContact`] are finite.

use glam::DVec3;
use thiserror::Error;

use super::{Base, SensorId};
use crate::units::{Beyond, Shown};

/// Largest coordinate of a position, metres. Chosen: beyond it single precision says nothing.
const POSITION_MAX: f64 = 1e6;
/// Largest standard deviation of a position, metres. Chosen: the size of a hand-held object.
const POSITION_DEVIATION_MAX: f64 = 0.1;
/// Largest standard deviation of a normal, rad. Chosen: a normal known to less than 57° says no
/// more than none.
const NORMAL_DEVIATION_MAX: f64 = 1.0;
/// Difference of a normal's norm from 1 that is taken for rounding. Chosen: three digits.
const NORM_TOLERANCE: f64 = 1e-2;
/// Largest force, newton. Chosen: more than any robot's sensor bears.
const FORCE_MAX: f64 = 1e5;

/// An outward normal and its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeltNormal {
    /// The outward normal of the touched surface, norm 1; for a miss, against the way of the
    /// sensor.
    pub direction: DVec3,
    /// Standard deviation about either axis, rad.
    pub deviation: f64,
}

/// The unchecked numbers of a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactNumbers {
    /// Whether something was touched; if not, nothing is at the position.
    pub touched: bool,
    /// Place of the contact, metres: x, y, z.
    pub position: [f64; 3],
    /// Standard deviation of the position in each direction, metres.
    pub position_deviation: f64,
    /// The outward normal, if it was felt: x, y, z of norm 1.
    pub normal: Option<[f64; 3]>,
    /// Standard deviation of the normal about either axis, rad; with `normal` only.
    pub normal_deviation: Option<f64>,
    /// Normal force, newton, if it was measured.
    pub force: Option<f64>,
}

/// A contact without an image, checked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointContact {
    sensor: SensorId,
    numbers: ContactNumbers,
    normal: Option<FeltNormal>,
    approach: f64,
    base: Option<Base>,
}

/// A number of a contact that can be wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactField {
    /// [`ContactNumbers::position`].
    Position,
    /// [`ContactNumbers::position_deviation`].
    PositionDeviation,
    /// [`ContactNumbers::normal`].
    Normal,
    /// [`ContactNumbers::normal_deviation`].
    NormalDeviation,
    /// [`ContactNumbers::force`].
    Force,
}

/// Error of numbers that are not a contact.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum ContactError {
    /// A number is not finite or not within its range.
    #[error("is {}, expected {expected}", Beyond(*found, *limits))]
    Range {
        /// The number.
        field: ContactField,
        /// The given value.
        found: f64,
        /// The smallest and the largest permitted value.
        limits: [f64; 2],
        /// The range and unit.
        expected: &'static str,
    },
    /// The normal is not of norm 1.
    #[error("has the norm {}, expected 1: an outward unit vector", Shown(*norm))]
    Norm {
        /// The given norm.
        norm: f64,
    },
    /// A normal without its deviation.
    #[error("is missing, expected with `normal`: its standard deviation, above 0, at most 1 rad")]
    DeviationMissing,
    /// A deviation of a normal that was not given.
    #[error("came without `normal`, expected both or neither")]
    DeviationAlone,
}

impl ContactError {
    /// The number that is wrong.
    #[must_use]
    pub fn field(&self) -> ContactField {
        match self {
            Self::Range { field, .. } => *field,
            Self::Norm { .. } => ContactField::Normal,
            Self::DeviationMissing | Self::DeviationAlone => ContactField::NormalDeviation,
        }
    }
}

impl PointContact {
    /// Checks the numbers of a contact.
    ///
    /// # Errors
    /// [`ContactError`] names the first wrong number.
    pub fn new(sensor: SensorId, numbers: ContactNumbers) -> Result<Self, ContactError> {
        let range = |field, found: f64, limits @ [low, high]: [f64; 2], expected| {
            // A standard deviation is above 0, other numbers may be at their limits.
            let is_deviation = !matches!(field, ContactField::Position | ContactField::Force);
            if (low..=high).contains(&found) && !(is_deviation && found <= 0.0) {
                return Ok(());
            }
            Err(ContactError::Range { field, found, limits, expected })
        };
        for found in numbers.position {
            let limits = [-POSITION_MAX, POSITION_MAX];
            range(ContactField::Position, found, limits, "metres within ±1e6")?;
        }
        let found = numbers.position_deviation;
        let limits = [0.0, POSITION_DEVIATION_MAX];
        let expected = "a standard deviation above 0, at most 0.1 m";
        range(ContactField::PositionDeviation, found, limits, expected)?;
        if let Some(found) = numbers.force {
            range(ContactField::Force, found, [0.0, FORCE_MAX], "newton from 0 to 1e5")?;
        }
        let normal = match (numbers.normal, numbers.normal_deviation) {
            (None, None) => None,
            (None, Some(_)) => return Err(ContactError::DeviationAlone),
            (Some(_), None) => return Err(ContactError::DeviationMissing),
            (Some(normal), Some(deviation)) => {
                let direction = DVec3::from_array(normal);
                let norm = direction.length();
                // A norm that is not a number is refused as well.
                let is_unit = (norm - 1.0).abs() <= NORM_TOLERANCE;
                if !is_unit {
                    return Err(ContactError::Norm { norm });
                }
                let limits = [0.0, NORMAL_DEVIATION_MAX];
                let expected = "a standard deviation above 0, at most 1 rad";
                range(ContactField::NormalDeviation, deviation, limits, expected)?;
                Some(FeltNormal { direction: direction / norm, deviation })
            }
        };
        Ok(Self { sensor, numbers, normal, approach: 0.0, base: None })
    }

    /// The sensor that felt it.
    #[must_use]
    pub fn sensor(&self) -> SensorId {
        self.sensor
    }

    /// Whether something was touched; if not, nothing is at the position.
    #[must_use]
    pub fn touched(&self) -> bool {
        self.numbers.touched
    }

    /// Its place in the session frame, metres.
    #[must_use]
    pub fn position(&self) -> DVec3 {
        DVec3::from_array(self.numbers.position)
    }

    /// Standard deviation of the position in each direction, metres.
    #[must_use]
    pub fn position_deviation(&self) -> f64 {
        self.numbers.position_deviation
    }

    /// The outward normal, if it was felt.
    #[must_use]
    pub fn normal(&self) -> Option<FeltNormal> {
        self.normal
    }

    /// The normal force, newton, if it was measured.
    #[must_use]
    pub fn force(&self) -> Option<f64> {
        self.numbers.force
    }

    /// Length of the free path against the normal before the contact, metres; 0 when not stated.
    #[must_use]
    pub fn approach(&self) -> f64 {
        self.approach
    }

    /// The same contact after a free path of `metres` against the normal; a value that is not
    /// positive counts as 0, and so does the path of a contact without a normal.
    #[must_use]
    pub fn after_approach(mut self, metres: f64) -> Self {
        let is_known = metres.is_finite() && self.normal.is_some();
        self.approach = if is_known { metres.max(0.0) } else { 0.0 };
        self
    }

    /// The robot's base, if its position is uncertain.
    #[must_use]
    pub fn base(&self) -> Option<Base> {
        self.base
    }

    /// The same contact by a robot with an uncertain base.
    #[must_use]
    pub fn with_base(mut self, base: Base) -> Self {
        self.base = Some(base);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONTACT: ContactNumbers = ContactNumbers {
        touched: true,
        position: [0.1, 0.2, 0.3],
        position_deviation: 0.002,
        normal: Some([0.0, 0.0, 1.0]),
        normal_deviation: Some(0.2),
        force: Some(3.0),
    };

    fn field(numbers: ContactNumbers) -> ContactField {
        PointContact::new(SensorId(1), numbers).unwrap_err().field()
    }

    #[test]
    fn a_wrong_number_is_refused_by_its_name() {
        let wrong = [f64::NAN, f64::INFINITY, -1.0, 0.0, 2.0];
        for found in wrong {
            let numbers = ContactNumbers { position_deviation: found, ..CONTACT };
            assert_eq!(field(numbers), ContactField::PositionDeviation, "{found}");
            let numbers = ContactNumbers { normal_deviation: Some(found), ..CONTACT };
            assert_eq!(field(numbers), ContactField::NormalDeviation, "{found}");
            let numbers = ContactNumbers { normal: Some([0.0, found, 0.5]), ..CONTACT };
            assert_eq!(field(numbers), ContactField::Normal, "{found}");
        }
        let position = [0.0, f64::NAN, 0.0];
        assert_eq!(field(ContactNumbers { position, ..CONTACT }), ContactField::Position);
        assert_eq!(field(ContactNumbers { force: Some(-1.0), ..CONTACT }), ContactField::Force);
        for (normal, normal_deviation) in [(CONTACT.normal, None), (None, Some(0.1))] {
            let numbers = ContactNumbers { normal, normal_deviation, ..CONTACT };
            assert_eq!(field(numbers), ContactField::NormalDeviation);
        }
    }

    #[test]
    fn a_normal_is_of_norm_one_after_rounding() {
        let normal = Some([0.0, 0.6005, 0.8005]);
        let contact = PointContact::new(SensorId(1), ContactNumbers { normal, ..CONTACT }).unwrap();
        assert!((contact.normal().unwrap().direction.length() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_path_needs_a_normal_for_its_direction() {
        let contact = |numbers| PointContact::new(SensorId(1), numbers).unwrap();
        assert!((contact(CONTACT).after_approach(0.1).approach() - 0.1).abs() < 1e-12);
        let blind = ContactNumbers { normal: None, normal_deviation: None, ..CONTACT };
        assert!(contact(blind).after_approach(0.1).approach().abs() < 1e-12);
    }
}
