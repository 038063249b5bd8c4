//! The public benchmark: 25 closed objects to touch, 80 mm in their largest dimension.
//!
//! The first ten are as varied as the dissertation's (section 5.4): thin and thick, round and
//! edged, smooth and rough. The other fifteen are harder to distinguish (`hard`). Each is a
//! signed distance in millimetres, meshed on a grid, without any randomness. Not here: files;
//! meshes from users are read by `mesh`.

mod assembled;
mod creatures;
mod field;
mod hard;
mod reference;
pub(crate) mod surface_nets;
mod tools;
mod vessels;
mod wheels;

pub use assembled::assembled;
use glam::DVec3;
use palpate_core::units::MM;

use crate::mesh::Mesh;

/// Largest dimension of every example, metres.
pub const LARGEST_DIMENSION: f64 = 80.0 * MM;

/// A body as a signed distance, and the box and grid to mesh it in; all in millimetres.
struct Body {
    name: &'static str,
    field: fn(DVec3) -> f64,
    low: DVec3,
    high: DVec3,
    cell: f64,
}

const BODIES: [Body; 10] = [
    creatures::CHESS_KNIGHT,
    creatures::DRAGON,
    wheels::GEAR,
    tools::HAMMER,
    creatures::HAND,
    vessels::MUG,
    tools::PLIERS,
    tools::SCREWDRIVER,
    wheels::TYRE,
    vessels::WINE_GLASS,
];

/// Names of the ten example objects.
pub const NAMES: [&str; 10] = names(&BODIES);

/// Names of the fifteen harder objects.
const HARD_NAMES: [&str; 15] = names(&hard::BODIES);

/// Names of the public benchmark: the ten example objects, then fifteen harder ones.
pub const PUBLIC_NAMES: [&str; 25] = {
    let mut all = [""; 25];
    let mut idx = 0;
    while idx < all.len() {
        all[idx] = if idx < NAMES.len() { NAMES[idx] } else { HARD_NAMES[idx - NAMES.len()] };
        idx += 1;
    }
    all
};

const fn names<const N: usize>(bodies: &[Body; N]) -> [&'static str; N] {
    let mut names = [""; N];
    let mut idx = 0;
    while idx < N {
        names[idx] = bodies[idx].name;
        idx += 1;
    }
    names
}

/// The object of a name in [`PUBLIC_NAMES`]: closed, outward, in metres, its surface's centroid
/// at the origin. `None` for an unknown name.
#[must_use]
pub fn example(name: &str) -> Option<Mesh> {
    let body = BODIES.iter().chain(&hard::BODIES).find(|body| body.name == name)?;
    let mesh = meshed(body).scaled_to_largest_dimension(LARGEST_DIMENSION);
    let centroid = mesh.centroid();
    Some(mesh.translated(-centroid))
}

/// Names of the four reference bodies: a plate with a ridge, a sphere, a cube, a stepped wedge.
pub const REFERENCE_NAMES: [&str; 4] = names(&reference::BODIES);

/// The reference body of a name in [`REFERENCE_NAMES`]: closed, outward, in metres and at its own
/// size, its surface's centroid at the origin. `None` for an unknown name.
#[must_use]
pub fn reference_body(name: &str) -> Option<Mesh> {
    let mesh = meshed(reference::BODIES.iter().find(|body| body.name == name)?);
    let centroid = mesh.centroid();
    Some(mesh.translated(-centroid))
}

fn meshed(body: &Body) -> Mesh {
    let (vertices, triangles) = surface_nets::mesh(body.field, body.low, body.high, body.cell);
    let vertices = vertices.iter().map(|at| *at * MM).collect();
    Mesh::new(vertices, triangles).expect("every example has a surface")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_example_is_closed_outward_and_eighty_millimetres() {
        for name in PUBLIC_NAMES {
            let mesh = example(name).unwrap();
            assert!(mesh.is_watertight(), "{name}");
            assert!(mesh.signed_volume() > 0.0, "{name}");
            assert!((mesh.largest_dimension() / LARGEST_DIMENSION - 1.0).abs() < 0.005, "{name}");
            assert!(mesh.centroid().length() < 1e-9, "{name}");
            let n = mesh.triangles().len();
            println!("{name}: {n} triangles");
            assert!((4_000..60_000).contains(&n), "{name} has {n} triangles");
        }
    }

    #[test]
    fn names_are_unique_and_others_are_unknown() {
        let mut names = PUBLIC_NAMES.to_vec();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), PUBLIC_NAMES.len());
        assert!(example("teapot").is_none());
    }

    #[test]
    fn reference_bodies_are_closed_and_have_their_sizes() {
        let sizes = [[80.0, 60.0, 30.0], [40.0; 3], [50.0; 3], [80.0, 40.0, 35.0]];
        for (name, size) in REFERENCE_NAMES.into_iter().zip(sizes) {
            let mesh = reference_body(name).unwrap();
            assert!(mesh.is_watertight() && mesh.signed_volume() > 0.0, "{name}");
            let off = mesh.extent() / MM - DVec3::from_array(size);
            assert!(off.abs().max_element() < 1.0, "{name}: {off}");
            assert!((4_000..60_000).contains(&mesh.triangles().len()), "{name}");
        }
        assert!(reference_body("mug").is_none());
    }

    #[test]
    fn an_example_is_always_the_same() {
        assert_eq!(example("hammer"), example("hammer"));
    }
}
