//! A touch as the recogniser keeps it: single precision about the session's anchor.

use std::ops::Range;

use glam::{DVec3, Vec3};

use super::options::TouchScale;
use super::placement::{Placement, Variances};
use super::steadiness::Steadiness;
use crate::surface::appearance::{Feature, StoredFeature, ratio};
use crate::surface::features::Features;
use crate::surface::{AppearanceSpace, Touch};
use palpate_core::reading::{Base, Looseness};

/// Touches of one place agree: nearer ones than this (m) are no independent evidence.
const SAME_PLACE: f32 = 0.003;

/// A turn of the normal by a radian counts as this many metres apart.
const NORMAL_REACH: f32 = 0.006;

/// What a touch at the place of an earlier one still counts.
const REPEATED: f32 = 0.25;

/// A touch of the session, relative to the anchor (its first touch).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sighting {
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    pub(super) direction: Vec3,
    pub(super) elongation: f32,
    /// How much its evidence counts: 1 for a new place, less where it was touched before.
    pub(super) weight: f32,
    /// The same before the object moved.
    novelty: f32,
    /// How loosely it is placed, and what follows for where it may be out of reach
    /// ([`Placement::astray`]).
    pub(super) placement: Placement,
    pub(super) astray: f32,
    /// How far its normal and its stretch can be trusted.
    pub(super) steadiness: Steadiness,
    feature: Feature,
    /// For finding where a touch may be: as sharp as touches of one place are alike.
    sharp: Looks,
    /// For judging poses: what is alike by chance must not outweigh where things are.
    soft: Looks,
}

/// How features are compared, and how dense touches anywhere are at this one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Looks {
    pub(super) softness: f32,
    pub(super) density: f32,
}

impl Sighting {
    /// A touch as seen from `anchor`.
    pub(super) fn new(
        touch: &Touch,
        anchor: DVec3,
        space: &AppearanceSpace,
        scale: &TouchScale,
    ) -> Self {
        let looks = |softness| Looks {
            softness,
            density: space.density_anywhere(&touch.feature, softness),
        };
        Self::with_looks(touch, anchor, looks(scale.appearance), looks(scale.appearance_of_pose))
    }

    /// A touch whose looks are compared in given ways.
    pub(super) fn with_looks(touch: &Touch, anchor: DVec3, sharp: Looks, soft: Looks) -> Self {
        Self {
            position: (touch.position - anchor).as_vec3(),
            normal: touch.normal.as_vec3(),
            direction: touch.direction.as_vec3(),
            elongation: touch.elongation as f32,
            weight: 1.0,
            novelty: 1.0,
            placement: Placement::default(),
            astray: 0.0,
            steadiness: Steadiness::new(touch.evenness),
            feature: touch.feature,
            sharp,
            soft,
        }
    }

    /// The touch of a robot whose base is known so well.
    pub(super) fn with_base(mut self, base: Option<Base>) -> Self {
        self.place(Placement::of_base(base));
        self
    }

    /// The object may have moved so many times since, each time by so much: the touch says the
    /// less of where it is now.
    pub(super) fn age(&mut self, moves: usize, motion: &Looseness) {
        self.place(self.placement.after(moves, motion));
        self.weight = self.novelty * self.placement.recency();
    }

    fn place(&mut self, placement: Placement) {
        self.placement = placement;
        self.astray = placement.astray();
    }

    /// Variances that base and motion add: of positions (m²) and of normals (rad²).
    #[inline]
    pub(super) fn looseness(&self) -> Variances {
        self.placement.variances()
    }

    /// The same between this touch and another one.
    pub(super) fn looseness_to(&self, other: &Self) -> Variances {
        self.placement.variances_to(&other.placement)
    }

    /// What it counts for whether it is an object at all that is known: a motion that nobody
    /// stated takes nothing of it.
    pub(super) fn counts(&self, is_told: bool) -> f32 {
        if is_told { self.weight } else { self.novelty }
    }

    /// How much less well (ln) even its own place explains the touch than a steady one that is
    /// exactly placed; `is_told` says whether the session was told how far the object moves.
    pub(super) fn loss(&self, is_told: bool) -> f32 {
        self.steadiness.loss() + self.placement.loss(is_told)
    }

    /// The touch with what it counts beside `earlier` ones.
    pub(super) fn weighed(mut self, earlier: &[Self]) -> Self {
        let apart = |other: &Self| {
            let turned = NORMAL_REACH * self.normal.distance(other.normal);
            self.position.distance(other.position).hypot(turned)
        };
        let nearest = earlier.iter().map(apart).fold(f32::INFINITY, f32::min);
        self.novelty = (nearest / SAME_PLACE).clamp(REPEATED, 1.0);
        self.weight = self.novelty;
        self
    }

    /// How much likelier the touch looks as it does where `other` was felt than anywhere.
    #[inline]
    pub(super) fn appearance(&self, other: &StoredFeature) -> f32 {
        ratio(&self.feature, other, self.sharp.softness, self.sharp.density)
    }

    /// The same where each of a `range` of touches was felt, at the end of `found`.
    pub(super) fn appearances(&self, of: &Features, range: Range<usize>, found: &mut Vec<f32>) {
        of.ratios(&self.feature, range, [self.sharp.softness, self.sharp.density], found);
    }

    /// The same for judging a pose, less trusting.
    #[inline]
    pub(super) fn appearance_of_pose(&self, other: &StoredFeature) -> f32 {
        ratio(&self.feature, other, self.soft.softness, self.soft.density)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::test_support::{LOOKS, places, seen, some_pose};
    use palpate_core::pose::Pose;

    #[test]
    fn a_repeated_touch_counts_less() {
        let mut place = places(1, 0).remove(0);
        place.normal = DVec3::Z;
        let first = seen(&place, &Pose::IDENTITY);
        assert!((first.clone().weighed(&[]).weight - 1.0).abs() < 1e-6);
        let again = |off: DVec3, normal: DVec3| {
            let moved = Touch { position: place.position + off, normal, ..place.clone() };
            seen(&moved, &Pose::IDENTITY).weighed(std::slice::from_ref(&first)).weight
        };
        assert!((again(DVec3::ZERO, DVec3::Z) - 0.25).abs() < 1e-6, "never less than a quarter");
        assert!((again(DVec3::X * 0.001_5, DVec3::Z) - 0.5).abs() < 1e-4, "1.5 mm of 3");
        assert!((again(DVec3::X * 0.003, DVec3::Z) - 1.0).abs() < 1e-4);
        // Turned by a right angle: 6 mm · √2 apart.
        assert!((again(DVec3::ZERO, DVec3::X) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_kilometre_away_a_touch_is_the_same_beside_its_anchor() {
        let pose = some_pose(1);
        let far = Pose::from_parts(pose.rotation, pose.translation + DVec3::splat(1_000.0));
        for place in places(20, 1) {
            let sighting = |pose: &Pose, anchor: DVec3| {
                let position = *pose * place.position;
                let touch = Touch { position, ..place.clone() };
                Sighting::with_looks(&touch, anchor, LOOKS, LOOKS).position
            };
            let near = sighting(&pose, pose.translation);
            let away = sighting(&far, far.translation);
            assert!(near.distance(away) < 1e-8, "{near} {away}");
        }
    }
}
