//! Probable mistakes in single readings, above all a wrong unit: what a person would notice.
//!
//! Pure functions of checked readings; they change nothing. Not here: refusals, and what only a whole
//! session shows.

mod units;

use glam::DVec3;

use crate::reading::Reading;
use crate::sensor::SensorDescription;
use crate::units::Shown;
use units::is_structured;
pub use units::meant;

/// Reach of an arm from the origin of its frame, metres. Chosen: the longest industrial arms
/// reach 3 to 4 m.
const REACH: f64 = 5.0;
/// Largest plausible size of an object, metres. Chosen: a door or a table is 2 m, and objects
/// that robots touch are smaller.
pub const SIZE_LARGE: f64 = 2.0;
/// Smallest plausible size of an object, metres. Chosen: half the width of the smallest
/// preset's array.
pub const SIZE_SMALL: f64 = 0.005;
/// Share of the saturation above which no sensor reads: noise and calibration add less. Chosen.
const SATURATION_SHARE_MAX: f64 = 1.5;
/// Share of the saturation below which a press is weak. Chosen: twice the share from which a
/// reading is a contact at all.
const SATURATION_SHARE_LOW: f64 = 0.01;
/// Deviations of the noise by which an untouched taxel may be below zero. Derived: of 100
/// taxels one is beyond that in three of 1,000 images.
const TARE_DEVIATIONS: f64 = 4.0;

/// Kind of a probable mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doubt {
    /// Pressures in another unit than pascal.
    PressureUnit,
    /// A weak press.
    PressureLow,
    /// A sensor that was not tared.
    NotTared,
    /// Most taxels saturated.
    Saturated,
    /// Positions in another unit than metres.
    PositionUnit,
    /// A position that no arm reaches.
    PositionFar,
    /// Positions too far from each other for one object.
    PositionsApart,
}

impl Doubt {
    /// Its code in answers.
    #[must_use]
    pub fn code(self) -> &'static str {
        match self {
            Self::PressureUnit => "pressure_unit",
            Self::PressureLow => "pressure_low",
            Self::NotTared => "not_tared",
            Self::Saturated => "saturated",
            Self::PositionUnit => "position_unit",
            Self::PositionFar => "position_far",
            Self::PositionsApart => "positions_apart",
        }
    }
}

/// Probable mistakes in the pressures of a reading, each with a sentence on what was probably meant.
#[must_use]
pub fn of_pressures(reading: &Reading, sensor: &SensorDescription) -> Vec<(Doubt, String)> {
    let image = reading.image();
    let parameters = sensor.parameters();
    let (max, saturation) = (image.max(), parameters.saturation);
    let min = image.pressures.iter().copied().fold(f64::MAX, f64::min);
    let floor = sensor.contact_floor();
    let mut found = Vec::new();
    if max > 0.0 && max <= floor && is_structured(image, sensor) {
        found.push((Doubt::PressureUnit, too_small(max, floor, sensor)));
    } else if max > floor && max < SATURATION_SHARE_LOW * saturation {
        let detail = format!(
            "the largest pressure is {} Pa, less than 1 % of the sensor's {} Pa: press harder, or \
             are the values in another unit than pascal?",
            Shown(max),
            Shown(saturation)
        );
        found.push((Doubt::PressureLow, detail));
    }
    if max > SATURATION_SHARE_MAX * saturation {
        let detail = format!(
            "the largest pressure is {} Pa, above the sensor's saturation of {} Pa: are the values \
             counts of a converter, or in another unit than pascal?",
            Shown(max),
            Shown(saturation)
        );
        found.push((Doubt::PressureUnit, detail));
    }
    if min < -TARE_DEVIATIONS * parameters.noise.max(parameters.quantisation) {
        let detail = format!("pressures go down to {} Pa: was the sensor tared?", Shown(min));
        found.push((Doubt::NotTared, detail));
    }
    let n_saturated = image.pressures.iter().filter(|p| **p >= saturation).count();
    if 2 * n_saturated > image.pressures.len() {
        let n = image.pressures.len();
        let detail = format!("{n_saturated} of {n} taxels are saturated: press more lightly");
        found.push((Doubt::Saturated, detail));
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

/// A position (metres, session frame) that no arm reaches.
#[must_use]
pub fn of_position(position: DVec3) -> Option<(Doubt, String)> {
    let distance = position.length();
    if distance <= REACH {
        return None;
    }
    let in_millimetres = distance / 1e3;
    let (code, meant) = if (SIZE_SMALL..=REACH).contains(&in_millimetres) {
        (
            Doubt::PositionUnit,
            format!("in millimetres it would be {} m, expected metres", Shown(in_millimetres)),
        )
    } else {
        (Doubt::PositionFar, "expected metres, in a frame near the object".to_owned())
    };
    let detail = format!(
        "the sensor is {} m from the origin of its frame, further than an arm reaches: {meant}",
        Shown(distance)
    );
    Some((code, detail))
}

/// A position too far from the first for both to touch one object; metres.
#[must_use]
pub fn of_two_positions(first: DVec3, here: DVec3) -> Option<(Doubt, String)> {
    let distance = first.distance(here);
    (distance > SIZE_LARGE).then(|| {
        let detail = format!(
            "the sensor is {} m from where the first reading was, and one object of at most \
             {SIZE_LARGE} m is expected: are positions in metres, and in one frame?",
            Shown(distance)
        );
        (Doubt::PositionsApart, detail)
    })
}
