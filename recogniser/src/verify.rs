//! Verification: how well a pose explains what was felt, and what that is held against.
//!
//! [`mod@reference`] is the model written plainly, in double precision, without look-up; the other
//! modules are the same model made fast. [`check`] compares both.

pub mod check;
pub(crate) mod density;
#[cfg(test)]
mod density_tests;
pub(crate) mod evidence;
pub(crate) mod free_space;
pub(crate) mod hypothesis;
pub(crate) mod motion_prior;
pub(crate) mod null_model;
pub mod reference;
