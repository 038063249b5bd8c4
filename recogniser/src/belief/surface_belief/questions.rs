//! Questions about a reading that leave the belief as it is: how likely the belief makes it, and
//! how it lies on the likeliest known object.

use palpate_core::object::ObjectIdx;
use palpate_core::reading::Reading;
use palpate_core::reading::point_contact::PointContact;
use palpate_core::sensor::SensorDescription;

use super::SurfaceBelief;
use crate::belief::felt::Given;
use crate::belief::misfit::{Misfit, misfit};
use crate::belief::predictive::log_predictive;
use crate::belief::stage::Stage;
use crate::observe::observation::Observation;
use crate::observe::press_space::PressSpace;

impl SurfaceBelief {
    /// ln likelihood ratio of the reading under the object's current poses against a touch
    /// anywhere; `None` before three touches have determined the poses.
    #[must_use]
    pub fn log_predictive(&self, reading: &Reading, sensor: &SensorDescription) -> Option<f64> {
        self.predict(Given::Press(reading, sensor))
    }

    /// [`SurfaceBelief::log_predictive`] of a contact without an image.
    #[must_use]
    pub fn log_predictive_of_contact(&self, contact: &PointContact) -> Option<f64> {
        self.predict(Given::Contact(contact))
    }

    /// How a reading of this session lies on an object in its best pose; `None` before three
    /// touches have determined poses, and for an object without any.
    #[must_use]
    pub fn misfit(
        &self,
        object: ObjectIdx,
        reading: &Reading,
        sensor: &SensorDescription,
    ) -> Option<Misfit> {
        self.compare(object, Given::Press(reading, sensor))
    }

    /// [`SurfaceBelief::misfit`] of a contact without an image.
    #[must_use]
    pub fn misfit_of_contact(&self, object: ObjectIdx, contact: &PointContact) -> Option<Misfit> {
        self.compare(object, Given::Contact(contact))
    }

    fn predict(&self, given: Given<'_>) -> Option<f64> {
        if self.rest.explained().stage != Stage::Poses {
            return None;
        }
        let (touch, space) = self.seen(given);
        let (touches, spaces): (Vec<_>, _) = (touch.into_iter().collect(), [space]);
        let evidence = self.common.evidence(&touches, &spaces);
        let objects = self.leading().explained().objects;
        log_predictive(&evidence, objects, &self.posterior())
    }

    fn compare(&self, object: ObjectIdx, given: Given<'_>) -> Option<Misfit> {
        if self.rest.explained().stage != Stage::Poses {
            return None;
        }
        let index = object.0 as usize;
        let best = self.leading().explained().objects.get(index)?.hypotheses.first()?;
        let (touch, space) = self.seen(given);
        // Only a touch by the first tool shares the error of its centre.
        let is_shared = self.first_tool.is_none_or(|first| given.tool() == Some(first));
        let touch = touch.map(|touch| if is_shared { touch } else { touch.with_own_tool() });
        let (touches, spaces): (Vec<_>, _) = (touch.into_iter().collect(), [space]);
        let evidence = self.common.evidence(&touches, &spaces);
        Some(misfit(&evidence, &self.common.model.maps()[index], &best.inverse_pose()))
    }

    /// The observation of a reading, unless it is a miss, and the space that it shows.
    fn seen(&self, given: Given<'_>) -> (Option<Observation>, PressSpace) {
        let (space, scale) = (&self.common.model.space, &self.common.options.scale);
        let touch = given.touch(space).map(|touch| {
            Observation::new(&touch, self.anchor, space, scale).with_base(given.base())
        });
        let space = match touch {
            Some(_) => given.space_of_touch(self.anchor),
            None => given.miss().space(self.anchor),
        };
        (touch, space)
    }
}
