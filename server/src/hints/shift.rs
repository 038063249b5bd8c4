//! Warning about a session whose touches are all off in the same way.

use palpate_core::belief::answer::SensorShift;
use palpate_core::units::MM;
use palpate_schemas::{Warning, WarningCode};

/// Number of touches from which the warning is given. Chosen: fewer touches hardly tell a shift
/// of the sensor from the object's pose.
const TOUCHES_MIN: usize = 6;
/// Least shift, metres. Chosen: a calibrated arm and tool are wrong by less.
const SHIFT_MIN: f64 = 1.0 * MM;
/// Least shift in standard deviations. Chosen: the deviations leave the map's own errors out.
const DEVIATIONS_MIN: f64 = 4.0;

/// The warning, if the shift is large and certain.
pub(crate) fn of_session(found: &SensorShift) -> Option<Warning> {
    let (shift, deviation) = (found.shift.to_array(), found.deviation.to_array());
    let is_off =
        |axis: &usize| shift[*axis].abs() > SHIFT_MIN.max(DEVIATIONS_MIN * deviation[*axis]);
    if found.n_touches < TOUCHES_MIN {
        return None;
    }
    let axis = (0..3).filter(is_off).max_by(|a, b| shift[*a].abs().total_cmp(&shift[*b].abs()))?;
    let [x, y, z] = shift.map(|metres| format!("{:+.1}", metres / MM));
    let cause = if axis == 2 {
        "is the tool centre too long or too short, or the covering of another stiffness than \
         described?"
    } else {
        "is the tool centre right?"
    };
    let detail = format!(
        "all {} touches fit best with the sensor {x}, {y}, {z} mm (x, y, z of the sensor frame) \
         beside its stated pose, ± {:.1} mm along {}: {cause}",
        found.n_touches,
        deviation[axis] / MM,
        ["x", "y", "z"][axis],
    );
    Some(Warning { code: WarningCode::SensorShifted, pointer: String::new(), detail })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn warned(shift: [f64; 3], deviation: f64, n_touches: usize) -> Option<String> {
        let shift = DVec3::from_array(shift) * MM;
        let deviation = DVec3::splat(deviation * MM);
        of_session(&SensorShift { shift, deviation, n_touches }).map(|warning| warning.detail)
    }

    #[test]
    fn a_shift_is_named_once_it_is_large_and_certain() {
        let said = warned([0.1, -0.2, 2.3], 0.3, 8).unwrap();
        assert!(said.contains("+0.1, -0.2, +2.3 mm") && said.contains("along z"), "{said}");
        assert!(said.contains("too long or too short"), "{said}");
        assert!(warned([3.0, 0.0, 2.0], 0.3, 8).unwrap().contains("along x"));
        assert_eq!(warned([0.0, 0.0, 2.3], 0.3, 5), None, "too few touches");
        assert_eq!(warned([0.0, 0.0, 2.3], 0.6, 8), None, "not certain");
        assert_eq!(warned([0.0, 0.0, 0.9], 0.1, 8), None, "within what arms are wrong by");
    }
}
