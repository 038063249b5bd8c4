//! Commissioning: what some twenty touches of one known object say about a sensor on its robot.
//!
//! Units, conventions and image order are discrete hypotheses, each fitted by continuous errors
//! of the tool centre, the response and the spread. The method is written down in
//! `docs/commissioning.md`; "equation C3" refers to it. Pure: no I/O, no clock, and randomness
//! only from a seed. Lengths in metres, pressures in pascal, angles in radians.

pub mod estimate;
pub mod touch;
mod pressure;
mod solve;
mod surface;
mod conventions;
mod images;
mod order;
mod covering;
mod taxels;
pub mod tool_center;
pub mod commission;
pub mod passport;
pub mod mistakes;
