//! A belief from touches that a training learnt as patches: how one object looks to others.

use super::SurfaceBelief;
use crate::belief::component::Observed;
use crate::model::SurfacePatch;
use crate::observe::observation::Observation;
use crate::observe::touch::Touch;

impl SurfaceBelief {
    /// Adds the touch of a patch; the session frame is that of the patch's object, which rests. A
    /// patch shows no free space, and its place has no error of a tool's centre.
    pub(crate) fn add_patch(&mut self, patch: &SurfacePatch) {
        let touch = Touch::of_patch(patch);
        if self.n_touches() == 0 {
            self.anchor = touch.position;
        }
        self.n_readings += 1;
        let (space, scale) = (&self.common.model.space, &self.common.options.scale);
        let touch = Observation::new(&touch, self.anchor, space, scale).with_own_tool();
        let touch = touch.weighed(self.rest.explained().touches, None);
        let observed = Observed { touch: Some(touch), spaces: Vec::new() };
        self.rest.add(&self.common, &observed, true);
    }
}
