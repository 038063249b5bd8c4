//! `palpate report`: a version's appearance report, as tables and as a picture.

mod picture;

use std::path::PathBuf;

use anyhow::Context as _;
use clap::Args;
use palpate_client::schemas::AppearanceReport;

use super::Context;
use crate::output;

/// Largest matrix that is printed; larger ones appear only in the picture.
const MATRIX_MAX: usize = 12;

/// Arguments of `palpate report`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  palpate report --svg report.svg\n\n\
    The version must have been trained with `palpate train --appearance`.")]
pub(crate) struct ReportArgs {
    /// Name of the catalogue.
    #[arg(long, default_value = "default")]
    catalogue: String,
    /// Version of the catalogue [default: the current one].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    version: Option<u32>,
    /// Also write both matrices as a picture (SVG).
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

/// Runs the command.
pub(crate) async fn run(args: ReportArgs, context: &Context) -> anyhow::Result<()> {
    let client = &context.client;
    let version = match args.version {
        Some(version) => version,
        None => client.current_version(&args.catalogue).await?.version,
    };
    let report = client.appearance_report(&args.catalogue, version).await?;
    if let Some(path) = &args.svg {
        std::fs::write(path, picture::svg(&report))
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    context.output.answer(&report, words)
}

fn words(report: &AppearanceReport) -> String {
    let percent = |share: f64| format!("{:.1} %", share * 100.0);
    let names: Vec<&str> = report.objects.iter().map(|object| object.name.as_str()).collect();
    let rows = report.objects.iter().enumerate().map(|(row, object)| {
        let confused = largest_other(&report.confusion[row], row);
        let alike = largest_other(&report.affinity[row], row);
        [
            object.name.clone(),
            object.n_readings.to_string(),
            object.n_held_back.to_string(),
            percent(report.confusion[row][row]),
            confused.map_or("–".to_owned(), |(o, p)| format!("{} {}", names[o], percent(p))),
            alike.map_or("–".to_owned(), |(o, a)| format!("{} {a:.2}", names[o])),
        ]
    });
    let header = ["object", "readings", "held back", "itself", "taken for", "most alike"];
    let mut parts = vec![output::table(header, rows)];
    if names.len() <= MATRIX_MAX {
        let confusion = matrix(&names, &report.confusion);
        parts.push(format!(
            "probability of each object (column) when the row's is touched\n{confusion}"
        ));
        let affinity = matrix(&names, &report.affinity);
        parts.push(format!("similarity of the objects\n{affinity}"));
    }
    parts.push(format!(
        "version {} of {}: {} classes of {} values; after {} held-back readings {} right, \
         likelihoods to the power {:.2}",
        report.version,
        report.catalogue,
        report.n_classes,
        report.n_components,
        report.n_readings,
        percent(report.accuracy),
        report.exponent
    ));
    parts.extend(report.warnings.iter().map(|warning| format!("warning: {warning}")));
    parts.join("\n\n")
}

/// The largest off-diagonal entry of a row and its column; `None` if none is above 0.
fn largest_other(row: &[f64], own: usize) -> Option<(usize, f64)> {
    let others =
        row.iter().copied().enumerate().filter(|(place, value)| *place != own && *value > 0.0);
    others.max_by(|a, b| a.1.total_cmp(&b.1))
}

fn matrix(names: &[&str], rows: &[Vec<f64>]) -> String {
    let longest = names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
    let line = |(name, row): (&&str, &Vec<f64>)| {
        let cells: String = row.iter().map(|value| format!("{value:6.2}")).collect();
        format!("{name:<longest$}{cells}")
    };
    names.iter().zip(rows).map(line).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_diagonal_is_not_another_object() {
        assert_eq!(largest_other(&[0.9, 0.04, 0.06], 0), Some((2, 0.06)));
        assert_eq!(largest_other(&[0.2, 0.7, 0.1], 1), Some((0, 0.2)));
        assert_eq!(largest_other(&[1.0, 0.0], 0), None);
    }

    #[test]
    fn a_matrix_has_its_columns_below_each_other() {
        let shown = matrix(&["mug", "hammer"], &[vec![1.0, 0.0], vec![0.25, 0.75]]);
        assert_eq!(shown, "mug     1.00  0.00\nhammer  0.25  0.75");
    }
}
