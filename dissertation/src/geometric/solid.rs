//! The belief over solid poses within bounds, from occupancy maps and contact classes.
//!
//! A pose is the nominal one moved along the session's axes (m) and turned about the object's
//! own origin by a rotation vector along them (rad). Touching and free taxels both count. A
//! bin's extent blurs the map that it is compared with.

use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::marginals::{self, Marginals};
use super::prepared::{BLURS, Blurs, PreparedGeometry};
use super::{AdaptiveOptions, BeliefMemory, GeometricError, PosePrior};
use crate::filter::adaptive::{AdaptiveHistogram, Bin, BinLikelihood, Division, Effort};
use crate::geometric::model::GeometricModel;
use crate::occupancy::{ClassifiedPress, InverseModel, log_likelihood};
use palpate_core::belief::answer::{Answer, ModeScale, WeightedPose, answer};
use palpate_core::log_prob::log_sum_exp;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::stop::Stop;
use palpate_core::units::{DEG, MM};

/// Lever arm (m) of one rad of rotation: an object's reach from its origin. Chosen for
/// objects of a hand's size, 60 to 100 mm across; not fitted.
const LEVER: f64 = 30.0 * MM;

/// Target width of the first bins in metres, and the minimum and maximum number of them along
/// an axis. Chosen: more than 4⁶ bins per object take too long for one touch; with a single
/// bin along an axis the search often refines the wrong object.
const FIRST_WIDTH: f64 = 7.0 * MM;
const FIRST_MIN: usize = 2;
const FIRST_MAX: usize = 4;

/// Half the side of the largest box along each axis, metres. Derived: `FIRST_MAX` bins of
/// `FIRST_WIDTH`.
const HALF_MAX: f64 = 0.5 * FIRST_MAX as f64 * FIRST_WIDTH;

/// Exponent of a press: its taxels see one blurred contact and are not independent. Chosen,
/// not fitted; `palpate experiment solid-geometry` measures the answers with it.
const TEMPER: f64 = 0.3;

/// Evaluations of a split, relative to those of a plane's three axes. Chosen: a few splits of
/// 2⁶ children on all readings of a usual session; not fitted.
const EVALUATIONS: usize = 46;

/// Maximum number of bins in an answer.
const ANSWERED_MAX: usize = 400;

/// Number of cells of a plotted axis.
const MARGINAL_CELLS: usize = 48;

/// Refuses a box whose first bins would be wider than `FIRST_WIDTH`.
fn check_resolved(half_extent: DVec3, half_angle: f64) -> Result<(), GeometricError> {
    let fields = ["half_extent x", "half_extent y", "half_extent z", "half_angle"];
    let [x, y, z] = half_extent.to_array();
    for (field, (found, unit)) in
        fields.into_iter().zip([(x, 1.0), (y, 1.0), (z, 1.0), (half_angle, LEVER)])
    {
        let high = HALF_MAX / unit;
        if found > high {
            return Err(GeometricError::Range { field, found, low: 0.0, high });
        }
    }
    Ok(())
}

/// Metres per unit of each axis.
const LENGTHS: [f64; 6] = [1.0, 1.0, 1.0, LEVER, LEVER, LEVER];

/// Half the sides of the box of poses, in the axes' own units.
fn half_sides(half_extent: DVec3, half_angle: f64) -> [f64; 6] {
    let [x, y, z] = half_extent.to_array();
    [x, y, z, half_angle, half_angle, half_angle]
}

/// First bins along each axis.
fn first_bins(half_extent: DVec3, half_angle: f64) -> [usize; 6] {
    let half = half_sides(half_extent, half_angle);
    std::array::from_fn(|axis| {
        let width = 2.0 * half[axis] * LENGTHS[axis];
        ((width / FIRST_WIDTH).round() as usize).clamp(FIRST_MIN, FIRST_MAX)
    })
}

const AXES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// A belief over identity and solid pose.
#[derive(Clone, Debug)]
pub(super) struct SolidBelief {
    model: SolidModel,
    effort: Effort,
    histogram: AdaptiveHistogram<6>,
    n_objects: usize,
    smallest: f64,
    low: [f64; 6],
    high: [f64; 6],
}

/// Likelihood of presses for solid poses.
#[derive(Clone, Debug)]
struct SolidModel {
    geometry: Arc<GeometricModel>,
    nominal: Pose,
    /// Maps of every object, by blur.
    maps: Vec<Arc<Blurs>>,
    /// Index of the blur for each depth.
    blur_of: Vec<usize>,
    presses: Vec<ClassifiedPress>,
    stop: Stop,
}

impl SolidModel {
    fn pose(&self, at: &[f64; 6]) -> Pose {
        let turn = DQuat::from_scaled_axis(DVec3::new(at[3], at[4], at[5]));
        let moved = DVec3::new(at[0], at[1], at[2]);
        Pose::from_parts(turn * self.nominal.rotation, self.nominal.translation + moved)
    }
}

impl BinLikelihood<6> for SolidModel {
    fn log_likelihood(&mut self, object: u32, at: &[f64; 6], depth: usize, reading: usize) -> f64 {
        self.stop.check();
        let blur = self.blur_of[depth.min(self.blur_of.len() - 1)];
        let map = &self.maps[object as usize][blur];
        let press = &self.presses[reading];
        TEMPER * log_likelihood(press, map, &self.geometry.table, &self.pose(at))
    }

    fn expected(&self, reading: usize) -> f64 {
        // An unmapped position: every class with its probability where the log-odds are 0.
        let table = &self.geometry.table;
        let taxels = self.presses[reading].taxels().iter();
        TEMPER * taxels.map(|(_, class)| table.probability(*class, 0.0).ln()).sum::<f64>()
    }

    fn screen(&mut self, object: u32, center: &[f64; 6], depth: usize, reading: usize) -> f64 {
        self.log_likelihood(object, center, depth, reading)
    }
}

impl SolidBelief {
    /// Bytes of the histogram and of the presses.
    pub(super) fn bytes(&self) -> usize {
        let presses: usize = self.model.presses.iter().map(ClassifiedPress::bytes).sum();
        size_of::<Self>() + self.histogram.bytes() + presses
    }

    /// Memory of [`SolidBelief::new`], without creating it.
    pub(super) fn memory(
        prepared: &PreparedGeometry,
        half_extent: DVec3,
        half_angle: f64,
        n_alive: usize,
    ) -> Result<BeliefMemory, GeometricError> {
        if prepared.model().maps.iter().any(|map| map.occupancy.shape().is_planar()) {
            return Err(GeometricError::NotSolid);
        }
        check_resolved(half_extent, half_angle)?;
        let first: usize = first_bins(half_extent, half_angle).iter().product();
        let own = first * n_alive * size_of::<Bin<6>>();
        Ok(BeliefMemory::new(own, prepared.blurs_bytes(), prepared.has_blurs()))
    }

    pub(super) fn new(
        prepared: &PreparedGeometry,
        pose: PosePrior,
        options: AdaptiveOptions,
        log_prior: &[f64],
    ) -> Result<Self, GeometricError> {
        let PosePrior::Bounded { session_from_object: nominal, half_extent, half_angle } = pose
        else {
            return Err(GeometricError::NotPlanar);
        };
        let geometry = prepared.model();
        if geometry.maps.iter().any(|map| map.occupancy.shape().is_planar()) {
            return Err(GeometricError::NotSolid);
        }
        let (high, lengths) = (half_sides(half_extent, half_angle), LENGTHS);
        let low = high.map(|half| -half);
        let n = first_bins(half_extent, half_angle);
        let smallest = options.smallest.max(1.0 * MM);
        let division = Division::new(low, high, n, lengths, smallest, 1);
        let blur_of = (0..=division.depth_max())
            .map(|depth| {
                let widths = division.widths(depth);
                let squared: f64 = (0..6).map(|a| (widths[a] * lengths[a]).powi(2)).sum();
                // Along one axis: a third of the shifts, and two thirds of the turns about it.
                let spread = (squared / 12.0 / 3.0).sqrt();
                BLURS.iter().rposition(|blur| *blur <= spread).unwrap_or(0)
            })
            .collect();
        let maps = (0..geometry.maps.len()).map(|object| prepared.blurs(object));
        let maps = maps.collect::<Result<Vec<_>, _>>()?;
        let first: usize = n.iter().product();
        let n_alive = log_prior.iter().filter(|log| log.is_finite()).count();
        let effort = Effort {
            keep: options.keep,
            split: options.split,
            floor: options.floor,
            screened_max: usize::MAX,
            screen_temper: 1.0,
            evaluations_max: EVALUATIONS * options.evaluations * n_alive,
            bins_max: 8 * first * n_alive,
        };
        let presses = Vec::new();
        let model = SolidModel {
            geometry: geometry.clone(),
            nominal,
            maps,
            blur_of,
            presses,
            stop: Stop::never(),
        };
        let histogram = AdaptiveHistogram::new(division, log_prior);
        Ok(Self { model, effort, histogram, n_objects: log_prior.len(), smallest, low, high })
    }

    /// Makes long loops unwind once `stop` is requested ([`Stop::check`]).
    pub(super) fn heed(&mut self, stop: &Stop) {
        self.model.stop = stop.clone();
    }

    pub(super) fn add(&mut self, reading: &Reading, sensor: &SensorDescription) {
        self.model.presses.push(InverseModel::default().classified(reading, sensor));
        self.histogram.add(&mut self.model, &self.effort);
    }

    pub(super) fn answer(&self, n_modes: usize, n_readings: usize) -> Answer {
        let mut bins: Vec<(f64, &Bin<6>)> =
            self.histogram.bins().iter().map(|bin| (self.histogram.log_mass(bin), bin)).collect();
        bins.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.object.cmp(&b.1.object)));
        let log_of = |object: usize| {
            let own = bins.iter().filter(|(_, bin)| bin.object as usize == object);
            log_sum_exp(own.map(|(log, _)| *log))
        };
        let log_objects: Vec<f64> = (0..self.n_objects).map(log_of).collect();
        let weighted = |(log_weight, bin): &(f64, &Bin<6>)| WeightedPose {
            object: ObjectIdx(bin.object),
            session_from_object: self.model.pose(&bin.center),
            log_weight: *log_weight,
        };
        let poses = bins.iter().take(ANSWERED_MAX).map(weighted).collect();
        let deviation = self.smallest / 12.0_f64.sqrt();
        let scale = ModeScale {
            distance: 8.0 * MM,
            angle: 20.0 * DEG,
            position_deviation: deviation,
            rotation_deviation: deviation / LEVER,
        };
        answer(&log_objects, poses, n_modes, &scale, n_readings)
    }

    pub(super) fn marginals(&self, object: ObjectIdx) -> Option<Marginals> {
        let (low, high) = (self.low, self.high);
        marginals::of_object(&self.histogram, object, &AXES, low, high, MARGINAL_CELLS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_too_large_for_the_first_bins_are_refused_by_axis() {
        // Four bins of 7 mm: 14 mm, and 0.467 rad at 30 mm.
        assert_eq!(check_resolved(DVec3::splat(14.0 * MM), 0.46), Ok(()));
        let error = check_resolved(DVec3::new(0.01, 0.5, 0.01), 0.3).unwrap_err();
        let GeometricError::Range { field: "half_extent y", high, .. } = error else {
            panic!("{error}");
        };
        assert!((high - 14.0 * MM).abs() < 0.1 * MM, "{high}");
        let error = check_resolved(DVec3::splat(0.01), 0.5).unwrap_err();
        assert!(matches!(error, GeometricError::Range { field: "half_angle", .. }), "{error}");
    }
}
