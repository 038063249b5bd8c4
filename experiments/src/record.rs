//! The committed record of an experiment: `results/NAME.json`, one entry per command line.
//!
//! A second run of a command replaces its entry. Rows, plot and pictures of the last run go to
//! the folder `results/NAME`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::report::{Outcome, Report};

/// Version of the file's form.
pub const FORMAT: u32 = 1;

/// All recorded runs of an experiment.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Record {
    /// Version of the form: [`FORMAT`].
    pub format: u32,
    /// Name of the experiment.
    pub experiment: String,
    /// One entry per command line.
    pub runs: Vec<Run>,
}

/// One run of an experiment.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Run {
    /// The command line that gives the figures again.
    pub command: String,
    /// Every argument by name, defaults included.
    pub arguments: Map<String, Value>,
    /// The commit that ran, or "unknown" outside of a working copy.
    pub commit: String,
    /// Processor and number of cores.
    pub machine: String,
    /// The figures by key. A figure that does not exist is null.
    pub figures: BTreeMap<String, Option<f64>>,
}

impl Run {
    /// A run on this machine and working copy.
    #[must_use]
    pub fn new(command: String, arguments: Map<String, Value>, report: &Report) -> Self {
        let figure = |(key, value): (&String, &f64)| {
            (key.clone(), value.is_finite().then(|| rounded(*value)))
        };
        let figures = report.summary.iter().map(figure).collect();
        Self { command, arguments, commit: commit(), machine: machine(), figures }
    }
}

impl Record {
    /// Reads a record; an empty one when the file does not exist.
    ///
    /// # Errors
    /// When the file cannot be read, or is of another experiment or form.
    pub fn read(path: &Path, experiment: &str) -> anyhow::Result<Self> {
        if !path.exists() {
            let experiment = experiment.to_owned();
            return Ok(Self { format: FORMAT, experiment, runs: Vec::new() });
        }
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read {}", path.display()))?;
        let record: Self = serde_json::from_str(&text)
            .with_context(|| format!("{} is not a record of figures", path.display()))?;
        ensure!(
            record.format == FORMAT && record.experiment == experiment,
            "{} holds {} in form {}, expected {experiment} in form {FORMAT}",
            path.display(),
            record.experiment,
            record.format
        );
        Ok(record)
    }

    /// Adds a run in place of an earlier one of the same command line.
    pub fn add(&mut self, run: Run) {
        match self.runs.iter_mut().find(|old| old.command == run.command) {
            Some(old) => *old = run,
            None => self.runs.push(run),
        }
    }

    /// Writes the record.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        write(path, (serde_json::to_string_pretty(self)? + "\n").as_bytes())
    }
}

/// Writes rows, plot and pictures to `<out>/<experiment>/`, and adds the run to
/// `<out>/<experiment>.json` if it `is_recorded`. Returns the folder.
///
/// # Errors
/// When a file cannot be written, or the record cannot be read.
pub fn write_outcome(
    out: &Path,
    experiment: &str,
    outcome: &Outcome,
    run: &Run,
    is_recorded: bool,
) -> anyhow::Result<PathBuf> {
    let folder = out.join(experiment);
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot create folder {}", folder.display()))?;
    write(&folder.join("rows.csv"), outcome.report.csv().as_bytes())?;
    write(&folder.join("plot.svg"), outcome.plot.as_bytes())?;
    for (name, bytes) in &outcome.pictures {
        write(&folder.join(name), bytes)?;
    }
    if is_recorded {
        let path = out.join(format!("{experiment}.json"));
        let mut record = Record::read(&path, experiment)?;
        record.add(run.clone());
        record.write(&path)?;
    }
    Ok(folder)
}

fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    std::fs::write(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

/// Rounds to six significant digits, which exceeds the precision of any figure and keeps records
/// readable.
fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

fn commit() -> String {
    let output = std::process::Command::new("git").args(["rev-parse", "--short", "HEAD"]).output();
    match output {
        Ok(output) if output.status.success() => {
            String::from_utf8_lossy(&output.stdout).trim().to_owned()
        }
        _ => "unknown".to_owned(),
    }
}

fn machine() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info
        .lines()
        .find_map(|line| line.strip_prefix("model name"))
        .and_then(|rest| rest.split_once(':'))
        .map_or("unknown processor", |(_, model)| model.trim());
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    format!("{model}, {cores} cores")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_run_of_a_command_replaces_its_entry() {
        let folder = std::env::temp_dir().join(format!("palpate-record-{}", std::process::id()));
        let mut report = Report::default();
        for (command, value) in [("demo --seed 1", 0.5), ("demo", 0.25), ("demo", 0.987_654_321)] {
            report.summarise("accuracy", value);
            report.summarise("never", f64::NAN);
            let plot = "<svg/>".to_owned();
            let outcome = Outcome { report: report.clone(), plot, pictures: Vec::new() };
            let run = Run::new(command.to_owned(), Map::new(), &report);
            write_outcome(&folder, "demo", &outcome, &run, true).unwrap();
        }
        let record = Record::read(&folder.join("demo.json"), "demo").unwrap();
        assert!(Record::read(&folder.join("demo.json"), "other").is_err());
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(record.runs.len(), 2);
        assert_eq!(record.runs[1].figures["accuracy"], Some(0.987_654));
        assert_eq!(record.runs[1].figures["never"], None);
    }
}
