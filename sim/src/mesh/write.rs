//! Writes a mesh as OFF or STL, in metres.

use std::fmt::Write as _;

use super::Mesh;

impl Mesh {
    /// The mesh as an ASCII OFF file in metres, exact to the last bit.
    #[must_use]
    pub fn to_off_bytes(&self) -> Vec<u8> {
        let mut text = format!("OFF\n{} {} 0\n", self.vertices.len(), self.triangles.len());
        for vertex in &self.vertices {
            let _ = writeln!(text, "{} {} {}", vertex.x, vertex.y, vertex.z);
        }
        for [a, b, c] in &self.triangles {
            let _ = writeln!(text, "3 {a} {b} {c}");
        }
        text.into_bytes()
    }

    /// The mesh as a binary STL file in metres, in single precision.
    #[must_use]
    pub fn to_stl_bytes(&self) -> Vec<u8> {
        let mut bytes = vec![b' '; 80];
        bytes.extend((self.triangles.len() as u32).to_le_bytes());
        for triangle in 0..self.triangles.len() {
            let normal = self.normal(triangle);
            for vector in std::iter::once(normal).chain(self.corners(triangle)) {
                bytes.extend(vector.as_vec3().to_array().map(f32::to_le_bytes).concat());
            }
            bytes.extend([0, 0]);
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::mesh::MeshFormat;

    #[test]
    fn written_off_files_read_back_exactly() {
        let vertices = vec![DVec3::splat(0.1), DVec3::X / 3.0, DVec3::Y * 1e-7];
        let mesh = Mesh::new(vertices, vec![[0, 1, 2]]).unwrap();
        let read = Mesh::from_bytes(MeshFormat::Off, &mesh.to_off_bytes(), 1.0).unwrap();
        assert_eq!(read, mesh);
    }
}
