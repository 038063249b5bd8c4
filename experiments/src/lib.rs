//! The dissertation's tables and figures, and our own, one file per experiment.
//!
//! Every experiment is a function of its arguments, which hold a seed, and returns a
//! [`report::Outcome`]; the program `palpate-experiments` writes it to files and [`record`]s its
//! figures. Poses, noise and readings of a trial come from streams that training never uses.

mod cpu_time;
pub mod lost_sessions;
pub mod disturbance;
pub mod letter_presses;
mod own_server;
pub mod report;
pub mod objects;
pub mod arguments;
pub mod families;
pub mod consistency;
pub mod coverage;
pub mod record;
pub mod sensing;
pub mod stated;
pub mod statistics;
pub mod played;
pub mod appearance_trials;
pub mod contact_rates;
pub mod controllers;
pub mod covering;
pub mod letters_geometric;
pub mod object_sessions;
pub mod server_throughput;
pub mod restart;
pub mod several_servers;
pub mod divided_servers;
pub mod next_touch;
pub mod object_trials;
pub mod finer_maps;
pub mod appearance_rules;
pub mod explorations;
pub mod explored_sessions;
pub mod explored_touches;
pub mod planner_trials;
pub mod covering_thickness;
pub mod descriptors;
pub mod exploration;
pub mod letters_appearance;
pub mod noise;
pub mod other_physics;
pub mod other_worlds;
pub mod commissioning;
pub mod perturbation;
pub mod ppf_peer;
pub mod real_contacts;
pub mod real_edges;
pub mod real_frames;
pub mod resolution;
pub mod sim_to_real;
pub mod solid_geometry;
pub mod surface_noise;
pub mod surface_objects;
pub mod surface_scale;
pub mod camera;
pub mod skins;
pub mod printed_sva;
pub mod sva_objects;
pub mod letters_sva;
pub mod geometric_elsewhere;
pub mod symmetry;
pub mod thinning;
pub mod unknown;
pub mod experiment;
