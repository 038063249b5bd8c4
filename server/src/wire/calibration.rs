//! Conversion of sensor calibrations: indentations and fits.

use palpate_core::reading::{ReadingError, checked};
use palpate_core::sensor::line::{Goodness, Line};
use palpate_core::sensor::point_spread::point_spread_of_covering;
use palpate_core::sensor::response::{Indentation, ResponseError, ResponseForm, fit_response};
use palpate_core::sensor::response_curve::ResponseCurve;
use palpate_core::sensor::spread_fit::{Indenter, SpreadError, SpreadPress, fit_spread};
use palpate_core::sensor::{Calibration, SensorDescription, TaxelState};
use palpate_core::units::MM;
use palpate_schemas as wire;
use palpate_store::calibration::{StoredCalibration, StoredLines, StoredSpread};
use palpate_store::entity::Sensor;

use crate::wire::reading::TAXELS_MAX;
use crate::wire::{Invalid, count, outside, range, time};

/// Maximum number of presses at taxels' centres.
const RESPONSE_PRESSES_MAX: usize = 100_000;
/// Maximum number of presses of the fine grid.
const SPREAD_PRESSES_MAX: usize = 20_000;
/// Maximum depth, thickness and position.
const LENGTH_MAX: f64 = 50.0 * MM;
/// Minimum diameter of an indenter.
const LENGTH_MIN: f64 = 0.01 * MM;
/// Smallest depth of a press of the spread. Chosen: its square is far from where numbers end.
const DEPTH_MIN: f64 = 1e-9;

/// The lines that fit a request, still without a number.
pub(crate) fn fitted(
    request: &wire::CalibrateSensor,
    sensor: &Sensor,
    created_at_ms: u64,
) -> Result<StoredLines, Invalid> {
    let description = &sensor.description;
    if description.listed().is_some() {
        let detail = "the sensor is a list of taxels, expected one with rows and columns: correct \
                      its values in the driver";
        return Err(Invalid::field("/response", detail));
    }
    let n_spread = request.spread.as_ref().map_or(0, |spread| spread.presses.len());
    n_presses("/response", request.response.len(), RESPONSE_PRESSES_MAX)?;
    let n_taxels = (request.response.len() + n_spread) * description.grid().n_taxels();
    if n_taxels > TAXELS_MAX {
        let detail = format!("{n_taxels} taxels came, expected at most {TAXELS_MAX}");
        return Err(Invalid::field("/response", detail));
    }
    let presses = indentations(&request.response, description)?;
    let saturation = description.parameters().saturation;
    let form = match request.form.unwrap_or_default() {
        wire::ResponseForm::Lines => ResponseForm::Lines,
        wire::ResponseForm::Curves => ResponseForm::Curves,
    };
    let fit =
        fit_response(&presses, description.grid(), saturation, form).map_err(refuse_response)?;
    let spread = match &request.spread {
        Some(spread) => Some(fitted_spread(spread, description, &fit.calibration)?),
        None => None,
    };
    Ok(StoredLines {
        since: 0,
        calibration: fit.calibration,
        before: fit.before,
        after: fit.after,
        n_presses: count(presses.len()),
        spread,
        created_at_ms,
    })
}

fn indentations(
    given: &[wire::ResponsePress],
    description: &SensorDescription,
) -> Result<Vec<Indentation>, Invalid> {
    let grid = description.grid();
    let one = |(index, press): (usize, &wire::ResponsePress)| {
        let at = format!("/response/{index}");
        let below = |n: usize| n as u64 - 1;
        super::within(&format!("{at}/row"), u64::from(press.row), 0, below(grid.rows))?;
        super::within(&format!("{at}/col"), u64::from(press.col), 0, below(grid.cols))?;
        let taxel = press.row as usize * grid.cols + press.col as usize;
        let depth = length(&format!("{at}/depth"), press.depth, 0.0)?;
        let pressures = image(&at, &press.pressures, description)?;
        Ok(Indentation { taxel, depth, pressures })
    };
    given.iter().enumerate().map(one).collect()
}

fn fitted_spread(
    given: &wire::SpreadPresses,
    description: &SensorDescription,
    calibration: &Calibration,
) -> Result<StoredSpread, Invalid> {
    n_presses("/spread/presses", given.presses.len(), SPREAD_PRESSES_MAX)?;
    let diameter = length("/spread/indenter_diameter", given.indenter_diameter, LENGTH_MIN)?;
    let thickness = |thickness| length("/spread/covering_thickness", thickness, LENGTH_MIN);
    let covering_thickness = given.covering_thickness.map(thickness).transpose()?;
    let one = |(index, press): (usize, &wire::SpreadPress)| {
        let at = format!("/spread/presses/{index}");
        length(&format!("{at}/depth"), press.depth, DEPTH_MIN)?;
        let x = length(&format!("{at}/x"), press.x, -LENGTH_MAX)?;
        let y = length(&format!("{at}/y"), press.y, -LENGTH_MAX)?;
        let mut pressures = image(&at, &press.pressures, description)?;
        calibration.correct(&mut pressures);
        // The pressure at rest is not part of the shape, and neither is what is not straight.
        pressures.iter_mut().flatten().for_each(|p| *p = calibration.straightened(*p));
        Ok(SpreadPress { at: (x, y), pressures })
    };
    let presses: Result<Vec<SpreadPress>, Invalid> =
        given.presses.iter().enumerate().map(one).collect();
    let presses = presses?;
    let fit = fit_spread(description.grid(), Indenter { diameter }, &presses).map_err(|error| {
        let at = match error {
            SpreadError::Shape { press, .. } | SpreadError::Silent { press } => {
                format!("/spread/presses/{press}/pressures")
            }
            SpreadError::Empty | SpreadError::AtEnd { .. } => "/spread/presses".to_owned(),
        };
        Invalid::field(at, error)
    })?;
    let n_presses = count(presses.len());
    Ok(StoredSpread { fit, n_presses, indenter_diameter: diameter, covering_thickness })
}

fn n_presses(pointer: &str, found: usize, max: usize) -> Result<(), Invalid> {
    if (1..=max).contains(&found) {
        return Ok(());
    }
    Err(Invalid::field(pointer, format!("{found} presses came, expected 1 to {max}")))
}

/// Checks a length in metres.
fn length(pointer: &str, found: f64, low: f64) -> Result<f64, Invalid> {
    if found.is_finite() && (low..=LENGTH_MAX).contains(&found) {
        return Ok(found);
    }
    let expected = format!("metres from {}", range(low, LENGTH_MAX));
    Err(outside(pointer, found, [low, LENGTH_MAX], &expected))
}

fn image(
    pointer: &str,
    given: &[Option<f64>],
    description: &SensorDescription,
) -> Result<Vec<Option<f64>>, Invalid> {
    checked(description, given).map_err(|error| {
        let at = match error {
            ReadingError::Pressure { taxel, .. } => format!("{pointer}/pressures/{taxel}"),
            _ => format!("{pointer}/pressures"),
        };
        Invalid::field(at, error)
    })
}

fn refuse_response(error: ResponseError) -> Invalid {
    let at = match error {
        ResponseError::Taxel { press, .. } => format!("/response/{press}/row"),
        ResponseError::Depth { press, .. } => format!("/response/{press}/depth"),
        ResponseError::Shape { press, .. } => format!("/response/{press}/pressures"),
        ResponseError::Depths { .. }
        | ResponseError::Curve { .. }
        | ResponseError::Saturated { .. }
        | ResponseError::Negative { .. }
        | ResponseError::Silent { .. }
        | ResponseError::Fit(_) => "/response".to_owned(),
    };
    Invalid::field(at, error)
}

/// A stored calibration in its wire form; `None` if it has no taxel lines.
pub(crate) fn calibration(
    stored: &StoredCalibration,
    description: &SensorDescription,
) -> Option<wire::SensorCalibration> {
    let lines = stored.lines.as_ref()?;
    let cols = description.grid().cols;
    let curves = lines.calibration.curves();
    let place =
        |taxel: usize| wire::TaxelPlace { row: count(taxel / cols), col: count(taxel % cols) };
    let taxels = lines.calibration.taxels().iter().enumerate().map(|(taxel, response)| {
        let (state, answers) = match response.state {
            TaxelState::Ok => (wire::TaxelState::Ok, None),
            TaxelState::Dead => (wire::TaxelState::Dead, None),
            TaxelState::CrossWired { answers } => {
                (wire::TaxelState::CrossWired, Some(place(answers)))
            }
        };
        let wire::TaxelPlace { row, col } = place(taxel);
        let Line { slope, offset } = response.line;
        let r_squared = response.r_squared;
        let curve = curves.and_then(|curves| curves.taxels[taxel].as_ref()).map(knots);
        wire::TaxelCalibration { row, col, slope, offset, r_squared, curve, state, answers }
    });
    let taxels: Vec<wire::TaxelCalibration> = taxels.collect();
    let Line { slope, offset } = lines.calibration.target();
    let n_unusable = taxels.iter().filter(|taxel| taxel.state != wire::TaxelState::Ok).count();
    let described = &description.parameters().force_curve;
    let force_curve = curves.and_then(|curves| curves.target.force_curve(described));
    Some(wire::SensorCalibration {
        sensor: stored.sensor,
        number: stored.number,
        passport: stored.passport.as_ref().map(|passport| passport.since),
        form: match curves {
            Some(_) => wire::ResponseForm::Curves,
            None => wire::ResponseForm::Lines,
        },
        target: wire::ResponseLine { slope, offset },
        curve: curves.map(|curves| knots(&curves.target)),
        force_curve: force_curve.as_ref().map(super::sensor::force_curve),
        before: goodness(lines.before),
        after: goodness(lines.after),
        n_presses: lines.n_presses,
        taxels,
        n_unusable: count(n_unusable),
        spread: lines.spread.as_ref().map(|spread| self::spread(spread, description)),
        created_at: time(lines.created_at_ms),
    })
}

fn knots(curve: &ResponseCurve) -> Vec<wire::ResponseKnot> {
    let knot = |&(depth, pressure): &(f64, f64)| wire::ResponseKnot { depth, pressure };
    curve.knots().iter().map(knot).collect()
}

fn goodness(Goodness { r_squared, residual }: Goodness) -> wire::ResponseGoodness {
    wire::ResponseGoodness { r_squared, residual }
}

fn spread(stored: &StoredSpread, description: &SensorDescription) -> wire::SpreadCalibration {
    let parameters = description.parameters();
    let thickness = stored.covering_thickness.unwrap_or(parameters.covering_thickness);
    wire::SpreadCalibration {
        sigma: stored.fit.sigma,
        sigma_in_widths: stored.fit.sigma_in_widths,
        described: parameters.point_spread,
        published: point_spread_of_covering(thickness),
        cosine: stored.fit.cosine,
        pearson: stored.fit.pearson,
        n_presses: stored.n_presses,
    }
}
