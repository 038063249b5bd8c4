//! Conversion of what a sensor felt: images and contacts without one between wire, store and
//! core, and shear.

use palpate_core::pose::Pose;
use palpate_core::reading::point_contact::{
    ContactError, ContactField, ContactNumbers, PointContact,
};
use palpate_core::reading::{Felt, Reading, ReadingError, SensorId};
use palpate_core::sensor::{Correction, SensorDescription};
use palpate_core::units::Beyond;
use palpate_schemas as wire;
use palpate_store::entity::{Sensor, StoredReading};
use thiserror::Error;

use super::{Invalid, outside};

/// The largest shear of a taxel, pascal.
const SHEAR_MAX: f64 = 1e8;
/// Smallest standard deviation, in metres or radians. Chosen: nothing is known better, and its
/// square is far from where numbers end.
pub(super) const DEVIATION_MIN: f64 = 1e-9;

/// Error of a stored reading that is none.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub(crate) enum FeltError {
    /// Its image.
    #[error(transparent)]
    Image(#[from] ReadingError),
    /// Its contact.
    #[error("the contact's {:?} {}", .0.field(), .0)]
    Contact(#[from] ContactError),
}

/// A stored reading in core's form, corrected by the calibration that it names. It was
/// checked on arrival, but not by this program. A contact without an image stays as stated.
pub(crate) fn from_store(
    stored: &StoredReading,
    sensor: &Sensor,
    correction: Option<&Correction>,
) -> Result<Felt, FeltError> {
    match stored.contact {
        Some(numbers) => {
            let contact = PointContact::new(SensorId(stored.sensor.as_u128()), numbers)?;
            Ok(Felt::Contact(contact.after_approach(stored.approach)))
        }
        None => Ok(Felt::Press(press_from_store(stored, sensor, correction)?)),
    }
}

/// The press of a stored reading with an image. One without a stored pose gets the identity:
/// callers that need poses check the stored one first.
pub(crate) fn press_from_store(
    stored: &StoredReading,
    sensor: &Sensor,
    correction: Option<&Correction>,
) -> Result<Reading, ReadingError> {
    let id = SensorId(stored.sensor.as_u128());
    let pose = stored.session_from_sensor.unwrap_or(Pose::IDENTITY);
    let (description, pressures) = (&sensor.description, &stored.pressures);
    let reading = match correction {
        Some(correction) => Reading::corrected(id, description, correction, pressures, pose)?,
        None => Reading::new(id, description, pressures, pose)?,
    };
    Ok(reading.after_approach(stored.approach))
}

/// The numbers of a contact as sent, with exactly one of contact and image.
pub(super) fn contact(
    pointer: &str,
    given: &wire::Reading,
) -> Result<Option<ContactNumbers>, Invalid> {
    let Some(contact) = &given.contact else {
        if given.image.is_empty() {
            let detail = "is missing, expected the pressures of the taxels, or a `contact` instead";
            return Err(Invalid::field(format!("{pointer}/image"), detail));
        }
        return Ok(None);
    };
    let beside = |field: &str, detail: &str| Invalid::field(format!("{pointer}/{field}"), detail);
    if !given.image.is_empty() {
        return Err(beside("contact", "came with an image, expected exactly one of both"));
    }
    if given.pose.is_some() {
        let detail = "came with a `contact`, which has its own position: leave the pose out";
        return Err(beside("pose", detail));
    }
    if given.shear.is_some() {
        return Err(beside("shear", "came with a `contact`, expected with an image only"));
    }
    if given.approach_m.is_some() && contact.normal.is_none() {
        let detail = "came with a `contact` without `normal`, expected one: the way is against it";
        return Err(beside("approach_m", detail));
    }
    let deviations = [
        ("position_deviation_m", Some(contact.position_deviation_m)),
        ("normal_deviation_rad", contact.normal_deviation_rad),
    ];
    for (field, deviation) in deviations {
        // Below it the variance has no digits left; other numbers are checked by core.
        if let Some(found) = deviation.filter(|found| (0.0..DEVIATION_MIN).contains(found)) {
            let at = format!("{pointer}/contact/{field}");
            let expected = format!("at least {DEVIATION_MIN:e}");
            return Err(outside(at, found, [DEVIATION_MIN], &expected));
        }
    }
    Ok(Some(ContactNumbers {
        touched: contact.touched,
        position: contact.position,
        position_deviation: contact.position_deviation_m,
        normal: contact.normal,
        normal_deviation: contact.normal_deviation_rad,
        force: contact.force_n,
    }))
}

/// The refusal of a reading whose stored form is none, at its field.
pub(super) fn refused(pointer: &str, error: FeltError) -> Invalid {
    let at = match error {
        FeltError::Image(ReadingError::Pressure { taxel, .. }) => {
            format!("{pointer}/image/{taxel}")
        }
        FeltError::Image(_) => format!("{pointer}/image"),
        FeltError::Contact(error) => {
            let field = match error.field() {
                ContactField::Position => "position",
                ContactField::PositionDeviation => "position_deviation_m",
                ContactField::Normal => "normal",
                ContactField::NormalDeviation => "normal_deviation_rad",
                ContactField::Force => "force_n",
            };
            return Invalid::field(format!("{pointer}/contact/{field}"), error);
        }
    };
    Invalid::field(at, error)
}

/// Checks the shear of three-axis taxels.
pub(super) fn shear(
    pointer: &str,
    given: &wire::Reading,
    sensor: &SensorDescription,
) -> Result<(), Invalid> {
    let Some(shear) = &given.shear else { return Ok(()) };
    let (expected, found) = (sensor.n_taxels(), shear.len());
    if found != expected {
        let detail = format!(
            "{found} taxels came, expected {expected}: two values for each taxel of the image"
        );
        return Err(Invalid::field(format!("{pointer}/shear"), detail));
    }
    let is_wrong = |pair: &Option<[f64; 2]>| {
        pair.is_some_and(|pair| !pair.iter().all(|value| value.abs() <= SHEAR_MAX))
    };
    let Some(taxel) = shear.iter().position(is_wrong) else { return Ok(()) };
    let [x, y] = shear[taxel].unwrap_or_default();
    let limits = [-SHEAR_MAX, SHEAR_MAX];
    let (x, y) = (Beyond(x, limits), Beyond(y, limits));
    let detail = format!("came {x} and {y}, expected pascal within ±{SHEAR_MAX:e}");
    Err(Invalid::field(format!("{pointer}/shear/{taxel}"), detail))
}

/// A contact in its wire form.
pub(super) fn shown(contact: ContactNumbers) -> wire::Contact {
    wire::Contact {
        touched: contact.touched,
        position: contact.position,
        position_deviation_m: contact.position_deviation,
        normal: contact.normal,
        normal_deviation_rad: contact.normal_deviation,
        force_n: contact.force,
    }
}

/// Refuses readings that teach nothing of an object at rest: those without an image, and those
/// before which it may have moved.
pub(crate) fn for_training(given: &[wire::Reading]) -> Result<(), Invalid> {
    let refused = |index: usize, field: &str, detail: &str| {
        Err(Invalid::field(format!("/readings/{index}/{field}"), detail))
    };
    if let Some(index) = given.iter().position(|reading| reading.contact.is_some()) {
        let detail = "came without an image, expected one: objects are learnt from images; \
                      contacts serve to recognise them";
        return refused(index, "contact", detail);
    }
    if let Some(index) = given.iter().position(|reading| reading.object_moved.is_some()) {
        let detail = "came with a training reading, expected none: an object is learnt at rest in \
                      one frame; give poses in a frame that moves with it";
        return refused(index, "object_moved", detail);
    }
    Ok(())
}

/// What of these readings a session's method leaves out, at most one warning of a kind; without
/// a method only what no method uses.
pub(crate) fn ignored<'a>(
    given: impl Iterator<Item = &'a StoredReading> + Clone,
    method: Option<wire::Method>,
) -> Vec<wire::Warning> {
    use wire::WarningCode::{ApproachIgnored, ContactIgnored, MotionIgnored, ShearIgnored};
    let mut warnings = Vec::new();
    let mut warn = |code, field: &str, detail: String, is: fn(&StoredReading) -> bool| {
        if let Some(index) = given.clone().position(is) {
            let pointer = format!("/readings/{index}/{field}");
            warnings.push(wire::Warning { code, pointer, detail });
        }
    };
    if let Some(method) = method.filter(|method| *method != wire::Method::Surface) {
        let only = |what: &str| {
            let method = method.name();
            format!(
                "the method `{method}` {what} stored and do not change the belief; `surface` uses \
                 them"
            )
        };
        let contacts = only("needs images: contacts without one are");
        warn(ContactIgnored, "contact", contacts, |reading| reading.contact.is_some());
        let motions = only("takes the object to be at rest: announced motions are");
        // Appearance has no pose that a motion could make uncertain.
        if !method.is_appearance() {
            warn(MotionIgnored, "object_moved", motions, |reading| reading.object_moved.is_some());
        }
        let paths = only("looks at presses alone: free paths are");
        warn(ApproachIgnored, "approach_m", paths, |reading| reading.approach > 0.0);
    }
    let shear = "shear is stored and returned with the reading; no method uses it".to_owned();
    warn(ShearIgnored, "shear", shear, |reading| reading.shear.is_some());
    warnings
}
