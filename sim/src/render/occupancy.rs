//! Pictures of occupancy maps: heat maps as PNG, clouds and surfaces as PLY.
//!
//! Colours run from blue (free) over grey (the prior, or log-odds 0) to red (occupied),
//! evenly in log-odds up to ±[`LOG_ODDS_FULL`]. Pictures have x to the right and y up;
//! lengths in PLY files are metres in the object frame.

use std::fmt::Write as _;

use glam::DVec3;
use palpate_dissertation::occupancy::OccupancyGrid;

use super::canvas::Canvas;
use crate::mesh::Mesh;
use crate::shapes::surface_nets;

/// The log-odds of full colour.
pub const LOG_ODDS_FULL: f64 = 6.0;

/// Free, undecided and occupied: equally light ends, a light neutral middle.
const COLORS: [[f64; 3]; 5] = [
    [33.0, 60.0, 140.0],
    [110.0, 160.0, 214.0],
    [236.0, 235.0, 232.0],
    [226.0, 132.0, 98.0],
    [150.0, 26.0, 34.0],
];

/// The colour of log-odds.
#[must_use]
pub fn color(log_odds: f64) -> [u8; 3] {
    let last = COLORS.len() - 1;
    let place = (log_odds / LOG_ODDS_FULL + 1.0).clamp(0.0, 2.0) * 0.5 * last as f64;
    let below = (place as usize).min(last - 1);
    let share = place - below as f64;
    std::array::from_fn(|channel| {
        let (a, b) = (COLORS[below][channel], COLORS[below + 1][channel]);
        (a + share * (b - a)).round() as u8
    })
}

/// A layer of a map as a PNG, each cell a square of `cell_pixels` (at least 1). `layer` counts
/// from the lowest z, 0 in a planar map; `None` when the map has no such layer.
#[must_use]
pub fn layer_png(map: &OccupancyGrid, layer: usize, cell_pixels: usize) -> Option<Vec<u8>> {
    let [x, y, z] = map.shape().n();
    if layer >= z {
        return None;
    }
    let side = cell_pixels.max(1);
    let mut canvas = Canvas::new(x * side, y * side, color(0.0));
    for (cell, log_odds) in map.log_odds()[layer * x * y..][..x * y].iter().enumerate() {
        let (col, row) = (cell % x, y - 1 - cell / x);
        canvas.fill(col * side, row * side, side, color(f64::from(*log_odds)));
    }
    Some(canvas.to_png())
}

/// The cells more likely occupied than `probability_min` as an ASCII PLY point cloud:
/// position, probability, colour.
#[must_use]
pub fn cloud_ply(map: &OccupancyGrid, probability_min: f64) -> Vec<u8> {
    let mut points = String::new();
    let mut n = 0;
    for (cell, log_odds) in map.log_odds().iter().enumerate() {
        let log_odds = f64::from(*log_odds);
        let probability = (1.0 + (-log_odds).exp()).recip();
        if probability > probability_min {
            let (at, [red, green, blue]) = (map.shape().center(cell), color(log_odds));
            let _ = writeln!(
                points,
                "{} {} {} {probability:.6} {red} {green} {blue}",
                at.x as f32, at.y as f32, at.z as f32
            );
            n += 1;
        }
    }
    let header = format!(
        "ply\nformat ascii 1.0\nelement vertex {n}\nproperty float x\nproperty float y\n\
         property float z\nproperty float probability\nproperty uchar red\n\
         property uchar green\nproperty uchar blue\nend_header\n"
    );
    (header + &points).into_bytes()
}

/// The surface at which a solid map's probability is `probability_min`, closed, normals
/// outward; `None` for a planar map and for one without cells above that probability.
///
/// The prior must not exceed that probability, or all surrounding space is occupied.
#[must_use]
pub fn surface(map: &OccupancyGrid, probability_min: f64) -> Option<Mesh> {
    let shape = map.shape();
    if shape.is_planar() || map.prior() > probability_min {
        return None;
    }
    // At a half, undecided space is free, by less than any evidence.
    let level = (probability_min / (1.0 - probability_min)).ln().max(1e-3);
    let field = |at: DVec3| level - map.log_odds_at(at);
    let [x, y, z] = shape.n().map(|n| n as f64);
    let (low, cell) = (shape.min() - 1.5 * shape.cell(), shape.cell());
    let high = low + (DVec3::new(x, y, z) + 3.0) * cell;
    let (vertices, triangles) = surface_nets::mesh(field, low, high, cell);
    Mesh::new(vertices, triangles).ok()
}

/// [`surface`] as an ASCII PLY file.
#[must_use]
pub fn surface_ply(map: &OccupancyGrid, probability_min: f64) -> Option<Vec<u8>> {
    let mesh = surface(map, probability_min)?;
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.vertices().len(),
        mesh.triangles().len()
    );
    for at in mesh.vertices() {
        let _ = writeln!(text, "{} {} {}", at.x as f32, at.y as f32, at.z as f32);
    }
    for [a, b, c] in mesh.triangles() {
        let _ = writeln!(text, "3 {a} {b} {c}");
    }
    Some(text.into_bytes())
}

#[cfg(test)]
mod tests {
    use palpate_dissertation::occupancy::GridShape;

    use super::*;
    use crate::mesh::MeshFormat;

    fn map(n: [usize; 3], log_odds: Vec<f32>) -> OccupancyGrid {
        let shape = GridShape::new(DVec3::splat(-1.0), 0.2, n).unwrap();
        OccupancyGrid::from_parts(shape, 0.5, log_odds).unwrap()
    }

    /// A ball of radius 0.7 m in a cube of 2 m.
    fn ball() -> OccupancyGrid {
        let shape = GridShape::new(DVec3::splat(-1.0), 0.2, [10; 3]).unwrap();
        let inside = |cell| (10.0 * (0.7 - shape.center(cell).length())) as f32;
        map([10; 3], (0..1_000).map(inside).collect())
    }

    #[test]
    fn colors_are_neutral_at_zero_and_full_at_the_ends() {
        assert_eq!(color(0.0), [236, 235, 232]);
        assert_eq!(color(-99.0), [33, 60, 140]);
        // Halfway between undecided and full.
        assert_eq!(color(3.0), [226, 132, 98]);
    }

    #[test]
    fn a_layer_has_y_up_and_x_to_the_right() {
        let png = layer_png(&map([2, 2, 1], vec![9.0, 0.0, 0.0, -9.0]), 0, 3).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels.len(), 6 * 6 * 3);
        // The first cell, occupied, is at the bottom left; the free one at the top right.
        assert_eq!(pixels[5 * 18..][..3], color(9.0));
        assert_eq!(pixels[15..18], color(-9.0));
        assert_eq!(layer_png(&map([1, 1, 2], vec![0.0; 2]), 2, 1), None);
    }

    #[test]
    fn a_cloud_holds_the_occupied_cells() {
        let text = String::from_utf8(cloud_ply(&map([3, 1, 1], vec![2.0, 0.0, -1.0]), 0.5));
        let text = text.unwrap();
        assert!(text.contains("element vertex 1\n"));
        // 1/(1 + e⁻²) = 0.880797.
        assert!(text.ends_with("end_header\n-0.9 -0.9 -1 0.880797 229 166 143\n"), "{text}");
    }

    #[test]
    fn the_surface_of_a_ball_is_closed_and_has_its_volume() {
        let bytes = surface_ply(&ball(), 0.5).unwrap();
        let mesh = Mesh::from_bytes(MeshFormat::Ply, &bytes, 1.0).unwrap();
        assert!(mesh.is_watertight());
        // 4/3 π 0.7³ = 1.4368; the chords of 0.2 m cells cut off a tenth.
        assert!((mesh.signed_volume() / 1.4368 - 1.0).abs() < 0.12, "{}", mesh.signed_volume());
        assert!(surface(&map([3, 1, 1], vec![2.0, 0.0, -1.0]), 0.5).is_none());
    }

    #[test]
    fn a_map_occupied_to_its_border_gives_a_closed_surface() {
        let mesh = surface(&map([2, 2, 2], vec![3.0; 8]), 0.5).unwrap();
        assert!(mesh.is_watertight() && mesh.signed_volume() > 0.0);
    }
}
