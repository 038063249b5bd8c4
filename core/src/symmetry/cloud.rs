//! The patches of one map, and the misfit of a moved patch to them.
//!
//! The best match of a patch is the map patch nearest in three respects: height over that
//! patch's plane, distance along it, and angle between the normals, each in units of the
//! map's own scatter. A true symmetry has the same misfits as patches matched with themselves
//! left out, so no tolerance is in metres or degrees.

use glam::DVec3;

use super::cells::Cells;
use crate::object::MapPatch;
use crate::pose::Pose;
use crate::units::{DEG, MM};

/// Largest misfit, for a patch far from the map.
const MISFIT_MAX: f64 = 15.0;

/// Smallest scatter of a map: a smooth plate in simulation, metres and rad.
const HEIGHT_MIN: f64 = 0.02 * MM;
const ANGLE_MIN: f64 = 2.0 * DEG;

/// The neighbour whose distance, halved, is the spacing of touches: 0.56/√density.
const SPACING_NEIGHBOUR: usize = 4;

/// Search radius, in spacings of the sparse regions.
const REACH: f64 = 4.0;

/// Resolution at which a map is compared.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Sight {
    /// In units of its scatter, for decisions.
    Sharp,
    /// At least a third of a spacing and 20°, for convergence from afar.
    Blurred,
}

/// The patches of a map with their spacing and their scatter.
pub(super) struct Cloud {
    pub(super) positions: Vec<DVec3>,
    pub(super) normals: Vec<DVec3>,
    /// Confidence of each normal, 0 to 1.
    trusts: Vec<f64>,
    /// 1/spacing² of touches around each patch, 1/m².
    pub(super) along: Vec<f64>,
    /// 1/σ² of heights over planes, 1/m².
    pub(super) across: f64,
    /// 1/σ² of the chord between well-known normals, 1/rad².
    facing: f64,
    cells: Cells,
}

/// The best match of a patch: the map patch, and the misfit in units of scatter.
#[derive(Clone, Copy)]
pub(super) struct Explained {
    pub(super) by: Option<usize>,
    pub(super) misfit: f64,
}

impl Cloud {
    /// The cloud of some patches; needs more than [`SPACING_NEIGHBOUR`].
    pub(super) fn new(patches: &[MapPatch], sight: Sight) -> Self {
        let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        let positions: Vec<DVec3> = patches.iter().map(|patch| vector(patch.position)).collect();
        let normals: Vec<DVec3> =
            patches.iter().map(|patch| vector(patch.normal).normalize_or(DVec3::Z)).collect();
        let trusts = patches.iter().map(|patch| f64::from(patch.normal_confidence)).collect();
        let (mut spacings, mut heights, mut chords) = (Vec::new(), Vec::new(), Vec::new());
        for (at, position) in positions.iter().enumerate() {
            let near = nearest(&positions, at, SPACING_NEIGHBOUR);
            let farthest = near.last().map_or(0.0, |far| position.distance(positions[*far]));
            spacings.push((0.5 * farthest).max(HEIGHT_MIN));
            if let Some(&other) = near.iter().find(|n| normals[at].dot(normals[**n]) > 0.0) {
                heights.push((*position - positions[other]).dot(normals[other]).abs());
                chords.push(normals[at].distance(normals[other]));
            }
        }
        let (height_min, chord_min) = match sight {
            Sight::Sharp => (HEIGHT_MIN, ANGLE_MIN),
            Sight::Blurred => (quantile(&spacings, 0.5) / 3.0, 20.0 * DEG),
        };
        // The deviation of a normal distribution is 1.48 times the median of its magnitude.
        let scatter = |values: &[f64], min: f64| (1.48 * quantile(values, 0.5)).max(min);
        Self {
            cells: Cells::new(&positions, REACH * quantile(&spacings, 0.9)),
            positions,
            normals,
            trusts,
            along: spacings.iter().map(|spacing| spacing.powi(-2)).collect(),
            across: scatter(&heights, height_min).powi(-2),
            facing: scatter(&chords, chord_min).powi(-2),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.positions.len()
    }

    /// The best match of patch `patch` of this map after `motion` (object to object).
    pub(super) fn explain(&self, motion: &Pose, patch: usize) -> Explained {
        let (position, normal) =
            (*motion * self.positions[patch], motion.turn(self.normals[patch]));
        self.look_up(position, normal, self.trusts[patch], usize::MAX)
    }

    /// The best match of patch `patch` with itself left out.
    pub(super) fn explain_left_out(&self, patch: usize) -> Explained {
        self.look_up(self.positions[patch], self.normals[patch], self.trusts[patch], patch)
    }

    /// Weight of the angle between the normals of two patches, 1/rad².
    pub(super) fn facing(&self, patch: usize, other: usize) -> f64 {
        self.facing * self.trusts[patch].min(self.trusts[other])
    }

    /// The misfits of all patches after `motion`.
    pub(super) fn misfits(&self, motion: &Pose) -> Vec<f64> {
        (0..self.len()).map(|patch| self.explain(motion, patch).misfit).collect()
    }

    fn look_up(&self, position: DVec3, normal: DVec3, trust: f64, left_out: usize) -> Explained {
        let (mut by, mut least) = (None, MISFIT_MAX * MISFIT_MAX);
        self.cells.each_near(position, |other| {
            let off = position - self.positions[other];
            let along = self.along[other];
            let height = off.dot(self.normals[other]);
            let bent = 2.0 * (1.0 - normal.dot(self.normals[other]));
            let square = (off.length_squared() - height * height) * along
                + height * height * self.across
                + bent * self.facing * trust.min(self.trusts[other]);
            if square < least && other != left_out {
                (by, least) = (Some(other), square);
            }
        });
        Explained { by, misfit: least.max(0.0).sqrt() }
    }
}

/// The `n` positions nearest to position `at`, except itself, nearest first.
pub(super) fn nearest(positions: &[DVec3], at: usize, n: usize) -> Vec<usize> {
    let mut near: Vec<(f64, usize)> = Vec::with_capacity(n + 1);
    for (other, position) in positions.iter().enumerate() {
        let distance = position.distance_squared(positions[at]);
        if other == at || (near.len() == n && distance >= near[n - 1].0) {
            continue;
        }
        let place = near.partition_point(|entry| entry.0 <= distance);
        near.insert(place, (distance, other));
        near.truncate(n);
    }
    near.into_iter().map(|entry| entry.1).collect()
}

/// The value below which a share of the values lies; 0 without values.
pub(super) fn quantile(values: &[f64], share: f64) -> f64 {
    let mut values = values.to_vec();
    if values.is_empty() {
        return 0.0;
    }
    let place = ((values.len() - 1) as f64 * share).round() as usize;
    *values.select_nth_unstable_by(place, f64::total_cmp).1
}

/// At most `n` patches spread evenly over the map, each farthest from those before it.
pub(super) fn thinned(patches: &[MapPatch], n: usize) -> Vec<MapPatch> {
    let vector = |patch: &MapPatch| DVec3::from_array(patch.position.map(f64::from));
    let mut distances = vec![f64::INFINITY; patches.len()];
    let mut chosen = Vec::new();
    let mut next = 0;
    while chosen.len() < n.min(patches.len()) {
        chosen.push(patches[next]);
        let newest = vector(&patches[next]);
        let mut farthest = 0.0;
        for (other, (patch, distance)) in patches.iter().zip(&mut distances).enumerate() {
            *distance = distance.min(newest.distance_squared(vector(patch)));
            if *distance > farthest {
                (next, farthest) = (other, *distance);
            }
        }
        if farthest <= 0.0 {
            break;
        }
    }
    chosen
}
