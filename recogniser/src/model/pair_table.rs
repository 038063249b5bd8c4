//! The pair table of one object, which finds the places of an observed pair on it.
//!
//! Each unordered pair is stored once; a query asks for both orders.

use glam::Vec3;

use super::pair_cells::{N_DISTANCES_MAX, PairCells};
use super::pair_geometry::PairGeometry;
use crate::options::PairTolerance;

/// Number of equal bins of a cosine.
const N_COSINES: usize = 8;

/// The pairs of one object.
#[derive(Clone, Debug, PartialEq)]
pub struct PairTable {
    cells: PairCells<Pair, N_COSINES>,
}

/// Two touches, the first before the second.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Pair {
    // Sorted by the second patch: the pairs of a shorter table come first in a cell.
    second: u16,
    first: u16,
}

impl PairTable {
    /// Tables all pairs of `places` at least `min` metres apart, in distance bins of `edge` m,
    /// or wider ones for objects that would need too many.
    #[must_use]
    pub fn build(places: &[(Vec3, Vec3)], min: f32, edge: f32) -> Self {
        let low = places.iter().map(|place| place.0).fold(Vec3::INFINITY, Vec3::min);
        let high = places.iter().map(|place| place.0).fold(Vec3::NEG_INFINITY, Vec3::max);
        let edge = edge.max(low.distance(high) / N_DISTANCES_MAX);
        let pairs = places.iter().enumerate().flat_map(|(first, a)| {
            let later = places.iter().enumerate().skip(first + 1);
            later.filter_map(move |(second, b)| {
                let pair = Pair { second: second as u16, first: first as u16 };
                Some((PairGeometry::new(*a, *b)?, pair))
            })
        });
        Self { cells: PairCells::build(pairs, min, edge) }
    }

    /// Calls `found` with every stored pair whose cell may hold pairs within `tolerance` of
    /// the query, in the query's order. The caller compares the geometry itself.
    #[inline]
    pub fn matches(
        &self,
        query: PairGeometry,
        tolerance: PairTolerance,
        mut found: impl FnMut(u16, u16),
    ) {
        self.cells.visit(query, tolerance, |Pair { first, second }, is_reversed| {
            let (first, second) = if is_reversed { (second, first) } else { (first, second) };
            found(first, second);
        });
    }

    /// Number of pairs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// True when there is no pair.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes in memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.cells.bytes()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use palpate_core::rng::{Purpose, Stream};

    const MIN: f32 = 0.004;
    const EDGE: f32 = 0.002;
    const TOLERANCE: PairTolerance = PairTolerance { distance: 0.002_5, cosine: 0.22 };

    fn places(n: usize) -> Vec<(Vec3, Vec3)> {
        let mut stream = Stream::new(1, Purpose::Shape, 0);
        let mut place = || {
            let position = stream.uniform(0.0, 0.04) * stream.direction();
            (position.as_vec3(), stream.direction().as_vec3())
        };
        (0..n).map(|_| place()).collect()
    }

    #[test]
    fn a_reversed_geometry_is_that_of_the_swapped_touches() {
        for pair in places(40).chunks_exact(2) {
            let reversed = PairGeometry::new(pair[0], pair[1]).unwrap().reversed();
            let swapped = PairGeometry::new(pair[1], pair[0]).unwrap();
            let differences = [
                (reversed.distance - swapped.distance) / EDGE,
                reversed.cosines[0] - swapped.cosines[0],
                reversed.cosines[1] - swapped.cosines[1],
                reversed.cosines[2] - swapped.cosines[2],
                reversed.chirality - swapped.chirality,
            ];
            assert!(differences.iter().all(|d| d.abs() < 1e-5), "{differences:?}");
        }
    }

    #[test]
    fn every_pair_within_tolerance_is_found_in_query_order() {
        let places = places(60);
        let table = PairTable::build(&places, MIN, EDGE);
        let ordered = || (0..places.len()).flat_map(|a| (0..places.len()).map(move |b| (a, b)));
        let geometry = |(a, b): (usize, usize)| PairGeometry::new(places[a], places[b]);
        let mut n_within = 0;
        for query in ordered().filter(|(a, b)| a != b).step_by(13) {
            let query = geometry(query).unwrap();
            let mut found = BTreeSet::new();
            table.matches(query, TOLERANCE, |a, b| {
                assert!(found.insert((usize::from(a), usize::from(b))), "found twice");
            });
            for pair in ordered() {
                let Some(stored) = geometry(pair) else { continue };
                let cosines = stored.cosines.iter().zip(&query.cosines);
                let within = (stored.distance - query.distance).abs() < TOLERANCE.distance
                    && cosines.into_iter().all(|(a, b)| (a - b).abs() < TOLERANCE.cosine);
                if within && stored.distance >= MIN {
                    assert!(found.contains(&pair), "{pair:?}");
                    n_within += 1;
                }
            }
        }
        assert!(n_within > 1_000, "{n_within}");
    }

    #[test]
    fn each_pair_is_stored_once_and_short_ones_are_not() {
        let at = |x: f32| (Vec3::new(x, 0.0, 0.0), Vec3::Z);
        // 3, 7 and 10 mm apart: one of the three is shorter than 4 mm.
        let table = PairTable::build(&[at(0.0), at(0.003), at(0.010)], MIN, EDGE);
        assert_eq!(table.len(), 2);
        assert!(PairTable::build(&[at(0.0)], MIN, EDGE).is_empty());
    }

    #[test]
    fn a_huge_object_takes_no_more_cells() {
        let far = [(Vec3::ZERO, Vec3::Z), (Vec3::new(1_000.0, 0.0, 0.0), Vec3::Z)];
        let table = PairTable::build(&far, MIN, EDGE);
        assert!(table.bytes() < 2_000_000, "{}", table.bytes());
        let mut found = Vec::new();
        let query = PairGeometry::new(far[1], far[0]).unwrap();
        table.matches(query, TOLERANCE, |a, b| found.push((a, b)));
        assert!(found.contains(&(1, 0)), "{found:?}");
    }
}
