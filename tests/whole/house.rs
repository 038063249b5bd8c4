//! Architecture rules: dependencies between crates, order of modules, place of conversions, budgets
//! of lines, and a purpose comment in every source file.

#[path = "house/budget.rs"]
mod budget;
#[path = "house/imports.rs"]
mod imports;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::root;
use imports::{Import, circle, declared, imports, is_test, only_declares, product};

/// Layers of crates: a crate may use only crates of lower layers.
const STOREYS: [&[&str]; 8] = [
    &["palpate-core", "palpate-schemas"],
    &["palpate-dissertation", "palpate-recogniser"],
    &["palpate-sim", "palpate-store", "palpate-client"],
    &["palpate-migrations", "palpate-load", "palpate-commissioning"],
    &["palpate-server"],
    &["palpate-experiments"],
    &["palpate"],
    &["palpate-tests"],
];

/// Our crates that each crate may use; a crate not listed may use none.
const MAY_USE: &[(&str, &[&str])] = &[
    ("palpate-dissertation", &["palpate-core"]),
    ("palpate-recogniser", &["palpate-core"]),
    ("palpate-sim", &["palpate-core", "palpate-dissertation"]),
    ("palpate-store", &["palpate-core", "palpate-dissertation", "palpate-recogniser"]),
    ("palpate-client", &["palpate-schemas"]),
    ("palpate-migrations", &["palpate-store"]),
    ("palpate-commissioning", &["palpate-core", "palpate-sim"]),
    (
        "palpate-server",
        &[
            "palpate-core",
            "palpate-dissertation",
            "palpate-recogniser",
            "palpate-schemas",
            "palpate-sim",
            "palpate-commissioning",
            "palpate-store",
            "palpate-migrations",
        ],
    ),
    ("palpate-load", &["palpate-core", "palpate-schemas", "palpate-sim", "palpate-client"]),
    (
        "palpate-experiments",
        &[
            "palpate-core",
            "palpate-dissertation",
            "palpate-recogniser",
            "palpate-schemas",
            "palpate-sim",
            "palpate-commissioning",
            "palpate-client",
            "palpate-load",
            "palpate-server",
        ],
    ),
];

/// The mathematical crates, without time and I/O.
const MATHEMATICS: [&str; 4] = ["core", "dissertation", "recogniser", "commissioning"];

/// The crates whose modules use only those that `lib.rs` (`main.rs`) declares before them.
const CRATES: [&str; 13] = [
    "core",
    "dissertation",
    "recogniser",
    "schemas",
    "sim",
    "commissioning",
    "store",
    "client",
    "migrations",
    "server",
    "load",
    "experiments",
    "cli",
];

/// The longest name of a test, in characters.
const NAME_MAX: usize = 60;

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let is_foreign = |n: &std::ffi::OsStr| n == "target" || n == ".git" || n == "node_modules";
        let skipped = path.file_name().is_some_and(is_foreign);
        if path.is_dir() && !skipped {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found
}

#[test]
fn crates_use_only_lower_storeys() {
    let metadata = cargo_metadata::MetadataCommand::new().no_deps().exec().unwrap();
    let storey = |name: &str| STOREYS.iter().position(|crates| crates.contains(&name));
    let allowed: BTreeMap<&str, &[&str]> = MAY_USE.iter().copied().collect();
    for package in &metadata.packages {
        let own = storey(&package.name).unwrap_or_else(|| panic!("{} has no storey", package.name));
        for dependency in &package.dependencies {
            let Some(other) = storey(&dependency.name) else { continue };
            let (user, used) = (&package.name, &dependency.name);
            assert!(other < own, "{user} uses {used}, which is not below it");
            // The command and the tests stand on top and may use everything.
            let on_top = own >= 6 || dependency.kind == cargo_metadata::DependencyKind::Development;
            let named = allowed.get(user.as_str()).is_some_and(|a| a.contains(&used.as_str()));
            assert!(on_top || named, "{user} may not use {used}");
        }
    }
}

/// The folders of peers in a crate: its root, and every module that only declares modules.
fn peers(krate: &str) -> Vec<(PathBuf, String, Vec<String>)> {
    let folder = root().join(krate).join("src");
    let is_root = |name: &&str| folder.join(name).exists();
    let top = ["lib.rs", "main.rs"].into_iter().find(is_root).expect("a crate has a root");
    let modules = declared(&std::fs::read_to_string(folder.join(top)).unwrap());
    let mut found = Vec::new();
    for module in &modules {
        let text = std::fs::read_to_string(folder.join(format!("{module}.rs"))).unwrap();
        if only_declares(&text) {
            let prefix = format!("crate::{module}::");
            found.push((folder.join(module), prefix, declared(&text)));
        }
    }
    found.push((folder, "crate::".to_owned(), modules));
    found
}

#[test]
fn no_modules_use_each_other_in_a_circle() {
    for krate in CRATES {
        for (folder, prefix, modules) in peers(krate) {
            let circle = circle(&imports(&folder, &prefix, &modules), &modules);
            assert_eq!(circle, None, "{krate}: these modules of {prefix} form a circle");
        }
    }
}

#[test]
fn modules_use_only_those_that_are_declared_before_them() {
    for krate in CRATES {
        for (folder, prefix, modules) in peers(krate) {
            let place = |name: &str| modules.iter().position(|module| module == name);
            for Import { user, used, file } in imports(&folder, &prefix, &modules) {
                let is_earlier = place(&used) < place(&user);
                assert!(is_earlier, "{}: {user} uses {used}, declared later", file.display());
            }
        }
    }
}

/// The public types that the sources of a crate define.
fn types(krate: &str) -> BTreeSet<String> {
    let name = |line: &str| {
        let line = line.trim_start().strip_prefix("pub ")?;
        let line = line.strip_prefix("struct ").or(line.strip_prefix("enum "))?;
        Some(line.chars().take_while(|c| c.is_alphanumeric()).collect())
    };
    let files = sources(&root().join(krate).join("src"));
    let texts: Vec<String> =
        files.iter().map(|file| std::fs::read_to_string(file).unwrap()).collect();
    texts.iter().flat_map(|text| text.lines()).filter_map(name).collect()
}

#[test]
fn only_wire_converts_between_schemas_and_core_or_store() {
    let known: BTreeSet<String> =
        ["core", "dissertation", "recogniser", "store"].into_iter().flat_map(types).collect();
    let twins: Vec<String> = types("schemas").intersection(&known).cloned().collect();
    assert!(twins.len() > 10, "types of one name on the wire and below: {twins:?}");
    let folder = root().join("server/src");
    for file in sources(&folder) {
        if file.starts_with(folder.join("wire")) || is_test(&file) {
            continue;
        }
        let text = product(&std::fs::read_to_string(&file).unwrap());
        let converts = |line: &&str| {
            let from = line.trim_start().starts_with("impl") && line.contains("From<");
            let of_wire = line.contains("wire::") || line.contains("palpate_schemas");
            let built = twins.iter().any(|twin| line.contains(&format!("wire::{twin} {{")));
            (from && of_wire) || (built && !line.contains("->"))
        };
        let found: Vec<&str> = text.lines().filter(converts).collect();
        assert!(found.is_empty(), "{} converts: {found:?}", file.display());
    }
}

#[test]
fn every_source_file_opens_with_what_it_is_for() {
    for path in sources(&root()) {
        let text = std::fs::read_to_string(&path).unwrap();
        let first = text.lines().next().unwrap_or("");
        let says = first.starts_with("//! ") && first.len() > 12;
        assert!(says, "{} does not open with a sentence of what it is for", path.display());
    }
}

#[test]
fn names_of_tests_have_at_most_60_characters() {
    for path in sources(&root()) {
        let text = std::fs::read_to_string(&path).unwrap();
        for test in text.split("test]").skip(1) {
            let Some((_, name)) = test.split_once("fn ") else { continue };
            let name = name.split('(').next().unwrap_or_default();
            assert!(name.len() <= NAME_MAX, "{}: {name}", path.display());
        }
    }
}

#[test]
fn the_mathematics_does_no_io_and_knows_no_time() {
    for krate in MATHEMATICS {
        let manifest = std::fs::read_to_string(root().join(krate).join("Cargo.toml")).unwrap();
        let product = manifest.split("[dev-dependencies]").next().unwrap();
        for stranger in ["serde", "tokio", "axum", "sled", "reqwest", "jiff", "tracing"] {
            assert!(!product.contains(stranger), "{krate} depends on {stranger}");
        }
    }
    for krate in MATHEMATICS {
        for file in sources(&root().join(krate).join("src")) {
            let text = product(&std::fs::read_to_string(&file).unwrap());
            for stranger in
                ["std::fs", "std::env", "std::net", "std::time", "std::io", "std::process"]
            {
                assert!(!text.contains(stranger), "{} uses {stranger}", file.display());
            }
        }
    }
}

#[test]
fn the_recogniser_and_the_dissertation_do_not_know_each_other() {
    for (krate, other) in
        [("recogniser", "palpate-dissertation"), ("dissertation", "palpate-recogniser")]
    {
        let manifest = std::fs::read_to_string(root().join(krate).join("Cargo.toml")).unwrap();
        assert!(!manifest.contains(other), "{krate} depends on {other}");
    }
}
