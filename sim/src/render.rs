//! Pictures for visual checks: a mesh with its touches, an arm, contact sheets, tactile images.
//!
//! Orthographic and shaded, without a graphics card. Output is PNG, 8-bit RGB.

mod arm;
mod canvas;
pub mod occupancy;

use glam::{DQuat, DVec3};
use palpate_core::units::DEG;

use crate::mesh::Mesh;
pub use arm::arm_png;
use canvas::{Canvas, pixels_of};

const BACKGROUND: [u8; 3] = [250, 250, 248];
const SURFACE: [f64; 3] = [176.0, 184.0, 196.0];
const TOUCH: [u8; 3] = [214, 62, 42];
/// Depth to which marks of touches show through the object, as a fraction of its largest
/// dimension: touches lie inside the surface by the covering's indentation.
const TOUCH_DEPTH: f64 = 0.05;

/// Pixels that the triangles of a picture may cover in all, counted once for each triangle. Chosen:
/// about 400 times the pixels of a small picture.
const PIXELS_MAX: f64 = 1e8;

/// Viewing direction of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// `camera_from_object`: the camera looks along its −z, y is up in the picture.
    pub rotation: DQuat,
}

impl View {
    /// A view from `elevation` above the x-y plane, the object turned by `azimuth` about z
    /// (radians).
    #[must_use]
    pub fn from_angles(azimuth: f64, elevation: f64) -> Self {
        let upright = DQuat::from_rotation_x(elevation - 90.0 * DEG);
        Self { rotation: upright * DQuat::from_rotation_z(azimuth) }
    }
}

impl Default for View {
    fn default() -> Self {
        Self::from_angles(-35.0 * DEG, 25.0 * DEG)
    }
}

/// A picture of `size` × `size` pixels of a mesh, with visible `points` (metres, in the
/// mesh's frame) marked.
#[must_use]
pub fn mesh_png(mesh: &Mesh, view: View, size: usize, points: &[DVec3]) -> Vec<u8> {
    drawn(mesh, view, size, points).to_png()
}

/// Name of the text in a small picture that states the extent of its mesh along x, y and z, metres.
pub const EXTENT: &str = "size_m";

/// A small picture of `size` × `size` pixels of a mesh, for lists: smooth edges, RGBA with a
/// transparent background, and the mesh's extent as text.
#[must_use]
pub fn thumbnail_png(mesh: &Mesh, size: usize) -> Vec<u8> {
    let (low, high) = mesh.bounds();
    let extent = (high - low).to_array().map(|side| format!("{side:.6}")).join(" ");
    drawn(mesh, View::default(), 2 * size, &[]).to_small_png((EXTENT, &extent))
}

fn drawn(mesh: &Mesh, view: View, size: usize, points: &[DVec3]) -> Canvas {
    let mut canvas = Canvas::new(size, size, BACKGROUND);
    let (low, high) = mesh.bounds();
    let center = 0.5 * (low + high);
    let scale = 0.92 * size as f64 / (high - low).length();
    // Pixels: x to the right, y down, z towards the viewer.
    let in_picture = |point: DVec3| {
        let seen = view.rotation * (point - center) * scale;
        DVec3::new(0.5 * size as f64 + seen.x, 0.5 * size as f64 - seen.y, seen.z)
    };
    let n_triangles = mesh.triangles().len();
    let seen = |triangle: usize| mesh.corners(triangle).map(in_picture);
    let pixels: f64 = (0..n_triangles).map(|triangle| pixels_of(&seen(triangle))).sum();
    for triangle in (0..n_triangles).step_by(step(pixels)) {
        let normal = view.rotation * mesh.normal(triangle);
        canvas.add_triangle(&seen(triangle), shade(normal, SURFACE));
    }
    let through = TOUCH_DEPTH * mesh.largest_dimension() * scale;
    for point in points {
        canvas.add_dot(in_picture(*point), through, (size as f64 / 220.0).max(1.0), TOUCH);
    }
    canvas
}

/// 1 if all triangles are drawn, 2 if every second one is, and so on: only meshes of long slivers, or
/// of many large triangles, cover too many `pixels`.
fn step(pixels: f64) -> usize {
    (pixels / PIXELS_MAX).ceil().max(1.0) as usize
}

/// Light from above the viewer's left shoulder; back faces are as bright as front faces.
fn shade(normal: DVec3, color: [f64; 3]) -> [u8; 3] {
    let facing = if normal.z < 0.0 { -normal } else { normal };
    let key = facing.dot(DVec3::new(-0.45, 0.6, 0.66)).max(0.0);
    let fill = facing.dot(DVec3::new(0.8, -0.1, 0.6)).max(0.0);
    let brightness = 0.22 + 0.72 * key + 0.18 * fill;
    color.map(|channel| (channel * brightness * 1.25).clamp(0.0, 255.0) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::tests_support::sphere;

    fn size_of(png: &[u8]) -> (u32, u32) {
        let reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        (reader.info().width, reader.info().height)
    }

    #[test]
    fn pictures_have_the_requested_size() {
        let ball = sphere(0.03, 24);
        assert_eq!(size_of(&mesh_png(&ball, View::default(), 64, &[])), (64, 64));
    }

    #[test]
    fn a_touch_is_marked_in_front_and_hidden_behind() {
        let ball = sphere(0.03, 24);
        let has_mark = |point: DVec3| {
            let view = View { rotation: DQuat::IDENTITY };
            drawn(&ball, view, 64, &[point]).count(TOUCH) > 0
        };
        assert!(has_mark(0.029 * DVec3::Z));
        assert!(!has_mark(-0.029 * DVec3::Z));
    }

    #[test]
    fn of_too_many_large_triangles_only_some_are_drawn() {
        let view = View::default();
        let towards_viewer = view.rotation.inverse() * DVec3::Z;
        // The second triangle is tilted, in front of all others.
        let mesh = |n: u32| {
            let corner = |at: u32| {
                let own = [DVec3::ZERO, DVec3::X, DVec3::Z][at as usize % 3];
                own + towards_viewer * [0.0, 0.1 * f64::from(1 + at % 3)][usize::from(at / 3 == 1)]
            };
            let triangles = (0..n).map(|at| [3 * at, 3 * at + 1, 3 * at + 2]).collect();
            Mesh::new((0..3 * n).map(corner).collect(), triangles).unwrap()
        };
        let shows_second = |n: u32| {
            let (mesh, normal) = (mesh(n), mesh(2).normal(1));
            drawn(&mesh, view, 512, &[]).count(shade(view.rotation * normal, SURFACE)) > 0
        };
        assert!(shows_second(2));
        assert!(!shows_second(4_000));
        assert_eq!([0.0, PIXELS_MAX, 2.5 * PIXELS_MAX].map(step), [1, 1, 3]);
    }

    #[test]
    fn a_thumbnail_shows_the_object_on_a_transparent_ground() {
        let png = thumbnail_png(&sphere(0.03, 24), 64);
        let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (64, 64, png::ColorType::Rgba));
        let texts = &reader.info().uncompressed_latin1_text;
        let size = texts.iter().find(|text| text.keyword == EXTENT).unwrap();
        assert_eq!(size.text.split(' ').map(str::parse::<f64>).filter(Result::is_ok).count(), 3);
        let largest =
            size.text.split(' ').map(|text| text.parse::<f64>().unwrap()).fold(0.0, f64::max);
        assert!((largest - 0.06).abs() < 0.000_2, "a ball of 30 mm radius: {}", size.text);
        let (pixels, _) = pixels.as_chunks::<4>();
        let share = |fits: fn(u8) -> bool| {
            pixels.iter().filter(|pixel| fits(pixel[3])).count() as f64 / pixels.len() as f64
        };
        assert!((0.15..0.3).contains(&share(|alpha| alpha == 255)), "the object");
        assert!(share(|alpha| alpha == 0) > 0.2, "the ground");
        assert!(share(|alpha| alpha > 0 && alpha < 255) > 0.005, "smooth edges");
        assert_eq!((pixels[0][3], pixels[64 * 32 + 32][3]), (0, 255));
    }
}
