//! Points in cubic cells, for finding those near a position without visiting all.

use glam::DVec3;

/// Maximum number of cells along an axis.
const CELLS_MAX: f64 = 64.0;

/// Points sorted into the cubic cells of a box.
pub(super) struct Cells {
    low: DVec3,
    per_metre: f64,
    counts: [usize; 3],
    /// Start of each cell in `points`; one more than there are cells.
    starts: Vec<u32>,
    points: Vec<u32>,
}

impl Cells {
    /// Sorts points (metres) into cells that are at least `reach` metres wide.
    pub(super) fn new(points: &[DVec3], reach: f64) -> Self {
        let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) =
            points.iter().fold(nothing, |(low, high), at| (low.min(*at), high.max(*at)));
        let width = reach.max((high - low).max_element() / CELLS_MAX).max(f64::MIN_POSITIVE);
        let per_metre = width.recip();
        let counts = ((high - low) * per_metre).to_array().map(|n| n as usize + 1);
        let mut cells = Self { low, per_metre, counts, starts: Vec::new(), points: Vec::new() };
        let cell_of: Vec<usize> = points.iter().map(|at| cells.cell(cells.place(*at))).collect();
        let mut starts = vec![0u32; counts.iter().product::<usize>() + 1];
        for cell in &cell_of {
            starts[cell + 1] += 1;
        }
        for cell in 1..starts.len() {
            starts[cell] += starts[cell - 1];
        }
        let mut next = starts.clone();
        cells.points = vec![0; points.len()];
        for (point, cell) in cell_of.into_iter().enumerate() {
            cells.points[next[cell] as usize] = point as u32;
            next[cell] += 1;
        }
        cells.starts = starts;
        cells
    }

    /// Visits all points nearer than `reach`, and some that are farther away.
    pub(super) fn each_near(&self, at: DVec3, mut visit: impl FnMut(usize)) {
        let place = self.place(at);
        let range = |axis: usize| {
            let last = self.counts[axis] as i64 - 1;
            place[axis].saturating_sub(1).max(0)..=place[axis].saturating_add(1).min(last)
        };
        for x in range(0) {
            for y in range(1) {
                let (first, last) = (*range(2).start(), *range(2).end());
                if first > last {
                    return;
                }
                let (from, to) = (self.cell([x, y, first]), self.cell([x, y, last]) + 1);
                let run = self.starts[from] as usize..self.starts[to] as usize;
                self.points[run].iter().for_each(|point| visit(*point as usize));
            }
        }
    }

    fn place(&self, at: DVec3) -> [i64; 3] {
        ((at - self.low) * self.per_metre).floor().to_array().map(|n| n as i64)
    }

    fn cell(&self, place: [i64; 3]) -> usize {
        let [x, y, z] = place.map(|n| n as usize);
        (x * self.counts[1] + y) * self.counts[2] + z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};

    #[test]
    fn every_point_within_reach_is_visited_once() {
        let mut stream = Stream::new(1, Purpose::Sampling, 0);
        let points: Vec<DVec3> =
            (0..300).map(|_| stream.direction() * DVec3::new(0.04, 0.02, 0.0)).collect();
        let reach = 0.006;
        let cells = Cells::new(&points, reach);
        for _ in 0..200 {
            let at = stream.direction() * stream.uniform(0.0, 0.06);
            let mut visits = vec![0; points.len()];
            cells.each_near(at, |point| visits[point] += 1);
            for (point, visits) in points.iter().zip(visits) {
                assert!(visits <= 1);
                assert!(visits == 1 || point.distance(at) > reach);
            }
        }
    }
}
