//! The layers that a request passes on its way to a route, one concern a file. What they keep
//! between requests lives below `app`.

pub(crate) mod telemetry;

pub(crate) mod headers;

pub(crate) mod caller;

pub(crate) mod admission;
pub(crate) mod audit;
pub(crate) mod guard;
pub(crate) mod rate;
