//! Verification: scores of poses by the touches, and the null model with which they are compared.
//!
//! [`mod@reference`] is the direct form of the model in double precision without look-up; the
//! other modules are fast versions of it. [`check`] compares both.

pub mod check;
pub(crate) mod density;
#[cfg(test)]
mod density_tests;
pub(crate) mod evidence;
pub(crate) mod free_space;
pub(crate) mod gaussian;
pub(crate) mod hypothesis;
pub(crate) mod motion_prior;
pub(crate) mod null_model;
#[cfg(test)]
mod point_tests;
pub mod reference;
pub(crate) mod stated_prior;
pub(crate) mod tool_error;
