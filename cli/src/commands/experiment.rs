//! `palpate experiment`: reruns the tables and figures that `docs/results.md` states.
//!
//! Each writes JSON, CSV, SVG and pictures to a folder, and its line into `docs/results.md`
//! when it is run where that file is.

mod appearance;
mod exploration;
mod robustness;
mod surface;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context as _;
use clap::{Args, Subcommand, ValueEnum};
use palpate_client::{Client, ClientOptions};
use palpate_core::units::MM;
use palpate_experiments::contact_rates::{self, ContactRates};
use palpate_experiments::covering::{self, Covering};
use palpate_experiments::letters_geometric::{self, LetterMaps, LettersGeometric, letters_named};
use palpate_experiments::report::{Outcome, Progress};
use palpate_experiments::restart::{self, Restart};
use palpate_experiments::server_throughput::{self, ServerThroughput};
use palpate_experiments::sva_objects::{self, SvaObjects};
use palpate_experiments::symmetry::{self, SymmetryTrials};
use palpate_server::{Config, Server};
use palpate_sim::rig::RigNoise;

use crate::output::{Output, table};
use crate::progress::StepProgress;
use appearance::AppearanceExperiment;
use exploration::ExplorationExperiment;
use robustness::RobustnessExperiment;
use surface::SurfaceExperiment;

/// The page that states every figure.
const RESULTS: &str = "docs/results.md";

/// Arguments of `palpate experiment`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  palpate experiment sva-objects --trials 50 --seed 1\n  \
    palpate experiment sva-objects --meshes meshes --size-mm 80 --out results/mine")]
pub(crate) struct ExperimentArgs {
    #[command(subcommand)]
    experiment: Experiment,
    /// The folder for what it writes.
    #[arg(long, global = true, default_value = "results", value_name = "DIR")]
    out: PathBuf,
    /// The seed of everything random.
    #[arg(long, global = true, default_value_t = 1)]
    seed: u64,
    /// Do not put its line into docs/results.md.
    #[arg(long, global = true)]
    no_record: bool,
}

#[derive(Debug, Subcommand)]
enum Experiment {
    /// Section 5.5.1: accuracy and errors of pose against readings, literal and default.
    SvaObjects {
        /// A folder of meshes; the built-in objects when not given.
        #[arg(long, value_name = "DIR")]
        meshes: Option<PathBuf>,
        /// Largest dimension to which every object is scaled.
        #[arg(long, default_value_t = 80.0, value_parser = millimetres)]
        size_mm: f64,
        /// Trials an object.
        #[arg(long, default_value_t = 10, value_parser = count)]
        trials: usize,
        /// Add the printed filter on features and patches as printed: plain inner products,
        /// the mask before the turn, all classes, patches at the sensor's centroid.
        #[arg(long)]
        as_printed: bool,
    },
    /// Section 3.4: raised letters by geometry, histogram and particle filters.
    LettersGeometric {
        /// AEIOU, capitals, all, or any letters.
        #[arg(long, default_value = "AEIOU", value_parser = letters_named)]
        letters: String,
        /// How many seeds, from --seed on; each is a sensor, its noise and its trials.
        #[arg(long, default_value_t = 10, value_parser = count)]
        seeds: usize,
        /// Trials a letter and seed.
        #[arg(long, default_value_t = 10, value_parser = count)]
        trials: usize,
        /// How far presses are from ideal.
        #[arg(long, value_enum, default_value_t = LetterNoise::Physical)]
        noise: LetterNoise,
        /// Which form of equations 3.3 to 3.5 makes the maps.
        #[arg(long, value_enum, default_value_t = MapForm::Corrected)]
        maps: MapForm,
        /// A TrueType or OpenType font; Quicksand Bold when not given.
        #[arg(long, value_name = "PATH")]
        font: Option<PathBuf>,
        /// Only the method of this name, or those whose names begin so; may be repeated.
        #[arg(long = "method", value_name = "NAME")]
        methods: Vec<String>,
    },
    /// Presses and converged readings per second on one core.
    ContactRates {
        /// A folder of meshes; the built-in objects when not given.
        #[arg(long, value_name = "DIR")]
        meshes: Option<PathBuf>,
        /// Touches an object.
        #[arg(long, default_value_t = 300, value_parser = count)]
        touches: usize,
    },
    /// Chapter 2: elastic reference, point spread, choice of a covering, H indenter.
    Covering,
    /// Symmetries by touches alone and by the mesh: ten solids, also with a handle or a notch.
    Symmetry {
        /// A folder of meshes; the twenty solids when not given.
        #[arg(long, value_name = "DIR")]
        meshes: Option<PathBuf>,
    },
    #[command(flatten)]
    Appearance(AppearanceExperiment),
    #[command(flatten)]
    Surface(SurfaceExperiment),
    #[command(flatten)]
    Robustness(RobustnessExperiment),
    #[command(flatten)]
    Exploration(ExplorationExperiment),
    /// Readings per second through a whole server, at 1, 8 and 64 sessions.
    ServerThroughput {
        /// Readings that are posted in each setting.
        #[arg(long, default_value_t = 1280, value_parser = count)]
        readings: usize,
    },
    /// How long a restart takes until all open sessions' beliefs are answered again.
    Restart {
        /// Open sessions.
        #[arg(long, default_value_t = 1000, value_parser = count)]
        sessions: usize,
        /// Readings of each, up to 1000.
        #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=1000))]
        readings: u32,
    },
}

/// The argument that names a folder of meshes.
fn meshes_of(meshes: &Option<PathBuf>) -> String {
    meshes.as_ref().map(|folder| format!(" --meshes {}", folder.display())).unwrap_or_default()
}

/// The noise of the letter rig.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum LetterNoise {
    /// As of a real rig and array.
    Physical,
    /// Worse in everything, with values that are stuck.
    Harsh,
    /// Of other families than the default method assumes: places that wander, slips, bent
    /// responses, rows that leak into each other.
    Unmatched,
}

impl LetterNoise {
    fn of_rig(self) -> RigNoise {
        match self {
            Self::Physical => RigNoise::physical(),
            Self::Harsh => RigNoise::harsh(),
            Self::Unmatched => RigNoise::unmatched(),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Physical => "physical",
            Self::Harsh => "harsh",
            Self::Unmatched => "unmatched",
        }
    }
}

/// Which form of equations 3.3 to 3.5 makes the maps of letters.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum MapForm {
    /// As the service makes them.
    Corrected,
    /// The same with the exponent of equation 3.4 as printed.
    PrintedSpread,
    /// All of equations 3.3 to 3.5 as printed.
    AsPrinted,
}

impl MapForm {
    fn of_letters(self) -> LetterMaps {
        match self {
            Self::Corrected => LetterMaps::Corrected,
            Self::PrintedSpread => LetterMaps::PrintedSpread,
            Self::AsPrinted => LetterMaps::AsPrinted,
        }
    }

    /// The argument that gives it again; none for the default.
    fn argument(self) -> &'static str {
        match self {
            Self::Corrected => "",
            Self::PrintedSpread => " --maps printed-spread",
            Self::AsPrinted => " --maps as-printed",
        }
    }
}

fn millimetres(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(size) if (5.0..=2_000.0).contains(&size) => Ok(size),
        _ => Err("expected millimetres from 5 to 2000".to_owned()),
    }
}

fn count(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(n) if (1..=1_000_000).contains(&n) => Ok(n),
        _ => Err("expected a number from 1 to 1000000".to_owned()),
    }
}

/// Runs an experiment and shows its summary.
pub(crate) async fn run(args: ExperimentArgs, output: Output) -> anyhow::Result<()> {
    let ExperimentArgs { experiment, out, seed, no_record } = args;
    let command = command_line(&experiment, seed);
    output.say(format!("running {command}"));
    let progress = Arc::new(StepProgress::new());
    let shown = progress.clone();
    let show = move |stage: &str, done, total| shown.show(stage, done, total);
    let outcome = match experiment {
        Experiment::SvaObjects { meshes, size_mm, trials, as_printed } => {
            let (size, default) = (size_mm * MM, SvaObjects::default());
            let config = SvaObjects { meshes, size, seed, trials, as_printed, ..default };
            on_a_thread(move || sva_objects::run(&config, command, &show)).await?
        }
        Experiment::LettersGeometric { letters, seeds, trials, noise, maps, font, methods } => {
            let (noise, geometry) = (noise.of_rig(), maps.of_letters().geometry());
            let config = LettersGeometric {
                letters,
                seed,
                seeds,
                trials,
                noise,
                font,
                geometry,
                methods,
                ..LettersGeometric::default()
            };
            on_a_thread(move || letters_geometric::run(&config, command, &show)).await?
        }
        Experiment::ContactRates { meshes, touches } => {
            let config = ContactRates { meshes, seed, touches };
            on_a_thread(move || contact_rates::run(&config, command, &show)).await?
        }
        Experiment::Covering => {
            let config = Covering { seed, ..Covering::default() };
            on_a_thread(move || covering::run(&config, command, &show)).await?
        }
        Experiment::Symmetry { meshes } => {
            let config = SymmetryTrials { meshes, seed, ..SymmetryTrials::default() };
            on_a_thread(move || symmetry::run(&config, command, &show)).await?
        }
        Experiment::Appearance(experiment) => {
            on_a_thread(move || experiment.run(seed, command, &show)).await?
        }
        Experiment::Surface(experiment) => {
            on_a_thread(move || experiment.run(seed, command, &show)).await?
        }
        Experiment::Robustness(experiment) => {
            on_a_thread(move || experiment.run(seed, command, &show)).await?
        }
        Experiment::Exploration(experiment) => {
            on_a_thread(move || experiment.run(seed, command, &show)).await?
        }
        Experiment::ServerThroughput { readings } => {
            let config = ServerThroughput { seed, readings, ..ServerThroughput::default() };
            with_a_server(&config, command, &show).await?
        }
        Experiment::Restart { sessions, readings } => {
            let config = Restart { seed, sessions, readings: readings as usize };
            over_a_restart(&config, command, &show).await?
        }
    };
    progress.clear();
    let written = outcome.write(&out)?;
    let record = Path::new(RESULTS);
    if !no_record && record.exists() {
        outcome.report.record(record)?;
    }
    output.answer(&outcome.report, |report| {
        let rows = report.summary.iter().map(|(key, value)| [key.clone(), format!("{value:.4}")]);
        format!("{}\n\nwritten to {}", table(["figure", "value"], rows), written.display())
    })
}

/// The command line that gives the same figures again.
fn command_line(experiment: &Experiment, seed: u64) -> String {
    let rest = match experiment {
        Experiment::SvaObjects { meshes, size_mm, trials, as_printed } => {
            let printed = if *as_printed { " --as-printed" } else { "" };
            let meshes = meshes_of(meshes);
            format!("sva-objects{meshes} --size-mm {size_mm} --trials {trials}{printed}")
        }
        Experiment::LettersGeometric { letters, seeds, trials, noise, maps, font, methods } => {
            let font = font.as_ref().map(|font| format!(" --font {}", font.display()));
            let methods = methods.iter().map(|name| format!(" --method {name}"));
            format!(
                "letters-geometric --letters {letters} --seeds {seeds} --trials {trials} \
                 --noise {}{}{}{}",
                noise.name(),
                maps.argument(),
                font.unwrap_or_default(),
                methods.collect::<String>()
            )
        }
        Experiment::ContactRates { meshes, touches } => {
            format!("contact-rates{} --touches {touches}", meshes_of(meshes))
        }
        Experiment::Covering => "covering".to_owned(),
        Experiment::Symmetry { meshes } => format!("symmetry{}", meshes_of(meshes)),
        Experiment::Appearance(experiment) => experiment.line(),
        Experiment::Surface(experiment) => experiment.line(),
        Experiment::Robustness(experiment) => experiment.line(),
        Experiment::Exploration(experiment) => experiment.line(),
        Experiment::ServerThroughput { readings } => {
            format!("server-throughput --readings {readings}")
        }
        Experiment::Restart { sessions, readings } => {
            format!("restart --sessions {sessions} --readings {readings}")
        }
    };
    format!("palpate experiment {rest} --seed {seed}")
}

async fn on_a_thread(
    work: impl FnOnce() -> anyhow::Result<Outcome> + Send + 'static,
) -> anyhow::Result<Outcome> {
    let interrupted = tokio::signal::ctrl_c();
    tokio::select! {
        outcome = tokio::task::spawn_blocking(work) => outcome.context("the experiment broke off")?,
        _ = interrupted => Err(crate::exit::Ended::Interrupted.into()),
    }
}

/// Measures a server of its own, on a temporary folder and a free port.
async fn with_a_server(
    config: &ServerThroughput,
    command: String,
    progress: Progress<'_>,
) -> anyhow::Result<Outcome> {
    let folder = tempfile::Builder::new().prefix("palpate-throughput-").tempdir()?;
    let (server, client) = serve(folder.path()).await?;
    let outcome = tokio::select! {
        outcome = server_throughput::run(config, &client, command, progress) => outcome,
        _ = tokio::signal::ctrl_c() => Err(crate::exit::Ended::Interrupted.into()),
    };
    server.shutdown().await;
    outcome
}

/// Fills a server of its own, starts it anew and asks for what it knew.
async fn over_a_restart(
    config: &Restart,
    command: String,
    progress: Progress<'_>,
) -> anyhow::Result<Outcome> {
    let folder = tempfile::Builder::new().prefix("palpate-restart-").tempdir()?;
    let (server, client) = serve(folder.path()).await?;
    let filled = tokio::select! {
        filled = restart::fill(config, &client, progress) => filled,
        _ = tokio::signal::ctrl_c() => Err(crate::exit::Ended::Interrupted.into()),
    };
    server.shutdown().await;
    let filled = filled?;
    let begun = Instant::now();
    let (server, client) = serve(folder.path()).await?;
    let start_seconds = begun.elapsed().as_secs_f64();
    let outcome = restart::ask(config, filled, start_seconds, &client, command).await;
    server.shutdown().await;
    outcome
}

/// A server on a folder and a free port, and a client of it.
async fn serve(folder: &Path) -> anyhow::Result<(Server, Client)> {
    let any_port = std::net::SocketAddr::from(([127, 0, 0, 1], 0));
    let server =
        Server::start(Config { listen: any_port, ..Config::new(folder.join("data")) }).await?;
    let address = format!("http://{}", server.local_addr());
    Ok((server, Client::with_options(&address, ClientOptions::default())?))
}
