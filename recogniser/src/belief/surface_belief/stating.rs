//! A belief with a stated pose prior, such as a camera's word.

use std::sync::Arc;

use super::SurfaceBelief;
use crate::belief::component::Component;
use crate::belief::motion::{Motion, median_radius};
use crate::pose_prior::{PosePrior, PosePriorError};
use crate::verify::stated_prior::{StatedPrior, Statement};

impl SurfaceBelief {
    /// The belief before any reading with a statement about the object and its pose. Equation R32
    /// of docs/camera-model.md.
    ///
    /// # Errors
    /// [`PosePriorError`] when the statement does not fit the catalogue.
    pub fn with_pose_prior(mut self, prior: &PosePrior) -> Result<Self, PosePriorError> {
        let radius = median_radius(&self.common.model);
        let before = &mut self.common.prior.log_objects;
        let statement = Statement::new(prior, before, radius)?;
        before.clone_from(&statement.log_objects);
        self.rest = Component::new(Motion::announced(self.common.options.motion), &self.common);
        self.statement = Some(Arc::new(statement));
        Ok(self)
    }

    /// The statement relative to the anchor, at the first touch.
    pub(super) fn state(&mut self) {
        let Some(statement) = &self.statement else { return };
        let options = &self.common.options;
        let stated = StatedPrior::new(Arc::clone(statement), self.anchor, options);
        self.rest.state(Some(Arc::new(stated)));
    }
}
