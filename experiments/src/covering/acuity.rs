//! Figure 2.6: spatial acuity over the point spread and the force resolution.

use palpate_core::sensor::covering::{Acuity, force_resolutions, spreads};
use palpate_sim::plot::{Heat, heat_svg};
use serde::Serialize;

use crate::report::Report;
use crate::statistics::median;

/// Number of positions that are counted (section 2.4.1.1).
const N_PLACES: usize = 51;

#[derive(Serialize)]
struct AcuityRow {
    force_resolution: f64,
    sigma: f64,
    representations: usize,
    two_point_distance: Option<f64>,
}

/// Counts and distances on the 25 × 25 grid, drawn as two heat maps.
pub(super) fn figure_2_6(report: &mut Report) -> String {
    let (sigmas, resolutions) = (spreads(), force_resolutions());
    let acuities: Vec<Acuity> = sigmas.iter().map(|sigma| Acuity::of_spread(*sigma)).collect();
    let mut counts = Vec::new();
    let mut distances = Vec::new();
    for f in &resolutions {
        for (sigma, acuity) in sigmas.iter().zip(&acuities) {
            let (count, distance) = (acuity.representations(*f), acuity.two_point_distance(*f));
            report.labelled(
                &[("figure", "2.6")],
                AcuityRow {
                    force_resolution: *f,
                    sigma: *sigma,
                    representations: count,
                    two_point_distance: distance,
                },
            );
            counts.push((count as f64).log10());
            distances.push(distance.map_or(f64::NAN, f64::log10));
        }
    }
    let places_ridge = ridge(&sigmas, &counts, f64::max);
    let pairs_ridge = ridge(&sigmas, &distances, f64::min);
    // Where the finest resolution distinguishes all 51 places, there is a plateau and no ridge.
    let full = (N_PLACES as f64).log10();
    let rows = counts.chunks_exact(sigmas.len());
    let is_full: Vec<bool> =
        rows.map(|row| row.iter().any(|count| *count >= full - 1e-9)).collect();
    let open: Vec<f64> =
        places_ridge.iter().zip(&is_full).filter(|(_, full)| !**full).map(|(r, _)| *r).collect();
    report.summarise("representations_ridge", median(&open));
    report.summarise("representations_ridge_rows", open.len() as f64);
    report.summarise("two_point_ridge", median(&pairs_ridge));
    let best = distances.iter().copied().filter(|d| d.is_finite()).fold(f64::MAX, f64::min);
    report.summarise("two_point_distance_min", 10f64.powf(best));
    let heat = |title: &str, values, ridge| Heat {
        title: title.to_owned(),
        x: "σ (element widths, log)".to_owned(),
        y: "force resolution (log)".to_owned(),
        xs: sigmas.clone(),
        ys: resolutions.clone(),
        values,
        ridge,
    };
    heat_svg(&[
        heat("2.6a: log₁₀ of distinct representations", counts, places_ridge),
        heat("2.6b: log₁₀ of two-point distance (element widths)", distances, pairs_ridge),
    ])
}

/// The spread of the best value in each row; of several equal values, the geometric mean of the
/// first and the last spread.
fn ridge(sigmas: &[f64], values: &[f64], better: fn(f64, f64) -> f64) -> Vec<f64> {
    let one = |row: &[f64]| {
        // `max` and `min` skip NaN, which stands for a missing value.
        let best = row.iter().copied().fold(f64::NAN, better);
        let same: Vec<usize> =
            (0..row.len()).filter(|index| (row[*index] - best).abs() < 1e-9).collect();
        match (same.first(), same.last()) {
            (Some(first), Some(last)) => (sigmas[*first] * sigmas[*last]).sqrt(),
            _ => f64::NAN,
        }
    };
    values.chunks_exact(sigmas.len()).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ridge_is_in_the_middle_of_what_is_equally_good() {
        let values = [1.0, 3.0, 3.0, 3.0, f64::NAN, 2.0, 2.0, 1.0, 5.0, 4.0];
        let sigmas = [1.0, 2.0, 4.0, 8.0, 16.0];
        let highest = ridge(&sigmas, &values, f64::max);
        assert!((highest[0] - 4.0).abs() < 1e-12 && (highest[1] - 8.0).abs() < 1e-12);
        let lowest = ridge(&sigmas, &values, f64::min);
        assert!((lowest[0] - 1.0).abs() < 1e-12 && (lowest[1] - 4.0).abs() < 1e-12);
    }
}
