//! Pairs of touches by their geometry: where an observed pair may lie on an object.
//!
//! Source: the hash multimap of section 5.3 with another key: distance and three cosines (the
//! first normal, the second normal and each other's) after Drost et al. (2010), because a pair
//! fixes the pose in closed form when both normals are known. Each unordered pair is stored
//! once; a query asks for both orders.

use glam::Vec3;

/// Cosines are cut into this many equal bins.
const N_COSINES: usize = 8;

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
    /// Tables all pairs of `places` at least `min` metres apart, in distance bins of `edge` m.
    #[must_use]
    pub fn build(places: &[(Vec3, Vec3)], min: f32, edge: f32) -> Self {
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
