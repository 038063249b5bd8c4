//! The findings of an experiment: rows of figures, and a summary by key.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Map, Value};

/// One row of a report: column names to numbers, strings or null.
pub type Row = Map<String, Value>;

/// Callback for the progress of an experiment: current phase, steps done, steps in all.
pub type Progress<'a> = &'a (dyn Fn(&str, usize, usize) + Sync);

/// A report with its plot and pictures.
pub struct Outcome {
    /// The figures.
    pub report: Report,
    /// The plot, SVG.
    pub plot: String,
    /// Further pictures: file name and bytes.
    pub pictures: Vec<(String, Vec<u8>)>,
}

/// The figures of an experiment.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// All figures, one row per measurement.
    pub rows: Vec<Row>,
    /// Figures by key, in which goals are stated.
    #[serde(rename = "figures")]
    pub summary: BTreeMap<String, f64>,
}

impl Report {
    /// Adds a row. Its columns are the fields of a struct.
    pub fn row(&mut self, row: impl Serialize) {
        self.labelled(&[], row);
    }

    /// Adds a row of labels, which name what is measured, and of figures: the fields of a
    /// struct, or none.
    ///
    /// # Panics
    /// When the figures are neither a struct nor none.
    pub fn labelled(&mut self, labels: &[(&str, &str)], figures: impl Serialize) {
        let label = |(name, text): &(&str, &str)| ((*name).to_owned(), Value::from(*text));
        let mut row: Row = labels.iter().map(label).collect();
        match serde_json::to_value(figures) {
            Ok(Value::Object(figures)) => row.extend(figures),
            Ok(Value::Null) => {}
            other => panic!("figures are a struct, not {other:?}"),
        }
        self.rows.push(row);
    }

    /// Adds a figure to the summary.
    pub fn summarise(&mut self, key: &str, value: f64) {
        self.summary.insert(key.to_owned(), value);
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_all_rows_are_in_the_csv() {
        #[derive(Serialize)]
        struct Accuracy {
            mode: &'static str,
            accuracy: f64,
        }
        #[derive(Serialize)]
        struct Count {
            readings: usize,
        }
        let mut report = Report::default();
        report.row(Accuracy { mode: "a,b", accuracy: 0.5 });
        report.row(Accuracy { mode: "b", accuracy: f64::NAN });
        report.labelled(&[("mode", "c")], Count { readings: 3 });
        assert_eq!(report.csv(), "accuracy,mode,readings\n0.5,\"a,b\",\n,b,\n,c,3\n");
    }
}
