//! Contact of a rigid body with an elastic surface: pressures by conjugate gradients.
//!
//! Source: Polonsky and Keer (1999), with the approach given instead of the force. The
//! solution has pressures p ≥ 0 with gaps u − d ≥ 0 and p·(u − d) = 0, where u = K p is the
//! displacement of the surface and d the depth of the body below the undisturbed one: the
//! minimum of ½ pᵀKp − dᵀp over p ≥ 0. Since u ≥ 0, only cells with d > 0 can touch.

use super::convolution::{Convolution, Workspace};

/// Iteration limit; touches of ten objects took at most 22 steps at a tolerance of 1e-3.
const ITERATIONS_MAX: usize = 400;

/// The pressures (Pa) under a body `penetrations` (m) below the undisturbed surface, both
/// row-major; `compliance` gives metres per pascal.
///
/// Solved when the root mean square gap of touching cells, and overlap of the others, is
/// below `tolerance` times the deepest penetration.
pub(super) fn pressures(
    compliance: &Convolution,
    penetrations: &[f64],
    tolerance: f64,
) -> Vec<f64> {
    let candidates: Vec<usize> =
        (0..penetrations.len()).filter(|cell| penetrations[*cell] > 0.0).collect();
    let mut contact = Contact::new(compliance, penetrations, &candidates);
    let deepest = penetrations.iter().copied().fold(0.0, f64::max);
    if candidates.is_empty() || !contact.begin() {
        return contact.pressures;
    }
    for _ in 0..ITERATIONS_MAX {
        if contact.residual() <= tolerance * deepest {
            break;
        }
        contact.step();
    }
    contact.pressures
}

/// The state of the iteration; arrays are over the grid and zero outside of `candidates`.
struct Contact<'a> {
    compliance: &'a Convolution,
    penetrations: &'a [f64],
    candidates: &'a [usize],
    workspace: Workspace,
    pressures: Vec<f64>,
    /// K p − d on candidates.
    gaps: Vec<f64>,
    direction: Vec<f64>,
    /// K applied to the direction, or to the pressures while the gaps are computed.
    response: Vec<f64>,
    /// Sum of squared gaps of the last step; 0 restarts the iteration.
    gap_squares: f64,
}

impl<'a> Contact<'a> {
    fn new(compliance: &'a Convolution, penetrations: &'a [f64], candidates: &'a [usize]) -> Self {
        let zeros = || vec![0.0; compliance.rows() * compliance.cols()];
        Self {
            compliance,
            penetrations,
            candidates,
            workspace: compliance.workspace(),
            pressures: zeros(),
            gaps: zeros(),
            direction: zeros(),
            response: zeros(),
            gap_squares: 0.0,
        }
    }

    /// Starts with pressures proportional to the penetrations, optimally scaled; false when
    /// no displacement results.
    fn begin(&mut self) -> bool {
        for &cell in self.candidates {
            self.pressures[cell] = self.penetrations[cell];
        }
        self.compliance.apply(&self.pressures, &mut self.response, &mut self.workspace);
        let (mut work, mut energy) = (0.0, 0.0);
        for &cell in self.candidates {
            work += self.pressures[cell] * self.penetrations[cell];
            energy += self.pressures[cell] * self.response[cell];
        }
        if energy <= 0.0 {
            self.pressures.fill(0.0);
            return false;
        }
        let scale = work / energy;
        for &cell in self.candidates {
            self.pressures[cell] *= scale;
            self.gaps[cell] = scale * self.response[cell] - self.penetrations[cell];
        }
        true
    }

    /// Root mean square error of the solution, metres.
    fn residual(&self) -> f64 {
        let fault = |cell: usize| {
            if self.pressures[cell] > 0.0 { self.gaps[cell] } else { self.gaps[cell].min(0.0) }
        };
        let squares: f64 = self.candidates.iter().map(|cell| fault(*cell).powi(2)).sum();
        (squares / self.candidates.len() as f64).sqrt()
    }

    /// One step along a direction conjugate to the last, unless cells joined the contact.
    fn step(&mut self) {
        let touching = |pressures: &[f64], cell: usize| pressures[cell] > 0.0;
        let mut squares = 0.0;
        for &cell in self.candidates.iter().filter(|cell| touching(&self.pressures, **cell)) {
            squares += self.gaps[cell].powi(2);
        }
        let keep = if self.gap_squares > 0.0 { squares / self.gap_squares } else { 0.0 };
        for &cell in self.candidates {
            self.direction[cell] = if touching(&self.pressures, cell) {
                self.gaps[cell] + keep * self.direction[cell]
            } else {
                0.0
            };
        }
        self.compliance.apply(&self.direction, &mut self.response, &mut self.workspace);
        let (mut slope, mut curvature) = (0.0, 0.0);
        for &cell in self.candidates.iter().filter(|cell| touching(&self.pressures, **cell)) {
            slope += self.gaps[cell] * self.direction[cell];
            curvature += self.response[cell] * self.direction[cell];
        }
        // Without curvature nothing touches, and cells join as if each were alone.
        let length = if curvature > 0.0 { slope / curvature } else { 1.0 / self.compliance.own() };
        self.gap_squares = squares;
        self.advance(length);
    }

    /// Moves by `length`, clips negative pressures, and lets overlapping cells join.
    fn advance(&mut self, length: f64) {
        let (mut has_left, mut has_joined) = (false, false);
        for &cell in self.candidates {
            let was_touching = self.pressures[cell] > 0.0;
            self.pressures[cell] -= length * self.direction[cell];
            has_left |= self.pressures[cell] < 0.0;
            self.pressures[cell] = self.pressures[cell].max(0.0);
            if !was_touching && self.gaps[cell] < 0.0 {
                self.pressures[cell] = -length * self.gaps[cell];
                has_joined = true;
            }
        }
        if has_joined {
            self.gap_squares = 0.0;
        }
        if has_left || has_joined {
            self.compliance.apply(&self.pressures, &mut self.response, &mut self.workspace);
            for &cell in self.candidates {
                self.gaps[cell] = self.response[cell] - self.penetrations[cell];
            }
        } else {
            for &cell in self.candidates {
                self.gaps[cell] -= length * self.response[cell];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use palpate_core::units::{KPA, MM};
    use proptest::prelude::*;

    use super::super::kernel::love;
    use super::*;

    const MODULUS: f64 = 40.0 * KPA;
    const STEP: f64 = 0.25 * MM;
    const SIDE: usize = 48;

    fn half_space() -> Convolution {
        Convolution::new(SIDE, SIDE, |row, col| {
            love(STEP, col as f64 * STEP, row as f64 * STEP) / MODULUS
        })
    }

    /// Penetrations by the distance from the grid's middle, metres.
    fn around_the_middle(depth: impl Fn(f64) -> f64) -> Vec<f64> {
        let at = |index: usize| (index as f64 - 0.5 * (SIDE as f64 - 1.0)) * STEP;
        (0..SIDE * SIDE).map(|cell| depth(at(cell % SIDE).hypot(at(cell / SIDE)))).collect()
    }

    fn force(pressures: &[f64]) -> f64 {
        pressures.iter().sum::<f64>() * STEP * STEP
    }

    #[test]
    fn a_ball_has_hertzian_pressures() {
        let (radius, depth) = (20.0 * MM, 0.8 * MM);
        let ball = around_the_middle(|r| depth - r * r / (2.0 * radius));
        let pressures = pressures(&half_space(), &ball, 1e-4);
        // a = √(Rd) = 4 mm; p₀ = 2 E*/π √(d/R) = 5.093 kPa; F = 4/3 E* √R d^1.5 = 0.1707 N.
        let contact_radius = 4.0 * MM;
        let peak = 2.0 * MODULUS / PI * (depth / radius).sqrt();
        let total = 4.0 / 3.0 * MODULUS * radius.sqrt() * depth.powf(1.5);
        assert!((force(&pressures) / total - 1.0).abs() < 0.01, "{} N", force(&pressures));
        let highest = pressures.iter().copied().fold(0.0, f64::max);
        assert!((highest / peak - 1.0).abs() < 0.02, "{highest} Pa");
        let n_touching = pressures.iter().filter(|pressure| **pressure > 0.0).count() as f64;
        let radius_found = (n_touching * STEP * STEP / PI).sqrt();
        assert!((radius_found / contact_radius - 1.0).abs() < 0.03, "{radius_found} m");
        // The whole profile: p₀ √(1 − r²/a²).
        for (pressure, r) in pressures.iter().zip(around_the_middle(|r| r)) {
            let hertz = peak * (1.0 - (r / contact_radius).powi(2)).max(0.0).sqrt();
            assert!((pressure - hertz).abs() < 0.12 * peak, "{pressure} for {hertz} at {r}");
        }
    }

    #[test]
    fn a_flat_punch_carries_the_analytic_force() {
        let (radius, depth) = (4.0 * MM, 0.3 * MM);
        let punch = around_the_middle(|r| if r < radius { depth } else { -1.0 });
        let pressures = pressures(&half_space(), &punch, 1e-4);
        // F = 2 E* a d; at the middle F / (2π a²).
        let total = 2.0 * MODULUS * radius * depth;
        assert!(
            (force(&pressures) / total - 1.0).abs() < 0.03,
            "{} N of {total}",
            force(&pressures)
        );
        let middle = pressures[(SIDE / 2) * SIDE + SIDE / 2];
        assert!(
            (middle / (total / (2.0 * PI * radius * radius)) - 1.0).abs() < 0.03,
            "{middle} Pa"
        );
    }

    #[test]
    fn a_body_above_the_surface_gives_no_pressure() {
        let away = around_the_middle(|_| f64::NEG_INFINITY);
        assert!(
            pressures(&half_space(), &away, 1e-3).iter().all(|pressure| pressure.abs() < 1e-30)
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn touching_cells_press_and_others_keep_a_gap(
            bumps in prop::collection::vec((0.0..48.0f64, 0.0..48.0f64, 0.2..6.0f64), 1..6),
            depth in 0.05..2.0f64,
        ) {
            // Balls of several curvatures; the deepest point of each differs.
            let height = |row: f64, col: f64| {
                bumps.iter().map(|(r, c, bend)| {
                    bend * 1e-2 * ((row - r).powi(2) + (col - c).powi(2)) + 0.1 * bend
                }).fold(f64::INFINITY, f64::min)
            };
            let body: Vec<f64> = (0..SIDE * SIDE)
                .map(|cell| (depth - height((cell / SIDE) as f64, (cell % SIDE) as f64)) * MM)
                .collect();
            let compliance = half_space();
            let tolerance = 1e-5;
            let found = pressures(&compliance, &body, tolerance);
            let mut give = vec![0.0; found.len()];
            compliance.apply(&found, &mut give, &mut compliance.workspace());
            let deepest = body.iter().copied().fold(0.0, f64::max);
            let n = body.iter().filter(|depth| **depth > 0.0).count() as f64;
            // One cell's part of a root mean square of n is at most √n of it.
            let allowed = tolerance * deepest * n.sqrt() * 1.01 + 1e-15;
            for cell in 0..found.len() {
                let gap = give[cell] - body[cell];
                prop_assert!(found[cell] >= 0.0);
                prop_assert!(gap >= -allowed, "overlap {gap} at {cell}");
                prop_assert!(found[cell] <= 0.0 || gap <= allowed, "pushes across {gap} at {cell}");
            }
        }
    }
}
