//! Warnings about accepted readings and objects that are probably a mistake, above all a
//! wrong unit.
//!
//! Pure functions: the input was checked, and the output changes nothing. Each warning has a
//! code for programs and a sentence with the probable intention. Not here: refusals
//! (`wire::reading`).

mod clock;
mod image_order;
mod object;
mod shift;

use std::collections::BTreeMap;

use glam::DVec3;
use palpate_core::plausible::{self, Doubt};
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_schemas::{Warning, WarningCode};

pub(crate) use clock::{SetBack, of_clock};
pub(crate) use image_order::of_images;
pub(crate) use object::{Touched, of_catalogue, of_kept_knowledge, of_object, of_twins};
pub(crate) use shift::of_session;

/// A probable mistake in a reading, and its field.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Hint {
    pub(crate) code: WarningCode,
    pub(crate) field: &'static str,
    pub(crate) detail: String,
}

/// A reading to be judged.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Judged<'a> {
    /// The press and its sensor; `None` for a contact without an image.
    press: Option<(&'a Reading, &'a SensorDescription)>,
    /// Position of the sensor or of the contact, if stated.
    position: Option<DVec3>,
    /// The field of the position.
    field: &'static str,
}

impl<'a> Judged<'a> {
    /// A press; `pose` is the sensor's, if stated.
    pub(crate) fn press(
        reading: &'a Reading,
        sensor: &'a SensorDescription,
        pose: Option<Pose>,
    ) -> Self {
        let position = pose.map(|pose| pose.translation);
        Self { press: Some((reading, sensor)), position, field: "/pose/position" }
    }

    /// A contact without an image.
    pub(crate) fn contact(position: DVec3) -> Self {
        Self { press: None, position: Some(position), field: "/contact/position" }
    }
}

/// The probable mistakes in one reading.
pub(crate) fn of_reading(judged: Judged<'_>) -> Vec<Hint> {
    let press = judged.press.map(|(reading, sensor)| plausible::of_pressures(reading, sensor));
    let of_image = press.into_iter().flatten().map(|doubt| hint("/image", doubt));
    let position = judged.position.and_then(plausible::of_position);
    of_image.chain(position.map(|doubt| hint(judged.field, doubt))).collect()
}

fn hint(field: &'static str, (doubt, detail): (Doubt, String)) -> Hint {
    let code = match doubt {
        Doubt::PressureUnit => WarningCode::PressureUnit,
        Doubt::PressureLow => WarningCode::PressureLow,
        Doubt::NotTared => WarningCode::NotTared,
        Doubt::Saturated => WarningCode::Saturated,
        Doubt::PositionUnit => WarningCode::PositionUnit,
        Doubt::PositionFar => WarningCode::PositionFar,
        Doubt::PositionsApart => WarningCode::PositionsApart,
    };
    Hint { code, field, detail }
}

/// The probable mistakes in the readings of one request: at most one warning of a kind, at
/// the first reading concerned. All are of one object; `first` is the position of the
/// object's or the session's first reading, if there is one.
pub(crate) fn of_readings(readings: &[Judged<'_>], first: Option<DVec3>) -> Vec<Warning> {
    let first = first.or_else(|| readings.iter().find_map(|judged| judged.position));
    let mut found: BTreeMap<WarningCode, (usize, usize, Hint)> = BTreeMap::new();
    for (index, judged) in readings.iter().enumerate() {
        let mut hints = of_reading(*judged);
        let both = first.zip(judged.position);
        let apart = both.and_then(|(first, here)| plausible::of_two_positions(first, here));
        hints.extend(apart.map(|doubt| hint(judged.field, doubt)));
        for hint in hints {
            found.entry(hint.code).or_insert((index, 0, hint)).1 += 1;
        }
    }
    let warning = |(index, n, hint): (usize, usize, Hint)| {
        let others = match n {
            1 => String::new(),
            n => format!(" ({n} of {} readings)", readings.len()),
        };
        Warning {
            code: hint.code,
            pointer: format!("/readings/{index}{}", hint.field),
            detail: format!("{}{others}", hint.detail),
        }
    };
    found.into_values().map(warning).collect()
}

#[cfg(test)]
mod tests;
