//! Steerable filters: derivatives at the image centre along the gradient; a negative control.
//!
//! Source: section 4.3.2 omits them for poor performance; Freeman and Adelson (1991), in the
//! form of Mikolajczyk and Schmid (2005): Gaussian derivatives up to order 4, order n in n +
//! 1 directions from the gradient's on. Deviation: a quarter of the diameter.

use super::disc::Disc;
use super::{Descriptor, Workspace};
use crate::reading::TactileImage;

/// Highest order of derivatives.
const ORDER_MAX: usize = 4;
/// Number of partial derivatives of orders 0 to 4: 1 + 2 + 3 + 4 + 5.
const N_PARTIALS: usize = 15;
/// Order 0, order 1 along the gradient (across, it is 0), and 3 + 4 + 5.
const DIMENSION: usize = 14;
/// Binomial coefficients of each order.
const BINOMIAL: [[f64; 5]; 5] = [
    [1.0, 0.0, 0.0, 0.0, 0.0],
    [1.0, 1.0, 0.0, 0.0, 0.0],
    [1.0, 2.0, 1.0, 0.0, 0.0],
    [1.0, 3.0, 3.0, 1.0, 0.0],
    [1.0, 4.0, 6.0, 4.0, 1.0],
];

/// Steered derivatives for images of one shape.
#[derive(Clone, Debug)]
pub struct Steerable {
    disc: Disc,
    /// For each taxel in the circle, its index and its weight in each partial derivative:
    /// order by order, from all in x to all in y.
    weights: Vec<(usize, [f64; N_PARTIALS])>,
}

impl Steerable {
    /// Plans for images of `rows` × `cols` taxels.
    #[must_use]
    pub fn new(rows: usize, cols: usize) -> Self {
        let disc = Disc { rows, cols };
        let sigma = disc.diameter() as f64 / 4.0;
        let weights = disc.taxels().into_iter().map(|inside| {
            let (x, y) = (inside.x / sigma, inside.y / sigma);
            let gaussian = (-0.5 * (x * x + y * y)).exp();
            let (in_x, in_y) = (hermite(x), hermite(y));
            let mut partials = [0.0; N_PARTIALS];
            let orders = (0..=ORDER_MAX).flat_map(|n| (0..=n).map(move |k| (n - k, k)));
            for (partial, (a, b)) in partials.iter_mut().zip(orders) {
                *partial = gaussian * in_x[a] * in_y[b];
            }
            (inside.taxel, partials)
        });
        Self { disc, weights: weights.collect() }
    }
}

impl Descriptor for Steerable {
    fn shape(&self) -> (usize, usize) {
        (self.disc.rows, self.disc.cols)
    }

    fn dimension(&self) -> usize {
        DIMENSION
    }

    fn write(&self, image: &TactileImage, _: &mut Workspace, features: &mut [f64]) {
        let mut partials = [0.0; N_PARTIALS];
        for (taxel, weights) in &self.weights {
            let pressure = image.pressures[*taxel];
            partials.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += pressure * weight);
        }
        let gradient = partials[2].atan2(partials[1]);
        let directions = (0..=ORDER_MAX).flat_map(|order| {
            let n = if order == 1 { 1 } else { order + 1 };
            (0..n).map(move |step| (order, step))
        });
        for (feature, (order, step)) in features.iter_mut().zip(directions) {
            let turn = std::f64::consts::PI * step as f64 / (order + 1) as f64;
            *feature = steer(&partials, order, gradient + turn);
        }
    }
}

/// The derivative of an order in a direction (rad), from the partial derivatives.
fn steer(partials: &[f64; N_PARTIALS], order: usize, direction: f64) -> f64 {
    let (sin, cos) = direction.sin_cos();
    let partials = &partials[order * (order + 1) / 2..];
    let term = |k: usize| {
        BINOMIAL[order][k] * cos.powi((order - k) as i32) * sin.powi(k as i32) * partials[k]
    };
    (0..=order).map(term).sum()
}

/// The Hermite polynomials of orders 0 to 4 at x.
fn hermite(x: f64) -> [f64; ORDER_MAX + 1] {
    let square = x * x;
    [1.0, x, square - 1.0, x * (square - 3.0), square * (square - 6.0) + 3.0]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::descriptor::DescriptorKind;
    use crate::descriptor::test_support::{blob, check_quarter_turn, turned_affinity};

    #[test]
    fn a_steered_derivative_combines_the_axes() {
        // Order 2 of x² − y² (partials 2, 0, −2): 2 along x, −2 along y, 0 on the diagonal.
        let mut partials = [0.0; N_PARTIALS];
        partials[3..6].copy_from_slice(&[2.0, 0.0, -2.0]);
        assert!((steer(&partials, 2, 0.0) - 2.0).abs() < 1e-12);
        assert!((steer(&partials, 2, std::f64::consts::FRAC_PI_2) + 2.0).abs() < 1e-12);
        assert!(steer(&partials, 2, std::f64::consts::FRAC_PI_4).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn quarter_turns_change_nothing(angle in -3.0..3.0_f64, dx in 0.2..0.6_f64) {
            check_quarter_turn(DescriptorKind::Steerable, &blob(6, angle, dx, 0.1), 1e-9);
        }

        #[test]
        fn rotation_of_a_smooth_image_changes_little(angle in -3.1..3.1_f64) {
            let kept = turned_affinity(DescriptorKind::Steerable, angle);
            prop_assert!(kept > 0.99, "{kept}");
        }
    }
}
