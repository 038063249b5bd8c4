//! The layer above all formats: polygons of a file become the triangles of one body.
//!
//! Vertices that no polygon uses are no part of the body, vertices at one place are one, polygons
//! that came twice are one, and polygons are cut into triangles in their own plane.

use glam::DVec3;

use super::cut::cut;
use super::polygons::Polygons;
use super::weld::weld;
use super::{MeshError, MeshRemark};

/// Work for cutting the polygons of one file: tests of a corner against another. About a second.
const STEPS_MAX: u64 = 1_000_000_000;
/// Rounding of single precision, as a share of a number.
const SINGLE: f64 = 1.0 / 16_777_216.0;
/// Share of the extent above which rounding spoils a shape. Chosen: 0.1 mm of a hammer.
const ROUNDING_MAX: f64 = 1e-3;

/// Vertices in metres, triangles, and what is remarkable about them.
pub(super) type Body = (Vec<DVec3>, Vec<[u32; 3]>, Vec<MeshRemark>);

/// The body of a file's polygons, with `unit` metres in one unit of the file.
pub(super) fn assemble(mut polygons: Polygons, unit: f64) -> Result<Body, MeshError> {
    weld(&mut polygons)?;
    let mut remarks = Vec::new();
    let places = &polygons.vertices;
    let low = places.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = places.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let extent = (high - low).max_element();
    remarks.extend(far(places, low.abs().max(high.abs()).max_element(), extent, unit));
    let repeated = repeated(&polygons);
    let mut triangles = Vec::with_capacity(polygons.len());
    let mut corners = Vec::new();
    let (mut n_crossing, mut steps) = (0, STEPS_MAX);
    for polygon in 0..polygons.len() {
        if repeated.binary_search(&(polygon as u32)).is_ok() {
            continue;
        }
        let mut numbers = polygons.get(polygon).to_vec();
        numbers.dedup();
        if numbers.len() > 1 && numbers.first() == numbers.last() {
            numbers.pop();
        }
        if numbers.len() < 3 {
            continue;
        }
        corners.clear();
        corners.extend(numbers.iter().map(|corner| places[*corner as usize]));
        // Twice what a mesh drops as a triangle without area.
        let whole = cut(&corners, 2e-15 * extent * extent, &mut steps, |triangle| {
            triangles.push(triangle.map(|corner| numbers[corner]));
        });
        n_crossing += usize::from(!whole);
    }
    if !repeated.is_empty() {
        remarks.push(MeshRemark::Repeated { n: repeated.len() });
    }
    if n_crossing > 0 {
        remarks.push(MeshRemark::Crossing { n: n_crossing });
    }
    let mut vertices = polygons.vertices;
    vertices.iter_mut().for_each(|place| *place *= unit);
    Ok((vertices, triangles, remarks))
}

/// Whether the coordinates' rounding is large beside the body.
///
/// Numbers that all fit single precision have probably been through it.
fn far(places: &[DVec3], largest: f64, extent: f64, unit: f64) -> Option<MeshRemark> {
    #[expect(clippy::float_cmp, reason = "a number is exact in single precision or not")]
    let is_single = |number: f64| f64::from(number as f32) == number;
    if largest * SINGLE <= ROUNDING_MAX * extent {
        return None;
    }
    let single = places.iter().all(|place| place.to_array().into_iter().all(is_single));
    let share = if single { SINGLE } else { f64::EPSILON / 2.0 };
    let rounding = largest * share;
    (rounding > ROUNDING_MAX * extent)
        .then_some(MeshRemark::Far { distance: largest * unit, rounding: rounding * unit })
}

/// Polygons with the corners of an earlier one in the same order, ascending.
fn repeated(polygons: &Polygons) -> Vec<u32> {
    let mut order: Vec<(u64, u32)> =
        (0..polygons.len()).map(|polygon| (hash(polygons.get(polygon)), polygon as u32)).collect();
    order.sort_unstable();
    let is_repeated = |pair: &&[(u64, u32)]| {
        let [(first, a), (second, b)] = [pair[0], pair[1]];
        let [a, b] = [a, b].map(|polygon| polygons.get(polygon as usize));
        first == second && a.len() == b.len() && from_lowest(a).eq(from_lowest(b))
    };
    let mut found: Vec<u32> = order.windows(2).filter(is_repeated).map(|pair| pair[1].1).collect();
    found.sort_unstable();
    found
}

/// The corners, beginning with the lowest.
fn from_lowest(corners: &[u32]) -> impl Iterator<Item = u32> {
    let lowest = (0..corners.len()).min_by_key(|at| corners[*at]).unwrap_or_default();
    corners[lowest..].iter().chain(&corners[..lowest]).copied()
}

fn hash(corners: &[u32]) -> u64 {
    from_lowest(corners).fold(0, |hash: u64, corner| {
        (hash.rotate_left(5) ^ u64::from(corner)).wrapping_mul(0x517c_c1b7_2722_0a95)
    })
}
