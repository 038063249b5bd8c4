//! MR-8: the largest response over six angles of oriented filters at each taxel.
//!
//! Source: section 4.3.2.3, Varma and Zisserman (2005). Windows and scales as in
//! `docs/equations.md`: four overlapping windows of two thirds of each side, mirrored
//! borders, deviations (1, 2), (2, 4), (4, 8) twelfths of the shorter side. The maximum over
//! angles turns with the image; the order of a window's taxels does not, which is its
//! weakness.

use super::disc::Disc;
use super::filter_bank::{FilterBank, Kernel};
use super::{Descriptor, Workspace};
use crate::reading::TactileImage;

/// Angles of each oriented filter.
const N_ANGLES: usize = 6;
/// Oriented filters, of six angles each, and two isotropic ones.
const N_CHANNELS: usize = 8;
/// Maximum number of blocks along a side over which a window's responses are averaged.
const BLOCKS_MAX: usize = 4;

/// MR-8 for images of one shape.
#[derive(Clone, Debug)]
pub struct Mr8 {
    disc: Disc,
    bank: FilterBank,
    rows: Spans,
    cols: Spans,
}

/// Positions of windows along one side of the image, and their blocks.
#[derive(Clone, Debug, PartialEq)]
struct Spans {
    /// First taxel of each window: one or two.
    starts: Vec<usize>,
    /// Taxels of a window.
    length: usize,
    n_blocks: usize,
}

impl Mr8 {
    /// Plans for images of `rows` × `cols` taxels. At 6 × 6 each of the four windows has 4 ×
    /// 4 taxels with 8 responses each; larger windows are averaged into 4 × 4 blocks.
    #[must_use]
    pub fn new(rows: usize, cols: usize) -> Self {
        let disc = Disc { rows, cols };
        let unit = disc.diameter() as f64 / 12.0;
        let mut kernels = Vec::new();
        for scale in [1.0, 2.0, 4.0] {
            for second in [false, true] {
                kernels.extend((0..N_ANGLES).map(|angle| Kernel::Oriented {
                    second,
                    narrow: scale * unit,
                    wide: 2.0 * scale * unit,
                    angle: std::f64::consts::PI * angle as f64 / N_ANGLES as f64,
                }));
            }
        }
        kernels.push(Kernel::Gaussian { sigma: 2.0 * unit });
        kernels.push(Kernel::GaussianDifference { narrow: 2.0 * unit, wide: 4.0 * unit });
        let bank = FilterBank::new(rows, cols, &kernels);
        Self { disc, bank, rows: Spans::new(rows), cols: Spans::new(cols) }
    }

    /// The largest magnitude over the angles, for each channel and taxel; `best` starts as zeros.
    fn respond(&self, image: &TactileImage, workspace: &mut Workspace) {
        let n = image.pressures.len();
        let (best, buffer) = workspace.lend(N_CHANNELS * n, self.bank.n_buffer());
        best.fill(0.0);
        self.bank.respond(image, buffer, |pair, taxel, response| {
            for (filter, value) in [(2 * pair, response.re), (2 * pair + 1, response.im)] {
                let place = &mut best[channel(filter) * n + taxel];
                *place = place.max(value.abs());
            }
        });
    }

    /// Writes the feature of the window that starts at (row, col).
    fn window(&self, best: &[f64], row: usize, col: usize, feature: &mut [f64]) {
        let n = self.disc.rows * self.disc.cols;
        let mut places = feature.iter_mut();
        for channel in best.chunks_exact(n) {
            for rows in self.rows.blocks(row) {
                for (cols, place) in self.cols.blocks(col).zip(&mut places) {
                    let line = |r: usize| &channel[r * self.disc.cols..][cols.clone()];
                    let sum: f64 = rows.clone().flat_map(line).sum();
                    *place = sum / (rows.len() * cols.len()) as f64;
                }
            }
        }
    }
}

impl Descriptor for Mr8 {
    fn shape(&self) -> (usize, usize) {
        (self.disc.rows, self.disc.cols)
    }

    fn dimension(&self) -> usize {
        N_CHANNELS * self.rows.n_blocks * self.cols.n_blocks
    }

    fn features_per_image(&self) -> usize {
        self.rows.starts.len() * self.cols.starts.len()
    }

    fn write(&self, image: &TactileImage, workspace: &mut Workspace, features: &mut [f64]) {
        self.respond(image, workspace);
        let best = workspace.lend(N_CHANNELS * image.pressures.len(), 0).0;
        let starts =
            self.rows.starts.iter().flat_map(|r| self.cols.starts.iter().map(move |c| (r, c)));
        for ((row, col), feature) in starts.zip(features.chunks_exact_mut(self.dimension())) {
            self.window(best, *row, *col, feature);
        }
    }
}

impl Spans {
    fn new(side: usize) -> Self {
        let length = (2 * side).div_ceil(3);
        let starts = if length < side { vec![0, side - length] } else { vec![0] };
        Self { starts, length, n_blocks: length.min(BLOCKS_MAX) }
    }

    /// The blocks of the window that starts at `start`, as equal as possible.
    fn blocks(&self, start: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
        let (length, n) = (self.length, self.n_blocks);
        (0..n).map(move |block| start + block * length / n..start + (block + 1) * length / n)
    }
}

/// The channel of a filter, shared by all angles of an oriented one.
fn channel(filter: usize) -> usize {
    let n_oriented = (N_CHANNELS - 2) * N_ANGLES;
    if filter < n_oriented { filter / N_ANGLES } else { filter - n_oriented + N_CHANNELS - 2 }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::descriptor::test_support::{any_image, blob, quarter_turned};

    #[test]
    fn a_6x6_image_has_four_overlapping_windows_of_4x4_taxels() {
        let plan = Mr8::new(6, 6);
        assert_eq!((plan.features_per_image(), plan.dimension()), (4, 8 * 16));
        assert_eq!(plan.rows, Spans { starts: vec![0, 2], length: 4, n_blocks: 4 });
        let blocks: Vec<_> = Spans::new(26).blocks(8).collect(); // windows of 18: 4, 5, 4, 5
        assert_eq!(blocks, [8..12, 12..17, 17..21, 21..26]);
    }

    fn responses(image: &TactileImage) -> Vec<f64> {
        let mut workspace = Workspace::default();
        Mr8::new(image.rows, image.cols).respond(image, &mut workspace);
        workspace.lend(N_CHANNELS * image.pressures.len(), 0).0.to_vec()
    }

    proptest! {
        #[test]
        fn the_largest_responses_turn_with_the_image(image in any_image(6, 8)) {
            // 30° steps contain every quarter turn of themselves.
            let (straight, turned) = (responses(&image), responses(&quarter_turned(&image)));
            for (a, b) in straight.chunks_exact(48).zip(turned.chunks_exact(48)) {
                let channel = TactileImage { pressures: a.to_vec(), ..image };
                let expected = quarter_turned(&channel).pressures;
                prop_assert!(expected.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6));
            }
        }
    }

    #[test]
    fn a_single_filter_does_not_turn_with_the_image() {
        // The control: without the maximum over angles, a quarter turn exchanges responses.
        let image = blob(6, 0.0, 0.0, 0.0);
        let kernel = Kernel::Oriented { second: true, narrow: 0.5, wide: 1.0, angle: 0.0 };
        let bank = FilterBank::new(6, 6, &[kernel]);
        let total = |image: &TactileImage| {
            let mut buffer = vec![Default::default(); bank.n_buffer()];
            let mut sum = 0.0;
            bank.respond(image, &mut buffer, |_, _, response| sum += response.re.abs());
            sum
        };
        assert!((total(&image) / total(&quarter_turned(&image)) - 1.0).abs() > 0.2);
    }
}
