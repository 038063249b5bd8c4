//! Pairs of touches by their geometry: where an observed pair may lie on an object.
//!
//! Source: the hash multimap of section 5.3 with another key: distance and three cosines (the
//! first normal, the second normal and each other's) after Drost et al. (2010), because a pair
//! fixes the pose in closed form when both normals are known. Each unordered pair is stored
//! once; a query asks for both orders.

use glam::Vec3;

/// Cosines are cut into this many equal bins.
const N_COSINES: usize = 8;

/// The most distance bins: of objects beyond about a metre the bins are wider than asked for.
const N_DISTANCES_MAX: f32 = 512.0;

/// An ordered pair's geometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairGeometry {
    /// Distance of the two touches, metres.
    pub distance: f32,
    /// Cosines: first normal with the axis (from first to second), second normal with the
    /// axis, the two normals with each other.
    pub cosines: [f32; 3],
    /// (first normal × second normal) · axis: tells a pair from its mirror image.
    pub chirality: f32,
}

impl PairGeometry {
    /// The geometry of two places; `None` for one and the same.
    #[must_use]
    pub fn new(a: (Vec3, Vec3), b: (Vec3, Vec3)) -> Option<Self> {
        let axis = b.0 - a.0;
        let distance = axis.length();
        if distance < 1e-6 {
            return None;
        }
        let axis = axis / distance;
        Some(Self {
            distance,
            cosines: [a.1.dot(axis), b.1.dot(axis), a.1.dot(b.1)],
            chirality: a.1.cross(b.1).dot(axis),
        })
    }

    /// The same pair seen from its other end.
    #[must_use]
    pub fn reversed(self) -> Self {
        let [first, second, between] = self.cosines;
        // Axis and order of the normals both turn: the triple product stays.
        Self { cosines: [-second, -first, between], ..self }
    }
}

/// How far a stored pair may be from an observed one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairTolerance {
    /// Difference of distances, metres.
    pub distance: f32,
    /// Difference of each cosine and of the chirality.
    pub cosine: f32,
}

/// The pairs of one object.
#[derive(Clone, Debug, PartialEq)]
pub struct PairTable {
    min: f32,
    edge: f32,
    n_distances: usize,
    /// Where each cell's pairs begin; one more than there are cells.
    starts: Vec<u32>,
    pairs: Vec<[u16; 2]>,
}

impl PairTable {
    /// Tables all pairs of `places` at least `min` metres apart, in distance bins of `edge` m,
    /// or wider ones for objects that would need too many.
    #[must_use]
    pub fn build(places: &[(Vec3, Vec3)], min: f32, edge: f32) -> Self {
        let low = places.iter().map(|place| place.0).fold(Vec3::INFINITY, Vec3::min);
        let high = places.iter().map(|place| place.0).fold(Vec3::NEG_INFINITY, Vec3::max);
        let edge = edge.max(low.distance(high) / N_DISTANCES_MAX);
        let mut keyed = Vec::new();
        let mut n_distances = 1;
        for (first, a) in places.iter().enumerate() {
            for (second, b) in places.iter().enumerate().skip(first + 1) {
                let Some(geometry) = PairGeometry::new(*a, *b) else { continue };
                if geometry.distance < min {
                    continue;
                }
                let bin = ((geometry.distance - min) / edge) as usize;
                n_distances = n_distances.max(bin + 1);
                keyed.push((cell(bin, geometry.cosines), [second as u16, first as u16]));
            }
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
        let pairs = keyed.into_iter().map(|(_, [second, first])| [first, second]).collect();
        Self { min, edge, n_distances, starts, pairs }
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
        self.one_order(query, tolerance, |[first, second]| found(first, second));
        self.one_order(query.reversed(), tolerance, |[first, second]| found(second, first));
    }

    fn one_order(
        &self,
        query: PairGeometry,
        tolerance: PairTolerance,
        mut found: impl FnMut([u16; 2]),
    ) {
        let low = (query.distance - tolerance.distance - self.min) / self.edge;
        let high = (query.distance + tolerance.distance - self.min) / self.edge;
        if high < 0.0 {
            return;
        }
        let last_distance = (high as usize).min(self.n_distances - 1);
        let [first, second, between] = query
            .cosines
            .map(|c| (cosine_bin(c - tolerance.cosine), cosine_bin(c + tolerance.cosine)));
        for distance in low.max(0.0) as usize..=last_distance {
            for a in first.0..=first.1 {
                for b in second.0..=second.1 {
                    let row = ((distance * N_COSINES + a) * N_COSINES + b) * N_COSINES;
                    let from = self.starts[row + between.0] as usize;
                    let to = self.starts[row + between.1 + 1] as usize;
                    self.pairs[from..to].iter().for_each(|pair| found(*pair));
                }
            }
        }
    }

    /// How many pairs there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// True when there is no pair.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// Bytes in memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.starts.as_slice()) + size_of_val(self.pairs.as_slice())
    }
}

fn cosine_bin(cosine: f32) -> usize {
    // Below −1 the cast saturates at 0.
    ((0.5 * (cosine + 1.0) * N_COSINES as f32) as usize).min(N_COSINES - 1)
}

fn cell(distance: usize, cosines: [f32; 3]) -> u32 {
    let [a, b, between] = cosines.map(cosine_bin);
    (((distance * N_COSINES + a) * N_COSINES + b) * N_COSINES + between) as u32
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::rng::{Purpose, Stream};

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
    fn geometry_of_a_pair_by_hand() {
        // 3 mm along z; normals x, and halfway between y and z (0.8, 0.6).
        let a = (Vec3::ZERO, Vec3::X);
        let b = (Vec3::new(0.0, 0.0, 0.003), Vec3::new(0.0, 0.8, 0.6));
        let geometry = PairGeometry::new(a, b).unwrap();
        assert!((geometry.distance - 0.003).abs() < 1e-9);
        // x · z = 0, (0, .8, .6) · z = 0.6, x · (0, .8, .6) = 0; (x × b) · z = 0.8.
        let [first, second, between] = geometry.cosines;
        assert!(first.abs() < 1e-6 && (second - 0.6).abs() < 1e-6 && between.abs() < 1e-6);
        assert!((geometry.chirality - 0.8).abs() < 1e-6);
        // In the mirror (y → −y) only the chirality differs.
        let mirrored = (b.0, Vec3::new(0.0, -0.8, 0.6));
        let mirrored = PairGeometry::new(a, mirrored).unwrap();
        assert!((mirrored.chirality + 0.8).abs() < 1e-6);
        assert_eq!(mirrored.cosines[1].to_bits(), geometry.cosines[1].to_bits());
        assert_eq!(PairGeometry::new(a, (Vec3::ZERO, Vec3::Y)), None);
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
    fn every_pair_within_tolerance_is_found_in_the_order_of_the_query() {
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
