//! Symmetry: the rotations that leave an object as it is, discovered from its touches.
//!
//! Not part of the dissertation, whose angles are plain. Only rotations count: no pose mirrors
//! an object. Found is what the geometry of touches shows: what only images tell apart, such
//! as holes too small to enter, does not break a symmetry here.
//! Frames: the object's. Not here: symmetries of letters in the plane (`metric`).

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

/// A map of fewer patches is too coarse for a symmetry to be told from none.
pub const PATCHES_MIN: usize = 60;

/// The rotations that leave an object as it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Symmetry {
    /// A point that no symmetry moves, object frame, metres: of those the nearest to the
    /// origin; the origin itself for an object without symmetry.
    pub center: DVec3,
    /// All axes, the highest order first. Beside a continuous axis one axis of order 2 stands
    /// for all across it; three continuous axes are a ball.
    pub axes: Vec<SymmetryAxis>,
}

/// What touches say of an object's symmetry.
#[derive(Clone, Debug, PartialEq)]
pub enum Finding {
    /// They leave hardly any place as large as a contact untouched; this is what they show.
    Settled(Symmetry),
    /// A difference could have been missed, or another symmetry fits nearly as well: about this
    /// many more touches are needed.
    Undetermined {
        /// How many more touches, at least 1.
        touches_needed: usize,
    },
}

impl Finding {
    /// What touches say.
    #[must_use]
    pub fn of_touches(presses: &[Press]) -> Self {
        discover::discover(presses)
    }

    /// The symmetry that poses are answered modulo: none while it is undetermined.
    #[must_use]
    pub fn into_symmetry(self) -> Symmetry {
        match self {
            Self::Settled(symmetry) => symmetry,
            Self::Undetermined { .. } => Symmetry::NONE,
        }
    }
}

/// A line about which an object can be turned without a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SymmetryAxis {
    /// A point of it, object frame, metres: the centre.
    pub point: DVec3,
    /// Its direction, object frame, norm 1.
    pub direction: DVec3,
    /// By which angles.
    pub order: AxisOrder,
}

/// By which angles an object can be turned about an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisOrder {
    /// By multiples of 1/n of a turn, n from 2 to [`ORDER_MAX`].
    Finite(u8),
    /// By every angle, as far as touches tell.
    Continuous,
}

impl Symmetry {
    /// An object that only looks like itself.
    pub const NONE: Self = Self { center: DVec3::ZERO, axes: Vec::new() };

    /// The symmetry of an object whose shape is known; see [`Shape`] for which turns count.
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
