//! Conversion of misfits: how readings lie on the nearest object, and what speaks against it.

use std::f64::consts::LN_2;

use palpate_core::units::MM;
use palpate_recogniser::belief::Misfit;
use palpate_schemas::{Objection, ObjectionCode, ReadingMisfit};

/// Height from which a touch is off the surface, metres. Chosen: 2.5 deviations of a refined touch
/// (0.6 mm, equation R21 of docs/recogniser.md).
const HEIGHT_OFF: f64 = 1.5 * MM;

/// Angle from which a normal is another one, rad. Chosen: beyond what uneven presses turn.
const TURN_OFF: f64 = 0.5;

/// Bits from which an image is unlike those of training, and from which space speaks against an
/// object. Chosen: odds of two to one in a single reading.
const UNLIKE_BITS: f64 = -1.0;

/// Share of readings that make an objection. Chosen: fewer are single mistakes, which
/// `disagrees` marks.
const SHARE_MIN: f64 = 0.25;

/// A misfit in its wire form.
pub(crate) fn misfit(of: &Misfit) -> ReadingMisfit {
    ReadingMisfit {
        touched: of.is_touch,
        height_m: of.height,
        turn_rad: of.turn,
        appearance_bits: of.appearance.map(|log| log / LN_2),
        free_space_bits: of.free_space / LN_2,
    }
}

/// What may object: its kind, the value that grows with the misfit, and the least that counts.
type Test<'a> = (ObjectionCode, &'a dyn Fn(&ReadingMisfit) -> Option<f64>, f64);

/// Median of values that are not empty.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// What speaks against the object of this name, by the misfits of readings with their numbers;
/// the objection of most readings first.
pub(crate) fn against(name: &str, misfits: &[(u32, ReadingMisfit)]) -> Vec<Objection> {
    use ObjectionCode::{
        AboveSurface, AwayFromSurface, BelowSurface, FreeSpace, OtherNormal, UnlikeImages,
    };
    let height = |m: &ReadingMisfit| m.height_m;
    let depth = |m: &ReadingMisfit| m.height_m.map(|height| -height);
    let missing = |m: &ReadingMisfit| (m.touched && m.height_m.is_none()).then_some(1.0);
    let turn = |m: &ReadingMisfit| m.turn_rad;
    let unlike = |m: &ReadingMisfit| m.appearance_bits.map(|bits| -bits);
    let space = |m: &ReadingMisfit| Some(-m.free_space_bits);
    let tests: [Test<'_>; 6] = [
        (AboveSurface, &height, HEIGHT_OFF),
        (BelowSurface, &depth, HEIGHT_OFF),
        (AwayFromSurface, &missing, 0.5),
        (OtherNormal, &turn, TURN_OFF),
        (UnlikeImages, &unlike, -UNLIKE_BITS),
        (FreeSpace, &space, -UNLIKE_BITS),
    ];
    let n = misfits.len();
    let objection = |(code, value, least): Test<'_>| {
        let found = misfits.iter().filter_map(|(number, m)| Some((*number, value(m)?)));
        let (readings, values): (Vec<u32>, Vec<f64>) =
            found.filter(|(_, value)| *value >= least).unzip();
        let is_common = readings.len() >= 2 && readings.len() as f64 >= SHARE_MIN * n as f64;
        is_common.then(|| {
            let detail = words(code, name, readings.len(), n, median(values));
            Objection { code, readings, detail }
        })
    };
    let mut against: Vec<Objection> = tests.into_iter().filter_map(objection).collect();
    against.sort_by_key(|objection| std::cmp::Reverse(objection.readings.len()));
    against
}

/// An objection in words; `median` of what its readings exceed.
fn words(code: ObjectionCode, name: &str, readings: usize, of: usize, median: f64) -> String {
    let share = format!("{readings} of {of} readings");
    match code {
        ObjectionCode::AboveSurface => format!(
            "{share} lie {:.1} mm (median) above the surface of {name:?}: a larger object, a tool \
             centre that is stated too far back, or a unit of position",
            median / MM
        ),
        ObjectionCode::BelowSurface => format!(
            "{share} lie {:.1} mm (median) below the surface of {name:?}: a smaller object, a tool \
             centre that is stated too far ahead, or a softer covering than described",
            median / MM
        ),
        ObjectionCode::AwayFromSurface => format!(
            "{share} touched something where {name:?} has no surface: another object, or an \
             object that moved"
        ),
        ObjectionCode::OtherNormal => format!(
            "{share} felt a normal that is {:.0} degrees (median) from that of {name:?} there: \
             another shape, a mirrored or turned image, or a tilted tool",
            median.to_degrees()
        ),
        ObjectionCode::UnlikeImages => format!(
            "{share} have an image that is unlike those of {name:?} there, by {median:.1} bits \
             (median): another shape, another unit of pressure, or a sensor unlike that of training"
        ),
        ObjectionCode::FreeSpace => format!(
            "{share} found space free that {name:?} fills, or felt something where it has nothing, \
             at a loss of {median:.1} bits (median)"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(height_mm: f64) -> ReadingMisfit {
        ReadingMisfit {
            touched: true,
            height_m: Some(height_mm * MM),
            turn_rad: Some(0.1),
            appearance_bits: Some(2.0),
            free_space_bits: 0.0,
        }
    }

    fn objections(misfits: &[ReadingMisfit]) -> Vec<(ObjectionCode, Vec<u32>)> {
        let numbered: Vec<(u32, ReadingMisfit)> = (0..).zip(misfits.iter().copied()).collect();
        against("mug", &numbered).into_iter().map(|one| (one.code, one.readings)).collect()
    }

    #[test]
    fn objections_name_the_readings_that_share_a_fault() {
        let fits = at(0.2);
        assert_eq!(objections(&[fits; 6]), []);
        let turned = ReadingMisfit { turn_rad: Some(0.9), ..fits };
        let high = [at(2.0), at(2.4), at(3.0), at(-1.0), turned, turned];
        let expected = [
            (ObjectionCode::AboveSurface, vec![0, 1, 2]),
            (ObjectionCode::OtherNormal, vec![4, 5]),
        ];
        assert_eq!(objections(&high), expected);
        let nowhere =
            ReadingMisfit { height_m: None, turn_rad: None, appearance_bits: None, ..fits };
        let miss = ReadingMisfit { touched: false, free_space_bits: -4.0, ..nowhere };
        let expected =
            [(ObjectionCode::AwayFromSurface, vec![0, 1]), (ObjectionCode::FreeSpace, vec![2, 3])];
        assert_eq!(objections(&[nowhere, nowhere, miss, miss, fits]), expected);
        assert_eq!(objections(&[nowhere, fits, fits]), [], "one reading is a mistake of its own");
    }

    #[test]
    fn an_objection_states_the_median_in_its_unit() {
        let misfits = [(0, at(2.0)), (1, at(2.5)), (2, at(9.0))];
        let detail = against("mug", &misfits).remove(0).detail;
        assert!(detail.starts_with("3 of 3 readings lie 2.5 mm (median) above"), "{detail}");
    }
}
