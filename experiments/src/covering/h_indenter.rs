//! Table 2.1: an H-shaped indenter in the simulator against the elastic reference.
//!
//! The dissertation compares with its physical sensor; here the finite-element reference
//! stands in for it. Two spreads are compared: that of equation 2.5, which contains the bare
//! sensor's own spread that the reference does not have, and the Gaussian fitted to it.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::sensor::point_spread::point_spread_of_covering;
use palpate_core::sensor::spread_fit::{cosine, pearson};
use palpate_core::units::{DEG, MM};
use palpate_sim::elastic::PointResponse;
use palpate_sim::elastic::covering::{ElasticCovering, ProfilePoint};
use palpate_sim::mesh::Mesh;
use palpate_sim::press::{Load, PressSimulator};
use serde::Serialize;

use super::point_spread::sensor_under;
use super::{COVERINGS, key_of};
use crate::report::Report;

/// Orientations of table 2.1, degrees.
const ANGLES: [f64; 4] = [0.0, 90.0, 30.0, 135.0];
/// Indentation of the H as a share of the covering's thickness.
const DEPTH: f64 = 0.5;
/// The bars of the H: middle and size along x and y. 8 mm wide, 10 mm high, strokes of 2 mm;
/// the dissertation does not give its own.
const BARS: [[f64; 4]; 3] = [
    [-3.0 * MM, 0.0, 2.0 * MM, 10.0 * MM],
    [3.0 * MM, 0.0, 2.0 * MM, 10.0 * MM],
    [0.0, 0.0, 4.0 * MM, 2.0 * MM],
];
/// Distance of the profile's points.
const STEP: f64 = 0.1 * MM;

#[derive(Serialize)]
struct Alike {
    degrees: f64,
    cosine: f64,
    pearson: f64,
    cosine_fitted_spread: f64,
    pearson_fitted_spread: f64,
}

/// Presses the H at every angle under the thinnest covering and upright under every covering.
pub(super) fn table_2_1(slabs: &[PointResponse], report: &mut Report) -> anyhow::Result<()> {
    let slab = slabs.last().ok_or_else(|| anyhow::anyhow!("no elastic slab"))?;
    let thinnest = ANGLES.map(|angle| (angle, COVERINGS[0]));
    let upright = COVERINGS[1..].iter().map(|thickness| (0.0, *thickness));
    let mut cosines = Vec::new();
    for (degrees, thickness) in thinnest.into_iter().chain(upright) {
        let reference = elastic_image(slab, thickness, degrees);
        let fitted = slab.gaussian().sigma * thickness / slab.n_layers() as f64;
        let published = simulated_image(thickness, point_spread_of_covering(thickness), degrees)?;
        let narrow = simulated_image(thickness, fitted, degrees)?;
        let similarity = cosine(&published, &reference);
        cosines.push(similarity);
        report.labelled(
            &[("figure", "table 2.1"), ("covering", &key_of(thickness))],
            Alike {
                degrees,
                cosine: similarity,
                pearson: pearson(&published, &reference),
                cosine_fitted_spread: cosine(&narrow, &reference),
                pearson_fitted_spread: pearson(&narrow, &reference),
            },
        );
        let key = match thickness {
            thin if (thin - COVERINGS[0]).abs() < 1e-9 => format!("{degrees:.0}deg"),
            thick => key_of(thick),
        };
        report.summarise(&format!("h_cosine_{key}"), similarity);
        report.summarise(&format!("h_cosine_fitted_{key}"), cosine(&narrow, &reference));
    }
    report.summarise("h_cosine_min", cosines.iter().copied().fold(1.0, f64::min));
    Ok(())
}

/// Maps a point of the H's face into the sensor frame, whose y axis is reversed because the
/// sensor faces the H.
fn in_sensor(degrees: f64, x: f64, y: f64) -> (f64, f64) {
    let turned = DQuat::from_rotation_z(degrees * DEG) * DVec3::new(x, y, 0.0);
    (turned.x, -turned.y)
}

fn elastic_image(slab: &PointResponse, thickness: f64, degrees: f64) -> Vec<f64> {
    let sensor = sensor_under(thickness, point_spread_of_covering(thickness));
    let covering = ElasticCovering::new(slab, thickness, sensor.grid().taxel_width);
    let volume = DEPTH * thickness * STEP * STEP;
    let mut profile = Vec::new();
    for [x, y, width, height] in BARS {
        let (n_x, n_y) = ((width / STEP).round() as i32, (height / STEP).round() as i32);
        for (u, v) in (0..n_y).flat_map(|v| (0..n_x).map(move |u| (u, v))) {
            let along = |index: i32, size: f64| (f64::from(index) + 0.5) * STEP - 0.5 * size;
            let at = in_sensor(degrees, x + along(u, width), y + along(v, height));
            profile.push(ProfilePoint { at, volume });
        }
    }
    covering.image(sensor.grid(), &profile)
}

fn simulated_image(thickness: f64, spread: f64, degrees: f64) -> anyhow::Result<Vec<f64>> {
    let turn = Pose::from_parts(DQuat::from_rotation_z(-degrees * DEG), DVec3::ZERO);
    let look_down = DQuat::from_rotation_x(std::f64::consts::PI);
    let pressed = Pose::from_parts(look_down, DVec3::new(0.0, 0.0, -DEPTH * thickness));
    let simulator = PressSimulator::new(h_mesh()?, sensor_under(thickness, spread));
    match simulator.press(turn * pressed).load {
        Load::Displacements(displacements) => Ok(displacements),
        Load::Pressures(_) => anyhow::bail!("expected a press of the point spread"),
    }
}

/// The H as three boxes, its face at z = 0 towards +z.
fn h_mesh() -> anyhow::Result<Mesh> {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for [x, y, width, height] in BARS {
        let first = vertices.len() as u32;
        for corner in 0..8u32 {
            let side = |bit: u32| f64::from(corner >> bit & 1) - 0.5;
            let z = if corner >> 2 & 1 == 1 { 0.0 } else { -8.0 * MM };
            vertices.push(DVec3::new(x + side(0) * width, y + side(1) * height, z));
        }
        let faces: [[u32; 4]; 6] =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        for [a, b, c, d] in faces.map(|face| face.map(|corner| corner + first)) {
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    Ok(Mesh::new(vertices, triangles)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_images_turn_the_same_way() {
        // A slanted H under the sharpest covering: an image that is turned the wrong way would
        // not correlate.
        use palpate_sim::elastic::{POISSON_RATIO, Slab, point_response};
        let slab = Slab { half_width: 16, n_layers: 4, poisson_ratio: POISSON_RATIO };
        let slab = point_response(&slab).unwrap();
        let sigma = slab.gaussian().sigma * COVERINGS[0] / 4.0;
        let simulated = simulated_image(COVERINGS[0], sigma, 30.0).unwrap();
        let right = cosine(&simulated, &elastic_image(&slab, COVERINGS[0], 30.0));
        let wrong = cosine(&simulated, &elastic_image(&slab, COVERINGS[0], -30.0));
        assert!(right > 0.97 && wrong < right - 0.05, "{right}, turned the wrong way {wrong}");
    }
}
