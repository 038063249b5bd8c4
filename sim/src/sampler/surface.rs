//! Random points of a surface: by area, or within a slice of the object.
//!
//! The object is cut into [`N_SLICES`] slices of equal thickness along each principal axis of
//! its surface. A slice through a thin neck has little area but counts like any other.

use glam::DVec3;
use nalgebra::{Matrix3, SymmetricEigen};
use palpate_core::rng::Stream;

use crate::mesh::Mesh;

/// Number of slices along each of the three axes.
pub(crate) const N_SLICES: usize = 16;

/// A point of the surface and the outward normal there, in the object's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The point, metres.
    pub point: DVec3,
    /// The outward normal, of length 1.
    pub normal: DVec3,
}

/// Tables for drawing points of a mesh's surface.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    corners: Vec<[DVec3; 3]>,
    whole: Table,
    slices: Vec<Table>,
    axes: [DVec3; 3],
    low: [f64; 3],
    width: [f64; 3],
}

/// Triangles and the running sum of their weights.
#[derive(Clone, Debug, Default)]
struct Table {
    triangles: Vec<u32>,
    sums: Vec<f64>,
}

impl Table {
    fn push(&mut self, triangle: u32, weight: f64) {
        self.triangles.push(triangle);
        self.sums.push(self.sums.last().copied().unwrap_or(0.0) + weight);
    }

    fn draw(&self, stream: &mut Stream) -> Option<u32> {
        let drawn = stream.uniform(0.0, *self.sums.last()?);
        let idx = self.sums.partition_point(|sum| *sum <= drawn);
        self.triangles.get(idx.min(self.triangles.len() - 1)).copied()
    }
}

impl Surface {
    pub(crate) fn new(mesh: &Mesh) -> Self {
        let corners: Vec<[DVec3; 3]> =
            (0..mesh.triangles().len()).map(|triangle| mesh.corners(triangle)).collect();
        let axes = principal_axes(mesh);
        let along = |axis: usize, point: DVec3| axes[axis].dot(point);
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for point in corners.as_flattened() {
            for axis in 0..3 {
                low[axis] = low[axis].min(along(axis, *point));
                high[axis] = high[axis].max(along(axis, *point));
            }
        }
        let width =
            std::array::from_fn(|axis| ((high[axis] - low[axis]) / N_SLICES as f64).max(1e-12));
        let whole = Table::default();
        let slices = vec![Table::default(); 3 * N_SLICES];
        let mut surface = Self { corners, whole, slices, axes, low, width };
        for triangle in 0..surface.corners.len() {
            surface.add(triangle, mesh.area(triangle));
        }
        surface
    }

    /// Adds a triangle to the whole and, by the area within each, to the slices it crosses.
    fn add(&mut self, triangle: usize, area: f64) {
        self.whole.push(triangle as u32, area);
        for axis in 0..3 {
            let places = self.corners[triangle].map(|corner| self.place(axis, corner));
            let first = slice_of(places.iter().copied().fold(f64::INFINITY, f64::min));
            let last = slice_of(places.iter().copied().fold(f64::NEG_INFINITY, f64::max));
            for slice in axis * N_SLICES + first..=axis * N_SLICES + last {
                let area_within = if first == last {
                    area
                } else {
                    fan_areas(&self.part_within(slice, triangle)).iter().sum()
                };
                if area_within > 0.0 {
                    self.slices[slice].push(triangle as u32, area_within);
                }
            }
        }
    }

    /// The convex polygon of a triangle's part within a slice.
    fn part_within(&self, slice: usize, triangle: usize) -> Vec<DVec3> {
        let axis = slice / N_SLICES;
        let start = (slice % N_SLICES) as f64;
        let from_start = cut(&self.corners[triangle], |point| self.place(axis, point) - start);
        cut(&from_start, |point| start + 1.0 - self.place(axis, point))
    }

    /// Coordinate of a point along an axis, in slices from the start of the first.
    fn place(&self, axis: usize, point: DVec3) -> f64 {
        (self.axes[axis].dot(point) - self.low[axis]) / self.width[axis]
    }

    /// The slice of each axis that contains a point.
    pub(crate) fn slices_at(&self, point: DVec3) -> [usize; 3] {
        std::array::from_fn(|axis| axis * N_SLICES + slice_of(self.place(axis, point)))
    }

    /// A point drawn uniformly from the surface, or from the part of it in `slice`.
    pub(crate) fn draw(&self, slice: Option<usize>, stream: &mut Stream) -> SurfacePoint {
        let sliced = slice.and_then(|slice| Some((slice, self.slices[slice].draw(stream)?)));
        let (triangle, polygon) = match sliced {
            Some((slice, triangle)) => (triangle, self.part_within(slice, triangle as usize)),
            None => {
                let triangle = self.whole.draw(stream).unwrap_or(0);
                (triangle, self.corners[triangle as usize].to_vec())
            }
        };
        let [a, b, c] = self.corners[triangle as usize];
        let normal = (b - a).cross(c - a).normalize_or(DVec3::Z);
        SurfacePoint { point: point_in(&polygon, stream), normal }
    }
}

/// The part of a convex polygon where `side` is not negative (Sutherland and Hodgman 1974).
fn cut(polygon: &[DVec3], side: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (idx, &point) in polygon.iter().enumerate() {
        let next = polygon[(idx + 1) % polygon.len()];
        let (here, there) = (side(point), side(next));
        if here >= 0.0 {
            kept.push(point);
        }
        if (here >= 0.0) != (there >= 0.0) {
            kept.push(point.lerp(next, here / (here - there)));
        }
    }
    kept
}

/// The areas of the triangles of a convex polygon's fan.
fn fan_areas(polygon: &[DVec3]) -> Vec<f64> {
    let area = |pair: &[DVec3]| 0.5 * (pair[0] - polygon[0]).cross(pair[1] - polygon[0]).length();
    polygon.get(1..).unwrap_or_default().windows(2).map(area).collect()
}

/// A point drawn uniformly from a convex polygon.
fn point_in(polygon: &[DVec3], stream: &mut Stream) -> DVec3 {
    let areas = fan_areas(polygon);
    let mut left = stream.uniform(0.0, areas.iter().sum());
    let triangle = areas.iter().position(|area| {
        left -= area;
        left < 0.0
    });
    let triangle = triangle.unwrap_or(areas.len() - 1);
    let (a, b, c) = (polygon[0], polygon[triangle + 1], polygon[triangle + 2]);
    let (u, v) = (stream.uniform(0.0, 1.0).sqrt(), stream.uniform(0.0, 1.0));
    a * (1.0 - u) + b * (u * (1.0 - v)) + c * (u * v)
}

fn slice_of(place: f64) -> usize {
    (place.max(0.0) as usize).min(N_SLICES - 1)
}

/// The principal axes of the surface's area.
fn principal_axes(mesh: &Mesh) -> [DVec3; 3] {
    let centroid = mesh.centroid();
    let mut moments = Matrix3::<f64>::zeros();
    for triangle in 0..mesh.triangles().len() {
        let middle = mesh.corners(triangle).iter().sum::<DVec3>() / 3.0 - centroid;
        let offset = nalgebra::Vector3::from(middle.to_array());
        moments += offset * offset.transpose() * mesh.area(triangle);
    }
    let eigen = SymmetricEigen::new(moments);
    std::array::from_fn(|axis| {
        let column = eigen.eigenvectors.column(axis);
        DVec3::new(column[0], column[1], column[2]).normalize_or(DVec3::AXES[axis])
    })
}

#[cfg(test)]
mod tests {
    use palpate_core::rng::Purpose;

    use super::*;
    use crate::mesh::tests_support::cuboid;

    #[test]
    fn points_of_a_box_lie_on_its_faces_with_their_normals() {
        let surface = Surface::new(&cuboid(DVec3::new(0.02, 0.04, 0.08)));
        let mut stream = Stream::new(1, Purpose::Sampling, 0);
        let mut on_ends = 0;
        for _ in 0..2000 {
            let place = surface.draw(None, &mut stream);
            let half = DVec3::new(0.01, 0.02, 0.04);
            let outermost = (place.point.abs() / half).max_element();
            assert!((outermost - 1.0).abs() < 1e-9);
            assert!(place.normal.dot(place.point) > 0.0);
            on_ends += usize::from(place.normal.z.abs() > 0.9);
        }
        // The ends have 2·8 of 2·(8 + 16 + 32) cm²: one in seven, 286 ± 16.
        assert!((220..350).contains(&on_ends), "{on_ends}");
    }

    #[test]
    fn points_of_a_slice_lie_in_it_even_on_long_triangles() {
        let surface = Surface::new(&cuboid(DVec3::new(0.02, 0.04, 0.08)));
        let mut stream = Stream::new(2, Purpose::Sampling, 0);
        for slice in 0..3 * N_SLICES {
            for _ in 0..20 {
                let place = surface.draw(Some(slice), &mut stream);
                let along = surface.place(slice / N_SLICES, place.point);
                let start = (slice % N_SLICES) as f64;
                assert!((start - 1e-9..=start + 1.0 + 1e-9).contains(&along), "{along}");
            }
        }
    }
}
