//! Tests of `press_fit`.

use glam::DVec3;

use super::*;
use crate::mosaic::ForceMosaic;
use crate::occupancy::GridShape;

/// A round bump of 10 kPa and deviation 3 mm at (1, 0) mm, known to 200 Pa.
fn bump() -> Tile {
    let shape = GridShape::new(DVec3::splat(-10.0 * MM), 0.5 * MM, [40, 40, 1]).unwrap();
    let pressure = (0..1600).map(|cell| height(shape.center(cell)) as f32).collect();
    Tile::new(&ForceMosaic::from_parts(shape, pressure, vec![200.0; 1600]).unwrap(), 0.0)
}

fn height(at: DVec3) -> f64 {
    let squared = (at.x - 1.0 * MM).powi(2) + at.y.powi(2);
    10_000.0 * (-0.5 * squared / (3.0 * MM).powi(2)).exp()
}

/// A press of the bump with the given `amplitude`, displaced by `slip` (m) along x.
fn press(amplitude: f64, slip: f64) -> Press {
    let mut press = Press::default();
    for taxel in 0..36 {
        let [x, y] = [taxel % 6, taxel / 6].map(|n| (f64::from(n) - 2.5) * 2.0 * MM);
        press.offsets.push([x as f32, y as f32]);
        press.pressures.push((amplitude * height(DVec3::new(x + slip, y, 0.0))) as f32);
    }
    press
}

fn fitted(press: &Press, prior: &PressPrior) -> PressFit {
    let place = Placement { center: [0.0, 0.0], turn: [1.0, 0.0] };
    fit(press, &place, &bump(), prior, &mut Workspace::default())
}

#[test]
fn amplitude_and_slip_are_recovered_in_units_of_deviations() {
    let prior = PressPrior { amplitude: 0.25, ..PressPrior::default() };
    let deep = fitted(&press(1.2, 0.0), &prior).unknowns;
    // 0.2 / 0.25 = 0.8, less the prior's small pull.
    assert!((deep[0] - 0.8).abs() < 0.03 && deep[3].abs() < 0.05, "{deep:?}");
    let upright = PressPrior { tilt: 0.1, ..prior };
    let slipped = fitted(&press(1.0, 0.3 * MM), &upright).unknowns;
    // 0.3 mm of 0.4 mm.
    assert!((slipped[3] - 0.75).abs() < 0.06 && slipped[4].abs() < 0.05, "{slipped:?}");
}

#[test]
fn permitted_deviations_cost_little_and_others_much() {
    let prior = PressPrior::default();
    let log = |press: &Press| fitted(press, &prior).log_likelihood;
    let exact = log(&press(1.0, 0.0));
    // One deviation of the slip costs half a nat, and the linearisation a little.
    assert!((exact - log(&press(1.0, 0.4 * MM)) - 0.5).abs() < 0.3);
    assert!(exact - log(&press(1.0, 2.0 * MM)) > 10.0);
}

#[test]
fn a_stuck_taxel_costs_nine_halves_and_changes_nothing_else() {
    let prior = PressPrior::default();
    let mut stuck = press(1.0, 0.0);
    stuck.pressures[0] = 20_000.0;
    let (clean, found) = (fitted(&press(1.0, 0.0), &prior), fitted(&stuck, &prior));
    let cost = clean.log_likelihood - found.log_likelihood;
    assert!((cost - 4.5).abs() < 0.1, "{cost}");
    assert!(found.unknowns.iter().all(|unknown| unknown.abs() < 0.1), "{:?}", found.unknowns);
}

#[test]
fn the_factor_solves_and_inverts() {
    let mut matrix = [[0.0f32; N_UNKNOWNS]; N_UNKNOWNS];
    for row in 0..N_UNKNOWNS {
        for col in 0..=row {
            matrix[row][col] = if row == col { 4.0 + row as f32 } else { 0.5 };
        }
    }
    let factor = cholesky(&matrix);
    let inverse = inverse(&factor);
    for row in 0..N_UNKNOWNS {
        for col in 0..N_UNKNOWNS {
            let at = |a: usize, b: usize| matrix[a.max(b)][a.min(b)];
            let product: f32 = (0..N_UNKNOWNS).map(|k| at(row, k) * inverse[k][col]).sum();
            let expected = if row == col { 1.0 } else { 0.0 };
            assert!((product - expected).abs() < 1e-5, "{row} {col}: {product}");
        }
    }
}
