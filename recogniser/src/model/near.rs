//! Near patches: a few of those about a cube of space, and the number that each represents.
//!
//! The density of a touch is a sum over all patches about it. Where they are many, a few
//! represent all: each counts for itself and for the omitted ones that are nearest to it and
//! face the same way (equation R8). The density therefore does not depend on the number of
//! touches of a surface.

use glam::Vec3;

use palpate_core::exponential::exp;

use super::thinning::NORMAL_REACH;

/// Maximum number of patches in a list; all are read for every touch under every pose.
pub const NEAR_MAX: usize = 6;

/// Minimum number of listed patches of each of two sides of a wall, if there are as many.
const OF_EACH_SIDE: usize = NEAR_MAX / 2;

/// Largest cosine of the normals of two sides of a wall. Faces that meet in an edge have a larger
/// one.
const APART: f32 = -0.5;

/// Filler of a list with fewer patches.
const NONE: u16 = u16::MAX;

/// Bits of a number's fraction that are kept: steps of a sixteenth, far finer than the accuracy
/// of a density.
const FRACTION_BITS: u32 = 4;

/// Bits of a number's fraction that are dropped.
const DROPPED_BITS: u32 = f32::MANTISSA_DIGITS - 1 - FRACTION_BITS;

/// The patches near a cube: their indices, nearest first, and the number that each represents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Near {
    touches: [u16; NEAR_MAX],
    stands_for: [u8; NEAR_MAX],
}

impl Near {
    pub(super) const EMPTY: Self = Self { touches: [NONE; NEAR_MAX], stands_for: [0; NEAR_MAX] };

    /// Lists some of the touches about a cube, which come nearest first.
    pub(super) fn choose(
        sorted: impl Iterator<Item = u16> + Clone,
        places: &[(Vec3, Vec3)],
    ) -> Self {
        let normal = |touch: u16| places[usize::from(touch)].1;
        let Some(nearest) = sorted.clone().next() else { return Self::EMPTY };
        let is_other = |touch: u16| normal(touch).dot(normal(nearest)) < APART;
        let n_other = sorted.clone().filter(|touch| is_other(*touch)).take(OF_EACH_SIDE).count();
        let mut room = [NEAR_MAX - n_other, NEAR_MAX];
        let mut listed = Self::EMPTY;
        let mut n = 0;
        for touch in sorted {
            let room = &mut room[usize::from(is_other(touch))];
            if *room > 0 && n < NEAR_MAX {
                *room -= 1;
                listed.touches[n] = touch;
                n += 1;
            }
        }
        listed
    }

    /// The touches, nearest to the cube first.
    #[inline]
    pub fn touches(self) -> impl Iterator<Item = u16> {
        self.touches.into_iter().take_while(|touch| *touch != NONE)
    }

    /// The patches, each with the number that it represents, itself included.
    #[inline]
    pub fn weighed(self) -> impl Iterator<Item = (u16, f32)> {
        let numbers = self.stands_for.into_iter().map(read);
        self.touches.into_iter().zip(numbers).take_while(|(touch, _)| *touch != NONE)
    }

    /// The total number of patches represented.
    #[inline]
    pub fn n_meant(self) -> f32 {
        self.weighed().map(|(_, number)| number).sum()
    }
}

/// Weight of the patches that a cube's list omits, by the listed patch that represents them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LeftOut([f32; NEAR_MAX]);

impl LeftOut {
    /// Counts a patch of `places` by its weight at the cube, unless it is listed.
    pub(super) fn count(&mut self, near: &Near, touch: u16, weight: f32, places: &[(Vec3, Vec3)]) {
        let (position, normal) = places[usize::from(touch)];
        let mut best = (f32::INFINITY, None);
        for (slot, listed) in near.touches().enumerate() {
            if listed == touch {
                return;
            }
            let (other, facing) = places[usize::from(listed)];
            let apart = position.distance_squared(other)
                + NORMAL_REACH * NORMAL_REACH * normal.distance_squared(facing);
            if apart < best.0 {
                best = (apart, Some(slot));
            }
        }
        if let (_, Some(slot)) = best {
            self.0[slot] += weight;
        }
    }

    /// Stores the number that each listed patch represents; `weigh` gives a patch's weight at
    /// the cube.
    pub(super) fn settle(&self, near: &mut Near, weigh: impl Fn(u16) -> f32) {
        let listed: Vec<u16> = near.touches().collect();
        for (slot, touch) in listed.into_iter().enumerate() {
            near.stands_for[slot] = written(1.0 + self.0[slot] / weigh(touch));
        }
    }
}

/// Weight of a patch at a cube by a Gaussian; `square` is the squared distance (m²).
pub(super) fn weight(square: f32, inverse_variance: f32) -> f32 {
    exp(-0.5 * square * inverse_variance)
}

/// Encodes a number of at least 1 in a byte: four bits each for its power of two and its fraction.
fn written(number: f32) -> u8 {
    let rounded = number.max(1.0).to_bits() + (1 << (DROPPED_BITS - 1));
    let steps = (rounded - 1f32.to_bits()) >> DROPPED_BITS;
    steps.min(u32::from(u8::MAX)) as u8
}

#[inline]
fn read(byte: u8) -> f32 {
    f32::from_bits((u32::from(byte) << DROPPED_BITS) + 1f32.to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_keeps_a_number_to_a_thirtieth() {
        for (number, kept) in [(0.5, 1.0), (1.0, 1.0), (1.5, 1.5), (96.0, 96.0), (1e9, 63_488.0)] {
            assert!((read(written(number)) - kept).abs() < 1e-6, "{number}");
        }
        for number in (0..60_000).map(|n| 1.0 + n as f32) {
            let error = (read(written(number)) / number - 1.0).abs();
            assert!(error <= 1.0 / 32.0 + 1e-6, "{number}: {error}");
        }
    }

    #[test]
    fn both_faces_of_a_thin_wall_are_listed() {
        // Ten on the near face, then four on the far one.
        let place = |n: u16| {
            let up = if n < 10 { 1.0 } else { -1.0 };
            (Vec3::new(f32::from(n), 0.0, 0.0), Vec3::Z * up)
        };
        let places: Vec<(Vec3, Vec3)> = (0..14).map(place).collect();
        let listed = |order: &[u16]| -> Vec<u16> {
            Near::choose(order.iter().copied(), &places).touches().collect()
        };
        let all: Vec<u16> = (0..14).collect();
        assert_eq!(listed(&all), [0, 1, 2, 10, 11, 12]);
        assert_eq!(listed(&all[..11]), [0, 1, 2, 3, 4, 10], "one of them");
        assert_eq!(listed(&all[..8]), [0, 1, 2, 3, 4, 5], "one face");
        let from_beyond: Vec<u16> = all.iter().rev().copied().collect();
        assert_eq!(listed(&from_beyond), [13, 12, 11, 9, 8, 7]);
        assert_eq!(listed(&[]), [0; 0]);
    }

    #[test]
    fn faces_that_meet_in_an_edge_are_no_wall() {
        // Eight on one face, four on one across an edge, which noise turned beyond a right angle.
        let place = |n: u16| {
            let normal = if n < 8 { Vec3::Z } else { Vec3::new(0.99, 0.0, -0.1) };
            (Vec3::new(f32::from(n), 0.0, 0.0), normal)
        };
        let places: Vec<(Vec3, Vec3)> = (0..12).map(place).collect();
        let listed: Vec<u16> = Near::choose(0..12, &places).touches().collect();
        assert_eq!(listed, [0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn the_nearest_that_faces_its_way_stands_for_a_left_out_touch() {
        let at = |x: f32, up: f32| (Vec3::new(x, 0.0, 0.0), Vec3::Z * up);
        // Two listed, one facing down; three left out.
        let places =
            [at(0.0, 1.0), at(0.001, -1.0), at(0.002, 1.0), at(0.002, -1.0), at(0.003, 1.0)];
        let mut near = Near::choose([0, 1].into_iter(), &places);
        let mut left_out = LeftOut::default();
        for touch in 0..5 {
            left_out.count(&near, touch, 0.5, &places);
        }
        left_out.settle(&mut near, |_| 1.0);
        let found: Vec<(u16, f32)> = near.weighed().collect();
        assert_eq!(found, [(0, 2.0), (1, 1.5)]);
        assert!((near.n_meant() - 3.5).abs() < 1e-6);
    }
}
