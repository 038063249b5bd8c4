//! `palpate-experiments`: reruns the figures of `docs/results`.
//!
//! Users type `palpate experiment NAME`, which runs this program.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command line prints its answers")]

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use palpate_experiments::experiment::{Experiment, PROGRAM};
use palpate_experiments::record::{Run, write_outcome};
use palpate_experiments::report::Report;
use serde::Serialize;

/// Each touch allocates many small lists; this allocator is faster with them.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Time between lines of progress where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(30);

/// Reruns the tables and figures of docs/results.
#[derive(Parser)]
#[command(
    name = PROGRAM,
    bin_name = PROGRAM,
    version,
    max_term_width = 100,
    after_help = "Examples:\n  palpate experiment sva-objects --trials 50 --seed 1\n  \
        palpate experiment surface-objects --public\n  \
        palpate experiment sva-objects --meshes meshes --size-mm 80 --out mine"
)]
struct Cli {
    #[command(subcommand)]
    experiment: Experiment,
    /// The folder to write to: figures as NAME.json; rows, plot and pictures in the folder NAME.
    #[arg(long, global = true, default_value = "results", value_name = "DIR")]
    out: PathBuf,
    /// Do not add the figures to NAME.json.
    #[arg(long, global = true)]
    no_record: bool,
    /// Print JSON to the standard output, everything else to the standard error.
    #[arg(long, global = true)]
    json: bool,
}

/// Output of `--json`.
#[derive(Serialize)]
struct Answer<'a> {
    experiment: &'a str,
    #[serde(flatten)]
    run: &'a Run,
    rows: &'a [palpate_experiments::report::Row],
}

fn main() -> ExitCode {
    match run(&Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(cli: &Cli) -> anyhow::Result<()> {
    let (experiment, command) = (cli.experiment.name(), cli.experiment.command_line());
    eprintln!("running {command}");
    let shown = Shown::new()?;
    let outcome = cli.experiment.run(&|stage, done, total| shown.show(stage, done, total))?;
    shown.bar.finish_and_clear();
    let run = Run::new(command, cli.experiment.arguments(), &outcome.report);
    let folder = write_outcome(&cli.out, &experiment, &outcome, &run, !cli.no_record)?;
    if cli.json {
        let rows = &outcome.report.rows;
        println!(
            "{}",
            serde_json::to_string(&Answer { experiment: &experiment, run: &run, rows })?
        );
    } else {
        println!("{}\n\nrows and pictures are in {}", table(&outcome.report), folder.display());
    }
    Ok(())
}

/// Progress: a bar on a terminal, otherwise an occasional line.
struct Shown {
    bar: ProgressBar,
    begun: Instant,
    last: Mutex<Last>,
}

/// The stage under way and when it began, and when a line was printed.
struct Last {
    stage: String,
    since: Instant,
    line: Instant,
}

impl Shown {
    fn new() -> anyhow::Result<Self> {
        let template = "{msg:<24} {bar:32} {pos}/{len} {elapsed}, {eta} left";
        let bar = ProgressBar::new(0).with_style(ProgressStyle::with_template(template)?);
        bar.enable_steady_tick(Duration::from_millis(200));
        let begun = Instant::now();
        let last = Last { stage: String::new(), since: begun, line: begun };
        Ok(Self { bar, begun, last: Mutex::new(last) })
    }

    fn show(&self, stage: &str, done: usize, total: usize) {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let is_new = last.stage != stage;
        if is_new {
            (last.stage, last.since) = (stage.to_owned(), Instant::now());
        }
        if !self.bar.is_hidden() {
            if is_new {
                self.bar.set_message(stage.to_owned());
                self.bar.reset_eta();
            }
            self.bar.set_length(total as u64);
            self.bar.set_position(done as u64);
        } else if last.line.elapsed() >= LINE_EVERY {
            last.line = Instant::now();
            let left = left(last.since.elapsed().as_secs_f64(), done, total);
            let after = self.begun.elapsed().as_secs_f64();
            eprintln!("{stage}: {done} of {total} after {after:.0} s{left}");
        }
    }
}

/// The time that a stage of this age still takes, in words; nothing before its first step.
fn left(seconds: f64, done: usize, total: usize) -> String {
    if done == 0 {
        return String::new();
    }
    let left = seconds / done as f64 * total.saturating_sub(done) as f64;
    format!(", {left:.0} s left")
}

/// The summary, one figure per line.
fn table(report: &Report) -> String {
    let width = report.summary.keys().map(String::len).max().unwrap_or(0);
    let lines = report.summary.iter().map(|(key, value)| format!("{key:width$}  {value:.4}"));
    lines.collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::left;

    #[test]
    fn the_time_left_is_that_of_the_steps_left() {
        assert_eq!(left(30.0, 10, 40), ", 90 s left");
        assert_eq!(left(30.0, 0, 40), "");
    }
}
