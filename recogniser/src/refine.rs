//! Refinement: poses are laid continuously onto the surface, and those that are one are merged.

pub(crate) mod likeness;
pub(crate) mod merge;
pub(crate) mod surface_point;
pub(crate) mod gauss_newton;
pub(crate) mod settle;
