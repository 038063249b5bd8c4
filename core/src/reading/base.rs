//! Uncertainty of poses: of a single one, and of a robot's base, which its readings share.

/// Uncertainty of a stated pose: standard deviations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Looseness {
    /// In each direction, metres.
    pub position: f64,
    /// About each axis, rad.
    pub angle: f64,
}

/// The base of a robot with an uncertain position, which shifts all readings of that robot
/// equally.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Base {
    /// The robot's number in the session.
    pub robot: u32,
    /// Uncertainty of the placement of its readings, where the object is.
    pub looseness: Looseness,
}
