//! The services, one resource a file: they store, compute and answer in values of the wire.

pub(crate) mod audit;
pub(crate) mod calibrations;
pub(crate) mod sensor_health;
pub(crate) mod sensors;
pub(crate) mod keys;
pub(crate) mod storage;
pub(crate) mod thumbnails;
pub(crate) mod objects;
pub(crate) mod commissionings;
pub(crate) mod catalogues;
pub(crate) mod sessions;
pub(crate) mod recalibration;
pub(crate) mod shadow;
pub(crate) mod training;
pub(crate) mod jobs;
pub(crate) mod snapshots;
pub(crate) mod webhooks;
pub(crate) mod integrity;
