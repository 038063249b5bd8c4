//! Palpate's networked service, as a library: start a [`Server`] with a [`Config`].
//!
//! A request comes in by `door` and goes through `telemetry` (id, log, figures), `headers`
//! (for browsers), `guard` (who may do what: `keys`, `roles`), `admission` (bounds), `audit`
//! and a route, which asks one of `sensors`, `objects`, `catalogues`, `jobs` and `sessions`;
//! `wire` converts, `compute` computes, `problem` turns every refusal into RFC 9457.

pub mod config;
pub mod headers;
pub mod intake;
pub mod openapi;
pub mod server;
pub mod tls;

mod admission;
mod app;
mod asker;
mod audit;
mod belief;
mod blocks;
mod budget;
mod calibrations;
mod catalogues;
mod checkpoints;
mod client;
mod clock;
mod compute;
mod dashboard;
mod door;
mod extract;
mod guard;
mod hints;
mod integrity;
mod jobs;
mod keys;
mod limits;
mod live;
mod objects;
mod problem;
mod rate;
mod refusal;
mod repeats;
mod roles;
mod routes;
mod sensors;
mod sessions;
mod snapshots;
mod storage;
mod telemetry;
mod training;
mod wire;

pub use config::{Access, Config};
pub use door::Patience;
pub use palpate_store::sled::FreeSpace;
pub use server::{Server, StartError};
