//! Black-box tests of the whole, in one binary: what users see, and the order of the house.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

mod command;
mod corpora;
mod house;
mod load;
mod numbers;
mod serving;
#[cfg(feature = "otlp")]
mod spans;
mod torture;
