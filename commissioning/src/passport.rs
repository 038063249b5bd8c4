//! The passport of findings. Only what was found wrong is corrected; what is undetermined stays as
//! stated. Not here: what a passport does (`palpate_core::sensor::passport`).

use palpate_core::convention::{PoseConvention, PoseDirection, PositionUnit, QuaternionOrder};
use palpate_core::pose::Pose;
use palpate_core::sensor::{Estimate, ImageOrder, Passport, SensorDescription};

use crate::commission::{Findings, TaxelFault};
use crate::estimate::{Choice, Verdict};
use crate::touch::SentTouch;

/// The passport of findings about a sensor with this description.
#[must_use]
pub fn passport(findings: &Findings, stated: &SensorDescription) -> Passport {
    let is_wrong = findings.tool.verdict == Verdict::Wrong;
    let image_order = kept(&findings.image_order);
    let is_dead = |fault: &&(usize, TaxelFault)| fault.1 == TaxelFault::Dead;
    let dead = findings.taxels.iter().filter(is_dead).map(|fault| fault.0);
    Passport {
        pascals: kept(&findings.pressure_unit).pascals(stated),
        convention: PoseConvention {
            unit: kept(&findings.position_unit),
            quaternion: kept(&findings.quaternion),
            direction: kept(&findings.direction),
        },
        image_order,
        sent_from_true: if is_wrong { findings.tool.sent_from_true } else { Pose::IDENTITY },
        dead: moved(dead.collect(), findings.image_order.value, image_order, stated),
        gain: bounded(findings.gain),
        stiffening: bounded(findings.stiffening),
        point_spread: bounded(findings.point_spread),
        margin: findings.edge.value.margin,
        edge: findings.edge.value.effect,
        is_edge_known: findings.edge.verdict() != Verdict::Undetermined,
        looseness: findings.looseness,
    }
}

/// A touch as it should have been sent: pascal in the order that the description states, and
/// the true pose in the API's convention.
///
/// # Panics
/// When the touch has not as many taxels as the sensor.
#[must_use]
pub fn corrected(passport: &Passport, touch: &SentTouch, stated: &SensorDescription) -> SentTouch {
    let grid = stated.grid();
    let image = passport.image(&touch.pressures, grid);
    let sent = passport.convention.read(touch.position, touch.quaternion);
    let (position, quaternion) = PoseConvention {
        unit: PositionUnit::Metre,
        quaternion: QuaternionOrder::Xyzw,
        direction: PoseDirection::SessionFromSensor,
    }
    .write(sent * passport.sent_from_true);
    let pressures = stated.parameters().image_order.of_driver(&image, grid.rows, grid.cols);
    SentTouch { pressures, position, quaternion }
}

/// What is found wrong, otherwise what is stated.
fn kept<T: PartialEq + Copy>(choice: &Choice<T>) -> T {
    if choice.verdict() == Verdict::Wrong { choice.value } else { choice.stated }
}

/// An estimate whose deviation is a number: touches that say nothing leave an infinite one.
fn bounded(estimate: Estimate) -> Estimate {
    let deviation = if estimate.deviation.is_finite() { estimate.deviation } else { UNKNOWN };
    Estimate { deviation, ..estimate }
}

/// Deviation of a number that the touches do not tell: wider than every range.
const UNKNOWN: f64 = 1e3;

/// Indices of taxels in images of the order `found`, in those of the order `kept`.
fn moved(
    taxels: Vec<usize>,
    found: ImageOrder,
    kept: ImageOrder,
    sensor: &SensorDescription,
) -> Vec<usize> {
    let grid = sensor.grid();
    let sent: Vec<usize> = (0..grid.n_taxels()).collect();
    let [found, kept] = [found, kept].map(|order| order.row_major(&sent, grid.rows, grid.cols));
    let place = |taxel: usize| kept.iter().position(|at| *at == found[taxel]);
    let mut moved: Vec<usize> = taxels.into_iter().filter_map(place).collect();
    moved.sort_unstable();
    moved
}
