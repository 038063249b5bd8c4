//! Bins over poses: a lattice of positions, in space or in a plane, times a grid of rotations.
//!
//! Source: sections 5.5.1.2 and 5.5.2. The lattice of space is unbounded (a bin is named by its
//! coordinates), so a robot's base may be anywhere; the workspace only sets the number of bins of
//! the prior. The lattice of a plane ends with its workspace.

use glam::DVec3;

use crate::rotation_grid::RotationGrid;
use palpate_core::pose::Pose;

/// The name of a bin: three lattice coordinates and a rotation bin, 16 bits each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PoseBin(pub u64);

/// Positions that have bins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lattice {
    /// Cubes over all of space.
    Space,
    /// Squares over x and y of the workspace, centred at the origin, with one bin for every
    /// height (section 5.5.2).
    Plane,
}

/// Division of poses into bins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseBins {
    /// Edge of a translation bin, metres.
    pub edge: f64,
    /// The rotations.
    pub rotations: RotationGrid,
    /// Edge of the cube (or square) of possible positions, metres.
    pub workspace: f64,
    /// The positions.
    pub lattice: Lattice,
}

impl PoseBins {
    /// ln of the number of bins of the workspace.
    #[must_use]
    pub fn log_count(&self) -> f64 {
        let dimensions = match self.lattice {
            Lattice::Space => 3.0,
            Lattice::Plane => 2.0,
        };
        dimensions * (self.workspace / self.edge).ln() + (self.rotations.n_bins() as f64).ln()
    }

    /// The bin of a pose; `None` beyond the workspace of a plane. In space, positions beyond
    /// ±32,767 edges fall into the outermost bin.
    #[must_use]
    pub fn bin(&self, pose: &Pose) -> Option<PoseBin> {
        let DVec3 { x, y, z } = pose.translation;
        // Saturating float-to-int casts; the two's complement bits name the cell.
        let along = |value: f64| u64::from((value.floor() as i16) as u16);
        let rotation = u64::from(self.rotations.bin(pose.rotation));
        match self.lattice {
            Lattice::Space => {
                let [x, y, z] = [x, y, z].map(|value| along(value * self.edge.recip()));
                Some(PoseBin(x << 48 | y << 32 | z << 16 | rotation))
            }
            Lattice::Plane => {
                let half = 0.5 * self.workspace;
                let [x, y] = [x, y].map(|value| value + half);
                let inside = |value: f64| (0.0..self.workspace).contains(&value);
                let [i, j] = [x, y].map(|value| along(value * self.edge.recip()));
                (inside(x) && inside(y)).then_some(PoseBin(i << 48 | j << 32 | rotation))
            }
        }
    }

    /// The pose at the centre of a bin.
    #[must_use]
    pub fn center(&self, bin: PoseBin) -> Pose {
        let along = |shift: u32| (f64::from((bin.0 >> shift) as u16 as i16) + 0.5) * self.edge;
        let half = 0.5 * self.workspace;
        let translation = match self.lattice {
            Lattice::Space => DVec3::new(along(48), along(32), along(16)),
            Lattice::Plane => DVec3::new(along(48) - half, along(32) - half, 0.0),
        };
        Pose { rotation: self.rotations.center(bin.0 as u16), translation }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use palpate_core::rng::{Purpose, Stream};
    use palpate_core::units::MM;

    const BINS: PoseBins = PoseBins {
        edge: 0.008,
        rotations: RotationGrid::CubedHypersphere { n: 6 },
        workspace: 0.4,
        lattice: Lattice::Space,
    };

    proptest! {
        #[test]
        fn a_pose_lies_within_half_an_edge_of_its_bins_center(seed in 0u64..500) {
            let mut stream = Stream::new(seed, Purpose::ObjectPose, 0);
            let pose = Pose::from_parts(stream.rotation(), 0.7 * stream.direction());
            let center = BINS.center(BINS.bin(&pose).unwrap());
            let off = (center.translation - pose.translation).abs();
            prop_assert!(off.max_element() <= 4.0 * MM + 1e-12);
            prop_assert_eq!(BINS.bin(&center), BINS.bin(&pose));
        }
    }

    #[test]
    fn the_dissertations_grid_has_50_cubed_times_9_cubed_bins() {
        let literal = PoseBins { rotations: RotationGrid::Rodrigues { n: 9 }, ..BINS };
        assert!((literal.log_count() - (125_000.0 * 729.0_f64).ln()).abs() < 1e-9);
    }

    #[test]
    fn a_plane_of_21_by_21_bins_ends_at_ten_millimetres() {
        // Section 5.5.2: 21 bins over −10 to 10 mm, each 20/21 mm wide.
        let bins = PoseBins {
            edge: 20.0 / 21.0 * MM,
            rotations: RotationGrid::Rodrigues { n: 9 },
            workspace: 20.0 * MM,
            lattice: Lattice::Plane,
        };
        assert!((bins.log_count() - (21.0 * 21.0 * 729.0_f64).ln()).abs() < 1e-9);
        let at = |x: f64, z: f64| {
            Pose::from_parts(glam::DQuat::IDENTITY, DVec3::new(x * MM, 0.3 * MM, z * MM))
        };
        // The middle bin is centred at the origin, and heights do not matter.
        let middle = bins.bin(&at(0.0, 0.0)).unwrap();
        assert_eq!(bins.bin(&at(0.4, -7.0)), Some(middle));
        assert!(bins.center(middle).translation.length() < 1e-12);
        assert!(bins.bin(&at(9.9, 0.0)).is_some() && bins.bin(&at(-9.9, 0.0)).is_some());
        assert!(bins.bin(&at(10.1, 0.0)).is_none() && bins.bin(&at(-10.1, 0.0)).is_none());
    }
}
