//! Orient: fits a plane to the pressed taxels and turns the sensor part of the way to it.
//!
//! Source: algorithm 1, with its sign, its missing normalisation and its degenerate cases
//! settled in `docs/equations.md`: towards the sensor, by slerp, and no command from fewer
//! than three points or from points on a line.

use glam::{DMat3, DQuat, DVec3};
use palpate_core::sensor::SensorDescription;

use super::ContactConfig;

/// The command of Orient, a rotation in the sensor frame; `None` within the tolerance.
pub(super) fn command(
    sensor: &SensorDescription,
    pressures: &[f64],
    config: &ContactConfig,
) -> Option<DQuat> {
    let full = turn_to_surface(sensor, pressures, config.contact_threshold)?;
    let angle = full.angle_between(DQuat::IDENTITY);
    (angle > config.orient_tolerance)
        .then(|| DQuat::IDENTITY.slerp(full, config.orient_step).normalize())
}

/// The shortest rotation, in the sensor frame, that makes the sensor face the surface it feels.
///
/// `pressures` in Pa, row-major in the sensor frame's order. Taxels above `threshold` (Pa)
/// are points of the surface; their depth is the inverse of the force curve. `None` for fewer
/// than three of them or when they lie on a line. Source: algorithm 1.
#[must_use]
pub fn turn_to_surface(
    sensor: &SensorDescription,
    pressures: &[f64],
    threshold: f64,
) -> Option<DQuat> {
    let points: Vec<DVec3> = pressures
        .iter()
        .enumerate()
        .filter(|(_, pressure)| **pressure > threshold)
        .map(|(index, pressure)| {
            let taxel = sensor.taxel(index);
            let displaced = sensor.parameters().force_curve.displacement(*pressure);
            taxel.position - displaced * taxel.normal
        })
        .collect();
    let (slope_x, slope_y) = plane_slopes(&points)?;
    // The surface is z = slope_x x + slope_y y + c; this normal points away from the sensor.
    let normal = DVec3::new(-slope_x, -slope_y, 1.0).normalize();
    Some(DQuat::from_rotation_arc(DVec3::Z, normal))
}

/// The slopes of the plane through `points` with the least squared distances along z.
fn plane_slopes(points: &[DVec3]) -> Option<(f64, f64)> {
    if points.len() < 3 {
        return None;
    }
    let mean = points.iter().sum::<DVec3>() / points.len() as f64;
    let mut moments = DMat3::ZERO;
    for point in points {
        let offset = *point - mean;
        moments += DMat3::from_cols(offset * offset.x, offset * offset.y, offset * offset.z);
    }
    let (xx, xy, yy) = (moments.x_axis.x, moments.x_axis.y, moments.y_axis.y);
    let (xz, yz) = (moments.x_axis.z, moments.y_axis.z);
    let determinant = xx * yy - xy * xy;
    // On a line the determinant vanishes beside the square of the trace.
    if determinant <= 1e-9 * (xx + yy).powi(2) {
        return None;
    }
    let slope_x = (xz * yy - yz * xy) / determinant;
    let slope_y = (yz * xx - xz * xy) / determinant;
    Some((slope_x, slope_y))
}

#[cfg(test)]
mod tests {
    use palpate_core::units::{DEG, KPA, MM};

    use super::*;

    fn pressures(depth: impl Fn(f64, f64) -> f64) -> Vec<f64> {
        let sensor = SensorDescription::digitacts_6x6();
        let grid = sensor.grid();
        (0..36)
            .map(|taxel| {
                let (x, y) = grid.center(taxel / 6, taxel % 6);
                sensor.parameters().force_curve.pressure(depth(x, y))
            })
            .collect()
    }

    #[test]
    fn a_tilted_plane_turns_the_sensor_to_face_it() {
        // Depth 1 mm + x·tan 5°: the surface is z = −1 mm − x·tan 5°, its normal away from
        // the sensor (tan 5°, 0, 1), which is z turned by +5° about y.
        let sensor = SensorDescription::digitacts_6x6();
        let tilted = pressures(|x, _| 1.0 * MM + x * (5.0 * DEG).tan());
        let rotation = turn_to_surface(&sensor, &tilted, 0.5 * KPA).unwrap();
        let facing = rotation * DVec3::Z;
        let expected = DVec3::new((5.0 * DEG).sin(), 0.0, (5.0 * DEG).cos());
        assert!(facing.distance(expected) < 1e-9, "{facing}");
    }

    #[test]
    fn one_command_turns_three_tenths_of_the_angle() {
        let sensor = SensorDescription::digitacts_6x6();
        let config = ContactConfig::for_sensor(&sensor, crate::noise::NoiseLevel::NONE);
        let tilted = pressures(|_, y| 1.0 * MM + y * (10.0 * DEG).tan());
        let rotation = command(&sensor, &tilted, &config).unwrap();
        let facing = rotation * DVec3::Z;
        assert!((facing.angle_between(DVec3::Z) - 3.0 * DEG).abs() < 1e-6);
        assert_eq!(command(&sensor, &pressures(|_, _| 1.0 * MM), &config), None);
    }

    #[test]
    fn few_or_collinear_points_give_no_command() {
        let sensor = SensorDescription::digitacts_6x6();
        let turn = |pressed: &[usize]| {
            let mut image = vec![0.0; 36];
            pressed.iter().for_each(|taxel| image[*taxel] = 5.0 * KPA + *taxel as f64);
            turn_to_surface(&sensor, &image, 1.0 * KPA)
        };
        assert_eq!(turn(&[]), None);
        assert_eq!(turn(&[0, 7]), None);
        assert_eq!(turn(&[0, 7, 14, 21, 28, 35]), None);
        assert!(turn(&[0, 1, 6]).is_some());
    }
}
