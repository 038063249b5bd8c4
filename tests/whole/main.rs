//! Black-box tests of the whole, in one binary: user-visible behaviour, and the order of the
//! crates.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

mod book;
mod command;
mod constants;
mod corpora;
mod fair;
mod house;
mod load;
mod numbers;
mod pages;
mod lists;
mod serving;
#[cfg(feature = "otlp")]
mod spans;
mod story;
mod stranger;
mod torture;

/// The repository's folder.
fn root() -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}
