//! Pose prior and search options of a geometric belief.

use std::f64::consts::PI;

use glam::DVec3;

use super::GeometricError;
use super::planar::check_tilt;
use crate::filter::particle::ParticleOptions;
use crate::mosaic::press_fit::PressPrior;
use palpate_core::pose::Pose;
use palpate_core::units::{DEG, MM};

/// Prior of the object's pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PosePrior {
    /// Planar: x, y and θ in a stated plane.
    Planar {
        /// The plane; its z points out of the object's face towards the sensor.
        session_from_plane: Pose,
        /// Centre of the object's positions in the plane, metres.
        center: [f64; 2],
        /// Largest distance from the centre along x and along y, metres.
        half_extent: f64,
        /// Centre of its angles, rad.
        angle: f64,
        /// Largest rotation from it, rad; π permits any angle.
        half_angle: f64,
    },
    /// Solid: six dimensions about a nominal pose.
    Bounded {
        /// The nominal pose.
        session_from_object: Pose,
        /// Largest distance from it along the session's axes, metres.
        half_extent: DVec3,
        /// Largest rotation from it about each of the session's axes, rad.
        half_angle: f64,
    },
}

impl PosePrior {
    /// Whether a belief with this prior accepts a press at `session_from_sensor`.
    ///
    /// # Errors
    /// [`GeometricError::Tilt`] when a press on a plane is tilted by more than 30 degrees.
    pub fn check_press(&self, session_from_sensor: &Pose) -> Result<(), GeometricError> {
        match self {
            Self::Planar { session_from_plane, .. } => {
                check_tilt(&(session_from_plane.inverse() * *session_from_sensor))
            }
            Self::Bounded { .. } => Ok(()),
        }
    }
}

/// Representation of the belief.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GeometricFilter {
    /// The adaptive histogram, with force if there are mosaics.
    Adaptive(AdaptiveOptions),
    /// The filters of chapter 3, over maps of contact.
    Printed(PrintedFilter),
}

/// A filter of chapter 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PrintedFilter {
    /// The histogram filter, in the plane alone.
    Histogram {
        /// Number of bins of an object along x, y and the full turn (Table 3.1).
        n: [usize; 3],
    },
    /// The particle filter.
    Particles(ParticleOptions),
}

/// Parameters of the adaptive histogram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveOptions {
    /// Maximum width of the first bins of planar poses along x and y, metres.
    pub first_width: f64,
    /// Maximum width of the first bins along θ, rad.
    pub first_angle: f64,
    /// Width at which bins are no longer split, metres.
    pub smallest: f64,
    /// Distance behind the best at which bins sleep, nats.
    pub keep: f64,
    /// Distance behind the best at which bins are not split, nats.
    pub split: f64,
    /// Largest penalty of one reading for a pose, nats.
    pub floor: f64,
    /// Bins per object that are evaluated in full after a screening; proportionally more when
    /// the box of poses holds more first bins than a box of ±10 mm.
    pub screened: usize,
    /// Exponent of the screening for the others, 0 to 1.
    pub screen_temper: f64,
    /// Evaluations per reading and object that splitting may cost.
    pub evaluations: usize,
    /// Exponent of the likelihood, for correlations beyond the press's own nuisance parameters.
    pub temper: f64,
    /// Prior of the deviations of a single press.
    pub press: PressPrior,
}

/// Number of first bins of a box of ±10 mm and the full turn, approximately.
const SCREENED_OF: usize = 700;

/// Maximum number of first bins along an axis; wider boxes are refused. Chosen: ±170 mm, far
/// beyond any measured planar session, at 8 MB an object.
const FIRST_MAX: f64 = 100.0;

impl AdaptiveOptions {
    /// Number of first bins of a box of poses along x, y and θ; `half` are its half widths
    /// (m, m, rad).
    #[must_use]
    pub fn first_bins(&self, half: [f64; 3]) -> [usize; 3] {
        let widths = [self.first_width, self.first_width, self.first_angle];
        std::array::from_fn(|axis| {
            // A rounding error must not add a bin.
            let n = (2.0 * half[axis] / widths[axis] - 1e-6).ceil();
            n.clamp(1.0, FIRST_MAX) as usize
        })
    }

    /// Refuses a box that the first bins cannot cover at their width.
    pub(super) fn check_resolved(&self, half_extent: f64) -> Result<(), GeometricError> {
        let high = 0.5 * FIRST_MAX * self.first_width;
        within("half_extent", half_extent, 0.1 * MM, high)
    }

    /// Number of bins of an object that are evaluated in full when it has `first` first bins.
    pub(super) fn screened(&self, first: usize) -> usize {
        self.screened * first.div_ceil(SCREENED_OF).max(1)
    }
}

impl Default for AdaptiveOptions {
    fn default() -> Self {
        Self {
            first_width: 3.4 * MM,
            first_angle: 20.0 * DEG,
            smallest: 1.6 * MM,
            keep: 30.0,
            split: 12.0,
            floor: 12.0,
            screened: 45,
            screen_temper: 0.3,
            evaluations: 35,
            temper: 0.7,
            press: PressPrior::default(),
        }
    }
}

/// Options of a geometric belief.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeometricOptions {
    /// Prior of the object's pose.
    pub pose: PosePrior,
    /// Representation of the belief.
    pub filter: GeometricFilter,
    /// Seed of filters that draw.
    pub seed: u64,
}

impl GeometricOptions {
    /// Checks every number.
    ///
    /// # Errors
    /// [`GeometricError::Range`] names the first field that is out of range.
    pub(super) fn check(&self) -> Result<(), GeometricError> {
        match &self.pose {
            PosePrior::Planar { center, half_extent, angle, half_angle, .. } => {
                within("center x", center[0], -1e3, 1e3)?;
                within("center y", center[1], -1e3, 1e3)?;
                within("half_extent", *half_extent, 0.1 * MM, 1.0)?;
                within("angle", *angle, -4.0 * PI, 4.0 * PI)?;
                within("half_angle", *half_angle, 1e-3, PI)?;
            }
            PosePrior::Bounded { half_extent, half_angle, .. } => {
                for (field, value) in ["half_extent x", "half_extent y", "half_extent z"]
                    .into_iter()
                    .zip(half_extent.to_array())
                {
                    within(field, value, 0.1 * MM, 1.0)?;
                }
                within("half_angle", *half_angle, 1e-3, PI)?;
            }
        }
        let filter = match &self.filter {
            GeometricFilter::Adaptive(filter) => filter,
            GeometricFilter::Printed(PrintedFilter::Histogram { n }) => {
                for (field, n) in ["bins x", "bins y", "bins angle"].into_iter().zip(*n) {
                    within(field, n as f64, 1.0, 200.0)?;
                }
                return Ok(());
            }
            GeometricFilter::Printed(PrintedFilter::Particles(options)) => {
                return within("particles", options.n as f64, 1.0, 1e7);
            }
        };
        within("first_width", filter.first_width, 0.1 * MM, 1.0)?;
        within("first_angle", filter.first_angle, 1.0 * DEG, PI)?;
        within("smallest", filter.smallest, 0.01 * MM, 100.0 * MM)?;
        within("keep", filter.keep, 1.0, 1e4)?;
        within("split", filter.split, 0.0, 1e4)?;
        within("floor", filter.floor, 1.0, 1e4)?;
        within("screened", filter.screened as f64, 1.0, 1e6)?;
        within("screen_temper", filter.screen_temper, 0.0, 1.0)?;
        within("evaluations", filter.evaluations as f64, 0.0, 1e6)?;
        within("temper", filter.temper, 0.01, 1.0)?;
        within("press.amplitude", filter.press.amplitude, 1e-4, 10.0)?;
        within("press.tilt", filter.press.tilt, 1e-4, 1e4)?;
        within("press.shift", filter.press.shift, 1e-6, 0.1)?;
        within("press.turn", filter.press.turn, 1e-4, 1.0)
    }
}

fn within(field: &'static str, found: f64, low: f64, high: f64) -> Result<(), GeometricError> {
    if found.is_finite() && (low..=high).contains(&found) {
        Ok(())
    } else {
        Err(GeometricError::Range { field, found, low, high })
    }
}
