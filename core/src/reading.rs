//! A reading: one press of a tactile sensor, checked at construction, or a contact without an
//! image ([`point_contact`]).
//!
//! Pressures are in pascal, row-major in the sensor frame's order; a missing value marks an
//! invalid taxel. The pose is `session_from_sensor` (in training, the session frame is the
//! object's). The numbers of a [`Reading`] are finite.

mod base;
mod image;
mod error;
pub mod point_contact;

pub use self::base::{Base, Looseness};
pub use self::error::ReadingError;
use self::image::fill_missing;
pub use self::image::{ImageShape, TactileImage};
use self::point_contact::PointContact;
use crate::pose::Pose;
use crate::sensor::{Correction, SensorDescription};

/// The sensor that took a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SensorId(pub u128);

/// One press: the image, the sensor's pose, and the sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    sensor: SensorId,
    session_from_sensor: Pose,
    image: TactileImage,
    missing: Vec<bool>,
    approach: f64,
    base: Option<Base>,
    looseness: f64,
    drawn_from: Option<Box<Drawn>>,
}

/// What an image was drawn from: a press by a layout of taxels.
#[derive(Clone, Debug, PartialEq)]
struct Drawn {
    values: Vec<Option<f64>>,
    sensor_from_image: Pose,
}

/// What a sensor felt: a press with an image, or a contact without one. Methods that compare
/// images take a [`Reading`]; what takes both takes this.
#[derive(Clone, Debug, PartialEq)]
pub enum Felt {
    /// A press with its image.
    Press(Reading),
    /// A contact without an image.
    Contact(PointContact),
}

impl Felt {
    /// The press, unless it is a contact without an image.
    #[must_use]
    pub fn press(&self) -> Option<&Reading> {
        match self {
            Self::Press(reading) => Some(reading),
            Self::Contact(_) => None,
        }
    }

    /// The same by a robot with an uncertain base.
    #[must_use]
    pub fn with_base(self, base: Base) -> Self {
        match self {
            Self::Press(reading) => Self::Press(reading.with_base(base)),
            Self::Contact(contact) => Self::Contact(contact.with_base(base)),
        }
    }
}

impl Reading {
    /// Checks an image against the sensor that took it and brings it into the sensor frame's
    /// order. `pressures` are in the driver's order (the sensor's [`crate::sensor::ImageOrder`]),
    /// in pascal.
    ///
    /// Missing taxels take the mean of their valid neighbours, nearest ring first. Values of a
    /// layout of taxels are drawn on its grid, and the pose becomes that of the drawing
    /// ([`crate::sensor::unrolling`]).
    ///
    /// # Errors
    /// [`ReadingError`] for a wrong number of taxels, a pressure that is not finite, or more
    /// than half of the taxels missing.
    pub fn new(
        sensor: SensorId,
        description: &SensorDescription,
        pressures: &[Option<f64>],
        session_from_sensor: Pose,
    ) -> Result<Self, ReadingError> {
        let ordered = checked(description, pressures)?;
        Self::filled(sensor, description, &ordered, session_from_sensor)
    }

    /// Like [`Reading::new`], with the pressures and the pose corrected: by taxel lines
    /// (equation 2.1), then by a passport. Taxels that either excludes count as missing.
    ///
    /// # Errors
    /// As [`Reading::new`]; the range also holds for corrected pressures.
    pub fn corrected(
        sensor: SensorId,
        description: &SensorDescription,
        correction: &Correction,
        pressures: &[Option<f64>],
        sent: Pose,
    ) -> Result<Self, ReadingError> {
        let lined = after_lines(description, correction, pressures)?;
        let ordered = match &correction.passport {
            None => in_order(description, &lined),
            Some(passport) => {
                let pascals = |p: &Option<f64>| p.map(|p| p * passport.pascals);
                bounded(&lined.iter().map(pascals).collect::<Vec<_>>())?;
                passport.image(&lined, description.grid())
            }
        };
        let looseness = correction.passport.as_ref().map_or(0.0, |passport| passport.looseness);
        let read = Self::filled(sensor, description, &ordered, correction.pose(sent))?;
        Ok(read.with_looseness(looseness))
    }

    fn filled(
        sensor: SensorId,
        description: &SensorDescription,
        ordered: &[Option<f64>],
        session_from_sensor: Pose,
    ) -> Result<Self, ReadingError> {
        let (rows, cols) = (description.grid().rows, description.grid().cols);
        let n_missing = ordered.iter().filter(|pressure| pressure.is_none()).count();
        if 2 * n_missing > ordered.len() {
            return Err(ReadingError::Missing { missing: n_missing, expected: ordered.len() });
        }
        let drawn =
            description.listed().map(|layout| layout.unroll(ordered, description.contact_floor()));
        let (shown, session_from_sensor) = match &drawn {
            None => (ordered, session_from_sensor),
            Some(drawn) => (&drawn.image[..], session_from_sensor * drawn.sensor_from_image),
        };
        let missing: Vec<bool> = shown.iter().map(Option::is_none).collect();
        let image = TactileImage { rows, cols, pressures: fill_missing(shown, rows, cols) };
        let drawn_from = drawn.as_ref().map(|drawn| {
            let sensor_from_image = drawn.sensor_from_image;
            Box::new(Drawn { values: ordered.to_vec(), sensor_from_image })
        });
        Ok(Self {
            sensor,
            session_from_sensor,
            image,
            missing,
            approach: 0.0,
            base: None,
            looseness: 0.0,
            drawn_from,
        })
    }

    /// The sensor that took the reading.
    #[must_use]
    pub fn sensor(&self) -> SensorId {
        self.sensor
    }

    /// The pose of the image: that of the sensor, or for a layout of taxels that of the plane on
    /// which its press was drawn.
    #[must_use]
    pub fn session_from_sensor(&self) -> Pose {
        self.session_from_sensor
    }

    /// The image in the sensor frame's order, missing taxels filled in.
    #[must_use]
    pub fn image(&self) -> &TactileImage {
        &self.image
    }

    /// The pose of the sensor itself.
    #[must_use]
    pub fn sent_pose(&self) -> Pose {
        match &self.drawn_from {
            None => self.session_from_sensor,
            Some(drawn) => self.session_from_sensor * drawn.sensor_from_image.inverse(),
        }
    }

    /// The values of the taxels in the sensor frame's order, Pa, `None` for missing ones: those of
    /// the image, or those that a layout's image was drawn from.
    #[must_use]
    pub fn values(&self) -> Vec<Option<f64>> {
        if let Some(drawn) = &self.drawn_from {
            return drawn.values.clone();
        }
        let taxels = self.image.pressures.iter().zip(&self.missing);
        taxels.map(|(pressure, is_missing)| (!is_missing).then_some(*pressure)).collect()
    }

    /// Whether each taxel was missing, in the order of the image.
    #[must_use]
    pub fn missing(&self) -> &[bool] {
        &self.missing
    }

    /// Length of the sensor's free path along its own +z before the press, metres; 0 when not
    /// stated.
    #[must_use]
    pub fn approach(&self) -> f64 {
        self.approach
    }

    /// The same press after a free path of `metres` along the sensor's +z; a value that is
    /// not positive counts as 0.
    #[must_use]
    pub fn after_approach(mut self, metres: f64) -> Self {
        self.approach = if metres.is_finite() { metres.max(0.0) } else { 0.0 };
        self
    }

    /// Standard deviation of the stated place of this press alone, in each direction, metres; 0
    /// unless a passport says more.
    #[must_use]
    pub fn looseness(&self) -> f64 {
        self.looseness
    }

    /// The same press by a sensor whose places have this standard deviation, metres.
    #[must_use]
    pub fn with_looseness(mut self, metres: f64) -> Self {
        self.looseness = metres;
        self
    }

    /// The robot's base, if its position is uncertain.
    #[must_use]
    pub fn base(&self) -> Option<Base> {
        self.base
    }

    /// The same press by a robot with an uncertain base.
    #[must_use]
    pub fn with_base(mut self, base: Base) -> Self {
        self.base = Some(base);
        self
    }

    /// The same press seen from another frame: `other_from_session`.
    #[must_use]
    pub fn moved_by(&self, other_from_session: Pose) -> Self {
        Self { session_from_sensor: other_from_session * self.session_from_sensor, ..self.clone() }
    }
}

/// The pressures of a driver's image, checked, in the sensor frame's row-major order.
///
/// # Errors
/// [`ReadingError::TaxelCount`] and [`ReadingError::Pressure`].
pub fn checked(
    description: &SensorDescription,
    pressures: &[Option<f64>],
) -> Result<Vec<Option<f64>>, ReadingError> {
    let (found, expected) = (pressures.len(), description.n_taxels());
    if found != expected {
        let shape = ImageShape::of(description);
        return Err(ReadingError::TaxelCount { expected, found, shape });
    }
    bounded(pressures)?;
    Ok(in_order(description, pressures))
}

/// The image of a driver after the taxel lines of a correction, in the driver's order and unit.
///
/// # Errors
/// As [`checked`].
pub fn after_lines(
    description: &SensorDescription,
    correction: &Correction,
    pressures: &[Option<f64>],
) -> Result<Vec<Option<f64>>, ReadingError> {
    let mut ordered = checked(description, pressures)?;
    let Some(lines) = &correction.lines else { return Ok(pressures.to_vec()) };
    lines.correct(&mut ordered);
    if description.listed().is_some() {
        return Ok(ordered);
    }
    let grid = description.grid();
    Ok(description.parameters().image_order.of_driver(&ordered, grid.rows, grid.cols))
}

fn in_order(description: &SensorDescription, pressures: &[Option<f64>]) -> Vec<Option<f64>> {
    if description.listed().is_some() {
        return pressures.to_vec();
    }
    let grid = description.grid();
    description.parameters().image_order.row_major(pressures, grid.rows, grid.cols)
}

fn bounded(pressures: &[Option<f64>]) -> Result<(), ReadingError> {
    let is_wrong = |found: f64| !(found.is_finite() && found.abs() <= 1e8);
    let wrong = pressures.iter().enumerate().find_map(|(taxel, pressure)| {
        pressure.filter(|found| is_wrong(*found)).map(|found| (taxel, found))
    });
    wrong.map_or(Ok(()), |(taxel, found)| Err(ReadingError::Pressure { taxel, found }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::{ImageOrder, SensorParameters, TaxelGrid};
    use crate::units::MM;

    fn sensor(rows: usize, cols: usize, image_order: ImageOrder) -> SensorDescription {
        let parameters = SensorDescription::digitacts_6x6().parameters().clone();
        let grid = TaxelGrid { rows, cols, pitch: 2.0 * MM, taxel_width: 1.8 * MM };
        SensorDescription::new(SensorParameters { grid, image_order, ..parameters }).unwrap()
    }

    fn read(
        description: &SensorDescription,
        pressures: &[Option<f64>],
    ) -> Result<Reading, ReadingError> {
        Reading::new(SensorId(1), description, pressures, Pose::IDENTITY)
    }

    #[test]
    fn a_wrong_shape_is_refused_with_both_counts() {
        let error = read(&SensorDescription::digitacts_6x6(), &[Some(0.0); 35]).unwrap_err();
        assert!(matches!(error, ReadingError::TaxelCount { expected: 36, found: 35, .. }));
    }

    #[test]
    fn a_pressure_that_is_not_finite_is_refused_by_taxel() {
        let mut pressures = vec![Some(1.0); 36];
        pressures[7] = Some(f64::INFINITY);
        let error = read(&SensorDescription::digitacts_6x6(), &pressures).unwrap_err();
        assert!(matches!(error, ReadingError::Pressure { taxel: 7, .. }));
    }

    #[test]
    fn a_missing_taxel_is_the_mean_of_its_neighbours() {
        let description = sensor(3, 3, ImageOrder::default());
        let mut pressures: Vec<Option<f64>> = (0..9).map(|n| Some(f64::from(n))).collect();
        pressures[4] = None;
        let reading = read(&description, &pressures).unwrap();
        assert!((reading.image().at(1, 1) - 4.0).abs() < 1e-12); // (0+1+2+3+5+6+7+8)/8
        assert_eq!(reading.missing().iter().filter(|missing| **missing).count(), 1);
    }

    #[test]
    fn more_than_half_missing_is_refused() {
        let mut pressures = vec![None; 36];
        pressures[..17].fill(Some(1.0));
        let error = read(&SensorDescription::digitacts_6x6(), &pressures).unwrap_err();
        assert_eq!(error, ReadingError::Missing { missing: 19, expected: 36 });
    }

    #[test]
    fn images_are_brought_into_the_sensor_frames_order() {
        // Ours, 2 rows × 3 columns: 0 1 2 / 3 4 5.
        let cases = [
            (ImageOrder { transposed: true, ..Default::default() }, [0, 3, 1, 4, 2, 5]),
            (ImageOrder { rows_reversed: true, ..Default::default() }, [3, 4, 5, 0, 1, 2]),
            (ImageOrder { cols_reversed: true, ..Default::default() }, [2, 1, 0, 5, 4, 3]),
        ];
        for (order, sent) in cases {
            let sent: Vec<Option<f64>> = sent.iter().map(|n| Some(f64::from(*n))).collect();
            let reading = read(&sensor(2, 3, order), &sent).unwrap();
            assert_eq!(reading.image().pressures, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], "{order:?}");
        }
    }
}
