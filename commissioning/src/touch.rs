//! Touches as a driver sends them.

/// Fewest touches from which anything is inferred. Chosen: six numbers of the object's pose and
/// six of the tool centre need as many touches with two numbers each, and some to spare.
pub const TOUCHES_MIN: usize = 8;

/// Most touches that are used; a bound on the work.
pub const TOUCHES_MAX: usize = 100;

/// One touch in the numbers that were sent.
#[derive(Clone, Debug, PartialEq)]
pub struct SentTouch {
    /// Pressures in the order and unit of the driver; `None` for a missing taxel.
    pub pressures: Vec<Option<f64>>,
    /// Position of the pose as sent.
    pub position: [f64; 3],
    /// Quaternion of the pose as sent, of norm 1.
    pub quaternion: [f64; 4],
}
