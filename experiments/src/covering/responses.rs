//! Figure 2.2: responses of the elements against depth, before and after the calibration.

use palpate_core::sensor::point_spread::point_spread_of_covering;
use palpate_core::sensor::response::{Indentation, ResponseForm, fit_response};
use palpate_core::sensor::{Calibration, SensorDescription};
use palpate_core::units::{KPA, MM};
use palpate_sim::indent::indentation_run;
use palpate_sim::plot::{Line, Panel, svg};

use super::COVERINGS;
use super::point_spread::sensor_under;

/// The figure, of a simulated run under the thinnest covering.
pub(super) fn figure_2_2(seed: u64) -> anyhow::Result<String> {
    let sensor = sensor_under(COVERINGS[0], point_spread_of_covering(COVERINGS[0]));
    let presses = indentation_run(&sensor, seed).response;
    let saturation = sensor.parameters().saturation;
    let calibration =
        fit_response(&presses, sensor.grid(), saturation, ResponseForm::Lines)?.calibration;
    let as_measured = |_: usize, pressure: f64| pressure;
    let corrected = |taxel: usize, pressure: f64| calibration.corrected(taxel, pressure);
    Ok(svg(&[
        panel("2.2 (a): as measured", &sensor, &presses, &calibration, &as_measured),
        panel("2.2 (b): calibrated", &sensor, &presses, &calibration, &corrected),
    ]))
}

/// One dotted line for each usable element, and the common line of the fit.
fn panel(
    title: &str,
    sensor: &SensorDescription,
    presses: &[Indentation],
    calibration: &Calibration,
    value: &dyn Fn(usize, f64) -> f64,
) -> Panel {
    let of_taxel = |taxel: usize| {
        let own = presses.iter().filter(|press| press.taxel == taxel);
        let point = |press: &Indentation| {
            let pressure = press.pressures[taxel].unwrap_or(f64::NAN);
            (press.depth / MM, value(taxel, pressure) / KPA)
        };
        Line { name: String::new(), points: own.map(point).collect() }
    };
    let usable = (0..sensor.n_taxels()).filter(|taxel| calibration.is_usable(*taxel));
    let mut lines: Vec<Line> = usable.map(of_taxel).collect();
    let depths: Vec<f64> = presses.iter().map(|press| press.depth).collect();
    let ends = [f64::min as fn(f64, f64) -> f64, f64::max].map(|choose| {
        let depth = depths.iter().copied().reduce(choose).unwrap_or(f64::NAN);
        (depth / MM, calibration.target().at(depth) / KPA)
    });
    lines.push(Line { name: "fitted line".to_owned(), points: ends.to_vec() });
    let (x, y) = ("depth (mm)".to_owned(), "response (kPa)".to_owned());
    Panel { title: title.to_owned(), x, y, lines }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_usable_element_has_a_line_in_both_panels() {
        // The array has 6 × 8 elements: one is dead, one is cross-wired.
        let drawn = figure_2_2(1).unwrap();
        assert_eq!(drawn.matches("stroke-dasharray").count(), 2 * 46);
        assert_eq!(drawn.matches("fitted line").count(), 2);
    }
}
