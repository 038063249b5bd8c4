//! Tests on bodies of known symmetry, from noisy and irregular patches.

use std::f64::consts::TAU;

use glam::{DQuat, DVec2, DVec3};

use super::*;
use crate::object::MapPatch;
use crate::pose::Pose;
use crate::rng::{Purpose, Stream};
use crate::units::{DEG, MM};

/// Positions and outward normals on a body.
type Surface = Vec<(DVec3, DVec3)>;

/// `n` points of a prism: corners of its outline counter-clockwise, half its height (mm).
fn prism(corners: &[DVec2], half_height: f64, n: usize, stream: &mut Stream) -> Surface {
    let edges: Vec<(DVec2, DVec2)> = (0..corners.len())
        .map(|corner| (corners[corner], corners[(corner + 1) % corners.len()]))
        .collect();
    let length: f64 = edges.iter().map(|(a, b)| a.distance(*b)).sum();
    let area: f64 = edges.iter().map(|(a, b)| 0.5 * a.perp_dot(*b)).sum();
    let walls = 2.0 * half_height * length;
    let reach = corners.iter().map(|corner| corner.length()).fold(0.0, f64::max);
    let inside = |at: DVec2| {
        let crossings = edges.iter().filter(|(a, b)| {
            (a.y > at.y) != (b.y > at.y) && a.x + (at.y - a.y) / (b.y - a.y) * (b.x - a.x) > at.x
        });
        crossings.count() % 2 == 1
    };
    let point = |_| {
        if stream.uniform(0.0, walls + 2.0 * area) < walls {
            let mut place = stream.uniform(0.0, length);
            let edge = edges.iter().find(|(a, b)| {
                place -= a.distance(*b);
                place < 0.0
            });
            let (a, b) = *edge.unwrap_or(&edges[0]);
            let at = b + (b - a).normalize() * place;
            let outward = -(b - a).perp().normalize();
            (at.extend(stream.uniform(-half_height, half_height)), outward.extend(0.0))
        } else {
            let side = if stream.uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
            loop {
                let at = DVec2::new(stream.uniform(-reach, reach), stream.uniform(-reach, reach));
                if inside(at) {
                    break (at.extend(side * half_height), DVec3::Z * side);
                }
            }
        }
    };
    (0..n).map(point).collect()
}

fn ring(n: usize, radius: impl Fn(f64) -> f64) -> Vec<DVec2> {
    let corner = |k: usize| {
        let angle = TAU * k as f64 / n as f64;
        radius(angle) * DVec2::from_angle(angle)
    };
    (0..n).map(corner).collect()
}

fn rectangle(half_x: f64, half_y: f64) -> Vec<DVec2> {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    corners.map(|(x, y)| DVec2::new(x * half_x, y * half_y)).to_vec()
}

/// A wheel of `n_teeth` teeth, 5 mm high, which are wider than the gaps.
fn wheel(n_teeth: usize, n: usize, stream: &mut Stream) -> Surface {
    let tooth = [(0.1, 25.0), (0.2, 30.0), (0.6, 30.0), (0.7, 25.0)];
    let corners: Vec<DVec2> = (0..n_teeth)
        .flat_map(|k| tooth.map(|(share, radius)| (k as f64 + share, radius)))
        .map(|(turns, radius)| radius * DVec2::from_angle(TAU * turns / n_teeth as f64))
        .collect();
    prism(&corners, 7.0, n, stream)
}

/// A cylinder with a handle, of a tenth of the patches, above its middle.
fn mug(n: usize, stream: &mut Stream) -> Surface {
    let body = prism(&ring(120, |_| 25.0), 30.0, n - n / 10, stream);
    let mut points = body;
    while points.len() < n {
        let (around, along) = (stream.uniform(0.0, TAU), stream.uniform(-TAU / 4.0, TAU / 4.0));
        let outward = DVec3::new(along.cos(), 0.0, along.sin());
        let normal = outward * around.cos() + DVec3::Y * around.sin();
        let at = DVec3::new(25.0, 0.0, 8.0) + 15.0 * outward + 3.5 * normal;
        if at.truncate().length() > 25.0 {
            points.push((at, normal));
        }
    }
    points
}

/// A map of points (mm), with the noise of touches, 0.1 mm and 4°, at any pose in the frame.
fn map(points: &Surface, pose: &Pose, stream: &mut Stream) -> Vec<MapPatch> {
    let patch = |(at, normal): &(DVec3, DVec3)| {
        let noise = DVec3::new(stream.normal(), stream.normal(), stream.normal());
        let normal = (*normal + 4.0 * DEG * noise).normalize();
        let position = *pose * (*at * MM + normal * 0.1 * MM * stream.normal());
        MapPatch {
            position: position.to_array().map(|value| value as f32),
            normal: pose.turn(normal).to_array().map(|value| value as f32),
            normal_confidence: 0.9,
        }
    };
    points.iter().map(patch).collect()
}

/// Presses of a sensor of 12 mm on each patch. A sensor tilted by 4° about either axis
/// touches with an edge: its middle is 0.6 mm off.
fn presses(patches: &[MapPatch]) -> Vec<Press> {
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let press = |patch: &MapPatch| {
        let turn = DQuat::from_rotation_arc(DVec3::NEG_Z, vector(patch.normal).normalize());
        let middle = vector(patch.position) + 0.6 * MM * vector(patch.normal);
        let object_from_sensor = Pose::from_parts(turn, middle);
        Press { patch: *patch, object_from_sensor, half: DVec2::splat(6.0 * MM) }
    };
    patches.iter().map(press).collect()
}

fn symmetry_of(patches: &[MapPatch]) -> Symmetry {
    Finding::of_touches(&presses(patches)).into_symmetry()
}

/// Half of a sphere joined to half of a spheroid, the point end up.
fn on_an_egg(direction: DVec3) -> (DVec3, DVec3) {
    let half = DVec3::new(20.0, 20.0, if direction.z > 0.0 { 34.0 } else { 20.0 });
    (direction * half, (direction / half).normalize())
}

/// Bodies by name.
fn body(name: &str, n: usize, stream: &mut Stream) -> Surface {
    let l_shape = [(0.0, 0.0), (30.0, 0.0), (30.0, 10.0), (10.0, 10.0), (10.0, 45.0), (0.0, 45.0)];
    match name {
        "box" => prism(&rectangle(12.0, 22.0), 35.0, n, stream),
        "square prism" => prism(&rectangle(15.0, 15.0), 30.0, n, stream),
        "cube" => prism(&rectangle(20.0, 20.0), 20.0, n, stream),
        "cylinder" => prism(&ring(120, |_| 15.0), 30.0, n, stream),
        "squat cylinder" => prism(&ring(120, |_| 25.0), 21.0, n, stream),
        "L" => prism(&l_shape.map(DVec2::from), 6.0, n, stream),
        "mug" => mug(n, stream),
        "wheel of 5" => wheel(5, n, stream),
        "wheel of 12" => wheel(12, n, stream),
        "egg" => (0..n).map(|_| on_an_egg(stream.direction())).collect(),
        _ => (0..n).map(|_| stream.direction()).map(|normal| (20.0 * normal, normal)).collect(),
    }
}

/// Samples a body with two seeds, in two poses, and checks the orders of its axes, and the
/// directions of the axes given by the body's frame.
#[track_caller]
fn check(name: &str, n: usize, directions: &[DVec3], orders: &[(AxisOrder, usize)]) {
    for seed in [101, 102] {
        let mut stream = Stream::new(seed, Purpose::Shape, 0);
        // A claim of symmetry needs more touches than its detection.
        let points = body(name, 1_500.min(2 * n), &mut stream);
        let pose = Pose::from_parts(stream.rotation(), stream.direction() * 10.0 * MM);
        let found = symmetry_of(&map(&points, &pose, &mut stream));
        let n_axes = |order| found.axes.iter().filter(|axis| axis.order == order).count();
        for (order, n_expected) in orders {
            assert_eq!(n_axes(*order), *n_expected, "{name} {seed} {order:?}: {found:?}");
        }
        let n_expected: usize = orders.iter().map(|order| order.1).sum();
        assert_eq!(found.axes.len(), n_expected, "{name} {seed}: {found:?}");
        for direction in directions {
            let direction = pose.turn(*direction);
            let nearest = found
                .axes
                .iter()
                .map(|axis| axis.direction.cross(direction).length())
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 1.5 * DEG, "{name} {seed}: {:.2}° off", nearest / DEG);
        }
        if let Some(axis) = directions.first() {
            let off = (found.center - pose.translation).reject_from_normalized(pose.turn(*axis));
            assert!(off.length() < 0.5 * MM, "{name} {seed}: {off}");
        }
    }
}

const TWO: AxisOrder = AxisOrder::Finite(2);

#[test]
fn a_box_has_three_half_turns() {
    check("box", 600, &DVec3::AXES, &[(TWO, 3)]);
}

#[test]
fn a_square_prism_has_quarter_turns_and_four_half_turns_across() {
    let diagonal = DVec3::new(1.0, 1.0, 0.0).normalize();
    let directions = [DVec3::Z, DVec3::X, diagonal];
    check("square prism", 600, &directions, &[(AxisOrder::Finite(4), 1), (TWO, 4)]);
}

#[test]
fn a_cube_has_all_its_thirteen_axes() {
    let diagonal = DVec3::ONE.normalize();
    let directions = [DVec3::Z, DVec3::X, diagonal];
    let orders = [(AxisOrder::Finite(4), 3), (AxisOrder::Finite(3), 4), (TWO, 6)];
    check("cube", 800, &directions, &orders);
}

#[test]
fn cylinders_are_continuous_and_turn_over_at_any_length() {
    for name in ["cylinder", "squat cylinder"] {
        check(name, 600, &[DVec3::Z], &[(AxisOrder::Continuous, 1), (TWO, 1)]);
    }
}

#[test]
fn an_egg_is_continuous_and_a_ball_in_every_direction() {
    check("egg", 500, &[DVec3::Z], &[(AxisOrder::Continuous, 1)]);
    check("ball", 500, &[], &[(AxisOrder::Continuous, 3)]);
}

#[test]
fn a_mug_with_a_handle_and_an_l_have_no_symmetry() {
    check("mug", 600, &[], &[]);
    check("L", 500, &[], &[]);
}

#[test]
fn wheels_have_as_many_turns_as_teeth() {
    check("wheel of 5", 700, &[DVec3::Z], &[(AxisOrder::Finite(5), 1), (TWO, 5)]);
}

#[test]
fn a_fine_wheel_has_all_its_turns_or_is_undetermined() {
    for (seed, n) in [(101, 900), (102, 900), (101, 1_500), (102, 1_500)] {
        let mut stream = Stream::new(seed, Purpose::Shape, 0);
        let points = body("wheel of 12", n, &mut stream);
        let pose = Pose::from_parts(stream.rotation(), stream.direction() * 10.0 * MM);
        let found = symmetry_of(&map(&points, &pose, &mut stream));
        let n_turns = found.axes.iter().filter(|axis| axis.order == AxisOrder::Finite(12)).count();
        let is_whole = n_turns == 1 && found.axes.len() == 13;
        assert!(found.axes.is_empty() || is_whole, "{seed} {n}: {found:?}");
    }
}

#[test]
fn the_answer_does_not_depend_on_the_number_of_threads() {
    let mut stream = Stream::new(103, Purpose::Shape, 0);
    let points = body("square prism", 1_200, &mut stream);
    let pose = Pose::from_parts(DQuat::from_rotation_x(0.4), DVec3::ZERO);
    let patches = map(&points, &pose, &mut stream);
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| symmetry_of(&patches))
    });
    assert!(!one.is_none());
    assert_eq!(one, three);
}

#[test]
fn few_or_equal_patches_have_no_symmetry() {
    let patch =
        MapPatch { position: [0.01, 0.0, 0.0], normal: [1.0, 0.0, 0.0], normal_confidence: 1.0 };
    for n in [0, PATCHES_MIN - 1, 200] {
        let found = Finding::of_touches(&presses(&vec![patch; n]));
        assert!(matches!(found, Finding::Undetermined { touches_needed: 1.. }), "{found:?}");
    }
}
