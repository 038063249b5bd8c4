//! Kernel weights of the cells around a taxel.

use crate::occupancy::GridShape;

/// Calls `take` with (cell, kernel weight) of the cells within three deviations of a position.
pub(super) fn share(
    shape: &GridShape,
    kernel: f64,
    place: [f64; 2],
    mut take: impl FnMut(usize, f64),
) {
    let (min, cell, n) = (shape.min(), shape.cell(), shape.n());
    let at = [(place[0] - min.x) / cell - 0.5, (place[1] - min.y) / cell - 0.5];
    let reach = 3.0 * kernel / cell;
    let range = |axis: usize| {
        let low = (at[axis] - reach).ceil().max(0.0) as usize;
        let high = (at[axis] + reach).floor().min(n[axis] as f64 - 1.0);
        low..(high + 1.0).max(low as f64) as usize
    };
    let scale = -0.5 * (cell / kernel).powi(2);
    // The kernel is a product of one along x and one along y.
    let weight = |axis: usize, index: usize| (scale * (index as f64 - at[axis]).powi(2)).exp();
    let along: Vec<f64> = range(0).map(|x| weight(0, x)).collect();
    for y in range(1) {
        let up = weight(1, y);
        for (x, along) in range(0).zip(&along) {
            take(x + n[0] * y, up * along);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn weights_fall_with_distance_and_end_at_three_deviations() {
        let shape = GridShape::new(DVec3::ZERO, 1.0, [9, 1, 1]).unwrap();
        let mut weights = [0.0; 9];
        share(&shape, 1.0, [4.5, 0.5], |cell, weight| weights[cell] = weight);
        // exp(−d²/2) to three deviations: cells 1 to 7.
        assert!((weights[4] - 1.0).abs() < 1e-12 && (weights[5] - 0.606_531).abs() < 1e-6);
        assert!((weights[1] - 0.011_109).abs() < 1e-6 && weights[0].abs() < 1e-12);
    }
}
