//! Single readings compared with the belief: what an explanation tells of each.

use palpate_core::object::ObjectIdx;
use palpate_core::reading::Felt;
use palpate_core::sensor::SensorDescription;
use palpate_recogniser::belief::Misfit;

use super::SessionBelief;

impl SessionBelief {
    /// log₂ ratio of a reading's density in the belief to that of a touch anywhere; `None`
    /// when the method has none.
    pub(crate) fn fit_bits(&self, felt: &Felt, sensor: &SensorDescription) -> Option<f64> {
        let Self::Surface(belief) = self else { return None };
        let log = match felt {
            Felt::Press(reading) => belief.log_predictive(reading, sensor)?,
            Felt::Contact(contact) => belief.log_predictive_of_contact(contact)?,
        };
        Some(log / std::f64::consts::LN_2)
    }

    /// How a reading lies on an object; `None` when the method or the object has no pose.
    pub(crate) fn misfit(
        &self,
        object: ObjectIdx,
        felt: &Felt,
        sensor: &SensorDescription,
    ) -> Option<Misfit> {
        let Self::Surface(belief) = self else { return None };
        match felt {
            Felt::Press(reading) => belief.misfit(object, reading, sensor),
            Felt::Contact(contact) => belief.misfit_of_contact(object, contact),
        }
    }
}
