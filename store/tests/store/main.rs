//! Tests of the store in one binary: laws of the engines, repositories, bytes and crashes.
#![allow(clippy::unwrap_used, reason = "tests may panic, helpers outside of test functions too")]

mod access;
mod bytes;
mod calibrations;
mod cluster;
mod compaction;
mod content;
mod crash;
mod damage;
mod engines;
mod fsck;
mod holding;
mod keeping;
mod labels;
mod meshes;
mod nats;
mod removal;
mod repositories;
mod samples;
mod sensor_days;
mod sensors;
mod sharing;
mod snapshots;
mod webhooks;
