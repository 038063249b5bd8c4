//! Budgets of product lines for each crate and each subject.
//!
//! A commit that needs more takes something out first, or raises the figure here and says why.

use super::imports::{is_test, product};
use super::sources;
use crate::root;

/// Largest number of product lines in a folder: lines with code, without tests. Chosen: as many as
/// there were, rounded up to 50.
const BUDGETS: &[(&str, usize)] = &[
    ("core/src", 8400),
    ("dissertation/src", 7150),
    ("recogniser/src", 9000),
    ("sim/src", 10_150),
    ("commissioning/src", 1500),
    ("schemas/src", 3400),
    ("store/src", 13_550),
    ("migrations/src", 300),
    ("server/src", 26_300),
    ("client/src", 1550),
    ("load/src", 1250),
    ("experiments/src", 15_150),
    ("cli/src", 8950),
    ("recogniser/src/belief", 3500),
    ("recogniser/src/model", 1450),
    ("recogniser/src/next_touch", 800),
    ("recogniser/src/observe", 750),
    ("recogniser/src/verify", 1300),
    ("server/src/compute", 550),
    ("server/src/door", 700),
    ("server/src/extract", 600),
    ("server/src/live", 2550),
    ("server/src/middleware", 750),
    ("server/src/openapi", 750),
    ("server/src/routes", 1700),
    ("server/src/services/catalogues", 1150),
    ("server/src/services/jobs", 1300),
    ("server/src/services/keys", 700),
    ("server/src/services/sessions", 2050),
    ("server/src/services/training", 1350),
    ("server/src/services/webhooks", 1400),
    ("server/src/wire", 4750),
    ("store/src/audit", 550),
    ("store/src/catalogue", 600),
    ("store/src/entity", 550),
    ("store/src/fsck", 750),
    ("store/src/journal", 600),
    ("store/src/model_codec", 1250),
    ("store/src/nats", 3150),
    ("store/src/sled", 2250),
    ("sim/src/explore", 700),
    ("sim/src/mesh", 2650),
    ("sim/src/press", 1500),
    ("sim/src/rig", 550),
    ("sim/src/shapes", 1250),
];

/// Files longer than this hold more than one concept, as one in ten may.
const LONG: usize = 350;
const SHARE_OF_LONG: usize = 10;

/// The number of lines with code in a folder and its module file, without tests.
fn product_lines(folder: &str) -> usize {
    let folder = root().join(folder);
    let mut files = if folder.is_dir() { sources(&folder) } else { Vec::new() };
    files.extend(Some(folder.with_extension("rs")).filter(|file| file.exists()));
    let files = files.into_iter().filter(|file| !is_test(file));
    let lines =
        |text: String| product(&text).lines().filter(|line| !line.trim().is_empty()).count();
    files.map(|file| lines(std::fs::read_to_string(file).unwrap())).sum()
}

#[test]
fn no_crate_and_no_subject_outgrows_its_budget() {
    let found = BUDGETS.iter().map(|(folder, budget)| (folder, product_lines(folder), budget));
    let over: Vec<_> = found.filter(|(_, found, budget)| found > budget).collect();
    assert!(over.is_empty(), "(folder, product lines, budget): {over:?}");
}

#[test]
fn at_most_one_source_file_in_ten_is_long() {
    let files = sources(&root());
    let length = |file: &std::path::PathBuf| std::fs::read_to_string(file).unwrap().lines().count();
    let long: Vec<_> = files.iter().filter(|file| length(file) > LONG).collect();
    assert!(SHARE_OF_LONG * long.len() <= files.len(), "{} files: {long:?}", long.len());
}
