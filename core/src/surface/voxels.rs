//! Voxels: which touches of a map lie near a point, by one look-up.
//!
//! The map's box, grown by `reach`, is cut into cubes; a cube whose centre is within reach of a
//! touch lists the nearest few, nearest first. Cubes far from the surface have no list. Cubes
//! stand together in bricks of 4 × 4 × 4, which know by a bit each which of them have a list:
//! an object's bricks are a few kilobytes, which neighbouring look-ups share.
//! The cubes are bounded in number: of large objects they are larger, and reach grows with them.

use glam::{UVec3, Vec3};

/// The most touches a voxel lists.
pub const NEAR_MAX: usize = 6;

/// The most cubes along an axis.
const CUBES_MAX: f32 = 120.0;

/// Cubes along the edge of a brick, and in it.
const BRICK: u32 = 4;
const CUBES_OF_BRICK: u32 = BRICK.pow(3);

/// Fills up a list of fewer touches.
const NONE: u16 = u16::MAX;

/// The touches near a cube: their indices, nearest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Near([u16; NEAR_MAX]);

impl Near {
    const EMPTY: Self = Self([NONE; NEAR_MAX]);

    /// The touches, nearest to the cube first.
    #[inline]
    pub fn touches(self) -> impl Iterator<Item = u16> {
        self.0.into_iter().take_while(|touch| *touch != NONE)
    }
}

/// Which of some neighbouring cubes have a list.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Brick {
    /// A bit for each cube, x fastest.
    listed: u64,
    /// Where the lists of its cubes begin.
    first: u32,
}

/// The touches near each point of an object's box.
#[derive(Clone, Debug, PartialEq)]
pub struct Voxels {
    min: Vec3,
    inverse_edge: f32,
    /// Cubes and bricks along each axis.
    n: UVec3,
    n_bricks: UVec3,
    /// x fastest.
    bricks: Vec<Brick>,
    /// In the order of the bricks, then of the cubes in each.
    near: Vec<Near>,
}

impl Voxels {
    /// Cubes of `edge` metres about touches at `positions`; a cube lists the touches within
    /// `reach` (m) of its centre. At most 65,535 touches.
    #[must_use]
    pub fn build(positions: &[Vec3], edge: f32, reach: f32) -> Self {
        let low = positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        if positions.is_empty() {
            let (bricks, near) = (Vec::new(), Vec::new());
            let n = UVec3::ZERO;
            return Self { min: Vec3::ZERO, inverse_edge: 1.0, n, n_bricks: n, bricks, near };
        }
        // An object may have any size: the cubes are bounded, not their edge. With a reach of an
        // edge each touch is listed at least by the cube that it is in.
        let edge = edge.max((high - low).max_element() / (CUBES_MAX - 2.0));
        let reach = reach.max(edge);
        let min = low - Vec3::splat(reach);
        let extent = high - low + Vec3::splat(2.0 * reach);
        let n = (extent / edge).ceil().as_uvec3().max(UVec3::ONE);
        let n_bricks = (n + UVec3::splat(BRICK - 1)) / BRICK;
        // One list, sorted by cube, then distance: a small list a cube would leave the memory in
        // pieces that no other object fits into.
        let mut found: Vec<(u32, f32, u16)> = Vec::new();
        for (index, position) in positions.iter().enumerate() {
            let first = ((*position - min - Vec3::splat(reach)) / edge).floor().max(Vec3::ZERO);
            let last = ((*position - min + Vec3::splat(reach)) / edge).floor();
            let (first, last) = (first.as_uvec3(), last.as_uvec3().min(n - UVec3::ONE));
            for z in first.z..=last.z {
                for y in first.y..=last.y {
                    for x in first.x..=last.x {
                        let cube = UVec3::new(x, y, z);
                        let center = min + (cube.as_vec3() + Vec3::splat(0.5)) * edge;
                        let distance = center.distance_squared(*position);
                        if distance <= reach * reach {
                            let (brick, cube) = place(cube, n_bricks);
                            let key = brick as u32 * CUBES_OF_BRICK + cube;
                            found.push((key, distance, index as u16));
                        }
                    }
                }
            }
        }
        found.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        let mut bricks = vec![Brick::default(); n_bricks.element_product() as usize];
        let cubes = found.chunk_by(|a, b| a.0 == b.0);
        let mut near = Vec::with_capacity(cubes.clone().count());
        for cube in cubes {
            let (brick, bit) = (cube[0].0 / CUBES_OF_BRICK, cube[0].0 % CUBES_OF_BRICK);
            let brick = &mut bricks[brick as usize];
            if brick.listed == 0 {
                brick.first = near.len() as u32;
            }
            brick.listed |= 1 << bit;
            let mut touches = Near::EMPTY;
            for (slot, (_, _, touch)) in touches.0.iter_mut().zip(cube) {
                *slot = *touch;
            }
            near.push(touches);
        }
        Self { min, inverse_edge: edge.recip(), n, n_bricks, bricks, near }
    }

    /// The touches near a point of the object frame.
    #[inline]
    #[must_use]
    pub fn near(&self, point: Vec3) -> Near {
        let scaled = (point - self.min) * self.inverse_edge;
        if scaled.min_element() < 0.0 || !scaled.is_finite() {
            return Near::EMPTY;
        }
        let cube = scaled.as_uvec3();
        if cube.cmpge(self.n).any() {
            return Near::EMPTY;
        }
        let (brick, bit) = place(cube, self.n_bricks);
        let Brick { listed, first } = self.bricks[brick];
        if listed >> bit & 1 == 0 {
            return Near::EMPTY;
        }
        let before = listed & ((1 << bit) - 1);
        self.near[(first + before.count_ones()) as usize]
    }

    /// Bytes in memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.bricks.as_slice()) + size_of_val(self.near.as_slice())
    }
}

/// The brick of a cube, and which of the brick's cubes it is.
#[inline]
fn place(cube: UVec3, n_bricks: UVec3) -> (usize, u32) {
    let (brick, within) = (cube / BRICK, cube % BRICK);
    let in_order = |at: UVec3, n: UVec3| (at.z * n.y + at.y) * n.x + at.x;
    (in_order(brick, n_bricks) as usize, in_order(within, UVec3::splat(BRICK)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};

    const EDGE: f32 = 0.003;
    const REACH: f32 = 0.007;

    fn on_a_sphere(n: usize) -> Vec<Vec3> {
        let mut stream = Stream::new(1, Purpose::Shape, 0);
        (0..n).map(|_| 0.03 * stream.direction().as_vec3()).collect()
    }

    /// By definition: the nearest six within reach of the centre of the point's cube.
    fn brute_force(positions: &[Vec3], point: Vec3) -> Vec<u16> {
        let min = positions.iter().copied().fold(Vec3::INFINITY, Vec3::min) - Vec3::splat(REACH);
        let center = min + (((point - min) / EDGE).floor() + Vec3::splat(0.5)) * EDGE;
        let mut near: Vec<(f32, u16)> = positions
            .iter()
            .enumerate()
            .map(|(index, position)| (center.distance(*position), index as u16))
            .filter(|(distance, _)| *distance <= REACH)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.truncate(NEAR_MAX);
        near.into_iter().map(|(_, index)| index).collect()
    }

    #[test]
    fn near_is_what_a_search_of_all_touches_finds() {
        let positions = on_a_sphere(300);
        let voxels = Voxels::build(&positions, EDGE, REACH);
        let mut stream = Stream::new(2, Purpose::Shape, 0);
        let mut n_found = 0;
        for _ in 0..2_000 {
            let point = (stream.uniform(0.02, 0.04) * stream.direction()).as_vec3();
            let found: Vec<u16> = voxels.near(point).touches().collect();
            // A centre that is just within reach may round either way.
            let expected = brute_force(&positions, point);
            if found.len() == NEAR_MAX || found.len() == expected.len() {
                assert_eq!(found, expected, "{point}");
            }
            n_found += found.len();
        }
        assert!(n_found > 2_000, "{n_found}");
    }

    #[test]
    fn away_from_the_surface_nothing_is_near() {
        let voxels = Voxels::build(&on_a_sphere(300), EDGE, REACH);
        let away = [Vec3::ZERO, Vec3::splat(1.0), Vec3::splat(-1.0), Vec3::splat(f32::NAN)];
        for point in away {
            assert_eq!(voxels.near(point).touches().count(), 0, "{point}");
        }
        assert_eq!(Voxels::build(&[], EDGE, REACH).near(Vec3::ZERO).touches().count(), 0);
    }

    #[test]
    fn a_huge_object_has_larger_cubes_and_loses_no_touch() {
        // 100 m across: cubes of about 0.85 m, far beyond the reach that was asked for.
        let positions: Vec<Vec3> = on_a_sphere(50).iter().map(|p| *p * (50.0 / 0.03)).collect();
        let voxels = Voxels::build(&positions, EDGE, REACH);
        for (index, position) in positions.iter().enumerate() {
            assert!(
                voxels.near(*position).touches().any(|touch| usize::from(touch) == index),
                "{index}"
            );
        }
        assert!(voxels.bytes() < 4_000_000, "{}", voxels.bytes());
    }
}
