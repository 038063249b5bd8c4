//! Tests of the command as a person or a script uses it, in one binary.
#![allow(clippy::unwrap_used, reason = "tests may panic, helpers outside of test functions too")]

mod fleet;
mod keys;
mod load;
mod sessions;
mod story;
mod supervised;
mod support;
mod webhooks;
