//! Blurring of a solid map to the resolution of a coarse bin.
//!
//! Probabilities of occupancy, not log-odds, are averaged under a Gaussian: a position that
//! is certainly full half of the time is full with probability one half.

use crate::occupancy::OccupancyGrid;
use palpate_core::sensor::point_spread::gaussian_kernel;

/// The map convolved with a Gaussian of deviation `sigma` (m) along every axis; space outside
/// has the map's prior.
pub(super) fn blurred(map: &OccupancyGrid, sigma: f64) -> OccupancyGrid {
    let shape = *map.shape();
    if sigma < 0.5 * shape.cell() {
        return map.clone();
    }
    let kernel: Vec<f32> =
        gaussian_kernel(sigma, shape.cell()).into_iter().map(|weight| weight as f32).collect();
    let outside = map.prior() as f32;
    let mut values: Vec<f32> =
        map.log_odds().iter().map(|log_odds| (1.0 + (-log_odds).exp()).recip()).collect();
    let n = shape.n();
    for (axis, stride) in [1, n[0], n[0] * n[1]].into_iter().enumerate() {
        values = along(&values, stride, n[axis], &kernel, outside);
    }
    let log_odds = values.iter().map(|p| {
        let p = p.clamp(1e-4, 1.0 - 1e-4);
        (p / (1.0 - p)).ln()
    });
    OccupancyGrid::from_parts(shape, map.prior(), log_odds.collect())
        .expect("shape and prior are those of a grid, and clamped odds are finite")
}

fn along(values: &[f32], stride: usize, n: usize, kernel: &[f32], outside: f32) -> Vec<f32> {
    let radius = kernel.len() / 2;
    let cell = |index: usize| {
        let place = index / stride % n;
        let tap = |(tap, weight): (usize, &f32)| {
            let from = (place + tap).checked_sub(radius).filter(|from| *from < n);
            weight * from.map_or(outside, |from| values[index - place * stride + from * stride])
        };
        kernel.iter().enumerate().map(tap).sum()
    };
    (0..values.len()).map(cell).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::occupancy::GridShape;

    #[test]
    fn an_edge_becomes_a_slope_and_a_uniform_map_stays() {
        let shape = GridShape::new(DVec3::ZERO, 1.0, [9, 1, 2]).unwrap();
        let step = (0..18).map(|cell| if cell % 9 < 4 { -8.0 } else { 8.0 }).collect();
        let map = OccupancyGrid::from_parts(shape, 0.5, step).unwrap();
        let soft = blurred(&map, 1.0);
        // The kernel's taps at 0 and 1 are 0.4 and 0.24: ½ ± 0.2 within, half of y and z is
        // outside at the prior.
        assert!(soft.log_odds()[3] < 0.0 && soft.log_odds()[3] > -1.0, "{:?}", soft.log_odds());
        assert!(soft.log_odds()[4] > 0.0 && soft.log_odds()[4] < 1.0);
        let even = OccupancyGrid::from_parts(shape, 0.5, vec![0.0; 18]).unwrap();
        assert!(blurred(&even, 1.0).log_odds().iter().all(|value| value.abs() < 1e-5));
        assert_eq!(blurred(&map, 0.1), map);
    }
}
