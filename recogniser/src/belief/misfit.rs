//! How one touch lies on an object in a pose, term by term: what an explanation shows.
//!
//! The sum of the terms is not the score of equation R4, which is a mean over patches; they tell
//! which part of it is at fault.

use crate::model::SurfaceMap;
use crate::observe::inverse_pose::{InversePose, TouchOnMap};
use crate::observe::observation::{Observation, Says};
use crate::refine::surface_point::surface_point;
use crate::verify::evidence::Evidence;

/// Deviation of one touch from an object in a pose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Misfit {
    /// Distance of the touch from the surface along its outward normal, metres: positive above
    /// it. `None` for a miss and away from the surface.
    pub height: Option<f64>,
    /// Angle between the normal of the touch and that of the surface, rad; `None` as for the
    /// height, and for a contact without a normal.
    pub turn: Option<f64>,
    /// ln of the likelihood of the image at this place over that of a touch anywhere; `None` as
    /// for the height, and for a contact without an image.
    pub appearance: Option<f64>,
    /// Loss (ln, 0 or less) because the object fills space that was free, or is missing where
    /// something was felt.
    pub free_space: f64,
    /// Whether the reading touched something.
    pub is_touch: bool,
}

/// The misfit of the only touch or miss of `evidence`.
pub(super) fn misfit(evidence: &Evidence<'_>, map: &SurfaceMap, pose: &InversePose) -> Misfit {
    let free_space = f64::from(evidence.newest_press(map, pose));
    let Some(touch) = evidence.touches.last() else {
        return Misfit { free_space, ..Misfit::default() };
    };
    let none = Misfit { free_space, is_touch: true, ..Misfit::default() };
    let Some(surface) = surface_point(evidence.kernel, map, pose, touch) else { return none };
    let felt = pose.object_from_session * touch.normal;
    let says_normal = touch.says != Says::Position;
    Misfit {
        height: Some(f64::from(surface.offset.dot(surface.normal))),
        turn: says_normal.then(|| f64::from(surface.normal.angle_between(felt))),
        appearance: appearance(evidence, map, pose, touch),
        ..none
    }
}

/// ln of the appearance ratio (equation R7), averaged over the patches that explain the touch.
fn appearance(
    evidence: &Evidence<'_>,
    map: &SurfaceMap,
    pose: &InversePose,
    touch: &Observation,
) -> Option<f64> {
    if touch.says != Says::All {
        return None;
    }
    let TouchOnMap { touch: at, near } = TouchOnMap::new(map, pose, touch);
    let width = evidence.kernel.width(map, touch);
    let (mut sum, mut total) = (0.0, 0.0);
    for (index, stands_for) in near.weighed() {
        let facet = &map.facets()[usize::from(index)];
        let weight = stands_for * evidence.kernel.patch_density(width, facet, &at, touch);
        sum += weight * touch.appearance_ratio_of_pose(&facet.feature);
        total += weight;
    }
    (total > 0.0 && sum > 0.0).then(|| f64::from((sum / total).ln()))
}
