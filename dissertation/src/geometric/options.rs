//! What a geometric belief assumes about the pose, and how it looks for it.

use std::f64::consts::PI;

use glam::DVec3;

use super::GeometricError;
use super::planar::check_tilt;
use crate::filter::particle::ParticleOptions;
use crate::mosaic::press_fit::PressPrior;
use palpate_core::pose::Pose;
use palpate_core::units::{DEG, MM};

/// Where the object may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PosePrior {
    /// Planar: x, y and θ in a stated plane.
    Planar {
        /// The plane; its z points out of the object's face towards the sensor.
        session_from_plane: Pose,
        /// The middle of the object's places in the plane, metres.
        center: [f64; 2],
        /// How far the object may be from there along x and along y, metres.
        half_extent: f64,
        /// The middle of its angles, rad.
        angle: f64,
        /// How far it may be turned from there, rad; π is any angle.
        half_angle: f64,
    },
    /// Solid: six dimensions about a nominal pose.
    Bounded {
        /// The nominal pose.
        session_from_object: Pose,
        /// How far the object may be from there along the session's axes, metres.
        half_extent: DVec3,
        /// How far it may be turned from there about each of the session's axes, rad.
        half_angle: f64,
    },
}

impl PosePrior {
    /// Whether a belief with this prior can take a press at `session_from_sensor`.
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

/// How the belief is carried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GeometricFilter {
    /// The adaptive histogram, with force where there are mosaics.
    Adaptive(AdaptiveOptions),
    /// The filters of chapter 3, over maps of contact.
    Printed(PrintedFilter),
}

/// A filter of chapter 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PrintedFilter {
    /// The histogram filter, in the plane alone.
    Histogram {
        /// Bins of an object along x, y and the full turn (Table 3.1).
        n: [usize; 3],
    },
    /// The particle filter.
    Particles(ParticleOptions),
}

/// The work of the adaptive histogram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveOptions {
    /// The first bins of planar poses are at most this wide along x and y, metres.
    pub first_width: f64,
    /// And along θ, rad.
    pub first_angle: f64,
    /// Bins are split until they are no wider than this, metres.
    pub smallest: f64,
    /// Bins this far behind the best sleep, nats.
    pub keep: f64,
    /// Bins this far behind the best are not split, nats.
    pub split: f64,
    /// No reading counts more than this against a pose, nats.
    pub floor: f64,
    /// Bins that are evaluated in full after a screening, for every object; more, in
    /// proportion, when the box of poses holds more first bins than a box of ±10 mm does.
    pub screened: usize,
    /// The exponent of the screening for the others, 0 to 1.
    pub screen_temper: f64,
    /// Evaluations a reading that splitting may cost, for every object.
    pub evaluations: usize,
    /// The exponent of the likelihood: what is correlated beyond the press's own unknowns.
    pub temper: f64,
    /// How far single presses stray from what is stated about them.
    pub press: PressPrior,
}

/// About the first bins of a box of ±10 mm and the full turn.
const SCREENED_OF: usize = 700;

/// No axis is divided into more first bins than this: wider boxes are refused. Chosen: ±170 mm,
/// far beyond what a planar session has ever been measured on, at 8 MB an object.
const FIRST_MAX: f64 = 100.0;

impl AdaptiveOptions {
    /// How many first bins a box of poses has along x, y and θ: `half` are its half widths
    /// (m, m, rad).
    #[must_use]
    pub fn first_bins(&self, half: [f64; 3]) -> [usize; 3] {
        let widths = [self.first_width, self.first_width, self.first_angle];
        std::array::from_fn(|axis| {
            // A hair's breadth more must not add a bin.
            let n = (2.0 * half[axis] / widths[axis] - 1e-6).ceil();
            n.clamp(1.0, FIRST_MAX) as usize
        })
    }

    /// Refuses a box that the first bins cannot cover at their width.
    pub(super) fn check_resolved(&self, half_extent: f64) -> Result<(), GeometricError> {
        let high = 0.5 * FIRST_MAX * self.first_width;
        within("half_extent", half_extent, 0.1 * MM, high)
    }

    /// How many bins of an object are evaluated in full when it has `first` first bins.
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

/// What a belief assumes and how it works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeometricOptions {
    /// Where the object may be.
    pub pose: PosePrior,
    /// How the belief is carried.
    pub filter: GeometricFilter,
    /// The seed of filters that draw.
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
