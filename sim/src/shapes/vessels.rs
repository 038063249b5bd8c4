//! The wine glass and the mug: thin walls, and an inside that a sensor may or may not reach.

use std::sync::LazyLock;

use glam::DVec3;

use super::Body;
use super::field::{blend, cylinder, lathe, smoothed, torus, without};

pub(super) const WINE_GLASS: Body = Body {
    name: "wine_glass",
    field: wine_glass,
    low: DVec3::new(-21.0, -21.0, -2.0),
    high: DVec3::new(21.0, 21.0, 82.5),
    cell: 0.9,
};

pub(super) const MUG: Body = Body {
    name: "mug",
    field: mug,
    low: DVec3::new(-31.0, -31.0, -3.0),
    high: DVec3::new(54.0, 31.0, 69.0),
    cell: 1.2,
};

/// Foot, stem and bowl: outside from the foot up to the rim, then the inside down.
const WINE_GLASS_PROFILE: [(f64, f64); 26] = [
    (0.0, 0.0),
    (17.0, 0.0),
    (17.6, 0.9),
    (16.5, 1.9),
    (6.0, 3.4),
    (3.0, 6.5),
    (2.3, 12.0),
    (2.3, 29.0),
    (3.2, 33.0),
    (8.0, 36.0),
    (14.0, 41.0),
    (18.0, 48.0),
    (19.2, 56.0),
    (18.6, 66.0),
    (17.0, 79.0),
    (16.8, 80.0),
    (15.0, 80.0),
    (15.1, 79.0),
    (16.9, 66.0),
    (17.4, 56.0),
    (16.3, 49.0),
    (12.6, 43.2),
    (9.0, 40.4),
    (6.0, 38.9),
    (3.0, 38.0),
    (0.0, 37.7),
];

fn wine_glass(at: DVec3) -> f64 {
    static SMOOTH: LazyLock<Vec<(f64, f64)>> =
        LazyLock::new(|| smoothed(&smoothed(&WINE_GLASS_PROFILE)));
    lathe(at, &SMOOTH) - 0.3
}

fn mug(at: DVec3) -> f64 {
    let body = cylinder(at - 33.0 * DVec3::Z, 28.0, 33.0, 3.0);
    // The handle is a flattened ring that stands on the mug's side.
    let at_handle = at - DVec3::new(28.0, 0.0, 33.0);
    let ring = torus(DVec3::new(at_handle.x, 0.85 * at_handle.z, 0.8 * at_handle.y), 17.5, 3.6);
    let handle = ring.max(-at_handle.x - 4.0);
    let inside = cylinder(at - 45.0 * DVec3::Z, 24.0, 40.0, 4.0);
    without(blend(body, handle, 4.0), inside)
}
