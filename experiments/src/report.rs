//! What every experiment leaves behind: JSON, CSV, SVG and a line of `docs/results.md`.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use serde::Serialize;
use serde_json::{Map, Value};

/// One row of a report: column names to numbers, strings or null.
pub type Row = Map<String, Value>;

/// Hears how far an experiment is: what it does, steps done, steps in all.
pub type Progress<'a> = &'a (dyn Fn(&str, usize, usize) + Sync);

/// A report with what is drawn of it.
pub struct Outcome {
    /// The figures.
    pub report: Report,
    /// The plot, SVG.
    pub plot: String,
    /// Further pictures: file name and PNG.
    pub pictures: Vec<(String, Vec<u8>)>,
}

impl Outcome {
    /// Writes `<out>/<experiment>.json`, `.csv`, `.svg` and the pictures; returns the JSON's
    /// path.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, out: &Path) -> anyhow::Result<PathBuf> {
        let path = self.report.write(out, &self.plot)?;
        for (name, png) in &self.pictures {
            let picture = out.join(name);
            std::fs::write(&picture, png)
                .with_context(|| format!("cannot write {}", picture.display()))?;
        }
        Ok(path)
    }
}

/// The figures of an experiment.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Its name, also of the files.
    pub experiment: String,
    /// The command line that gives it again.
    pub command: String,
    /// The seed of every random choice.
    pub seed: u64,
    /// The commit of the working copy, or "unknown" outside one.
    pub commit: String,
    /// Processor and number of cores.
    pub machine: String,
    /// The figures, a row a measurement.
    pub rows: Vec<Row>,
    /// The figures that goals are stated in.
    pub summary: BTreeMap<String, f64>,
}

impl Report {
    /// An empty report of this machine and working copy.
    #[must_use]
    pub fn new(experiment: &str, command: String, seed: u64) -> Self {
        Self {
            experiment: experiment.to_owned(),
            command,
            seed,
            commit: commit(),
            machine: machine(),
            rows: Vec::new(),
            summary: BTreeMap::new(),
        }
    }

    /// Adds a row of columns.
    pub fn row(&mut self, columns: Vec<(&str, Value)>) {
        self.rows.push(columns.into_iter().map(|(name, value)| (name.to_owned(), value)).collect());
    }

    /// Adds a figure to the summary.
    pub fn summarise(&mut self, key: &str, value: f64) {
        self.summary.insert(key.to_owned(), value);
    }

    fn write(&self, out: &Path, svg: &str) -> anyhow::Result<PathBuf> {
        std::fs::create_dir_all(out)
            .with_context(|| format!("cannot create folder {}", out.display()))?;
        let path = |extension| out.join(format!("{}.{extension}", self.experiment));
        let write = |path: &Path, text: &str| {
            std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
        };
        write(&path("json"), &serde_json::to_string_pretty(self)?)?;
        write(&path("csv"), &self.csv())?;
        write(&path("svg"), svg)?;
        Ok(path("json"))
    }

    /// The rows as comma-separated values; columns in the order of their first appearance.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut columns: Vec<&String> = Vec::new();
        for name in self.rows.iter().flat_map(Map::keys) {
            if !columns.contains(&name) {
                columns.push(name);
            }
        }
        let quote = |text: &str| {
            let plain = !text.contains([',', '"', '\n']);
            if plain { text.to_owned() } else { format!("\"{}\"", text.replace('"', "\"\"")) }
        };
        let cell = |row: &Row, column: &str| match row.get(column) {
            None | Some(Value::Null) => String::new(),
            Some(Value::String(text)) => quote(text),
            Some(other) => other.to_string(),
        };
        let header: Vec<String> = columns.iter().map(|name| quote(name)).collect();
        let mut csv = header.join(",") + "\n";
        for row in &self.rows {
            let cells: Vec<String> = columns.iter().map(|column| cell(row, column)).collect();
            csv += &(cells.join(",") + "\n");
        }
        csv
    }

    /// The line for `docs/results.md`: command, summary, seed, commit and machine.
    #[must_use]
    pub fn results_line(&self) -> String {
        let mut figures = String::new();
        for (key, value) in &self.summary {
            let separator = if figures.is_empty() { "" } else { ", " };
            let _ = write!(figures, "{separator}{key} {}", figure(*value));
        }
        format!(
            "| `{}` | {figures} | {} | {} | {} |",
            self.command, self.seed, self.commit, self.machine
        )
    }

    /// Puts the line into a results file, in place of an earlier line of the same command or
    /// at the end.
    ///
    /// # Errors
    /// When the file cannot be read or written.
    pub fn record(&self, results: &Path) -> anyhow::Result<()> {
        let text = std::fs::read_to_string(results)
            .with_context(|| format!("cannot read {}", results.display()))?;
        let begins = format!("| `{}` |", self.command);
        let line = self.results_line();
        let mut found = false;
        let mut lines: Vec<String> = Vec::new();
        for old in text.lines() {
            let same = old.starts_with(&begins);
            found |= same;
            lines.push(if same { line.clone() } else { old.to_owned() });
        }
        if !found {
            lines.push(line);
        }
        std::fs::write(results, lines.join("\n") + "\n")
            .with_context(|| format!("cannot write {}", results.display()))
    }
}

/// Four significant digits, whole numbers whole.
fn figure(value: f64) -> String {
    if value.fract() == 0.0 || value.abs() >= 1e4 {
        return format!("{value:.0}");
    }
    let digits = (3 - value.abs().log10().floor() as i32).clamp(0, 8) as usize;
    format!("{value:.digits$}")
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
    use serde_json::json;

    use super::*;

    fn report() -> Report {
        let mut report = Report::new("demo", "palpate experiment demo".to_owned(), 7);
        report.row(vec![("mode", json!("a,b")), ("accuracy", json!(0.5))]);
        report.row(vec![("mode", json!("c")), ("readings", json!(3))]);
        report.summarise("accuracy_at_10", 0.98765);
        report
    }

    #[test]
    fn columns_of_all_rows_are_in_the_csv() {
        assert_eq!(report().csv(), "accuracy,mode,readings\n0.5,\"a,b\",\n,c,3\n");
    }

    #[test]
    fn a_second_run_replaces_its_line() {
        let folder = std::env::temp_dir().join(format!("palpate-report-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let results = folder.join("results.md");
        std::fs::write(&results, "# Results\n").unwrap();
        report().record(&results).unwrap();
        report().record(&results).unwrap();
        let text = std::fs::read_to_string(&results).unwrap();
        assert_eq!(text.lines().count(), 2, "{text}");
        assert!(text.contains("accuracy_at_10 0.9876") || text.contains("accuracy_at_10 0.9877"));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
