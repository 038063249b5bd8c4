//! Surface matching, the service's own recogniser: readings and surface maps in, beliefs out.
//!
//! The model is written down in `docs/recogniser.md`. Pure: no HTTP, no storage, no clock, no
//! randomness but a seed's. Not here: the dissertation's methods.

pub mod surface;

pub mod model;

pub mod train;

pub mod belief;

pub mod next_touch;
