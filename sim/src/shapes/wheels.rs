//! The tyre and the gear: the same outline, but tread here and teeth there.

use glam::{DVec2, DVec3};

use super::Body;
use super::field::{blend, cylinder, extruded, polygon, repeated_around, torus, without};

pub(super) const TYRE: Body = Body {
    name: "tyre",
    field: tyre,
    low: DVec3::new(-42.0, -42.0, -15.0),
    high: DVec3::new(42.0, 42.0, 15.0),
    cell: 1.1,
};

pub(super) const GEAR: Body = Body {
    name: "gear",
    field: gear,
    low: DVec3::new(-42.0, -42.0, -13.0),
    high: DVec3::new(42.0, 42.0, 13.0),
    cell: 1.1,
};

fn tyre(at: DVec3) -> f64 {
    let radius = at.truncate().length();
    // The section: a rounded box whose side walls bulge, around a bore for the rim.
    let section = DVec2::new(radius - 30.0, at.z);
    let bulge = 12.5 - 0.035 * (section.x - 1.0).powi(2);
    let carcass = extruded(section.x.abs() - 10.0, at.z, bulge, 4.0);
    let bead = torus(DVec3::new(at.x, at.y, at.z.abs() - 10.0), 23.0, 2.2);
    let body = blend(carcass, bead, 2.0);
    let treads = tread(at, radius);
    without(body, treads)
}

/// The grooves cut into the running surface: two around, and slanted ones across the shoulders.
fn tread(at: DVec3, radius: f64) -> f64 {
    let depth = 37.3 - radius;
    let around = (at.z.abs() - 4.0).abs() - 1.1;
    let slant = 0.012 * at.z;
    let turned = DVec3::new(
        at.x * slant.cos() - at.y * slant.sin(),
        at.x * slant.sin() + at.y * slant.cos(),
        at.z,
    );
    let across = (repeated_around(turned, 26).y.abs() - 1.3).max(5.0 - at.z.abs());
    around.min(across).max(depth)
}

fn gear(at: DVec3) -> f64 {
    let rim = cylinder(at, 32.0, 9.0, 1.0);
    let tooth_at = repeated_around(at, 16);
    let outline = [(29.0, -5.2), (40.0, -2.4), (40.0, 2.4), (29.0, 5.2)];
    let tooth = extruded(polygon(tooth_at.truncate(), &outline), at.z, 9.0, 0.7);
    // The disc between rim and hub is thinner, and has holes.
    let web = DVec2::new((at.truncate().length() - 19.5).abs() - 7.0, 5.0 - at.z.abs());
    let recess = web.max_element();
    let hole_at = repeated_around(at, 5) - 19.0 * DVec3::X;
    let hole = hole_at.truncate().length() - 5.2;
    let bore = at.truncate().length() - 6.0;
    let key = (at.x.abs() - 1.8).max((at.y - 6.0).abs() - 2.5);
    let cuts = recess.min(hole).min(bore).min(key);
    without(blend(rim, tooth, 1.0), cuts)
}
