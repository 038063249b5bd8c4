//! Families of shapes: smooth random warps of given meshes, for catalogues of any size.
//!
//! A member is its parent scaled along three random axes (each by 0.7 to 1.4), tapered, twisted
//! and bent along one of them, and scaled to its parent's size again. It is drawn anew until it
//! differs from its parent and all its siblings: the distances of 1,000 pairs of surface points,
//! which no rigid motion changes, differ by at least [`DIFFERENT`] (root of the mean square).

use std::collections::BTreeMap;

use anyhow::Context as _;
use glam::{DVec2, DVec3};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;
use palpate_sim::mesh::Mesh;

use crate::objects::TestObject;

/// Minimum difference between members of a family, for objects of 80 mm, metres; touches of one
/// place agree to a tenth of it.
pub const DIFFERENT: f64 = 2.0 * MM;

/// Maximum length of an edge as a share of the largest dimension. Meshes are refined to it
/// unless that takes too many triangles.
const EDGE_MAX: f64 = 0.08;
const TRIANGLES_MAX: usize = 30_000;

/// Pairs of points by which members are compared.
const PAIRS: usize = 1_000;

/// Maximum number of draws until a member differs.
const DRAWS_MAX: usize = 300;

/// A smooth deformation of the ball of radius ½ about the origin, free of folds.
struct Warp {
    axes: glam::DQuat,
    scale: DVec3,
    taper: f64,
    twist: f64,
    bend: f64,
}

impl Warp {
    fn draw(stream: &mut Stream) -> Self {
        let mut factor = || stream.uniform(-0.35, 0.35).exp();
        let scale = DVec3::new(factor(), factor(), factor());
        Self {
            axes: stream.rotation(),
            scale,
            taper: stream.uniform(-0.6, 0.6),
            twist: stream.uniform(-1.5, 1.5),
            bend: stream.uniform(-1.2, 1.2),
        }
    }

    /// The mesh warped, its largest dimension as before, its centroid at the origin.
    fn apply(&self, mesh: &Mesh) -> anyhow::Result<Mesh> {
        let center = mesh.centroid();
        let scaled = |at: &DVec3| self.axes.conjugate() * (*at - center) * self.scale;
        let scaled: Vec<DVec3> = mesh.vertices().iter().map(scaled).collect();
        let radius = scaled.iter().map(|at| at.length()).fold(f64::MIN_POSITIVE, f64::max);
        let warped = scaled.iter().map(|at| self.bent(self.twisted(*at / (2.0 * radius))));
        let warped = Mesh::new(warped.collect(), mesh.triangles().to_vec())
            .context("a warped mesh is no mesh")?;
        let warped = warped.scaled_to_largest_dimension(mesh.largest_dimension());
        Ok(warped.translated(-warped.centroid()))
    }

    fn twisted(&self, at: DVec3) -> DVec3 {
        let turned = DVec2::from_angle(self.twist * at.z).rotate(at.truncate());
        (turned * (1.0 + self.taper * at.z)).extend(at.z)
    }

    /// Lays the z axis onto an arc of curvature `bend`; 1 − bend · y stays positive.
    fn bent(&self, at: DVec3) -> DVec3 {
        if self.bend.abs() < 1e-6 {
            return at;
        }
        let (sin, cos) = (self.bend * at.z).sin_cos();
        let radius = self.bend.recip() - at.y;
        DVec3::new(at.x, self.bend.recip() - radius * cos, radius * sin)
    }
}

/// Iterator over the parents, then over members of their families in turn. Equal seeds give
/// equal objects. Only the parents' meshes are kept.
pub struct Families {
    parents: Vec<TestObject>,
    /// [`signature`]s of the members so far, one list a family.
    signatures: Vec<Vec<Vec<f64>>>,
    seed: u64,
    next: usize,
}

impl Families {
    /// Families of these parents.
    ///
    /// # Errors
    /// When a parent cannot be made of smaller triangles.
    pub fn new(parents: Vec<TestObject>, seed: u64) -> anyhow::Result<Self> {
        let own = |parent: &TestObject| Ok(vec![signature(&subdivided(&parent.mesh)?)]);
        let signatures = parents.iter().map(own).collect::<anyhow::Result<_>>()?;
        Ok(Self { parents, signatures, seed, next: 0 })
    }

    /// The same objects from the first on.
    ///
    /// # Errors
    /// As [`Families::new`].
    pub fn again(self) -> anyhow::Result<Self> {
        Self::new(self.parents, self.seed)
    }

    fn member(&mut self, index: usize) -> anyhow::Result<TestObject> {
        let (parent, generation) = (index % self.parents.len(), index / self.parents.len());
        let TestObject { name, mesh } = &self.parents[parent];
        let mesh = subdivided(mesh)?;
        let signatures = &mut self.signatures[parent];
        let mut stream = Stream::new(self.seed, Purpose::Shape, index as u64);
        let least = DIFFERENT / (80.0 * MM) * mesh.largest_dimension();
        for _draw in 0..DRAWS_MAX {
            let mesh = Warp::draw(&mut stream).apply(&mesh)?;
            let found = signature(&mesh);
            if signatures.iter().all(|known| difference(known, &found) >= least) {
                signatures.push(found);
                return Ok(TestObject { name: format!("{name}-{generation}"), mesh });
            }
        }
        anyhow::bail!("{name} has no new member");
    }
}

impl Iterator for Families {
    /// An object, or why a parent cannot be warped into something new.
    type Item = anyhow::Result<TestObject>;

    fn next(&mut self) -> Option<Self::Item> {
        let index = self.next;
        self.next += 1;
        match self.parents.get(index) {
            Some(TestObject { name, mesh }) => {
                Some(Ok(TestObject { name: name.clone(), mesh: mesh.clone() }))
            }
            None if self.parents.is_empty() => None,
            None => Some(self.member(index)),
        }
    }
}

/// Distances between pairs of vertices, the same pairs for all warps of a mesh, metres.
fn signature(mesh: &Mesh) -> Vec<f64> {
    let vertices = mesh.vertices();
    let mut stream = Stream::new(0, Purpose::Shape, vertices.len() as u64);
    let mut vertex = || vertices[stream.index(vertices.len())];
    (0..PAIRS).map(|_| vertex().distance(vertex())).collect()
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
    (squares.sum::<f64>() / a.len() as f64).sqrt()
}

/// The surface in smaller triangles, so that it can be warped.
fn subdivided(mesh: &Mesh) -> anyhow::Result<Mesh> {
    let longest_wanted = EDGE_MAX * mesh.largest_dimension();
    let mut mesh = mesh.clone();
    loop {
        let corners = (0..mesh.triangles().len()).map(|triangle| mesh.corners(triangle));
        let edges = corners.flat_map(|[a, b, c]| [a.distance(b), b.distance(c), c.distance(a)]);
        let longest = edges.fold(0.0, f64::max);
        if longest <= longest_wanted || 4 * mesh.triangles().len() > TRIANGLES_MAX {
            return Ok(mesh);
        }
        let mut vertices = mesh.vertices().to_vec();
        let mut middles: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                vertices.push(0.5 * (vertices[a as usize] + vertices[b as usize]));
                vertices.len() as u32 - 1
            })
        };
        let mut triangles = Vec::with_capacity(4 * mesh.triangles().len());
        for &[a, b, c] in mesh.triangles() {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        mesh = Mesh::new(vertices, triangles).context("a subdivided mesh is no mesh")?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects;
    use palpate_sim::shapes;

    fn built_in() -> Vec<TestObject> {
        objects::generated(&shapes::NAMES, shapes::LARGEST_DIMENSION).unwrap()
    }

    fn families(parents: Vec<TestObject>, n: usize, seed: u64) -> anyhow::Result<Vec<TestObject>> {
        Families::new(parents, seed)?.take(n).collect()
    }

    #[test]
    fn members_are_closed_new_and_as_large_as_their_parents() {
        let parents: Vec<TestObject> = built_in().into_iter().take(2).collect();
        let volumes: Vec<f64> = parents.iter().map(|p| p.mesh.signed_volume()).collect();
        let found = families(parents, 8, 101).unwrap();
        assert_eq!(found.len(), 8);
        assert!(found[2].name.ends_with("-1") && found[7].name.ends_with("-3"));
        for (index, object) in found.iter().enumerate() {
            assert!((object.mesh.largest_dimension() / (80.0 * MM) - 1.0).abs() < 1e-9);
            assert!(object.mesh.is_watertight(), "{}", object.name);
            // Never inside out, nor crushed.
            let share = object.mesh.signed_volume() / volumes[index % 2];
            assert!((0.1..10.0).contains(&share), "{}: {share}", object.name);
            for other in &found[..index] {
                assert_ne!(other.name, object.name);
            }
        }
        for family in [[2, 4, 6], [3, 5, 7]] {
            let of = |index: usize| signature(&found[index].mesh);
            let [a, b, c] = family.map(of);
            assert!(
                difference(&a, &b).min(difference(&b, &c)).min(difference(&a, &c)) >= DIFFERENT
            );
        }
    }

    #[test]
    fn a_thin_parent_has_a_large_family_too() {
        let is_thin = |object: &TestObject| object.name == "screwdriver";
        let parent = built_in().into_iter().find(is_thin).unwrap();
        let found = families(vec![parent], 16, 101).unwrap();
        assert_eq!(found.len(), 16);
        let shapes: Vec<_> = found.iter().skip(1).map(|one| signature(&one.mesh)).collect();
        for (index, shape) in shapes.iter().enumerate() {
            assert!(shapes[..index].iter().all(|other| difference(shape, other) >= DIFFERENT));
        }
    }

    #[test]
    fn fewer_objects_are_the_first_of_more() {
        let parents = || built_in().into_iter().take(1).collect();
        let (few, more) = (families(parents(), 2, 7).unwrap(), families(parents(), 3, 7).unwrap());
        assert_eq!(few[1].mesh, more[1].mesh);
        assert!(few[1].mesh != families(parents(), 2, 8).unwrap()[1].mesh, "another seed");
        let mut twice = Families::new(parents(), 7).unwrap();
        assert!(twice.by_ref().take(3).all(|object| object.is_ok()));
        assert_eq!(twice.again().unwrap().nth(1).unwrap().unwrap().mesh, few[1].mesh);
    }

    #[test]
    fn a_subdivided_mesh_is_the_same_surface() {
        let mesh = built_in().remove(3).mesh;
        let corner = [DVec3::ZERO, DVec3::X, DVec3::Y].map(|at| at * 0.08).to_vec();
        let triangle = Mesh::new(corner, vec![[0, 1, 2]]).unwrap();
        // The longest edge, 113 mm, is halved five times, to below 8 % of 80 mm: 6.4 mm.
        assert_eq!(subdivided(&triangle).unwrap().triangles().len(), 4usize.pow(5));
        let fine = subdivided(&mesh).unwrap();
        assert!((fine.surface_area() / mesh.surface_area() - 1.0).abs() < 1e-9);
        assert!(fine.is_watertight());
    }
}
