//! Bodies for this crate's tests whose touches can be computed by hand.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::Mesh;

/// A box of `size` metres around the origin.
pub(crate) fn cuboid(size: DVec3) -> Mesh {
    let corner = |bits: u32| {
        let along = |axis: u32| f64::from(bits >> axis & 1) - 0.5;
        size * DVec3::new(along(0), along(1), along(2))
    };
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Mesh::new((0..8).map(corner).collect(), triangles).unwrap()
}

/// A sphere of `radius` metres around the origin, with `n` rings.
pub(crate) fn sphere(radius: f64, n: u32) -> Mesh {
    tube(n, |ring| {
        let angle = PI * (f64::from(ring) + 0.5) / f64::from(n);
        (radius * angle.sin(), -radius * angle.cos())
    })
}

/// A closed body of rings (radius, z), from the lowest to the highest, around the z axis.
pub(crate) fn tube(n_rings: u32, ring: impl Fn(u32) -> (f64, f64)) -> Mesh {
    let n_around = 2 * n_rings.max(12);
    let mut vertices = Vec::new();
    for idx in 0..n_rings {
        let (radius, z) = ring(idx);
        vertices.extend((0..n_around).map(|step| {
            let angle = TAU * f64::from(step) / f64::from(n_around);
            DVec3::new(radius * angle.cos(), radius * angle.sin(), z)
        }));
    }
    let (bottom, top) = (vertices.len() as u32, vertices.len() as u32 + 1);
    vertices.extend([DVec3::Z * ring(0).1, DVec3::Z * ring(n_rings - 1).1]);
    let mut triangles = Vec::new();
    for step in 0..n_around {
        let next = (step + 1) % n_around;
        triangles.push([bottom, next, step]);
        for idx in 0..n_rings - 1 {
            let (low, high) = (idx * n_around, (idx + 1) * n_around);
            triangles.push([low + step, low + next, high + next]);
            triangles.push([low + step, high + next, high + step]);
        }
        let last = (n_rings - 1) * n_around;
        triangles.push([top, last + step, last + next]);
    }
    Mesh::new(vertices, triangles).unwrap()
}
