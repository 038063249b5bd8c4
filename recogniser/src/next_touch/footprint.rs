//! What an approach meets under a hypothesis: what the sensor's footprint sweeps over the
//! mapped touches.
//!
//! The flat sensor stops at the foremost touch within its footprint and settles on what lies
//! about as far forward near its middle. How often that ends in a valid contact is a logistic
//! function of how the surface faces the sensor, how far off the middle it is and how much of
//! it there is (`docs/equations.md`). Frames: the object's.

use glam::Vec3;

use crate::surface::appearance::{N_AXES, StoredFeature};
use crate::surface::{SurfaceMap, SurfacePatch};

/// So many of a map's touches are met: any first part of them is an even cover.
const PATCHES_MAX: usize = 500;

/// Of the surface within the footprint, what lies this much further back counts 1/e, metres.
const DEPTH: f32 = 0.002;

/// Surfaces that face away more than this (cosine) are met from behind: not at all.
const FACING_MIN: f32 = 0.05;

/// What is asked of a robot: how wide its sensor is, and whether it re-centres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hand {
    /// Half the width of the sensor's array, metres.
    pub(super) half_width: f32,
    pub(super) recenters: bool,
}

/// A ray in the object frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ray {
    pub(super) start: Vec3,
    /// Norm 1.
    pub(super) direction: Vec3,
    /// How far it goes, metres.
    pub(super) reach: f32,
}

/// What a ray is expected to meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Met {
    /// The probability of a valid contact.
    pub(super) contact: f32,
    /// Where, metres.
    pub(super) position: Vec3,
    /// Which way the surface faces there, norm 1.
    pub(super) normal: Vec3,
    /// How far normals of touches there scatter, rad.
    pub(super) normal_deviation: f32,
    /// What it looks like.
    pub(super) feature: StoredFeature,
}

/// How a surface lies under the sensor: what the probability of a contact depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lie {
    /// Cosine between the sensor and the surface, 0 to 1.
    pub(super) facing: f32,
    /// How far off the middle, in half widths.
    pub(super) off: f32,
    /// How much of the footprint is surface about as far forward as its foremost, 0 to about 1.
    pub(super) filled: f32,
}

/// What a ray meets on a map; `None` when nothing.
pub(super) fn meet(map: &SurfaceMap, ray: &Ray, hand: &Hand) -> Option<(Met, Lie)> {
    let patches = map.patches();
    let patches = &patches[..patches.len().min(PATCHES_MAX)];
    // A map that is cut short is as much sparser.
    let thinning = (map.patches().len().max(1) as f32 / patches.len().max(1) as f32).sqrt();
    let spacing = map.spacing() * thinning;
    let radius = hand.half_width + 0.25 * spacing;
    let swept = swept(patches, ray, radius);
    let foremost = swept.iter().map(|(_, along, _)| *along).fold(f32::INFINITY, f32::min);
    if foremost > ray.reach {
        return None;
    }
    let mut sum = Sum::default();
    let inner = (0.7 * hand.half_width).max(0.5 * spacing).powi(2).recip();
    for (patch, along, square) in swept {
        if along - foremost > 4.0 * DEPTH {
            continue;
        }
        let level = (-(along - foremost) / DEPTH).exp();
        sum.add(patch, level * (-square * inner).exp(), level, square.sqrt());
    }
    let (position, normal) = (sum.position / sum.weight, sum.normal.try_normalize()?);
    let expected = std::f32::consts::PI * radius * radius / spacing.max(1e-4).powi(2);
    let lie = Lie {
        facing: (-normal.dot(ray.direction)).max(0.0),
        off: sum.off / sum.weight / hand.half_width,
        filled: (sum.levels / expected.max(1.0)).min(1.5),
    };
    let contact = contact_probability(&lie, hand.recenters);
    let normal_deviation = sum.deviation / sum.weight;
    Some((Met { contact, position, normal, normal_deviation, feature: sum.feature }, lie))
}

/// The touches that the footprint sweeps over, facing it: how far along the ray each is, and
/// the square of how far from it.
fn swept<'a>(
    patches: &'a [SurfacePatch],
    ray: &Ray,
    radius: f32,
) -> Vec<(&'a SurfacePatch, f32, f32)> {
    let mut swept = Vec::new();
    for patch in patches {
        let off = patch.position - ray.start;
        let along = off.dot(ray.direction);
        let square = (off.length_squared() - along * along).max(0.0);
        let faces = -patch.normal.dot(ray.direction) > FACING_MIN;
        if square < radius * radius && along > 0.0 && faces {
            swept.push((patch, along, square));
        }
    }
    swept
}

#[derive(Default)]
struct Sum {
    weight: f32,
    levels: f32,
    position: Vec3,
    normal: Vec3,
    off: f32,
    deviation: f32,
    heaviest: f32,
    feature: [i8; N_AXES],
}

impl Sum {
    fn add(&mut self, patch: &SurfacePatch, weight: f32, level: f32, off: f32) {
        self.weight += weight;
        self.levels += level;
        self.position += weight * patch.position;
        self.normal += weight * patch.normal;
        self.off += weight * off;
        self.deviation += weight * patch.normal_deviation;
        if weight > self.heaviest {
            self.heaviest = weight;
            self.feature = patch.feature;
        }
    }
}

/// How probable it is that an approach ends in a valid contact. The slopes are set by hand, the
/// first number of each so that on simulated robots as many presses touched as was expected.
fn contact_probability(lie: &Lie, recenters: bool) -> f32 {
    let [bias, facing, off, filled] =
        if recenters { [-0.2, 4.0, -0.5, 0.5] } else { [-1.1, 5.0, -3.0, 1.0] };
    let sum = bias + facing * lie.facing + off * lie.off + filled * lie.filled;
    (1.0 + (-sum).exp()).recip()
}
