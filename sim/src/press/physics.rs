//! What happens in the covering when something is pressed into it: the physics of a press.
//!
//! [`Physics::PointSpread`] is section 2.5.1's image processing, with which everything is
//! trained. [`Physics::ElasticCovering`] solves the contact with an elastic body and shares
//! nothing with it but the object's heights: what recognises there too has not merely learnt
//! our own blur. Used to test; never fitted to the other.

use std::f64::consts::PI;

use palpate_core::sensor::SensorDescription;
use palpate_core::units::{KPA, MM};

use crate::elastic::POISSON_RATIO;
use crate::noise::Electronics;

/// How a press becomes what the taxels feel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Physics {
    /// Depths, blurred by the point spread and put through the force curve (section 2.5.1).
    #[default]
    PointSpread,
    /// A rigid object in frictionless contact with a linear elastic covering: it neither pulls
    /// nor is penetrated, and where it touches is part of the answer.
    ElasticCovering(CoveringConfig),
}

/// What is under the covering's surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Base {
    /// More of the same, without end: an elastic half-space, the taxels buried in it.
    Unbounded,
    /// The rigid sensor, to which the covering is bonded.
    Bonded,
}

/// The elastic covering and the electronics under it: a sensor's own numbers, not those of
/// its description.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoveringConfig {
    /// What is under the covering's surface.
    pub base: Base,
    /// How deep the taxels are under the surface, metres; of a bonded covering its thickness.
    pub taxel_depth: f64,
    /// Young's modulus, pascal.
    pub young_modulus: f64,
    /// Poisson's ratio, 0 to below 0.5.
    pub poisson_ratio: f64,
    /// Relative standard deviation of the taxels' gains about 1.
    pub gain_spread: f64,
    /// The gains are those of this sensor; equal seeds are the same sensor.
    pub gain_seed: u64,
    /// Standard deviation of a reading's additive noise, pascal.
    pub noise: f64,
    /// Step of the analogue-to-digital converter, pascal; 0 is a continuous sensor.
    pub quantisation: f64,
    /// The contact is solved when the gaps left are below this part of the deepest
    /// penetration, as a root mean square over the cells that could touch.
    pub tolerance: f64,
}

/// Noise and converter of another make than the presets': 0.1 kPa and 8 bits of 20 kPa.
const NOISE: f64 = 0.15 * KPA;
const CONVERTER_STEPS: f64 = 200.0;

impl CoveringConfig {
    /// An elastic half-space with the sensor's taxels as deep as the covering is thick.
    ///
    /// A half-space is a body without a thickness, so no even press gives its modulus. A ball
    /// of 10 mm, of the curvature of a handle, pressed to half of the thickness, shall have
    /// half of the sensing range as its peak: p₀ = 2 E*/π · √(d/R). For the DigiTacts sensors
    /// E* is 44 kPa, a soft foam.
    #[must_use]
    pub fn half_space(sensor: &SensorDescription) -> Self {
        let parameters = sensor.parameters();
        let (radius, depth) = (10.0 * MM, 0.5 * parameters.covering_thickness);
        let peak = 0.5 * parameters.saturation;
        let contact_modulus = peak * PI / (2.0 * (depth / radius).sqrt());
        let young_modulus = contact_modulus * (1.0 - POISSON_RATIO.powi(2));
        Self { base: Base::Unbounded, ..Self::of(sensor, young_modulus) }
    }

    /// A layer on the rigid sensor that answers an even press to its full thickness with the
    /// sensing range, as the presets' force curves do: (1 − ν) E / ((1 + ν)(1 − 2ν)) is the
    /// saturation. How it answers anything that is not even follows from elasticity.
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

    /// E / (1 − ν²), the modulus that the contact of a rigid body feels, pascal.
    #[must_use]
    pub fn contact_modulus(&self) -> f64 {
        self.young_modulus / (1.0 - self.poisson_ratio.powi(2))
    }

    /// What turns the pressures on the taxels into what is reported; the range is that of the
    /// description.
    pub(crate) fn electronics(&self, sensor: &SensorDescription) -> Electronics {
        let saturation = sensor.parameters().saturation;
        Electronics { noise: self.noise, saturation, quantisation: self.quantisation }
    }
}
