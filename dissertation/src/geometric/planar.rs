//! The belief over planar poses from force mosaics.
//!
//! A pose is (x, y, θ) of the object's frame in the stated plane, metres and rad. A bin's
//! extent acts as one more slip of the press: shift and turn widen by the bin's spread, so
//! that a coarse bin is scored by whether the press fits anywhere within it (`model`).

mod model;

use glam::{DQuat, DVec3};
use nalgebra::{Matrix3, Matrix6, Matrix6x3};

use super::marginals::{self, Marginals};
use super::polish::Mode;
use super::prepared::PreparedGeometry;
use super::{AdaptiveOptions, BeliefMemory, GeometricError, PosePrior};
use crate::filter::adaptive::{AdaptiveHistogram, Bin, Division, Effort};
use crate::mosaic::learn::lay_down;
use crate::mosaic::press_fit::Workspace;
use palpate_core::belief::answer::{Answer, PoseMode};
use palpate_core::log_prob::{entropy_bits, log_sum_exp, normalize};
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::stop::Stop;
use palpate_core::units::{DEG, MM};

use model::{PlanarMap, PlanarModel, PlanarReading};

/// Lever arm (m) of one rad of rotation: an object's reach from its origin.
const LEVER: f64 = 9.0 * MM;

/// Largest tilt of a press from the plane's normal.
const TILT_MAX: f64 = 30.0 * DEG;

/// Distance behind the best beyond which bins form no modes and hold no probability, nats.
const MODE_REACH: f64 = 12.0;
const FORGOTTEN: f64 = 40.0;

/// Standard deviation of a taxel's gain before it is learnt, relative to 1.
const UNKNOWN_GAIN: f32 = 0.2;

/// Standard deviation of the stated plane, metres. Chosen: for a client that measures it.
const PLANE_DEVIATION: f64 = 0.1 * MM;

/// Minimum number of objects for which effort is allotted.
const LOOKED_AT_MIN: usize = 5;

/// Number of cells of a plotted axis.
const MARGINAL_CELLS: usize = 72;

const AXES: [&str; 3] = ["x", "y", "theta"];

/// Refuses presses that are not along the plane's normal.
pub(super) fn check_tilt(plane_from_sensor: &Pose) -> Result<(), GeometricError> {
    // The sensor faces the object: its z points into the plane.
    let tilt = (-plane_from_sensor.turn(DVec3::Z).z).clamp(-1.0, 1.0).acos();
    if tilt > TILT_MAX {
        return Err(GeometricError::Tilt { degrees: tilt / DEG });
    }
    Ok(())
}

/// A belief over identity and planar pose.
#[derive(Clone, Debug)]
pub(super) struct PlanarBelief {
    plane: Plane,
    effort: Effort,
    model: PlanarModel,
    histogram: AdaptiveHistogram<3>,
    n_objects: usize,
}

/// The plane and the box of poses in it.
#[derive(Clone, Copy, Debug)]
struct Plane {
    session_from_plane: Pose,
    low: [f64; 3],
    high: [f64; 3],
}

impl PlanarBelief {
    /// Bytes of the histogram and of the presses.
    pub(super) fn bytes(&self) -> usize {
        let taxels: usize = self.model.readings.iter().map(|r| r.press.pressures.len()).sum();
        size_of::<Self>() + self.histogram.bytes() + taxels * size_of::<[f32; 3]>()
    }

    /// Memory of [`PlanarBelief::new`], without creating it.
    pub(super) fn memory(
        prepared: &PreparedGeometry,
        half_extent: f64,
        half_angle: f64,
        options: &AdaptiveOptions,
        n_alive: usize,
    ) -> Result<BeliefMemory, GeometricError> {
        for object in 0..prepared.model().maps.len() {
            prepared.mosaic(object)?;
        }
        options.check_resolved(half_extent)?;
        let first = options.first_bins([half_extent, half_extent, half_angle]);
        let own = first.iter().product::<usize>() * n_alive * size_of::<Bin<3>>();
        Ok(BeliefMemory::new(own, prepared.tiles_bytes(), prepared.has_tiles()))
    }

    pub(super) fn new(
        prepared: &PreparedGeometry,
        pose: PosePrior,
        options: AdaptiveOptions,
        log_prior: &[f64],
    ) -> Result<Self, GeometricError> {
        let PosePrior::Planar { session_from_plane, center, half_extent, angle, half_angle } = pose
        else {
            return Err(GeometricError::NotSolid);
        };
        let half = [half_extent, half_extent, half_angle];
        let middle = [center[0], center[1], angle];
        let low = [0, 1, 2].map(|axis: usize| middle[axis] - half[axis]);
        let high = [0, 1, 2].map(|axis: usize| middle[axis] + half[axis]);
        let lengths = [1.0, 1.0, LEVER];
        let n = options.first_bins(half);
        let division = Division::new(low, high, n, lengths, options.smallest, 3);
        let model = PlanarModel::new(prepared, options, &division)?;
        let n_alive = log_prior.iter().filter(|log| log.is_finite()).count();
        // Two similar objects need as close a search as five.
        let n_looked_at = n_alive.max(LOOKED_AT_MIN);
        let first: usize = n.iter().product();
        let effort = Effort {
            keep: options.keep,
            split: options.split,
            floor: options.floor,
            screened_max: options.screened(first) * n_looked_at,
            screen_temper: options.screen_temper,
            evaluations_max: options.evaluations * n_looked_at,
            bins_max: 4 * first * n_alive,
        };
        let histogram = AdaptiveHistogram::new(division, log_prior);
        let plane = Plane { session_from_plane, low, high };
        Ok(Self { plane, effort, model, histogram, n_objects: log_prior.len() })
    }

    /// Makes long loops unwind once `stop` is requested ([`Stop::check`]).
    pub(super) fn heed(&mut self, stop: &Stop) {
        self.model.stop = stop.clone();
    }

    pub(super) fn add(
        &mut self,
        reading: &Reading,
        sensor: &SensorDescription,
    ) -> Result<(), GeometricError> {
        let plane_from_sensor =
            self.plane.session_from_plane.inverse() * reading.session_from_sensor();
        check_tilt(&plane_from_sensor)?;
        let known = self.model.geometry.gains.iter().find(|g| g.sensor == reading.sensor());
        let gains = known
            .map(|known| &known.gains[..])
            .filter(|gains| gains.len() == reading.image().pressures.len());
        let (center, mut press, _) = lay_down(&plane_from_sensor, reading, sensor, gains);
        press.gain_deviation = if gains.is_some() { 0.0 } else { UNKNOWN_GAIN };
        self.model.readings.push(PlanarReading { center, press });
        self.model.note_heights(sensor);
        self.histogram.add(&mut self.model, &self.effort);
        Ok(())
    }

    /// Probabilities of the objects and refined poses.
    pub(super) fn answer(&self, n_modes: usize, n_readings: usize) -> Answer {
        let masses = || self.histogram.bins().iter().map(|bin| self.histogram.log_mass(bin));
        let best = masses().fold(f64::NEG_INFINITY, f64::max);
        let mut sums = vec![0.0; self.n_objects];
        for (bin, log_mass) in self.histogram.bins().iter().zip(masses()) {
            if log_mass > best - FORGOTTEN {
                sums[bin.object as usize] += (log_mass - best).exp();
            }
        }
        let log_objects: Vec<f64> = sums.into_iter().map(|sum: f64| best + sum.ln()).collect();
        let probabilities = normalize(&log_objects);
        let total = log_sum_exp(log_objects.iter().copied());
        let modes = self.modes(n_modes, total);
        let entropy_bits = entropy_bits(&probabilities);
        Answer {
            probabilities,
            unknown: 0.0,
            modes,
            entropy_bits,
            n_readings,
            sensor_shift: None,
            image_doubt: None,
        }
    }

    /// Repeatedly refines the bin of the largest mass and gathers the bins around it.
    fn modes(&self, n_modes: usize, log_total: f64) -> Vec<PoseMode> {
        let mut bins: Vec<(f64, Bin<3>)> =
            self.histogram.bins().iter().map(|bin| (self.histogram.log_mass(bin), *bin)).collect();
        let best = bins.iter().map(|bin| bin.0).fold(f64::NEG_INFINITY, f64::max);
        bins.retain(|bin| bin.0 >= best - MODE_REACH);
        let mut workspace = Workspace::default();
        let mut modes = Vec::new();
        while modes.len() < n_modes
            && let Some(most) = most_massive(&bins)
        {
            let (log_first, first) = bins[most];
            let widths = self.histogram.division().widths(first.depth as usize);
            let mode = match self.model.readings.is_empty() {
                true => Mode::unpolished(first.center, widths),
                false => self.model.polish(first.object, first.center, &mut workspace),
            };
            // The best bin is a member, wherever refinement has moved the mode.
            bins.swap_remove(most);
            let mut weight = (log_first - log_total).exp();
            bins.retain(|(log_mass, bin)| {
                let widths = self.histogram.division().widths(bin.depth as usize);
                let here = bin.object == first.object && mode.holds(&bin.center, &widths);
                if here {
                    weight += (log_mass - log_total).exp();
                }
                !here
            });
            modes.push(self.pose_mode(first.object, &mode, weight));
        }
        modes.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        modes
    }

    fn pose_mode(&self, object: u32, mode: &Mode, weight: f64) -> PoseMode {
        let [x, y, angle] = mode.pose;
        let PlanarMap { height, height_deviation, .. } = self.model.maps[object as usize];
        let z_deviation = height_deviation.hypot(PLANE_DEVIATION);
        let plane_from_object =
            Pose::from_parts(DQuat::from_rotation_z(angle), DVec3::new(x, y, -height));
        let session_from_plane = self.plane.session_from_plane;
        PoseMode {
            object: ObjectIdx(object),
            session_from_object: session_from_plane * plane_from_object,
            covariance: in_session(&session_from_plane, &mode.covariance, z_deviation),
            weight,
        }
    }

    pub(super) fn marginals(&self, object: ObjectIdx) -> Option<Marginals> {
        let (low, high) = (self.plane.low, self.plane.high);
        marginals::of_object(&self.histogram, object, &AXES, low, high, MARGINAL_CELLS)
    }
}

/// The bin of the largest mass; of equals, the one of the lowest object and position.
fn most_massive(bins: &[(f64, Bin<3>)]) -> Option<usize> {
    let place = |bin: &Bin<3>| (bin.object, bin.center.map(f64::to_bits));
    let order = |a: &usize, b: &usize| {
        let (a, b) = (&bins[*a], &bins[*b]);
        a.0.total_cmp(&b.0).then_with(|| place(&b.1).cmp(&place(&a.1)))
    };
    (0..bins.len()).max_by(order)
}

/// Covariance in ROS order of x, y and θ in a plane; the height's deviation is `z_deviation`
/// (m), that of tilts 0.1 degrees.
fn in_session(
    session_from_plane: &Pose,
    covariance: &Matrix3<f64>,
    z_deviation: f64,
) -> Matrix6<f64> {
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| session_from_plane.turn(axis));
    let mut moves = Matrix6x3::zeros();
    let mut fixed = Matrix6x3::zeros();
    for row in 0..3 {
        moves[(row, 0)] = x[row];
        moves[(row, 1)] = y[row];
        moves[(row + 3, 2)] = z[row];
        fixed[(row, 0)] = z_deviation * z[row];
        fixed[(row + 3, 1)] = 0.1 * DEG * x[row];
        fixed[(row + 3, 2)] = 0.1 * DEG * y[row];
    }
    moves * covariance * moves.transpose() + fixed * fixed.transpose()
}
