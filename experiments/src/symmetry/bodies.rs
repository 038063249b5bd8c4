//! Twenty solids of known symmetry: ten, and the same ten with a handle or a notch.
//!
//! Each is a stack of rings about z whose radius depends on the angle, closed at both ends; a
//! seed decides the sizes. Handles stand off and notches lie away from the middle, each at least
//! as wide as a contact, so that no rotation preserves them. With a dent alone, a ball would
//! keep every rotation about the dent; the ball therefore has a leaning handle. Sizes in
//! millimetres here; meshes in metres.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::symmetry::AxisOrder;
use palpate_core::units::MM;
use palpate_sim::mesh::Mesh;

use crate::objects::TestObject;

/// Corners of a ring, a multiple of every order of the bodies.
const AROUND: usize = 240;

/// Rings of a body.
const ALONG: usize = 80;

/// Outline of a body: radius (mm) by angle (rad) and height (0 at the bottom, 1 at the top).
type Radius<'a> = dyn Fn(f64, f64) -> f64 + 'a;

/// A notch of a body or a handle on it.
#[derive(Clone, Copy)]
enum Mark {
    /// A bar of this radius from one height (share) to another, at this distance from the body, mm.
    /// It leans towards its upper end by the share `lean` of half its length.
    Handle { from: f64, to: f64, off: f64, thick: f64, lean: f64 },
    /// This deep (mm), over a width (mm along the surface) and between heights (share).
    Notch { from: f64, to: f64, depth: f64, width: f64 },
}

/// A body with its mark and its true symmetry.
pub(super) struct Body {
    pub(super) object: TestObject,
    /// The orders of its axes, the highest first; none with a handle or a notch.
    pub(super) orders: Vec<AxisOrder>,
}

/// Axes of a regular solid: its sides, and half turns across when both ends are alike.
fn sides(n: u8, across: bool) -> Vec<AxisOrder> {
    let flips = if across { n } else { 0 };
    let half_turns = std::iter::repeat_n(AxisOrder::Finite(2), usize::from(flips));
    std::iter::once(AxisOrder::Finite(n)).chain(half_turns).collect()
}

/// The axes of a round body: any turn, and a half turn across when both ends are alike.
fn round(flips: bool) -> Vec<AxisOrder> {
    let over = flips.then_some(AxisOrder::Finite(2));
    std::iter::once(AxisOrder::Continuous).chain(over).collect()
}

/// A handle from a height (share) on.
fn handle(from: f64) -> Mark {
    Mark::Handle { from, to: from + 0.42, off: 13.0, thick: 4.0, lean: 0.0 }
}

/// A notch this deep (mm) from a height (share) on.
fn notch(from: f64, depth: f64) -> Mark {
    Mark::Notch { from, to: from + 0.38, depth, width: 30.0 }
}

/// The twenty bodies of a seed, those with a handle or a notch last.
pub(super) fn bodies(seed: u64) -> anyhow::Result<Vec<Body>> {
    let mut stream = Stream::new(seed, Purpose::Shape, 0);
    let mut draw = |low: f64, high: f64| stream.uniform(low, high);
    let mut bodies = Vec::new();
    for mark in [None, Some(())] {
        let mut add =
            |name: &str, orders: Vec<AxisOrder>, height: f64, radius: &Radius<'_>, own| {
                let marked = mark.map(|()| own);
                let solid = solid(height, radius, marked)?;
                let ending = match marked {
                    None => "",
                    Some(Mark::Handle { .. }) => " with handle",
                    Some(Mark::Notch { .. }) => " with notch",
                };
                let mesh = solid.translated(-solid.centroid());
                let object = TestObject { name: format!("{name}{ending}"), mesh };
                let orders = if marked.is_some() { Vec::new() } else { orders };
                bodies.push(Body { object, orders });
                anyhow::Ok(())
            };
        let r = draw(15.0, 20.0);
        add("cylinder", round(true), draw(65.0, 80.0), &|_, _| r, handle(draw(0.43, 0.52)))?;
        let (low, high) = (draw(12.0, 15.0), draw(20.0, 24.0));
        add(
            "tumbler",
            round(false),
            draw(60.0, 75.0),
            &|_, up| low + (high - low) * up,
            handle(draw(0.1, 0.3)),
        )?;
        let (body, neck) = (draw(15.0, 18.0), draw(6.0, 8.0));
        let profile = move |up: f64| neck + (body - neck) * smooth((0.78 - up) / 0.2);
        add("round bottle", round(false), 80.0, &|_, up| profile(up), handle(draw(0.1, 0.2)))?;
        for (n, narrow) in [(16, draw(15.5, 18.0)), (6, draw(14.0, 17.0))] {
            let neck = 0.45 * narrow;
            let profile = move |up: f64| neck + (narrow - neck) * smooth((0.8 - up) / 0.2);
            let own = if n == 16 { notch(draw(0.1, 0.3), 5.0) } else { handle(draw(0.1, 0.2)) };
            let sided = |angle: f64, up: f64| profile(up) * flat(angle, n);
            add(&format!("bottle of {n} sides"), sides(n, false), 80.0, &sided, own)?;
        }
        let ball = draw(24.0, 29.0);
        let sphere = |_: f64, up: f64| 2.0 * ball * (up * (1.0 - up)).max(1e-4).sqrt();
        add(
            "ball",
            vec![AxisOrder::Continuous; 3],
            2.0 * ball,
            &sphere,
            Mark::Handle { from: draw(0.2, 0.3), to: 0.75, off: 16.0, thick: 4.0, lean: 0.8 },
        )?;
        for (name, n, size) in [
            ("triangular prism", 3, draw(20.0, 24.0)),
            ("square prism", 4, draw(17.0, 21.0)),
            ("hexagonal prism", 6, draw(16.0, 20.0)),
        ] {
            // A side on +x: a notch that cut an edge would be narrower than a contact.
            let sided = |angle: f64, _: f64| size * flat(angle + PI / f64::from(n), n);
            add(
                name,
                sides(n, true),
                draw(55.0, 75.0),
                &sided,
                notch(draw(0.02, 0.12), draw(5.0, 7.0)),
            )?;
        }
        let half = DVec2::new(draw(10.0, 13.0), draw(17.0, 21.0));
        let sided = |angle: f64, _: f64| {
            let (sin, cos) = angle.sin_cos();
            (half.x / cos.abs().max(1e-9)).min(half.y / sin.abs().max(1e-9))
        };
        add(
            "box",
            vec![AxisOrder::Finite(2); 3],
            draw(60.0, 75.0),
            &sided,
            notch(draw(0.02, 0.12), draw(5.0, 7.0)),
        )?;
    }
    Ok(bodies)
}

/// The distance of a regular outline of `n` sides from its middle, 1 at its corners.
fn flat(angle: f64, n: u8) -> f64 {
    let step = TAU / f64::from(n);
    (0.5 * step).cos() / (angle.rem_euclid(step) - 0.5 * step).cos()
}

/// Smooth step from 0 to 1.
fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A closed stack of rings, with a mark on its +x side.
fn solid(height: f64, radius: &Radius<'_>, mark: Option<Mark>) -> anyhow::Result<Mesh> {
    let marked = |angle: f64, up: f64| {
        let plain = radius(angle, up);
        match mark {
            Some(Mark::Notch { from, to, depth, width }) => {
                let off = (angle + PI).rem_euclid(TAU) - PI;
                let is_in = (from..to).contains(&up) && (off * plain).abs() < 0.5 * width;
                // A cut with a flat ground across x.
                let ground = (radius(0.0, 0.5 * (from + to)) - depth) / off.cos();
                if is_in { plain.min(ground) } else { plain }
            }
            _ => plain,
        }
    };
    let mut vertices = Vec::with_capacity(AROUND * (ALONG + 1) + 2);
    for ring in 0..=ALONG {
        // Denser towards the ends, where a ball closes.
        let up = 0.5 - 0.5 * (PI * ring as f64 / ALONG as f64).cos();
        for corner in 0..AROUND {
            let angle = TAU * corner as f64 / AROUND as f64;
            let out = marked(angle, up) * DVec2::from_angle(angle);
            vertices.push(out.extend(height * (up - 0.5)) * MM);
        }
    }
    let ends = vertices.len() as u32;
    vertices.extend([-0.5, 0.5].map(|end| DVec3::new(0.0, 0.0, end * height) * MM));
    let mut triangles = Vec::new();
    let at = |ring: usize, corner: usize| (ring * AROUND + corner % AROUND) as u32;
    for corner in 0..AROUND {
        for ring in 0..ALONG {
            let (a, b) = (at(ring, corner), at(ring, corner + 1));
            let (c, d) = (at(ring + 1, corner), at(ring + 1, corner + 1));
            triangles.extend([[a, b, d], [a, d, c]]);
        }
        triangles.push([ends, at(0, corner + 1), at(0, corner)]);
        triangles.push([ends + 1, at(ALONG, corner), at(ALONG, corner + 1)]);
    }
    if let Some(Mark::Handle { from, to, off, thick, lean }) = mark {
        let foot = |up: f64| DVec2::new(radius(0.0, up), height * (up - 0.5));
        bow([foot(from), foot(to)], [off, thick, lean], &mut vertices, &mut triangles);
    }
    Ok(Mesh::new(vertices, triangles)?)
}

/// A bar bent from one foot (x and z, mm) to another, its ends inside the body, with its
/// distance from the body (mm), its radius (mm) and its lean.
fn bow(
    [low, high]: [DVec2; 2],
    [off, thick, lean]: [f64; 3],
    vertices: &mut Vec<DVec3>,
    triangles: &mut Vec<[u32; 3]>,
) {
    const STEPS: usize = 32;
    const ROUND: usize = 16;
    let first = vertices.len() as u32;
    // Half an ellipse, begun and ended 3 mm inside the body.
    let middle = |t: f64| {
        let along = low.lerp(high, 0.5 - 0.5 * (PI * t).cos());
        let out = off * (PI * t).sin() - 3.0 * (1.0 - (PI * t).sin());
        along + DVec2::new(out, 0.5 * lean * (high - low).length() * (PI * t).sin())
    };
    for step in 0..=STEPS {
        let t = step as f64 / STEPS as f64;
        let way = (middle((t + 1e-4).min(1.0)) - middle((t - 1e-4).max(0.0))).normalize();
        let outward = DVec3::new(way.y, 0.0, -way.x);
        let center = middle(t);
        for corner in 0..ROUND {
            let (sin, cos) = (TAU * corner as f64 / ROUND as f64).sin_cos();
            let at = DVec3::new(center.x, 0.0, center.y) + thick * (cos * outward + sin * DVec3::Y);
            vertices.push(at * MM);
        }
    }
    let at = |step: usize, corner: usize| first + (step * ROUND + corner % ROUND) as u32;
    for corner in 0..ROUND {
        for step in 0..STEPS {
            let (a, b) = (at(step, corner), at(step, corner + 1));
            let (c, d) = (at(step + 1, corner), at(step + 1, corner + 1));
            triangles.extend([[a, b, d], [a, d, c]]);
        }
        if (1..ROUND - 1).contains(&corner) {
            triangles.push([at(0, 0), at(0, corner + 1), at(0, corner)]);
            triangles.push([at(STEPS, 0), at(STEPS, corner), at(STEPS, corner + 1)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_are_closed_outward_and_smaller_than_the_examples() {
        for Body { object, .. } in bodies(1).unwrap() {
            let mesh = &object.mesh;
            assert!(mesh.is_watertight(), "{}", object.name);
            assert!(mesh.signed_volume() > 0.0, "{}", object.name);
            let size = mesh.largest_dimension();
            assert!((40.0 * MM..=85.0 * MM).contains(&size), "{}: {size}", object.name);
        }
    }
}
