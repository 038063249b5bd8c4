//! Dependencies between the modules of a crate, read from their sources.

use std::path::{Path, PathBuf};

/// A module that uses another one, and the file where it does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Import {
    pub(crate) user: String,
    pub(crate) used: String,
    pub(crate) file: PathBuf,
}

/// The modules that a file declares, in the order in which it does.
pub(crate) fn declared(root: &str) -> Vec<String> {
    let module = |line: &str| {
        let line = line.trim_start_matches("pub(crate) ").trim_start_matches("pub ");
        Some(line.strip_prefix("mod ")?.strip_suffix(';')?.to_owned())
    };
    root.lines().filter_map(module).collect()
}

/// Whether a file declares modules and nothing else: they are a folder of peers.
pub(crate) fn only_declares(root: &str) -> bool {
    let is_plain = |line: &str| line.is_empty() || line.starts_with("//");
    let lines: Vec<&str> = root.lines().filter(|line| !is_plain(line)).collect();
    !lines.is_empty() && declared(root).len() == lines.len()
}

/// The imports between the modules of a folder, whose paths begin with `prefix` (`crate::`).
pub(crate) fn imports(folder: &Path, prefix: &str, modules: &[String]) -> Vec<Import> {
    let mut found = Vec::new();
    for user in modules {
        let inner = folder.join(user);
        let mut files = if inner.is_dir() { super::sources(&inner) } else { Vec::new() };
        files.push(folder.join(format!("{user}.rs")));
        for file in files.into_iter().filter(|file| !is_test(file)) {
            let Ok(text) = std::fs::read_to_string(&file) else { continue };
            let text = product(&text);
            let is_top = file.parent() == Some(folder);
            let beside = if is_top { heads(&text, "super::") } else { Vec::new() };
            for used in heads(&text, prefix).into_iter().chain(beside) {
                if used != *user && modules.contains(&used) {
                    found.push(Import { user: user.clone(), used, file: file.clone() });
                }
            }
        }
    }
    found
}

/// Whether a file holds tests alone.
pub(crate) fn is_test(file: &Path) -> bool {
    let is_named = |part: &std::ffi::OsStr| {
        let name = part.to_string_lossy();
        name.starts_with("test") || name.trim_end_matches(".rs").ends_with("_tests")
    };
    file.file_name().is_some_and(is_named)
        || file.parent().and_then(Path::file_name).is_some_and(is_named)
}

/// A source without its inline tests, comments and texts.
pub(crate) fn product(source: &str) -> String {
    let source = source.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    let lines = source.lines().map(|line| {
        let mut parts = line.split('"');
        let code: Vec<&str> = parts.by_ref().step_by(2).collect();
        let code = if line.contains('"') { code.join("\"\"") } else { line.to_owned() };
        code.split("//").next().unwrap_or_default().to_owned()
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// The first segments of the paths that begin with a prefix, also of those in braces.
fn heads(source: &str, prefix: &str) -> Vec<String> {
    let mut found = Vec::new();
    for path in source.split(prefix).skip(1) {
        match path.strip_prefix('{') {
            Some(braced) => found.extend(braced_heads(braced)),
            None => found.push(segment(path)),
        }
    }
    found
}

fn braced_heads(braced: &str) -> Vec<String> {
    let (mut depth, mut start, mut found) = (1, 0, Vec::new());
    for (at, character) in braced.char_indices() {
        match character {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        if depth == 0 || (depth == 1 && character == ',') {
            found.push(segment(braced[start..at].trim_start()));
            start = at + 1;
        }
        if depth == 0 {
            break;
        }
    }
    found
}

fn segment(path: &str) -> String {
    path.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}

/// A cycle among imports, as the modules on it; `None` when there is none.
pub(crate) fn circle(imports: &[Import], modules: &[String]) -> Option<Vec<String>> {
    let mut left: Vec<&String> = modules.iter().collect();
    loop {
        let is_bound = |module: &&String| {
            imports.iter().any(|import| import.user == **module && left.contains(&&import.used))
        };
        let bound: Vec<&String> = left.iter().copied().filter(is_bound).collect();
        if bound.is_empty() {
            return None;
        }
        if bound.len() == left.len() {
            return Some(left.into_iter().cloned().collect());
        }
        left = bound;
    }
}

#[test]
fn imports_are_found_also_in_braces_and_not_in_texts() {
    let source = "use crate::{a::{b, c}, d};\nlet x = crate::e::f(); // crate::g\n\"crate::h\"";
    assert_eq!(heads(&product(source), "crate::"), ["a", "d", "e"]);
    assert_eq!(declared("mod a;\npub(crate) mod b;\npub mod c;\nmod d {"), ["a", "b", "c"]);
    assert!(only_declares("//! Peers.\n\npub(crate) mod a;\n") && !only_declares("mod a;\nuse a;"));
}

#[test]
fn a_circle_is_told_from_a_chain() {
    let modules = ["a", "b", "c"].map(str::to_owned);
    let import = |user: &str, used: &str| {
        let (user, used) = (user.to_owned(), used.to_owned());
        Import { user, used, file: PathBuf::new() }
    };
    let chain = [import("a", "b"), import("b", "c")];
    assert_eq!(circle(&chain, &modules), None);
    let round = [import("a", "b"), import("b", "a"), import("a", "c")];
    assert_eq!(circle(&round, &modules), Some(vec!["a".to_owned(), "b".to_owned()]));
}
