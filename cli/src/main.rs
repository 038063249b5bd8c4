//! The one binary, `palpate`: the service, its demonstration, and everything a person does
//! with it from a shell.
//!
//! One file a subcommand under `commands`; all of them speak to the server through the SDK,
//! over HTTP. Exit codes are listed in [`exit`] and in `--help`.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command line prints its answers")]

mod args;
mod commands;
mod exit;
mod explorer;
mod output;
mod progress;
mod readings_file;
mod robot;
mod symmetry;
mod trial;

use std::process::ExitCode;

use clap::Parser;

use crate::args::{Cli, Command};

fn main() -> ExitCode {
    let cli = Cli::parse();
    install_log(&cli);
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
    let outcome = match runtime {
        Ok(runtime) => {
            let outcome = runtime.block_on(commands::run(cli));
            // Simulated touches that nobody waits for any more are not waited for.
            runtime.shutdown_background();
            outcome
        }
        Err(error) => Err(error.into()),
    };
    exit::code_of(outcome)
}

/// Logs go to the standard error: what `RUST_LOG` says, else warnings, and with `serve` or
/// `--verbose` also what happens.
fn install_log(cli: &Cli) {
    let talkative = cli.verbose || matches!(cli.command, Command::Serve(_));
    let default = if talkative { "info" } else { "warn" };
    let filter = tracing_subscriber::EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new(default));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(progress::is_watched())
        .init();
}
