//! Likeness: hypotheses with the same pose, or in one orbit of the object's symmetry.

use glam::DVec3;
use palpate_core::belief::orbits::OrbitScale;
use palpate_core::symmetry::Symmetry;

use crate::options::SurfaceOptions;
use crate::verify::hypothesis::Hypothesis;

/// Whether two hypotheses of an object look alike.
pub(crate) fn look_alike(
    first: &Hypothesis,
    second: &Hypothesis,
    symmetry: &Symmetry,
    options: &SurfaceOptions,
) -> bool {
    let scale = orbit_scale(options);
    let pose = |hypothesis: &Hypothesis| hypothesis.session_from_object(DVec3::ZERO);
    symmetry.look_alike(&pose(first), &pose(second), scale.distance, scale.angle)
}

/// The scale within which poses are equal: that of merging.
pub(crate) fn orbit_scale(options: &SurfaceOptions) -> OrbitScale {
    let SurfaceOptions { merge_distance, merge_angle, .. } = *options;
    OrbitScale { distance: f64::from(merge_distance), angle: f64::from(merge_angle) }
}
