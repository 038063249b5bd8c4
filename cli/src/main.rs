//! The `palpate` command line.
fn main() {}
