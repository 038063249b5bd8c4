//! `palpate experiment`: runs the program `palpate-experiments` that lies beside this one.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::Args;

use crate::output::Output;

/// The program that holds the experiments.
const PROGRAM: &str = "palpate-experiments";

/// Arguments of `palpate experiment`.
#[derive(Debug, Args)]
#[command(disable_help_flag = true)]
pub(crate) struct ExperimentArgs {
    /// Name of the experiment and its arguments; `--help` lists them.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "NAME AND ARGUMENTS")]
    arguments: Vec<OsString>,
}

/// Runs the experiment in place of this program.
pub(crate) fn run(args: ExperimentArgs, output: Output) -> anyhow::Result<()> {
    let own = std::env::current_exe().context("cannot tell where this program lies")?;
    let program = beside(&own)?;
    let mut command = std::process::Command::new(&program);
    command.args(args.arguments);
    if output.json {
        command.arg("--json");
    }
    let error = std::os::unix::process::CommandExt::exec(&mut command);
    Err(error).with_context(|| format!("cannot run {}", program.display()))
}

/// The experiments' program in the folder of `own`.
fn beside(own: &Path) -> anyhow::Result<PathBuf> {
    let program = own.with_file_name(PROGRAM);
    anyhow::ensure!(
        program.is_file(),
        "{} does not exist; `cargo build --release -p {PROGRAM}` builds it",
        program.display()
    );
    Ok(program)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_program_names_the_command_that_builds_it() {
        let folder = tempfile::tempdir().unwrap();
        let own = folder.path().join("palpate");
        let error = beside(&own).unwrap_err().to_string();
        assert!(
            error.ends_with("`cargo build --release -p palpate-experiments` builds it"),
            "{error}"
        );
        std::fs::write(folder.path().join(PROGRAM), "").unwrap();
        assert_eq!(beside(&own).unwrap(), folder.path().join(PROGRAM));
    }
}
