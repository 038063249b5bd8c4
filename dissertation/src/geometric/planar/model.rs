//! The likelihood of readings for planar poses: maps of force, fitted by every press.
//!
//! A bin's extent widens the slips of the press and the expectation of the map; precisions by
//! pressure say how well a good fit should explain a reading.

use std::sync::Arc;

use super::LEVER;
use crate::filter::adaptive::{BinLikelihood, Division};
use crate::geometric::model::GeometricModel;
use crate::geometric::polish::{Mode, PressAtPose, polish};
use crate::geometric::prepared::PreparedGeometry;
use crate::geometric::tables::Counted;
use crate::geometric::{AdaptiveOptions, GeometricError};
use crate::mosaic::face::FaceDepth;
use crate::mosaic::press_fit::{Placement, Press, PressPrior, Workspace, fit};
use crate::mosaic::screen::{ScreenTile, TurnedPress};
use crate::mosaic::tile::Tile;
use palpate_core::sensor::SensorDescription;
use palpate_core::stop::Stop;

/// Fraction of a bin's spread that widens the map's expectation: slips within the bin are
/// nuisance parameters of the press already, and only the bending beyond them is left.
const BEND: f64 = 0.7;

/// Number of bins of pressure in which precisions are averaged.
const PRESSURE_BINS: usize = 24;

/// Approximate loss of a good fit to the volume of a press's nuisance parameters, nats.
const UNKNOWNS_VOLUME: f64 = 6.0;

/// Likelihood of readings for planar poses.
#[derive(Clone, Debug)]
pub(super) struct PlanarModel {
    pub(super) geometry: Arc<GeometricModel>,
    pub(super) maps: Vec<PlanarMap>,
    pub(super) readings: Vec<PlanarReading>,
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
    pub(super) stop: Stop,
}

/// One object: its tiles by depth, and the height of its plane, metres.
#[derive(Clone, Debug)]
pub(super) struct PlanarMap {
    tiles: Vec<Arc<Counted<Tile>>>,
    screen: Arc<Counted<ScreenTile>>,
    pub(super) height: f64,
    /// Standard deviation of that height, from the presses' uncertain depth.
    pub(super) height_deviation: f64,
}

/// A reading in the plane's frame.
#[derive(Clone, Debug)]
pub(super) struct PlanarReading {
    pub(super) center: [f64; 2],
    pub(super) press: Press,
}

impl PlanarModel {
    pub(super) fn new(
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
    pub(super) fn note_heights(&mut self, sensor: &SensorDescription) {
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
    pub(super) fn polish(&self, object: u32, start: [f64; 3], workspace: &mut Workspace) -> Mode {
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

/// The rotation from the plane's axes to those of an object at this angle.
fn turn_of(angle: f64) -> [f64; 2] {
    let (sin, cos) = angle.sin_cos();
    [cos, -sin]
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
