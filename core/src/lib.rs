//! The mathematics of recognising objects by touch: readings and catalogues in, beliefs out.
//!
//! Pure: no HTTP, no storage, no clock, no hidden randomness. The modules stand in the order
//! in which they may use each other. Source: Pezzementi (2011), chapters 2–5, with the
//! corrections in `docs/equations.md`.

pub mod units;

pub mod stop;

pub mod rng;

pub mod log_prob;

pub mod exponential;

pub mod pose;

pub mod rotation_grid;

pub mod sensor;

pub mod reading;

pub mod contact;

pub mod occupancy;

pub mod metric;

pub mod mosaic;

pub mod descriptor;

pub mod vocabulary;

pub mod patch;

pub mod patch_pair;

pub mod filter;

pub mod symmetry;

pub mod surface;

pub mod model;

pub mod belief;

pub mod train;

pub mod recognise;

pub mod surface;

pub mod next_touch;

pub mod geometric;

pub mod appearance;
