//! Tests of beliefs on analytic objects; one program, so that their model is trained once.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

mod calibration;
mod contacts;
mod ellipsoids;
mod golden_beliefs;
mod image_doubt;
mod looseness;
mod misfit;
mod motion;
mod near;
mod pose_prior;
mod recalibration;
mod surface;
