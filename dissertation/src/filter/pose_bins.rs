//! Bins over six-dimensional poses: a cubic lattice of positions times a grid of rotations.
//!
//! Source: section 5.5.1.2. The lattice is unbounded (a bin is named by its coordinates), so
//! a robot's base may be anywhere; the workspace only sets the number of bins of the prior.

use glam::DVec3;

use crate::rotation_grid::RotationGrid;
use palpate_core::pose::Pose;

/// The name of a bin: three lattice coordinates and a rotation bin, 16 bits each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PoseBin(pub u64);

/// Division of poses into bins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseBins {
    /// Edge of a translation bin, metres.
    pub edge: f64,
    /// The rotations.
    pub rotations: RotationGrid,
    /// Edge of the cube of possible positions, metres.
    pub workspace: f64,
}

impl PoseBins {
    /// ln of the number of bins of the workspace.
    #[must_use]
    pub fn log_count(&self) -> f64 {
        3.0 * (self.workspace / self.edge).ln() + (self.rotations.n_bins() as f64).ln()
    }

    /// The bin of a pose. Positions beyond ±32,767 edges fall into the outermost bin.
    #[must_use]
    pub fn bin(&self, pose: &Pose) -> PoseBin {
        let at = pose.translation * self.edge.recip();
        // Saturating float-to-int casts; the two's complement bits name the cell.
        let along = |value: f64| u64::from((value.floor() as i16) as u16);
        let rotation = u64::from(self.rotations.bin(pose.rotation));
        PoseBin(along(at.x) << 48 | along(at.y) << 32 | along(at.z) << 16 | rotation)
    }

    /// The pose at the centre of a bin.
    #[must_use]
    pub fn center(&self, bin: PoseBin) -> Pose {
        let along = |shift: u32| (f64::from((bin.0 >> shift) as u16 as i16) + 0.5) * self.edge;
        Pose {
            rotation: self.rotations.center(bin.0 as u16),
            translation: DVec3::new(along(48), along(32), along(16)),
        }
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
    };

    proptest! {
        #[test]
        fn a_pose_lies_within_half_an_edge_of_its_bins_center(seed in 0u64..500) {
            let mut stream = Stream::new(seed, Purpose::ObjectPose, 0);
            let pose = Pose::from_parts(stream.rotation(), 0.7 * stream.direction());
            let center = BINS.center(BINS.bin(&pose));
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
}
