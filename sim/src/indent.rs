//! A simulated indentation run: the data that the bench of section 2.1.1 measures of a sensor.
//!
//! Every taxel has its own gain and offset, one is dead and one is wired to its neighbour. A
//! small indenter is stiffer than a uniform displacement. The imaging model gives only the
//! shape of its image, so the scale is chosen: the deepest press reads 60 % of the range, along
//! the description's force curve.
//! Lengths in metres in the sensor frame, images row-major in pascal.

use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::sensor::response::Indentation;
use palpate_core::sensor::spread_fit::{Indenter, indentation_image};
use palpate_core::units::MM;

/// The dissertation's indenter (section 2.1.1).
pub const INDENTER: Indenter = Indenter { diameter: 1.0 * MM };
/// Number of readings averaged for one press: 250 ms at 30 Hz.
const N_FRAMES: usize = 8;
/// Largest relative deviation of a gain from 1.
const GAIN_SPREAD: f64 = 0.2;
/// Largest offset, as a fraction of the range.
const OFFSET_MAX: f64 = 0.02;
/// Reading of the deepest press, as a fraction of the range.
const DEEPEST: f64 = 0.6;
/// Places of the fine grid along each side, and their spacing.
const N_PLACES: usize = 15;
const PLACE_STEP: f64 = 0.1 * MM;
/// Depths of the fine grid, as fractions of the covering.
const SPREAD_DEPTHS: [f64; 3] = [0.30, 0.50, 0.65];
/// Draws of a taxel for a fault. A sensor of three taxels or more has one among 64 draws.
const DRAWS_MAX: usize = 64;

/// One press of the fine grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridPress {
    /// Position in the sensor frame, (x, y).
    pub at: (f64, f64),
    /// Depth.
    pub depth: f64,
    /// The measured image.
    pub pressures: Vec<f64>,
}

/// The presses of a run, and the sensor's true properties.
#[derive(Clone, Debug, PartialEq)]
pub struct IndentationRun {
    /// Presses of every taxel at its centre, to five depths.
    pub response: Vec<Indentation>,
    /// 15 × 15 places around one taxel, at 30, 50 and 65 % of the covering.
    pub spread: Vec<GridPress>,
    /// Gain of every taxel.
    pub gains: Vec<f64>,
    /// The taxel that never responds; `None` for sensors of one taxel.
    pub dead: Option<usize>,
    /// A taxel that responds to presses on another one, and that other taxel; `None` for sensors of
    /// fewer than three taxels or of one column.
    pub cross_wired: Option<(usize, usize)>,
}

/// A run on a sensor whose images are those of its description.
#[must_use]
pub fn indentation_run(sensor: &SensorDescription, seed: u64) -> IndentationRun {
    let sigma = sensor.parameters().point_spread;
    indentation_run_of(sensor, seed, &|at| indentation_image(sensor.grid(), sigma, INDENTER, at))
}

/// A run on a sensor; `image` returns its image of a press at (x, y), at any scale.
#[must_use]
pub fn indentation_run_of(
    sensor: &SensorDescription,
    seed: u64,
    image: &dyn Fn((f64, f64)) -> Vec<f64>,
) -> IndentationRun {
    let bench = Bench::new(sensor, seed, image);
    let thickness = sensor.parameters().covering_thickness;
    // 0.2 to 0.6 mm as printed, less under a covering thinner than 1 mm.
    let step = 0.1 * thickness.min(1.0 * MM);
    let grid = sensor.grid();
    let mut stream = Stream::new(seed, Purpose::SensorNoise, 1);
    let mut response = Vec::new();
    for taxel in 0..grid.n_taxels() {
        let shape = image(grid.center(taxel / grid.cols, taxel % grid.cols));
        for steps in 2..=6 {
            let depth = f64::from(steps) * step;
            let measured = bench.measure(&shape, depth, &mut stream);
            let pressures = measured.into_iter().map(Some).collect();
            response.push(Indentation { taxel, depth, pressures });
        }
    }
    let (x, y) = grid.center(grid.rows / 2, grid.cols / 2);
    let middle = (N_PLACES as f64 - 1.0) / 2.0;
    let mut spread = Vec::new();
    for (u, v) in (0..N_PLACES).flat_map(|v| (0..N_PLACES).map(move |u| (u, v))) {
        let away = |index: usize| (index as f64 - middle) * PLACE_STEP;
        let at = (x + away(u), y + away(v));
        let shape = image(at);
        for depth in SPREAD_DEPTHS.map(|part| part * thickness) {
            let pressures = bench.measure(&shape, depth, &mut stream);
            spread.push(GridPress { at, depth, pressures });
        }
    }
    let Bench { gains, dead, cross_wired, .. } = bench;
    IndentationRun { response, spread, gains, dead, cross_wired }
}

/// A sensor with its faults.
struct Bench<'a> {
    sensor: &'a SensorDescription,
    gains: Vec<f64>,
    offsets: Vec<f64>,
    dead: Option<usize>,
    cross_wired: Option<(usize, usize)>,
    /// Displacement for a metre of depth and a unit of the image.
    displacement: f64,
}

impl<'a> Bench<'a> {
    fn new(
        sensor: &'a SensorDescription,
        seed: u64,
        image: &dyn Fn((f64, f64)) -> Vec<f64>,
    ) -> Self {
        let (grid, parameters) = (sensor.grid(), sensor.parameters());
        let mut stream = Stream::new(seed, Purpose::SensorNoise, 0);
        let n = grid.n_taxels();
        let gains = (0..n).map(|_| 1.0 + stream.uniform(-GAIN_SPREAD, GAIN_SPREAD)).collect();
        let offset_max = OFFSET_MAX * parameters.saturation;
        let offsets = (0..n).map(|_| stream.uniform(0.0, offset_max)).collect();
        let pressed = grid.rows / 2 * grid.cols + grid.cols / 2;
        // Neither fault is at the taxel on which the fine grid is centred.
        let mut faulty = |but: Option<usize>| {
            let mut drawn = (0..DRAWS_MAX).map(|_| stream.index(n));
            drawn.find(|taxel| *taxel != pressed && Some(*taxel) != but)
        };
        let dead = faulty(None);
        let beside = |taxel| if taxel % grid.cols == 0 { taxel + 1 } else { taxel - 1 };
        let wrong = faulty(dead).filter(|_| grid.cols > 1);
        let cross_wired = wrong.map(|wrong| (wrong, beside(wrong)));
        let own = image(grid.center(grid.rows / 2, grid.cols / 2))[pressed];
        let thickness = parameters.covering_thickness;
        let deepest = (0.6 * thickness.min(1.0 * MM)).max(0.65 * thickness);
        let reached = parameters.force_curve.displacement(DEEPEST * parameters.saturation);
        let displacement = reached / (own * deepest);
        Self { sensor, gains, offsets, dead, cross_wired, displacement }
    }

    /// The mean of several readings of a press.
    fn measure(&self, shape: &[f64], depth: f64, stream: &mut Stream) -> Vec<f64> {
        let parameters = self.sensor.parameters();
        let one = |taxel: usize| {
            let crossed = self.cross_wired.filter(|(wrong, _)| *wrong == taxel);
            let reads = crossed.map_or(taxel, |(_, beside)| beside);
            let gain = if Some(taxel) == self.dead { 0.0 } else { self.gains[taxel] };
            let pressed = parameters.force_curve.pressure(self.displacement * depth * shape[reads]);
            let ideal = gain * pressed + self.offsets[taxel];
            let mut sum = 0.0;
            for _ in 0..N_FRAMES {
                let noisy = ideal + parameters.noise * stream.normal();
                let clipped = noisy.clamp(0.0, parameters.saturation);
                let step = parameters.quantisation;
                sum += if step > 0.0 { (clipped / step).round() * step } else { clipped };
            }
            sum / N_FRAMES as f64
        };
        (0..shape.len()).map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::sensor::response::{ResponseForm, fit_response};
    use palpate_core::sensor::spread_fit::{SpreadPress, fit_spread};
    use palpate_core::sensor::{SensorParameters, TaxelGrid, TaxelState};

    use super::*;

    #[test]
    fn the_fits_recover_the_sensors_true_properties() {
        let sensor = SensorDescription::digitacts_6x6();
        let parameters = sensor.parameters();
        for seed in 1..=5 {
            let run = indentation_run(&sensor, seed);
            let fit = fit_response(
                &run.response,
                sensor.grid(),
                parameters.saturation,
                ResponseForm::Lines,
            )
            .unwrap();
            let calibration = &fit.calibration;
            for (taxel, response) in calibration.taxels().iter().enumerate() {
                let expected = match taxel {
                    taxel if Some(taxel) == run.dead => TaxelState::Dead,
                    taxel if run.cross_wired.is_some_and(|(wrong, _)| wrong == taxel) => {
                        TaxelState::CrossWired { answers: run.cross_wired.unwrap().1 }
                    }
                    _ => TaxelState::Ok,
                };
                assert_eq!(response.state, expected, "seed {seed}, taxel {taxel}");
                let usable = expected == TaxelState::Ok;
                assert!(!usable || response.r_squared > 0.95, "{}", response.r_squared);
            }
            assert!(fit.after.residual < 0.3 * fit.before.residual, "{fit:?}");
            let corrected = |press: &GridPress| {
                let mut pressures: Vec<Option<f64>> =
                    press.pressures.iter().copied().map(Some).collect();
                calibration.correct(&mut pressures);
                pressures.iter_mut().flatten().for_each(|p| *p = calibration.straightened(*p));
                SpreadPress { at: press.at, pressures }
            };
            let presses: Vec<SpreadPress> = run.spread.iter().map(corrected).collect();
            let spread = fit_spread(sensor.grid(), INDENTER, &presses).unwrap();
            let part = spread.sigma / parameters.point_spread;
            assert!((part - 1.0).abs() < 0.03 && spread.cosine > 0.99, "seed {seed}: {spread:?}");
        }
    }

    #[test]
    fn the_smallest_sensors_have_both_faults() {
        let parameters = SensorDescription::digitacts_6x6().parameters().clone();
        for (rows, cols) in [(2, 2), (2, 3), (3, 2)] {
            let grid = TaxelGrid { rows, cols, ..parameters.grid };
            let sensor = SensorParameters { grid, ..parameters.clone() };
            let run = indentation_run(&SensorDescription::new(sensor).unwrap(), 1);
            let (dead, wrong) = (run.dead.unwrap(), run.cross_wired.unwrap().0);
            assert_ne!(dead, wrong, "{rows}×{cols}");
        }
    }

    #[test]
    fn equal_seeds_give_equal_runs() {
        let sensor = SensorDescription::digitacts_6x8();
        assert_eq!(indentation_run(&sensor, 4), indentation_run(&sensor, 4));
        let run = indentation_run(&sensor, 4);
        assert_eq!((run.response.len(), run.spread.len()), (48 * 5, 225 * 3));
        assert_ne!(run, indentation_run(&sensor, 5));
    }
}
