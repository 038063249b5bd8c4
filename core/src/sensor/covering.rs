//! Choice of a covering: the spatial acuity of a sensor under a point spread.
//!
//! Source: section 2.4, equations 2.6–2.8 with the corrections in `docs/equations.md`. One
//! dimension, lengths in element widths: five elements from −2 to 3, the stimulated one from
//! 0 to 1; impulses of unit integral, responses rounded to multiples of the force resolution.

use libm::erf;

use super::point_spread::{SPREAD_OFFSET, SPREAD_SLOPE};

/// The spread (element widths) at which frequencies above the Nyquist rate of half a cycle an
/// element are three deviations out: 3 / (2πσ) = 1/2, σ = 3/π (equation 2.8).
pub const ALIASING_SPREAD: f64 = 3.0 / std::f64::consts::PI;

const N_ELEMENTS: usize = 5;
/// Step of positions and distances, element widths.
const STEP: f64 = 0.02;
/// Number of positions from one edge of the element to the other.
const N_PLACES: usize = 51;
/// Centres of two points: offsets from the edge in steps of 0.1.
const N_CENTERS: usize = 10;
/// Largest distance of two points, in steps: 10 element widths, when both are beyond the five
/// elements.
const N_DISTANCES: usize = 500;

type Response = [f64; N_ELEMENTS];

/// Values spaced evenly in their logarithm, both ends included.
#[must_use]
pub fn log_spaced(low: f64, high: f64, n: usize) -> Vec<f64> {
    let step = (high / low).powf(1.0 / (n.max(2) - 1) as f64);
    (0..n).map(|index| low * step.powi(index as i32)).collect()
}

/// The force resolutions of figure 2.6: 25 from 0.001 to 0.5 of the impulse.
#[must_use]
pub fn force_resolutions() -> Vec<f64> {
    log_spaced(1e-3, 0.5, 25)
}

/// The spreads of figure 2.6: 25 from 0.05 to 5 element widths.
#[must_use]
pub fn spreads() -> Vec<f64> {
    log_spaced(0.05, 5.0, 25)
}

/// Acuity under one point spread.
#[derive(Clone, Debug, PartialEq)]
pub struct Acuity {
    places: Vec<Response>,
    /// For each centre, the response to two coincident points and to two points at each distance.
    pairs: Vec<Vec<Response>>,
}

impl Acuity {
    /// The responses under a spread of `sigma` element widths, which must be above 0.
    #[must_use]
    pub fn of_spread(sigma: f64) -> Self {
        let places = (0..N_PLACES).map(|place| response(place as f64 * STEP, sigma)).collect();
        let pairs = (0..N_CENTERS).map(|center| {
            let center = center as f64 * 0.1;
            let pair = |steps: usize| {
                let half = 0.5 * steps as f64 * STEP;
                let (left, right) =
                    (response(center - half, sigma), response(center + half, sigma));
                std::array::from_fn(|element| left[element] + right[element])
            };
            (0..=N_DISTANCES).map(pair).collect()
        });
        Self { places, pairs: pairs.collect() }
    }

    /// The number of distinct images of a point that moves over one element, at a force
    /// resolution as a fraction of the impulse (section 2.4.1.1): 1 to 51.
    #[must_use]
    pub fn representations(&self, force_resolution: f64) -> usize {
        let mut images: Vec<[i64; N_ELEMENTS]> =
            self.places.iter().map(|place| rounded(place, force_resolution)).collect();
        images.sort_unstable();
        images.dedup();
        images.len()
    }

    /// The mean distance (element widths) from which two points are distinguished from one of
    /// twice the force (section 2.4.1.2); `None` when they are not at some centre, at any
    /// distance.
    #[must_use]
    pub fn two_point_distance(&self, force_resolution: f64) -> Option<f64> {
        let mut sum = 0.0;
        for pairs in &self.pairs {
            let one = rounded(&pairs[0], force_resolution);
            let differs = |pair: &Response| rounded(pair, force_resolution) != one;
            sum += pairs.iter().position(differs)? as f64 * STEP;
        }
        Some(sum / N_CENTERS as f64)
    }
}

/// The index of the thinnest covering that does not alias, by spreads in element widths.
#[must_use]
pub fn recommended(spreads: &[f64]) -> Option<usize> {
    let avoids = |index: &usize| spreads[*index] >= ALIASING_SPREAD;
    (0..spreads.len()).filter(avoids).min_by(|a, b| spreads[*a].total_cmp(&spreads[*b]))
}

/// The thickness of the covering with a given spread, both in element widths (equation 2.5
/// inverted); `None` for a spread below that of no covering.
#[must_use]
pub fn thickness_of_spread(sigma: f64) -> Option<f64> {
    let thickness = (sigma - SPREAD_OFFSET) / SPREAD_SLOPE;
    (thickness >= 0.0).then_some(thickness)
}

/// Equation 2.6: the Gaussian around `at`, integrated over each element.
fn response(at: f64, sigma: f64) -> Response {
    let below = |x: f64| 0.5 * (1.0 + erf((x - at) / (sigma * std::f64::consts::SQRT_2)));
    std::array::from_fn(|element| {
        let edge = element as f64 - 2.0;
        below(edge + 1.0) - below(edge)
    })
}

/// Equation 2.7, in multiples of the force resolution.
fn rounded(response: &Response, force_resolution: f64) -> [i64; N_ELEMENTS] {
    response.map(|force| (force / force_resolution + 0.5).floor() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_impulse_excites_only_the_element_it_falls_on() {
        // σ → 0: on either edge half goes to the neighbour, elsewhere all to the element, so
        // there are three images.
        let acuity = Acuity::of_spread(1e-6);
        assert_eq!(acuity.representations(0.1), 3);
        // Two points around 0.1 inside an edge differ from one when the first is on the edge,
        // 0.2 apart; around 0.5 at 1.0. Around the edge itself each side keeps one of them
        // until they reach the next edges, 2.0 apart.
        let expected = (2.0 + 2.0 * (0.2 + 0.4 + 0.6 + 0.8) + 1.0) / 10.0;
        let found = acuity.two_point_distance(0.1).unwrap();
        assert!((found - expected).abs() < 0.021, "{found} for {expected}");
    }

    #[test]
    fn a_uniform_response_has_no_acuity() {
        // σ = 50: every element has about 0.008 of the impulse, below half of f = 0.1.
        let acuity = Acuity::of_spread(50.0);
        assert_eq!(acuity.representations(0.1), 1);
        assert_eq!(acuity.two_point_distance(0.1), None);
    }

    #[test]
    fn coarse_representations_match_hand_counted_ones() {
        // f = 0.5, σ = 0.3: an element shows 1 above 0.25, 2 above 0.75. The stimulated one
        // has Φ((1−μ)/σ) − Φ(−μ/σ): at μ = 0 0.4996, above 0.75 from Φ(μ/0.3) = 0.75
        // (μ = 0.2024) to 0.7976; the neighbour has Φ(−μ/σ), above 0.25 until the same μ. So
        // three images: (1, 1, 0), (0, 2, 0), (0, 1, 1).
        assert_eq!(Acuity::of_spread(0.3).representations(0.5), 3);
    }

    #[test]
    fn the_coarse_optimum_agrees_with_the_dissertation() {
        // docs/equations.md: near σ ≈ 0.27–0.37 at coarse f; saturated at 51 where f is fine.
        let acuities: Vec<(f64, Acuity)> =
            spreads().into_iter().map(|sigma| (sigma, Acuity::of_spread(sigma))).collect();
        let best = |f: f64| {
            let counts = acuities.iter().map(|(sigma, acuity)| (*sigma, acuity.representations(f)));
            counts.max_by_key(|(_, count)| *count).unwrap()
        };
        let (sigma, count) = best(0.1);
        assert!((0.2..0.5).contains(&sigma) && count < 51, "σ {sigma}: {count}");
        assert_eq!(best(1e-3).1, 51);
    }

    #[test]
    fn the_aliasing_bound_gives_a_thickness() {
        assert!((ALIASING_SPREAD - 0.955).abs() < 1e-3);
        assert_eq!(thickness_of_spread(ALIASING_SPREAD), None, "below what polyurethane gives");
        // 0.04 inch is 0.508 element widths: σ = 1.11 + 0.497 · 0.508 = 1.3625.
        assert!((thickness_of_spread(1.362476).unwrap() - 0.508).abs() < 1e-6);
        assert_eq!(recommended(&[2.4, 0.5, 1.36, 1.7]), Some(2));
        assert_eq!(recommended(&[0.3, 0.5]), None);
    }

    #[test]
    fn the_grids_are_those_of_figure_2_6() {
        let f = force_resolutions();
        assert_eq!(f.len(), 25);
        assert!((f[0] - 1e-3).abs() < 1e-12 && (f[24] - 0.5).abs() < 1e-12);
        assert!((f[12] - (1e-3f64 * 0.5).sqrt()).abs() < 1e-12, "geometric mean in the middle");
    }
}
