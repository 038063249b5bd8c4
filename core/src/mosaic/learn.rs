//! Learning mosaics: pressures, gains and the presses' own strays by alternating least squares.
//!
//! Planar presses of known objects overlap, so that cells, taxel gains and what single
//! presses did otherwise (depth, tilt, slip) are told apart with no calibration run: each is
//! fitted in turn with the others held. Training poses are `object_from_sensor`; a mosaic's
//! plane is that of its grid. Taxels without a value do not count.

use crate::occupancy::{GridError, GridShape};
use crate::pose::Pose;
use crate::reading::{Reading, SensorId};
use crate::sensor::SensorDescription;

use super::ForceMosaic;
use super::press_fit::{Placement, Press, PressPrior, Workspace, fit};
use super::tile::Tile;

/// The presses of one object by one sensor, and the grid of its mosaic.
#[derive(Clone, Copy, Debug)]
pub struct MosaicSet<'a> {
    /// The presses; poses are `object_from_sensor`.
    pub readings: &'a [Reading],
    /// The sensor that took them.
    pub sensor: &'a SensorDescription,
    /// Where the mosaic's cells lie: one layer.
    pub shape: GridShape,
}

/// How mosaics are learnt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MosaicOptions {
    /// Deviation of the Gaussian that shares a taxel's pressure out to the cells, m.
    pub kernel: f64,
    /// Rounds of alternating least squares.
    pub rounds: usize,
    /// How far presses stray.
    pub press: PressPrior,
    /// A cell with fewer presses (in kernel weights) than this is unknown.
    pub weight_min: f64,
}

impl Default for MosaicOptions {
    fn default() -> Self {
        Self { kernel: 0.0008, rounds: 4, press: PressPrior::default(), weight_min: 1.0 }
    }
}

/// The relative gains of one sensor's taxels, mean 1.
#[derive(Clone, Debug, PartialEq)]
pub struct TaxelGains {
    /// The sensor.
    pub sensor: SensorId,
    /// One gain a taxel, row-major.
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
    for _round in 0..options.rounds {
        let mut sums: Vec<Vec<[f64; 2]>> =
            gains.iter().map(|known| vec![[0.0; 2]; known.gains.len()]).collect();
        for set in sets {
            let mut presses = Presses::new(set, &gains);
            let mosaic = presses.alternate(set, options, 2)?;
            presses.sum_gains(&Tile::new(&mosaic, 0.0), &gains, &mut sums);
        }
        for (known, sums) in gains.iter_mut().zip(&sums) {
            update_gains(&mut known.gains, sums);
        }
    }
    Ok(gains)
}

/// Builds the mosaic of one object with known gains; sensors that are not named have gain 1.
///
/// # Errors
/// [`GridError`] when the set's shape is not one layer.
pub fn build_mosaic(
    set: &MosaicSet<'_>,
    gains: &[TaxelGains],
    options: &MosaicOptions,
) -> Result<ForceMosaic, GridError> {
    Presses::new(set, gains).alternate(set, options, options.rounds)
}

/// New gains from Σ pressure × expected and Σ expected² a taxel, scaled to mean 1.
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

/// A training press as it is understood so far.
struct Trained {
    press: Press,
    taxels: Vec<usize>,
    sensor: SensorId,
    place: Placement,
    /// Amplitude and its change along x and y (1/m), shift (m) and turn (rad).
    strays: [f64; 6],
}

struct Presses(Vec<Trained>);

/// The sensor's centre and the turn of its image in a plane: `plane_from_sensor` seen from
/// above, with the offsets of its taxels in the plane's axes.
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

/// The gains of a sensor among known ones, when they fit its image.
#[must_use]
pub fn gains_of<'a>(gains: &'a [TaxelGains], reading: &Reading) -> Option<&'a [f64]> {
    let known = gains.iter().find(|known| known.sensor == reading.sensor())?;
    (known.gains.len() == reading.image().pressures.len()).then_some(&known.gains[..])
}

impl Presses {
    fn new(set: &MosaicSet<'_>, gains: &[TaxelGains]) -> Self {
        let trained = |reading: &Reading| {
            let object_from_sensor = reading.session_from_sensor();
            let known = gains_of(gains, reading);
            let (center, press, taxels) = lay_down(&object_from_sensor, reading, set.sensor, known);
            let place = Placement { center, turn: [1.0, 0.0] };
            let strays = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            Trained { press, taxels, sensor: reading.sensor(), place, strays }
        };
        Self(set.readings.iter().map(trained).collect())
    }

    /// Fits cells and strays in turn.
    fn alternate(
        &mut self,
        set: &MosaicSet<'_>,
        options: &MosaicOptions,
        rounds: usize,
    ) -> Result<ForceMosaic, GridError> {
        let mut mosaic = self.mosaic(&set.shape, set.sensor, options)?;
        for _round in 0..rounds {
            self.fit_strays(&Tile::new(&mosaic, 0.0), &options.press);
            mosaic = self.mosaic(&set.shape, set.sensor, options)?;
        }
        Ok(mosaic)
    }

    fn fit_strays(&mut self, tile: &Tile, prior: &PressPrior) {
        let mut workspace = Workspace::default();
        let deviations = prior.deviations();
        let mut mean = [0.0; 6];
        let share = 1.0 / self.0.len().max(1) as f64;
        for trained in &mut self.0 {
            let fitted = fit(&trained.press, &trained.place, tile, prior, &mut workspace);
            for (k, stray) in trained.strays.iter_mut().enumerate() {
                *stray = f64::from(fitted.unknowns[k] * deviations[k]);
                mean[k] += *stray * share;
            }
        }
        // Strays have mean 0 over a set: their mean belongs to the map.
        for trained in &mut self.0 {
            for (k, mean) in mean.iter().enumerate() {
                trained.strays[k] -= mean;
            }
            trained.strays[0] += 1.0;
        }
    }

    fn sum_gains(&self, tile: &Tile, gains: &[TaxelGains], sums: &mut [Vec<[f64; 2]>]) {
        for trained in &self.0 {
            let Some(of) = gains.iter().position(|known| known.sensor == trained.sensor) else {
                continue;
            };
            for (at, taxel) in trained.taxels.iter().enumerate() {
                let (place, amplitude) = trained.taxel(at);
                let expected = tile.at(place[0] as f32, place[1] as f32);
                let mean = amplitude * f64::from(expected.pressure);
                let raw = f64::from(trained.press.pressures[at]) * gains[of].gains[*taxel];
                sums[of][*taxel][0] += raw * mean;
                sums[of][*taxel][1] += mean * mean;
            }
        }
    }

    /// Kernel-weighted least squares of every cell, and the residuals about it.
    fn mosaic(
        &self,
        shape: &GridShape,
        sensor: &SensorDescription,
        options: &MosaicOptions,
    ) -> Result<ForceMosaic, GridError> {
        let n = shape.n_cells();
        // Σ K m z, Σ K m², Σ K.
        let mut sums = vec![[0.0f64; 3]; n];
        self.share_out(shape, options.kernel, |cell, weight, pressure, amplitude| {
            let sum = &mut sums[cell];
            sum[0] += weight * amplitude * pressure;
            sum[1] += weight * amplitude * amplitude;
            sum[2] += weight;
        });
        let pressure: Vec<f64> =
            sums.iter().map(|[product, square, _]| product / square.max(1e-9)).collect();
        let means = ForceMosaic::from_parts(
            *shape,
            pressure.iter().map(|value| *value as f32).collect(),
            vec![1.0; n],
        )?;
        let tile = Tile::new(&means, 0.0);
        let mut squares = vec![0.0f64; n];
        self.each_taxel(|place, pressure, amplitude| {
            let expected = tile.at(place[0] as f32, place[1] as f32).pressure;
            let residual = pressure - amplitude * f64::from(expected);
            share(shape, options.kernel, place, |cell, weight| {
                squares[cell] += weight * residual * residual;
            });
        });
        let parameters = sensor.parameters();
        let floor = parameters.noise.powi(2) + parameters.quantisation.powi(2) / 12.0;
        let floor = floor.max((1e-3 * parameters.saturation).powi(2));
        let deviation = |(square, sum): (&f64, &[f64; 3])| {
            if sum[2] < options.weight_min {
                return f32::INFINITY;
            }
            // One taxel of a typical deviation's weight keeps a lucky cell from certainty.
            (square / sum[2]).max(floor).sqrt() as f32
        };
        let deviation = squares.iter().zip(&sums).map(deviation).collect();
        let pressure = pressure.iter().map(|value| *value as f32).collect();
        ForceMosaic::from_parts(*shape, pressure, deviation)
    }

    /// Calls with (place, pressure over gain, amplitude) of every taxel.
    fn each_taxel(&self, mut take: impl FnMut([f64; 2], f64, f64)) {
        for trained in &self.0 {
            for (at, pressure) in trained.press.pressures.iter().enumerate() {
                let (place, amplitude) = trained.taxel(at);
                take(place, f64::from(*pressure), amplitude);
            }
        }
    }

    fn share_out(
        &self,
        shape: &GridShape,
        kernel: f64,
        mut take: impl FnMut(usize, f64, f64, f64),
    ) {
        self.each_taxel(|place, pressure, amplitude| {
            share(shape, kernel, place, |cell, weight| take(cell, weight, pressure, amplitude));
        });
    }
}

impl Trained {
    /// Where a taxel lay in the object's plane (m) and how strongly it was pressed there.
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

/// Calls with (cell, kernel weight) of the cells within three deviations of a place.
fn share(shape: &GridShape, kernel: f64, place: [f64; 2], mut take: impl FnMut(usize, f64)) {
    let (min, cell, n) = (shape.min(), shape.cell(), shape.n());
    let at = [(place[0] - min.x) / cell - 0.5, (place[1] - min.y) / cell - 0.5];
    let reach = 3.0 * kernel / cell;
    let range = |axis: usize| {
        let low = (at[axis] - reach).ceil().max(0.0) as usize;
        let high = (at[axis] + reach).floor().min(n[axis] as f64 - 1.0);
        low..(high + 1.0).max(low as f64) as usize
    };
    let scale = -0.5 * (cell / kernel).powi(2);
    for y in range(1) {
        for x in range(0) {
            let squared = (x as f64 - at[0]).powi(2) + (y as f64 - at[1]).powi(2);
            take(x + n[0] * y, (scale * squared).exp());
        }
    }
}
