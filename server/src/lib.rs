//! Palpate's networked service, as a library: start a [`Server`] with a [`Config`].
//!
//! A request comes in by `door`, passes the layers of `middleware` and reaches a handler in
//! `routes`, which asks one of `services`; a session in memory is `live`. `wire` converts,
//! `compute` computes, `problem` turns every error into RFC 9457. The order of the lines `mod`
//! is the order in which modules may use each other: `tests/whole/house.rs` enforces it.

mod clock;
mod derived;
mod figures;
mod process;
mod program;
mod etag;
mod secret;
mod limits;
mod client;
mod budget;
mod door;
mod certificate;
pub mod tls;
pub mod config;
mod asker;
mod compute;
mod dashboard;
mod roles;
mod hints;
mod model;
mod wire;
mod known_sensors;
mod cause;
mod repeats;
mod notices;
mod outgoing;
mod live;
mod services;
mod refusal;
mod admission;
mod rate;
mod problem;
mod app;
mod hearing;
mod middleware;
mod extract;
pub mod intake;
pub mod outbox;
mod routes;
pub mod openapi;
mod router;
pub mod server;

#[doc(hidden)]
pub use clock::set_ahead as set_clock_ahead;
pub use config::{Access, Config, Forward};
pub use door::Patience;
pub use outbox::{Outbox, OutboxError};
pub use palpate_store::nats::NatsOptions;
pub use palpate_store::sled::FreeSpace;
pub use secret::{ChosenKey, ChosenKeyError};
pub use server::{Server, StartError, check};
