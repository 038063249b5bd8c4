//! The mathematics of recognising objects by touch: the ground that all recognisers share.
//!
//! Pure: no HTTP, no storage, no clock, no hidden randomness. The modules are listed in the
//! order in which they may use each other. Source: Pezzementi (2011), chapters 2–5, with the
//! corrections in `docs/equations.md`.

pub mod units;
pub mod stop;
pub mod rng;
pub mod log_prob;
pub mod exponential;
pub mod pose;
pub mod convention;
pub mod sensor;
pub mod reading;
pub mod contact;
pub mod object;
pub mod training;
pub mod metric;
pub mod descriptor;
pub mod vocabulary;
pub mod symmetry;
pub mod belief;
pub mod health;
pub mod plausible;
