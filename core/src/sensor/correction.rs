//! The correction of a sensor's touches: taxel lines, then a passport.
//!
//! The lines were fitted to pressures as sent, and the passport to touches after the lines. Either
//! may be missing.

use super::calibration::Calibration;
use super::passport::Passport;
use crate::pose::Pose;

/// What applies to the touches of one sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Correction {
    /// The response lines of the taxels.
    pub lines: Option<Calibration>,
    /// The passport.
    pub passport: Option<Passport>,
}

impl Correction {
    /// `session_from_sensor` of a pose as sent.
    #[must_use]
    pub fn pose(&self, sent: Pose) -> Pose {
        self.passport.as_ref().map_or(sent, |passport| passport.pose(sent))
    }

    /// Whether a taxel's values are used; `taxel` is row-major in the sensor frame's order.
    #[must_use]
    pub fn is_usable(&self, taxel: usize) -> bool {
        self.lines.as_ref().is_none_or(|lines| lines.is_usable(taxel))
            && self.passport.as_ref().is_none_or(|passport| !passport.dead.contains(&taxel))
    }
}
