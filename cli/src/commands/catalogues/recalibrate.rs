//! `palpate catalogues recalibrate`: what closed sessions say about a calibration, before and after.

use clap::Args;
use palpate_client::schemas::{
    CatalogueVersion, Job, JobState, RecalibrateCatalogue, RecalibrationReport, RecalibrationSide,
    RecalibrationStops,
};
use serde::Serialize;

use crate::commands::{Context, train};
use crate::exit::Ended;
use crate::ids::{SessionName, ids};
use crate::output;

/// Arguments of `palpate catalogues recalibrate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  palpate catalogues recalibrate default\n  \
    palpate catalogues recalibrate default --sensor finger --keep-current\n\n\
    At least 20 closed sessions must have a known truth: close them with the object, \
    `palpate sessions close SESSION --object mug`.\n\
    `palpate catalogues use default VERSION` undoes it.")]
pub(crate) struct RecalibrateArgs {
    /// Name of the catalogue.
    catalogue: String,
    /// Version to recalibrate [default: the current one].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    version: Option<u32>,
    /// Only sessions of this sensor, by its id or name.
    #[arg(long)]
    sensor: Option<String>,
    /// Only these sessions, 20 to 300 [default: the newest 300 whose truth is known].
    #[arg(long = "session", value_name = "SESSION")]
    sessions: Vec<SessionName>,
    /// Do not make the new version current, even if it is better.
    #[arg(long)]
    keep_current: bool,
    /// Print the job and exit without waiting.
    #[arg(long)]
    detach: bool,
}

/// The answer: the job, and the version it made.
#[derive(Debug, Serialize)]
struct Recalibrated {
    job: Job,
    version: Option<CatalogueVersion>,
}

/// Runs the command.
pub(super) async fn run(args: RecalibrateArgs, context: &Context) -> anyhow::Result<()> {
    let sessions = ids(&args.sessions, &context.client).await?;
    let request = RecalibrateCatalogue {
        version: args.version,
        sessions: (!sessions.is_empty()).then_some(sessions),
        sensor: args.sensor,
        activate: args.keep_current.then_some(false),
    };
    let job = context.client.recalibrate(&args.catalogue, &request).await?;
    if args.detach {
        return context
            .output
            .answer(&job, |job| format!("recalibration {} is {}", job.id, job.state.name()));
    }
    wait(&job, context).await
}

/// Waits for a job and prints its result.
pub(crate) async fn wait(job: &Job, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    let job = train::follow(client, job, output).await?;
    let version = match job.version {
        Some(version) => Some(client.catalogue_version(&job.catalogue, version).await?),
        None => None,
    };
    output.answer(&Recalibrated { job: job.clone(), version }, words)?;
    match job.state {
        JobState::Succeeded => Ok(()),
        JobState::Cancelled => Err(Ended::Interrupted.into()),
        _ => anyhow::bail!("the recalibration failed: {}", job.reason.unwrap_or_default()),
    }
}

fn words(recalibrated: &Recalibrated) -> String {
    let version = recalibrated.version.as_ref();
    let report = version.and_then(|version| version.report.recalibration.as_ref());
    let (Some(version), Some(report)) = (version, report) else {
        let Job { id, state, .. } = &recalibrated.job;
        return format!("recalibration {id} is {}", state.name());
    };
    let left_out = match report.n_left_out {
        0 => String::new(),
        n => format!(", {n} left out"),
    };
    format!(
        "{}\n\nversion {} of {}: recalibrated from version {} by {} sessions, {} of them of {} \
         known objects{left_out}, in {:.1} s\n{}",
        table(report),
        version.version,
        version.catalogue,
        report.from_version,
        report.n_sessions,
        report.n_known,
        report.n_objects,
        report.seconds,
        verdict(version, report)
    )
}

/// Whether it is better, which version is current, and how to change that.
fn verdict(version: &CatalogueVersion, report: &RecalibrationReport) -> String {
    let (name, new, old) = (&version.catalogue, version.version, report.from_version);
    let gain = format!("lower by {:.3} ± {:.3}", report.gain, report.gain_error);
    match (report.is_better, version.is_current) {
        (true, true) => format!(
            "better: log loss {gain} on sessions it does not know. Version {new} is current; undo \
             with `palpate catalogues use {name} {old}`"
        ),
        (true, false) => format!(
            "better: log loss {gain} on sessions it does not know. It is not current; use it with \
             `palpate catalogues use {name} {new}`"
        ),
        (false, _) => format!(
            "no better: log loss {gain} on sessions it does not know. Version {old} was not replaced"
        ),
    }
}

fn table(report: &RecalibrationReport) -> String {
    let row = |name: &str, figure: &dyn Fn(&RecalibrationSide) -> String| {
        [name.to_owned(), figure(&report.before), figure(&report.after)]
    };
    let mut rows = vec![
        row("known objects named", &|side| format!("{:.1} %", 100.0 * side.accuracy)),
        row("\"none of these\" of known objects", &|side| format!("{:.3}", side.unknown_of_known)),
        row("\"none of these\" of unknown objects", &|side| {
            format!("{:.3}", side.unknown_of_unknown)
        }),
        row("log loss", &|side| format!("{:.3}", side.log_loss)),
        row("calibration error", &|side| format!("{:.3}", side.calibration_error)),
    ];
    for (at, stops) in report.before.stops.iter().enumerate() {
        let risk = stops.risk;
        let of = |side: &RecalibrationSide| side.stops.get(at).copied();
        rows.push(row(&format!("wrong stops at a risk of {risk}"), &|side| wrong(of(side))));
        rows.push(row("touches until these", &|side| touches(of(side))));
    }
    rows.push(row("width of the sensor", &|side| format!("{:.1}", side.sensor_width)));
    output::table(["", "before", "after"], rows)
}

fn wrong(stops: Option<RecalibrationStops>) -> String {
    stops.map_or("–".to_owned(), |stops| format!("{} of {}", stops.n_wrong, stops.n_stopped))
}

fn touches(stops: Option<RecalibrationStops>) -> String {
    let touches = stops.and_then(|stops| stops.touches);
    touches.map_or("–".to_owned(), |touches| format!("{touches:.1}"))
}

#[cfg(test)]
mod tests {
    use palpate_client::schemas::RecalibrationStage;

    use super::*;

    fn side(accuracy: f64, sensor_width: f64) -> RecalibrationSide {
        let stage = RecalibrationStage { temperature: 1.0, unknown: 0.0, unknown_per_touch: 0.0 };
        let stops = |risk| RecalibrationStops {
            risk,
            n_trials: 48,
            n_stopped: 40,
            n_wrong: 3,
            touches: Some(4.25),
        };
        RecalibrationSide {
            sensor_width,
            stop_excess: 0.2,
            stages: vec![stage; 3],
            accuracy,
            unknown_of_known: 0.25,
            unknown_of_unknown: 0.9,
            log_loss: 0.5,
            calibration_error: 0.1,
            stops: vec![stops(0.05), stops(0.01)],
        }
    }

    #[test]
    fn before_and_after_stand_side_by_side() {
        let report = RecalibrationReport {
            from_version: 1,
            n_sessions: 24,
            n_known: 24,
            n_objects: 2,
            n_left_out: 0,
            is_better: true,
            gain: 0.4,
            gain_error: 0.1,
            before: side(0.75, 1.0),
            after: side(1.0, 2.0),
            seconds: 1.5,
        };
        let table = table(&report);
        let row = |name: &str| {
            let line = table.lines().find(|line| line.contains(name)).unwrap();
            let words: Vec<&str> = line.split_whitespace().collect();
            words[words.len() - 4..].join(" ")
        };
        assert_eq!(row("known objects named"), "75.0 % 100.0 %");
        assert!(row("width of the sensor").ends_with("1.0 2.0"), "{table}");
        assert!(table.contains("wrong stops at a risk of 0.05") && table.contains("3 of 40"));
    }
}
