//! The belief over planar poses from force mosaics.
//!
//! A pose is (x, y, θ) of the object's frame in the stated plane, metres and rad. A bin's own
//! extent is one more slip of the press: shift and turn widen by the bin's spread, so that a
//! coarse bin is asked whether the press fits anywhere within it.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use nalgebra::{Matrix3, Matrix6, Matrix6x3};

use super::marginals::{self, Marginals, Share};
use super::polish::{Mode, PressAtPose, polish};
use super::{AdaptiveOptions, GeometricError, PosePrior};
use crate::belief::answer::{Answer, PoseMode};
use crate::filter::adaptive::{AdaptiveHistogram, BinLikelihood, Division, Effort};
use crate::log_prob::{entropy_bits, log_sum_exp, normalize};
use crate::model::ObjectIdx;
use crate::model::geometry::GeometricModel;
use crate::mosaic::learn::lay_down;
use crate::mosaic::press_fit::{Placement, Press, PressPrior, Workspace, fit};
use crate::mosaic::tile::Tile;
use crate::pose::Pose;
use crate::reading::Reading;
use crate::sensor::SensorDescription;
use crate::units::{DEG, MM};

/// A length (m) that stands for a turn of one rad: an object's reach from its origin.
const LEVER: f64 = 9.0 * MM;

/// The most a press may be tilted from the plane's normal.
const TILT_MAX: f64 = 30.0 * DEG;

/// Bins that are polished for an answer, and how far behind the best they may be, nats.
const POLISHED_MAX: usize = 24;
const POLISHED_REACH: f64 = 8.0;

/// Cells of a plotted axis.
const MARGINAL_CELLS: usize = 72;

/// Refuses presses that do not come along the plane's normal.
pub(super) fn check_tilt(plane_from_sensor: &Pose) -> Result<(), GeometricError> {
    // The sensor looks at the object: its z points into the plane.
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
    log_prior: Vec<f64>,
}

/// The plane and the box of poses in it.
#[derive(Clone, Copy, Debug)]
struct Plane {
    session_from_plane: Pose,
    low: [f64; 3],
    high: [f64; 3],
}

/// What readings say about planar poses.
#[derive(Clone, Debug)]
pub(super) struct PlanarModel {
    geometry: Arc<GeometricModel>,
    maps: Vec<PlanarMap>,
    readings: Vec<PlanarReading>,
    options: AdaptiveOptions,
    /// Spread of a bin by depth: of x and y (m) and of θ (rad).
    spreads: Vec<[f64; 2]>,
    workspace: Workspace,
}

/// One object: its tiles by depth, and the height of its plane, metres.
#[derive(Clone, Debug)]
struct PlanarMap {
    tiles: Vec<Arc<Tile>>,
    height: f64,
}

/// A reading in the plane's frame.
#[derive(Clone, Debug)]
struct PlanarReading {
    center: [f64; 2],
    press: Press,
}

impl PlanarModel {
    fn new(
        geometry: &Arc<GeometricModel>,
        options: AdaptiveOptions,
        division: &Division<3>,
    ) -> Result<Self, GeometricError> {
        let spreads: Vec<[f64; 2]> = (0..=division.depth_max())
            .map(|depth| {
                // Uniform within the bin: width over √12.
                let [x, y, angle] = division.widths(depth).map(|width| width / 12.0_f64.sqrt());
                [x.max(y), angle]
            })
            .collect();
        let mut maps = Vec::new();
        for (object, map) in geometry.maps.iter().enumerate() {
            if !map.occupancy.shape().is_planar() {
                return Err(GeometricError::NotPlanar);
            }
            let mosaic = map.mosaic.as_ref().ok_or(GeometricError::NoMosaic { object })?;
            let reach = |spread: &[f64; 2]| spread[0].hypot(LEVER * spread[1]);
            let tile = |spread| Arc::new(Tile::new(mosaic, reach(spread)));
            let mut tiles: Vec<Arc<Tile>> = spreads.iter().take(2).map(tile).collect();
            tiles.push(Arc::new(Tile::new(mosaic, 0.0)));
            maps.push(PlanarMap { tiles, height: mosaic.shape().min().z });
        }
        let (readings, workspace) = (Vec::new(), Workspace::default());
        Ok(Self { geometry: geometry.clone(), maps, readings, options, spreads, workspace })
    }

    /// Where a reading lies on an object at a pose.
    fn placement(center: [f64; 2], pose: &[f64; 3]) -> Placement {
        let (sin, cos) = pose[2].sin_cos();
        let [x, y] = [center[0] - pose[0], center[1] - pose[1]];
        Placement { center: [cos * x + sin * y, cos * y - sin * x], turn: [cos, -sin] }
    }

    /// The strays of a press within a bin of this spread.
    fn within_bin(&self, place: &Placement, spread: [f64; 2]) -> PressPrior {
        let press = self.options.press;
        let lever = place.center[0].hypot(place.center[1]);
        let shift = press.shift.hypot(spread[0]).hypot(lever * spread[1]);
        PressPrior { shift, turn: press.turn.hypot(spread[1]), ..press }
    }

    fn tile(&self, object: u32, depth: usize) -> Arc<Tile> {
        let tiles = &self.maps[object as usize].tiles;
        tiles[depth.min(tiles.len() - 1)].clone()
    }

    /// Polishes a pose on all readings.
    fn polish(&mut self, object: u32, start: [f64; 3]) -> Mode {
        let tile = self.tile(object, usize::MAX);
        let (press, temper) = (self.options.press, self.options.temper);
        let (readings, workspace) = (&self.readings, &mut self.workspace);
        let fit_at = |pose: &[f64; 3], reading: usize| {
            let reading = &readings[reading];
            let place = Self::placement(reading.center, pose);
            let fitted = fit(&reading.press, &place, &tile, &press, workspace);
            PressAtPose { fitted, place, prior: press, temper }
        };
        polish(start, readings.len(), fit_at)
    }
}

impl BinLikelihood<3> for PlanarModel {
    fn log_likelihood(
        &mut self,
        object: u32,
        center: &[f64; 3],
        depth: usize,
        reading: usize,
    ) -> f64 {
        let place = Self::placement(self.readings[reading].center, center);
        let prior = self.within_bin(&place, self.spreads[depth.min(self.spreads.len() - 1)]);
        let tiles = &self.maps[object as usize].tiles;
        let tile = &tiles[depth.min(tiles.len() - 1)];
        let press = &self.readings[reading].press;
        self.options.temper * fit(press, &place, tile, &prior, &mut self.workspace).log_likelihood
    }
}

impl PlanarBelief {
    pub(super) fn new(
        geometry: &Arc<GeometricModel>,
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
        let division = Division::new(low, high, options.first, lengths, options.smallest, 3);
        let model = PlanarModel::new(geometry, options, &division)?;
        let n_alive = log_prior.iter().filter(|log| log.is_finite()).count();
        let first: usize = options.first.iter().product();
        let effort = Effort {
            keep: options.keep,
            split: options.split,
            floor: options.floor,
            evaluations_max: options.evaluations * n_alive,
            bins_max: 4 * first * n_alive,
        };
        let histogram = AdaptiveHistogram::new(division, log_prior);
        let plane = Plane { session_from_plane, low, high };
        Ok(Self { plane, effort, model, histogram, log_prior: log_prior.to_vec() })
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
        let (center, press, _) = lay_down(&plane_from_sensor, reading, sensor, gains);
        self.model.readings.push(PlanarReading { center, press });
        self.histogram.add(&mut self.model, &self.effort);
        Ok(())
    }

    /// Probabilities of the objects and polished poses.
    pub(super) fn answer(&self, n_modes: usize, n_readings: usize) -> Answer {
        let mut log_objects = vec![f64::NEG_INFINITY; self.log_prior.len()];
        for (object, log) in log_objects.iter_mut().enumerate() {
            let bins = self.histogram.bins().iter().filter(|bin| bin.object as usize == object);
            *log = log_sum_exp(bins.map(|bin| self.histogram.log_mass(bin)));
        }
        let probabilities = normalize(&log_objects);
        let total = log_sum_exp(log_objects.iter().copied());
        let modes = self.modes(n_modes, total);
        let entropy_bits = entropy_bits(&probabilities);
        Answer { probabilities, modes, entropy_bits, n_readings }
    }

    /// Polishes the most massive bins and gathers those that end at the same pose.
    fn modes(&self, n_modes: usize, log_total: f64) -> Vec<PoseMode> {
        let mut bins: Vec<_> =
            self.histogram.bins().iter().map(|bin| (self.histogram.log_mass(bin), *bin)).collect();
        bins.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.object.cmp(&b.1.object)));
        let best = bins.first().map_or(0.0, |bin| bin.0);
        bins.truncate(POLISHED_MAX.max(n_modes));
        bins.retain(|bin| bin.0 >= best - POLISHED_REACH);
        let mut model = self.model.clone();
        let mut found: Vec<(u32, Mode, f64)> = Vec::new();
        for (log_mass, bin) in bins {
            let mode = match self.model.readings.is_empty() {
                true => Mode::unpolished(bin.center, self.histogram.division().widths(0)),
                false => model.polish(bin.object, bin.center),
            };
            let same = found.iter_mut().find(|known| known.0 == bin.object && known.1.is(&mode));
            let weight = (log_mass - log_total).exp();
            match same {
                Some(known) => {
                    known.2 += weight;
                    if mode.log_likelihood > known.1.log_likelihood {
                        known.1 = mode;
                    }
                }
                None => found.push((bin.object, mode, weight)),
            }
        }
        found.sort_by(|a, b| b.2.total_cmp(&a.2));
        found.truncate(n_modes);
        found.iter().map(|(object, mode, weight)| self.pose_mode(*object, mode, *weight)).collect()
    }

    fn pose_mode(&self, object: u32, mode: &Mode, weight: f64) -> PoseMode {
        let [x, y, angle] = mode.pose;
        let height = self.model.maps[object as usize].height;
        let plane_from_object =
            Pose::from_parts(DQuat::from_rotation_z(angle), DVec3::new(x, y, -height));
        let session_from_plane = self.plane.session_from_plane;
        PoseMode {
            object: ObjectIdx(object),
            session_from_object: session_from_plane * plane_from_object,
            covariance: in_session(&session_from_plane, &mode.covariance),
            weight,
        }
    }

    pub(super) fn marginals(&self, object: ObjectIdx) -> Option<Marginals> {
        let of = |bin: &&_| -> bool {
            let bin: &crate::filter::adaptive::Bin<3> = bin;
            bin.object == object.0
        };
        let bins: Vec<_> = self.histogram.bins().iter().filter(of).collect();
        let logs: Vec<f64> = bins.iter().map(|bin| self.histogram.log_mass(bin)).collect();
        if bins.is_empty() {
            return None;
        }
        let probabilities = normalize(&logs);
        let spans: Vec<([f64; 3], [f64; 3])> = bins
            .iter()
            .map(|bin| {
                let widths = self.histogram.division().widths(bin.depth as usize);
                let edge = |side: f64| [0, 1, 2].map(|a: usize| bin.center[a] + side * widths[a]);
                (edge(-0.5), edge(0.5))
            })
            .collect();
        let boxes: Vec<Share<'_>> = spans
            .iter()
            .zip(&probabilities)
            .map(|((low, high), probability)| Share { low, high, probability: *probability })
            .collect();
        let (low, high) = (self.plane.low, self.plane.high);
        let axis = |name, index: usize| {
            marginals::axis(name, index, (low[index], high[index]), MARGINAL_CELLS, &boxes)
        };
        let corner = |corner: [f64; 3]| [corner[0], corner[1]];
        Some(Marginals {
            axes: vec![axis("x", 0), axis("y", 1), axis("theta", 2)],
            plane: Some(marginals::plane(corner(low), corner(high), MARGINAL_CELLS, &boxes)),
        })
    }
}

/// Covariance in ROS order of x, y and θ in a plane; the three fixed axes are known to
/// 0.1 mm and 0.1 degrees.
fn in_session(session_from_plane: &Pose, covariance: &Matrix3<f64>) -> Matrix6<f64> {
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| session_from_plane.turn(axis));
    let mut moves = Matrix6x3::zeros();
    let mut fixed = Matrix6x3::zeros();
    for row in 0..3 {
        moves[(row, 0)] = x[row];
        moves[(row, 1)] = y[row];
        moves[(row + 3, 2)] = z[row];
        fixed[(row, 0)] = 0.1 * MM * z[row];
        fixed[(row + 3, 1)] = 0.1 * DEG * x[row];
        fixed[(row + 3, 2)] = 0.1 * DEG * y[row];
    }
    moves * covariance * moves.transpose() + fixed * fixed.transpose()
}
