//! Bend: the curvature of the surface about each patch, which gives the surface between patches.
//!
//! Along a tangential displacement t the normal turns, n(t) ≈ n + S t, and the surface falls by
//! ½ tᵀ S t; S is symmetric, that of the second fundamental form. It is fitted to the normals of
//! the patches around, drawn towards a plane. The variances of the residuals are the scatter of
//! normals: large at edges, small on any smooth surface, curved or flat. The variances along the
//! touch's stretch and across it differ: on a ridge a sensor aligns with the ridge but may tilt
//! about it. All values follow from the patches; none are stored.

use glam::{Mat3, Vec2, Vec3};

use super::patch::SurfacePatch;

/// Radius within which neighbours determine the bend about a patch, in spacings.
const REACH_SPACINGS: f32 = 1.75;

/// Standard deviation of the neighbours' Gaussian weight, in spacings.
const WIDTH_SPACINGS: f32 = 1.0;

/// Least spacing, metres; closer touches are of one place.
const SPACING_MIN: f32 = 0.003;

/// Least cosine of a neighbour's normal with the patch's; below it the neighbour is on another
/// side.
const FACING_MIN: f32 = 0.2;

/// Largest share of a neighbour's offset along the normal; above it the neighbour is on another
/// side.
const STEEPEST: f32 = 0.7;

/// Prior deviation of the bend, rad/m.
const BEND_USUAL: f32 = 100.0;

/// Prior deviation of a normal along either axis, rad.
const MISS_USUAL: f32 = 0.1;

/// Weight of the prior, in patches.
const KNOWN: f32 = 2.0;

/// Least variance of normals along either axis, rad².
const VARIANCE_MIN: f32 = 0.002_5;

/// Largest variance of normals along either axis, rad².
pub const VARIANCE_MAX: f32 = 0.25;

/// The bend about one patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bend {
    /// xx, xy and yy of S, rad/m, along the touch's direction and across it.
    pub form: [f32; 3],
    /// Scatter of normals about the expected one: variances of the tangent of their angle along
    /// the touch's direction and across it, about rad².
    pub normal_variances: [f32; 2],
}

/// The bend about each of `patches`, which lie `spacing` metres apart. Equation R4a of
/// docs/recogniser.md.
#[must_use]
pub fn bends(patches: &[SurfacePatch], spacing: f32) -> Vec<Bend> {
    let spacing = spacing.max(SPACING_MIN);
    let reach = REACH_SPACINGS * spacing;
    let mut along_x: Vec<(f32, usize)> =
        patches.iter().enumerate().map(|(index, patch)| (patch.position.x, index)).collect();
    along_x.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let bend_of = |patch: &SurfacePatch| {
        let at = patch.position;
        let first = along_x.partition_point(|(x, _)| *x < at.x - reach);
        let within = along_x[first..].iter().take_while(|(x, _)| *x <= at.x + reach);
        let mut near: Vec<usize> = within
            .map(|(_, index)| *index)
            .filter(|index| patches[*index].position.distance_squared(at) <= reach * reach)
            .collect();
        // Sums stay the same whatever the order along x.
        near.sort_unstable();
        bend(patch, near.into_iter().map(|index| &patches[index]), spacing)
    };
    patches.iter().map(bend_of).collect()
}

/// A touch near another one, in that one's tangent plane.
struct Neighbour {
    weight: f32,
    /// Offset in the tangent plane, metres.
    way: Vec2,
    /// Turn of its normal: tangent of the angle along both axes.
    turn: Vec2,
}

fn bend<'a>(
    patch: &SurfacePatch,
    near: impl Iterator<Item = &'a SurfacePatch>,
    spacing: f32,
) -> Bend {
    let neighbours: Vec<Neighbour> =
        near.filter_map(|other| neighbour(patch, other, spacing)).collect();
    // Least squares of turn = S way for xx, xy, yy: rows (x, y, 0) and (0, x, y).
    let mut normal = Mat3::from_diagonal(Vec3::splat((MISS_USUAL / BEND_USUAL).powi(2)));
    let mut right = Vec3::ZERO;
    for Neighbour { weight, way, turn } in &neighbours {
        let rows = [(Vec3::new(way.x, way.y, 0.0), turn.x), (Vec3::new(0.0, way.x, way.y), turn.y)];
        for (row, turned) in rows {
            let weighed = *weight * row;
            normal += Mat3::from_cols(weighed * row.x, weighed * row.y, weighed * row.z);
            right += weighed * turned;
        }
    }
    let [xx, xy, yy] = (normal.inverse() * right).to_array();
    let mut squares = Vec2::splat(KNOWN * MISS_USUAL * MISS_USUAL);
    let mut weights = KNOWN;
    for Neighbour { weight, way, turn } in &neighbours {
        let expected = Vec2::new(xx * way.x + xy * way.y, xy * way.x + yy * way.y);
        let missed = expected - *turn;
        squares += *weight * missed * missed;
        weights += weight;
    }
    let variance = |sum: f32| (sum / weights).clamp(VARIANCE_MIN, VARIANCE_MAX);
    Bend { form: [xx, xy, yy], normal_variances: squares.to_array().map(variance) }
}

/// A touch as a neighbour of `patch`; `None` if it is far or on another side of the surface.
fn neighbour(patch: &SurfacePatch, other: &SurfacePatch, spacing: f32) -> Option<Neighbour> {
    let off = other.position - patch.position;
    let square = off.length_squared();
    let is_near = square > 0.0 && square <= (REACH_SPACINGS * spacing).powi(2);
    let is_along = off.dot(patch.normal).powi(2) <= STEEPEST * STEEPEST * square;
    if !is_near || !is_along || other.normal.dot(patch.normal) < FACING_MIN {
        return None;
    }
    let across = patch.normal.cross(patch.direction);
    let weight = (-0.5 * square / (WIDTH_SPACINGS * spacing).powi(2)).exp();
    let flat = |v: Vec3| Vec2::new(v.dot(patch.direction), v.dot(across));
    Some(Neighbour { weight, way: flat(off), turn: flat(other.normal) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::facet::Facet;
    use palpate_core::rng::{Purpose, Stream};

    fn patch(position: Vec3, normal: Vec3) -> SurfacePatch {
        SurfacePatch {
            position,
            normal,
            direction: normal.any_orthonormal_vector(),
            elongation: 0.0,
            normal_deviation: 0.1,
            feature: [0; 8],
        }
    }

    /// A cylinder of 10 mm radius about z with `n` random patches.
    fn cylinder(n: usize) -> Vec<SurfacePatch> {
        let mut stream = Stream::new(3, Purpose::Shape, 0);
        let mut touch = || {
            let angle = stream.uniform(0.0, std::f64::consts::TAU) as f32;
            let normal = Vec3::new(angle.cos(), angle.sin(), 0.0);
            patch(0.010 * normal + Vec3::Z * stream.uniform(-0.03, 0.03) as f32, normal)
        };
        (0..n).map(|_| touch()).collect()
    }

    #[test]
    fn a_touch_alone_is_taken_for_a_plane() {
        let alone = patch(Vec3::ZERO, Vec3::Z);
        let bend = bends(&[alone], 0.004)[0];
        assert!(bend.normal_variances.iter().all(|variance| (variance - 0.01).abs() < 1e-8));
        let facet = Facet::new(&alone, &bend);
        let (height, normal) = facet.surface_at(Vec3::new(0.003, -0.002, 0.001));
        assert!((height - 0.001).abs() < 1e-9 && normal.distance(Vec3::Z) < 1e-6);
    }

    #[test]
    fn between_touches_a_cylinder_is_where_it_is() {
        // 3,770 mm² in 600 touches: 2.5 mm apart.
        let patches = cylinder(600);
        let bends = bends(&patches, 0.0025);
        let (mut planes, mut heights, mut turns) = (0.0f32, 0.0f32, 0.0f32);
        for (patch, bend) in patches.iter().zip(&bends).filter(|(p, _)| p.position.z.abs() < 0.02) {
            // A quarter of a radian further around: 2.5 mm, where the plane is 0.31 mm off.
            let normal = glam::Quat::from_rotation_z(0.25) * patch.normal;
            let off = 0.010 * (normal - patch.normal);
            let (height, expected) = Facet::new(patch, bend).surface_at(off);
            planes = planes.max(off.dot(patch.normal).abs());
            heights = heights.max(height.abs());
            turns = turns.max(expected.angle_between(normal));
        }
        assert!((planes - 0.000_31).abs() < 0.000_01, "{planes}");
        assert!(heights < 0.000_12 && turns < 0.1, "{heights} m, {turns} rad");
    }

    #[test]
    fn normals_scatter_at_edges_and_not_on_smooth_bends() {
        let smooth = bends(&cylinder(600), 0.0025);
        let mean = |bends: &[Bend]| {
            bends.iter().map(|b| b.normal_variances.iter().sum::<f32>().sqrt()).sum::<f32>()
                / bends.len() as f32
        };
        assert!(mean(&smooth) < 0.1, "{}", mean(&smooth));
        // Both sides of a ridge of 90° along y, 1 mm and 4 mm off it.
        let side = |sign: f32| {
            let normal = Vec3::new(sign, 0.0, 1.0).normalize();
            let down = Vec3::new(sign, 0.0, -1.0).normalize();
            let row = |off: f32| (0..9).map(move |n| off * down + 0.003 * n as f32 * Vec3::Y);
            row(0.001).chain(row(0.004)).map(move |at| patch(at, normal)).collect::<Vec<_>>()
        };
        // Faces at right angles have no common bend; those of a blunter ridge do.
        let sharp = bends(&[side(1.0), side(-1.0)].concat(), 0.003);
        assert!(mean(&sharp) < 0.15, "{}", mean(&sharp));
        let blunt: Vec<SurfacePatch> = [side(1.0), side(-1.0)]
            .concat()
            .into_iter()
            .map(|p| patch(p.position, (p.normal + 0.6 * Vec3::Z).normalize()))
            .collect();
        assert!(mean(&bends(&blunt, 0.003)) > 0.15, "{}", mean(&bends(&blunt, 0.003)));
    }

    #[test]
    fn about_a_ridge_normals_scatter_and_along_it_they_do_not() {
        // Touches along y lean 0.4 rad to alternating sides; contacts are stretched along y.
        let ridge: Vec<SurfacePatch> = (0..20)
            .map(|n| {
                let side = if n % 2 == 0 { 0.4f32 } else { -0.4 };
                let normal = Vec3::new(side.sin(), 0.0, side.cos());
                let touch = patch(0.002 * n as f32 * Vec3::Y, normal);
                SurfacePatch { direction: Vec3::Y, ..touch }
            })
            .collect();
        let [along, across] = bends(&ridge, 0.003)[10].normal_variances;
        assert!(along < 0.01 && across > 0.1, "{along} {across}");
    }
}
