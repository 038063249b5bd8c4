//! Fifteen objects that are hard to distinguish by touch: near twins, thin, notched, symmetric.
//!
//! Twins differ in one measure by about 2 mm, in handedness, or in the place of one notch.
//! Symmetric ones look the same from many poses. Lengths in millimetres, as in `field`.

use glam::{DVec2, DVec3};

use super::Body;
use super::field::{
    ball, blend, chain, cuboid, cylinder, ellipsoid, extruded, lathe, limb, polygon, smoothed,
    torus, without,
};

const fn body(name: &'static str, field: fn(DVec3) -> f64, half: [f64; 3], cell: f64) -> Body {
    let high = DVec3::new(half[0], half[1], half[2]);
    let low = DVec3::new(-half[0], -half[1], -half[2]);
    Body { name, field, low, high, cell }
}

/// The fifteen, by kind.
pub(super) const BODIES: [Body; 15] = [
    body("bottle", bottle, [18.0, 18.0, 42.0], 1.0),
    body("bottle_slim", bottle_slim, [18.0, 18.0, 42.0], 1.0),
    body("bracket_left", bracket_left, [42.0, 32.0, 17.0], 1.13),
    body("bracket_right", bracket_right, [42.0, 32.0, 17.0], 1.13),
    body("dumbbell", dumbbell, [20.0, 20.0, 42.0], 1.0),
    body("dumbbell_uneven", dumbbell_uneven, [20.0, 20.0, 42.0], 1.0),
    body("plate", plate, [42.0, 27.0, 4.0], 0.8),
    body("ring", ring, [42.0, 42.0, 5.0], 0.8),
    body("spoon", spoon, [42.0, 14.0, 10.0], 0.7),
    body("block_notched_end", block_notched_end, [42.0, 17.0, 13.0], 1.1),
    body("block_notched_middle", block_notched_middle, [42.0, 17.0, 13.0], 1.1),
    body("rod_slotted", rod_slotted, [12.0, 12.0, 42.0], 0.8),
    body("ball", ball_of_80, [42.0, 42.0, 42.0], 1.6),
    body("cube", cube, [42.0, 42.0, 42.0], 1.6),
    body("hexagonal_prism", hexagonal_prism, [22.0, 22.0, 42.0], 1.2),
];

/// A bottle whose body has this radius; its neck is the same in all.
fn bottle_of(at: DVec3, radius: f64) -> f64 {
    let profile = [
        (0.0, -40.0),
        (radius - 1.0, -40.0),
        (radius, -38.0),
        (radius, 8.0),
        (radius - 2.0, 15.0),
        (7.0, 24.0),
        (5.5, 30.0),
        (5.5, 35.0),
        (7.0, 36.0),
        (7.0, 40.0),
        (0.0, 40.0),
    ];
    lathe(at, &smoothed(&profile)) - 0.2
}

fn bottle(at: DVec3) -> f64 {
    bottle_of(at, 15.0)
}

fn bottle_slim(at: DVec3) -> f64 {
    bottle_of(at, 13.0)
}

/// An angle with a hole in its long leg and a rib beside it, which makes it left-handed.
fn bracket_left(at: DVec3) -> f64 {
    let long = cuboid(at - DVec3::new(0.0, -25.0, 0.0), DVec3::new(40.0, 5.0, 15.0), 1.0);
    let short = cuboid(at - DVec3::new(-35.0, 0.0, 0.0), DVec3::new(5.0, 30.0, 15.0), 1.0);
    let rib_outline = [(-32.0, -22.0), (-2.0, -22.0), (-32.0, 14.0)];
    let rib = extruded(polygon(at.truncate(), &rib_outline), at.z - 11.0, 4.0, 0.5);
    let hole = DVec2::new(at.x - 18.0, at.z + 5.0).length() - 6.0;
    without(blend(blend(long, short, 2.0), rib, 1.0), hole)
}

fn bracket_right(at: DVec3) -> f64 {
    bracket_left(DVec3::new(at.x, at.y, -at.z))
}

/// A bar between two balls of these radii, each 80 mm long in all.
fn dumbbell_of(at: DVec3, lower: f64, upper: f64) -> f64 {
    let (low, high) = (DVec3::Z * (lower - 40.0), DVec3::Z * (40.0 - upper));
    let bar = limb(at, (low, 6.0), (high, 6.0));
    blend(bar, ball(at - low, lower).min(ball(at - high, upper)), 3.0)
}

fn dumbbell(at: DVec3) -> f64 {
    dumbbell_of(at, 16.0, 16.0)
}

fn dumbbell_uneven(at: DVec3) -> f64 {
    dumbbell_of(at, 16.0, 14.0)
}

/// A plate 4 mm thick with a round and a square hole.
fn plate(at: DVec3) -> f64 {
    let outline = cuboid(at, DVec3::new(40.0, 25.0, 2.0), 0.8);
    let round = DVec2::new(at.x - 20.0, at.y - 4.0).length() - 9.0;
    let square = DVec2::new(at.x + 18.0, at.y + 6.0).abs().max_element() - 7.0;
    without(outline, round.min(square))
}

/// A ring 5 mm thick.
fn ring(at: DVec3) -> f64 {
    torus(at, 37.5, 2.5)
}

fn spoon(at: DVec3) -> f64 {
    let handle = chain(
        at * DVec3::new(1.0, 0.7, 1.0),
        &[
            (DVec3::new(-37.5, 0.0, 2.0), 2.5),
            (DVec3::new(-20.0, 0.0, 1.0), 2.0),
            (DVec3::new(0.0, 0.0, -1.0), 1.9),
            (DVec3::new(14.0, 0.0, -2.0), 2.2),
        ],
    );
    let bowl_at = at - DVec3::new(26.0, 0.0, 0.0);
    let outside = ellipsoid(bowl_at, DVec3::new(14.0, 10.5, 7.0));
    let inside = ellipsoid(bowl_at - 3.0 * DVec3::Z, DVec3::new(12.5, 9.0, 7.5));
    let bowl = without(outside, inside).max(bowl_at.z - 1.0);
    blend(handle, bowl, 1.5)
}

/// A block with a notch across its upper side at this place along x.
fn notched(at: DVec3, place: f64) -> f64 {
    let block = cuboid(at, DVec3::new(40.0, 15.0, 11.0), 1.0);
    let notch = (at.x - place).abs() - 5.0;
    without(block, notch.max(5.0 - at.z))
}

fn block_notched_end(at: DVec3) -> f64 {
    notched(at, 25.0)
}

fn block_notched_middle(at: DVec3) -> f64 {
    notched(at, 0.0)
}

/// A round rod with a slot along one side of its upper half.
fn rod_slotted(at: DVec3) -> f64 {
    let rod = cylinder(at, 10.0, 40.0, 1.0);
    let slot = (at.y.abs() - 2.5).max(5.0 - at.x).max(4.0 - at.z);
    without(rod, slot)
}

fn ball_of_80(at: DVec3) -> f64 {
    ball(at, 40.0)
}

fn cube(at: DVec3) -> f64 {
    cuboid(at, DVec3::splat(40.0), 2.0)
}

fn hexagonal_prism(at: DVec3) -> f64 {
    let corners: Vec<(f64, f64)> = (0..6)
        .map(|corner| DVec2::from_angle(std::f64::consts::FRAC_PI_3 * f64::from(corner)) * 20.0)
        .map(|corner| (corner.x, corner.y))
        .collect();
    extruded(polygon(at.truncate(), &corners), at.z, 40.0, 0.8)
}
