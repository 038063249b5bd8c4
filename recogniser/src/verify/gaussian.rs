//! Gaussian distributions of poses: shares inside a box, the volume of rotations, quasi-random draws.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3, Mat3, Vec3};
use libm::erf;
use nalgebra::{Cholesky, Matrix3, Vector3};

use crate::pose_prior::Workspace;

/// Quasi-random rotations by which a density over rotations is normalised.
const NORMALIZED_BY: usize = 256;

/// The numbers by which [`normalizer`] takes its mean.
pub(super) fn normals() -> Vec<Vector3<f64>> {
    (0..NORMALIZED_BY).map(quasi_normal).collect()
}

/// Mean over the rotations of a Gaussian of the volume of rotations beside that of their vectors: 1
/// for a narrow one.
pub(super) fn normalizer(covariance: &Matrix3<f64>, normals: &[Vector3<f64>]) -> f64 {
    let factor = Cholesky::new(*covariance).expect("checked").l();
    let volume = |normal: &Vector3<f64>| {
        let angle = (factor * normal).norm();
        if angle < 1e-3 {
            1.0
        } else if angle > PI {
            0.0
        } else {
            2.0 * (1.0 - angle.cos()) / angle.powi(2)
        }
    };
    let mean = normals.iter().map(volume).sum::<f64>() / normals.len() as f64;
    mean.max(1.0 / normals.len() as f64)
}

/// The share of a Gaussian about `center` inside the box, by its marginals.
pub(super) fn share_inside(place: &Matrix3<f64>, center: DVec3, space: Workspace) -> f64 {
    let (low, high) = ((space.low - center).to_array(), (space.high - center).to_array());
    (0..3).map(|n| between(low[n], high[n], place[(n, n)])).product()
}

/// The share of a Gaussian of this variance (m²) about `place` inside the box.
pub(super) fn inside(place: DVec3, [low, high]: [Vec3; 2], variance: f64) -> f64 {
    let (low, high) = (low.as_dvec3() - place, high.as_dvec3() - place);
    let both = low.to_array().into_iter().zip(high.to_array());
    both.map(|(low, high)| between(low, high, variance)).product()
}

/// The probability that a normal variable of this variance lies from `low` to `high`.
fn between(low: f64, high: f64, variance: f64) -> f64 {
    let scale = (2.0 * variance).sqrt();
    0.5 * (erf(high / scale) - erf(low / scale))
}

/// The n-th of a fixed sequence of three independent standard normal numbers; the first is 0.
/// Halton's sequence by the transform of Box and Muller.
pub(crate) fn quasi_normal(n: usize) -> Vector3<f64> {
    if n == 0 {
        return Vector3::zeros();
    }
    let pair = |a: usize, b: usize| {
        let (radius, angle) = ((-2.0 * halton(n, a).ln()).sqrt(), TAU * halton(n, b));
        (radius * angle.cos(), radius * angle.sin())
    };
    let ((x, y), (z, _)) = (pair(2, 3), pair(5, 7));
    Vector3::new(x, y, z)
}

/// The n-th number, from 1 on, of the sequence of van der Corput with this base.
fn halton(mut n: usize, base: usize) -> f64 {
    let (mut result, mut step) = (0.0, 1.0);
    while n > 0 {
        step /= base as f64;
        result += step * (n % base) as f64;
        n /= base;
    }
    result
}

pub(super) fn single(matrix: &Matrix3<f64>) -> Mat3 {
    DMat3::from_cols_slice(matrix.as_slice()).as_mat3()
}
