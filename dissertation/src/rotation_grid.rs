//! Grids over all rotations: the bin of a quaternion, and the centre of a bin.
//!
//! The dissertation bins Rodrigues vectors in 9³ cubes (section 5.5.1.2): 565 of 729 bins are
//! reachable, ±π is not adjacent to itself and the mean error is 16.6°. That grid stays for
//! reproduction. The default is a cubed hypersphere: the largest component of a quaternion
//! chooses one of four faces, the other three a cell at equal angles; seamless and nearly
//! uniform.

use std::f64::consts::{FRAC_PI_4, PI};

use glam::{DQuat, DVec3};

/// A division of the rotations into numbered bins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RotationGrid {
    /// Cubes of the Rodrigues vector (axis · angle within ±π), `n` per dimension.
    Rodrigues {
        /// Bins per dimension.
        n: u16,
    },
    /// Equal-angle cells on the four faces of the cubed hypersphere, `n` per dimension.
    CubedHypersphere {
        /// Cells per dimension of one face.
        n: u16,
    },
}

impl RotationGrid {
    /// Number of bins, reachable or not.
    #[must_use]
    pub fn n_bins(self) -> usize {
        match self {
            Self::Rodrigues { n } => usize::from(n).pow(3),
            Self::CubedHypersphere { n } => 4 * usize::from(n).pow(3),
        }
    }

    /// The bin of a unit quaternion; q and −q share it.
    #[must_use]
    pub fn bin(self, rotation: DQuat) -> u16 {
        match self {
            Self::Rodrigues { n } => {
                let vector = rodrigues(rotation);
                cell(vector.map(|value| (value + PI) / (2.0 * PI)), n)
            }
            Self::CubedHypersphere { n } => {
                let (face, others) = on_face(rotation);
                let along = others.map(|ratio| 0.5 + ratio.atan() / (2.0 * FRAC_PI_4));
                face * n * n * n + cell(DVec3::from_array(along), n)
            }
        }
    }

    /// The rotation at the centre of a bin.
    #[must_use]
    pub fn center(self, bin: u16) -> DQuat {
        match self {
            Self::Rodrigues { n } => {
                let vector = cell_center(bin, n).map(|value| (value - 0.5) * 2.0 * PI);
                DQuat::from_scaled_axis(vector)
            }
            Self::CubedHypersphere { n } => {
                let per_face = n * n * n;
                let along = cell_center(bin % per_face, n);
                let others = along.to_array().map(|value| ((value - 0.5) * 2.0 * FRAC_PI_4).tan());
                let face = usize::from(bin / per_face);
                let mut components = [1.0; 4];
                let mut next = others.into_iter();
                for (index, component) in components.iter_mut().enumerate() {
                    if index != face {
                        *component = next.next().unwrap_or(0.0);
                    }
                }
                DQuat::from_array(components).normalize()
            }
        }
    }
}

/// Axis · angle, the angle within 0 ..= π.
fn rodrigues(rotation: DQuat) -> DVec3 {
    let q = if rotation.w < 0.0 { -rotation } else { rotation };
    let sin_half = q.xyz().length();
    if sin_half < 1e-12 { DVec3::ZERO } else { q.xyz() * (2.0 * sin_half.atan2(q.w) / sin_half) }
}

/// The component of largest magnitude, and the other three divided by it.
fn on_face(rotation: DQuat) -> (u16, [f64; 3]) {
    let q = rotation.to_array();
    let mut face = 0;
    for index in 1..4 {
        if q[index].abs() > q[face].abs() {
            face = index;
        }
    }
    let scale = q[face].recip();
    let others = match face {
        0 => [q[1], q[2], q[3]],
        1 => [q[0], q[2], q[3]],
        2 => [q[0], q[1], q[3]],
        _ => [q[0], q[1], q[2]],
    };
    (face as u16, others.map(|component| component * scale))
}

/// The number of the cell that holds a point of the unit cube.
fn cell(point: DVec3, n: u16) -> u16 {
    let along = |value: f64| ((value * f64::from(n)) as i32).clamp(0, i32::from(n) - 1) as u16;
    (along(point.x) * n + along(point.y)) * n + along(point.z)
}

fn cell_center(cell: u16, n: u16) -> DVec3 {
    let along = |index: u16| (f64::from(index) + 0.5) / f64::from(n);
    DVec3::new(along(cell / (n * n)), along(cell / n % n), along(cell % n))
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_core::pose::rotation_angle;
    use palpate_core::rng::{Purpose, Stream};
    use palpate_core::units::DEG;

    /// Mean and largest angle (rad) between random rotations and the centres of their bins.
    fn errors(grid: RotationGrid) -> (f64, f64) {
        let mut stream = Stream::new(5, Purpose::ObjectPose, 0);
        let n = 20_000;
        let angles = (0..n).map(|_| {
            let rotation = stream.rotation();
            rotation_angle(rotation.conjugate() * grid.center(grid.bin(rotation)))
        });
        angles.fold((0.0, 0.0), |(mean, max): (f64, f64), angle| {
            (mean + angle / f64::from(n), max.max(angle))
        })
    }

    #[test]
    fn every_center_lies_in_its_own_bin() {
        let grid = RotationGrid::CubedHypersphere { n: 5 };
        for bin in 0..grid.n_bins() as u16 {
            assert_eq!(grid.bin(grid.center(bin)), bin);
        }
    }

    #[test]
    fn the_printed_grid_errs_by_seventeen_degrees() {
        // docs/equations.md: mean 16.6°, an irreducible error of the literal grid.
        let (mean, _) = errors(RotationGrid::Rodrigues { n: 9 });
        assert!((mean / DEG - 16.6).abs() < 0.5, "{}", mean / DEG);
    }

    #[test]
    fn the_default_grid_errs_less_with_as_many_bins() {
        // 4 · 6³ = 864 bins against the 729 of the printed grid, and no far corner.
        let (mean, max) = errors(RotationGrid::CubedHypersphere { n: 6 });
        assert!(mean / DEG < 14.0 && max / DEG < 27.0, "{} {}", mean / DEG, max / DEG);
    }

    #[test]
    fn opposite_quaternions_share_a_bin_in_both_grids() {
        let mut stream = Stream::new(6, Purpose::ObjectPose, 0);
        for grid in [RotationGrid::Rodrigues { n: 9 }, RotationGrid::CubedHypersphere { n: 6 }] {
            for _ in 0..100 {
                let rotation = stream.rotation();
                assert_eq!(grid.bin(rotation), grid.bin(-rotation), "{grid:?}");
            }
        }
    }
}
