//! `torture`: kills and damages a real server repeatedly, and counts its faults.
//!
//! `kill`: `kill -9` under concurrent writers, with `--store nats` of several servers that share a
//! NATS cluster, and of the cluster's leader; `corrupt`: bytes of the stored files change;
//! `order`: one set of readings is sent in many ways; `hostile`: attackers beside honest
//! robots; `soak`: a long mix of kept and removed records, and its disk usage. The last line
//! of the standard output is one JSON object; every count of faults in it must be 0, and the
//! exit code is 1 otherwise. Progress goes to the standard error.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command line prints its answers")]

mod check;
mod corrupt;
mod hostile;
mod http;
mod keys;
mod kill;
mod ledger;
mod material;
mod nats;
mod order;
mod pauses;
mod robot;
mod serving;
mod several;
mod soak;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::Context;
use clap::{Parser, ValueEnum};
use serde::Serialize;

/// Kills and damages a real server repeatedly, and counts its faults.
#[derive(Debug, Parser)]
struct Args {
    /// The kind of test.
    mode: Mode,
    /// Number of rounds.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    rounds: u32,
    /// Number of concurrent clients.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=1000))]
    writers: u32,
    /// Seed of the requests, the times of the kills and the damage.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// With `kill`: whether the server requires keys. If so, robots have their own, training
    /// uses a trainer's, and keys are also created and revoked under fire.
    #[arg(long, value_enum, default_value = "open")]
    access: Access,
    /// With `kill`: where the servers store. `nats` runs two and three servers in turn.
    #[arg(long, value_enum, default_value = "folder")]
    store: Store,
    /// With `--store nats`: the program `nats-server`, 2.12 or later.
    #[arg(long, value_name = "FILE", required_if_eq("store", "nats"))]
    nats_server: Option<PathBuf>,
    /// With `hostile`: seconds of each attack.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=600))]
    seconds: u32,
    /// With `hostile`: only the attacks of this review.
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=2))]
    review: Option<u8>,
    /// The command under test; built by cargo if not given.
    #[arg(long, value_name = "FILE")]
    palpate: Option<PathBuf>,
    /// With `soak`: duration in minutes.
    #[arg(long, default_value_t = 30.0)]
    minutes: f64,
    /// With `soak`: end after this many acknowledged readings.
    #[arg(long, default_value_t = 10_000_000)]
    readings: u64,
    /// With `soak`: number of readings stored before the start and kept to the end.
    #[arg(long, default_value_t = 0)]
    kept: u64,
    /// With `soak`: the server's data folder; a temporary one if not given.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// With `soak`: `--store-slack-mb` of the server; a huge value turns compaction off.
    #[arg(long, value_name = "MB", default_value_t = 32)]
    slack_mb: u64,
    /// With `soak`: write figures and all samples to this JSON file; with `kill` the counts.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// With `soak`: draw the bytes over time into this SVG file.
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Print nothing but the JSON object.
    #[arg(long)]
    json: bool,
}

/// Whether the server requires keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
enum Access {
    /// It does not.
    Open,
    /// It does.
    Keys,
}

impl Access {
    /// The value of `palpate serve --access`.
    fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Keys => "keys",
        }
    }
}

/// Where the servers store.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
enum Store {
    /// One server on a folder.
    Folder,
    /// Several servers on a cluster of three NATS servers.
    Nats,
}

/// The kind of test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
enum Mode {
    /// `kill -9` at random moments.
    Kill,
    /// Changed and cut files.
    Corrupt,
    /// Readings in other orders, in batches, repeated, and withdrawn; eight ways a round.
    Order,
    /// Attackers beside honest robots, one attack after the other.
    Hostile,
    /// A long mix of kept and removed records.
    Soak,
    /// Everything but `hostile` and `soak`.
    All,
}

/// Counts of the run; the first ones are faults.
#[derive(Clone, Debug, Default, Serialize)]
struct Counts {
    acknowledged_lost: u64,
    invented: u64,
    beliefs_differ: u64,
    silent_corruptions: u64,
    orders_differ: u64,
    unexpected_answers: u64,
    rounds: u64,
    writers: u32,
    seed: u64,
    acknowledged: u64,
    unanswered: u64,
    restarts: u64,
    restart_seconds_max: f64,
    servers_killed: u64,
    leaders_killed: u64,
    longest_pause_s: f64,
    beliefs_compared: u64,
    orders_compared: u64,
    versions_trained: u64,
    keys_created: u64,
    keys_revoked: u64,
    keys_tried: u64,
    damages: u64,
    damages_refused: u64,
    damages_named: u64,
    damages_harmless: u64,
    seconds: f64,
}

impl Counts {
    fn faults(&self) -> u64 {
        self.acknowledged_lost
            + self.invented
            + self.beliefs_differ
            + self.silent_corruptions
            + self.orders_differ
            + self.unexpected_answers
    }
}

#[tokio::main]
async fn main() -> ExitCode {
    let args = Args::parse();
    // Reqwest needs a provider although nothing here uses TLS.
    let _ = rustls::crypto::ring::default_provider().install_default();
    match run(&args).await {
        Ok((report, faults)) => {
            println!("{report}");
            if faults == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

/// The results as JSON, and the number of faults in them.
async fn run(args: &Args) -> anyhow::Result<(String, u64)> {
    let begun = Instant::now();
    let command = match &args.palpate {
        Some(path) => path.clone(),
        None => serving::build()?,
    };
    let mut counts = Counts { writers: args.writers, seed: args.seed, ..Counts::default() };
    let say = |line: String| {
        if !args.json {
            eprintln!("{line}");
        }
    };
    if args.mode == Mode::Soak {
        let figures = soak::run(args).await?;
        return Ok((figures.to_string(), figures.faults()));
    }
    if args.mode == Mode::Hostile {
        let report = hostile::run(&command, args, &say).await?;
        return Ok((serde_json::to_string(&report)?, report.faults()));
    }
    if let (Mode::Kill, Store::Nats, Some(program)) = (args.mode, args.store, &args.nats_server) {
        several::run(&command, program, args, &mut counts, &say).await?;
        counts.seconds = begun.elapsed().as_secs_f64();
        return report(args, &counts);
    }
    if args.store == Store::Nats {
        anyhow::bail!("`--store nats` goes with `kill`");
    }
    if matches!(args.mode, Mode::Kill | Mode::All) {
        kill::run(&command, args, &mut counts, &say).await?;
    }
    if matches!(args.mode, Mode::Corrupt | Mode::All) {
        corrupt::run(&command, args, &mut counts, &say).await?;
    }
    if matches!(args.mode, Mode::Order | Mode::All) {
        order::run(&command, args, &mut counts, &say).await?;
    }
    counts.seconds = begun.elapsed().as_secs_f64();
    report(args, &counts)
}

/// The counts as JSON, also in the file of the report if there is one, and the number of faults.
fn report(args: &Args, counts: &Counts) -> anyhow::Result<(String, u64)> {
    if let Some(file) = args.report.as_ref().filter(|_| args.mode == Mode::Kill) {
        std::fs::write(file, serde_json::to_string_pretty(counts)? + "\n")
            .with_context(|| format!("cannot write {}", file.display()))?;
    }
    Ok((serde_json::to_string(counts)?, counts.faults()))
}
