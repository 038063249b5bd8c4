//! The chess knight, the dragon and the hand: no axis of symmetry, many small parts.

use glam::{DVec2, DVec3};

use super::Body;
use super::field::{
    ball, blend, chain, cuboid, ellipsoid, extruded, lathe, limb, polygon, without,
};

pub(super) const CHESS_KNIGHT: Body = Body {
    name: "chess_knight",
    field: chess_knight,
    low: DVec3::new(-22.0, -22.0, -3.0),
    high: DVec3::new(27.0, 22.0, 84.0),
    cell: 0.95,
};

pub(super) const DRAGON: Body = Body {
    name: "dragon",
    field: dragon,
    low: DVec3::new(-52.0, -36.0, -4.0),
    high: DVec3::new(50.0, 36.0, 62.0),
    cell: 1.03,
};

pub(super) const HAND: Body = Body {
    name: "hand",
    field: hand,
    low: DVec3::new(-42.0, -18.0, -40.0),
    high: DVec3::new(26.0, 14.0, 56.0),
    cell: 1.03,
};

/// Foot, collar and neck ring of a chess piece.
const FOOT_PROFILE: [(f64, f64); 11] = [
    (0.0, 0.0),
    (18.0, 0.0),
    (18.8, 2.0),
    (18.0, 5.5),
    (15.5, 7.0),
    (15.8, 9.0),
    (12.5, 12.0),
    (11.0, 16.0),
    (13.2, 18.0),
    (12.6, 20.5),
    (0.0, 20.5),
];

/// The horse's head and neck seen from its left: (forward, up).
const HORSE_OUTLINE: [(f64, f64); 24] = [
    (-11.5, 18.0),
    (-14.5, 27.0),
    (-15.0, 38.0),
    (-13.0, 49.0),
    (-9.0, 58.5),
    (-3.5, 65.5),
    (-2.0, 69.0),
    (-1.0, 78.0),
    (3.5, 71.0),
    (6.5, 68.0),
    (11.0, 64.5),
    (17.5, 56.0),
    (22.5, 49.0),
    (23.0, 45.0),
    (20.5, 41.5),
    (16.5, 41.0),
    (13.5, 43.5),
    (8.5, 45.0),
    (4.5, 43.5),
    (3.5, 40.5),
    (6.5, 36.0),
    (10.5, 30.0),
    (12.0, 24.0),
    (11.5, 18.0),
];

fn chess_knight(at: DVec3) -> f64 {
    let foot = lathe(at, &FOOT_PROFILE) - 0.4;
    let in_plane = polygon(DVec2::new(at.x, at.z), &HORSE_OUTLINE);
    // Thick at the neck, thin at the muzzle and the mane.
    let towards_muzzle = ((at.x - 2.0) / 20.0).clamp(0.0, 1.0);
    let upward = ((at.z - 20.0) / 55.0).clamp(0.0, 1.0);
    let half = 9.5 - 3.5 * upward - 1.5 * towards_muzzle;
    let head = extruded(in_plane, at.y, half, 3.0);
    let mirrored = DVec3::new(at.x, at.y.abs(), at.z);
    let eye = ball(mirrored - DVec3::new(6.5, 6.0, 60.0), 1.7);
    let nostril = ball(mirrored - DVec3::new(19.5, 5.2, 47.5), 1.5);
    // Locks of the mane: notches into the ridge of the neck.
    let on_ridge =
        (in_plane.abs() - 2.6).max(at.x - 0.34 * (at.z - 30.0)).max((at.z - 44.0).abs() - 21.0);
    let notches = on_ridge.max(0.35 - (0.95 * at.z + 0.35 * at.y.abs()).sin());
    let carved = without(without(without(head, notches), eye), nostril);
    blend(foot, carved, 1.5)
}

/// From the tip of the tail to the throat.
const DRAGON_SPINE: [(DVec3, f64); 11] = [
    (DVec3::new(-44.0, 12.0, 9.0), 1.0),
    (DVec3::new(-41.0, 5.0, 6.0), 1.8),
    (DVec3::new(-35.0, -1.5, 5.0), 2.8),
    (DVec3::new(-26.0, -3.0, 8.0), 4.4),
    (DVec3::new(-15.0, 0.0, 14.0), 7.6),
    (DVec3::new(-3.0, 0.0, 17.0), 9.2),
    (DVec3::new(8.0, 0.0, 20.0), 8.6),
    (DVec3::new(16.0, 0.0, 28.0), 5.6),
    (DVec3::new(20.0, 0.0, 37.0), 4.4),
    (DVec3::new(23.0, 0.0, 45.0), 4.2),
    (DVec3::new(28.0, 0.0, 48.0), 4.8),
];

fn dragon(at: DVec3) -> f64 {
    let mirrored = DVec3::new(at.x, at.y.abs(), at.z);
    let spine = chain(at, &DRAGON_SPINE);
    let belly = ellipsoid(at - DVec3::new(-2.0, 0.0, 15.0), DVec3::new(15.0, 9.5, 10.5));
    let body = blend(blend(spine, belly, 4.0), dragon_legs(mirrored), 3.5);
    let with_head = blend(body, dragon_head(mirrored), 2.5);
    let scales = 0.35 * ((1.5 * at.x).sin() * (1.5 * at.y).sin() * (1.5 * at.z).sin());
    let with_crest = with_head.min(dragon_crest(at));
    blend(with_crest + scales, dragon_wing(mirrored), 2.0)
}

fn dragon_legs(mirrored: DVec3) -> f64 {
    let hind = [
        (DVec3::new(-12.0, 6.5, 13.0), 5.4),
        (DVec3::new(-7.0, 10.5, 7.0), 3.6),
        (DVec3::new(-13.0, 11.0, 2.4), 2.4),
        (DVec3::new(-6.0, 12.5, 1.4), 2.2),
    ];
    let fore = [
        (DVec3::new(10.0, 6.0, 18.0), 4.4),
        (DVec3::new(8.0, 10.0, 10.0), 3.0),
        (DVec3::new(12.0, 10.5, 2.2), 2.2),
        (DVec3::new(18.0, 11.5, 1.4), 2.0),
    ];
    chain(mirrored, &hind).min(chain(mirrored, &fore))
}

fn dragon_head(mirrored: DVec3) -> f64 {
    let skull = ellipsoid(mirrored - DVec3::new(30.0, 0.0, 49.5), DVec3::new(7.0, 5.2, 4.8));
    let muzzle =
        limb(mirrored, (DVec3::new(33.0, 1.4, 49.5), 3.2), (DVec3::new(43.0, 1.0, 48.0), 2.3));
    let jaw =
        limb(mirrored, (DVec3::new(29.0, 1.2, 45.5), 2.6), (DVec3::new(40.0, 0.6, 40.5), 1.6));
    let horn = chain(
        mirrored,
        &[
            (DVec3::new(28.0, 3.0, 53.0), 1.9),
            (DVec3::new(21.0, 5.0, 56.5), 1.4),
            (DVec3::new(14.5, 6.5, 56.0), 0.9),
        ],
    );
    let brow = ball(mirrored - DVec3::new(33.5, 3.4, 52.2), 1.7);
    blend(blend(skull, muzzle, 2.5), jaw, 1.5).min(horn).min(brow)
}

/// Spikes along the back, from the neck to the tail.
fn dragon_crest(at: DVec3) -> f64 {
    let spike = |(from, radius): (DVec3, f64), (to, _): (DVec3, f64), height: f64| {
        let middle = 0.5 * (from + to);
        let along = (to - from).normalize();
        let up = (DVec3::Z - along * along.z).normalize();
        let tip = middle + (radius + height) * up - 2.0 * along;
        limb(at, (middle + 0.7 * radius * up, 2.6), (tip, 0.7))
    };
    DRAGON_SPINE[2..]
        .windows(2)
        .map(|pair| spike(pair[0], pair[1], 4.6))
        .fold(f64::INFINITY, f64::min)
}

/// A wing: a scalloped plate, raised and swept back, with a thicker leading edge.
fn dragon_wing(mirrored: DVec3) -> f64 {
    let shoulder = DVec3::new(7.0, 4.0, 24.0);
    let outward = DVec3::new(-0.15, 0.72, 0.68).normalize();
    let forward = (DVec3::X - outward * outward.x).normalize();
    let normal = outward.cross(forward);
    let offset = mirrored - shoulder;
    let on_plate = DVec2::new(offset.dot(outward), offset.dot(forward));
    let outline = [
        (0.0, 4.0),
        (18.0, 6.0),
        (37.0, -3.0),
        (33.0, -10.0),
        (34.0, -19.0),
        (25.0, -17.0),
        (22.0, -26.0),
        (14.0, -18.5),
        (6.0, -23.0),
        (0.0, -14.0),
    ];
    let membrane = extruded(polygon(on_plate, &outline), offset.dot(normal), 1.3, 0.6);
    let finger = |to: (f64, f64)| {
        let to = shoulder + to.0 * outward + to.1 * forward;
        limb(mirrored, (shoulder + 14.0 * outward + 4.0 * forward, 2.0), (to, 1.1))
    };
    let arm = limb(mirrored, (shoulder, 3.0), (shoulder + 15.0 * outward + 4.5 * forward, 2.2));
    let bones = arm.min(finger((36.0, -3.0))).min(finger((33.0, -18.0))).min(finger((22.0, -24.5)));
    blend(membrane, bones, 1.0)
}

/// Knuckle, middle joint and tip of the four fingers, from the index to the little one.
const FINGERS: [[(DVec3, f64); 3]; 4] = [
    [
        (DVec3::new(-13.0, 0.0, 12.0), 5.2),
        (DVec3::new(-16.0, -1.0, 29.0), 4.4),
        (DVec3::new(-17.5, -4.5, 41.0), 3.7),
    ],
    [
        (DVec3::new(-4.2, 0.5, 14.0), 5.4),
        (DVec3::new(-5.2, 0.0, 33.5), 4.6),
        (DVec3::new(-5.6, -3.5, 47.0), 3.8),
    ],
    [
        (DVec3::new(4.6, 0.5, 13.0), 5.2),
        (DVec3::new(6.2, 0.0, 31.0), 4.4),
        (DVec3::new(7.0, -3.5, 43.5), 3.7),
    ],
    [
        (DVec3::new(12.8, 0.0, 10.0), 4.7),
        (DVec3::new(16.5, -0.5, 24.0), 3.8),
        (DVec3::new(18.5, -3.0, 33.5), 3.2),
    ],
];

fn hand(at: DVec3) -> f64 {
    let palm = cuboid(at - DVec3::new(0.0, 0.0, -1.0), DVec3::new(17.5, 6.6, 18.0), 6.5);
    let wrist = wrist(at);
    let fingers = FINGERS.iter().map(|finger| chain(at, finger)).fold(f64::INFINITY, f64::min);
    let thumb = chain(
        at,
        &[
            (DVec3::new(-9.0, -3.0, -10.0), 7.0),
            (DVec3::new(-22.0, -6.0, 0.0), 5.4),
            (DVec3::new(-30.5, -8.0, 10.0), 4.5),
            (DVec3::new(-33.5, -9.0, 19.0), 3.8),
        ],
    );
    let hollow = ellipsoid(at - DVec3::new(2.0, -16.5, -2.0), DVec3::new(16.0, 11.5, 19.0));
    let body = blend(blend(palm, wrist, 6.0), blend(fingers, thumb, 1.0), 3.0);
    without(body, hollow)
}

fn wrist(at: DVec3) -> f64 {
    let squeezed = DVec3::new(at.x * 0.62, at.y, at.z);
    limb(squeezed, (DVec3::new(0.0, 0.0, -14.0), 6.8), (DVec3::new(0.0, 0.0, -30.0), 7.0))
        .max(-36.0 - at.z)
}
