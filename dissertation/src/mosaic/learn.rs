//! Learning of mosaics: pressures, gains and deviations of presses by alternating least squares.
//!
//! Planar presses of known objects overlap, so that cells, taxel gains and the deviations of
//! single presses (depth, tilt, slip) are separable without a calibration run: each is fitted
//! in turn with the others fixed. Training poses are `object_from_sensor`; a mosaic's plane
//! is that of its grid. Missing taxels are ignored.

use crate::occupancy::{GridError, GridShape};
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::SensorDescription;
use palpate_core::units::MM;

use super::ForceMosaic;
use super::kernel::share;
use super::press_fit::{Placement, Press, PressPrior, Workspace, fit};
use super::tile::Tile;
use super::variance::Variance;

/// The presses of one object by one sensor, and the grid of its mosaic.
#[derive(Clone, Copy, Debug)]
pub struct MosaicSet<'a> {
    /// The presses; poses are `object_from_sensor`.
    pub readings: &'a [Reading],
    /// The sensor of the presses.
    pub sensor: &'a SensorDescription,
    /// Position of the mosaic's cells: one layer.
    pub shape: GridShape,
}

/// Options of learning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MosaicOptions {
    /// Standard deviation of the Gaussian that distributes a taxel's pressure over cells, m.
    pub kernel: f64,
    /// Rounds of alternating least squares.
    pub rounds: usize,
    /// Prior of the presses' deviations. The cells are fitted with their amplitudes alone:
    /// slips fitted together with the cells would warp the map, tilts would skew the gains.
    pub press: PressPrior,
    /// Minimum sum of kernel weights of a mapped cell.
    pub weight_min: f64,
}

impl Default for MosaicOptions {
    fn default() -> Self {
        let (kernel, press) = (0.8 * MM, PressPrior::default());
        Self { kernel, rounds: 4, press, weight_min: 1.0 }
    }
}

impl MosaicOptions {
    /// The prior with amplitudes alone.
    fn amplitude_alone(&self) -> PressPrior {
        PressPrior { tilt: 1e-3, shift: 1e-9, turn: 1e-6, ..self.press }
    }
}

/// The relative gains of one sensor's taxels, mean 1.
#[derive(Clone, Debug, PartialEq)]
pub struct TaxelGains {
    /// The sensor.
    pub sensor: SensorId,
    /// One gain per taxel, row-major.
    pub gains: Vec<f64>,
}

/// Learns the gains of all sensors from the presses of all objects together.
///
/// # Errors
/// [`GridError`] when a set's shape is not one layer.
pub fn learn_gains(
    sets: &[MosaicSet<'_>],
    options: &MosaicOptions,
) -> Result<Vec<TaxelGains>, GridError> {
    let mut gains: Vec<TaxelGains> = Vec::new();
    for set in sets {
        for reading in set.readings {
            if gains.iter().all(|known| known.sensor != reading.sensor()) {
                let ones = vec![1.0; reading.image().pressures.len()];
                gains.push(TaxelGains { sensor: reading.sensor(), gains: ones });
            }
        }
    }
    gains.sort_by_key(|known| known.sensor);
    let mut presses: Vec<Presses> = sets.iter().map(|set| Presses::new(set, &gains)).collect();
    for _round in 0..options.rounds {
        let mut sums: Vec<Vec<[f64; 2]>> =
            gains.iter().map(|known| vec![[0.0; 2]; known.gains.len()]).collect();
        for (presses, set) in presses.iter_mut().zip(sets) {
            presses.calibrate(&gains);
            let tile = presses.alternate(set, options)?;
            presses.sum_gains(&tile, &mut sums, &gains);
        }
        for (known, sums) in gains.iter_mut().zip(&sums) {
            update_gains(&mut known.gains, sums);
        }
    }
    Ok(gains)
}

/// Builds the mosaic of one object with known gains; other sensors have gain 1.
///
/// # Errors
/// [`GridError`] when the set's shape is not one layer.
pub fn build_mosaic(
    set: &MosaicSet<'_>,
    gains: &[TaxelGains],
    options: &MosaicOptions,
) -> Result<ForceMosaic, GridError> {
    let mut presses = Presses::new(set, gains);
    let mut tile = presses.alternate(set, options)?;
    for _round in 1..options.rounds {
        tile = presses.alternate(set, options)?;
    }
    presses.mosaic(set, &tile, options)
}

/// New gains from Σ pressure × expected and Σ expected² per taxel, scaled to mean 1.
fn update_gains(gains: &mut [f64], sums: &[[f64; 2]]) {
    for (gain, [product, square]) in gains.iter_mut().zip(sums) {
        if *square > 0.0 {
            // A taxel that reads nothing is dead, not infinitely weak.
            *gain = (product / square).clamp(0.05, 20.0);
        }
    }
    let mean = gains.iter().sum::<f64>() / gains.len().max(1) as f64;
    gains.iter_mut().for_each(|gain| *gain /= mean);
}

/// Deviations beyond which a taxel is stuck.
const STUCK_DEVIATIONS: f64 = 4.0;

/// A training press with its present fit.
struct Trained {
    press: Press,
    /// Measured pressures, Pa.
    raw: Vec<f64>,
    /// Whether each taxel was stuck at the time.
    stuck: Vec<bool>,
    taxels: Vec<usize>,
    sensor: SensorId,
    place: Placement,
    /// Amplitude and its change along x and y (1/m), shift (m) and turn (rad).
    strays: [f64; 6],
}

/// The presses of one object, and the variance of their residuals by pressure.
struct Presses {
    all: Vec<Trained>,
    variance: Variance,
}

/// The sensor's centre in a plane and the valid taxels of a press, with offsets along the
/// plane's axes; `plane_from_sensor` is seen from above.
#[must_use]
pub fn lay_down(
    plane_from_sensor: &Pose,
    reading: &Reading,
    sensor: &SensorDescription,
    gains: Option<&[f64]>,
) -> ([f64; 2], Press, Vec<usize>) {
    let grid = sensor.grid();
    let center = plane_from_sensor.translation;
    let mut press = Press::default();
    let mut taxels = Vec::new();
    for (taxel, pressure) in reading.image().pressures.iter().enumerate() {
        if reading.missing()[taxel] {
            continue;
        }
        let (x, y) = grid.center(taxel / grid.cols, taxel % grid.cols);
        let offset = plane_from_sensor.turn(glam::DVec3::new(x, y, 0.0));
        let gain = gains.map_or(1.0, |gains| gains[taxel]);
        press.offsets.push([offset.x as f32, offset.y as f32]);
        press.pressures.push((pressure / gain) as f32);
        taxels.push(taxel);
    }
    ([center.x, center.y], press, taxels)
}

impl Presses {
    fn new(set: &MosaicSet<'_>, gains: &[TaxelGains]) -> Self {
        let trained = |reading: &Reading| {
            let object_from_sensor = reading.session_from_sensor();
            let (center, press, taxels) = lay_down(&object_from_sensor, reading, set.sensor, None);
            let raw: Vec<f64> =
                press.pressures.iter().map(|pressure| f64::from(*pressure)).collect();
            let place = Placement { center, turn: [1.0, 0.0] };
            let strays = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            let stuck = vec![false; raw.len()];
            Trained { press, raw, stuck, taxels, sensor: reading.sensor(), place, strays }
        };
        let all = set.readings.iter().map(trained).collect();
        let saturation = set.sensor.parameters().saturation;
        // Initial values: a tenth of the range, and of the pressure.
        let variance = Variance { constant: (0.1 * saturation).powi(2), share: 0.01 };
        let mut presses = Self { all, variance };
        presses.calibrate(gains);
        presses
    }

    /// Divides the measured pressures by the known gains.
    fn calibrate(&mut self, gains: &[TaxelGains]) {
        for trained in &mut self.all {
            let known = gains.iter().find(|known| known.sensor == trained.sensor);
            for (at, taxel) in trained.taxels.iter().enumerate() {
                let gain = known.and_then(|known| known.gains.get(*taxel)).copied();
                trained.press.pressures[at] = (trained.raw[at] / gain.unwrap_or(1.0)) as f32;
            }
        }
    }

    /// Fits cells, then amplitudes, then cells again.
    fn alternate(
        &mut self,
        set: &MosaicSet<'_>,
        options: &MosaicOptions,
    ) -> Result<Tile, GridError> {
        let first = self.pressures(set, options)?;
        let tile = Tile::new(&first, 0.0);
        self.fit_strays(&tile, &options.amplitude_alone());
        self.find_stuck(&tile, floor(set.sensor));
        Ok(Tile::new(&self.pressures(set, options)?, 0.0))
    }

    fn fit_strays(&mut self, tile: &Tile, prior: &PressPrior) {
        let mut workspace = Workspace::default();
        let deviations = prior.deviations();
        let mut mean = [0.0; 6];
        let share = 1.0 / self.all.len().max(1) as f64;
        for trained in &mut self.all {
            let fitted = fit(&trained.press, &trained.place, tile, prior, &mut workspace);
            for (k, stray) in trained.strays.iter_mut().enumerate() {
                *stray = f64::from(fitted.unknowns[k] * deviations[k]);
                mean[k] += *stray * share;
            }
        }
        // Deviations have mean 0 over a set: their mean belongs to the map.
        for trained in &mut self.all {
            for (k, mean) in mean.iter().enumerate() {
                trained.strays[k] -= mean;
            }
            trained.strays[0] += 1.0;
        }
    }

    /// Learns the variance of residuals and marks outlying taxels as stuck.
    fn find_stuck(&mut self, tile: &Tile, floor: f64) {
        self.all.iter_mut().for_each(|trained| trained.stuck.fill(false));
        let squares = self.squares(tile);
        self.variance = Variance::of(&squares, floor);
        let mut left = squares.into_iter();
        for trained in &mut self.all {
            for (stuck, (expected, residual)) in trained.stuck.iter_mut().zip(&mut left) {
                *stuck = residual > STUCK_DEVIATIONS.powi(2) * self.variance.at(expected);
            }
        }
    }

    /// Squared expected pressure and squared residual of every taxel that is not stuck.
    fn squares(&self, tile: &Tile) -> Vec<(f64, f64)> {
        let mut squares = Vec::new();
        self.each_taxel(|place, pressure, amplitude| {
            let expected = tile.at(place[0] as f32, place[1] as f32).pressure;
            let expected = amplitude * f64::from(expected);
            squares.push((expected * expected, (pressure - expected).powi(2)));
        });
        squares
    }

    fn sum_gains(&self, tile: &Tile, sums: &mut [Vec<[f64; 2]>], gains: &[TaxelGains]) {
        for trained in &self.all {
            let Some(of) = gains.iter().position(|known| known.sensor == trained.sensor) else {
                continue;
            };
            for (at, taxel) in trained.taxels.iter().enumerate() {
                if trained.stuck[at] {
                    continue;
                }
                let (place, amplitude) = trained.taxel(at);
                let expected = tile.at(place[0] as f32, place[1] as f32);
                let mean = amplitude * f64::from(expected.pressure);
                sums[of][*taxel][0] += trained.raw[at] * mean;
                sums[of][*taxel][1] += mean * mean;
            }
        }
    }

    /// Kernel-weighted least squares of every cell's pressure, with its deviation; infinite
    /// for cells of too little weight.
    fn pressures(
        &self,
        set: &MosaicSet<'_>,
        options: &MosaicOptions,
    ) -> Result<ForceMosaic, GridError> {
        // Σ K m z, Σ K m², Σ K.
        let mut sums = vec![[0.0f64; 3]; set.shape.n_cells()];
        self.each_taxel(|place, pressure, amplitude| {
            share(&set.shape, options.kernel, place, |cell, weight| {
                let sum = &mut sums[cell];
                sum[0] += weight * amplitude * pressure;
                sum[1] += weight * amplitude * amplitude;
                sum[2] += weight;
            });
        });
        let pressure = |[cross, square, _]: &[f64; 3]| cross / square.max(1e-9);
        let deviation = |sum: &[f64; 3]| match sum[2] < options.weight_min {
            true => f32::INFINITY,
            false => self.variance.at(pressure(sum).powi(2)).sqrt() as f32,
        };
        let deviations = sums.iter().map(deviation).collect();
        let pressures = sums.iter().map(|sum| pressure(sum) as f32).collect();
        ForceMosaic::from_parts(set.shape, pressures, deviations)
    }

    /// The cells' pressures, and the deviations of residuals after each press's own deviations.
    fn mosaic(
        &mut self,
        set: &MosaicSet<'_>,
        tile: &Tile,
        options: &MosaicOptions,
    ) -> Result<ForceMosaic, GridError> {
        // Deviations are a function of the pressure alone. Further differences between cells
        // are chance, and identity would follow the chance of thirty taxels.
        let means = self.pressures(set, options)?;
        self.fit_strays(tile, &options.press);
        self.variance = Variance::of(&self.squares(tile), floor(set.sensor));
        let spread = |(pressure, known): (&f32, &f32)| match known.is_finite() {
            true => self.variance.at(f64::from(*pressure).powi(2)).sqrt() as f32,
            false => f32::INFINITY,
        };
        let deviation = means.pressure().iter().zip(means.deviation()).map(spread).collect();
        ForceMosaic::from_parts(set.shape, means.pressure().to_vec(), deviation)
    }

    /// Calls `take` with (position, pressure over gain, amplitude) of every taxel that is not
    /// stuck.
    fn each_taxel(&self, mut take: impl FnMut([f64; 2], f64, f64)) {
        for trained in &self.all {
            for (at, pressure) in trained.press.pressures.iter().enumerate() {
                if trained.stuck[at] {
                    continue;
                }
                let (place, amplitude) = trained.taxel(at);
                take(place, f64::from(*pressure), amplitude);
            }
        }
    }
}

impl Trained {
    /// Position of a taxel in the object's plane (m) and its amplitude.
    fn taxel(&self, at: usize) -> ([f64; 2], f64) {
        let [x, y] = self.press.offsets[at].map(f64::from);
        let [amplitude, tilt_x, tilt_y, shift_x, shift_y, turn] = self.strays;
        let place = [
            self.place.center[0] + x + shift_x - turn * y,
            self.place.center[1] + y + shift_y + turn * x,
        ];
        (place, (amplitude + tilt_x * x + tilt_y * y).max(0.1))
    }
}

/// Smallest variance, Pa²: the sensor's stated one, or 2.5 % of its range, since simulated
/// presses are more exact than those of a real sensor.
fn floor(sensor: &SensorDescription) -> f64 {
    let parameters = sensor.parameters();
    let stated = parameters.noise.powi(2) + parameters.quantisation.powi(2) / 12.0;
    stated.max((0.025 * parameters.saturation).powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_have_mean_one_and_a_dead_taxel_is_bounded() {
        let mut gains = vec![1.0; 3];
        update_gains(&mut gains, &[[2.0, 1.0], [4.0, 2.0], [0.0, 5.0]]);
        // 2, 2 and 0.05 over their mean of 1.35.
        assert!((gains[0] - 2.0 / 1.35).abs() < 1e-12 && (gains[2] - 0.05 / 1.35).abs() < 1e-12);
    }
}
