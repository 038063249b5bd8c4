//! Voxels: which touches of a map lie near a point, by one look-up.
//!
//! The map's box, grown by `reach`, is cut into cubes; a cube whose centre is within reach of a
//! touch lists the nearest few, nearest first. Cubes far from the surface share the empty list.
//! The cubes are bounded in number: of large objects they are larger, and reach grows with them.

use glam::{UVec3, Vec3};

/// The most touches a voxel lists.
pub const NEAR_MAX: usize = 6;

/// The most cubes along an axis.
const CUBES_MAX: f32 = 120.0;

/// What a voxel without any touch in reach holds.
const EMPTY: u16 = u16::MAX;

/// The touches near each point of an object's box.
#[derive(Clone, Debug, PartialEq)]
pub struct Voxels {
    min: Vec3,
    inverse_edge: f32,
    n: UVec3,
    /// Which list each cube has, x fastest; [`EMPTY`] for none.
    lists: Vec<u16>,
    /// [`NEAR_MAX`] touches a list, the last repeated markers of nothing.
    near: Vec<[u16; NEAR_MAX]>,
}

impl Voxels {
    /// Cubes of `edge` metres about touches at `positions`; a cube lists the touches within
    /// `reach` (m) of its centre. At most 65,535 touches.
    #[must_use]
    pub fn build(positions: &[Vec3], edge: f32, reach: f32) -> Self {
        let low = positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        if positions.is_empty() {
            let (lists, near) = (Vec::new(), Vec::new());
            return Self { min: Vec3::ZERO, inverse_edge: 1.0, n: UVec3::ZERO, lists, near };
        }
        // An object may have any size: the cubes are bounded, not their edge. With a reach of an
        // edge each touch is listed at least by the cube that it is in.
        let edge = edge.max((high - low).max_element() / (CUBES_MAX - 2.0));
        let reach = reach.max(edge);
        let min = low - Vec3::splat(reach);
        let extent = high - low + Vec3::splat(2.0 * reach);
        let n = (extent / edge).ceil().as_uvec3().max(UVec3::ONE);
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
                            found.push((place(cube, n) as u32, distance, index as u16));
                        }
                    }
                }
            }
        }
        found.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        let mut lists = vec![EMPTY; (n.x * n.y * n.z) as usize];
        let cubes = found.chunk_by(|a, b| a.0 == b.0).take(usize::from(EMPTY));
        let mut near = Vec::with_capacity(cubes.clone().count());
        for cube in cubes {
            let mut touches = [EMPTY; NEAR_MAX];
            for (slot, (_, _, touch)) in touches.iter_mut().zip(cube) {
                *slot = *touch;
            }
            lists[cube[0].0 as usize] = near.len() as u16;
            near.push(touches);
        }
        Self { min, inverse_edge: edge.recip(), n, lists, near }
    }

    /// The touches near a point of the object frame, nearest to the point's cube first.
    #[inline]
    pub fn near(&self, point: Vec3) -> impl Iterator<Item = u16> + '_ {
        let found: &[u16] = match self.list(point) {
            Some(list) => &self.near[usize::from(list)],
            None => &[],
        };
        found.iter().copied().take_while(|touch| *touch != EMPTY)
    }

    #[inline]
    fn list(&self, point: Vec3) -> Option<u16> {
        let scaled = (point - self.min) * self.inverse_edge;
        if scaled.min_element() < 0.0 || !scaled.is_finite() {
            return None;
        }
        let cube = scaled.as_uvec3();
        if cube.cmpge(self.n).any() {
            return None;
        }
        let list = self.lists[place(cube, self.n)];
        (list != EMPTY).then_some(list)
    }

    /// Bytes in memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.lists.as_slice()) + size_of_val(self.near.as_slice())
    }
}

#[inline]
fn place(cube: UVec3, n: UVec3) -> usize {
    ((cube.z * n.y + cube.y) * n.x + cube.x) as usize
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
            let found: Vec<u16> = voxels.near(point).collect();
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
            assert_eq!(voxels.near(point).count(), 0, "{point}");
        }
        assert_eq!(Voxels::build(&[], EDGE, REACH).near(Vec3::ZERO).count(), 0);
    }

    #[test]
    fn a_huge_object_has_larger_cubes_and_loses_no_touch() {
        // 100 m across: cubes of about 0.85 m, far beyond the reach that was asked for.
        let positions: Vec<Vec3> = on_a_sphere(50).iter().map(|p| *p * (50.0 / 0.03)).collect();
        let voxels = Voxels::build(&positions, EDGE, REACH);
        for (index, position) in positions.iter().enumerate() {
            assert!(voxels.near(*position).any(|touch| usize::from(touch) == index), "{index}");
        }
        assert!(voxels.bytes() < 4_000_000, "{}", voxels.bytes());
    }
}
