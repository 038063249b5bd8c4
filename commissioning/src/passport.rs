//! The passport: findings as the correction of later touches, and as the sensor's world.
//!
//! Only what was found wrong is corrected; what is undetermined stays as stated. Not here:
//! storing passports and naming them in readings.

use palpate_core::pose::Pose;
use palpate_core::sensor::family::bent;
use palpate_core::sensor::{
    Coupling, CoveringEdge, ImageOrder, SensorDescription, SensorError, SensorParameters,
    StatedRanges,
};

use crate::commission::{Findings, TaxelFault};
use crate::estimate::{Choice, Estimate, Verdict};
use crate::touch::{PoseConvention, PoseDirection, PositionUnit, QuaternionOrder, SentTouch};

/// Deviations of a measured number that its range spans each way. Chosen: 95 % of a normal
/// distribution.
const RANGE: f64 = 2.0;

/// Largest relative half-width of a range. Chosen: that of a data sheet's spread.
const HALF_WIDTH_MAX: f64 = 0.7;

/// Half-width of the range of the covering's extent, pitches: half the steps that are tried.
const MARGIN_HALF_WIDTH: f64 = 0.5;

/// Smallest stiffening of a force curve: below −1 it would fall.
const STIFFENING_MIN: f64 = -0.9;

/// Stiffening that a range may reach. Chosen: as for a data sheet.
const STIFFENING_MAX: f64 = 1.5;

/// Correction of the touches of one sensor on one robot.
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

impl Passport {
    /// The passport of findings about a sensor with this description.
    #[must_use]
    pub fn of(findings: &Findings, stated: &SensorDescription) -> Self {
        let is_wrong = findings.tool.verdict == Verdict::Wrong;
        let dead = |fault: &(usize, TaxelFault)| (fault.1 == TaxelFault::Dead).then_some(fault.0);
        Self {
            pascals: kept(&findings.pressure_unit).pascals(stated),
            convention: PoseConvention {
                unit: kept(&findings.position_unit),
                quaternion: kept(&findings.quaternion),
                direction: kept(&findings.direction),
            },
            image_order: kept(&findings.image_order),
            sent_from_true: if is_wrong { findings.tool.sent_from_true } else { Pose::IDENTITY },
            dead: findings.taxels.iter().filter_map(dead).collect(),
            gain: findings.gain,
            stiffening: findings.stiffening,
            point_spread: findings.point_spread,
            margin: findings.edge.value.margin,
            edge: findings.edge.value.effect,
            is_edge_known: findings.edge.verdict() != Verdict::Undetermined,
            looseness: findings.looseness,
        }
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

    /// A touch as it should have been sent: pascal in the order that the description states, and
    /// the true pose in the API's convention.
    ///
    /// # Panics
    /// When the touch has not as many taxels as the sensor.
    #[must_use]
    pub fn corrected(&self, touch: &SentTouch, stated: &SensorDescription) -> SentTouch {
        let (rows, cols) = (stated.grid().rows, stated.grid().cols);
        let mut image = self.image_order.row_major(&touch.pressures, rows, cols);
        image.iter_mut().flatten().for_each(|pressure| *pressure *= self.pascals);
        self.dead.iter().for_each(|taxel| image[*taxel] = None);
        let sent = self.convention.read(touch.position, touch.quaternion);
        let (position, quaternion) = PoseConvention {
            unit: PositionUnit::Metre,
            quaternion: QuaternionOrder::Xyzw,
            direction: PoseDirection::SessionFromSensor,
        }
        .write(sent * self.sent_from_true);
        let pressures = stated.parameters().image_order.of_driver(&image, rows, cols);
        SentTouch { pressures, position, quaternion }
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

/// What is found wrong, otherwise what is stated.
fn kept<T: PartialEq + Copy>(choice: &Choice<T>) -> T {
    if choice.verdict() == Verdict::Wrong { choice.value } else { choice.stated }
}
