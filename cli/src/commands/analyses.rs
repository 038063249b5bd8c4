//! `palpate analyses`: computations about sensors. Nothing is stored.

use clap::{Args, Subcommand};
use palpate_client::schemas::{AnalyseCoverings, CoveringAnalysis};
use palpate_core::units::MM;

use super::Context;
use crate::output;

/// Arguments of `palpate analyses`.
#[derive(Debug, Args)]
pub(crate) struct AnalysesArgs {
    #[command(subcommand)]
    analysis: Analysis,
}

#[derive(Debug, Subcommand)]
enum Analysis {
    /// Compare coverings: spatial resolution and depth range.
    #[command(after_help = "Examples:\n  palpate analyses covering\n  \
        palpate analyses covering --element-width-mm 2 --thickness-mm 1,2.5,5 --force-resolution 0.01")]
    Covering {
        /// Width of a sensing element (the sensor's pitch).
        #[arg(long, default_value_t = 2.0, value_name = "MM")]
        element_width_mm: f64,
        /// Thicknesses of the coverings, separated by commas [default: the dissertation's four].
        #[arg(long, value_delimiter = ',', value_name = "MM", conflicts_with = "spread_mm")]
        thickness_mm: Vec<f64>,
        /// Point spreads (standard deviations) instead of thicknesses.
        #[arg(long, value_delimiter = ',', value_name = "MM")]
        spread_mm: Vec<f64>,
        /// Force resolutions, as fractions of the impulse.
        #[arg(long, value_delimiter = ',', value_name = "PART", default_value = "0.005,0.05,0.2")]
        force_resolution: Vec<f64>,
    },
}

/// Runs the command.
pub(crate) async fn run(args: AnalysesArgs, context: &Context) -> anyhow::Result<()> {
    let Analysis::Covering { element_width_mm, thickness_mm, spread_mm, force_resolution } =
        args.analysis;
    let metres = |values: Vec<f64>| {
        let metres: Vec<f64> = values.into_iter().map(|value| value * MM).collect();
        (!metres.is_empty()).then_some(metres)
    };
    let question = AnalyseCoverings {
        element_width: element_width_mm * MM,
        thicknesses: metres(thickness_mm),
        spreads: metres(spread_mm),
        force_resolutions: Some(force_resolution),
    };
    let analysis = context.client.analyse_coverings(&question).await?;
    context.output.answer(&analysis, text)
}

fn text(analysis: &CoveringAnalysis) -> String {
    let mut rows = Vec::new();
    for covering in &analysis.coverings {
        for acuity in &covering.acuity {
            let mm = |length: Option<f64>| {
                length.map_or_else(|| "-".to_owned(), |length| format!("{:.2} mm", length / MM))
            };
            rows.push([
                mm(covering.thickness),
                mm(Some(covering.spread)),
                if covering.avoids_aliasing { "no" } else { "yes" }.to_owned(),
                format!("{}", acuity.force_resolution),
                acuity.representations.to_string(),
                mm(acuity.two_point_distance),
            ]);
        }
    }
    let header = ["covering", "spread", "aliases", "force step", "of 51 places", "two points from"];
    format!("{}\n\n{}", output::table(header, rows), analysis.reason)
}
