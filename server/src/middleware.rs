//! The layers that a request passes on its way to a route, one concern per file. Their state
//! between requests is in `app`.

pub(crate) mod telemetry;

pub(crate) mod headers;
pub(crate) mod once;

pub(crate) mod query;

pub(crate) mod caller;

pub(crate) mod admission;
pub(crate) mod audit;
pub(crate) mod guard;
pub(crate) mod rate;
