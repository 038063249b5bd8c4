//! The health of one sensor over time: sums of a day, and the judgement of several days.
//!
//! Two sources: presses that met nothing show offsets, noise and drift of single taxels, and
//! presses beside which the neighbours answer show dead and weak ones; recognised sessions show
//! the error of the tool centre that all their touches share (equation R21a). Pressures are in
//! pascal, taxels in the sensor frame's row-major order, shifts in metres in the sensor frame.
//! Not here: when a session counts, and where days are stored.

pub mod presses;
pub mod shifts;
pub mod day;
pub mod verdict;
