//! `palpate sessions export`: a session with its readings and what was believed after each.

use std::io::Write as _;
use std::path::PathBuf;

use anyhow::Context as _;
use clap::{Args, ValueEnum};
use palpate_client::Client;
use palpate_client::schemas::{Replay, Session, SessionChange, SessionReading};
use serde::Serialize;

use super::history;
use crate::ids::SessionName;
use crate::verdict::Verdict;

/// Arguments of `palpate sessions export`.
#[derive(Debug, Args)]
pub(super) struct ExportArgs {
    /// Id of the session, or its last digits.
    session: SessionName,
    /// JSON has everything; CSV has a line for each revision, without images.
    #[arg(long, value_enum, default_value = "json")]
    format: Format,
    /// File to write [default: standard output].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    Json,
    Csv,
}

/// A whole session, as the API shows its parts.
#[derive(Debug, Serialize)]
struct Exported {
    session: Session,
    readings: Vec<SessionReading>,
    replay: Replay,
}

/// Columns of the CSV, which the dashboard's are as well; metres, pascals, bits.
const COLUMNS: [&str; 18] = [
    "revision",
    "at",
    "change",
    "reading",
    "robot",
    "seq",
    "x_m",
    "y_m",
    "z_m",
    "qx",
    "qy",
    "qz",
    "qw",
    "peak_pa",
    "n_readings",
    "answer",
    "probability",
    "entropy_bits",
];

/// Writes a session.
pub(super) async fn export(client: &Client, args: ExportArgs) -> anyhow::Result<()> {
    let session = client.session(args.session.id(client).await?).await?;
    let readings = history::readings(client, session.id).await?.items;
    // Readings that came meanwhile are left out of both.
    let readings: Vec<_> =
        readings.into_iter().filter(|reading| reading.number < session.revision).collect();
    let replay = history::replay(client, session.id, Some(session.revision), 0).await?;
    let exported = Exported { session, readings, replay };
    let text = match args.format {
        Format::Json => serde_json::to_string(&exported)?,
        Format::Csv => csv(&exported)?,
    };
    match &args.out {
        Some(path) => {
            std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
        }
        None => Ok(writeln!(std::io::stdout().lock(), "{}", text.trim_end())?),
    }
}

fn csv(exported: &Exported) -> anyhow::Result<String> {
    let mut rows = csv::Writer::from_writer(Vec::new());
    rows.write_record(COLUMNS)?;
    for step in &exported.replay.steps {
        let (change, number) = match &step.change {
            SessionChange::Reading { number, .. } => ("reading", Some(*number)),
            SessionChange::Retraction { number } => ("retraction", Some(*number)),
            SessionChange::Closed => ("closed", None),
        };
        let reading = exported.readings.iter().find(|it| Some(it.number) == number);
        let answer = Verdict::of_best(step.best.as_ref(), step.unknown);
        let (name, probability) = (answer.name(), answer.probability);
        let mut cells = vec![step.revision.to_string(), step.at.clone(), change.to_owned()];
        cells.push(number.map(|number| number.to_string()).unwrap_or_default());
        cells.push(reading.and_then(|it| it.robot.clone()).unwrap_or_default());
        cells.push(reading.and_then(|it| it.seq).map(|seq| seq.to_string()).unwrap_or_default());
        cells.extend(pose(reading));
        cells.push(reading.and_then(peak).map(|peak| peak.to_string()).unwrap_or_default());
        cells.push(step.n_readings.to_string());
        cells.extend([name.to_owned(), probability.to_string(), step.entropy_bits.to_string()]);
        rows.write_record(cells.iter().map(|cell| plain(cell)))?;
    }
    Ok(String::from_utf8(rows.into_inner()?)?)
}

/// Position and quaternion of a reading, as it was sent.
fn pose(reading: Option<&SessionReading>) -> [String; 7] {
    let Some(pose) = reading.and_then(|reading| reading.pose.as_ref()) else {
        return Default::default();
    };
    let [x, y, z] = pose.position;
    let [qx, qy, qz, qw] = pose.orientation;
    [x, y, z, qx, qy, qz, qw].map(|value| value.to_string())
}

fn peak(reading: &SessionReading) -> Option<f64> {
    reading.image.iter().copied().flatten().max_by(f64::total_cmp)
}

/// A cell that a spreadsheet does not take for a formula.
fn plain(cell: &str) -> String {
    let is_formula = cell.starts_with(['=', '+', '@', '\t', '\r'])
        || (cell.starts_with('-') && cell.parse::<f64>().is_err());
    if is_formula { format!("'{cell}") } else { cell.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::plain;

    #[test]
    fn cells_are_never_formulas() {
        assert_eq!(["arm-3", "-0.25"].map(plain), ["arm-3", "-0.25"]);
        assert_eq!(["=1+1", "-cmd", "@x"].map(plain), ["'=1+1", "'-cmd", "'@x"]);
    }
}
