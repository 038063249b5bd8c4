//! Errors of a mechanism and a real array in a press.
//!
//! Order: placement, depth and tilt of the whole letter; then for each taxel its gain, drift,
//! additive noise, clipping, the converter's step, and perhaps a stuck value. Source: section
//! 3.2.3 (the rig) and sections 2.1–2.2 (differences between elements). The numbers were
//! chosen so that the contact classifier of equation 3.3 is right about nine times out of
//! ten.

use palpate_core::rng::Stream;
use palpate_core::units::{DEG, KPA, MM};

use super::{PlanarPose, Unmatched};

/// Gains and drifts are drawn within this many deviations, so that none is negative.
const DEVIATIONS_MAX: f64 = 2.5;

/// Deviations of presses from the ideal. Every number is a standard deviation unless it says
/// otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigNoise {
    /// A taxel's gain, the same in all presses; relative to 1.
    pub gain_spread: f64,
    /// A taxel's gain, redrawn for each reading; relative to 1.
    pub drift: f64,
    /// The logarithm of a press's depth.
    pub depth_spread: f64,
    /// The slope of the pressed face along x and along y: relative change of depth per metre.
    pub tilt: f64,
    /// The sensor's position along x and along y, metres.
    pub placement: f64,
    /// The sensor's angle, radians.
    pub placement_angle: f64,
    /// Additive noise of every value, pascal.
    pub noise: f64,
    /// Step of the converter, pascal; 0 for a continuous sensor.
    pub step: f64,
    /// Fraction of all values that are stuck at zero or at saturation, 0 to 1.
    pub stuck: f64,
    /// Errors of other families than those that a recogniser assumes.
    pub unmatched: Unmatched,
}

/// Position and tilt of the letter in one press.
pub(super) struct Lie {
    /// Depth as a fraction of the planned one.
    pub(super) depth: f64,
    /// Relative change of depth along x, per metre.
    pub(super) slope_x: f64,
    /// Relative change of depth along y, per metre.
    pub(super) slope_y: f64,
}

impl RigNoise {
    /// An ideal rig and array.
    #[must_use]
    pub fn none() -> Self {
        Self {
            gain_spread: 0.0,
            drift: 0.0,
            depth_spread: 0.0,
            tilt: 0.0,
            placement: 0.0,
            placement_angle: 0.0,
            noise: 0.0,
            step: 0.0,
            stuck: 0.0,
            unmatched: Unmatched::none(),
        }
    }

    /// A rig and array like the dissertation's: the contact classifier is right 88 % of the time.
    #[must_use]
    pub fn physical() -> Self {
        Self {
            gain_spread: 0.20,
            drift: 0.05,
            depth_spread: 0.15,
            tilt: 0.02 / MM,
            placement: 0.4 * MM,
            placement_angle: 2.0 * DEG,
            noise: 0.7 * KPA,
            step: 0.54 * KPA,
            stuck: 0.0,
            unmatched: Unmatched::none(),
        }
    }

    /// A bad rig and array, for tests of robustness; nothing is tuned on it.
    #[must_use]
    pub fn harsh() -> Self {
        Self {
            gain_spread: 0.30,
            drift: 0.12,
            depth_spread: 0.30,
            tilt: 0.04 / MM,
            placement: 0.8 * MM,
            placement_angle: 4.0 * DEG,
            noise: 1.5 * KPA,
            step: 0.54 * KPA,
            stuck: 0.03,
            unmatched: Unmatched::none(),
        }
    }

    /// A rig and array whose errors are of other families and sizes than the planar method
    /// assumes; for reports, nothing is tuned to it.
    #[must_use]
    pub fn unmatched() -> Self {
        Self {
            gain_spread: 0.10,
            drift: 0.05,
            depth_spread: 0.25,
            tilt: 0.03 / MM,
            placement: 0.15 * MM,
            placement_angle: 0.5 * DEG,
            noise: 0.4 * KPA,
            step: 0.54 * KPA,
            stuck: 0.0,
            unmatched: Unmatched {
                wander: 1.0 * MM,
                wander_angle: 4.0 * DEG,
                slip_share: 0.1,
                slip: 2.0 * MM,
                slip_angle: 10.0 * DEG,
                bend: 0.25,
                crosstalk: 0.1,
            },
        }
    }

    /// Draws a taxel's gain.
    pub(super) fn gain(&self, stream: &mut Stream) -> f64 {
        about_one(self.gain_spread, stream)
    }

    /// The true position of the sensor for the commanded `at`.
    pub(super) fn placed(&self, at: PlanarPose, stream: &mut Stream) -> PlanarPose {
        let placed = PlanarPose {
            x: at.x + self.placement * stream.normal(),
            y: at.y + self.placement * stream.normal(),
            angle: at.angle + self.placement_angle * stream.normal(),
        };
        self.unmatched.slipped(placed, stream)
    }

    /// Draws the position and tilt of the letter in a press.
    pub(super) fn lie(&self, stream: &mut Stream) -> Lie {
        Lie {
            depth: (self.depth_spread * stream.normal()).exp(),
            slope_x: self.tilt * stream.normal(),
            slope_y: self.tilt * stream.normal(),
        }
    }

    /// The value that a taxel reports at a pressure, pascal.
    pub(super) fn measured(&self, pressure: f64, saturation: f64, stream: &mut Stream) -> f64 {
        let noisy = pressure * about_one(self.drift, stream) + self.noise * stream.normal();
        if self.stuck > 0.0 && stream.uniform(0.0, 1.0) < self.stuck {
            return if stream.uniform(0.0, 1.0) < 0.5 { 0.0 } else { saturation };
        }
        let clipped = noisy.clamp(0.0, saturation);
        if self.step > 0.0 {
            ((clipped / self.step).round() * self.step).min(saturation)
        } else {
            clipped
        }
    }
}

fn about_one(spread: f64, stream: &mut Stream) -> f64 {
    1.0 + spread * stream.normal().clamp(-DEVIATIONS_MAX, DEVIATIONS_MAX)
}

#[cfg(test)]
mod tests {
    use palpate_core::rng::Purpose;

    use super::*;

    #[test]
    fn values_are_clipped_quantised_and_some_stuck() {
        let mut stream = Stream::new(3, Purpose::RigNoise, 0);
        let stepped = RigNoise { step: 3.0 * KPA, ..RigNoise::none() };
        // Steps of 3 kPa: 8 kPa reads as 9, 40 as the saturation of 20.
        let mut read = |noise: &RigNoise, p: f64| noise.measured(p, 20.0 * KPA, &mut stream);
        assert!((read(&stepped, 8.0 * KPA) - 9.0 * KPA).abs() < 1e-9);
        assert!((read(&stepped, 40.0 * KPA) - 20.0 * KPA).abs() < 1e-9);
        assert!(read(&stepped, -1.0).abs() < 1e-9);
        let stuck = RigNoise { stuck: 0.25, ..RigNoise::none() };
        let values: Vec<f64> = (0..4000).map(|_| read(&stuck, 7.0 * KPA)).collect();
        let (low, high) = values.iter().fold((0, 0), |(low, high), value| {
            (low + usize::from(*value < 1.0), high + usize::from(*value > 19.0 * KPA))
        });
        // 500 of each are expected, with a deviation of 21; five of them.
        assert!((395..605).contains(&low) && (395..605).contains(&high), "{low}, {high}");
    }

    #[test]
    fn gains_have_their_spread_and_are_never_negative() {
        let mut stream = Stream::new(3, Purpose::RigGains, 0);
        let noise = RigNoise { gain_spread: 0.3, ..RigNoise::none() };
        let gains: Vec<f64> = (0..10_000).map(|_| noise.gain(&mut stream)).collect();
        let mean = gains.iter().sum::<f64>() / 1e4;
        let deviation = (gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / 1e4).sqrt();
        assert!((mean - 1.0).abs() < 0.015 && (deviation - 0.3).abs() < 0.02, "{deviation}");
        assert!(gains.iter().all(|gain| (0.25..=1.75).contains(gain)));
    }
}
