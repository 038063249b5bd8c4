//! The pages of `docs/results` state what the records in `results` hold.
#![allow(clippy::unwrap_used, reason = "a test fails where it unwraps")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use palpate_experiments::experiment::Experiment;
use palpate_experiments::record::{Record, Run};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// Every record by the name of its experiment.
fn records() -> BTreeMap<String, Record> {
    let files = std::fs::read_dir(root().join("results")).unwrap().map(|entry| entry.unwrap());
    let paths =
        files.map(|file| file.path()).filter(|path| path.extension().is_some_and(|e| e == "json"));
    let record = |path: PathBuf| {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        (name.clone(), Record::read(&path, &name).unwrap())
    };
    paths.map(record).collect()
}

/// A figure as pages write it: four significant digits, whole numbers whole.
fn written(value: f64) -> String {
    if value.fract() == 0.0 || value.abs() >= 1e4 {
        return format!("{value:.0}");
    }
    let digits = (3 - value.abs().log10().floor() as i32).clamp(0, 8) as usize;
    format!("{value:.digits$}")
}

/// The figures of a page: the command above each, its key and its value.
fn stated(page: &str) -> Vec<(String, String, String)> {
    let (mut command, mut found) = (String::new(), Vec::new());
    for line in page.lines() {
        if line.starts_with("    palpate experiment ") {
            command = line.trim().to_owned();
        }
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let ["", key, value, ""] = cells[..] else { continue };
        if let Some(key) = key.strip_prefix('`').and_then(|key| key.strip_suffix('`')) {
            found.push((command.clone(), key.to_owned(), value.to_owned()));
        }
    }
    found
}

fn run<'a>(record: &'a Record, command: &str) -> Option<&'a Run> {
    record.runs.iter().find(|run| run.command == command)
}

#[test]
fn every_page_states_figures_of_its_record() {
    for (name, record) in records() {
        let path = root().join(format!("docs/results/{name}.md"));
        let page = std::fs::read_to_string(&path).unwrap_or_else(|_| panic!("{name} has no page"));
        let stated = stated(&page);
        assert!(!stated.is_empty(), "{name} states no figure");
        for (command, key, value) in stated {
            let run = run(&record, &command)
                .unwrap_or_else(|| panic!("{name} has no run of {command:?} for {key}"));
            let figure = run.figures.get(&key).unwrap_or_else(|| panic!("{name}: no {key}"));
            assert_eq!(figure.map(written), Some(value), "{name}, {command}: {key}");
        }
    }
}

#[test]
fn every_recorded_command_gives_the_recorded_arguments() {
    for (name, record) in records() {
        for run in record.runs {
            let experiment: Experiment = run.command.parse().unwrap();
            assert_eq!(experiment.name(), name);
            assert_eq!(experiment.command_line(), run.command);
            assert_eq!(experiment.arguments(), run.arguments, "{}", run.command);
        }
    }
}

#[test]
fn the_index_names_every_page_and_headlines_are_recorded() {
    let folder = root().join("docs/results");
    let index = std::fs::read_to_string(folder.join("README.md")).unwrap();
    for entry in std::fs::read_dir(&folder).unwrap() {
        let name = entry.unwrap().file_name().to_string_lossy().into_owned();
        assert!(name == "README.md" || index.contains(&format!("({name})")), "{name}");
    }
    let records = records();
    let headlines = stated(&index);
    assert!(headlines.len() >= 15, "{headlines:?}");
    for (command, key, value) in headlines {
        let name = command.split_whitespace().nth(2).unwrap();
        let figures = &run(&records[name], &command).unwrap().figures;
        assert_eq!(figures[&key].map(written), Some(value), "{command}: {key}");
    }
}

#[test]
fn the_page_of_the_dashboard_states_what_was_measured() {
    let read = |name: &str| -> serde_json::Value {
        let file = std::fs::read(root().join(format!("results/pages/{name}.json"))).unwrap();
        serde_json::from_slice(&file).unwrap()
    };
    let (before, after) = (read("before"), read("after"));
    let page = std::fs::read_to_string(root().join("docs/results/dashboard-pages.md")).unwrap();
    let pages = after["pages"].as_object().unwrap();
    assert!(pages.len() >= 10, "{pages:?}");
    for name in pages.keys() {
        let mut row = format!("| {name} |");
        for key in ["requests", "kilobytes", "renderer_mb"] {
            for run in [&before, &after] {
                let figure = run["pages"][name][key].as_u64();
                row += &format!(" {} |", figure.map_or("–".to_owned(), grouped));
            }
        }
        assert!(page.contains(&row), "no row {row}");
    }
}

/// A whole number with commas between thousands.
fn grouped(number: u64) -> String {
    match (number / 1000, number % 1000) {
        (0, rest) => rest.to_string(),
        (thousands, rest) => format!("{},{rest:03}", grouped(thousands)),
    }
}
