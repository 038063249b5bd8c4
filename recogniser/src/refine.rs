//! Refinement: continuous improvement of poses on the surface, and merging of equal ones.

pub(crate) mod likeness;
pub(crate) mod merge;
pub(crate) mod surface_point;
pub(crate) mod gauss_newton;
pub(crate) mod settle;
