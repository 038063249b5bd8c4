//! The passport: what commissioning found out about one sensor on one robot.
//!
//! It corrects touches as they are sent, and describes the sensor as it was measured. Only what
//! was found wrong is corrected; what is undetermined stays as stated. Not here: finding it
//! (`palpate_commissioning`).

use thiserror::Error;

use super::coupling::{Coupling, CoveringEdge};
use super::description::{ImageOrder, SensorDescription, SensorError, SensorParameters};
use super::family::bent;
use super::grid::TaxelGrid;
use super::ranges::StatedRanges;
use crate::convention::PoseConvention;
use crate::pose::Pose;

/// Deviations of a measured number that its range spans each way. Chosen: 95 % of a normal
/// distribution.
const RANGE: f64 = 2.0;

/// Largest relative half-width of a range. Chosen: that of a data sheet's spread.
const HALF_WIDTH_MAX: f64 = 0.7;

/// Half-width of the range of the covering's extent, pitches: half the steps that are tried.
const MARGIN_HALF_WIDTH: f64 = 0.5;

/// Smallest stiffening of a force curve. Derived: at −0.5 a straight curve stops rising at full
/// indentation.
const STIFFENING_MIN: f64 = -0.45;

/// Stiffening that a range may reach. Chosen: as for a data sheet.
const STIFFENING_MAX: f64 = 1.5;

/// A number and its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The likeliest value.
    pub value: f64,
    /// Its standard deviation, in the same unit.
    pub deviation: f64,
}

/// Correction and measured world of one sensor on one robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Passport {
    /// Factor from sent pressures to pascal.
    pub pascals: f64,
    /// Convention of sent poses.
    pub convention: PoseConvention,
    /// Order of the driver's images.
    pub image_order: ImageOrder,
    /// The tool centre: `sent_from_true` sensor.
    pub sent_from_true: Pose,
    /// Row-major indices of taxels without a meaning, in the sensor frame's order.
    pub dead: Vec<usize>,
    /// Factor on the described pressures.
    pub gain: Estimate,
    /// Excess of the pressure ratio at full indentation over that at first touch.
    pub stiffening: Estimate,
    /// Standard deviation of the point spread, metres.
    pub point_spread: Estimate,
    /// Extent of the covering beyond the array, metres; `None` without an end.
    pub margin: Option<f64>,
    /// Effect of the covering's end.
    pub edge: CoveringEdge,
    /// Whether the end was told from others.
    pub is_edge_known: bool,
    /// Deviation of single poses, metres.
    pub looseness: f64,
}

/// A number of a passport is not one.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("the passport's {field} is {found}, expected a finite number within its range")]
pub struct PassportError {
    /// The number.
    pub field: &'static str,
    /// Its value.
    pub found: f64,
}

impl Passport {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`PassportError`] names the first that is not finite or has the wrong sign.
    pub fn check(&self) -> Result<(), PassportError> {
        let positive = [
            ("pascals", self.pascals),
            ("gain", self.gain.value),
            ("point_spread", self.point_spread.value),
        ];
        let not_negative = [
            ("margin", self.margin.unwrap_or(0.0)),
            ("looseness", self.looseness),
            ("gain's deviation", self.gain.deviation),
            ("stiffening's deviation", self.stiffening.deviation),
            ("point_spread's deviation", self.point_spread.deviation),
        ];
        let is_wrong = |found: f64, is_right: bool| !(found.is_finite() && is_right);
        let wrong = positive.into_iter().find(|(_, n)| is_wrong(*n, *n > 0.0));
        let wrong = wrong.or(not_negative.into_iter().find(|(_, n)| is_wrong(*n, *n >= 0.0)));
        let stiffening = ("stiffening", self.stiffening.value);
        let wrong = wrong.or((!stiffening.1.is_finite()).then_some(stiffening));
        wrong.map_or(Ok(()), |(field, found)| Err(PassportError { field, found }))
    }

    /// Whether touches stay as they are sent.
    #[must_use]
    pub fn changes_nothing(&self, stated: &SensorDescription) -> bool {
        (self.pascals - 1.0).abs() < 1e-12
            && self.convention == PoseConvention::STATED
            && self.image_order == stated.parameters().image_order
            && self.sent_from_true == Pose::IDENTITY
            && self.dead.is_empty()
    }

    /// `session_from_sensor` in metres of the seven numbers that were sent as `sent`.
    #[must_use]
    pub fn pose(&self, sent: Pose) -> Pose {
        let (position, quaternion) = (sent.translation.to_array(), sent.rotation.to_array());
        self.convention.read(position, quaternion) * self.sent_from_true
    }

    /// Pressures in pascal, row-major in the sensor frame's order, of an image in the driver's
    /// order and unit; dead taxels lose their value.
    ///
    /// # Panics
    /// When the image has not as many taxels as the grid.
    #[must_use]
    pub fn image(&self, sent: &[Option<f64>], grid: &TaxelGrid) -> Vec<Option<f64>> {
        let mut image = self.image_order.row_major(sent, grid.rows, grid.cols);
        image.iter_mut().flatten().for_each(|pressure| *pressure *= self.pascals);
        for taxel in &self.dead {
            if let Some(pressure) = image.get_mut(*taxel) {
                *pressure = None;
            }
        }
        image
    }

    /// The sensor as it was measured, which training presses with.
    ///
    /// # Errors
    /// [`SensorError`] when a measured number is beyond what a description may state.
    pub fn description(
        &self,
        stated: &SensorDescription,
    ) -> Result<SensorDescription, SensorError> {
        let known = stated.parameters().clone();
        let stiffening = self.stiffening.value.max(STIFFENING_MIN);
        let coupling = if self.is_edge_known {
            Coupling { margin: self.margin, edge: self.edge, ..known.coupling }
        } else {
            known.coupling
        };
        SensorDescription::new(SensorParameters {
            point_spread: self.point_spread.value,
            force_curve: bent(
                &known.force_curve,
                known.covering_thickness,
                self.gain.value,
                stiffening,
            ),
            coupling,
            image_order: self.image_order,
            ..known
        })
    }

    /// What the passport leaves open about [`Self::description`]: what training draws sensors
    /// from, with `SensorFamily::within` and the knowledge of a data sheet.
    #[must_use]
    pub fn ranges(&self, stated: &SensorDescription) -> StatedRanges {
        let about = |estimate: &Estimate| {
            let relative = RANGE * estimate.deviation / estimate.value.max(1e-12);
            let relative = relative.min(HALF_WIDTH_MAX);
            (1.0 - relative, 1.0 + relative)
        };
        let half = MARGIN_HALF_WIDTH * stated.grid().pitch;
        let margin = self.margin.map(|margin| ((margin - half).max(0.0), margin + half));
        StatedRanges {
            spread_factor: Some(about(&self.point_spread)),
            margin: margin.filter(|_| self.is_edge_known),
            edges: self.is_edge_known.then(|| vec![self.edge]),
            stiffness: Some(about(&Estimate { value: 1.0, ..self.relative_gain() })),
            stiffening: Some((0.0, (RANGE * self.stiffening.deviation).min(STIFFENING_MAX))),
            ..StatedRanges::default()
        }
    }

    /// The gain with its deviation as a share of it.
    fn relative_gain(&self) -> Estimate {
        let value = self.gain.value.max(1e-12);
        Estimate { value, deviation: self.gain.deviation / value }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::convention::{PoseDirection, PositionUnit, QuaternionOrder};
    use crate::units::MM;

    fn passport() -> Passport {
        let one = Estimate { value: 1.0, deviation: 0.1 };
        Passport {
            pascals: 1e3,
            convention: PoseConvention {
                unit: PositionUnit::Millimetre,
                quaternion: QuaternionOrder::Wxyz,
                direction: PoseDirection::SessionFromSensor,
            },
            image_order: ImageOrder { rows_reversed: true, ..ImageOrder::default() },
            sent_from_true: Pose::from_parts(DQuat::IDENTITY, DVec3::new(0.0, 0.0, 4.0) * MM),
            dead: vec![1, 99],
            gain: one,
            stiffening: Estimate { value: 0.0, deviation: 0.1 },
            point_spread: Estimate { value: 1.0 * MM, deviation: 0.1 * MM },
            margin: None,
            edge: CoveringEdge::Continues,
            is_edge_known: true,
            looseness: 0.2 * MM,
        }
    }

    #[test]
    fn a_touch_is_corrected_by_hand() {
        let grid = TaxelGrid { rows: 2, cols: 2, pitch: 2.0 * MM, taxel_width: 1.8 * MM };
        // Rows reversed: the second sent row is the first; taxel 1 is then dead.
        let sent = [Some(1.0), Some(2.0), Some(3.0), None];
        assert_eq!(passport().image(&sent, &grid), [Some(3e3), None, Some(1e3), Some(2e3)]);
        // 10 mm along x, w first without a rotation, and 4 mm along the sensor's z.
        let pose = passport().pose(Pose::new([10.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]).unwrap());
        assert!(pose.translation.distance(DVec3::new(10.0, 0.0, 4.0) * MM) < 1e-15);
        assert!(pose.angle_to(&Pose::IDENTITY) < 1e-12);
    }

    #[test]
    fn a_covering_that_softens_is_described() {
        let stated = SensorDescription::digitacts_6x6();
        let softens = |value| Passport {
            stiffening: Estimate { value, deviation: 0.1 },
            edge: CoveringEdge::Continues,
            ..passport()
        };
        let described = softens(-0.9).description(&stated).unwrap();
        let (curve, thickness) =
            (&described.parameters().force_curve, described.parameters().covering_thickness);
        assert!(curve.pressure(thickness) > curve.pressure(0.9 * thickness));
    }

    #[test]
    fn numbers_that_are_none_are_named() {
        assert_eq!(passport().check(), Ok(()));
        let error = Passport { pascals: 0.0, ..passport() }.check().unwrap_err();
        assert_eq!(error, PassportError { field: "pascals", found: 0.0 });
        let error = Passport { looseness: f64::NAN, ..passport() }.check().unwrap_err();
        assert_eq!(error.field, "looseness");
    }
}
