//! Solid and vacant space: the cubes of an object's box with material, and those with nothing near.
//!
//! Two bits for each cube of the object's box. A cube is solid when its centre lies clearly
//! behind all mapped touches near it, or in a hollow that only solid cubes enclose; it is vacant
//! when no patch and no material is near. A cube that is neither is unknown and contradicts
//! nothing. Frame: the object's, metres.

use glam::{IVec3, UVec3, Vec3};

use super::patch::SurfacePatch;

/// Edge of a cube, metres, at least.
const EDGE: f32 = 0.002;

/// Maximum number of cubes along an axis.
const CUBES_MAX: f32 = 64.0;

/// Least depth of a solid cube's centre behind all patches near it, metres. Touches lie below
/// the surface by the covering's indentation: on a thin sheet those of one side lie behind those
/// of the other.
const DEPTH_MIN: f32 = 0.001_5;

/// Least distance of a vacant cube's centre from every patch, metres.
const VACANT_MIN: f32 = 0.005;

/// Least distance of a vacant cube's centre from every patch, in spacings of patches.
const VACANT_SPACINGS: f32 = 1.2;

/// The cubes of an object's box.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    min: Vec3,
    inverse_edge: f32,
    n: UVec3,
    solid: Bits,
    vacant: Bits,
}

/// A set of cubes.
#[derive(Clone, Debug, PartialEq)]
struct Bits(Vec<u64>);

impl Bits {
    fn none_of(n: usize) -> Self {
        Self(vec![0; n.div_ceil(64)])
    }

    fn insert(&mut self, cube: usize) {
        self.0[cube / 64] |= 1 << (cube % 64);
    }

    #[inline]
    fn holds(&self, cube: usize) -> bool {
        self.0[cube / 64] >> (cube % 64) & 1 == 1
    }
}

impl Solid {
    /// The cubes about `patches` that are `spacing` (m) apart; those within `reach` (m) are near.
    #[must_use]
    pub fn of_patches(patches: &[SurfacePatch], spacing: f32, reach: f32) -> Self {
        let positions = patches.iter().map(|patch| patch.position);
        let low = positions.clone().fold(Vec3::INFINITY, Vec3::min);
        let high = positions.fold(Vec3::NEG_INFINITY, Vec3::max);
        if patches.is_empty() {
            let nothing = Bits::none_of(0);
            let (solid, vacant) = (nothing.clone(), nothing);
            return Self { min: Vec3::ZERO, inverse_edge: 1.0, n: UVec3::ZERO, solid, vacant };
        }
        let edge = EDGE.max((high - low).max_element() / (CUBES_MAX - 4.0));
        // A margin of two cubes, so that the outside is connected.
        let min = low - Vec3::splat(2.0 * edge);
        let n = ((high - low) / edge + Vec3::splat(4.0)).ceil().as_uvec3().max(UVec3::ONE);
        let total = (n.x * n.y * n.z) as usize;
        let (mut solid, mut clear) = (Bits::none_of(total), Bits::none_of(total));
        let far = VACANT_MIN.max(VACANT_SPACINGS * spacing);
        for (cube, Near { height, distance }) in near(patches, reach, min, edge, n).enumerate() {
            if distance.is_finite() && height < -DEPTH_MIN {
                solid.insert(cube);
            }
            if distance > far {
                clear.insert(cube);
            }
        }
        let outside = reached_from_outside(&solid, n);
        let mut vacant = Bits::none_of(total);
        for cube in 0..total {
            if !outside.holds(cube) {
                solid.insert(cube);
            } else if clear.holds(cube) {
                vacant.insert(cube);
            }
        }
        Self { min, inverse_edge: edge.recip(), n, solid, vacant }
    }

    /// True where the map has material.
    #[inline]
    #[must_use]
    pub fn is_solid(&self, point: Vec3) -> bool {
        self.cube(point).is_some_and(|cube| self.solid.holds(cube))
    }

    /// True far from the object: outside the box, or far from every touch.
    #[inline]
    #[must_use]
    pub fn is_vacant(&self, point: Vec3) -> bool {
        self.cube(point).is_none_or(|cube| self.vacant.holds(cube))
    }

    #[inline]
    fn cube(&self, point: Vec3) -> Option<usize> {
        let scaled = (point - self.min) * self.inverse_edge;
        if scaled.min_element() < 0.0 || !scaled.is_finite() {
            return None;
        }
        let cube = scaled.as_uvec3();
        let inside = cube.cmplt(self.n).all();
        inside.then(|| index(cube, self.n))
    }

    /// Bytes in memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.solid.0.as_slice()) + size_of_val(self.vacant.0.as_slice())
    }
}

/// The surroundings of a cube's centre.
#[derive(Clone, Copy)]
struct Near {
    /// Largest height above a patch near it, along the patch's normal, metres.
    height: f32,
    /// Distance from the nearest patch, metres.
    distance: f32,
}

/// The surroundings of each cube, in order.
fn near(
    patches: &[SurfacePatch],
    reach: f32,
    min: Vec3,
    edge: f32,
    n: UVec3,
) -> impl Iterator<Item = Near> {
    let nothing = Near { height: f32::NEG_INFINITY, distance: f32::INFINITY };
    let mut found = vec![nothing; (n.x * n.y * n.z) as usize];
    for patch in patches {
        let cube = |side: f32| (patch.position + Vec3::splat(side * reach) - min) / edge;
        let first = cube(-1.0).floor().max(Vec3::ZERO).as_uvec3();
        let last = cube(1.0).floor().as_uvec3().min(n - UVec3::ONE);
        for z in first.z..=last.z {
            for y in first.y..=last.y {
                for x in first.x..=last.x {
                    let center = min + (UVec3::new(x, y, z).as_vec3() + Vec3::splat(0.5)) * edge;
                    let off = center - patch.position;
                    let distance = off.length();
                    if distance <= reach {
                        let near = &mut found[index(UVec3::new(x, y, z), n)];
                        near.height = near.height.max(off.dot(patch.normal));
                        near.distance = near.distance.min(distance);
                    }
                }
            }
        }
    }
    found.into_iter()
}

/// The cubes that are connected to the sides of the box through cubes that are not solid.
fn reached_from_outside(solid: &Bits, n: UVec3) -> Bits {
    const STEPS: [IVec3; 6] =
        [IVec3::X, IVec3::NEG_X, IVec3::Y, IVec3::NEG_Y, IVec3::Z, IVec3::NEG_Z];
    let mut reached = Bits::none_of((n.x * n.y * n.z) as usize);
    let mut open = Vec::new();
    for z in 0..n.z {
        for y in 0..n.y {
            for x in 0..n.x {
                let cube = UVec3::new(x, y, z);
                let on_a_side = cube.cmpeq(UVec3::ZERO).any() || (cube + 1).cmpeq(n).any();
                if on_a_side && !solid.holds(index(cube, n)) {
                    reached.insert(index(cube, n));
                    open.push(cube);
                }
            }
        }
    }
    while let Some(cube) = open.pop() {
        for step in STEPS {
            let next = cube.as_ivec3() + step;
            if next.min_element() < 0 || next.as_uvec3().cmpge(n).any() {
                continue;
            }
            let next = next.as_uvec3();
            let place = index(next, n);
            if !solid.holds(place) && !reached.holds(place) {
                reached.insert(place);
                open.push(next);
            }
        }
    }
    reached
}

/// Index of a cube in a box of `n` cubes, x fastest.
#[inline]
fn index(cube: UVec3, n: UVec3) -> usize {
    ((cube.z * n.y + cube.y) * n.x + cube.x) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_core::rng::{Purpose, Stream};

    /// A sphere of 30 mm that was touched all over, or above z = `from` only.
    fn sphere(from: f32) -> Solid {
        let mut stream = Stream::new(1, Purpose::Shape, 0);
        let normals = (0..3_000).map(|_| stream.direction().as_vec3());
        let patch = |normal: Vec3| SurfacePatch {
            position: 0.03 * normal,
            normal,
            direction: normal.any_orthonormal_vector(),
            elongation: 0.0,
            normal_deviation: 0.1,
            feature: [0; 8],
        };
        let patches: Vec<SurfacePatch> =
            normals.map(patch).filter(|patch| patch.position.z >= from).collect();
        Solid::of_patches(&patches, 0.002, 0.007)
    }

    /// Points in all directions at a distance from the origin.
    fn shell(radius: f32) -> impl Iterator<Item = Vec3> {
        let mut stream = Stream::new(2, Purpose::Shape, 0);
        (0..500).map(move |_| radius * stream.direction().as_vec3())
    }

    #[test]
    fn inside_is_solid_and_outside_is_not() {
        let solid = sphere(-1.0);
        for radius in [0.0, 0.01, 0.02, 0.026] {
            assert!(shell(radius).all(|point| solid.is_solid(point)), "{radius}");
            assert!(!shell(radius).any(|point| solid.is_vacant(point)), "{radius}");
        }
        for radius in [0.0305, 0.032, 0.04, 0.1] {
            assert!(!shell(radius).any(|point| solid.is_solid(point)), "{radius}");
        }
        // Cubes of 2 mm: within 1.8 mm of 30 mm nothing is vacant, from 37 mm on everything is.
        assert!(!shell(0.031).any(|point| solid.is_vacant(point)));
        assert!(shell(0.037).all(|point| solid.is_vacant(point)));
        assert!(solid.is_vacant(Vec3::splat(f32::NAN)) && !solid.is_solid(Vec3::splat(f32::NAN)));
    }

    #[test]
    fn what_was_not_touched_all_around_is_open() {
        let half = sphere(0.0);
        assert!(!half.is_solid(Vec3::ZERO), "its underside may be anywhere");
        assert!(half.is_solid(Vec3::new(0.0, 0.0, 0.027)));
    }

    #[test]
    fn nothing_is_known_of_nothing_and_a_huge_object_stays_small() {
        let none = Solid::of_patches(&[], 0.0, 0.007);
        assert!(!none.is_solid(Vec3::ZERO) && none.is_vacant(Vec3::ZERO));
        let patch = |x: f32| SurfacePatch {
            position: Vec3::splat(x),
            normal: Vec3::X,
            direction: Vec3::Y,
            elongation: 0.0,
            normal_deviation: 0.1,
            feature: [0; 8],
        };
        let patches = [patch(-50.0), patch(50.0)];
        // 64³ bits, twice.
        assert!(Solid::of_patches(&patches, 100.0, 175.0).bytes() <= 2 * 64 * 64 * 64 / 8 + 16);
    }
}
