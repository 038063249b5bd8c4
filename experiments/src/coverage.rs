//! Coverage of objects by touches: pictures of the touched places, and touches along each axis.
//!
//! A press controller that pushes thin parts through the sensor leaves them without a touch, and
//! recognition then fails for no visible reason; the pictures show it. Only axes along which the
//! object is long count: a touch lies inside the surface by the covering's indentation, so the
//! outer tenths of a thin rod's width stay empty however it is touched.

use glam::DVec3;
use palpate_core::reading::Reading;
use palpate_core::units::DEG;
use palpate_sim::render::{View, mesh_png};
use serde::Serialize;

use crate::objects::TestObject;
use crate::report::Report;

/// Slices of an object along each axis.
const N_SLICES: usize = 10;

/// An axis counts when the object's extent along it is at least this share of its largest.
const LONG_SHARE: f64 = 0.5;

#[derive(Serialize)]
struct Fewest {
    touches: usize,
    fewest_touches_in_a_tenth_along_x: Option<usize>,
    fewest_touches_in_a_tenth_along_y: Option<usize>,
    fewest_touches_in_a_tenth_along_z: Option<usize>,
}

/// Draws two pictures of each object with its touches, and adds a row with the lowest number of
/// touches in any tenth along its long axes; the summary gets the lowest number over all
/// objects.
pub fn pictures(
    report: &mut Report,
    objects: &[TestObject],
    readings: &[Vec<Reading>],
) -> Vec<(String, Vec<u8>)> {
    let mut pictures = Vec::new();
    let mut fewest = usize::MAX;
    for (object, readings) in objects.iter().zip(readings) {
        let touches: Vec<DVec3> =
            readings.iter().map(|reading| reading.session_from_sensor().translation).collect();
        let long = LONG_SHARE * object.mesh.largest_dimension();
        let per_axis = [0, 1, 2].map(|axis| {
            let is_long = object.mesh.extent()[axis] >= long;
            is_long.then(|| fewest_in_a_slice(object, &touches, axis))
        });
        fewest = per_axis.into_iter().flatten().fold(fewest, usize::min);
        report.labelled(
            &[("object", &object.name)],
            Fewest {
                touches: touches.len(),
                fewest_touches_in_a_tenth_along_x: per_axis[0],
                fewest_touches_in_a_tenth_along_y: per_axis[1],
                fewest_touches_in_a_tenth_along_z: per_axis[2],
            },
        );
        for (side, azimuth) in [("front", -35.0), ("back", 145.0)] {
            let view = View::from_angles(azimuth * DEG, 25.0 * DEG);
            let picture = mesh_png(&object.mesh, view, 400, &touches);
            pictures.push((format!("coverage-{}-{side}.png", object.name), picture));
        }
    }
    report.summarise("fewest_touches_in_a_tenth", fewest as f64);
    pictures
}

fn fewest_in_a_slice(object: &TestObject, touches: &[DVec3], axis: usize) -> usize {
    let (low, high) = object.mesh.bounds();
    let mut counts = [0usize; N_SLICES];
    for touch in touches {
        let share = (touch[axis] - low[axis]) / (high[axis] - low[axis]);
        let slice = (share * N_SLICES as f64).clamp(0.0, N_SLICES as f64 - 1.0);
        counts[slice as usize] += 1;
    }
    counts.into_iter().min().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use palpate_sim::shapes;

    use super::*;

    #[test]
    fn a_slice_without_a_touch_is_seen() {
        let mesh = shapes::example("screwdriver").unwrap();
        let object = TestObject { name: "screwdriver".to_owned(), mesh };
        let (low, high) = object.mesh.bounds();
        let along = |n: usize| (0..n).map(|k| low + (high - low) * ((k as f64 + 0.5) / 10.0));
        let all: Vec<DVec3> = along(10).collect();
        let half: Vec<DVec3> = along(5).collect();
        assert_eq!(fewest_in_a_slice(&object, &all, 2), 1);
        assert_eq!(fewest_in_a_slice(&object, &half, 2), 0);
    }
}
