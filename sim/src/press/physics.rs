//! Physics of the covering: the point spread, or an elastic body.
//!
//! [`Physics::PointSpread`] is section 2.5.1's image processing; all training uses it.
//! [`Physics::ElasticCovering`] solves the contact with an elastic body and shares only the
//! object's heights with it: recognition that works with it does not depend on our model of
//! blur. It is used for tests only and is never fitted to the point spread.

use std::f64::consts::PI;

use palpate_core::sensor::SensorDescription;
use palpate_core::units::{KPA, MM};

use crate::elastic::POISSON_RATIO;
use crate::noise::Electronics;

/// Conversion of a press into loads on the taxels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Physics {
    /// Depths, blurred by the point spread and put through the force curve (section 2.5.1).
    #[default]
    PointSpread,
    /// A rigid object in frictionless contact with a linear elastic covering, without
    /// adhesion or penetration; the contact area is part of the solution.
    ElasticCovering(CoveringConfig),
}

/// Support of the covering.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Base {
    /// None: an elastic half-space with the taxels buried in it.
    Unbounded,
    /// The rigid sensor, to which the covering is bonded.
    Bonded,
}

/// The elastic covering and the electronics under it, with numbers of their own instead of
/// those of the sensor's description.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoveringConfig {
    /// Support of the covering.
    pub base: Base,
    /// Depth of the taxels under the surface, metres; the thickness of a bonded covering.
    pub taxel_depth: f64,
    /// Young's modulus, pascal.
    pub young_modulus: f64,
    /// Poisson's ratio, 0 to below 0.5.
    pub poisson_ratio: f64,
    /// Relative standard deviation of the taxels' gains about 1.
    pub gain_spread: f64,
    /// Seed of the gains; equal seeds are the same sensor.
    pub gain_seed: u64,
    /// Standard deviation of a reading's additive noise, pascal.
    pub noise: f64,
    /// Step of the analogue-to-digital converter, pascal; 0 for a continuous sensor.
    pub quantisation: f64,
    /// The contact is solved when the remaining gaps are below this fraction of the deepest
    /// penetration, as a root mean square over the cells that could touch.
    pub tolerance: f64,
}

/// Noise and converter differ from the presets' on purpose: those have 0.1 kPa and 8 bits.
const NOISE: f64 = 0.15 * KPA;
const CONVERTER_STEPS: f64 = 200.0;

impl CoveringConfig {
    /// An elastic half-space with the sensor's taxels as deep as the covering is thick.
    ///
    /// A half-space has no thickness, so no uniform press gives its modulus. It is chosen
    /// such that a ball of 10 mm (the curvature of a handle), pressed to half of the
    /// thickness, peaks at half of the sensing range: p₀ = 2 E*/π · √(d/R). For the DigiTacts
    /// sensors E* is 44 kPa, a soft foam.
    #[must_use]
    pub fn half_space(sensor: &SensorDescription) -> Self {
        let parameters = sensor.parameters();
        let (radius, depth) = (10.0 * MM, 0.5 * parameters.covering_thickness);
        let peak = 0.5 * parameters.saturation;
        let contact_modulus = peak * PI / (2.0 * (depth / radius).sqrt());
        let young_modulus = contact_modulus * (1.0 - POISSON_RATIO.powi(2));
        Self { base: Base::Unbounded, ..Self::of(sensor, young_modulus) }
    }

    /// A layer on the rigid sensor that reads the sensing range under a uniform press to its
    /// full thickness, as the presets' force curves do: (1 − ν) E / ((1 + ν)(1 − 2ν)) is the
    /// saturation. Its response to any other press follows from elasticity.
    #[must_use]
    pub fn bonded_layer(sensor: &SensorDescription) -> Self {
        let nu = POISSON_RATIO;
        let uniaxial_modulus = sensor.parameters().saturation;
        let young_modulus = uniaxial_modulus * (1.0 + nu) * (1.0 - 2.0 * nu) / (1.0 - nu);
        Self { base: Base::Bonded, ..Self::of(sensor, young_modulus) }
    }

    fn of(sensor: &SensorDescription, young_modulus: f64) -> Self {
        let parameters = sensor.parameters();
        Self {
            base: Base::Bonded,
            taxel_depth: parameters.covering_thickness,
            young_modulus,
            poisson_ratio: POISSON_RATIO,
            gain_spread: 0.1,
            gain_seed: 1,
            noise: NOISE,
            quantisation: parameters.saturation / CONVERTER_STEPS,
            tolerance: 1e-3,
        }
    }

    /// E / (1 − ν²), the contact modulus against a rigid body, pascal.
    #[must_use]
    pub fn contact_modulus(&self) -> f64 {
        self.young_modulus / (1.0 - self.poisson_ratio.powi(2))
    }

    /// The electronics; the sensing range is that of the description.
    pub(crate) fn electronics(&self, sensor: &SensorDescription) -> Electronics {
        let saturation = sensor.parameters().saturation;
        Electronics { noise: self.noise, saturation, quantisation: self.quantisation }
    }
}
