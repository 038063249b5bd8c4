//! Voxels: the patches near a point, by one look-up.
//!
//! The map's box, grown by `reach`, is cut into cubes; a cube whose centre is within reach of a
//! patch lists the nearest few, nearest first, and the number that each represents (`near`).
//! Cubes far from the surface have no list. Cubes are grouped in bricks of 4 × 4 × 4, with a bit
//! for each cube that has a list: an object's bricks are a few kilobytes, which neighbouring
//! look-ups share. The number of cubes is bounded: those of large objects are larger, and the
//! reach grows with them.

use glam::{UVec3, Vec3};

use super::near::{LeftOut, Near, weight};

/// Maximum number of cubes along an axis.
const CUBES_MAX: f32 = 120.0;

/// Cubes along the edge of a brick.
const BRICK: u32 = 4;

/// Cubes in a brick.
const CUBES_OF_BRICK: u32 = BRICK.pow(3);

/// Cutoff of the Gaussian about a cube, in deviations: it omits e^-3.1 of the mass in a plane, 4 %.
const WIDTHS: f32 = 2.5;

/// The lists of some neighbouring cubes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Brick {
    /// A bit for each cube, x fastest.
    listed: u64,
    /// Index of the first list of its cubes.
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
    /// Bricks, x fastest.
    bricks: Vec<Brick>,
    /// Lists in the order of the bricks, then of the cubes in each.
    near: Vec<Near>,
}

impl Voxels {
    /// Cubes of `edge` metres about touches at `places` (position, normal); a cube lists touches
    /// within `reach` (m) of its centre, and they represent all about it with a Gaussian weight
    /// of deviation `reach` over `widths`. At most 65,535 touches.
    #[must_use]
    pub fn build(places: &[(Vec3, Vec3)], edge: f32, reach: f32, widths: f32) -> Self {
        let low = places.iter().map(|place| place.0).fold(Vec3::INFINITY, Vec3::min);
        let high = places.iter().map(|place| place.0).fold(Vec3::NEG_INFINITY, Vec3::max);
        if places.is_empty() {
            let (bricks, near) = (Vec::new(), Vec::new());
            let n = UVec3::ZERO;
            return Self { min: Vec3::ZERO, inverse_edge: 1.0, n, n_bricks: n, bricks, near };
        }
        // An object may have any size: the number of cubes is bounded, not their edge. A reach
        // of at least an edge lists each touch at least in its own cube.
        let edge = edge.max((high - low).max_element() / (CUBES_MAX - 2.0));
        let reach = reach.max(edge);
        let min = low - Vec3::splat(reach);
        let extent = high - low + Vec3::splat(2.0 * reach);
        let n = (extent / edge).ceil().as_uvec3().max(UVec3::ONE);
        let n_bricks = (n + UVec3::splat(BRICK - 1)) / BRICK;
        let cubes = Cubes { min, edge, n };
        // One list, sorted by cube, then distance: one small list per cube would fragment the
        // memory.
        let mut found: Vec<(u32, f32, u16)> = Vec::new();
        for (index, (position, _)) in places.iter().enumerate() {
            cubes.within(*position, reach, |cube, distance| {
                let (brick, cube) = place(cube, n_bricks);
                found.push((brick as u32 * CUBES_OF_BRICK + cube, distance, index as u16));
            });
        }
        found.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        let mut bricks = vec![Brick::default(); n_bricks.element_product() as usize];
        let listed = found.chunk_by(|a, b| a.0 == b.0);
        let mut near = Vec::with_capacity(listed.clone().count());
        for cube in listed {
            let (brick, bit) = (cube[0].0 / CUBES_OF_BRICK, cube[0].0 % CUBES_OF_BRICK);
            let brick = &mut bricks[brick as usize];
            if brick.listed == 0 {
                brick.first = near.len() as u32;
            }
            brick.listed |= 1 << bit;
            near.push(Near::choose(cube.iter().map(|found| found.2), places));
        }
        let mut voxels = Self { min, inverse_edge: edge.recip(), n, n_bricks, bricks, near };
        voxels.count(places, &cubes, reach / widths);
        voxels
    }

    /// Counts the patches that each listed one represents, by a Gaussian of this `width` (m).
    /// Equation R8 of docs/recogniser.md.
    fn count(&mut self, places: &[(Vec3, Vec3)], cubes: &Cubes, width: f32) {
        let inverse_variance = width.powi(-2);
        let mut left_out = vec![LeftOut::default(); self.near.len()];
        for (index, (position, _)) in places.iter().enumerate() {
            cubes.within(*position, WIDTHS * width, |cube, square| {
                if let Some(list) = self.list(cube) {
                    let weight = weight(square, inverse_variance);
                    left_out[list].count(&self.near[list], index as u16, weight, places);
                }
            });
        }
        for z in 0..self.n.z {
            for y in 0..self.n.y {
                for x in 0..self.n.x {
                    let cube = UVec3::new(x, y, z);
                    let Some(list) = self.list(cube) else { continue };
                    let center = cubes.center(cube);
                    left_out[list].settle(&mut self.near[list], |touch| {
                        let square = center.distance_squared(places[usize::from(touch)].0);
                        weight(square, inverse_variance)
                    });
                }
            }
        }
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
        self.list(cube).map_or(Near::EMPTY, |list| self.near[list])
    }

    /// Index of a cube's list.
    #[inline]
    fn list(&self, cube: UVec3) -> Option<usize> {
        let (brick, bit) = place(cube, self.n_bricks);
        let Brick { listed, first } = self.bricks[brick];
        if listed >> bit & 1 == 0 {
            return None;
        }
        let before = listed & ((1 << bit) - 1);
        Some((first + before.count_ones()) as usize)
    }

    /// Bytes in memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.bricks.as_slice()) + size_of_val(self.near.as_slice())
    }
}

/// The cubes that a box is cut into.
struct Cubes {
    min: Vec3,
    edge: f32,
    n: UVec3,
}

impl Cubes {
    fn center(&self, cube: UVec3) -> Vec3 {
        self.min + (cube.as_vec3() + Vec3::splat(0.5)) * self.edge
    }

    /// Calls `found` with every cube whose centre is within `reach` (m) of a point, and the
    /// squared distance.
    fn within(&self, point: Vec3, reach: f32, mut found: impl FnMut(UVec3, f32)) {
        let corner = |by: f32| ((point - self.min + Vec3::splat(by)) / self.edge).floor();
        let first = corner(-reach).max(Vec3::ZERO).as_uvec3();
        let last = corner(reach).as_uvec3().min(self.n - UVec3::ONE);
        for z in first.z..=last.z {
            for y in first.y..=last.y {
                for x in first.x..=last.x {
                    let cube = UVec3::new(x, y, z);
                    let square = self.center(cube).distance_squared(point);
                    if square <= reach * reach {
                        found(cube, square);
                    }
                }
            }
        }
    }
}

/// The brick of a cube, and the cube's index in it.
#[inline]
fn place(cube: UVec3, n_bricks: UVec3) -> (usize, u32) {
    let (brick, within) = (cube / BRICK, cube % BRICK);
    let in_order = |at: UVec3, n: UVec3| (at.z * n.y + at.y) * n.x + at.x;
    (in_order(brick, n_bricks) as usize, in_order(within, UVec3::splat(BRICK)))
}

#[cfg(test)]
mod tests {
    use super::super::near::NEAR_MAX;
    use super::*;
    use palpate_core::rng::{Purpose, Stream};

    const EDGE: f32 = 0.003;
    const REACH: f32 = 0.007;
    const WIDTHS: f32 = 1.75;

    fn on_a_sphere(n: usize) -> Vec<(Vec3, Vec3)> {
        let mut stream = Stream::new(1, Purpose::Shape, 0);
        let mut normal = || stream.direction().as_vec3();
        (0..n).map(|_| normal()).map(|normal| (0.03 * normal, normal)).collect()
    }

    /// By definition: the nearest six within reach of the centre of the point's cube.
    fn brute_force(places: &[(Vec3, Vec3)], point: Vec3) -> Vec<u16> {
        let low = places.iter().map(|place| place.0).fold(Vec3::INFINITY, Vec3::min);
        let min = low - Vec3::splat(REACH);
        let center = min + (((point - min) / EDGE).floor() + Vec3::splat(0.5)) * EDGE;
        let mut near: Vec<(f32, u16)> = places
            .iter()
            .enumerate()
            .map(|(index, (position, _))| (center.distance(*position), index as u16))
            .filter(|(distance, _)| *distance <= REACH)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.truncate(NEAR_MAX);
        near.into_iter().map(|(_, index)| index).collect()
    }

    #[test]
    fn near_is_what_a_search_of_all_touches_finds() {
        let places = on_a_sphere(300);
        let voxels = Voxels::build(&places, EDGE, REACH, WIDTHS);
        let mut stream = Stream::new(2, Purpose::Shape, 0);
        let mut n_found = 0;
        for _ in 0..2_000 {
            let point = (stream.uniform(0.02, 0.04) * stream.direction()).as_vec3();
            let found: Vec<u16> = voxels.near(point).touches().collect();
            // A centre that is just within reach may round either way.
            let expected = brute_force(&places, point);
            if found.len() == NEAR_MAX || found.len() == expected.len() {
                assert_eq!(found, expected, "{point}");
            }
            n_found += found.len();
        }
        assert!(n_found > 2_000, "{n_found}");
    }

    #[test]
    fn away_from_the_surface_nothing_is_near() {
        let voxels = Voxels::build(&on_a_sphere(300), EDGE, REACH, WIDTHS);
        let away = [Vec3::ZERO, Vec3::splat(1.0), Vec3::splat(-1.0), Vec3::splat(f32::NAN)];
        for point in away {
            assert_eq!(voxels.near(point).touches().count(), 0, "{point}");
        }
        assert_eq!(Voxels::build(&[], EDGE, REACH, WIDTHS).near(Vec3::ZERO).touches().count(), 0);
    }

    #[test]
    fn a_huge_object_has_larger_cubes_and_loses_no_touch() {
        // 100 m across: cubes of about 0.85 m, far beyond the given reach.
        let far = |(position, normal): (Vec3, Vec3)| (position * (50.0 / 0.03), normal);
        let places: Vec<(Vec3, Vec3)> = on_a_sphere(50).into_iter().map(far).collect();
        let voxels = Voxels::build(&places, EDGE, REACH, WIDTHS);
        for (index, (position, _)) in places.iter().enumerate() {
            assert!(
                voxels.near(*position).touches().any(|touch| usize::from(touch) == index),
                "{index}"
            );
        }
        assert!(voxels.bytes() < 4_000_000, "{}", voxels.bytes());
    }
}
