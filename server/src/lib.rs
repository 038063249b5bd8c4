//! Palpate's networked service, as a library: start a [`Server`] with a [`Config`].
//!
//! A request goes through `telemetry` (id, log, figures), `admission` (bounds) and a route,
//! which asks one of `sensors`, `objects`, `catalogues`, `jobs` and `sessions`; `wire`
//! converts, `compute` computes, `problem` turns every refusal into RFC 9457.
//! Not here: keys and who may do what; without them a server is for its own machine.

pub mod config;
pub mod openapi;
pub mod server;

mod admission;
mod app;
mod belief;
mod calibrations;
mod catalogues;
mod clock;
mod compute;
mod extract;
mod integrity;
mod jobs;
mod live;
mod objects;
mod problem;
mod refusal;
mod repeats;
mod routes;
mod sensors;
mod sessions;
mod snapshots;
mod telemetry;
mod training;
mod wire;

pub use config::Config;
pub use palpate_store::sled::FreeSpace;
pub use server::{Server, StartError};
