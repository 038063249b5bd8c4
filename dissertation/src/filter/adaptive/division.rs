//! Division of a box of poses into bins, and of bins into halves.
//!
//! Bins of one depth have one size. Axes are compared by the displacement per unit along them.

/// Division of a box of poses: numbers of the first bins, and the axes of each split.
#[derive(Clone, Debug, PartialEq)]
pub struct Division<const D: usize> {
    low: [f64; D],
    n: [usize; D],
    /// Widths of a bin by depth, in the axes' own units.
    widths: Vec<[f64; D]>,
    /// ln of the share of the box that a bin fills, by depth.
    log_shares: Vec<f64>,
}

impl<const D: usize> Division<D> {
    /// Divides the box from `low` to `high` into `n` bins along each axis. `lengths` (metres
    /// per unit of the axis) compare axes; a split halves all axes that are at least three
    /// quarters of the widest, and there are splits until none is wider than `smallest` (m).
    #[must_use]
    pub fn new(
        low: [f64; D],
        high: [f64; D],
        n: [usize; D],
        lengths: [f64; D],
        smallest: f64,
        axes_max: usize,
    ) -> Self {
        let n = n.map(|n| n.max(1));
        let mut width = [0.0; D];
        for axis in 0..D {
            width[axis] = (high[axis] - low[axis]) / n[axis] as f64;
        }
        let mut widths = vec![width];
        while widths.len() < DEPTH_MAX {
            let metric = |axis: usize| width[axis] * lengths[axis];
            let widest = (0..D).map(metric).fold(0.0, f64::max);
            if widest <= smallest {
                break;
            }
            let mut order: Vec<usize> = (0..D).filter(|a| metric(*a) >= 0.75 * widest).collect();
            order.sort_by(|a, b| metric(*b).total_cmp(&metric(*a)).then(a.cmp(b)));
            for axis in order.into_iter().take(axes_max) {
                width[axis] *= 0.5;
            }
            widths.push(width);
        }
        let log_first: f64 = n.iter().map(|n| -(*n as f64).ln()).sum();
        let log_share = |here: &[f64; D]| {
            let ratio = here.iter().zip(&widths[0]).map(|(here, first)| (here / first).ln());
            log_first + ratio.sum::<f64>()
        };
        let log_shares = widths.iter().map(log_share).collect();
        Self { low, n, widths, log_shares }
    }

    /// The widths of a bin at a depth, in the axes' own units.
    #[must_use]
    pub fn widths(&self, depth: usize) -> [f64; D] {
        self.widths[depth.min(self.widths.len() - 1)]
    }

    /// Depth of the smallest bins.
    #[must_use]
    pub fn depth_max(&self) -> usize {
        self.widths.len() - 1
    }

    /// ln of the fraction of the box that a bin of this depth fills.
    #[must_use]
    pub fn log_share(&self, depth: usize) -> f64 {
        self.log_shares[depth.min(self.log_shares.len() - 1)]
    }

    pub(super) fn first_centers(&self) -> impl Iterator<Item = [f64; D]> + '_ {
        let count: usize = self.n.iter().product();
        (0..count).map(|mut index| {
            std::array::from_fn(|axis| {
                let along = (index % self.n[axis]) as f64 + 0.5;
                index /= self.n[axis];
                self.low[axis] + along * self.widths[0][axis]
            })
        })
    }

    /// The centres of a bin's children.
    pub(super) fn children(&self, center: &[f64; D], depth: usize) -> Vec<[f64; D]> {
        let (here, below) = (self.widths[depth], self.widths[depth + 1]);
        let mut centers = vec![*center];
        for axis in (0..D).filter(|axis| below[*axis] < here[*axis]) {
            let aside = 0.5 * below[axis];
            let mut halves = Vec::with_capacity(2 * centers.len());
            for center in &centers {
                for side in [-aside, aside] {
                    let mut half = *center;
                    half[axis] += side;
                    halves.push(half);
                }
            }
            centers = halves;
        }
        centers
    }
}

/// Maximum depth; deeper bins would be below a micrometre.
const DEPTH_MAX: usize = 24;
