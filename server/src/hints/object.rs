//! Warnings about trained objects: a probably wrong unit, or too few touches.

use palpate_core::contact::touches;
use palpate_core::plausible::{SIZE_LARGE, SIZE_SMALL, meant};
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::units::Shown;
use palpate_schemas::{ObjectReport, SensorKnowledge, SkippedObject, Warning, WarningCode};

/// Number of touches below which an object's symmetry and much of its surface are unknown.
/// Derived: the search for symmetries needs as many.
const TOUCHES_FEW: usize = 60;
/// Distance of two places, metres. Chosen: half the finest pitch of the arrays.
const PLACE: f64 = 1e-3;
/// Ratio of two sizes from which they are in different units rather than of different
/// objects. Chosen: 1,000 is the factor of metres and millimetres, and objects of one
/// catalogue differ by less than 100 (a ring of 20 mm, a door of 2 m).
const SIZES_FACTOR: f64 = 200.0;

/// Statistics of an object's training readings.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Touched {
    /// Number of readings.
    pub(crate) n_readings: usize,
    /// Number of readings with contact.
    pub(crate) n_touches: usize,
    /// Number of places that these touched, as far as [`TOUCHES_FEW`]; that of the touches without
    /// poses.
    pub(crate) n_places: usize,
    /// The largest extent of the touches along an axis, metres.
    pub(crate) size: f64,
    /// The largest pressure of all readings, Pa.
    pub(crate) max_pressure: f64,
}

impl Touched {
    /// Statistics of the readings of one sensor; `are_placed` when they have poses.
    pub(crate) fn of(readings: &[Reading], sensor: &SensorDescription, are_placed: bool) -> Self {
        let felt: Vec<&Reading> = readings.iter().filter(|r| touches(r, sensor)).collect();
        let positions = || felt.iter().map(|r| r.session_from_sensor().translation);
        let size = match positions().next() {
            Some(first) if are_placed => {
                let low = positions().fold(first, glam::DVec3::min);
                let high = positions().fold(first, glam::DVec3::max);
                (high - low).max_element()
            }
            _ => 0.0,
        };
        let n_places = if are_placed { n_places(positions()) } else { felt.len() };
        let max_pressure = readings.iter().map(|r| r.image().max()).fold(0.0, f64::max);
        Self { n_readings: readings.len(), n_touches: felt.len(), n_places, size, max_pressure }
    }

    /// The probable unit of the pressures, when nothing was touched.
    pub(crate) fn meant(&self, sensor: &SensorDescription) -> String {
        let max = Shown(self.max_pressure);
        format!("the largest value is {max}, {}", meant(self.max_pressure, sensor))
    }
}

/// Number of positions (m) that are [`PLACE`] apart, at most [`TOUCHES_FEW`].
fn n_places(positions: impl Iterator<Item = glam::DVec3>) -> usize {
    let mut places: Vec<glam::DVec3> = Vec::new();
    for position in positions {
        if places.len() < TOUCHES_FEW && places.iter().all(|at| at.distance(position) > PLACE) {
            places.push(position);
        }
    }
    places.len()
}

/// The probable mistakes in an object's training data.
pub(crate) fn of_object(touched: &Touched, has_mesh: bool) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let mut warn = |code, detail| {
        warnings.push(Warning { code, pointer: String::new(), detail });
    };
    let what = if has_mesh { "the mesh" } else { "what the readings touched" };
    if touched.size > SIZE_LARGE {
        let unit = if has_mesh { "is its unit right" } else { "are positions in metres" };
        let detail = format!("{what} is {} m large: {unit}?", Shown(touched.size));
        warn(WarningCode::ObjectLarge, detail);
    }
    if touched.size > 0.0 && touched.size < SIZE_SMALL {
        let unit = if has_mesh { "is its unit right" } else { "are positions in metres" };
        let detail = format!("{what} is {} mm small: {unit}?", Shown(touched.size * 1e3));
        warn(WarningCode::ObjectSmall, detail);
    }
    if touched.n_touches < TOUCHES_FEW {
        let detail = format!(
            "{} of {} readings touched it, and below {TOUCHES_FEW} neither its surface nor its \
             symmetry is known",
            touched.n_touches, touched.n_readings
        );
        warn(WarningCode::FewTouches, detail);
    } else if touched.n_places < TOUCHES_FEW {
        let detail = format!(
            "{} of {} readings touched it, but only {} places that are a millimetre apart, and \
             below {TOUCHES_FEW} neither its surface nor its symmetry is known",
            touched.n_touches, touched.n_readings, touched.n_places
        );
        warn(WarningCode::FewTouches, detail);
    }
    warnings
}

/// The probable mistakes in a training as a whole.
pub(crate) fn of_catalogue(
    sizes: &[(&ObjectReport, f64)],
    skipped: &[SkippedObject],
) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let placed = || sizes.iter().filter(|(_, size)| *size > 0.0);
    let by_size = |a: &&(&ObjectReport, f64), b: &&(&ObjectReport, f64)| a.1.total_cmp(&b.1);
    if let (Some((small, low)), Some((large, high))) =
        (placed().min_by(by_size), placed().max_by(by_size))
        && high / low > SIZES_FACTOR
    {
        let detail = format!(
            "object {:?} is {} m large and {:?} only {} m: are both in the same unit?",
            large.name,
            Shown(*high),
            small.name,
            Shown(*low)
        );
        let pointer = "/objects".to_owned();
        warnings.push(Warning { code: WarningCode::SizesDiffer, pointer, detail });
    }
    if let Some(first) = skipped.first() {
        let detail = match skipped.len() {
            1 => format!("object {:?} was left out: {}", first.name, first.reason),
            n => format!("{n} objects were left out, first {:?}: {}", first.name, first.reason),
        };
        let pointer = "/skipped".to_owned();
        warnings.push(Warning { code: WarningCode::ObjectsSkipped, pointer, detail });
    }
    warnings
}

/// Warns of objects with equal shapes or readings, given the names of the first pair and the number
/// of pairs.
pub(crate) fn of_twins(([one, other], n_pairs): ([String; 2], usize)) -> Warning {
    let others = match n_pairs {
        0 | 1 => String::new(),
        2 => " (and one more pair)".to_owned(),
        n => format!(" (and {} more pairs)", n - 1),
    };
    let detail = format!(
        "objects {one:?} and {other:?} have the same shape{others}: touch cannot tell them apart, so \
         no belief gets sure of either; remove one of them, or accept either answer"
    );
    Warning { code: WarningCode::DuplicateObjects, pointer: "/objects".to_owned(), detail }
}

/// A training that trusts its sensor as an earlier version did, and not as the sensor states.
pub(crate) fn of_kept_knowledge(
    level: SensorKnowledge,
    version: u32,
    (sensor, stated): (&str, SensorKnowledge),
) -> Warning {
    let (level, stated) = (level.name(), stated.name());
    let detail = format!(
        "meshes were pressed as `{level}`, which is kept from version {version}, but the sensor \
         {sensor:?} is `{stated}`: train anew with `sensor_knowledge` `{stated}` unless `{level}` is \
         right"
    );
    Warning { code: WarningCode::KnowledgeKept, pointer: "/sensor_knowledge".to_owned(), detail }
}
