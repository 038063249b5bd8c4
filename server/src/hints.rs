//! Readings and objects that are accepted and are probably a mistake: the wrong unit above all.
//!
//! A pure judgement: what comes in was checked, what goes out changes nothing. Each warning has a
//! code for programs and a sentence that names what was probably meant.
//! Not here: what is refused (`wire::reading`), and who asks.

mod object;
mod units;

use std::collections::BTreeMap;

use glam::DVec3;
use palpate_core::contact::contact_floor;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::units::Shown;
use palpate_schemas::{Warning, WarningCode};

pub(crate) use object::{Touched, of_catalogue, of_object};
use units::{is_structured, meant};

/// How far an arm reaches from the origin of its frame, metres. Chosen: the longest industrial
/// arms reach 3 to 4 m.
const REACH: f64 = 5.0;
/// Objects that are touched are smaller than this, metres. Chosen: a door or a table is 2 m, and
/// what robots feel and turn is less.
pub(crate) const SIZE_LARGE: f64 = 2.0;
/// Objects that are touched are larger than this, metres. Chosen: half the width of the smallest
/// preset's array.
pub(crate) const SIZE_SMALL: f64 = 0.005;
/// Above this share of the saturation no sensor reads: noise and calibration add less. Chosen.
const SATURATION_SHARE_MAX: f64 = 1.5;
/// A contact below this share of the saturation is weak for a press. Chosen: twice the share from
/// which a reading is a contact at all.
const SATURATION_SHARE_LOW: f64 = 0.01;
/// How many deviations of the noise below zero an untouched taxel may be. Derived: of 100 taxels
/// one is beyond that in three of 1,000 images.
const TARE_DEVIATIONS: f64 = 4.0;

/// What is probably a mistake in a reading, and in which of its fields.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Hint {
    pub(crate) code: WarningCode,
    pub(crate) field: &'static str,
    pub(crate) detail: String,
}

/// A reading to be judged.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Judged<'a> {
    pub(crate) reading: &'a Reading,
    pub(crate) sensor: &'a SensorDescription,
    /// Where the sensor was, if that was said.
    pub(crate) pose: Option<Pose>,
}

/// What is probably a mistake in one reading.
pub(crate) fn of_reading(judged: Judged<'_>) -> Vec<Hint> {
    let mut hints: Vec<Hint> = pressures(&judged)
        .into_iter()
        .map(|(code, detail)| Hint { code, field: "/image", detail })
        .collect();
    hints.extend(judged.pose.and_then(|pose| far(pose.translation)));
    hints
}

/// What is probably a mistake in the readings of one request: at most one warning of a kind, at
/// the first reading that it is about. All are of one object; `first` is where the object's or
/// the session's first reading was, if there is one.
pub(crate) fn of_readings(readings: &[Judged<'_>], first: Option<DVec3>) -> Vec<Warning> {
    let position = |judged: &Judged<'_>| judged.pose.map(|pose| pose.translation);
    let first = first.or_else(|| readings.iter().find_map(position));
    let mut found: BTreeMap<WarningCode, (usize, usize, Hint)> = BTreeMap::new();
    for (index, judged) in readings.iter().enumerate() {
        let mut hints = of_reading(*judged);
        let apart = first.zip(position(judged)).and_then(|(first, here)| apart(first, here));
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

fn pressures(judged: &Judged<'_>) -> Vec<(WarningCode, String)> {
    let (image, sensor) = (judged.reading.image(), judged.sensor);
    let parameters = sensor.parameters();
    let (max, saturation) = (image.max(), parameters.saturation);
    let min = image.pressures.iter().copied().fold(f64::MAX, f64::min);
    let floor = contact_floor(sensor);
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

/// An image that has a press's shape and no press's size.
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
fn far(position: DVec3) -> Option<Hint> {
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
    Some(Hint { code, field: "/pose/position", detail })
}

/// A position that is too far from the first for both to touch one object.
fn apart(first: DVec3, here: DVec3) -> Option<Hint> {
    let distance = first.distance(here);
    (distance > SIZE_LARGE).then(|| Hint {
        code: WarningCode::PositionsApart,
        field: "/pose/position",
        detail: format!(
            "the sensor is {} m from where the first reading was, and one object of at most \
             {SIZE_LARGE} m is expected: are positions in metres, and in one frame?",
            Shown(distance)
        ),
    })
}

#[cfg(test)]
mod tests;
