//! Files and folders that the pages name, against the repository: each exists.

use std::path::Path;

use crate::root;

/// Folders without files of the repository.
const FOREIGN: [&str; 4] = ["target", ".git", "node_modules", "__pycache__"];

/// All files below a folder, relative to the root, with a `/` before.
fn files(folder: &Path, found: &mut Vec<String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if path.is_dir() && !path.is_symlink() && !FOREIGN.contains(&&*name) {
            files(&path, found);
        } else if path.is_file() {
            found.push(format!("/{}", path.strip_prefix(root()).unwrap().display()));
        }
    }
}

/// The alternatives of a path with braces: `a/{b,c}.rs`.
fn alternatives(path: &str) -> Vec<String> {
    let Some((before, rest)) = path.split_once('{') else { return vec![path.to_owned()] };
    let Some((inside, after)) = rest.split_once('}') else { return vec![path.to_owned()] };
    inside.split(',').flat_map(|one| alternatives(&format!("{before}{one}{after}"))).collect()
}

/// Whether a name has a part that stands for another one: `NAME.json`, `src/…`, `*.rs`.
fn has_placeholder(name: &str) -> bool {
    let stands = |part: &str| part.len() > 1 && part.chars().all(|c| c.is_ascii_uppercase());
    name.contains(['…', '*', '$', '<']) || name.split(['/', '.']).any(stands)
}

#[test]
fn every_file_that_a_page_names_exists() {
    let mut known = Vec::new();
    files(&root(), &mut known);
    let is_folder = |name: &str| !name.is_empty() && root().join(name).is_dir();
    let (mut n, mut missing) = (0, Vec::new());
    let is_page = |file: &&String| file.ends_with(".md") && !file.ends_with("/CHANGELOG.md");
    for page in known.iter().filter(is_page) {
        let text = std::fs::read_to_string(root().join(&page[1..])).unwrap();
        let quoted = text.lines().flat_map(|line| line.split('`').skip(1).step_by(2));
        for quoted in quoted.filter(|quoted| !quoted.contains(' ')) {
            let name = quoted.split("::").next().unwrap_or_default().trim_end_matches('/');
            let is_path = name.split_once('/').is_some_and(|(top, _)| is_folder(top));
            if has_placeholder(name) || !(is_path || name.ends_with(".rs")) {
                continue;
            }
            n += 1;
            for name in alternatives(name) {
                let ends = [format!("/{name}"), format!("/{name}.rs")];
                let is_there = if is_path {
                    root().join(&name).exists() || known.contains(&ends[1])
                } else {
                    known.iter().any(|file| ends.iter().any(|end| file.ends_with(end)))
                };
                if !is_there {
                    missing.push(format!("{page}: {quoted}"));
                }
            }
        }
    }
    assert!(n > 500, "{n} names");
    assert!(missing.is_empty(), "{missing:#?}");
}
