//! The dissertation's tables and figures, and our own: one file an experiment.
//!
//! Every experiment is a function of its arguments, which hold a seed, and gives a
//! [`report::Outcome`]; the program `palpate-experiments` writes it to files and [`record`]s its
//! figures. Poses, noise and readings of a trial come from streams that training never uses.

pub mod appearance_trials;
pub mod arguments;
pub mod consistency;
pub mod contact_rates;
pub mod controllers;
pub mod coverage;
pub mod covering;
pub mod covering_thickness;
pub mod descriptors;
pub mod disturbance;
pub mod experiment;
pub mod exploration;
pub mod explorations;
pub mod families;
pub mod letter_presses;
pub mod letters_appearance;
pub mod letters_geometric;
pub mod next_touch;
pub mod noise;
pub mod object_sessions;
pub mod object_trials;
pub mod objects;
pub mod other_physics;
mod own_server;
pub mod perturbation;
pub mod played;
pub mod ppf_peer;
pub mod real_frames;
pub mod record;
pub mod report;
pub mod resolution;
pub mod restart;
pub mod sensing;
pub mod server_throughput;
pub mod sim_to_real;
pub mod solid_geometry;
pub mod stated;
pub mod statistics;
pub mod surface_noise;
pub mod surface_objects;
pub mod surface_scale;
pub mod sva_objects;
pub mod symmetry;
pub mod thinning;
pub mod unknown;
