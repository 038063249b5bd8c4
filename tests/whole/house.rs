//! The order of the house: which crate may use which, which module of `core` comes first,
//! and that every source file says why it exists.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The storeys of the house: a crate may use only crates of lower storeys.
const STOREYS: [&[&str]; 8] = [
    &["palpate-core", "palpate-schemas"],
    &["palpate-dissertation", "palpate-recogniser"],
    &["palpate-sim", "palpate-store", "palpate-client"],
    &["palpate-migrations", "palpate-load"],
    &["palpate-server"],
    &["palpate-experiments"],
    &["palpate"],
    &["palpate-tests"],
];

/// What each crate may use of ours; a crate not named here may use nothing.
const MAY_USE: &[(&str, &[&str])] = &[
    ("palpate-dissertation", &["palpate-core"]),
    ("palpate-recogniser", &["palpate-core"]),
    ("palpate-sim", &["palpate-core", "palpate-dissertation"]),
    ("palpate-store", &["palpate-core", "palpate-dissertation", "palpate-recogniser"]),
    ("palpate-client", &["palpate-schemas"]),
    ("palpate-migrations", &["palpate-store"]),
    (
        "palpate-server",
        &[
            "palpate-core",
            "palpate-dissertation",
            "palpate-recogniser",
            "palpate-schemas",
            "palpate-sim",
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
            "palpate-client",
            "palpate-load",
            "palpate-server",
        ],
    ),
];

/// The crates of mathematics: no time, no I/O, and modules in the order of `lib.rs`.
const MATHEMATICS: [&str; 3] = ["core", "dissertation", "recogniser"];

/// The modules of a crate in the order of its `lib.rs`.
fn order(krate: &str) -> Vec<String> {
    let text = std::fs::read_to_string(root().join(krate).join("src/lib.rs")).unwrap();
    let module = |line: &str| {
        let name = line.strip_prefix("pub mod ").or(line.strip_prefix("mod "))?;
        Some(name.strip_suffix(';')?.to_owned())
    };
    text.lines().filter_map(module).collect()
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

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

#[test]
fn modules_of_the_mathematics_use_only_earlier_ones() {
    for krate in MATHEMATICS {
        let order = order(krate);
        let place = |name: &str| order.iter().position(|module| module == name);
        let folder = root().join(krate).join("src");
        for path in sources(&folder) {
            let relative = path.strip_prefix(&folder).unwrap();
            let first = relative.components().next().unwrap().as_os_str().to_string_lossy();
            let module = first.trim_end_matches(".rs").to_owned();
            if module == "lib" {
                continue;
            }
            let own = place(&module).unwrap_or_else(|| panic!("{module} is not in lib.rs"));
            let text = std::fs::read_to_string(&path).unwrap();
            // Tests may use anything: they stand below everything they test.
            let product = text.split("#[cfg(test)]").next().unwrap();
            for used in product.split("crate::").skip(1) {
                let name: String =
                    used.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                let other = place(&name).unwrap_or_else(|| panic!("{name} has no place"));
                assert!(other <= own, "{krate}: {} uses {name}", relative.display());
            }
        }
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
fn the_mathematics_does_no_io_and_knows_no_time() {
    for krate in MATHEMATICS {
        let manifest = std::fs::read_to_string(root().join(krate).join("Cargo.toml")).unwrap();
        let product = manifest.split("[dev-dependencies]").next().unwrap();
        for stranger in ["serde", "tokio", "axum", "sled", "reqwest", "jiff", "tracing"] {
            assert!(!product.contains(stranger), "{krate} depends on {stranger}");
        }
    }
}
