//! The screwdriver, the pliers and the hammer: thin shafts beside thick handles.

use glam::{DVec2, DVec3};

use super::Body;
use super::field::{blend, chain, cuboid, cylinder, extruded, lathe, limb, polygon, without};

pub(super) const SCREWDRIVER: Body = Body {
    name: "screwdriver",
    field: screwdriver,
    low: DVec3::new(-11.0, -11.0, -2.0),
    high: DVec3::new(11.0, 11.0, 83.0),
    cell: 0.7,
};

pub(super) const PLIERS: Body = Body {
    name: "pliers",
    field: pliers,
    low: DVec3::new(-50.0, -20.0, -8.0),
    high: DVec3::new(42.0, 20.0, 8.0),
    cell: 0.75,
};

pub(super) const HAMMER: Body = Body {
    name: "hammer",
    field: hammer,
    low: DVec3::new(-33.0, -10.0, -3.0),
    high: DVec3::new(26.0, 10.0, 80.0),
    cell: 0.8,
};

/// Grip and collar; the flutes are cut into it.
const GRIP_PROFILE: [(f64, f64); 12] = [
    (0.0, 0.0),
    (5.0, 0.3),
    (7.5, 2.0),
    (8.4, 5.0),
    (8.4, 20.0),
    (7.2, 25.0),
    (5.6, 28.0),
    (5.4, 30.0),
    (7.0, 32.5),
    (6.6, 34.5),
    (3.6, 36.0),
    (0.0, 36.0),
];

fn screwdriver(at: DVec3) -> f64 {
    let angle = at.y.atan2(at.x);
    let along_grip = ((at.z - 4.0).min(24.0 - at.z) / 4.0).clamp(0.0, 1.0);
    let flutes = 0.7 * along_grip * (1.0 - (6.0 * angle).cos());
    let grip = lathe(at, &GRIP_PROFILE) + flutes;
    let shaft = cylinder(at - 53.0 * DVec3::Z, 2.3, 20.0, 0.3);
    // The blade widens a little and then thins to its edge.
    let to_edge = ((at.z - 66.0) / 14.0).clamp(0.0, 1.0);
    let wide = 2.1 + 1.5 * to_edge.sqrt();
    let half = DVec2::new(wide, 2.1 - 1.3 * to_edge);
    let section = at.truncate().abs() - half;
    let blade = section.max_element().max((at.z - 73.0).abs() - 7.0);
    grip.min(blend(shaft, blade, 1.0))
}

fn pliers(at: DVec3) -> f64 {
    let arm = |side: f64| {
        // Seen with its handle at +y; the jaw crosses to −y beyond the pivot.
        let at = DVec3::new(at.x, side * at.y, at.z);
        let handle = chain(
            at * DVec3::new(1.0, 1.0, 0.95),
            &[
                (DVec3::new(-46.0, 14.5, 0.0), 3.2),
                (DVec3::new(-36.0, 14.0, 0.0), 3.9),
                (DVec3::new(-22.0, 11.5, 0.0), 3.9),
                (DVec3::new(-8.0, 6.0, 0.0), 3.4),
                (DVec3::new(4.0, 0.5, 0.0), 4.0),
            ],
        );
        let outline =
            [(2.0, 3.0), (6.0, -8.0), (16.0, -8.0), (38.0, -4.6), (38.0, -1.9), (16.0, -1.3)];
        let jaw = extruded(polygon(at.truncate(), &outline), at.z, 3.8, 0.8);
        blend(handle, jaw, 2.0)
    };
    // Teeth across the inner sides of the jaws.
    let teeth = (at.y.abs() - 2.1 - 0.5 * (1.9 * at.x).sin()).max(15.0 - at.x);
    let jaws = without(arm(1.0).min(arm(-1.0)), teeth);
    let pivot = cylinder(at - DVec3::new(5.0, 0.0, 0.0), 7.6, 4.8, 0.8);
    let bolt = cylinder(at - DVec3::new(5.0, 0.0, 0.0), 3.4, 6.2, 0.8);
    blend(jaws, pivot, 1.0).min(bolt)
}

fn hammer(at: DVec3) -> f64 {
    // Thicker where it is held.
    let waist = 1.22 - 0.22 * ((at.z - 14.0) / 14.0).powi(2).min(1.0);
    let haft = cuboid(
        (at - 33.0 * DVec3::Z) / DVec3::new(waist, waist, 1.0),
        DVec3::new(4.2, 3.2, 33.0),
        2.6,
    );
    let head_at = at - 67.0 * DVec3::Z;
    let cheek = cuboid(head_at, DVec3::new(6.5, 6.0, 6.5), 2.0);
    let on_side = DVec3::new(head_at.y, head_at.z, head_at.x);
    let neck = limb(head_at, (DVec3::ZERO, 5.0), (14.0 * DVec3::X, 4.8));
    let face = cylinder(on_side - 18.0 * DVec3::Z, 7.6, 4.5, 1.2);
    let mirrored = DVec3::new(head_at.x, head_at.y.abs(), head_at.z);
    let claw = chain(
        mirrored * DVec3::new(1.0, 1.0, 1.15),
        &[
            (DVec3::new(-3.0, 2.0, 1.0), 4.4),
            (DVec3::new(-12.0, 3.0, 2.0), 3.6),
            (DVec3::new(-21.0, 4.2, -1.5), 2.7),
            (DVec3::new(-28.5, 5.2, -9.0), 1.5),
        ],
    );
    let slit = (mirrored.y - 0.09 * (-9.0 - head_at.x).max(0.0)).max(head_at.x + 10.0);
    let head = blend(blend(cheek, neck, 3.0), face, 1.5);
    blend(haft, blend(head, without(claw, slit), 2.5), 1.5)
}
