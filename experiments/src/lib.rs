//! The dissertation's tables and figures, and our own: one file an experiment.
//!
//! Every experiment is a function of its arguments and a seed; it writes a [`report::Report`]
//! as JSON, CSV and SVG and one line of `docs/results.md`. Poses, noise and readings of a
//! trial come from streams that training never uses.

pub mod appearance_trials;
pub mod contact_rates;
pub mod controllers;
pub mod coverage;
pub mod covering;
pub mod exploration;
pub mod explorations;
pub mod letters_geometric;
pub mod object_trials;
pub mod objects;
pub mod perturbation;
pub mod plot;
pub mod report;
pub mod server_throughput;
pub mod statistics;
pub mod sva_objects;
