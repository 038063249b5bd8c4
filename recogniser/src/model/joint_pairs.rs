//! The joint pair table: pairs of patches of all objects of a catalogue in one table.
//!
//! Source: section 5.3 keeps the pairs of all objects in one hash multimap. Here the table holds
//! the pairs of the first touches of each map, which cover its surface evenly and suffice to
//! estimate the density of an object's pairs about a geometry. Each object's own
//! [`super::pair_table::PairTable`] holds them all.

use std::ops::Range;
use std::sync::Arc;

use super::facet::Facet;
use super::features::Features;
use super::map::SurfaceMap;
use super::pair_cells::{N_DISTANCES_MAX, PairCells};
use super::pair_geometry::PairGeometry;
use crate::options::PairTolerance;

/// Patches of an object whose pairs are tabled; an index fits into one byte.
pub const TOUCHES_PER_OBJECT: usize = 128;

/// Objects that share a table; an index fits into one byte. Tables are looked up in parallel.
pub const OBJECTS_PER_TABLE: usize = 64;

/// Number of equal bins of a cosine, finer than in the table of one object, since a table has
/// the pairs of many.
const N_COSINES: usize = 16;

/// The pairs of the first touches of all objects.
#[derive(Clone, Debug, PartialEq)]
pub struct JointPairs {
    tables: Vec<JointTable>,
}

/// The pairs of the first touches of some objects.
#[derive(Clone, Debug, PartialEq)]
pub struct JointTable {
    cells: PairCells<JointPair, N_COSINES>,
    facets: Vec<Facet>,
    features: Features,
    /// Index of each object's first patch, and the total at the end.
    starts: Vec<u32>,
}

/// A pair of one object's touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct JointPair {
    object: u8,
    first: u8,
    second: u8,
}

impl JointPairs {
    /// Tables the pairs of the maps.
    #[must_use]
    pub fn build(maps: &[Arc<SurfaceMap>]) -> Self {
        let tables = maps.chunks(OBJECTS_PER_TABLE).map(JointTable::build).collect();
        Self { tables }
    }

    /// The tables: objects in the order of the maps, the first ones in the first table.
    #[must_use]
    pub fn tables(&self) -> &[JointTable] {
        &self.tables
    }

    /// Bytes in memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let bytes = |table: &JointTable| {
            table.cells.bytes()
                + size_of_val(table.facets.as_slice())
                + table.features.bytes()
                + size_of_val(table.starts.as_slice())
        };
        self.tables.iter().map(bytes).sum()
    }
}

impl JointTable {
    fn build(maps: &[Arc<SurfaceMap>]) -> Self {
        let (mut facets, mut starts) = (Vec::new(), vec![0]);
        let (mut min, mut edge) = (f32::INFINITY, f32::INFINITY);
        for map in maps {
            facets.extend(map.facets().iter().take(TOUCHES_PER_OBJECT).copied());
            starts.push(facets.len() as u32);
            min = min.min(map.layout().pair_distance_min);
            edge = edge.min(map.layout().pair_distance_edge);
        }
        let farthest =
            facets.iter().map(|facet: &Facet| facet.position.length()).fold(0.0, f32::max);
        let edge = edge.max(2.0 * farthest / N_DISTANCES_MAX);
        let objects = starts.windows(2).map(|bounds| &facets[range(bounds)]).enumerate();
        let pairs = objects.flat_map(|(object, facets)| {
            let pair = move |first: usize, second: usize| {
                let [a, b] = [&facets[first], &facets[second]];
                let geometry = PairGeometry::new((a.position, a.normal), (b.position, b.normal))?;
                let (first, second) = (first as u8, second as u8);
                Some((geometry, JointPair { object: object as u8, first, second }))
            };
            let n = facets.len();
            (0..n).flat_map(move |a| (a + 1..n).filter_map(move |b| pair(a, b)))
        });
        let cells = PairCells::build(pairs, min, edge);
        let features = Features::new(facets.iter().map(|facet| &facet.feature));
        Self { cells, facets, features, starts }
    }

    /// Features of the tabled patches.
    #[must_use]
    pub fn features(&self) -> &Features {
        &self.features
    }

    /// Range of an object's tabled patches.
    #[must_use]
    pub fn touches(&self, object: usize) -> Range<usize> {
        range(&self.starts[object..object + 2])
    }

    /// Calls `visited` with the object (from 0 in this table) of every stored pair that may be
    /// within `tolerance` of the query, and the indices of its two tabled touches, in the
    /// query's order. The caller compares the geometry ([`Self::pair`]) itself.
    #[inline]
    pub fn matches(
        &self,
        query: PairGeometry,
        tolerance: PairTolerance,
        mut visited: impl FnMut(usize, [usize; 2]),
    ) {
        self.cells.visit(query, tolerance, |pair, is_reversed| {
            let object = usize::from(pair.object);
            let start = self.starts[object] as usize;
            let [first, second] = [pair.first, pair.second].map(|index| start + usize::from(index));
            visited(object, if is_reversed { [second, first] } else { [first, second] });
        });
    }

    /// Two of the tabled touches, and their geometry; `None` when they are at one place.
    #[inline]
    #[must_use]
    pub fn pair(&self, touches: [usize; 2]) -> Option<([&Facet; 2], PairGeometry)> {
        let [a, b] = touches.map(|touch| &self.facets[touch]);
        let geometry = PairGeometry::new((a.position, a.normal), (b.position, b.normal))?;
        Some(([a, b], geometry))
    }

    /// Number of objects in this table.
    #[must_use]
    pub fn n_objects(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of ordered pairs of an object's tabled patches.
    #[must_use]
    pub fn n_pairs(&self, object: usize) -> usize {
        let n = self.touches(object).len();
        n * n.saturating_sub(1)
    }
}

fn range(bounds: &[u32]) -> Range<usize> {
    bounds[0] as usize..bounds[1] as usize
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use glam::{DVec3, Vec3};

    use super::*;
    use crate::model::SurfacePatch;
    use crate::model::map::SurfaceLayout;
    use palpate_core::rng::{Purpose, Stream};

    const TOLERANCE: PairTolerance = PairTolerance { distance: 0.002_5, cosine: 0.22 };

    /// An object of `n` touches at random.
    fn map(n: usize, index: u64) -> Arc<SurfaceMap> {
        let mut stream = Stream::new(1, Purpose::Shape, index);
        let mut patch = || SurfacePatch {
            position: (stream.uniform(0.0, 0.04) * stream.direction()).as_vec3(),
            normal: stream.direction().as_vec3(),
            direction: Vec3::X,
            elongation: 0.0,
            normal_deviation: 0.1,
            feature: [0; 8],
        };
        let patches = (0..n).map(|_| patch()).collect();
        Arc::new(SurfaceMap::new(DVec3::ZERO, patches, SurfaceLayout::default()))
    }

    /// Objects and pairs (as positions) within the tolerance of a query.
    type Pairs = BTreeSet<(usize, [u32; 2])>;

    fn is_within(query: &PairGeometry, stored: &PairGeometry) -> bool {
        let cosines = query.cosines.iter().zip(&stored.cosines);
        (query.distance - stored.distance).abs() < TOLERANCE.distance
            && cosines.into_iter().all(|(a, b)| (a - b).abs() < TOLERANCE.cosine)
    }

    fn named(object: usize, positions: [Vec3; 2]) -> (usize, [u32; 2]) {
        (object, positions.map(|position| position.x.to_bits()))
    }

    /// Pairs that the table returns, filtered to those within the tolerance.
    fn found(table: &JointTable, query: PairGeometry) -> Pairs {
        let mut pairs = Pairs::new();
        table.matches(query, TOLERANCE, |object, touches| {
            assert!(touches.iter().all(|touch| table.touches(object).contains(touch)));
            let (patches, stored) = table.pair(touches).unwrap();
            if is_within(&query, &stored) {
                assert!(
                    pairs.insert(named(object, patches.map(|patch| patch.position))),
                    "found twice"
                );
            }
        });
        pairs
    }

    fn place(patch: &SurfacePatch) -> (Vec3, Vec3) {
        (patch.position, patch.normal)
    }

    #[test]
    fn every_pair_of_every_object_is_found_in_query_order() {
        let maps = [map(30, 0), map(40, 1), map(20, 2)];
        let joint = JointPairs::build(&maps);
        let [table] = joint.tables() else { panic!("three objects share a table") };
        let mut n_found = 0;
        for first in 1..30 {
            let [a, b] = [&maps[0].patches()[0], &maps[0].patches()[first]];
            let query = PairGeometry::new(place(a), place(b)).unwrap();
            let mut expected = Pairs::new();
            for (object, map) in maps.iter().enumerate() {
                let patches = map.patches();
                for (a, b) in patches.iter().flat_map(|a| patches.iter().map(move |b| (a, b))) {
                    let Some(stored) = PairGeometry::new(place(a), place(b)) else { continue };
                    if stored.distance >= 0.004 && is_within(&query, &stored) {
                        expected.insert(named(object, [a.position, b.position]));
                    }
                }
            }
            assert_eq!(found(table, query), expected);
            n_found += expected.iter().filter(|(object, _)| *object == 1).count();
        }
        assert!(n_found > 10, "{n_found}");
    }

    #[test]
    fn only_the_first_touches_of_a_map_are_tabled() {
        let joint = JointPairs::build(&[map(200, 0), map(3, 1)]);
        let [table] = joint.tables() else { panic!("two objects share a table") };
        assert_eq!((table.n_objects(), table.n_pairs(0), table.n_pairs(1)), (2, 128 * 127, 6));
        // A pair is three bytes, and almost all of 128 touches lie at least 4 mm apart.
        assert!(table.cells.len() > 8_000 && table.cells.len() <= 128 * 127 / 2 + 3);
        assert_eq!(size_of::<JointPair>(), 3);
    }

    #[test]
    fn many_objects_have_several_tables() {
        let maps: Vec<Arc<SurfaceMap>> = (0..70).map(|index| map(4, index)).collect();
        let sizes: Vec<usize> =
            JointPairs::build(&maps).tables().iter().map(JointTable::n_objects).collect();
        assert_eq!(sizes, [64, 6]);
        assert!(JointPairs::build(&[]).tables().is_empty());
    }
}
