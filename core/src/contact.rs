//! Contact of a press: its points, their centroid, and the constraint on the normal.
//!
//! Source: section 5.4.2, Algorithm 2; thresholds as settled in `docs/equations.md`: under
//! blur every taxel exceeds a fixed threshold, so a taxel counts as touching when it reads at
//! least half of the maximum, and depth has the unit of x and y (metres). Frame: the
//! sensor's. Not here: the classifier of chapter 3.

use glam::DVec3;
use nalgebra::{Matrix3, SymmetricEigen};

use crate::reading::{Reading, TactileImage};
use crate::sensor::SensorDescription;

/// The fraction of the maximum above which a taxel counts as touching.
pub const CONTACT_SHARE: f64 = 0.5;

/// Ratio of singular values below which a contact is an edge or a point: no constraint.
const MIN_CONSTRAINT: f64 = 0.1;

/// The touching taxels of a press as points in the sensor frame, metres; z is the indentation
/// of the surface there (negative: into the sensor).
#[must_use]
pub fn contact_points(image: &TactileImage, sensor: &SensorDescription) -> Vec<DVec3> {
    let max = image.max();
    if max <= 0.0 {
        return Vec::new();
    }
    let (grid, curve) = (sensor.grid(), &sensor.parameters().force_curve);
    let mut points = Vec::new();
    for row in 0..image.rows {
        for col in 0..image.cols {
            let pressure = image.at(row, col);
            if pressure >= CONTACT_SHARE * max {
                let (x, y) = grid.center(row, col);
                points.push(sensor.on_covering(x, y) - curve.displacement(pressure) * DVec3::Z);
            }
        }
    }
    points
}

/// The centre of pressure over the touching taxels, in the sensor frame's plane (z = 0),
/// metres; the origin for a press without contact.
#[must_use]
pub fn center_of_pressure(image: &TactileImage, sensor: &SensorDescription) -> DVec3 {
    let threshold = CONTACT_SHARE * image.max();
    if threshold <= 0.0 {
        return DVec3::ZERO;
    }
    let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
    for row in 0..image.rows {
        for col in 0..image.cols {
            // Pressure above the threshold, so that a taxel fades in instead of jumping.
            let excess = (image.at(row, col) - threshold).max(0.0);
            let (x, y) = sensor.grid().center(row, col);
            sum += excess * DVec3::new(x, y, 0.0);
            weight += excess;
        }
    }
    if weight > 0.0 { sum / weight } else { DVec3::ZERO }
}

/// The constraint of the contact on the surface normal, from 0 (edge, point) to 1 (planar).
///
/// Algorithm 2: the ratio σ₂/σ₁ of the singular values of the centred contact points; 0 if it
/// is below 0.1 or there are fewer than three points.
#[must_use]
pub fn normal_constraint(points: &[DVec3]) -> f64 {
    if points.len() < 3 {
        return 0.0;
    }
    let mean = points.iter().sum::<DVec3>() / points.len() as f64;
    let mut scatter = Matrix3::zeros();
    for point in points {
        let offset = *point - mean;
        let offset = nalgebra::Vector3::new(offset.x, offset.y, offset.z);
        scatter += offset * offset.transpose();
    }
    let mut squares: Vec<f64> = SymmetricEigen::new(scatter).eigenvalues.iter().copied().collect();
    squares.sort_by(|a, b| b.total_cmp(a));
    if squares[0] <= 0.0 {
        return 0.0;
    }
    let ratio = (squares[1].max(0.0) / squares[0]).sqrt();
    if ratio < MIN_CONSTRAINT { 0.0 } else { ratio }
}

/// True when any taxel reads clearly more than noise ([`SensorDescription::contact_floor`]).
#[must_use]
pub fn touches(reading: &Reading, sensor: &SensorDescription) -> bool {
    reading.image().max() > sensor.contact_floor()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::MM;

    fn image(rows: &[&str]) -> TactileImage {
        let pressures =
            rows.concat().chars().map(|c| if c == '#' { 10_000.0 } else { 1_000.0 }).collect();
        TactileImage { rows: rows.len(), cols: rows[0].len(), pressures }
    }

    #[test]
    fn a_square_contact_fixes_the_normal_and_a_line_does_not() {
        let sensor = SensorDescription::digitacts_6x6();
        let square = image(&["......", ".####.", ".####.", ".####.", ".####.", "......"]);
        let line = image(&["......", "......", "######", "......", "......", "......"]);
        assert!((normal_constraint(&contact_points(&square, &sensor)) - 1.0).abs() < 1e-9);
        assert!(normal_constraint(&contact_points(&line, &sensor)).abs() < 1e-12);
    }

    #[test]
    fn a_rectangles_constraint_is_the_ratio_of_its_deviations() {
        // 2 × 4 taxels: variances (n² − 1)/12 are 0.25 and 1.25, so the ratio is √0.2.
        let sensor = SensorDescription::digitacts_6x6();
        let contact = image(&["......", "......", ".####.", ".####.", "......", "......"]);
        let ratio = normal_constraint(&contact_points(&contact, &sensor));
        assert!((ratio - 0.2_f64.sqrt()).abs() < 1e-9, "{ratio}");
    }

    #[test]
    fn center_of_pressure_follows_the_contact() {
        let sensor = SensorDescription::digitacts_6x6();
        let corner = image(&["....##", "....##", "......", "......", "......", "......"]);
        let center = center_of_pressure(&corner, &sensor);
        assert!(center.distance(DVec3::new(4.0 * MM, -4.0 * MM, 0.0)) < 1e-12, "{center}");
    }
}
