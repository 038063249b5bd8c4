//! Four printable bodies to commission a sensor with, without a catalogue.
//!
//! Each has a base to stand on. Lengths in millimetres, as in `field`.

use glam::{DVec2, DVec3};

use super::Body;
use super::field::{ball, cuboid, extruded, polygon};

/// A plate with a ridge that is neither in its middle nor as long as it.
const RIDGE: Body = Body {
    name: "reference_ridge",
    field: ridge,
    low: DVec3::new(-42.0, -32.0, -12.0),
    high: DVec3::new(42.0, 32.0, 22.0),
    cell: 1.0,
};

/// A ball of 40 mm.
const SPHERE: Body = Body {
    name: "reference_sphere",
    field: sphere,
    low: DVec3::splat(-22.0),
    high: DVec3::splat(22.0),
    cell: 0.8,
};

/// A cube of 50 mm.
const CUBE: Body = Body {
    name: "reference_cube",
    field: cube,
    low: DVec3::splat(-27.0),
    high: DVec3::splat(27.0),
    cell: 1.0,
};

/// Three steps of different height and depth, and a slope.
const WEDGE: Body = Body {
    name: "reference_wedge",
    field: wedge,
    low: DVec3::new(-42.0, -22.0, -2.0),
    high: DVec3::new(42.0, 22.0, 37.0),
    cell: 1.0,
};

/// The four, and what each can tell.
pub(super) const BODIES: [Body; 4] = [RIDGE, SPHERE, CUBE, WEDGE];

fn ridge(at: DVec3) -> f64 {
    let plate = cuboid(at, DVec3::new(40.0, 30.0, 10.0), 0.0);
    // A triangle over x, 10 mm high, from y = -25 to y = 10.
    let across = polygon(DVec2::new(at.x, at.z), &[(4.0, 8.0), (24.0, 8.0), (14.0, 20.0)]);
    plate.min(extruded(across, at.y + 7.5, 17.5, 0.0))
}

fn sphere(at: DVec3) -> f64 {
    ball(at, 20.0)
}

fn cube(at: DVec3) -> f64 {
    cuboid(at, DVec3::splat(25.0), 0.0)
}

fn wedge(at: DVec3) -> f64 {
    let side = [
        (-40.0, 0.0),
        (40.0, 0.0),
        (40.0, 10.0),
        (22.0, 10.0),
        (22.0, 18.0),
        (2.0, 18.0),
        (2.0, 30.0),
        (-14.0, 35.0),
        (-40.0, 10.0),
    ];
    extruded(polygon(DVec2::new(at.x, at.z), &side), at.y, 20.0, 0.0)
}
