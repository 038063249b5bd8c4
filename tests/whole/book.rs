//! `docs/book.md` against the code and the results: every path, item, command, operation and
//! figure of the page exists, and no part of the dissertation is without a row.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use crate::root;

mod parts;

/// One row of the page, with the commands of its chapter by their names.
struct Row {
    place: String,
    printed: String,
    where_: String,
    result: String,
    commands: BTreeMap<String, String>,
}

fn page() -> String {
    std::fs::read_to_string(root().join("docs/book.md")).unwrap()
}

fn json(path: &str) -> Value {
    let text = std::fs::read_to_string(root().join(path));
    serde_json::from_str(&text.unwrap_or_else(|_| panic!("{path} does not exist"))).unwrap()
}

fn cells(line: &str) -> Vec<&str> {
    let inside = line.strip_prefix("| ").and_then(|line| line.strip_suffix(" |"));
    inside.map_or(Vec::new(), |inside| inside.split(" | ").map(str::trim).collect())
}

/// The rows of all chapters.
fn rows() -> Vec<Row> {
    let page = page();
    let mut rows = Vec::new();
    for chapter in page.split("\n## ").skip(1) {
        let mut commands = BTreeMap::new();
        for line in chapter.lines().filter(|line| line.starts_with('|')) {
            match cells(line)[..] {
                ["name", "command"] | ["place", ..] => {}
                [name, command] => {
                    let known = commands.insert(bare(name), bare(command));
                    assert_eq!(known, None, "{name} names two commands");
                }
                [place, printed, _corrected, where_, result, _theirs] => rows.push(Row {
                    place: place.to_owned(),
                    printed: printed.to_owned(),
                    where_: where_.to_owned(),
                    result: result.to_owned(),
                    commands: commands.clone(),
                }),
                _ => assert!(line.starts_with("|---"), "neither a row nor a command: {line}"),
            }
        }
    }
    assert!(rows.len() > 140, "{} rows", rows.len());
    rows
}

fn bare(cell: &str) -> String {
    cell.trim_matches('`').to_owned()
}

/// The texts between backticks, each with what precedes and what follows it.
fn quoted(cell: &str) -> Vec<(&str, &str, &str)> {
    let parts: Vec<&str> = cell.split('`').collect();
    assert_eq!(parts.len() % 2, 1, "a backtick is missing: {cell}");
    (1..parts.len()).step_by(2).map(|at| (parts[at - 1], parts[at], parts[at + 1])).collect()
}

/// Whether Rust source defines an item, a variant or a field's type of this name.
fn defines(source: &str, name: &str) -> bool {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    source.match_indices(name).any(|(at, _)| {
        let (before, after) = (&source[..at], &source[at + name.len()..]);
        if before.ends_with(is_name) || after.starts_with(is_name) {
            return false;
        }
        let line = before.rsplit('\n').next().unwrap();
        let is_item = ["fn ", "struct ", "enum ", "trait ", "const ", "static ", "type "]
            .iter()
            .any(|kind| line.ends_with(kind));
        let is_variant = line.trim().is_empty()
            && name.starts_with(char::is_uppercase)
            && after.trim_start().starts_with([',', '(', '{']);
        is_item || is_variant
    })
}

/// A place in the code or the documentation: a path, perhaps with `::item`.
fn check_place(place: &str) {
    let (path, item) = place.split_once("::").map_or((place, None), |(path, i)| (path, Some(i)));
    assert!(root().join(path).is_file(), "{path} does not exist");
    if let Some(item) = item {
        let source = std::fs::read_to_string(root().join(path)).unwrap();
        assert!(defines(&source, item), "{path} does not define {item}");
    }
}

/// An operation of the API, such as `GET /v1/objects`.
fn check_operation(api: &Value, method: &str, path: &str) {
    let operation = &api["paths"][path][method.to_lowercase()];
    assert!(operation.is_object(), "the API has no {method} {path}");
}

/// A command: its subcommand has a file, and its flags are arguments somewhere in the command's
/// source. `tests/commands` asks `--help` itself.
fn check_command(command: &str) {
    let mut words = command.split_whitespace().skip(1);
    let name = words.next().unwrap().replace('-', "_");
    let folder = root().join("cli/src/commands");
    let file = folder.join(format!("{name}.rs"));
    let mut source = std::fs::read_to_string(&file)
        .unwrap_or_else(|_| panic!("{command}: there is no subcommand {name}"));
    if let Ok(entries) = std::fs::read_dir(folder.join(&name)) {
        for path in entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_file()) {
            source += &std::fs::read_to_string(path).unwrap();
        }
    }
    if name == "experiment" {
        let names = std::fs::read_to_string(root().join("experiments/src/experiment.rs")).unwrap();
        let asked = words.next().unwrap().replace('-', "_");
        assert!(names.contains(&format!("{asked}::run")), "{command}: no such experiment");
        return;
    }
    for flag in words.filter_map(|word| word.strip_prefix("--")) {
        let argument = format!("{}:", flag.replace('-', "_"));
        assert!(source.contains(&argument), "{command}: no argument {argument}");
    }
}

#[test]
fn every_place_operation_and_command_of_the_book_exists() {
    let api = json("schemas/openapi.json");
    for row in rows() {
        for (_, text, _) in quoted(&row.where_) {
            match text.split_once(' ') {
                Some(("palpate", _)) => check_command(text),
                Some((method, path)) => check_operation(&api, method, path),
                None => check_place(text),
            }
        }
    }
}

/// The figures of a recorded command.
fn figures(command: &str) -> Value {
    let name = command.split_whitespace().nth(2).unwrap();
    let record = json(&format!("results/{name}.json"));
    let run = record["runs"].as_array().unwrap().iter().find(|run| run["command"] == command);
    run.unwrap_or_else(|| panic!("{name} has no run of {command}"))["figures"].clone()
}

#[test]
fn every_figure_of_the_book_is_that_of_its_record() {
    let (mut n_figures, mut records) = (0, BTreeMap::new());
    for Row { place, result, commands, .. } in rows() {
        for (before, key, after) in quoted(&result) {
            let name = before.split_whitespace().next_back().unwrap_or_default();
            let command = commands
                .get(name)
                .unwrap_or_else(|| panic!("{place}: {name} names no command of the chapter"));
            let record = records.entry(command.clone()).or_insert_with(|| figures(command));
            let stated: String = (after.trim_start().chars())
                .take_while(|c| c.is_ascii_digit() || ['.', '-'].contains(c))
                .collect();
            let figure = record.get(key).unwrap_or_else(|| panic!("{command} has no {key}"));
            let digits = stated.split_once('.').map_or(0, |(_, digits)| digits.len());
            let found = figure.as_f64().map(|figure| format!("{figure:.digits$}"));
            assert_eq!(found.unwrap_or_default(), stated, "{place}: {key} of {command}");
            n_figures += 1;
        }
    }
    assert!(n_figures > 100, "{n_figures} figures");
}

#[test]
fn every_command_of_the_book_gives_a_figure() {
    let mut used = BTreeSet::new();
    let rows = rows();
    for row in &rows {
        for (before, _, _) in quoted(&row.result) {
            used.insert(row.commands[before.split_whitespace().next_back().unwrap()].clone());
        }
    }
    for command in rows.iter().flat_map(|row| row.commands.values()) {
        assert!(used.contains(command), "no row states a figure of {command}");
    }
}

#[test]
fn every_row_has_a_result_or_says_why_not() {
    for row in rows() {
        let says_why = row.where_ != "–" || row.result.starts_with("none");
        assert!(says_why, "{}: {} has neither place nor reason", row.place, row.printed);
        assert!(!row.result.is_empty(), "{} has no result", row.place);
    }
}

#[test]
fn every_part_of_the_dissertation_has_a_row() {
    let named: BTreeSet<parts::Part> =
        rows().iter().flat_map(|row| parts::named(&row.place)).collect();
    for part in parts::all() {
        let has_row = named.iter().any(|other| other.is_within(&part));
        assert!(has_row, "no row for {part:?}");
    }
}

#[test]
fn every_picture_of_the_book_exists() {
    for part in page().split("](").skip(1) {
        let target = part.split(')').next().unwrap();
        let path = root().join("docs").join(target.split('#').next().unwrap());
        assert!(path.exists(), "docs/book.md: there is no {target}");
    }
}
