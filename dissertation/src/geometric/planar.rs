//! The belief over planar poses from force mosaics.
//!
//! A pose is (x, y, θ) of the object's frame in the stated plane, metres and rad. A bin's
//! extent acts as one more slip of the press: shift and turn widen by the bin's spread, so
//! that a coarse bin is scored by whether the press fits anywhere within it.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use nalgebra::{Matrix3, Matrix6, Matrix6x3};

use super::marginals::{self, Marginals};
use super::polish::{Mode, PressAtPose, polish};
use super::prepared::PreparedGeometry;
use super::tables::Counted;
use super::{AdaptiveOptions, BeliefMemory, GeometricError, PosePrior};
use crate::filter::adaptive::{AdaptiveHistogram, Bin, BinLikelihood, Division, Effort};
use crate::geometric::model::GeometricModel;
use crate::mosaic::face::FaceDepth;
use crate::mosaic::learn::lay_down;
use crate::mosaic::press_fit::{Placement, Press, PressPrior, Workspace, fit};
use crate::mosaic::screen::{ScreenTile, TurnedPress};
use crate::mosaic::tile::Tile;
use palpate_core::belief::answer::{Answer, PoseMode};
use palpate_core::log_prob::{entropy_bits, log_sum_exp, normalize};
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::stop::Stop;
use palpate_core::units::{DEG, MM};

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

/// Fraction of a bin's spread that widens the map's expectation: slips within the bin are
/// nuisance parameters of the press already, and only the bending beyond them is left.
const BEND: f64 = 0.7;

/// Number of cells of a plotted axis.
const MARGINAL_CELLS: usize = 72;

/// Number of bins of pressure in which precisions are averaged.
const PRESSURE_BINS: usize = 24;

/// Approximate loss of a good fit to the volume of a press's nuisance parameters, nats.
const UNKNOWNS_VOLUME: f64 = 6.0;

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

/// Likelihood of readings for planar poses.
#[derive(Clone, Debug)]
pub(super) struct PlanarModel {
    geometry: Arc<GeometricModel>,
    maps: Vec<PlanarMap>,
    readings: Vec<PlanarReading>,
    /// The thickest covering among their sensors, metres.
    covering: f64,
    options: AdaptiveOptions,
    precision: PrecisionByPressure,
    /// Spread of a bin by depth: of x and y (m) and of θ (rad).
    spreads: Vec<[f64; 2]>,
    workspace: Workspace,
    turned: TurnedPress,
    /// The reading and angle of the cached turn.
    turned_as: Option<(usize, u64)>,
    /// The turn of that angle.
    turn: [f64; 2],
    stop: Stop,
}

/// One object: its tiles by depth, and the height of its plane, metres.
#[derive(Clone, Debug)]
struct PlanarMap {
    tiles: Vec<Arc<Counted<Tile>>>,
    screen: Arc<Counted<ScreenTile>>,
    height: f64,
    /// Standard deviation of that height, from the presses' uncertain depth.
    height_deviation: f64,
}

/// A reading in the plane's frame.
#[derive(Clone, Debug)]
struct PlanarReading {
    center: [f64; 2],
    press: Press,
}

impl PlanarModel {
    fn new(
        prepared: &PreparedGeometry,
        options: AdaptiveOptions,
        division: &Division<3>,
    ) -> Result<Self, GeometricError> {
        let geometry = prepared.model();
        let spreads: Vec<[f64; 2]> = (0..=division.depth_max())
            .map(|depth| {
                // Uniform within the bin: width over √12.
                let [x, y, angle] = division.widths(depth).map(|width| width / 12.0_f64.sqrt());
                [x.max(y), angle]
            })
            .collect();
        let reach = |spread: &[f64; 2]| BEND * spread[0].hypot(LEVER * spread[1]);
        let mut maps = Vec::new();
        for object in 0..geometry.maps.len() {
            let tile = |spread| prepared.tile(object, reach(spread));
            let mut tiles = spreads.iter().take(2).map(tile).collect::<Result<Vec<_>, _>>()?;
            tiles.push(prepared.tile(object, 0.0)?);
            let screen = prepared.screen(object, reach(&spreads[0]).hypot(options.press.shift))?;
            let height = geometry.maps[object].occupancy.shape().min().z;
            maps.push(PlanarMap { tiles, screen, height, height_deviation: 0.0 });
        }
        Ok(Self {
            geometry: geometry.clone(),
            maps,
            readings: Vec::new(),
            covering: 0.0,
            options,
            precision: PrecisionByPressure::new(geometry),
            spreads,
            workspace: Workspace::default(),
            turned: TurnedPress::default(),
            turned_as: None,
            turn: [1.0, 0.0],
            stop: Stop::never(),
        })
    }

    /// Sets the deviation of the heights of the maps' faces. Maps do not name the sensor that
    /// made them; the sensor with the thickest covering of this belief's readings represents
    /// it.
    fn note_heights(&mut self, sensor: &SensorDescription) {
        let covering = sensor.parameters().covering_thickness;
        if covering <= self.covering {
            return;
        }
        self.covering = covering;
        for (map, trained) in self.maps.iter_mut().zip(&self.geometry.maps) {
            if let Some(mosaic) = &trained.mosaic {
                map.height_deviation = FaceDepth::of_mosaic(mosaic, sensor).deviation;
            }
        }
    }

    /// The placement of a reading on an object at a pose.
    fn placement(center: [f64; 2], pose: &[f64; 3]) -> Placement {
        Self::placement_turned(center, pose, turn_of(pose[2]))
    }

    /// The placement at a pose with a known turn.
    fn placement_turned(center: [f64; 2], pose: &[f64; 3], turn: [f64; 2]) -> Placement {
        let [cos, minus_sin] = turn;
        let [x, y] = [center[0] - pose[0], center[1] - pose[1]];
        Placement { center: [cos * x - minus_sin * y, cos * y + minus_sin * x], turn }
    }

    /// The prior of a press's deviations within a bin of this spread.
    fn within_bin(&self, place: &Placement, spread: [f64; 2]) -> PressPrior {
        let press = self.options.press;
        let lever = place.center[0].hypot(place.center[1]);
        let shift = press.shift.hypot(spread[0]).hypot(lever * spread[1]);
        PressPrior { shift, turn: press.turn.hypot(spread[1]), ..press }
    }

    /// Refines a pose on all readings.
    fn polish(&self, object: u32, start: [f64; 3], workspace: &mut Workspace) -> Mode {
        let Some(tile) = self.maps[object as usize].tiles.last() else {
            return Mode::unpolished(start, [0.0; 3]);
        };
        let (press, temper) = (self.options.press, self.options.temper);
        let fit_at = |pose: &[f64; 3], reading: usize| {
            self.stop.check();
            let reading = &self.readings[reading];
            let place = Self::placement(reading.center, pose);
            let fitted = fit(&reading.press, &place, tile, &press, workspace);
            PressAtPose { fitted, place, prior: press, temper }
        };
        polish(start, self.readings.len(), fit_at)
    }
}

/// Mean ln precision over all maps' cells by pressure.
#[derive(Clone, Debug)]
struct PrecisionByPressure {
    per_bin: f32,
    logs: Vec<f64>,
}

impl PrecisionByPressure {
    fn new(geometry: &GeometricModel) -> Self {
        let mosaics = || geometry.maps.iter().filter_map(|map| map.mosaic.as_ref());
        let largest = mosaics().flat_map(|m| m.pressure().iter().copied()).fold(1.0, f32::max);
        let per_bin = largest / PRESSURE_BINS as f32;
        let mut sums = vec![(0.0, 0.0); PRESSURE_BINS];
        for mosaic in mosaics() {
            for (pressure, deviation) in mosaic.pressure().iter().zip(mosaic.deviation()) {
                if deviation.is_finite() {
                    let sum = &mut sums[Self::bin(*pressure, per_bin)];
                    sum.0 -= f64::from(*deviation).ln();
                    sum.1 += 1.0;
                }
            }
        }
        let mut logs: Vec<f64> = Vec::with_capacity(PRESSURE_BINS);
        for (sum, n) in sums {
            let before = logs.last().copied().unwrap_or(0.0);
            logs.push(if n > 0.0 { sum / n } else { before });
        }
        Self { per_bin, logs }
    }

    fn bin(pressure: f32, per_bin: f32) -> usize {
        ((pressure.max(0.0) / per_bin) as usize).min(PRESSURE_BINS - 1)
    }

    fn of(&self, pressure: f32) -> f64 {
        self.logs[Self::bin(pressure, self.per_bin)]
    }
}

impl BinLikelihood<3> for PlanarModel {
    fn expected(&self, reading: usize) -> f64 {
        let press = &self.readings[reading].press;
        let precision: f64 = press.pressures.iter().map(|z| self.precision.of(*z)).sum();
        let n = press.pressures.len() as f64;
        // Half a nat per taxel, four of their deviations, and the volume of the nuisance
        // parameters.
        self.options.temper * (precision - 0.5 * n - 4.0 * (0.5 * n).sqrt() - UNKNOWNS_VOLUME)
    }

    fn log_likelihood(
        &mut self,
        object: u32,
        center: &[f64; 3],
        depth: usize,
        reading: usize,
    ) -> f64 {
        self.stop.check();
        let place = Self::placement(self.readings[reading].center, center);
        let prior = self.within_bin(&place, self.spreads[depth.min(self.spreads.len() - 1)]);
        let tiles = &self.maps[object as usize].tiles;
        let tile = &tiles[depth.min(tiles.len() - 1)];
        let press = &self.readings[reading].press;
        self.options.temper * fit(press, &place, tile, &prior, &mut self.workspace).log_likelihood
    }

    fn screen(&mut self, object: u32, center: &[f64; 3], _depth: usize, reading: usize) -> f64 {
        self.stop.check();
        let PlanarReading { center: at, press } = &self.readings[reading];
        let name = (reading, center[2].to_bits());
        if self.turned_as != Some(name) {
            self.turn = turn_of(center[2]);
            self.turned.turn(press, self.turn);
            self.turned_as = Some(name);
        }
        let place = Self::placement_turned(*at, center, self.turn);
        let screen = &self.maps[object as usize].screen;
        let amplitude = self.options.press.amplitude as f32;
        self.options.temper * screen.log_likelihood(&mut self.turned, place.center, amplitude)
    }
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
        Answer { probabilities, unknown: 0.0, modes, entropy_bits, n_readings }
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

/// The rotation from the plane's axes to those of an object at this angle.
fn turn_of(angle: f64) -> [f64; 2] {
    let (sin, cos) = angle.sin_cos();
    [cos, -sin]
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
