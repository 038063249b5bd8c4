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
mod units;

use std::collections::BTreeMap;

use glam::DVec3;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::units::Shown;
use palpate_schemas::{Warning, WarningCode};
pub(crate) use palpate_sim::mesh::{SIZE_LARGE, SIZE_SMALL};

pub(crate) use clock::{SetBack, of_clock};
pub(crate) use image_order::of_images;
pub(crate) use object::{Touched, of_catalogue, of_kept_knowledge, of_object, of_twins};
pub(crate) use shift::of_session;
use units::{is_structured, meant};

/// Reach of an arm from the origin of its frame, metres. Chosen: the longest industrial arms
/// reach 3 to 4 m.
const REACH: f64 = 5.0;
/// Share of the saturation above which no sensor reads: noise and calibration add less. Chosen.
const SATURATION_SHARE_MAX: f64 = 1.5;
/// Share of the saturation below which a press is weak. Chosen: twice the share from which a
/// reading is a contact at all.
const SATURATION_SHARE_LOW: f64 = 0.01;
/// Deviations of the noise by which an untouched taxel may be below zero. Derived: of 100
/// taxels one is beyond that in three of 1,000 images.
const TARE_DEVIATIONS: f64 = 4.0;

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
    let of_image =
        judged.press.map_or_else(Vec::new, |(reading, sensor)| pressures(reading, sensor));
    let mut hints: Vec<Hint> =
        of_image.into_iter().map(|(code, detail)| Hint { code, field: "/image", detail }).collect();
    hints.extend(judged.position.and_then(|position| far(position, judged.field)));
    hints
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
        let apart = both.and_then(|(first, here)| apart(first, here, judged.field));
        hints.extend(apart);
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

fn pressures(reading: &Reading, sensor: &SensorDescription) -> Vec<(WarningCode, String)> {
    let image = reading.image();
    let parameters = sensor.parameters();
    let (max, saturation) = (image.max(), parameters.saturation);
    let min = image.pressures.iter().copied().fold(f64::MAX, f64::min);
    let floor = sensor.contact_floor();
    let mut found = Vec::new();
    if max > 0.0 && max <= floor && is_structured(image, sensor) {
        found.push((WarningCode::PressureUnit, too_small(max, floor, sensor)));
    } else if max > floor && max < SATURATION_SHARE_LOW * saturation {
        let detail = format!(
            "the largest pressure is {} Pa, less than 1 % of the sensor's {} Pa: press harder, or \
             are the values in another unit than pascal?",
            Shown(max),
            Shown(saturation)
        );
        found.push((WarningCode::PressureLow, detail));
    }
    if max > SATURATION_SHARE_MAX * saturation {
        let detail = format!(
            "the largest pressure is {} Pa, above the sensor's saturation of {} Pa: are the values \
             counts of a converter, or in another unit than pascal?",
            Shown(max),
            Shown(saturation)
        );
        found.push((WarningCode::PressureUnit, detail));
    }
    if min < -TARE_DEVIATIONS * parameters.noise.max(parameters.quantisation) {
        let detail = format!("pressures go down to {} Pa: was the sensor tared?", Shown(min));
        found.push((WarningCode::NotTared, detail));
    }
    let n_saturated = image.pressures.iter().filter(|p| **p >= saturation).count();
    if 2 * n_saturated > image.pressures.len() {
        let n = image.pressures.len();
        let detail = format!("{n_saturated} of {n} taxels are saturated: press more lightly");
        found.push((WarningCode::Saturated, detail));
    }
    found
}

/// An image with the shape of a press and too small values.
fn too_small(max: f64, floor: f64, sensor: &SensorDescription) -> String {
    format!(
        "the largest pressure is {} Pa, below the {} Pa from which this sensor feels anything, \
         and yet the image is no noise: {}",
        Shown(max),
        Shown(floor),
        meant(max, sensor)
    )
}

/// A position that no arm reaches.
fn far(position: DVec3, field: &'static str) -> Option<Hint> {
    let distance = position.length();
    if distance <= REACH {
        return None;
    }
    let in_millimetres = distance / 1e3;
    let (code, meant) = if (SIZE_SMALL..=REACH).contains(&in_millimetres) {
        (
            WarningCode::PositionUnit,
            format!("in millimetres it would be {} m, expected metres", Shown(in_millimetres)),
        )
    } else {
        (WarningCode::PositionFar, "expected metres, in a frame near the object".to_owned())
    };
    let detail = format!(
        "the sensor is {} m from the origin of its frame, further than an arm reaches: {meant}",
        Shown(distance)
    );
    Some(Hint { code, field, detail })
}

/// A position too far from the first for both to touch one object.
fn apart(first: DVec3, here: DVec3, field: &'static str) -> Option<Hint> {
    let distance = first.distance(here);
    (distance > SIZE_LARGE).then(|| Hint {
        code: WarningCode::PositionsApart,
        field,
        detail: format!(
            "the sensor is {} m from where the first reading was, and one object of at most \
             {SIZE_LARGE} m is expected: are positions in metres, and in one frame?",
            Shown(distance)
        ),
    })
}

#[cfg(test)]
mod tests;
