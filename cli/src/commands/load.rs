//! `palpate load`: many simulated robots against a running server, to measure its capacity and its
//! behaviour under overload.

mod words;

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context as _;
use clap::Args;
use palpate_client::schemas::{BeliefDetail, Method};
use palpate_client::{Client, Error as ClientError, RetryPolicy};
use palpate_load::{
    self as load, Arrivals, Bounds, LoadConfig, LoadReport, MemorySource, Mix, Soak, StepReport,
    Touches,
};
use serde::Serialize;

use super::Context;
use crate::exit::Ended;
use crate::method::among;
use crate::output::Output;
use crate::progress::StepProgress;
use words::{HEADER, row, verdict_words};

/// Arguments of `palpate load`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  palpate load --prepare --rate 100 --duration-s 30\n  \
    palpate load --prepare --steps 100,200,400,800 --min-share 0.8 --picture load.svg\n  \
    palpate load --catalogue default --mix readings=8,beliefs=2 --poisson --polite\n  \
    palpate load --steps 200,400,800 --soak 10 --overload 1.5 --pid $(pidof palpate) \
    --max-growth-mb 50\n\n\
    Exits with 6 if one of the bounds --max-p99-ms, --min-share, --max-growth-mb is exceeded. \
    docs/load.md explains the output.")]
pub(crate) struct LoadArgs {
    /// First add the example objects as load-… and train the catalogue, unless it has them.
    #[arg(long)]
    prepare: bool,
    /// Catalogue to recognise with. The server must have the meshes of its objects.
    #[arg(long, default_value = "load")]
    catalogue: String,
    /// Requests due per second.
    #[arg(long, default_value_t = 50.0, value_parser = positive)]
    rate: f64,
    /// Rates to measure one after the other.
    #[arg(long, value_name = "RATES", value_delimiter = ',', conflicts_with = "rate",
        value_parser = positive)]
    steps: Vec<f64>,
    /// Duration of the measurement at each rate, in seconds.
    #[arg(long, default_value_t = 10.0, value_parser = positive)]
    duration_s: f64,
    /// Duration of the warm-up before each measurement, in seconds.
    #[arg(long, default_value_t = 3.0, value_parser = not_negative)]
    warmup_s: f64,
    /// Minutes of overload after the steps, to detect memory growth.
    #[arg(long, value_name = "MINUTES", value_parser = positive)]
    soak: Option<f64>,
    /// Rate of the soak, as a multiple of the highest accepted rate.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.5, value_parser = positive)]
    overload: f64,
    /// Number of robots, each with one session at a time.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    sessions: u32,
    /// Readings after which a robot closes its session and starts another.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    readings_per_session: u32,
    /// Mix of requests within a session, as weights.
    #[arg(long, default_value_t = Mix::default())]
    mix: Mix,
    /// Space requests like independent robots (exponential intervals, bursts) instead of evenly.
    #[arg(long)]
    poisson: bool,
    /// Robots obey `Retry-After` and wait.
    #[arg(long)]
    polite: bool,
    /// Maximum number of requests in flight, each on its own connection. Requests due beyond it
    /// count as not sent.
    #[arg(long, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=60_000))]
    in_flight: u32,
    /// Seconds after which an unanswered request is given up.
    #[arg(long, default_value_t = 30.0, value_parser = positive)]
    timeout_s: f64,
    /// Recognition method [default: the server's choice].
    #[arg(long, value_parser = among(&[Method::Surface, Method::Sva]))]
    method: Option<Method>,
    /// Detail of the belief in each answer.
    #[arg(long, value_enum, default_value = "full")]
    belief: BeliefDetail,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of simulated touches per object to draw from.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    touches: u32,
    /// Training readings per object, with --prepare.
    #[arg(long, default_value_t = 400, value_parser = clap::value_parser!(u32).range(20..=20_000))]
    training_readings: u32,
    /// Process id of the server, if it runs on this machine: memory is read from the process
    /// instead of /metrics.
    #[arg(long)]
    pid: Option<u32>,
    /// Bound on the 99th percentile of accepted requests in every step, in milliseconds.
    #[arg(long, value_name = "MS", value_parser = positive)]
    max_p99_ms: Option<f64>,
    /// Bound on the throughput beyond saturation, as a fraction of the peak.
    #[arg(long, value_name = "SHARE", value_parser = share)]
    min_share: Option<f64>,
    /// Bound on the growth of the server's memory over the soak (or the last step), in MB.
    #[arg(long, value_name = "MB", value_parser = not_negative)]
    max_growth_mb: Option<f64>,
    /// Write throughput and latency against the rate as a plot (SVG).
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
}

/// The answer: the run, and the bounds that it exceeded.
#[derive(Debug, Serialize)]
struct Loaded<'a> {
    #[serde(flatten)]
    report: &'a LoadReport,
    broken: Vec<String>,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() && number > 0.0 && number <= 1e6 => Ok(number),
        _ => Err("expected a number above 0, up to 1000000".to_owned()),
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() && (0.0..=1e6).contains(&number) => Ok(number),
        _ => Err("expected a number of 0 to 1000000".to_owned()),
    }
}

fn share(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("expected a share of 0 to 1".to_owned()),
    }
}

/// Runs the command.
pub(crate) async fn run(args: LoadArgs, context: &Context) -> anyhow::Result<()> {
    tokio::select! {
        done = measure(&args, context) => done,
        interrupted = tokio::signal::ctrl_c() => {
            interrupted?;
            Err(Ended::Interrupted.into())
        }
    }
}

async fn measure(args: &LoadArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    let touches = made_ready(args, client).await?;
    // Requests are sent once, because a repetition would not be counted.
    let timeout = Duration::from_secs_f64(args.timeout_s);
    let sender = client.with_policy(RetryPolicy::never(), timeout);
    let memory = match args.pid {
        Some(pid) => MemorySource::Process { pid },
        None => MemorySource::Metrics,
    };
    output.say(HEADER);
    let show = |step: &StepReport| output.say(row(step));
    let report = load::run(&config(args), &sender, touches, &memory, show).await?;
    if let Some(path) = &args.picture {
        std::fs::write(path, load::picture(&report))
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    said(&report, args, output)
}

async fn made_ready(args: &LoadArgs, client: &Client) -> anyhow::Result<Touches> {
    let progress = StepProgress::new();
    let show = |stage: &str, done: usize, total: usize| progress.show(stage, done, total);
    if args.prepare {
        load::prepare(client, &args.catalogue, args.training_readings, args.seed, &show).await?;
    }
    let n = args.touches as usize;
    let touches = Touches::of_catalogue(client, &args.catalogue, n, args.seed, &show).await;
    progress.clear();
    touches.map_err(|error| match error.downcast_ref::<ClientError>().map(ClientError::status) {
        Some(Some(404 | 409)) if !args.prepare => error
            .context("there is no catalogue to recognise with; --prepare trains example objects"),
        _ => error,
    })
}

fn config(args: &LoadArgs) -> LoadConfig {
    let rates = if args.steps.is_empty() { vec![args.rate] } else { args.steps.clone() };
    LoadConfig {
        seed: args.seed,
        catalogue: args.catalogue.clone(),
        method: args.method,
        belief: args.belief,
        rates,
        arrivals: if args.poisson { Arrivals::Poisson } else { Arrivals::Constant },
        duration: Duration::from_secs_f64(args.duration_s),
        warmup: Duration::from_secs_f64(args.warmup_s),
        soak: args.soak.map(|minutes| Soak {
            duration: Duration::from_secs_f64(60.0 * minutes),
            factor: args.overload,
        }),
        sessions: args.sessions as usize,
        readings_per_session: args.readings_per_session,
        mix: args.mix,
        in_flight_max: args.in_flight as usize,
        polite: args.polite,
    }
}

/// Prints the answer. Fails if a bound was exceeded.
fn said(report: &LoadReport, args: &LoadArgs, output: Output) -> anyhow::Result<()> {
    let bounds = Bounds {
        p99_max_ms: args.max_p99_ms,
        share_min: args.min_share,
        growth_max_bytes: args.max_growth_mb.map(|megabytes| megabytes * 1e6),
    };
    let loaded = Loaded { report, broken: report.broken(&bounds) };
    output.answer(&loaded, |loaded| verdict_words(loaded.report, &loaded.broken))?;
    if loaded.broken.is_empty() { Ok(()) } else { Err(Ended::BoundBroken.into()) }
}
