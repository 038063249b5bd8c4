//! The footprint: the expected contact of an approach under a sample, from a sweep of the sensor
//! over the map.
//!
//! The flat sensor stops at the foremost patch within its footprint and settles on patches about
//! equally far forward near its centre. The probability of a valid contact is a logistic
//! function of the surface's inclination, its offset from the sensor's centre and the filled
//! share of the footprint (equation R25). Frames: the object's.

use glam::Vec3;

use crate::model::agreement::{N_AXES, StoredFeature};
use crate::model::{SurfaceMap, SurfacePatch};

/// Maximum number of patches in a sweep: the first ones of a map, which cover the surface evenly.
const PATCHES_MAX: usize = 500;

/// Distance behind the foremost patch at which a patch's weight is 1/e, metres.
const DEPTH: f32 = 0.002;

/// Distance behind the foremost patch beyond which a patch is ignored, in [`DEPTH`]s.
const DEPTHS_MAX: f32 = 4.0;

/// Least cosine between sensor and surface in a contact; other surfaces face away.
const FACING_MIN: f32 = 0.05;

/// Margin of the footprint, in spacings, for the gaps between patches.
const REACH_SPACINGS: f32 = 0.25;

/// Width of the weight about the centre: in half widths of the sensor, and its minimum in spacings.
const MIDDLE: (f32, f32) = (0.7, 0.5);

/// Cap on the filled share of the footprint.
const FILLED_MAX: f32 = 1.5;

/// Coefficients of equation R25 for a robot that re-centres: constant, cosine, offset, filled.
const CENTERED: [f32; 4] = [-0.2, 4.0, -0.5, 0.5];

/// The same for a robot that does not re-centre.
const OFF_CENTER: [f32; 4] = [-1.1, 5.0, -3.0, 1.0];

/// The sensor of a robot, and whether it re-centres.
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
    /// Direction, norm 1.
    pub(super) direction: Vec3,
    /// Length, metres.
    pub(super) reach: f32,
}

/// The expected contact of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ExpectedContact {
    /// The probability of a valid contact.
    pub(super) contact: f32,
    /// Position, metres.
    pub(super) position: Vec3,
    /// Surface normal there, norm 1.
    pub(super) normal: Vec3,
    /// Scatter of normals there, rad.
    pub(super) normal_deviation: f32,
    /// Appearance there.
    pub(super) feature: StoredFeature,
}

/// The lie of a surface under the sensor, on which the probability of a contact depends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lie {
    /// Cosine between the sensor and the surface, 0 to 1.
    pub(super) facing: f32,
    /// Offset from the sensor's centre, in half widths.
    pub(super) off: f32,
    /// Share of the footprint with surface about as far forward as the foremost patch, 0 to
    /// about 1.
    pub(super) filled: f32,
}

/// The contact of a ray on a map; `None` for a miss.
pub(super) fn meet(map: &SurfaceMap, ray: &Ray, hand: &Hand) -> Option<(ExpectedContact, Lie)> {
    let patches = map.patches();
    let patches = &patches[..patches.len().min(PATCHES_MAX)];
    // The first patches of a map are sparser in proportion.
    let thinning = (map.patches().len().max(1) as f32 / patches.len().max(1) as f32).sqrt();
    let spacing = map.spacing() * thinning;
    let radius = hand.half_width + REACH_SPACINGS * spacing;
    let swept = swept(patches, ray, radius);
    let foremost = swept.iter().map(|(_, along, _)| *along).fold(f32::INFINITY, f32::min);
    if foremost > ray.reach {
        return None;
    }
    let mut sum = Sum::default();
    let inner = (MIDDLE.0 * hand.half_width).max(MIDDLE.1 * spacing).powi(2).recip();
    for (patch, along, square) in swept {
        if along - foremost > DEPTHS_MAX * DEPTH {
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
        filled: (sum.levels / expected.max(1.0)).min(FILLED_MAX),
    };
    let contact = contact_probability(&lie, hand.recenters);
    let normal_deviation = sum.deviation / sum.weight;
    Some((
        ExpectedContact { contact, position, normal, normal_deviation, feature: sum.feature },
        lie,
    ))
}

/// The patches that the footprint sweeps over and that face it: the distance of each along the ray,
/// and its squared distance from it.
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

/// The probability that an approach ends in a valid contact. Equation R25 of docs/recogniser.md.
fn contact_probability(lie: &Lie, recenters: bool) -> f32 {
    let [bias, facing, off, filled] = if recenters { CENTERED } else { OFF_CENTER };
    let sum = bias + facing * lie.facing + off * lie.off + filled * lie.filled;
    (1.0 + (-sum).exp()).recip()
}
