//! Voxels: which touches of a map lie near a point, by one look-up.
//!
//! The map's box, grown by `reach`, is cut into cubes; a cube within reach of a touch lists the
//! nearest few, nearest first. Cubes far from the surface share the empty list.

use glam::{UVec3, Vec3};

/// The most touches a voxel lists.
pub const NEAR_MAX: usize = 6;

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
        let min = low - Vec3::splat(reach);
        // A session may know an object of any size: the cubes are bounded, not their edge.
        let extent = high - low + Vec3::splat(2.0 * reach);
        let edge = edge.max(extent.max_element() / 120.0);
        let n = (extent / edge).ceil().as_uvec3().max(UVec3::ONE);
        let mut found = vec![Vec::<(f32, u16)>::new(); (n.x * n.y * n.z) as usize];
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
                            found[place(cube, n)].push((distance, index as u16));
                        }
                    }
                }
            }
        }
        let mut near = Vec::new();
        let lists = found.into_iter().map(|mut list| {
            if list.is_empty() || near.len() >= usize::from(EMPTY) {
                return EMPTY;
            }
            list.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let mut touches = [EMPTY; NEAR_MAX];
            for (slot, (_, touch)) in touches.iter_mut().zip(&list) {
                *slot = *touch;
            }
            near.push(touches);
            (near.len() - 1) as u16
        });
        let lists = lists.collect();
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
