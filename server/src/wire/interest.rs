//! Conversion of interest points.

use palpate_core::object::ObjectIdx;
use palpate_recogniser::next_touch::interest::{Interest, InterestPlace, Rival};
use palpate_schemas as wire;
use palpate_store::catalogue::VersionObject;

/// The interest of one of the objects of a version.
pub(crate) fn map(
    objects: &[VersionObject],
    object: ObjectIdx,
    found: &Interest,
) -> wire::InterestMap {
    let VersionObject { id, name } = objects[object.0 as usize].clone();
    let rival = |rival: &Rival| {
        let VersionObject { id, name } = objects[rival.object.0 as usize].clone();
        wire::InterestRival { id, name, likeness: rival.likeness }
    };
    wire::InterestMap {
        id,
        name,
        bits_max: found.bits_max(),
        places: found.places.iter().map(place).collect(),
        rivals: found.rivals.iter().map(rival).collect(),
    }
}

fn place(place: &InterestPlace) -> wire::InterestPlace {
    wire::InterestPlace {
        position: place.position.as_dvec3().to_array(),
        normal: place.normal.as_dvec3().to_array(),
        bits: place.bits,
    }
}
