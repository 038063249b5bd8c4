//! The binary `palpate`: the service, its demonstration and its command-line client.
//!
//! Each subcommand is one file under `commands`. All of them use the SDK over HTTP. [`exit`] and
//! `--help` list the exit codes.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command line prints its answers")]

mod admin_key;
mod calibrated;
mod cluster;
mod knowledge;
mod json_file;
mod numbers;
mod output;
mod listen;
mod exit;
mod ids;
mod method;
mod progress;
mod readings_file;
mod robot;
mod explorer;
mod settings;
#[cfg(feature = "otlp")]
mod spans;
mod supervisor;
mod forwarder;
mod symmetry;
mod verdict;
mod trial;
mod help;
mod commands;
mod args;
mod dispatch;
mod logging;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches};

use crate::args::{Cli, Command};

/// Allocator: each touch allocates many small lists, for which mimalloc is faster than the system's
/// allocator (`docs/results/surface-scale.md`).
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    let cli = match typed() {
        Ok(cli) => cli,
        Err(error) => return exit::code_of(Err(error)),
    };
    if let Err(error) = logging::install(&cli) {
        return exit::code_of(Err(error));
    }
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
    let outcome = match runtime {
        Ok(runtime) => {
            let outcome = runtime.block_on(dispatch::run(cli));
            // Do not wait for simulated touches that are no longer needed.
            runtime.shutdown_background();
            outcome
        }
        Err(error) => Err(error.into()),
    };
    #[cfg(feature = "otlp")]
    spans::flush();
    exit::code_of(outcome)
}

/// Parses the command line on top of the environment and a configuration file.
fn typed() -> anyhow::Result<Cli> {
    let typed: Vec<OsString> = std::env::args_os().collect();
    let mut command = help::grouped(Cli::command());
    let file = settings::file(&command, &typed)?;
    if let Some(file) = &file {
        command = settings::layered(command, file);
    }
    // Help and usage errors exit here.
    let matches = command.clone().get_matches_from(typed);
    help::check(&matches)?;
    let mut cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    if let Command::Config(args) = &mut cli.command {
        args.effective = settings::effective(&command, &matches, file.as_ref());
    }
    Ok(cli)
}
