//! A touch: position, normal, stretch and appearance of the surface under the sensor (equation R1),
//! or position and perhaps normal of a contact without an image (equation R1a).
//!
//! The frame is that of the reading's pose. The stretch is the second moment of the contact's
//! pressure (section 4.3.2.4); it has no sign: ±direction are equal.

use glam::{DVec2, DVec3, Mat3};

use crate::model::SurfacePatch;
use crate::model::agreement::{Feature, N_AXES, unstored};
use crate::model::appearance::AppearanceSpace;
use palpate_core::contact::touches;
use palpate_core::contact::{CONTACT_SHARE, center_of_pressure};
use palpate_core::reading::point_contact::PointContact;
use palpate_core::reading::{Reading, TactileImage};
use palpate_core::sensor::SensorDescription;
use palpate_core::units::MM;

/// Area that a contact can press evenly, square metres; the rest of a larger array is in free air.
const EVEN_AREA: f64 = 12.0 * MM * 12.0 * MM;

/// Deviation (rad) of the surface's normal from the axis of a single taxel: a sensor that presses
/// further off slides along the surface.
const AXIS_DEVIATION: f64 = 0.6;

/// The same for a single row of taxels, whose own pressures show how the surface lies along it.
const ROW_DEVIATION: f64 = 0.43;

/// The same for a curved skin, which shows where it was touched and so how the surface lies.
const SKIN_DEVIATION: f64 = 0.3;

/// Deviation of a place known to lie within a width of 1, evenly.
const EVENLY: f64 = 0.289;

/// What a contact without an image leaves open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointDeviations {
    /// Standard deviation of the position in each direction, metres.
    pub position: f64,
    /// Standard deviation of the normal about either axis, rad; `None` when no normal was felt.
    pub normal: Option<f64>,
}

impl PointDeviations {
    /// What a press leaves open that has no image which the catalogue can compare: by a single taxel
    /// or a single row, or by a curved skin unlike that of the training. `None` for others. Part of
    /// equation R1a.
    fn of_sensor(sensor: &SensorDescription, space: &AppearanceSpace) -> Option<Self> {
        let grid = sensor.grid();
        if grid.is_area() {
            let is_foreign = sensor.radius().is_some() && space.grid() != grid;
            let (position, normal) = (EVENLY * grid.pitch, Some(SKIN_DEVIATION));
            return is_foreign.then_some(Self { position, normal });
        }
        let is_single = grid.n_taxels() == 1;
        let normal = if is_single { AXIS_DEVIATION } else { ROW_DEVIATION };
        Some(Self { position: EVENLY * grid.pitch, normal: Some(normal) })
    }
}

/// One press with contact, or one contact without an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Touch {
    /// The centre of pressure on the covering's surface, metres.
    pub position: DVec3,
    /// The outward normal of the surface, norm 1; zero when none was felt.
    pub normal: DVec3,
    /// Direction in which the contact is stretched: norm 1, at right angles to the normal.
    pub direction: DVec3,
    /// The sensor's +x axis in the frame of the pose, norm 1; zero for a contact without an image,
    /// whose sensor has no stated axes.
    pub sensor_x: DVec3,
    /// Elongation: (λ₁ − λ₂)/(λ₁ + λ₂) of the second moments, 0 to 1.
    pub elongation: f64,
    /// Evenness of the press, 0 to 1: mean pressure over peak. Corners, tips and contacts of the rim
    /// alone press little of the array.
    pub evenness: f64,
    /// Appearance; it counts only if there was an image.
    pub feature: Feature,
    /// The deviations of a contact without an image, which has neither appearance nor stretch;
    /// `None` for a press.
    pub point: Option<PointDeviations>,
    /// Standard deviation of the stated place of a press in each direction, metres: the looseness of
    /// its sensor's passport.
    pub looseness: f64,
}

impl Touch {
    /// The even press that a training learnt as a patch, in the object frame.
    pub(crate) fn of_patch(patch: &SurfacePatch) -> Self {
        Self {
            position: patch.position.as_dvec3(),
            normal: patch.normal.as_dvec3(),
            direction: patch.direction.as_dvec3(),
            sensor_x: patch.direction.as_dvec3(),
            elongation: f64::from(patch.elongation),
            evenness: 1.0,
            feature: unstored(&patch.feature),
            point: None,
            looseness: 0.0,
        }
    }

    /// Standard deviation (m) of its place in each direction that is its own: that of a contact
    /// without an image, and of the passport.
    pub(crate) fn own_deviation(&self) -> f64 {
        self.point.map_or(0.0, |point| point.position).hypot(self.looseness)
    }

    /// The sensor's axes as columns, in the frame of the pose: its +z is against the normal. Zero
    /// for a contact without an image.
    pub(crate) fn sensor_axes(&self) -> Mat3 {
        if self.sensor_x == DVec3::ZERO {
            return Mat3::ZERO;
        }
        let (x, z) = (self.sensor_x, -self.normal);
        Mat3::from_cols(x.as_vec3(), z.cross(x).as_vec3(), z.as_vec3())
    }
}

/// The touch of a reading, or `None` for a miss.
#[must_use]
pub fn observe_touch(
    reading: &Reading,
    sensor: &SensorDescription,
    space: &AppearanceSpace,
) -> Option<Touch> {
    if !touches(reading, sensor) {
        return None;
    }
    let image = reading.image();
    let session_from_sensor = reading.session_from_sensor();
    if let Some(point) = PointDeviations::of_sensor(sensor, space) {
        return Some(Touch {
            position: session_from_sensor * center_of_pressure(image, sensor),
            normal: session_from_sensor.turn(DVec3::NEG_Z),
            direction: session_from_sensor.turn(DVec3::X),
            sensor_x: session_from_sensor.turn(DVec3::X),
            elongation: 0.0,
            evenness: 1.0,
            feature: [0.0; N_AXES],
            point: Some(point),
            looseness: reading.looseness(),
        });
    }
    let (direction, elongation) = stretch(image, sensor);
    Some(Touch {
        position: session_from_sensor * center_of_pressure(image, sensor),
        normal: session_from_sensor.turn(DVec3::NEG_Z),
        direction: session_from_sensor.turn(direction.extend(0.0)),
        sensor_x: session_from_sensor.turn(DVec3::X),
        elongation,
        evenness: evenness(image, sensor),
        feature: space.feature(image, sensor.grid()),
        point: None,
        looseness: reading.looseness(),
    })
}

/// The touch of a contact without an image, or `None` where nothing was touched. Equation R1a of
/// docs/recogniser.md.
#[must_use]
pub fn observe_contact(contact: &PointContact) -> Option<Touch> {
    if !contact.touched() {
        return None;
    }
    let normal = contact.normal();
    Some(Touch {
        position: contact.position(),
        normal: normal.map_or(DVec3::ZERO, |normal| normal.direction),
        direction: normal.map_or(DVec3::X, |normal| normal.direction.any_orthonormal_vector()),
        sensor_x: DVec3::ZERO,
        elongation: 0.0,
        evenness: 1.0,
        feature: [0.0; N_AXES],
        point: Some(PointDeviations {
            position: contact.position_deviation(),
            normal: normal.map(|normal| normal.deviation),
        }),
        looseness: 0.0,
    })
}

/// Mean pressure over peak; for an array larger than [`EVEN_AREA`] the mean is over that area.
fn evenness(image: &TactileImage, sensor: &SensorDescription) -> f64 {
    let max = image.max();
    if max <= 0.0 {
        return 0.0;
    }
    let taxel = sensor.grid().pitch.powi(2);
    let area = (taxel * image.pressures.len() as f64).min(EVEN_AREA);
    let borne: f64 = image.pressures.iter().map(|pressure| pressure.max(0.0)).sum();
    (borne / max * taxel / area).min(1.0)
}

/// The direction (in the sensor's plane, norm 1) and the elongation of a contact.
fn stretch(image: &TactileImage, sensor: &SensorDescription) -> (DVec2, f64) {
    let center = center_of_pressure(image, sensor).truncate();
    let threshold = 0.5 * CONTACT_SHARE * image.max();
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for row in 0..image.rows {
        for col in 0..image.cols {
            let excess = (image.at(row, col) - threshold).max(0.0);
            let off = DVec2::from(sensor.grid().center(row, col)) - center;
            xx += excess * off.x * off.x;
            xy += excess * off.x * off.y;
            yy += excess * off.y * off.y;
        }
    }
    let (along, across, total) = (xx - yy, 2.0 * xy, xx + yy);
    if total <= 0.0 {
        return (DVec2::X, 0.0);
    }
    let angle = 0.5 * across.atan2(along);
    (DVec2::from_angle(angle), (along.hypot(across) / total).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::agreement::N_AXES;
    use crate::model::appearance::raw_descriptor;
    use palpate_core::descriptor::Descriptor as _;
    use palpate_core::pose::Pose;
    use palpate_core::reading::SensorId;
    use palpate_core::sensor::{SensorParameters, TaxelGrid};
    use palpate_core::vocabulary::discriminant::Discriminant;

    fn space(sensor: &SensorDescription) -> AppearanceSpace {
        let dimension = raw_descriptor(sensor.grid()).dimension() + 1;
        let axes = vec![vec![1.0; dimension]];
        let projection = Discriminant { mean: vec![0.0; dimension], axes };
        AppearanceSpace::new(*sensor.grid(), projection, Vec::new())
    }

    fn touch_of(rows: &[&str], pose: Pose) -> Option<Touch> {
        let sensor = SensorDescription::digitacts_6x6();
        let pressure = |c| Some(if c == '#' { 10_000.0 } else { 0.0 });
        let pressures: Vec<Option<f64>> = rows.concat().chars().map(pressure).collect();
        let reading = Reading::new(SensorId(0), &sensor, &pressures, pose).unwrap();
        observe_touch(&reading, &sensor, &space(&sensor))
    }

    #[test]
    fn elongation_is_how_much_the_moments_differ() {
        // 2 × 4 taxels: variances along x and y are 1.25 and 0.25, so 1 / 1.5.
        let rows = ["......", "......", ".####.", ".####.", "......", "......"];
        let touch = touch_of(&rows, Pose::IDENTITY).unwrap();
        assert!((touch.elongation - 1.0 / 1.5).abs() < 1e-9, "{}", touch.elongation);
        assert!((touch.direction.x.abs() - 1.0).abs() < 1e-9, "{}", touch.direction);
        let line = ["#.....", ".#....", "..#...", "...#..", "....#.", ".....#"];
        let touch = touch_of(&line, Pose::IDENTITY).unwrap();
        assert!((touch.elongation - 1.0).abs() < 1e-9);
        assert!((touch.direction.x * touch.direction.y - 0.5).abs() < 1e-9, "{}", touch.direction);
        let square = ["......", "......", "..##..", "..##..", "......", "......"];
        assert!(touch_of(&square, Pose::IDENTITY).unwrap().elongation.abs() < 1e-9);
    }

    #[test]
    fn evenness_is_mean_over_peak_of_at_most_a_contacts_area() {
        let even = |rows: [&str; 6]| touch_of(&rows, Pose::IDENTITY).unwrap().evenness;
        assert!((even(["######"; 6]) - 1.0).abs() < 1e-9);
        // 9 of 36 taxels, at a corner.
        let corner = ["###...", "###...", "###...", "......", "......", "......"];
        assert!((even(corner) - 0.25).abs() < 1e-9);
        // The same 9 taxels of 2 mm on an array twice as wide.
        let wide = SensorDescription::digitacts(12, 12);
        let pressure = |taxel: usize| if taxel / 12 < 3 && taxel % 12 < 3 { 1e4 } else { 0.0 };
        let pressures: Vec<Option<f64>> = (0..144).map(|taxel| Some(pressure(taxel))).collect();
        let reading = Reading::new(SensorId(0), &wide, &pressures, Pose::IDENTITY).unwrap();
        assert!((evenness(reading.image(), &wide) - 0.25).abs() < 1e-9);
    }

    #[test]
    fn a_touch_moves_with_its_sensor_and_looks_the_same() {
        // Two columns right of the centre: x = 4 mm. A quarter turn about x takes y to z.
        let rows = ["....##", "....##", "....##", "....##", "....##", "....##"];
        let turn = glam::DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
        let pose = Pose::from_parts(turn, DVec3::new(1.0, 2.0, 3.0));
        let (still, moved) = (touch_of(&rows, Pose::IDENTITY), touch_of(&rows, pose));
        let (still, moved) = (still.unwrap(), moved.unwrap());
        assert!(moved.position.distance(DVec3::new(1.0 + 4.0 * MM, 2.0, 3.0)) < 1e-12);
        // The sensor faces its +z, so that the touched surface faces −z, here rotated to +y.
        assert!(moved.normal.distance(DVec3::Y) < 1e-12, "{}", moved.normal);
        assert!((moved.direction.z.abs() - 1.0).abs() < 1e-9, "{}", moved.direction);
        assert_eq!(moved.feature.map(f32::to_bits), still.feature.map(f32::to_bits));
        assert!(still.feature[0].abs() > 1e-3 && still.feature[N_AXES - 1].abs() < 1e-9);
    }

    #[test]
    fn a_press_that_touched_nothing_is_no_touch() {
        assert_eq!(touch_of(&["......"; 6], Pose::IDENTITY), None);
    }

    #[test]
    fn single_taxels_and_rows_say_where_and_about_which_way() {
        let six = SensorDescription::digitacts_6x6();
        for (rows, cols, deviation) in [(1, 1, 0.6), (1, 8, 0.43), (8, 1, 0.43)] {
            let grid = TaxelGrid { rows, cols, ..*six.grid() };
            let parameters = SensorParameters { grid, ..six.parameters().clone() };
            let sensor = SensorDescription::new(parameters).unwrap();
            // The last taxel alone: 7 mm off the middle of eight.
            let mut pressures = vec![Some(0.0); rows * cols];
            pressures[rows * cols - 1] = Some(9_000.0);
            let reading = Reading::new(SensorId(0), &sensor, &pressures, Pose::IDENTITY).unwrap();
            let touch = observe_touch(&reading, &sensor, &space(&six)).unwrap();
            let point = touch.point.unwrap();
            assert_eq!(point.normal, Some(deviation));
            // 2 mm / √12.
            assert!((point.position - 0.577 * MM).abs() < 0.002 * MM, "{point:?}");
            let (x, y) = grid.center(rows - 1, cols - 1);
            assert!(touch.position.distance(DVec3::new(x, y, 0.0)) < 1e-12);
            assert!(touch.elongation.abs() < 1e-12 && touch.normal == DVec3::NEG_Z);
            let quiet = vec![Some(0.0); rows * cols];
            let reading = Reading::new(SensorId(0), &sensor, &quiet, Pose::IDENTITY).unwrap();
            assert_eq!(observe_touch(&reading, &sensor, &space(&six)), None);
        }
    }
}
