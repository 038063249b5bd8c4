//! Random objects assembled from simple bodies, for catalogues of any size.
//!
//! Two to five boxes, cylinders, ellipsoids, rings, turned bodies and star-shaped prisms; each
//! has its middle on the surface of an earlier one, and half of the objects are drilled through.
//! An object is redrawn until it is connected. Lengths in millimetres, as in `field`.

use std::f64::consts::TAU;

use glam::{DMat3, DVec2, DVec3};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;

use super::field::{blend, cuboid, cylinder, ellipsoid, extruded, lathe, polygon, torus, without};
use super::{LARGEST_DIMENSION, surface_nets};
use crate::mesh::Mesh;

/// Side of the grid's cells.
const CELL: f64 = 1.2;
/// A length beyond any part.
const REACH: f64 = 100.0;
/// Maximum draws of one object until it is connected; more than any needs.
const DRAWS_MAX: u64 = 64;

/// A simple body about its own middle.
enum Kind {
    Cuboid { half: DVec3, rounding: f64 },
    Cylinder { radius: f64, half_height: f64 },
    Ellipsoid { half: DVec3 },
    Ring { radius: f64, tube: f64 },
    Turned { profile: Vec<(f64, f64)> },
    Star { corners: Vec<(f64, f64)>, half_height: f64 },
}

/// A body and its position.
struct Part {
    kind: Kind,
    middle: DVec3,
    part_from_object: DMat3,
}

/// A random object.
struct Assembly {
    parts: Vec<Part>,
    drill: Option<Part>,
    fillet: f64,
}

impl Kind {
    fn draw(stream: &mut Stream) -> Self {
        let which = stream.index(6);
        let mut length = |low, high| stream.uniform(low, high);
        match which {
            0 => {
                let half = DVec3::new(length(4.0, 30.0), length(4.0, 20.0), length(3.0, 14.0));
                Self::Cuboid { half, rounding: length(0.3, 2.5) }
            }
            1 => Self::Cylinder { radius: length(3.5, 18.0), half_height: length(4.0, 32.0) },
            2 => {
                let half = DVec3::new(length(6.0, 28.0), length(6.0, 22.0), length(4.0, 16.0));
                Self::Ellipsoid { half }
            }
            3 => Self::Ring { radius: length(10.0, 26.0), tube: length(3.5, 7.0) },
            4 => {
                let height = length(14.0, 34.0);
                let mut profile = vec![(0.0, -height)];
                for step in 0..5 {
                    let z = height * (f64::from(step) / 2.0 - 1.0);
                    profile.push((length(4.0, 18.0), z));
                }
                profile.push((0.0, height));
                Self::Turned { profile }
            }
            _ => {
                let (outer, inner) = (length(12.0, 28.0), length(0.45, 0.95));
                let half_height = length(3.5, 12.0);
                let n = 3 + stream.index(5);
                let corner = |index: usize| {
                    let angle = TAU * index as f64 / (2 * n) as f64;
                    let radius = if index.is_multiple_of(2) { outer } else { inner * outer };
                    (radius * angle.cos(), radius * angle.sin())
                };
                Self::Star { corners: (0..2 * n).map(corner).collect(), half_height }
            }
        }
    }

    /// Signed distance in the body's own frame.
    fn distance(&self, at: DVec3) -> f64 {
        match self {
            Self::Cuboid { half, rounding } => cuboid(at, *half, *rounding),
            Self::Cylinder { radius, half_height } => cylinder(at, *radius, *half_height, 0.5),
            Self::Ellipsoid { half } => ellipsoid(at, *half),
            Self::Ring { radius, tube } => torus(at, *radius, *tube),
            Self::Turned { profile } => lathe(at, profile),
            Self::Star { corners, half_height } => {
                extruded(polygon(at.truncate(), corners), at.z, *half_height, 0.4)
            }
        }
    }

    /// Radius of a ball about the body's middle that contains it.
    fn radius(&self) -> f64 {
        match self {
            Self::Cuboid { half, .. } => half.length(),
            Self::Cylinder { radius, half_height } => radius.hypot(*half_height),
            Self::Ellipsoid { half } => half.max_element(),
            Self::Ring { radius, tube } => radius + tube,
            Self::Turned { profile } => {
                profile.iter().map(|(radius, z)| radius.hypot(*z)).fold(0.0, f64::max)
            }
            Self::Star { corners, half_height } => {
                corners.iter().map(|(x, y)| x.hypot(*y).hypot(*half_height)).fold(0.0, f64::max)
            }
        }
    }

    /// A point of the surface: the first one outwards from the middle line of the body.
    fn surface_point(&self, stream: &mut Stream) -> DVec3 {
        let direction = stream.direction();
        let start = match self {
            Self::Ring { radius, .. } => {
                (DVec2::from_angle(stream.uniform(0.0, TAU)) * *radius).extend(0.0)
            }
            _ => DVec3::ZERO,
        };
        let (mut inside, mut outside) = (0.0, REACH);
        while outside - inside > 0.1 {
            let middle = 0.5 * (inside + outside);
            if self.distance(start + middle * direction) < 0.0 {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        start + inside * direction
    }
}

impl Part {
    fn distance(&self, at: DVec3) -> f64 {
        self.kind.distance(self.part_from_object * (at - self.middle))
    }

    fn draw(kind: Kind, middle: DVec3, stream: &mut Stream) -> Self {
        let part_from_object = DMat3::from_quat(stream.rotation()).transpose();
        Self { kind, middle, part_from_object }
    }
}

impl Assembly {
    fn draw(stream: &mut Stream) -> Self {
        let n_parts = 2 + stream.index(4);
        let first = Kind::draw(stream);
        let mut parts = vec![Part::draw(first, DVec3::ZERO, stream)];
        while parts.len() < n_parts {
            let base = &parts[stream.index(parts.len())];
            let at = base.kind.surface_point(stream);
            let middle = base.middle + base.part_from_object.transpose() * at;
            let kind = Kind::draw(stream);
            parts.push(Part::draw(kind, middle, stream));
        }
        let drill = (stream.index(2) == 0).then(|| {
            let radius = stream.uniform(2.5, 6.0);
            let middle = parts[stream.index(parts.len())].middle;
            Part::draw(Kind::Cylinder { radius, half_height: REACH }, middle, stream)
        });
        Self { parts, drill, fillet: stream.uniform(0.2, 4.0) }
    }

    fn distance(&self, at: DVec3) -> f64 {
        let parts = self.parts.iter().map(|part| part.distance(at));
        let whole = parts.reduce(|a, b| blend(a, b, self.fillet)).unwrap_or(f64::INFINITY);
        self.drill.as_ref().map_or(whole, |drill| without(whole, drill.distance(at)))
    }

    /// The mesh; `None` when it is in pieces.
    fn mesh(&self) -> Option<Mesh> {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for part in &self.parts {
            let reach = DVec3::splat(part.kind.radius() + self.fillet + 2.0 * CELL);
            (low, high) = (low.min(part.middle - reach), high.max(part.middle + reach));
        }
        let (vertices, triangles) = surface_nets::mesh(|at| self.distance(at), low, high, CELL);
        let vertices: Vec<DVec3> = vertices.iter().map(|at| *at * MM).collect();
        if !is_one_piece(vertices.len(), &triangles) {
            return None;
        }
        Mesh::new(vertices, triangles).ok().filter(Mesh::is_watertight)
    }
}

/// The `index`-th random object of a seed: closed, its largest dimension that of the
/// examples, metres, its surface's centroid at the origin. Equal arguments give equal
/// objects; `None` when no draw is connected.
#[must_use]
pub fn assembled(seed: u64, index: u64) -> Option<Mesh> {
    let mut stream = Stream::new(seed, Purpose::Assembly, index);
    let mesh = (0..DRAWS_MAX).find_map(|_| Assembly::draw(&mut stream).mesh())?;
    let mesh = mesh.scaled_to_largest_dimension(LARGEST_DIMENSION);
    let centroid = mesh.centroid();
    Some(mesh.translated(-centroid))
}

/// Whether triangles connect all of at least one vertex.
fn is_one_piece(n_vertices: usize, triangles: &[[u32; 3]]) -> bool {
    let mut parents: Vec<usize> = (0..n_vertices).collect();
    let mut n_pieces = n_vertices;
    for [a, b, c] in triangles {
        for (one, other) in [(a, b), (b, c)] {
            let (one, other) = (root(&mut parents, *one), root(&mut parents, *other));
            if one != other {
                parents[one] = other;
                n_pieces -= 1;
            }
        }
    }
    n_pieces == 1
}

/// The piece that a vertex belongs to.
fn root(parents: &mut [usize], vertex: u32) -> usize {
    let mut at = vertex as usize;
    while parents[at] != at {
        parents[at] = parents[parents[at]];
        at = parents[at];
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_closed_connected_and_of_example_size() {
        for index in 0..6 {
            let mesh = assembled(101, index).unwrap();
            assert!(mesh.is_watertight(), "{index}");
            assert!(mesh.signed_volume() > 0.0, "{index}");
            assert!((mesh.largest_dimension() / LARGEST_DIMENSION - 1.0).abs() < 1e-9);
            assert!(mesh.centroid().length() < 1e-9);
            assert!(is_one_piece(mesh.vertices().len(), mesh.triangles()));
        }
    }

    #[test]
    fn objects_depend_on_their_arguments_alone() {
        assert_eq!(assembled(101, 1), assembled(101, 1));
        assert_ne!(assembled(101, 1), assembled(101, 2));
        assert_ne!(assembled(101, 1), assembled(102, 1));
    }

    #[test]
    fn two_triangles_apart_are_two_pieces() {
        assert!(is_one_piece(4, &[[0, 1, 2], [2, 1, 3]]));
        assert!(!is_one_piece(6, &[[0, 1, 2], [3, 4, 5]]));
        assert!(!is_one_piece(4, &[[0, 1, 2]]), "a vertex of no triangle");
    }

    #[test]
    fn a_part_sits_on_the_surface_of_another() {
        let mut stream = Stream::new(1, Purpose::Assembly, 0);
        for _ in 0..30 {
            let kind = Kind::draw(&mut stream);
            let point = kind.surface_point(&mut stream);
            let distance = kind.distance(point);
            assert!(distance.abs() < 0.2, "{distance}");
            assert!(point.length() < kind.radius() + 0.2, "{point}");
        }
    }
}
