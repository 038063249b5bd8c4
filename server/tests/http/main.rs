//! Tests of the service over real HTTP; each starts a server on a free port with its own folder.

#![expect(clippy::unwrap_used, reason = "a test fails where it unwraps")]

mod appearance;
mod audit;
mod bad_input;
mod calibrated;
mod calibration;
mod checkpoints;
mod commissioning;
mod compute;
mod contacts;
mod coupling;
mod door;
mod fleet;
mod frames;
mod geometry;
mod harness;
mod headers;
mod history;
mod keeping;
mod keys;
mod knowledge;
mod leases;
mod limits;
mod matrix;
mod memory;
mod model_frame;
mod msgpack;
mod next_touches;
mod objects;
mod order;
mod recalibration;
mod removal;
mod rows;
mod sensor_health;
mod sessions;
mod sharing;
mod site;
mod storage;
mod symmetry;
mod tables;
mod tls;
mod training;
mod warnings;
mod who;
mod words;
