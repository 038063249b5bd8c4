//! Estimation of the unit of pressures.

use crate::reading::TactileImage;
use crate::sensor::SensorDescription;
use crate::units::Shown;

/// A unit that drivers send in place of pascal.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Unit {
    name: &'static str,
    /// Pascals per unit.
    pascals: f64,
}

/// Number of taxels below which an array is too small to show a shape. Chosen: for 4 × 4
/// taxels the probability of [`SHAPE_DEVIATIONS`] is that of larger arrays within a factor of
/// two.
const SHAPE_TAXELS_MIN: usize = 16;
/// Deviations of white noise's correlation of neighbours beyond which an image has a shape.
/// Derived: noise exceeds it once in a thousand images.
const SHAPE_DEVIATIONS: f64 = 3.0;
/// On small arrays, the share of the noise below which no image of noise stays. Derived: a
/// taxel does with a probability of 0.08, so four taxels together once in 25,000 images.
const NOISE_SHARE: f64 = 0.1;
/// Ratio of the noise to the sensor's range if no noise is stated. Derived: the largest
/// pressure in kPa is at most that.
const RANGE_SHARE: f64 = 1e-3;

/// The units in which `max`, the largest value of a press, lies between the sensor's
/// threshold and its saturation, the likeliest first: the one that brings it nearest to the
/// middle of that range on a logarithmic scale.
fn units(max: f64, sensor: &SensorDescription) -> Vec<Unit> {
    let (floor, saturation) = (sensor.contact_floor(), sensor.parameters().saturation);
    let area = sensor.grid().taxel_width * sensor.grid().taxel_width;
    let mut units = vec![
        Unit { name: "kPa", pascals: 1e3 },
        Unit { name: "N for each taxel", pascals: 1.0 / area },
        Unit { name: "bar", pascals: 1e5 },
        Unit { name: "MPa", pascals: 1e6 },
    ];
    units.retain(|unit| (floor..=saturation).contains(&(max * unit.pascals)));
    let middle = (floor.max(f64::MIN_POSITIVE) * saturation).sqrt();
    let off = |unit: &Unit| (max * unit.pascals / middle).ln().abs();
    units.sort_by(|a, b| off(a).total_cmp(&off(b)));
    units
}

/// The probable units of values with maximum `max`, in words.
#[must_use]
pub fn meant(max: f64, sensor: &SensorDescription) -> String {
    let units = units(max, sensor);
    let Some((likely, others)) = units.split_first() else {
        return "are the values in another unit than pascal?".to_owned();
    };
    let or = |unit: &Unit| format!("; or in {}, by {}", unit.name, Shown(unit.pascals));
    let others: String = others.iter().map(or).collect();
    let pascals = Shown(likely.pascals);
    format!("the values are probably in {}: multiply them by {pascals}{others}", likely.name)
}

/// Whether an image without contact is not an image of the sensor's noise either: it is
/// smaller than one deviation everywhere, and neighbours are similar as under a press. (On
/// small arrays: much smaller.)
pub(super) fn is_structured(image: &TactileImage, sensor: &SensorDescription) -> bool {
    let parameters = sensor.parameters();
    let noise =
        parameters.noise.max(parameters.quantisation).max(RANGE_SHARE * parameters.saturation);
    let size = image.pressures.iter().fold(0.0_f64, |size, pressure| size.max(pressure.abs()));
    if image.pressures.len() < SHAPE_TAXELS_MIN {
        return size < NOISE_SHARE * noise;
    }
    size < noise && correlation_of_neighbours(image).is_some_and(|found| found > SHAPE_DEVIATIONS)
}

/// Moran's statistic of neighbours along rows and columns: deviations of the correlation
/// above that of white noise. `None` for a constant image.
fn correlation_of_neighbours(image: &TactileImage) -> Option<f64> {
    let (rows, cols) = (image.rows, image.cols);
    let n = (rows * cols) as f64;
    let mean = image.pressures.iter().sum::<f64>() / n;
    let variance = image.pressures.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / n;
    if variance <= 0.0 {
        return None;
    }
    let (mut sum, mut pairs) = (0.0, 0.0);
    for row in 0..rows {
        for col in 0..cols {
            let here = image.at(row, col) - mean;
            if col + 1 < cols {
                sum += here * (image.at(row, col + 1) - mean);
                pairs += 1.0;
            }
            if row + 1 < rows {
                sum += here * (image.at(row + 1, col) - mean);
                pairs += 1.0;
            }
        }
    }
    // White noise has the mean −1/(n − 1) and, with symmetric neighbours, the variance 1/pairs.
    let correlation = sum / pairs / variance;
    Some((correlation + 1.0 / (n - 1.0)) * f64::sqrt(pairs))
}
