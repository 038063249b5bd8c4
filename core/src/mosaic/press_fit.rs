//! One press laid onto a mosaic: how likely it is there, whatever its depth, tilt and slip.
//!
//! Expected pressures are linear in a press's own unknowns about the mean press: amplitude,
//! tilt along two axes, and the slip (shift and turn) by which the arm missed the stated
//! place or a bin's centre misses the pose. With Gaussian priors they integrate out in closed
//! form. Taxels beyond three deviations count as that (stuck, crossed, or not the object).
//! Frame: the object's plane; o are a taxel's offsets from the sensor's centre, m.

#![allow(clippy::needless_range_loop, reason = "rows and columns of small matrices by index")]

use super::tile::Tile;

/// How many unknowns a press has: amplitude, two tilts, two shifts, a turn.
pub const N_UNKNOWNS: usize = 6;

/// How far single presses stray: standard deviations of their unknowns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressPrior {
    /// Of the amplitude about 1.
    pub amplitude: f64,
    /// Of the change of amplitude along an axis, 1/m.
    pub tilt: f64,
    /// Of the sensor's place along an axis, m.
    pub shift: f64,
    /// Of its turn about its own centre, rad.
    pub turn: f64,
}

impl Default for PressPrior {
    fn default() -> Self {
        Self { amplitude: 0.25, tilt: 25.0, shift: 0.000_5, turn: 0.04 }
    }
}

impl PressPrior {
    /// The deviations in the order of the unknowns.
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
}

/// Where a press lies on the object: the sensor's centre and the turn of its offsets.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// The centre in the object's plane, m.
    pub center: [f64; 2],
    /// Cosine and sine of the angle that takes offsets into the object's axes.
    pub turn: [f64; 2],
}

/// A press laid onto a mosaic.
#[derive(Clone, Copy, Debug)]
pub struct PressFit {
    /// ln of the probability density of the press, up to a constant of the press.
    pub log_likelihood: f64,
    /// The most likely unknowns, in units of their prior deviations.
    pub unknowns: [f32; N_UNKNOWNS],
    factor: Square,
}

impl PressFit {
    /// Covariance of the unknowns in units of their prior deviations.
    #[must_use]
    pub fn covariance(&self) -> [[f32; N_UNKNOWNS]; N_UNKNOWNS] {
        inverse(&self.factor)
    }
}

/// Residuals beyond this many deviations count as this many.
const OUTLIER: f32 = 3.0;

/// Working space of fits: seven columns over the taxels, padded to whole vectors.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    columns: [Vec<f32>; N_UNKNOWNS + 1],
}

type Square = [[f32; N_UNKNOWNS]; N_UNKNOWNS];

/// The normal equations of a press: unit priors and what the taxels say.
struct Normal {
    information: Square,
    pull: [f32; N_UNKNOWNS],
    residual: f32,
}

/// Lays `press` onto `tile` at `place` and integrates over its unknowns.
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
    let n_outliers = remove_outliers(&mut normal, &unknowns, workspace);
    if n_outliers > 0 {
        factor = cholesky(&normal.information);
        unknowns = solve(&factor, &normal.pull);
    }
    let explained: f32 = normal.pull.iter().zip(&unknowns).map(|(a, b)| a * b).sum();
    let log_volume: f64 = (0..N_UNKNOWNS).map(|k| f64::from(factor[k][k]).ln()).sum();
    let squares = normal.residual - explained + n_outliers as f32 * OUTLIER * OUTLIER;
    let log_likelihood = log_precision - 0.5 * f64::from(squares) - log_volume;
    PressFit { log_likelihood, unknowns, factor }
}

/// Fills the columns with what each unknown changes by one deviation, and the residuals at
/// the mean press, all over the taxels' deviations. Returns Σ ln precision.
fn look_up(
    press: &Press,
    place: &Placement,
    tile: &Tile,
    deviations: &[f32; N_UNKNOWNS],
    workspace: &mut Workspace,
) -> f64 {
    let n = press.pressures.len();
    let padded = n.next_multiple_of(8);
    for column in &mut workspace.columns {
        column.resize(padded, 0.0);
        column[n..].fill(0.0);
    }
    let [c0, c1, c2, c3, c4, c5, c6] = &mut workspace.columns;
    let [amplitude, tilt, _, shift, _, turn] = *deviations;
    let [cos, sin] = place.turn.map(|value| value as f32);
    let [x, y] = place.center.map(|value| value as f32);
    // In f64 the product of a press's precisions neither over- nor underflows for a while.
    let (mut product, mut log_precision) = (1.0f64, 0.0f64);
    for (taxel, (offset, pressure)) in press.offsets.iter().zip(&press.pressures).enumerate() {
        let ox = cos * offset[0] - sin * offset[1];
        let oy = sin * offset[0] + cos * offset[1];
        let expected = tile.at(x + ox, y + oy);
        let precision = expected.precision;
        let scaled = expected.pressure * precision;
        c0[taxel] = scaled * amplitude;
        c1[taxel] = scaled * ox * tilt;
        c2[taxel] = scaled * oy * tilt;
        c3[taxel] = expected.along_x * precision * shift;
        c4[taxel] = expected.along_y * precision * shift;
        c5[taxel] = (expected.along_y * ox - expected.along_x * oy) * precision * turn;
        c6[taxel] = pressure * precision - scaled;
        product *= f64::from(precision);
        if taxel % 64 == 63 {
            log_precision += product.ln();
            product = 1.0;
        }
    }
    log_precision + product.ln()
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

/// Takes taxels beyond the limit out of the normal equations; returns how many.
fn remove_outliers(
    normal: &mut Normal,
    unknowns: &[f32; N_UNKNOWNS],
    workspace: &Workspace,
) -> usize {
    let columns = &workspace.columns;
    let mut n_outliers = 0;
    for taxel in 0..columns[0].len() {
        let left = (0..N_UNKNOWNS)
            .fold(columns[N_UNKNOWNS][taxel], |left, k| left - columns[k][taxel] * unknowns[k]);
        if left.abs() <= OUTLIER {
            continue;
        }
        n_outliers += 1;
        let residual = columns[N_UNKNOWNS][taxel];
        for row in 0..N_UNKNOWNS {
            let change = columns[row][taxel];
            for col in 0..=row {
                normal.information[row][col] -= change * columns[col][taxel];
            }
            normal.pull[row] -= change * residual;
        }
        normal.residual -= residual * residual;
    }
    n_outliers
}

/// The lower factor of a symmetric matrix of at least unit priors.
fn cholesky(matrix: &Square) -> Square {
    let mut factor = [[0.0; N_UNKNOWNS]; N_UNKNOWNS];
    for row in 0..N_UNKNOWNS {
        for col in 0..=row {
            let known: f32 = (0..col).map(|k| factor[row][k] * factor[col][k]).sum();
            let left = matrix[row][col] - known;
            // The priors bound the diagonal from below; rounding must not break that.
            factor[row][col] =
                if row == col { left.max(0.5).sqrt() } else { left / factor[col][col] };
        }
    }
    factor
}

fn solve(factor: &Square, right: &[f32; N_UNKNOWNS]) -> [f32; N_UNKNOWNS] {
    let mut value = *right;
    for row in 0..N_UNKNOWNS {
        let known: f32 = (0..row).map(|k| factor[row][k] * value[k]).sum();
        value[row] = (value[row] - known) / factor[row][row];
    }
    for row in (0..N_UNKNOWNS).rev() {
        let known: f32 = (row + 1..N_UNKNOWNS).map(|k| factor[k][row] * value[k]).sum();
        value[row] = (value[row] - known) / factor[row][row];
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
