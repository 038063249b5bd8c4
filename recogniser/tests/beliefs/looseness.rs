//! Presses by sensors whose passport says that their poses are loose. Analytic objects.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::options::SurfaceOptions;

use crate::ellipsoids::*;

/// Mean of −ln probability of the true object and of P("none of these") after eight touches that
/// are off by `noise` (m) along each axis and state a looseness.
fn losses(noise: f64, stated: f64) -> (f64, f64) {
    let sensor = six_by_six();
    let (mut loss, mut unknown, n) = (0.0, 0.0, 30);
    for index in 0..n {
        let object = index % N_OBJECTS;
        let mut stream = Stream::new(41, Purpose::Perturbation, index as u64);
        let options = SurfaceOptions::default();
        let mut belief = SurfaceBelief::new(Arc::clone(&MODEL), options, None).unwrap();
        for reading in touches(object, 8, 300 + index as u64) {
            let off = noise * DVec3::new(stream.normal(), stream.normal(), stream.normal());
            let moved = reading.moved_by(Pose::from_parts(DQuat::IDENTITY, off));
            belief.add(&moved.with_looseness(stated), &sensor);
        }
        loss -= belief.posterior()[object].max(1e-6).ln();
        unknown += belief.answer(1).unknown;
    }
    (loss / n as f64, unknown / n as f64)
}

#[test]
fn loose_touches_that_say_so_are_recognised_for_sure() {
    let (unstated, none_unstated) = losses(1.5 * MM, 0.0);
    let (stated, none_stated) = losses(1.5 * MM, 1.5 * MM);
    assert!(stated < 0.6 * unstated, "{stated} {unstated}");
    assert!(none_stated < 0.6 * none_unstated, "{none_stated} {none_unstated}");
}

#[test]
fn exact_touches_that_state_little_lose_little() {
    let (exact, _) = losses(0.0, 0.0);
    let (stated, _) = losses(0.0, 0.3 * MM);
    assert!((stated - exact).abs() < 0.02, "{stated} {exact}");
}
