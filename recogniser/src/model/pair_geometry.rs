//! The geometry of a pair of touches: its invariants under motion of the object.
//!
//! Distance and three cosines (the first normal, the second normal and each other's) after Drost
//! et al. (2010), because a pair with both normals determines the pose in closed form.

use glam::Vec3;

/// An ordered pair's geometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairGeometry {
    /// Distance of the two touches, metres.
    pub distance: f32,
    /// Cosines: first normal with the axis (from first to second), second normal with the
    /// axis, the two normals with each other.
    pub cosines: [f32; 3],
    /// (first normal × second normal) · axis, which distinguishes a pair from its mirror image.
    pub chirality: f32,
}

impl PairGeometry {
    /// The geometry of two places; `None` if they coincide.
    #[must_use]
    pub fn new(a: (Vec3, Vec3), b: (Vec3, Vec3)) -> Option<Self> {
        let axis = b.0 - a.0;
        let distance = axis.length();
        if distance < 1e-6 {
            return None;
        }
        let axis = axis / distance;
        Some(Self {
            distance,
            cosines: [a.1.dot(axis), b.1.dot(axis), a.1.dot(b.1)],
            chirality: a.1.cross(b.1).dot(axis),
        })
    }

    /// The same pair seen from its other end.
    #[must_use]
    pub fn reversed(self) -> Self {
        let [first, second, between] = self.cosines;
        // Axis and order of the normals both turn: the triple product stays.
        Self { cosines: [-second, -first, between], ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn geometry_of_a_pair_by_hand() {
        // 3 mm along z; normals x, and halfway between y and z (0.8, 0.6).
        let a = (Vec3::ZERO, Vec3::X);
        let b = (Vec3::new(0.0, 0.0, 0.003), Vec3::new(0.0, 0.8, 0.6));
        let geometry = PairGeometry::new(a, b).unwrap();
        assert!((geometry.distance - 0.003).abs() < 1e-9);
        // x · z = 0, (0, .8, .6) · z = 0.6, x · (0, .8, .6) = 0; (x × b) · z = 0.8.
        let [first, second, between] = geometry.cosines;
        assert!(first.abs() < 1e-6 && (second - 0.6).abs() < 1e-6 && between.abs() < 1e-6);
        assert!((geometry.chirality - 0.8).abs() < 1e-6);
        // In the mirror (y → −y) only the chirality differs.
        let mirrored = (b.0, Vec3::new(0.0, -0.8, 0.6));
        let mirrored = PairGeometry::new(a, mirrored).unwrap();
        assert!((mirrored.chirality + 0.8).abs() < 1e-6);
        assert_eq!(mirrored.cosines[1].to_bits(), geometry.cosines[1].to_bits());
        assert_eq!(PairGeometry::new(a, (Vec3::ZERO, Vec3::Y)), None);
    }
}
