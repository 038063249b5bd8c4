//! Palpate's map database: the fleet's knowledge on disk, checked on every read.
//!
//! Bottom up: an [`engine::Engine`] holds ordered keys and small values and commits them
//! atomically and durably ([`sled`], [`memory`], [`nats`]); [`envelope`] and [`record`] define the
//! values; `pieces` splits large ones; [`table`], [`journal`], [`calibration`], [`sensor_day`], [`mesh`],
//! [`catalogue`], [`audit`] and [`webhook`] are the repositories that [`database::Database`] opens;
//! [`holding`] counts the bytes that each API key wrote; [`fsck`] checks a whole database,
//! [`snapshot`] copies one. `docs/formats.md` draws every
//! byte. Times are arguments, in milliseconds since 1970. Not here: HTTP, clocks, and
//! upgrades of old formats (`migrations`).

pub mod key;
pub mod engine;
pub mod envelope;
pub mod private;
mod descriptor_code;
pub mod model;
pub mod model_codec;
pub mod error;
pub mod record;
pub mod entity;
mod pieces;
pub mod holding;
mod amended;
pub mod memory;
pub mod sled;
pub mod nats;
pub mod robot;
pub mod table;
pub mod access;
pub mod webhook;
pub mod journal;
pub mod calibration;
pub mod sensor_day;
pub mod mesh;
pub mod audit;
pub mod catalogue;
pub mod running;
pub mod database;
pub mod fsck;
pub mod snapshot;
