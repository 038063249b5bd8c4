//! What a reader finds in a file: vertices in the file's unit, and polygons of any number of corners.

use glam::DVec3;

use super::{MeshError, TRIANGLES_MAX, VERTICES_MAX};

/// Vertices and polygons; the corners of an object count from that object's first vertex.
#[derive(Debug, Default)]
pub(super) struct Polygons {
    pub(super) vertices: Vec<DVec3>,
    corners: Vec<u32>,
    ends: Vec<u32>,
    /// The first vertex and the first polygon of the object that is being read.
    object: (usize, usize),
    n_triangles: usize,
}

impl Polygons {
    /// Adds a vertex.
    pub(super) fn vertex(&mut self, place: DVec3) -> Result<(), MeshError> {
        check_count("vertices", self.vertices.len() + 1, VERTICES_MAX)?;
        self.vertices.push(place);
        Ok(())
    }

    /// Adds a polygon of the current object; fewer than three corners add nothing.
    pub(super) fn polygon(&mut self, corners: &[u32]) -> Result<(), MeshError> {
        if corners.len() < 3 {
            return Ok(());
        }
        self.n_triangles += corners.len() - 2;
        check_count("triangles", self.n_triangles, TRIANGLES_MAX)?;
        for corner in corners {
            if *corner as usize >= VERTICES_MAX {
                return Err(self.no_vertex(self.ends.len(), i64::from(*corner)));
            }
            self.corners.push(corner + self.object.0 as u32);
        }
        self.ends.push(self.corners.len() as u32);
        Ok(())
    }

    /// Ends an object: the next one's corners count from its own first vertex.
    pub(super) fn end_object(&mut self) -> Result<(), MeshError> {
        let (first_vertex, first_polygon) = self.object;
        for polygon in first_polygon..self.len() {
            let missing = |corner: &&u32| **corner as usize >= self.vertices.len();
            if let Some(found) = self.get(polygon).iter().find(missing) {
                let found = i64::from(*found) - first_vertex as i64;
                return Err(self.no_vertex(polygon, found));
            }
        }
        self.object = (self.vertices.len(), self.len());
        Ok(())
    }

    /// Number of vertices of the current object.
    pub(super) fn n_vertices(&self) -> usize {
        self.vertices.len() - self.object.0
    }

    /// Number of polygons.
    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    /// The corners of a polygon.
    pub(super) fn get(&self, polygon: usize) -> &[u32] {
        &self.corners[self.begin(polygon)..self.ends[polygon] as usize]
    }

    /// All corners.
    pub(super) fn corners_mut(&mut self) -> &mut [u32] {
        &mut self.corners
    }

    fn begin(&self, polygon: usize) -> usize {
        polygon.checked_sub(1).map_or(0, |before| self.ends[before] as usize)
    }

    /// The error of a polygon that names a vertex which does not exist.
    pub(super) fn no_vertex(&self, polygon: usize, found: i64) -> MeshError {
        let triangle = polygon - self.object.1;
        MeshError::Index { triangle, found, n_vertices: self.n_vertices() }
    }
}

/// Refuses a count before anything is allocated for it.
pub(super) fn check_count(what: &'static str, found: usize, max: usize) -> Result<(), MeshError> {
    if found > max { Err(MeshError::TooMany { what, found, max }) } else { Ok(()) }
}
