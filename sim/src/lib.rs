//! A simulated tactile sensor, the controllers that bring it to rest, and objects to touch.
//!
//! A seed determines everything. Source: Pezzementi (2011), section 2.5 (imaging), section
//! 3.2.3 (letters and the rig that presses them), section 4.2.2 (contact control), section
//! 4.4.1.2 (training touches) and sections 4.2.1 and 4.4.1.1 (an arm that explores), with the
//! corrections in `docs/equations.md`. Lengths in metres, pressures in pascal; poses are
//! `object_from_sensor`, in the frame of the mesh. Not here: recognition (`palpate-core`).

mod distance;
pub mod mesh;
pub mod noise;
pub mod elastic;
mod surface;
pub mod press;
pub mod indent;
pub mod controller;
pub mod sampler;
pub mod kept;
pub mod symmetry;
pub mod form;
pub mod convergence;
pub mod arm;
pub mod explore;
pub mod shapes;
pub mod letters;
pub mod rig;
pub mod render;
pub mod plot;
