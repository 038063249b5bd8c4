//! Symmetry: the rotations that leave an object unchanged, discovered from its touches.
//!
//! Not part of the dissertation, whose angles ignore symmetry. Only rotations count: no pose
//! mirrors an object. Touches show geometry only: a difference that only images show, such as
//! a hole too small to enter, does not break a symmetry here. Frames: the object's. Not here:
//! symmetries of letters in the plane (`metric`).

mod axes;
mod cells;
mod cloud;
mod discover;
mod fit;
mod group;
mod line;
mod orbit;
mod presses;
mod seeds;
mod shape;
mod verify;

#[cfg(test)]
mod tests;

use glam::DVec3;

pub use axes::ORDER_MAX;
pub use presses::Press;
pub use shape::Shape;

/// Minimum number of patches of a map for deciding on a symmetry.
pub const PATCHES_MIN: usize = 60;

/// The rotations that leave an object unchanged.
#[derive(Clone, Debug, PartialEq)]
pub struct Symmetry {
    /// The fixed point of all symmetries nearest to the origin, object frame, metres; the
    /// origin itself for an object without symmetry.
    pub center: DVec3,
    /// All axes, the highest order first. Beside a continuous axis, one axis of order 2
    /// represents all axes across it; three continuous axes mean a ball.
    pub axes: Vec<SymmetryAxis>,
}

/// Result of a search for symmetry in touches.
#[derive(Clone, Debug, PartialEq)]
pub enum Finding {
    /// The touches leave hardly any area as large as a contact untouched; this is the symmetry.
    Settled(Symmetry),
    /// A difference could have been missed, or another symmetry fits nearly as well: about
    /// this many more touches are needed.
    Undetermined {
        /// Number of further touches, at least 1.
        touches_needed: usize,
    },
}

impl Finding {
    /// Finds the symmetry shown by touches.
    #[must_use]
    pub fn of_touches(presses: &[Press]) -> Self {
        discover::discover(presses)
    }

    /// The symmetry modulo which poses are reported: none while it is undetermined.
    #[must_use]
    pub fn into_symmetry(self) -> Symmetry {
        match self {
            Self::Settled(symmetry) => symmetry,
            Self::Undetermined { .. } => Symmetry::NONE,
        }
    }
}

/// An axis of an object's symmetry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SymmetryAxis {
    /// A point of the axis, object frame, metres: the centre.
    pub point: DVec3,
    /// Direction of the axis, object frame, norm 1.
    pub direction: DVec3,
    /// Order of the symmetry about it.
    pub order: AxisOrder,
}

/// Order of the symmetry about an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisOrder {
    /// Multiples of 1/n of a turn, n from 2 to [`ORDER_MAX`].
    Finite(u8),
    /// Every angle, within the resolution of touch.
    Continuous,
}

impl Symmetry {
    /// An object without symmetry.
    pub const NONE: Self = Self { center: DVec3::ZERO, axes: Vec::new() };

    /// The symmetry of an object of known shape; [`Shape`] defines which turns count.
    #[must_use]
    pub fn of_shape(shape: &Shape<'_>) -> Self {
        shape::discover(shape)
    }

    /// A symmetry whose axes (directions of norm 1) meet in a point (metres).
    #[must_use]
    pub fn through(center: DVec3, axes: &[(DVec3, AxisOrder)]) -> Self {
        let axis = |&(direction, order)| SymmetryAxis { point: center, direction, order };
        Self { center, axes: axes.iter().map(axis).collect() }
    }
}
