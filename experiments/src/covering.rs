//! Chapter 2: figures 2.2, 2.3, 2.5, 2.6, 2.8 and 2.9, and table 2.1.
//!
//! There is no physical sensor here. Two simulations replace the dissertation's measurements:
//! "simulator" is an indentation run of the imaging model itself (it shows that the fits recover
//! its parameters), "elastic" one of the finite-element reference, which has no Gaussian in it.
//! The H is compared with the finite-element reference.

mod acuity;
mod elastic;
mod h_indenter;
mod point_spread;
mod resolutions;
mod responses;

use clap::Args;
use palpate_core::units::INCH;
use palpate_sim::plot::svg;
use serde::Serialize;

use crate::arguments::count;
use crate::report::{Outcome, Progress, Report};

/// The coverings of sections 2.3 and 2.5, metres.
const COVERINGS: [f64; 4] = [0.04 * INCH, 0.10 * INCH, 0.14 * INCH, 0.20 * INCH];

/// Arguments of `covering`.
#[derive(Args, Clone, Debug, Serialize)]
pub struct Covering {
    /// Seed of gains and noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Elements from the centre to each side of the finite-element slabs.
    #[arg(long, default_value_t = 50, value_parser = count)]
    pub half_width: usize,
}

/// Runs all parts.
///
/// # Errors
/// When a finite-element slab cannot be solved or a fit fails.
pub fn run(config: &Covering, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let mut report = Report::default();
    let (slabs, mut panels) = elastic::figure_2_3(config.half_width, &mut report, progress)?;
    progress("indenting coverings", 6, 9);
    panels.push(point_spread::figure_2_5(config.seed, &slabs, &mut report)?);
    progress("counting representations", 7, 9);
    let acuity = acuity::figure_2_6(&mut report);
    progress("pressing the H", 8, 9);
    let h_indenter = h_indenter::table_2_1(&slabs, &mut report)?;
    let pictures = [
        ("covering-acuity.svg", acuity),
        ("covering-responses.svg", responses::figure_2_2(config.seed)?),
        ("covering-h-indenter.svg", h_indenter),
        ("covering-resolutions.svg", resolutions::figure_2_9()?),
    ];
    let pictures = pictures.map(|(name, drawn)| (name.to_owned(), drawn.into_bytes())).to_vec();
    Ok(Outcome { report, plot: svg(&panels), pictures })
}

/// A covering's thickness as the dissertation writes it, for keys: 0_04in.
fn key_of(thickness: f64) -> String {
    format!("{:.2}in", thickness / INCH).replace('.', "_")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_run_has_every_figure() {
        let config = Covering { seed: 1, half_width: 24 };
        let outcome = run(&config, &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        // The fit recovers equation 2.5 from images that were made with it.
        assert!((summary["simulator_spread_slope"] - 0.497).abs() < 0.03, "{summary:?}");
        assert!((summary["simulator_spread_offset"] - 1.11).abs() < 0.06, "{summary:?}");
        assert!(summary["elastic_gaussian_cosine_min"] > 0.99, "{summary:?}");
        assert!((0.2..0.5).contains(&summary["representations_ridge"]), "{summary:?}");
        assert!(summary["h_cosine_min"] > 0.8, "{summary:?}");
        assert_eq!(key_of(COVERINGS[0]), "0_04in");
        assert!(outcome.plot.matches("<polyline").count() > 10);
    }
}
