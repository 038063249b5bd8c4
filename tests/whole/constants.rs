//! The pages of the model against the code: no constant is missing and none differs, and every
//! operation and every cited equation exists.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::root;

/// Value by place: the file under `recogniser/src`, then the constant or the field of a default.
type Constants = BTreeMap<(String, String), String>;

/// The table: rows of symbol, value, unit, file, name, and origin.
fn in_the_table() -> (Constants, Vec<String>) {
    let text = std::fs::read_to_string(root().join("docs/constants.md")).unwrap();
    let rows = text.lines().filter(|line| line.starts_with("| ") && line.contains(".rs` |"));
    let (mut constants, mut origins) = (Constants::new(), Vec::new());
    for row in rows {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        let [_symbol, value, _unit, file, name, origin] = cells[..] else {
            panic!("a row of {} cells: {row}", cells.len())
        };
        let bare = |cell: &str| cell.trim_matches('`').to_owned();
        let known = constants.insert((bare(file), bare(name)), plain(&bare(value)));
        assert_eq!(known, None, "twice in the table: {row}");
        origins.push(origin.to_owned());
    }
    (constants, origins)
}

/// A value without what does not change it.
fn plain(value: &str) -> String {
    value.chars().filter(|c| !matches!(c, '_' | ' ' | '\n')).collect()
}

fn in_the_code() -> Constants {
    let folder = root().join("recogniser/src");
    let mut found = Constants::new();
    for path in sources(&folder) {
        let file = path.strip_prefix(&folder).unwrap().display().to_string();
        let name = path.file_stem().unwrap().to_string_lossy();
        if ["test_support", "tests", "density_tests", "reference", "check"].contains(&&*name) {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        let product = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
        consts(product, &mut |name, value| {
            found.insert((file.clone(), name.to_owned()), plain(value));
        });
        for block in product.split("impl Default for ").skip(1) {
            let block = block.split("\nimpl ").next().unwrap().split("\n}\n").next().unwrap();
            if let Some((_, body)) = block.rsplit_once("Self {") {
                fields(body, "", &mut |name, value| {
                    found.insert((file.clone(), name.to_owned()), plain(value));
                });
            }
        }
    }
    found
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else {
            found.push(path);
        }
    }
    found
}

/// The numeric constants of a source.
fn consts(text: &str, found: &mut dyn FnMut(&str, &str)) {
    for part in text.split("const ").skip(1) {
        let Some((name, rest)) = part.split_once(": ") else { continue };
        let is_name =
            name.chars().all(|c| c.is_ascii_uppercase() || c == '_' || c.is_ascii_digit());
        let Some((kind, value)) = rest.split_once(" = ") else { continue };
        let is_numeric =
            ["f32", "f64", "usize", "u32", "u16", "u8"].iter().any(|n| kind.contains(n));
        if is_name && is_numeric && !kind.contains('\n') {
            found(name, value.split(";\n").next().unwrap());
        }
    }
}

/// The numeric fields of the inside of a struct expression, by their path.
fn fields(body: &str, prefix: &str, found: &mut dyn FnMut(&str, &str)) {
    let (mut depth, mut start) = (0, 0);
    for (at, c) in body.char_indices() {
        match c {
            '{' | '(' | '[' => depth += 1,
            '}' | ')' | ']' => depth -= 1,
            _ => {}
        }
        if depth < 0 || (depth == 0 && c == ',') {
            if let Some((name, value)) = body[start..at].split_once(':') {
                let name = format!("{prefix}{}", name.trim());
                let value = value.trim();
                if let Some((_, inside)) = value.split_once('{') {
                    fields(inside, &format!("{name}."), found);
                } else if value.starts_with(|c: char| c.is_ascii_digit() || c == '-') {
                    found(&name, value);
                }
            }
            start = at + 1;
        }
        if depth < 0 {
            return;
        }
    }
}

#[test]
fn the_table_of_constants_is_that_of_the_code() {
    let (table, code) = (in_the_table().0, in_the_code());
    assert!(code.len() > 100, "{}", code.len());
    for (place, value) in &code {
        assert_eq!(table.get(place), Some(value), "in the table for {place:?}");
    }
    for place in table.keys() {
        assert!(code.contains_key(place), "the code has no constant {place:?}");
    }
}

#[test]
fn every_constant_says_where_it_comes_from() {
    for origin in in_the_table().1 {
        let word = origin.split([':', ';', ' ']).next().unwrap();
        assert!(["derived", "fitted", "chosen"].contains(&word), "{origin}");
        assert!(origin.len() > word.len() + 8, "{origin} does not say from what, or why");
    }
}

/// The equations: the page of the model, and that of a camera's word.
fn model() -> String {
    let pages = ["docs/recogniser.md", "docs/camera-model.md"];
    pages.map(|page| std::fs::read_to_string(root().join(page)).unwrap()).concat()
}

/// A row of the table of operations: its equations, and its functions with their files.
struct Operation {
    equations: Vec<String>,
    functions: Vec<(PathBuf, String)>,
}

fn operations() -> Vec<Operation> {
    let text = model();
    let table = text.split("## Operations").nth(1).unwrap().split("\n## ").next().unwrap();
    let row = |line: &str| {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let [_, equations, code] = cells[..] else { panic!("a row of {} cells", cells.len()) };
        let mut file = PathBuf::new();
        let functions = code.split(", ").map(|place| {
            let (path, function) = place.trim_matches('`').split_once("::").unwrap();
            if !path.is_empty() {
                let is_ours = !path.contains("/src/");
                file = root().join(if is_ours { "recogniser/src" } else { "" }).join(path);
            }
            (file.clone(), function.to_owned())
        });
        let functions = functions.collect();
        Operation { equations: equations.split(", ").map(str::to_owned).collect(), functions }
    };
    table.lines().filter(|line| line.contains(".rs::")).map(row).collect()
}

#[test]
fn every_operation_is_in_the_code_with_its_equations() {
    let operations = operations();
    for (file, function) in operations.iter().flat_map(|operation| &operation.functions) {
        let text = std::fs::read_to_string(file).unwrap_or_default();
        let found = [format!("fn {function}("), format!("fn {function}<")];
        let is_there = found.iter().any(|form| text.contains(form));
        assert!(is_there, "{} has no function {function}", file.display());
    }
    let stated: Vec<&str> =
        operations.iter().flat_map(|row| &row.equations).map(String::as_str).collect();
    for part in model().split("(R").skip(1) {
        let Some((number, _)) = part.split_once(')') else { continue };
        let digits = number.trim_end_matches(|c: char| c.is_ascii_lowercase());
        let is_number = !digits.is_empty() && digits.chars().all(|c| c.is_ascii_digit());
        let is_stated = stated.contains(&format!("R{number}").as_str());
        assert!(!is_number || is_stated, "R{number} is in no row of the operations");
    }
}

#[test]
fn the_code_cites_equations_that_the_document_has() {
    let document = model();
    let mut cited = BTreeMap::new();
    for path in sources(&root().join("recogniser/src")) {
        let text = std::fs::read_to_string(&path).unwrap();
        for part in text.split("quation R").chain(text.split("quations R")).skip(1) {
            let number: String = part.chars().take_while(char::is_ascii_digit).collect();
            cited.insert(number, path.clone());
        }
    }
    assert!(cited.len() > 15, "{}", cited.len());
    for (number, path) in cited {
        let printed = document.contains(&format!("(R{number})"));
        let path = path.display();
        assert!(number.is_empty() || printed, "{path} cites R{number}, which is not printed");
    }
}
