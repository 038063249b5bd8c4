//! What is remarkable about a body that was read: what a person should look at before training.

use std::fmt;

pub use palpate_core::plausible::{SIZE_LARGE, SIZE_SMALL};
use palpate_core::units::{INCH, MM, Shown};

use super::Mesh;

/// Something remarkable about a body.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshRemark {
    /// It is larger than [`SIZE_LARGE`] or smaller than [`SIZE_SMALL`].
    Size {
        /// The largest dimension, metres.
        size: f64,
        /// The metres in one unit by which the file was read.
        unit: f64,
    },
    /// Its coordinates are so large that rounding changes its shape.
    Far {
        /// The largest coordinate, metres.
        distance: f64,
        /// The rounding there, metres.
        rounding: f64,
    },
    /// Polygons with the same corners as others; one of each was kept.
    Repeated {
        /// Number of polygons that were left out.
        n: usize,
    },
    /// Polygons that cross themselves, or are too winding to be cut.
    Crossing {
        /// Their number.
        n: usize,
    },
    /// Edges with one triangle.
    Open {
        /// Their number.
        n: usize,
    },
    /// Edges with more than two triangles.
    Crowded {
        /// Their number.
        n: usize,
    },
    /// Triangles that face the other way than their neighbours.
    Turned {
        /// Their number.
        n: usize,
        /// The number of all triangles.
        of: usize,
    },
    /// A closed body whose triangles face inwards.
    InsideOut,
}

impl fmt::Display for MeshRemark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Size { size, unit } => {
                if size > SIZE_LARGE {
                    write!(f, "the mesh is {} m large", Shown(size))?;
                } else {
                    write!(f, "the mesh is {} mm small", Shown(size / MM))?;
                }
                for (number, (name, size)) in likely_units(size / unit).enumerate() {
                    let word = if number == 0 { ": is the file in" } else { " or" };
                    write!(f, "{word} {name} ({} mm)", Shown((size / MM * 10.0).round() / 10.0))?;
                }
                let is_asked = likely_units(size / unit).next().is_some();
                f.write_str(if is_asked { "?" } else { "" })
            }
            Self::Far { distance, rounding } => write!(
                f,
                "coordinates reach {} m, where numbers are rounded to {} mm: move the object to \
                 the origin before it is exported",
                Shown(distance),
                Shown(rounding / MM)
            ),
            Self::Repeated { n } => write!(f, "{n} polygons came more than once, and count once"),
            Self::Crossing { n } => {
                write!(f, "{n} polygons cross themselves: export triangles, or look at the picture")
            }
            Self::Open { n } => {
                write!(
                    f,
                    "the mesh is not watertight: {n} edges have one triangle (holes or seams)"
                )
            }
            Self::Crowded { n } => write!(
                f,
                "the mesh is not watertight: {n} edges have more than two triangles (parts that \
                 touch, or walls inside)"
            ),
            Self::Turned { n, of } => write!(
                f,
                "{n} of {of} triangles face the other way than their neighbors: let the program \
                 that made the mesh turn all outwards"
            ),
            Self::InsideOut => {
                write!(f, "all triangles face inwards: they are pressed turned around")
            }
        }
    }
}

/// Units in which a largest dimension, in the file's unit, is an object's usual size.
fn likely_units(size: f64) -> impl Iterator<Item = (&'static str, f64)> {
    [("mm", MM), ("cm", 10.0 * MM), ("in", INCH), ("m", 1.0)]
        .into_iter()
        .map(move |(name, unit)| (name, size * unit))
        .filter(|(_, size)| (SIZE_SMALL..=SIZE_LARGE).contains(size))
}

impl Mesh {
    /// What is remarkable about the size, read by `unit` metres, and the surface.
    #[must_use]
    pub fn remarks(&self, unit: f64) -> Vec<MeshRemark> {
        let mut remarks = Vec::new();
        let size = self.largest_dimension();
        if !(SIZE_SMALL..=SIZE_LARGE).contains(&size) {
            remarks.push(MeshRemark::Size { size, unit });
        }
        let edges = Edges::of(self);
        let found = [
            (edges.n_open, MeshRemark::Open { n: edges.n_open }),
            (edges.n_crowded, MeshRemark::Crowded { n: edges.n_crowded }),
            (edges.n_turned, MeshRemark::Turned { n: edges.n_turned, of: self.triangles.len() }),
        ];
        remarks.extend(found.into_iter().filter(|(n, _)| *n > 0).map(|(_, remark)| remark));
        if self.is_watertight() && self.signed_volume() < 0.0 {
            remarks.push(MeshRemark::InsideOut);
        }
        remarks
    }
}

/// Numbers of edges and triangles that a good surface has not.
struct Edges {
    n_open: usize,
    n_crowded: usize,
    n_turned: usize,
}

impl Edges {
    fn of(mesh: &Mesh) -> Self {
        // Lower vertex, higher vertex, triangle, and whether it runs from low to high.
        let mut edges: Vec<(u32, u32, u32, bool)> = Vec::with_capacity(3 * mesh.triangles.len());
        for (triangle, &[a, b, c]) in mesh.triangles.iter().enumerate() {
            let sides = [(a, b), (b, c), (c, a)];
            edges.extend(sides.map(|(a, b)| (a.min(b), a.max(b), triangle as u32, a < b)));
        }
        edges.sort_unstable();
        let (mut n_open, mut n_crowded) = (0, 0);
        let mut sides = Sides::new(mesh.triangles.len());
        let mut n_against = 0;
        for edge in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            match edge {
                [_] => n_open += 1,
                [(.., one, runs_up), (.., other, other_runs_up)] => {
                    let against = runs_up == other_runs_up;
                    n_against += usize::from(against);
                    sides.join(*one, *other, against);
                }
                _ => n_crowded += 1,
            }
        }
        let n_turned = if n_against == 0 { 0 } else { sides.n_in_minority() };
        Self { n_open, n_crowded, n_turned }
    }
}

/// Triangles joined by edges, each with its side relative to its group's root.
struct Sides {
    parents: Vec<(u32, bool)>,
}

impl Sides {
    fn new(n: usize) -> Self {
        Self { parents: (0..n as u32).map(|triangle| (triangle, false)).collect() }
    }

    /// The root of a triangle's group, and whether the triangle is turned against it.
    fn root(&mut self, triangle: u32) -> (u32, bool) {
        let (mut at, mut turned) = (triangle, false);
        while self.parents[at as usize].0 != at {
            let (parent, side) = self.parents[at as usize];
            let (grand, parents_side) = self.parents[parent as usize];
            // Halves the path: the next search is shorter.
            self.parents[at as usize] = (grand, side ^ parents_side);
            turned ^= side ^ parents_side;
            at = grand;
        }
        (at, turned)
    }

    fn join(&mut self, one: u32, other: u32, against: bool) {
        let ((root, side), (other_root, other_side)) = (self.root(one), self.root(other));
        if root != other_root {
            let (low, high) = (root.min(other_root), root.max(other_root));
            self.parents[high as usize] = (low, side ^ other_side ^ against);
        }
    }

    /// Number of triangles on the rarer side of their group.
    fn n_in_minority(&mut self) -> usize {
        let n = self.parents.len();
        let mut counts = vec![[0_u32; 2]; n];
        for triangle in 0..n as u32 {
            let (root, turned) = self.root(triangle);
            counts[root as usize][usize::from(turned)] += 1;
        }
        counts.iter().map(|[one, other]| (*one).min(*other) as usize).sum()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::mesh::tests_support::cuboid;

    #[track_caller]
    fn check(triangles: Vec<[u32; 3]>, expected: &[MeshRemark]) {
        let mesh = Mesh::new(cuboid(DVec3::splat(0.05)).vertices().to_vec(), triangles).unwrap();
        assert_eq!(mesh.remarks(1e-3), expected);
    }

    #[test]
    fn a_surface_is_described_by_what_is_wrong_with_it() {
        let good = cuboid(DVec3::splat(0.05)).triangles().to_vec();
        check(good.clone(), &[]);
        check(good[1..].to_vec(), &[MeshRemark::Open { n: 3 }]);
        let mut turned = good.clone();
        turned[..2].iter_mut().for_each(|triangle| triangle.swap(0, 1));
        check(turned, &[MeshRemark::Turned { n: 2, of: 12 }]);
        check(cuboid(DVec3::ONE).inside_out().triangles().to_vec(), &[MeshRemark::InsideOut]);
        let inside = [good.clone(), vec![[0, 7, 3]]].concat();
        assert!(matches!(
            Mesh::new(cuboid(DVec3::splat(0.05)).vertices().to_vec(), inside).unwrap().remarks(1.0)
                [..],
            [MeshRemark::Open { .. }, MeshRemark::Crowded { .. }, ..]
        ));
    }

    #[test]
    fn sizes_name_the_units_that_would_be_usual() {
        let text = |size, unit| MeshRemark::Size { size, unit }.to_string();
        assert_eq!(
            text(0.0031, 1e-3),
            "the mesh is 3.1 mm small: is the file in cm (31 mm) or in (78.7 mm)?"
        );
        assert_eq!(
            text(80.0, 1.0),
            "the mesh is 80 m large: is the file in mm (80 mm) or cm (800 mm)?"
        );
        assert_eq!(text(3e-9, 1e-3), "the mesh is 3e-6 mm small");
    }
}
