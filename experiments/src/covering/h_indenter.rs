//! Table 2.1 and figure 2.8: an H-shaped indenter in the simulator against the elastic reference.
//!
//! The dissertation compares with its physical sensor; here the finite-element reference
//! stands in for it. Two spreads are compared: that of equation 2.5, which contains the bare
//! sensor's own spread that the reference does not have, and the Gaussian fitted to it. That
//! reference superposes the response to a point; a second one solves the contact.

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::sensor::point_spread::point_spread_of_covering;
use palpate_core::sensor::spread_fit::{cosine, pearson};
use palpate_core::units::{DEG, INCH, MM};
use palpate_sim::elastic::PointResponse;
use palpate_sim::elastic::covering::{ElasticCovering, ProfilePoint};
use palpate_sim::mesh::Mesh;
use palpate_sim::plot::grids::{Grid, grids_svg};
use palpate_sim::press::{CoveringConfig, Load, Physics, PressConfig, PressSimulator};
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
    cosine_solved: f64,
    pearson_solved: f64,
}

/// The images of one press.
struct Images {
    degrees: f64,
    thickness: f64,
    /// By superposition of the finite-element response.
    elastic: Vec<f64>,
    /// By the solved contact with an elastic layer on the rigid sensor.
    solved: Vec<f64>,
    /// By the simulator with the spread of equation 2.5.
    simulator: Vec<f64>,
    /// By the simulator with the spread fitted to the finite-element response.
    fitted: Vec<f64>,
}

impl Images {
    fn new(slab: &PointResponse, degrees: f64, thickness: f64) -> anyhow::Result<Self> {
        let published = point_spread_of_covering(thickness);
        let fitted = slab.gaussian().sigma * thickness / slab.n_layers() as f64;
        Ok(Self {
            degrees,
            thickness,
            elastic: elastic_image(slab, thickness, degrees),
            solved: solved_image(thickness, degrees)?,
            simulator: simulated_image(thickness, published, degrees)?,
            fitted: simulated_image(thickness, fitted, degrees)?,
        })
    }

    /// Adds the row of the table, and the cosines to the summary.
    fn report(&self, report: &mut Report) {
        let alike = Alike {
            degrees: self.degrees,
            cosine: cosine(&self.simulator, &self.elastic),
            pearson: pearson(&self.simulator, &self.elastic),
            cosine_fitted_spread: cosine(&self.fitted, &self.elastic),
            pearson_fitted_spread: pearson(&self.fitted, &self.elastic),
            cosine_solved: cosine(&self.simulator, &self.solved),
            pearson_solved: pearson(&self.simulator, &self.solved),
        };
        let key = match self.thickness {
            thin if (thin - COVERINGS[0]).abs() < 1e-9 => format!("{:.0}deg", self.degrees),
            thick => key_of(thick),
        };
        report.summarise(&format!("h_cosine_{key}"), alike.cosine);
        report.summarise(&format!("h_cosine_fitted_{key}"), alike.cosine_fitted_spread);
        report.summarise(&format!("h_cosine_solved_{key}"), alike.cosine_solved);
        let least = report.summary.get("h_cosine_min").copied().unwrap_or(1.0);
        report.summarise("h_cosine_min", least.min(alike.cosine));
        let least = report.summary.get("h_cosine_solved_min").copied().unwrap_or(1.0);
        report.summarise("h_cosine_solved_min", least.min(alike.cosine_solved));
        let labels = [("figure", "table 2.1"), ("covering", &key_of(self.thickness))];
        report.labelled(&labels, alike);
    }
}

/// Presses the H at every angle under the thinnest covering and upright under every covering, and
/// draws figure 2.8.
pub(super) fn table_2_1(slabs: &[PointResponse], report: &mut Report) -> anyhow::Result<String> {
    let slab = slabs.last().ok_or_else(|| anyhow::anyhow!("no elastic slab"))?;
    let at = |(degrees, thickness): (f64, f64)| Images::new(slab, degrees, thickness);
    let turned: Vec<Images> =
        ANGLES.map(|angle| (angle, COVERINGS[0])).into_iter().map(at).collect::<Result<_, _>>()?;
    let upright: Vec<Images> =
        COVERINGS[1..].iter().map(|thickness| at((0.0, *thickness))).collect::<Result<_, _>>()?;
    turned.iter().chain(&upright).for_each(|images| images.report(report));
    let grid = *sensor_under(COVERINGS[0], point_spread_of_covering(COVERINGS[0])).grid();
    let drawn = |all: &[&Images], title: &dyn Fn(&Images) -> String| {
        let row = |kind: &str, of: fn(&Images) -> &Vec<f64>| -> Vec<Grid> {
            let one = |images: &&Images| {
                Grid::scaled(&format!("{kind}, {}", title(images)), &grid, of(images))
            };
            all.iter().map(one).collect()
        };
        let mut rows = row("superposed", |images| &images.elastic);
        rows.extend(row("solved", |images| &images.solved));
        rows.extend(row("simulator", |images| &images.simulator));
        rows
    };
    let angles: Vec<&Images> = turned.iter().collect();
    let coverings: Vec<&Images> = turned.iter().take(1).chain(&upright).collect();
    let mut grids = drawn(&angles, &|images| format!("{:.0}°", images.degrees));
    grids.extend(drawn(&coverings, &|images| format!("{:.2} inch", images.thickness / INCH)));
    Ok(grids_svg(&grids, ANGLES.len()))
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
    let simulator = PressSimulator::new(h_mesh()?, sensor_under(thickness, spread));
    match simulator.press(pressed(thickness, degrees)).load {
        Load::Displacements(displacements) => Ok(displacements),
        Load::Pressures(_) => anyhow::bail!("expected a press of the point spread"),
    }
}

/// The pressures of a solved contact with equal taxels, without noise.
fn solved_image(thickness: f64, degrees: f64) -> anyhow::Result<Vec<f64>> {
    let sensor = sensor_under(thickness, point_spread_of_covering(thickness));
    let layer = CoveringConfig { gain_spread: 0.0, ..CoveringConfig::bonded_layer(&sensor) };
    let physics = Physics::ElasticCovering(layer);
    let config = PressConfig { physics, ..PressConfig::for_sensor(&sensor) };
    let simulator = PressSimulator::with_config(h_mesh()?, sensor, config);
    match simulator.press(pressed(thickness, degrees)).load {
        Load::Pressures(pressures) => Ok(pressures),
        Load::Displacements(_) => anyhow::bail!("expected a press of the elastic covering"),
    }
}

/// The pose of the sensor on the H: `object_from_sensor`.
fn pressed(thickness: f64, degrees: f64) -> Pose {
    let turn = Pose::from_parts(DQuat::from_rotation_z(-degrees * DEG), DVec3::ZERO);
    let look_down = DQuat::from_rotation_x(std::f64::consts::PI);
    turn * Pose::from_parts(look_down, DVec3::new(0.0, 0.0, -DEPTH * thickness))
}

/// The H as three boxes, its face at z = 0 towards +z.
pub(super) fn h_mesh() -> anyhow::Result<Mesh> {
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
        let right = cosine(&simulated, &solved_image(COVERINGS[0], 30.0).unwrap());
        let wrong = cosine(&simulated, &solved_image(COVERINGS[0], -30.0).unwrap());
        assert!(right > 0.9 && wrong < right - 0.05, "{right}, turned the wrong way {wrong}");
    }
}
