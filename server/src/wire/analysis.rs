//! Conversion of analyses: requests about coverings, and their trade-offs.

use palpate_core::sensor::covering::{
    ALIASING_SPREAD, Acuity, force_resolutions, recommended, thickness_of_spread,
};
use palpate_core::sensor::point_spread::{ELEMENT_WIDTH, point_spread_of_covering};
use palpate_core::units::{INCH, MM};
use palpate_schemas as wire;

use crate::wire::{Invalid, count, outside, range};

/// Maximum number of coverings, and of force resolutions, in one request.
const ITEMS_MAX: usize = 50;
/// Bounds of element widths, thicknesses and spreads.
const LENGTHS: (f64, f64) = (0.01 * MM, 50.0 * MM);
/// Bounds of force resolutions.
const RESOLUTIONS: (f64, f64) = (1e-6, 1.0);

/// The coverings of the dissertation.
const THICKNESSES: [f64; 4] = [0.04 * INCH, 0.10 * INCH, 0.14 * INCH, 0.20 * INCH];

/// A checked request: the coverings as (thickness, spread) in metres.
pub(crate) struct Question {
    element_width: f64,
    coverings: Vec<(Option<f64>, f64)>,
    force_resolutions: Vec<f64>,
}

/// Checks a request.
pub(crate) fn question(request: &wire::AnalyseCoverings) -> Result<Question, Invalid> {
    let element_width = number("/element_width", request.element_width, LENGTHS)?;
    let of_thickness = |thickness: &f64| (Some(*thickness), point_spread_of_covering(*thickness));
    let coverings = match (&request.thicknesses, &request.spreads) {
        (Some(_), Some(_)) => {
            let detail = "expected either thicknesses or spreads";
            return Err(Invalid::field("/spreads", detail));
        }
        (Some(thicknesses), None) => {
            numbers("/thicknesses", thicknesses, LENGTHS)?;
            thicknesses.iter().map(of_thickness).collect()
        }
        (None, Some(spreads)) => {
            numbers("/spreads", spreads, LENGTHS)?;
            let thickness = |spread: f64| {
                thickness_of_spread(spread / ELEMENT_WIDTH).map(|widths| widths * ELEMENT_WIDTH)
            };
            spreads.iter().map(|spread| (thickness(*spread), *spread)).collect()
        }
        (None, None) => THICKNESSES.iter().map(of_thickness).collect(),
    };
    let resolutions = request.force_resolutions.clone().unwrap_or_else(force_resolutions);
    numbers("/force_resolutions", &resolutions, RESOLUTIONS)?;
    Ok(Question { element_width, coverings, force_resolutions: resolutions })
}

/// The trade-offs of a request's coverings.
pub(crate) fn analysis(question: &Question) -> wire::CoveringAnalysis {
    let width = question.element_width;
    let trade_off = |&(thickness, spread): &(Option<f64>, f64)| {
        let acuity = Acuity::of_spread(spread / width);
        let at = |f: &f64| wire::SpatialAcuity {
            force_resolution: *f,
            representations: count(acuity.representations(*f)),
            two_point_distance: acuity.two_point_distance(*f).map(|widths| widths * width),
        };
        wire::CoveringTradeOff {
            thickness,
            spread,
            spread_in_widths: spread / width,
            depth_range: thickness,
            avoids_aliasing: spread / width >= ALIASING_SPREAD,
            acuity: question.force_resolutions.iter().map(at).collect(),
        }
    };
    let in_widths: Vec<f64> = question.coverings.iter().map(|(_, s)| s / width).collect();
    let recommended = recommended(&in_widths);
    let bound = ALIASING_SPREAD * width;
    let reason = match recommended {
        Some(best) => format!(
            "a point spread of {:.2} mm is the sharpest of these that is at least {:.2} mm \
             ({ALIASING_SPREAD:.3} element widths), below which the elements alias; a thicker \
             covering feels deeper and blurs more",
            question.coverings[best].1 / MM,
            bound / MM
        ),
        None => format!(
            "all of these alias: the point spread is below {:.2} mm ({ALIASING_SPREAD:.3} element \
             widths); take a thicker covering or smaller elements",
            bound / MM
        ),
    };
    wire::CoveringAnalysis {
        element_width: width,
        aliasing_spread: bound,
        coverings: question.coverings.iter().map(trade_off).collect(),
        recommended: recommended.map(count),
        reason,
    }
}

fn number(pointer: &str, found: f64, (low, high): (f64, f64)) -> Result<f64, Invalid> {
    if found.is_finite() && (low..=high).contains(&found) {
        return Ok(found);
    }
    let expected = format!("{} (SI units)", range(low, high));
    Err(outside(pointer, found, [low, high], &expected))
}

fn numbers(pointer: &str, found: &[f64], bounds: (f64, f64)) -> Result<(), Invalid> {
    if !(1..=ITEMS_MAX).contains(&found.len()) {
        let detail = format!("{} values came, expected 1 to {ITEMS_MAX}", found.len());
        return Err(Invalid::field(pointer, detail));
    }
    for (index, value) in found.iter().enumerate() {
        number(&format!("{pointer}/{index}"), *value, bounds)?;
    }
    Ok(())
}
