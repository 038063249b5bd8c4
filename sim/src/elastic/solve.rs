//! A quarter of the slab as a grid of equal elements, and conjugate gradients over it.
//!
//! The matrix is never formed: each element's stiffness is applied to its 24 displacements.
//! Nodes are x-major within y within z; z = 0 is the bottom. Fixed are the bottom (all
//! directions) and the planes of symmetry x = 0 and y = 0 (their normal direction).

use thiserror::Error;

use super::hexahedron::{N_DEGREES, Stiffness, stiffness};

/// Ratio of residual to load at which the iteration ends.
const TOLERANCE: f64 = 1e-8;
/// Iteration limit; larger than any permitted slab was seen to take.
const ITERATIONS_MAX: usize = 20_000;

/// Error of equations that were not solved.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum SolveError {
    /// The residual stayed too large.
    #[error(
        "the residual is {residual:e} of the load after {iterations} iterations, expected \
         {TOLERANCE:e}"
    )]
    NoConvergence {
        /// Iterations done.
        iterations: usize,
        /// Residual over load.
        residual: f64,
    },
}

/// The grid of a quarter.
pub(super) struct Quarter {
    /// Nodes along x and along y.
    n: usize,
    n_layers: usize,
    stiffness: Stiffness,
    is_held: Vec<bool>,
    /// The inverse of the matrix's diagonal; 0 for fixed degrees of freedom.
    inverse_diagonal: Vec<f64>,
}

/// Displacements, and the number of iterations they took.
pub(super) struct Solution {
    pub(super) displacements: Vec<f64>,
    pub(super) n_iterations: usize,
}

impl Quarter {
    pub(super) fn new(half_width: usize, n_layers: usize, poisson_ratio: f64) -> Self {
        let n = half_width + 1;
        let n_degrees = 3 * n * n * (n_layers + 1);
        let is_held = (0..n_degrees).map(|degree| {
            let (node, axis) = (degree / 3, degree % 3);
            let (x, y, z) = (node % n, node / n % n, node / (n * n));
            z == 0 || (axis == 0 && x == 0) || (axis == 1 && y == 0)
        });
        let is_held: Vec<bool> = is_held.collect();
        let stiffness = stiffness(poisson_ratio);
        let mut grid = Self { n, n_layers, stiffness, is_held, inverse_diagonal: Vec::new() };
        let mut diagonal = vec![0.0; n_degrees];
        grid.for_elements(|degrees| {
            for (own, degree) in degrees.iter().enumerate() {
                diagonal[*degree] += grid.stiffness[own][own];
            }
        });
        let inverse = diagonal.iter().zip(&grid.is_held);
        grid.inverse_diagonal =
            inverse.map(|(value, held)| if *held { 0.0 } else { 1.0 / value }).collect();
        grid
    }

    /// The first degree of freedom of a node.
    pub(super) fn degree(&self, x: usize, y: usize, z: usize) -> usize {
        3 * ((z * self.n + y) * self.n + x)
    }

    pub(super) fn zeros(&self) -> Vec<f64> {
        vec![0.0; self.is_held.len()]
    }

    /// The forces that hold the nodes at `displacements`, fixed degrees of freedom included.
    pub(super) fn forces(&self, displacements: &[f64]) -> Vec<f64> {
        let mut forces = self.zeros();
        self.for_elements(|degrees| {
            let own: [f64; N_DEGREES] = std::array::from_fn(|d| displacements[degrees[d]]);
            // The matrix is symmetric: columns are rows, and columns vectorise.
            let mut sums = [0.0; N_DEGREES];
            for (column, u) in self.stiffness.iter().zip(own) {
                sums.iter_mut().zip(column).for_each(|(sum, k)| *sum += k * u);
            }
            degrees.iter().zip(sums).for_each(|(degree, sum)| forces[*degree] += sum);
        });
        forces
    }

    /// Calls `visit` with the degrees of freedom of every element.
    fn for_elements(&self, mut visit: impl FnMut(&[usize; N_DEGREES])) {
        for z in 0..self.n_layers {
            for y in 0..self.n - 1 {
                for x in 0..self.n - 1 {
                    visit(&std::array::from_fn(|degree| {
                        let node = degree / 3;
                        let (dx, dy, dz) = (node & 1, node >> 1 & 1, node >> 2);
                        self.degree(x + dx, y + dy, z + dz) + degree % 3
                    }));
                }
            }
        }
    }
}

/// The displacements under a load, by conjugate gradients preconditioned with the diagonal.
pub(super) fn solve(grid: &Quarter, load: &[f64]) -> Result<Solution, SolveError> {
    let mut displacements = grid.zeros();
    let mut residual = load.to_vec();
    hold(grid, &mut residual);
    let target = TOLERANCE * dot(&residual, &residual).sqrt();
    let mut scaled = precondition(grid, &residual);
    let mut direction = scaled.clone();
    let mut energy = dot(&residual, &scaled);
    for n_iterations in 0..ITERATIONS_MAX {
        if dot(&residual, &residual).sqrt() <= target {
            return Ok(Solution { displacements, n_iterations });
        }
        let mut forces = grid.forces(&direction);
        hold(grid, &mut forces);
        let step = energy / dot(&direction, &forces);
        add(&mut displacements, step, &direction);
        add(&mut residual, -step, &forces);
        scaled = precondition(grid, &residual);
        let next = dot(&residual, &scaled);
        let keep = next / energy;
        energy = next;
        direction.iter_mut().zip(&scaled).for_each(|(d, s)| *d = s + keep * *d);
    }
    let residual = dot(&residual, &residual).sqrt() * TOLERANCE / target;
    Err(SolveError::NoConvergence { iterations: ITERATIONS_MAX, residual })
}

fn hold(grid: &Quarter, forces: &mut [f64]) {
    forces.iter_mut().zip(&grid.is_held).filter(|(_, held)| **held).for_each(|(f, _)| *f = 0.0);
}

fn precondition(grid: &Quarter, residual: &[f64]) -> Vec<f64> {
    residual.iter().zip(&grid.inverse_diagonal).map(|(r, d)| r * d).collect()
}

fn add(sum: &mut [f64], factor: f64, other: &[f64]) {
    sum.iter_mut().zip(other).for_each(|(sum, other)| *sum += factor * other);
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_slab_under_uniform_load_sinks_by_the_formula() {
        // No sideways motion in the middle: thickness · pressure / (λ + 2 μ). ν = 0.3, μ = 1:
        // λ = 1.5, so 2 layers under a pressure of 1 sink by 2 / 3.5.
        let grid = Quarter::new(16, 2, 0.3);
        let mut load = grid.zeros();
        for (x, y) in (0..17).flat_map(|x| (0..17).map(move |y| (x, y))) {
            let share = |at: usize| if at == 0 || at == 16 { 0.5 } else { 1.0 };
            load[grid.degree(x, y, 2) + 2] = -share(x) * share(y);
        }
        let solution = solve(&grid, &load).unwrap();
        let sunk = -solution.displacements[grid.degree(0, 0, 2) + 2];
        assert!((sunk / (2.0 / 3.5) - 1.0).abs() < 1e-3, "{sunk}");
    }

    #[test]
    fn forces_of_the_solution_equal_the_load() {
        let grid = Quarter::new(5, 2, 0.45);
        let mut load = grid.zeros();
        load[grid.degree(1, 2, 2)] = 0.3;
        load[grid.degree(0, 0, 2) + 2] = -1.0;
        let solution = solve(&grid, &load).unwrap();
        let forces = grid.forces(&solution.displacements);
        for (degree, (force, load)) in forces.iter().zip(&load).enumerate() {
            assert!(grid.is_held[degree] || (force - load).abs() < 1e-7, "degree {degree}");
        }
    }
}
