//! Responses of the covering to pressure on one cell: surface displacement, and stress on a taxel.
//!
//! Sources: Boussinesq's half-space with Love's closed form for a rectangle (1929); for a
//! bonded layer the plane-strain solution in wave numbers k, with ξ = k·h, κ = 3 − 4ν, a =
//! 2(1 − ν) and b = 1 − 2ν. Both are isotropic: functions of the horizontal distance. Lengths
//! in metres, stresses in pascal, compressive stress positive.

use std::f64::consts::PI;

use super::super::physics::{Base, CoveringConfig};

/// Points along each side of a cell, and of a taxel, over which a kernel is averaged.
const CELL_POINTS: usize = 3;
const TAXEL_POINTS: usize = 6;

/// Love's form: the displacement (m) of the surface per pascal on a square cell of side
/// `step`, at (`x`, `y`) metres from its centre, for a half-space of contact modulus 1 Pa.
///
/// Source: Johnson (1985), equation 3.25.
pub(super) fn love(step: f64, x: f64, y: f64) -> f64 {
    let half = 0.5 * step;
    // Each term belongs to one corner; at a corner on an axis the product vanishes with its
    // length.
    let term = |along: f64, across_high: f64, across_low: f64| {
        if along.abs() < 1e-12 * step {
            return 0.0;
        }
        let reach = |across: f64| across + across.hypot(along);
        along * (reach(across_high) / reach(across_low)).ln()
    };
    let sides = term(x + half, y + half, y - half) - term(x - half, y + half, y - half)
        + term(y + half, x + half, x - half)
        - term(y - half, x + half, x - half);
    sides / PI
}

/// The kernels of a covering.
pub(super) struct Kernel {
    base: Base,
    depth: f64,
    contact_modulus: f64,
    /// For a bonded layer, by distance: the difference of its displacement under a point load
    /// from a half-space's, in units of 1 / (π E* h), and the stress density at its base per
    /// newton, in units of 1 / h². Empty for a half-space.
    layer: Vec<(f64, f64)>,
    layer_step: f64,
}

impl Kernel {
    /// The kernels of `config` up to a distance of `reach` metres.
    pub(super) fn new(config: &CoveringConfig, reach: f64) -> Self {
        let depth = config.taxel_depth;
        let layer_step = depth / 24.0;
        let layer = match config.base {
            Base::Unbounded => Vec::new(),
            Base::Bonded => {
                let n = (reach / layer_step).ceil() as usize + 2;
                let transforms = Transforms::new(config.poisson_ratio, reach / depth);
                (0..n).map(|index| transforms.at(index as f64 * layer_step / depth)).collect()
            }
        };
        let contact_modulus = config.contact_modulus();
        Self { base: config.base, depth, contact_modulus, layer, layer_step }
    }

    /// The displacement (m) of the surface at (`x`, `y`) per pascal on a cell of side `step`.
    pub(super) fn give(&self, step: f64, x: f64, y: f64) -> f64 {
        let half_space = love(step, x, y);
        let difference = match self.base {
            Base::Unbounded => 0.0,
            Base::Bonded => {
                let mean =
                    mean_over_square(step, CELL_POINTS, |u, v| self.tabled((x + u).hypot(y + v)).0);
                mean * step * step / (PI * self.depth)
            }
        };
        (half_space + difference) / self.contact_modulus
    }

    /// The mean compressive stress (Pa) on a taxel of `width` per pascal on a cell of side
    /// `step` whose centre is (`x`, `y`) from the taxel's.
    pub(super) fn taxel_stress(&self, width: f64, step: f64, x: f64, y: f64) -> f64 {
        let density = mean_over_square(width, TAXEL_POINTS, |u, v| {
            mean_over_square(step, CELL_POINTS, |s, t| self.density((x + u + s).hypot(y + v + t)))
        });
        density * step * step
    }

    /// The stress (Pa) at the taxels' depth per newton on a point of the surface.
    fn density(&self, distance: f64) -> f64 {
        let unit = match self.base {
            // Boussinesq: 3 h³ / (2π R⁵).
            Base::Unbounded => 1.5 / PI * (1.0 + (distance / self.depth).powi(2)).powf(-2.5),
            Base::Bonded => self.tabled(distance).1,
        };
        unit / self.depth.powi(2)
    }

    fn tabled(&self, distance: f64) -> (f64, f64) {
        let place = (distance / self.layer_step).min(self.layer.len() as f64 - 1.001);
        let (low, share) = (place.floor() as usize, place.fract());
        let (from, to) = (self.layer[low], self.layer[low + 1]);
        (from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1))
    }
}

/// The mean of `value` over a square of `side` about the origin, sampled at n × n points.
fn mean_over_square(side: f64, n: usize, value: impl Fn(f64, f64) -> f64) -> f64 {
    let at = |index: usize| ((index as f64 + 0.5) / n as f64 - 0.5) * side;
    let sum: f64 = (0..n * n).map(|point| value(at(point % n), at(point / n))).sum();
    sum / (n * n) as f64
}

/// A bonded layer's two kernels in wave numbers, sampled for Hankel's transform.
struct Transforms {
    step: f64,
    /// Ratio of the compliance to the half-space's, less 1, and ratio of the stress at the
    /// base to that on top; with Simpson's weights.
    samples: Vec<(f64, f64)>,
}

impl Transforms {
    /// The transforms for distances of up to `reach` thicknesses.
    fn new(poisson_ratio: f64, reach: f64) -> Self {
        // Both have decayed to at most e⁻³⁰; ten points to the fastest wave.
        const WAVE_NUMBER_MAX: f64 = 34.0;
        let n = ((WAVE_NUMBER_MAX * reach.max(10.0) * 1.6) as usize).next_multiple_of(2);
        let step = WAVE_NUMBER_MAX / n as f64;
        let weight = |index: usize| match index {
            0 => 1.0 / 3.0,
            index if index == n => 1.0 / 3.0,
            index if index % 2 == 1 => 4.0 / 3.0,
            _ => 2.0 / 3.0,
        };
        let sample = |index: usize| {
            let (give, stress) = layer_factors(poisson_ratio, index as f64 * step);
            (weight(index) * step * (give - 1.0), weight(index) * step * stress)
        };
        Self { step, samples: (0..=n).map(sample).collect() }
    }

    /// ∫ (M − 1) J₀(ξρ) dξ and 1/(2π) ∫ T J₀(ξρ) ξ dξ at a distance of ρ thicknesses.
    fn at(&self, rho: f64) -> (f64, f64) {
        let (mut give, mut stress) = (0.0, 0.0);
        for (index, sample) in self.samples.iter().enumerate() {
            let wave_number = index as f64 * self.step;
            let bessel = libm::j0(wave_number * rho);
            give += sample.0 * bessel;
            stress += sample.1 * bessel * wave_number;
        }
        (give, stress / (2.0 * PI))
    }
}

/// A bonded layer at the wave number ξ: the ratio of its compliance to a half-space's, and of
/// the normal stress at its base to that on its top.
fn layer_factors(poisson_ratio: f64, xi: f64) -> (f64, f64) {
    let (a, b) = (2.0 * (1.0 - poisson_ratio), 1.0 - 2.0 * poisson_ratio);
    let kappa = 3.0 - 4.0 * poisson_ratio;
    let (sinh, cosh) = (xi.sinh(), xi.cosh());
    let denominator = (a * cosh).powi(2) - (b * sinh).powi(2) + xi * xi;
    let give = (kappa * sinh * cosh - xi) / denominator;
    let stress = a * (a * cosh + xi * sinh) / denominator;
    (give, stress)
}

#[cfg(test)]
mod tests {
    use palpate_core::sensor::SensorDescription;
    use palpate_core::units::MM;

    use super::*;

    #[test]
    fn loves_form_is_the_integral_of_point_loads() {
        // At the centre of a square of side s: 4 s ln(1 + √2) / π; far away s² / (π r).
        let center = 4.0 * (1.0 + 2f64.sqrt()).ln() / PI;
        assert!((love(1.0, 0.0, 0.0) - center).abs() < 1e-12);
        assert!((love(1.0, 30.0, 40.0) * PI * 50.0 - 1.0).abs() < 1e-4);
        for (x, y) in [(1.0, 0.0), (2.0, 1.0), (0.5, 0.5), (-1.0, 3.0)] {
            let naive = mean_over_square(1.0, 400, |u, v| 1.0 / (x + u).hypot(y + v)) / PI;
            assert!((love(1.0, x, y) / naive - 1.0).abs() < 3e-3, "at {x}, {y}");
        }
    }

    #[test]
    fn a_layer_is_a_half_space_to_short_waves_a_spring_to_long() {
        for nu in [0.0, 0.3, 0.45] {
            let (give, stress) = layer_factors(nu, 12.0);
            assert!((give - 1.0).abs() < 1e-6 && stress < 1e-3);
            // The displacement is h (1 + ν)(1 − 2ν) / ((1 − ν) E), in units of 2 (1 − ν²) h /
            // (E ξ).
            let (give, stress) = layer_factors(nu, 1e-3);
            let uniaxial = (1.0 + nu) * (1.0 - 2.0 * nu) / (1.0 - nu);
            assert!((give * 2.0 * (1.0 - nu * nu) / 1e-3 / uniaxial - 1.0).abs() < 1e-4);
            assert!((stress - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn the_stress_below_carries_the_whole_load() {
        let sensor = SensorDescription::digitacts_6x6();
        for config in [CoveringConfig::half_space(&sensor), CoveringConfig::bonded_layer(&sensor)] {
            let kernel = Kernel::new(&config, 80.0 * MM);
            // A cell's pressure summed over taxels without gaps, 1 mm wide, to ±40 mm: all of
            // it but the part 1 − (1 − (1 + 16²)^(−3/2)) of the half-space beyond.
            let sum: f64 = (0..81 * 81)
                .map(|at| {
                    let along = |index: usize| (index as f64 - 40.0) * MM;
                    kernel.taxel_stress(1.0 * MM, 1.0 * MM, along(at % 81), along(at / 81))
                })
                .sum();
            assert!((sum - 1.0).abs() < 2e-3, "{:?}: {sum}", config.base);
        }
    }

    #[test]
    fn a_layer_hardly_moves_far_from_its_load() {
        let sensor = SensorDescription::digitacts_6x6();
        let kernel = Kernel::new(&CoveringConfig::bonded_layer(&sensor), 40.0 * MM);
        let near = kernel.give(1.0 * MM, 0.0, 0.0);
        for distance in [12.0, 20.0, 30.0] {
            let far = kernel.give(1.0 * MM, distance * MM, 0.0);
            assert!(far.abs() < 1e-3 * near, "{distance} mm: {far} of {near}");
        }
    }
}
