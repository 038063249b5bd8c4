//! Likelihood of one press on a mosaic, with its depth, tilt and slip integrated out.
//!
//! Expected pressures are linear in a press's nuisance parameters about the mean press:
//! amplitude, tilt along two axes, and the slip (shift and turn) by which the arm missed the
//! stated position or a bin's centre misses the pose. With Gaussian priors they integrate out
//! in closed form. Residuals are clipped at three deviations (stuck or crossed taxels, or not
//! the object). Frame: the object's plane; o are a taxel's offsets from the sensor's centre,
//! m.

#![allow(clippy::needless_range_loop, reason = "rows and columns of small matrices by index")]

use super::tile::Tile;
use palpate_core::units::{DEG, MM};

/// Number of nuisance parameters of a press: amplitude, two tilts, two shifts, a turn.
pub const N_UNKNOWNS: usize = 6;

/// Prior of the nuisance parameters of a press: standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressPrior {
    /// Amplitude, about 1.
    pub amplitude: f64,
    /// Change of amplitude along an axis, 1/m.
    pub tilt: f64,
    /// Position of the sensor along an axis, m.
    pub shift: f64,
    /// Rotation of the sensor about its own centre, rad.
    pub turn: f64,
}

impl Default for PressPrior {
    fn default() -> Self {
        Self { amplitude: 0.25, tilt: 25.0, shift: 0.4 * MM, turn: 2.0 * DEG }
    }
}

impl PressPrior {
    /// The deviations in the order of the parameters.
    #[must_use]
    pub fn deviations(&self) -> [f32; N_UNKNOWNS] {
        let Self { amplitude, tilt, shift, turn } = *self;
        [amplitude, tilt, tilt, shift, shift, turn].map(|deviation| deviation as f32)
    }
}

/// The valid taxels of a press: offsets from the sensor's centre and pressures over gains.
#[derive(Clone, Debug, Default)]
pub struct Press {
    /// Offsets in the plane's frame, m.
    pub offsets: Vec<[f32; 2]>,
    /// Pressures divided by the taxels' gains, Pa.
    pub pressures: Vec<f32>,
    /// Standard deviation of gains that were not divided out; 0 when they are known.
    pub gain_deviation: f32,
}

/// Placement of a press on the object: the sensor's centre and the rotation of its offsets.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// The centre in the object's plane, m.
    pub center: [f64; 2],
    /// Cosine and sine of the angle from the offsets' to the object's axes.
    pub turn: [f64; 2],
}

/// A press fitted to a mosaic.
#[derive(Clone, Copy, Debug)]
pub struct PressFit {
    /// ln of the probability density of the press, up to a constant of the press.
    pub log_likelihood: f64,
    /// The most likely nuisance parameters, in units of their prior deviations.
    pub unknowns: [f32; N_UNKNOWNS],
    factor: Square,
}

impl PressFit {
    /// Covariance of the nuisance parameters in units of their prior deviations.
    #[must_use]
    pub fn covariance(&self) -> [[f32; N_UNKNOWNS]; N_UNKNOWNS] {
        inverse(&self.factor)
    }
}

/// Deviations at which residuals are clipped.
const OUTLIER: f32 = 3.0;

/// Working space of fits: columns over the taxels, padded to whole vectors.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    columns: [Vec<f32>; N_UNKNOWNS + 1],
    /// Offsets turned into the object's axes.
    offsets: [Vec<f32>; 2],
    /// Positions in the tile.
    places: Vec<[f32; 2]>,
    /// Expected pressure, its two derivatives, and precision.
    expected: [Vec<f32>; 4],
    /// Residuals after the nuisance parameters.
    left: Vec<f32>,
    /// Sum of the clipped squared residuals.
    clipped: f32,
}

type Square = [[f32; N_UNKNOWNS]; N_UNKNOWNS];

/// The normal equations of a press: unit priors and the taxels' information.
struct Normal {
    information: Square,
    pull: [f32; N_UNKNOWNS],
    residual: f32,
}

/// Fits `press` to `tile` at `place` and integrates over its nuisance parameters.
#[must_use]
pub fn fit(
    press: &Press,
    place: &Placement,
    tile: &Tile,
    prior: &PressPrior,
    workspace: &mut Workspace,
) -> PressFit {
    let log_precision = look_up(press, place, tile, &prior.deviations(), workspace);
    let mut normal = accumulate(workspace);
    let mut factor = cholesky(&normal.information);
    let mut unknowns = solve(&factor, &normal.pull);
    let n_outliers = find_outliers(&unknowns, workspace);
    // A press that fits nowhere near needs no second fit: its clipped residuals suffice.
    let squares = if n_outliers > 0 && 4 * n_outliers > press.pressures.len() {
        workspace.clipped + unknowns.iter().map(|unknown| unknown * unknown).sum::<f32>()
    } else {
        if n_outliers > 0 {
            remove_outliers(&mut normal, workspace);
            factor = cholesky(&normal.information);
            unknowns = solve(&factor, &normal.pull);
        }
        let explained: f32 = normal.pull.iter().zip(&unknowns).map(|(a, b)| a * b).sum();
        normal.residual - explained + n_outliers as f32 * OUTLIER * OUTLIER
    };
    let volume: f32 = (0..N_UNKNOWNS).map(|k| factor[k][k]).product();
    let log_likelihood = log_precision - 0.5 * f64::from(squares) - f64::from(volume).ln();
    PressFit { log_likelihood, unknowns, factor }
}

/// Fills the columns with the derivative by each parameter, per deviation, and the residuals
/// at the mean press, all over the taxels' deviations. Returns Σ ln precision.
fn look_up(
    press: &Press,
    place: &Placement,
    tile: &Tile,
    deviations: &[f32; N_UNKNOWNS],
    workspace: &mut Workspace,
) -> f64 {
    let log_precision = look_around(press, place, tile, workspace);
    let n = press.pressures.len();
    let padded = n.next_multiple_of(8);
    for column in &mut workspace.columns {
        column.resize(padded, 0.0);
        column[n..].fill(0.0);
    }
    let [c0, c1, c2, c3, c4, c5, c6] = &mut workspace.columns;
    let [c0, c1, c2] = [&mut c0[..n], &mut c1[..n], &mut c2[..n]];
    let [c3, c4, c5, c6] = [&mut c3[..n], &mut c4[..n], &mut c5[..n], &mut c6[..n]];
    let [ox, oy] = &workspace.offsets;
    let [expected, along_x, along_y, precision] = &workspace.expected;
    let (ox, oy, expected) = (&ox[..n], &oy[..n], &expected[..n]);
    let (along_x, along_y, precision) = (&along_x[..n], &along_y[..n], &precision[..n]);
    let pressures = &press.pressures[..n];
    let [amplitude, tilt, _, shift, _, turn] = *deviations;
    for taxel in 0..n {
        let precision = precision[taxel];
        let scaled = expected[taxel] * precision;
        c0[taxel] = scaled * amplitude;
        c1[taxel] = scaled * ox[taxel] * tilt;
        c2[taxel] = scaled * oy[taxel] * tilt;
        c3[taxel] = along_x[taxel] * precision * shift;
        c4[taxel] = along_y[taxel] * precision * shift;
        let around = along_y[taxel] * ox[taxel] - along_x[taxel] * oy[taxel];
        c5[taxel] = around * precision * turn;
        c6[taxel] = pressures[taxel] * precision - scaled;
    }
    log_precision
}

/// Looks up the expected pressure of every taxel. Returns Σ ln precision.
fn look_around(press: &Press, place: &Placement, tile: &Tile, workspace: &mut Workspace) -> f64 {
    let n = press.pressures.len();
    let Workspace { offsets: [ox, oy], places, expected, .. } = workspace;
    ox.resize(n, 0.0);
    oy.resize(n, 0.0);
    places.resize(n, [0.0; 2]);
    expected.iter_mut().for_each(|column| column.resize(n, 0.0));
    let [cos, sin] = place.turn.map(|value| value as f32);
    let [x, y] = place.center.map(|value| value as f32);
    let (ox, oy, places) = (&mut ox[..n], &mut oy[..n], &mut places[..n]);
    for (taxel, offset) in press.offsets[..n].iter().enumerate() {
        ox[taxel] = cos * offset[0] - sin * offset[1];
        oy[taxel] = sin * offset[0] + cos * offset[1];
        places[taxel] = tile.place(x + ox[taxel], y + oy[taxel]);
    }
    let [pressure, along_x, along_y, precision] = expected;
    let (pressure, along_x) = (&mut pressure[..n], &mut along_x[..n]);
    let (along_y, precision) = (&mut along_y[..n], &mut precision[..n]);
    for taxel in 0..n {
        let found = tile.between(places[taxel]);
        [pressure[taxel], along_x[taxel], along_y[taxel], precision[taxel]] = found.to_array();
    }
    if press.gain_deviation > 0.0 {
        for (precision, pressure) in precision.iter_mut().zip(pressure.iter()) {
            let unknown_gain = pressure * *precision * press.gain_deviation;
            *precision /= (1.0 + unknown_gain * unknown_gain).sqrt();
        }
    }
    // In f64 the product of a press's precisions neither over- nor underflows for a while.
    let product = |chunk: &[f32]| chunk.iter().map(|p| f64::from(*p)).product::<f64>().ln();
    precision.chunks(64).map(product).sum()
}

fn accumulate(workspace: &Workspace) -> Normal {
    let columns = &workspace.columns;
    let mut information = [[0.0; N_UNKNOWNS]; N_UNKNOWNS];
    let mut pull = [0.0; N_UNKNOWNS];
    for row in 0..N_UNKNOWNS {
        for col in 0..=row {
            information[row][col] = dot(&columns[row], &columns[col]);
        }
        information[row][row] += 1.0;
        pull[row] = dot(&columns[row], &columns[N_UNKNOWNS]);
    }
    let residual = dot(&columns[N_UNKNOWNS], &columns[N_UNKNOWNS]);
    Normal { information, pull, residual }
}

#[inline]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0f32; 8];
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let halves = [sums[0] + sums[4], sums[1] + sums[5], sums[2] + sums[6], sums[3] + sums[7]];
    (halves[0] + halves[2]) + (halves[1] + halves[3])
}

/// The remaining residual of each taxel, and the number of outliers.
fn find_outliers(unknowns: &[f32; N_UNKNOWNS], workspace: &mut Workspace) -> usize {
    let [c0, c1, c2, c3, c4, c5, c6] = &workspace.columns;
    let n = c0.len();
    let left = &mut workspace.left;
    left.resize(n, 0.0);
    let (c1, c2, c3, c4, c5, c6) = (&c1[..n], &c2[..n], &c3[..n], &c4[..n], &c5[..n], &c6[..n]);
    let left = &mut left[..n];
    for taxel in 0..n {
        left[taxel] = c6[taxel]
            - (c0[taxel] * unknowns[0] + c1[taxel] * unknowns[1])
            - (c2[taxel] * unknowns[2] + c3[taxel] * unknowns[3])
            - (c4[taxel] * unknowns[4] + c5[taxel] * unknowns[5]);
    }
    let (mut count, mut clipped) = (0.0f32, 0.0f32);
    for value in left.iter() {
        let square = value * value;
        count += if square > OUTLIER * OUTLIER { 1.0 } else { 0.0 };
        clipped += square.min(OUTLIER * OUTLIER);
    }
    workspace.clipped = clipped;
    count as usize
}

/// Removes outliers from the normal equations.
fn remove_outliers(normal: &mut Normal, workspace: &Workspace) {
    let columns = &workspace.columns;
    for (taxel, left) in workspace.left.iter().enumerate() {
        if left * left <= OUTLIER * OUTLIER {
            continue;
        }
        let row: [f32; N_UNKNOWNS + 1] = std::array::from_fn(|k| columns[k][taxel]);
        for k in 0..N_UNKNOWNS {
            for col in 0..=k {
                normal.information[k][col] -= row[k] * row[col];
            }
            normal.pull[k] -= row[k] * row[N_UNKNOWNS];
        }
        normal.residual -= row[N_UNKNOWNS] * row[N_UNKNOWNS];
    }
}

/// The lower factor of a symmetric matrix of at least unit priors.
fn cholesky(matrix: &Square) -> Square {
    let mut factor = *matrix;
    for col in 0..N_UNKNOWNS {
        // The priors bound the diagonal from below; rounding must not break that.
        let diagonal = factor[col][col].max(0.5).sqrt();
        let scale = diagonal.recip();
        factor[col][col] = diagonal;
        for row in col + 1..N_UNKNOWNS {
            factor[row][col] *= scale;
        }
        for row in col + 1..N_UNKNOWNS {
            for other in col + 1..=row {
                factor[row][other] -= factor[row][col] * factor[other][col];
            }
        }
    }
    factor
}

fn solve(factor: &Square, right: &[f32; N_UNKNOWNS]) -> [f32; N_UNKNOWNS] {
    let mut value = *right;
    let scale: [f32; N_UNKNOWNS] = std::array::from_fn(|k| factor[k][k].recip());
    for row in 0..N_UNKNOWNS {
        value[row] *= scale[row];
        for below in row + 1..N_UNKNOWNS {
            value[below] -= factor[below][row] * value[row];
        }
    }
    for row in (0..N_UNKNOWNS).rev() {
        value[row] *= scale[row];
        for above in 0..row {
            value[above] -= factor[row][above] * value[row];
        }
    }
    value
}

fn inverse(factor: &Square) -> Square {
    let mut columns = [[0.0; N_UNKNOWNS]; N_UNKNOWNS];
    for (k, column) in columns.iter_mut().enumerate() {
        let mut unit = [0.0; N_UNKNOWNS];
        unit[k] = 1.0;
        *column = solve(factor, &unit);
    }
    columns
}

#[cfg(test)]
mod tests {
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
}
