//! Figure 2.9: three objects under arrays as fine as the dissertation's sensor, a fingertip and a
//! Tekscan sensor.
//!
//! The wrench and the ship of the dissertation are not available: the pliers and the dragon of
//! the public benchmark, scaled to 15 mm, stand in their place.

use anyhow::Context as _;
use glam::{DMat3, DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::sensor::{SensorDescription, SensorParameters, TaxelGrid};
use palpate_core::units::MM;
use palpate_sim::mesh::Mesh;
use palpate_sim::plot::grids::{Grid, grids_svg};
use palpate_sim::press::{Load, PressSimulator};
use palpate_sim::shapes;

use super::h_indenter::h_mesh;

/// Rows, columns and name of the arrays, all about 12 × 16 mm.
const ARRAYS: [(usize, usize, &str); 3] =
    [(6, 8, "PPS, 6 × 8"), (14, 20, "fingertip, 14 × 20"), (26, 36, "Tekscan, 26 × 36")];
/// Width of the arrays, metres.
const WIDTH: f64 = 16.0 * MM;
/// Largest dimension of the objects in place of wrench and ship, metres.
const SIZE: f64 = 15.0 * MM;
/// Depth of the press as a share of the covering.
const DEPTH: f64 = 0.8;

/// The figure: a row for each object, a column for each array.
pub(super) fn figure_2_9() -> anyhow::Result<String> {
    let lying = |name: &str| -> anyhow::Result<Mesh> {
        let mesh = shapes::example(name).with_context(|| format!("no example {name}"))?;
        Ok(flat(&mesh.scaled_to_largest_dimension(SIZE)))
    };
    let objects = [("H", h_mesh()?), ("pliers", lying("pliers")?), ("dragon", lying("dragon")?)];
    let mut grids = Vec::new();
    for (name, mesh) in objects {
        for (rows, cols, array) in ARRAYS {
            let simulator = PressSimulator::new(mesh.clone(), array_of(rows, cols)?);
            let image = pressed(&simulator)?;
            let title = format!("{name}, {array}");
            grids.push(Grid::scaled(&title, simulator.sensor().grid(), &image));
        }
    }
    Ok(grids_svg(&grids, ARRAYS.len()))
}

/// An array without gains, whose point spread is one element, as printed.
fn array_of(rows: usize, cols: usize) -> anyhow::Result<SensorDescription> {
    let pitch = WIDTH / cols as f64;
    let grid = TaxelGrid { rows, cols, pitch, taxel_width: 0.9 * pitch };
    let parameters = SensorDescription::digitacts_6x8().parameters().clone();
    Ok(SensorDescription::new(SensorParameters { grid, point_spread: pitch, ..parameters })?)
}

/// The mesh turned so that its least extent is along z and its largest along x.
fn flat(mesh: &Mesh) -> Mesh {
    let extent = mesh.extent();
    let mut axes = [DVec3::X, DVec3::Y, DVec3::Z];
    axes.sort_by(|a, b| b.dot(extent).total_cmp(&a.dot(extent)));
    // Rows of the rotation; the last axis keeps the frame right-handed.
    let turned = DMat3::from_cols(axes[0], axes[1], axes[0].cross(axes[1])).transpose();
    let (low, high) = mesh.bounds();
    let middle = mesh.translated(-0.5 * (low + high));
    middle.moved_by(Pose::from_parts(DQuat::from_mat3(&turned), DVec3::ZERO))
}

/// The displacements of a press from straight above.
fn pressed(simulator: &PressSimulator) -> anyhow::Result<Vec<f64>> {
    let look_down = DQuat::from_rotation_x(std::f64::consts::PI);
    let above = Pose::from_parts(look_down, DVec3::new(0.0, 0.0, 2.0 * SIZE));
    let heights = simulator.heights(above, 3.0 * SIZE);
    anyhow::ensure!(heights.lowest().is_finite(), "the object is not under the array");
    let travel = heights.lowest() + DEPTH * simulator.sensor().parameters().covering_thickness;
    match simulator.press_at(&heights, travel).load {
        Load::Displacements(displacements) => Ok(displacements),
        Load::Pressures(_) => anyhow::bail!("expected a press of the point spread"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_objects_are_drawn_under_three_arrays() {
        let drawn = figure_2_9().unwrap();
        // Cells of all arrays for each object, and the background.
        let cells = 6 * 8 + 14 * 20 + 26 * 36;
        assert_eq!(drawn.matches("<rect ").count(), 3 * cells + 1);
        assert!(drawn.contains("dragon, Tekscan, 26 × 36"));
    }

    #[test]
    fn a_lying_object_is_least_high_and_widest_along_x() {
        let extent = flat(&shapes::example("hammer").unwrap()).extent();
        assert!(extent.x >= extent.y && extent.y >= extent.z, "{extent}");
    }
}
