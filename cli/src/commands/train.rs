//! `palpate train`: starts a training, shows its progress and its result.

mod appearance;

use std::io::{IsTerminal, Write};

use clap::Args;
use palpate_client::Client;
use palpate_client::schemas::{
    CatalogueVersion, Descriptor, GeometricKind, GeometricReport, GeometricTraining, Job, JobState,
    SensorKnowledge, StartTraining, SurfaceReport, TrainingReport, Warning, WarningCode,
};
use serde::Serialize;

use super::Context;
use crate::calibrated;
use crate::exit::Ended;
use crate::knowledge;
use crate::output::{self, Output};
use crate::progress::TrainingProgress;
use crate::symmetry;
use appearance::{AppearanceArgs, appearance_words};

/// Arguments of `palpate train`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  palpate train\n  \
    palpate train mug hammer --readings-per-object 500 --seed 3\n  \
    palpate train --descriptor polar_fourier\n  \
    palpate train A E I O U --geometric planar\n  \
    palpate train --appearance --appearance-classes 24,48,96\n  \
    palpate train cup --extend 3\n\n\
    Ctrl-C asks whether to cancel the training. Without a terminal it continues in the server.")]
pub(crate) struct TrainArgs {
    /// Ids or names of the objects [default: all with a mesh or readings].
    objects: Vec<String>,
    /// Catalogue to train.
    #[arg(long, default_value = "default")]
    catalogue: String,
    /// Simulated readings per object that has only a mesh [default: 1000].
    #[arg(long, value_parser = clap::value_parser!(u32).range(20..=20_000))]
    readings_per_object: Option<u32>,
    /// Simulated readings for the surface of such an object [default: 2400, or
    /// `--readings-per-object` if given].
    #[arg(long, value_parser = clap::value_parser!(u32).range(20..=20_000))]
    surface_readings: Option<u32>,
    /// The seed of all random choices [default: 1].
    #[arg(long)]
    seed: Option<u64>,
    /// Sensor that touches meshes in simulation [default: digitacts-6x6].
    #[arg(long)]
    sensor: Option<String>,
    /// Trust in that sensor's description [default: commissioned with a passport, else that of the
    /// version before, else that of the sensor].
    #[arg(long, value_enum, value_name = "LEVEL")]
    knowledge: Option<SensorKnowledge>,
    /// Number of appearance classes [default: 25].
    #[arg(long, value_parser = clap::value_parser!(u32).range(2..=255))]
    classes: Option<u32>,
    /// Descriptor that turns a press into a feature [default: mnti].
    #[arg(long, value_enum)]
    descriptor: Option<Descriptor>,
    /// Also learn contact maps for the methods `geometric…`: of a plane pressed from above, or of a
    /// solid.
    #[arg(long, value_enum)]
    geometric: Option<GeometricKind>,
    /// Cell size of the contact maps, 0.1 to 50 mm [default: suited to the kind].
    #[arg(long, requires = "geometric", value_parser = parse_cell_mm)]
    cell_mm: Option<f64>,
    /// Learn only what the method `surface` needs: a tenth of the memory, for large catalogues.
    #[arg(long, conflicts_with_all = ["geometric", "classes", "descriptor", "no_sva"])]
    only_surface: bool,
    #[command(flatten)]
    appearance: AppearanceArgs,
    /// Version to extend. Its vocabularies and objects stay as they are; only the named objects
    /// (default: those it lacks) are trained, with its options.
    #[arg(long, value_name = "VERSION", value_parser = clap::value_parser!(u32).range(1..),
        conflicts_with_all = ["knowledge", "classes", "descriptor", "geometric", "only_surface",
        "AppearanceArgs"])]
    extend: Option<u32>,
    /// Fail if an object cannot be trained, instead of skipping it.
    #[arg(long)]
    strict: bool,
    /// Print the job and exit without waiting.
    #[arg(long)]
    detach: bool,
}

fn parse_cell_mm(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(cell) if (0.1..=50.0).contains(&cell) => Ok(cell),
        _ => Err("expected 0.1 to 50 mm".to_owned()),
    }
}

/// The answer: the job, and the version it made.
#[derive(Debug, Serialize)]
struct Trained {
    job: Job,
    version: Option<CatalogueVersion>,
}

/// Runs the command.
pub(crate) async fn run(args: TrainArgs, context: &Context) -> anyhow::Result<()> {
    let geometric = args
        .geometric
        .map(|kind| GeometricTraining { kind, cell: args.cell_mm.map(|cell| cell / 1e3) });
    let training = StartTraining {
        objects: (!args.objects.is_empty()).then_some(args.objects),
        sensor: args.sensor,
        sensor_knowledge: args.knowledge,
        readings_per_object: args.readings_per_object,
        surface_readings_per_object: args.surface_readings,
        seed: args.seed,
        n_classes: args.classes,
        descriptor: args.descriptor,
        geometric,
        appearance: args.appearance.wire(),
        surface: args.only_surface.then_some(true),
        sva: (args.only_surface || args.appearance.no_sva).then_some(false),
        extend: args.extend,
        strict: args.strict.then_some(true),
        ..StartTraining::default()
    };
    let job = context.client.start_training(&args.catalogue, &training).await?;
    if args.detach {
        return context
            .output
            .answer(&job, |job| format!("training {} is {}", job.id, job.state.name()));
    }
    wait(&job, context).await
}

/// Waits for a job and prints its result.
pub(crate) async fn wait(job: &Job, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    let job = follow(client, job, output).await?;
    let version = match job.version {
        Some(version) => Some(client.catalogue_version(&job.catalogue, version).await?),
        None => None,
    };
    output.answer(&Trained { job: job.clone(), version }, trained_words)?;
    match job.state {
        JobState::Succeeded => Ok(()),
        JobState::Cancelled => Err(Ended::Interrupted.into()),
        _ => anyhow::bail!("the training failed: {}", job.reason.unwrap_or_default()),
    }
}

/// Follows a job to its end with a progress bar. Ctrl-C offers to cancel it.
pub(crate) async fn follow(client: &Client, job: &Job, output: Output) -> anyhow::Result<Job> {
    let shown = std::cell::RefCell::new(TrainingProgress::new(output));
    shown.borrow_mut().show(job);
    let mut ended = std::pin::pin!(client.follow_job(job.id, |job| shown.borrow_mut().show(job)));
    let outcome = loop {
        tokio::select! {
            outcome = &mut ended => break outcome,
            interrupted = tokio::signal::ctrl_c() => {
                interrupted?;
                shown.borrow().pause();
                if wants_to_cancel(job).await? {
                    shown.borrow().resume();
                    client.cancel_job(job.id).await?;
                } else {
                    shown.borrow().clear();
                    output.say(format!("the training goes on: `palpate jobs follow {}`", job.id));
                    return Err(Ended::Interrupted.into());
                }
            }
        }
    };
    shown.borrow().clear();
    Ok(outcome?)
}

/// Asks on a terminal whether to cancel. A second Ctrl-C means no.
async fn wants_to_cancel(job: &Job) -> anyhow::Result<bool> {
    if !std::io::stdin().is_terminal() || !std::io::stderr().is_terminal() {
        return Ok(false);
    }
    eprint!("\nCancel training {}? Otherwise it goes on in the server. [y/N] ", job.id);
    std::io::stderr().flush()?;
    let answer = tokio::task::spawn_blocking(|| {
        let mut answer = String::new();
        std::io::stdin().read_line(&mut answer).map(|_| answer)
    });
    tokio::select! {
        answer = answer => Ok(matches!(answer??.trim(), "y" | "Y" | "yes")),
        interrupted = tokio::signal::ctrl_c() => {
            eprintln!();
            Ok(interrupted.map(|()| false)?)
        }
    }
}

/// Outcome of a training that made no version.
fn state_words(job: &Job) -> String {
    match job.state {
        JobState::Queued | JobState::Running => {
            format!("training {} is {}", job.id, job.state.name())
        }
        JobState::Succeeded | JobState::Failed => {
            format!("training {} {}", job.id, job.state.name())
        }
        JobState::Cancelled => format!("training {} was cancelled", job.id),
    }
}

fn trained_words(trained: &Trained) -> String {
    let Some(version) = &trained.version else {
        return state_words(&trained.job);
    };
    let report = &version.report;
    let objects = output::table(
        ["object", "readings", "patches", "index", "surface", "symmetry", "cells"],
        report.objects.iter().map(|object| {
            [
                object.name.clone(),
                object.n_readings.to_string(),
                object.n_patches.to_string(),
                format!("{:.1} MB", object.index_bytes as f64 / 1e6),
                object.surface.as_ref().map_or("–".to_owned(), surface),
                symmetry::trained_words(object),
                object.geometric.as_ref().map_or("–".to_owned(), cells),
            ]
        }),
    );
    format!(
        "{objects}\n\ntrained version {} of {} in {:.1} s: {} objects, {} classes, {:.1} MB{}{}{}",
        version.version,
        version.catalogue,
        report.seconds,
        report.objects.len(),
        report.n_classes,
        (report.index_bytes + report.surface_bytes) as f64 / 1e6,
        if version.is_current { ", current" } else { "" },
        report.appearance.as_ref().map_or(String::new(), appearance_words),
        knowledge_words(report) + &calibration_words(report),
    ) + &warning_words(report)
}

/// Skipped objects and probable mistakes, a line each.
fn warning_words(report: &TrainingReport) -> String {
    let skipped = report.skipped.iter().map(|left_out| format!("\nskipped: {}", left_out.reason));
    let of_whole = report.warnings.iter().filter(|w| w.code != WarningCode::ObjectsSkipped);
    let of_whole = of_whole.map(|warning| format!("\nwarning: {}", warning.detail));
    let of_objects = report.objects.iter().flat_map(|object| {
        let words = |warning: &Warning| format!("\nwarning: {}: {}", object.name, warning.detail);
        object.warnings.iter().map(words)
    });
    skipped.chain(of_whole).chain(of_objects).collect()
}

/// Text on how meshes were pressed; empty if the report does not state it.
fn knowledge_words(report: &TrainingReport) -> String {
    report.sensor_knowledge.map_or(String::new(), |level| {
        format!("\nsensor knowledge {}: {}", level.name(), knowledge::meaning(level))
    })
}

/// Text on the data of the calibration; empty if the report does not state it.
fn calibration_words(report: &TrainingReport) -> String {
    match (report.calibrated, report.uncalibrated_reason) {
        (Some(true), _) => format!(
            "\nprobabilities calibrated on other readings of {} objects",
            report.calibrated_on
        ),
        (_, Some(reason)) => format!("\n{}", calibrated::note(reason)),
        _ => String::new(),
    }
}

fn surface(surface: &SurfaceReport) -> String {
    format!("{} touches, {:.1} MB", surface.n_patches, surface.bytes as f64 / 1e6)
}

fn cells(geometry: &GeometricReport) -> String {
    let [x, y, z] = geometry.n_cells;
    format!("{x} × {y} × {z} of {}", output::mm(geometry.cell))
}
