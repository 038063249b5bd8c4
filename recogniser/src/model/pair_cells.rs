//! Cells: pairs sorted by their geometry, the inside of a table of pairs.
//!
//! Source: the hash multimap of section 5.3 with another key, distance and three cosines. A
//! query visits the cells that may hold pairs within its tolerance; the caller compares.

use std::ops::Range;

use super::pair_geometry::PairGeometry;
use crate::options::PairTolerance;

/// Maximum number of distance bins; objects larger than about a metre have wider bins.
pub(super) const N_DISTANCES_MAX: f32 = 512.0;

/// Entries in cells by the geometry of a pair; cosines are cut into `N_COSINES` equal bins.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PairCells<T, const N_COSINES: usize> {
    min: f32,
    edge: f32,
    n_distances: usize,
    /// Index of each cell's first entry, and the total at the end.
    starts: Vec<u32>,
    entries: Vec<T>,
}

impl<T: Copy + Ord, const N_COSINES: usize> PairCells<T, N_COSINES> {
    /// Sorts entries into cells: pairs at least `min` metres apart (others are left out), in
    /// distance bins of `edge` m. In a cell entries are in their own order.
    pub(super) fn build(
        pairs: impl Iterator<Item = (PairGeometry, T)>,
        min: f32,
        edge: f32,
    ) -> Self {
        let mut keyed = Vec::new();
        let mut n_distances = 1;
        for (geometry, entry) in pairs.filter(|(geometry, _)| geometry.distance >= min) {
            let bin = ((geometry.distance - min) / edge) as usize;
            n_distances = n_distances.max(bin + 1);
            keyed.push((Self::cell(bin, geometry.cosines), entry));
        }
        keyed.sort_unstable();
        let n_cells = n_distances * N_COSINES.pow(3);
        let mut starts = vec![0; n_cells + 1];
        for (cell, _) in &keyed {
            starts[*cell as usize + 1] += 1;
        }
        for cell in 0..n_cells {
            starts[cell + 1] += starts[cell];
        }
        let entries = keyed.into_iter().map(|(_, entry)| entry).collect();
        Self { min, edge, n_distances, starts, entries }
    }

    /// Calls `found` with every entry whose cell may hold pairs within `tolerance` of the query,
    /// then with those for the reversed query, with `true` as second argument.
    #[inline]
    pub(super) fn visit(
        &self,
        query: PairGeometry,
        tolerance: PairTolerance,
        mut found: impl FnMut(T, bool),
    ) {
        let mut rows = Vec::with_capacity(128);
        for (query, is_reversed) in [(query, false), (query.reversed(), true)] {
            self.rows(query, tolerance, |row| rows.push((row, is_reversed)));
        }
        // A single call of `found`, so that it is inlined into this loop.
        for (row, is_reversed) in rows {
            self.entries[row].iter().for_each(|entry| found(*entry, is_reversed));
        }
    }

    /// Calls `row` with each range of entries of neighbouring cells.
    fn rows(
        &self,
        query: PairGeometry,
        tolerance: PairTolerance,
        mut row: impl FnMut(Range<usize>),
    ) {
        let low = (query.distance - tolerance.distance - self.min) / self.edge;
        let high = (query.distance + tolerance.distance - self.min) / self.edge;
        if high < 0.0 {
            return;
        }
        let last_distance = (high as usize).min(self.n_distances - 1);
        let [first, second, between] = query
            .cosines
            .map(|c| [c - tolerance.cosine, c + tolerance.cosine].map(Self::cosine_bin));
        for distance in low.max(0.0) as usize..=last_distance {
            for a in first[0]..=first[1] {
                for b in second[0]..=second[1] {
                    let cell = ((distance * N_COSINES + a) * N_COSINES + b) * N_COSINES;
                    let from = self.starts[cell + between[0]] as usize;
                    let to = self.starts[cell + between[1] + 1] as usize;
                    if from < to {
                        row(from..to);
                    }
                }
            }
        }
    }

    /// Number of entries.
    pub(super) fn len(&self) -> usize {
        self.entries.len()
    }

    /// Bytes in memory.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.starts.as_slice()) + size_of_val(self.entries.as_slice())
    }

    fn cosine_bin(cosine: f32) -> usize {
        // Below −1 the cast saturates at 0.
        ((0.5 * (cosine + 1.0) * N_COSINES as f32) as usize).min(N_COSINES - 1)
    }

    fn cell(distance: usize, cosines: [f32; 3]) -> u32 {
        let [a, b, between] = cosines.map(Self::cosine_bin);
        (((distance * N_COSINES + a) * N_COSINES + b) * N_COSINES + between) as u32
    }
}
