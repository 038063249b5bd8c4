//! The contact pattern: where a press says that there is nothing, and where there is something.
//!
//! Negative evidence. Where taxels stayed free, in the sensor's body, and all along the way of
//! a press that met nothing, there is no material; behind taxels that were pressed there is.
//! Beyond the dissertation; what a map knows of material is `surface::solid`. Points are
//! relative to the session's anchor, metres.

use glam::{DVec3, Vec3};

use super::placement::left;
use super::turned::Turned;
use crate::surface::SurfaceMap;
use palpate_core::reading::{Looseness, Reading};
use palpate_core::sensor::SensorDescription;

/// So many points along each side of the array.
const SIDE: usize = 4;

/// Taxels that read less than this share of the maximum are free, more than [`PRESSED`] pressed.
const FREE: f64 = 0.1;
const PRESSED: f64 = 0.6;

/// Behind a pressed taxel the object is so far beyond the covering, metres.
const BEYOND: f64 = 0.001;

/// The sensor's body is so thick behind its covering, metres.
const BODY: f64 = 0.004;

/// The way of a press that met nothing is looked at in steps of this many metres, and no more
/// of it than this.
const STEP: f64 = 0.005;
const WAY_MAX: f64 = 0.3;

/// Where the object may have moved by as much (m) a press says half of what it did of space.
const HALF: f32 = 0.003;

/// What presses say of free and of occupied space.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pattern {
    free: Vec<Vec3>,
    occupied: Vec<Vec3>,
    /// How many touches there were, with its own.
    touches: usize,
    /// What it counts: less where the object may have moved since.
    weight: f32,
}

/// How much a contradicted point says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatternScale {
    /// A point that contradicts a pose makes it less likely by this (ln).
    pub point: f32,
    /// All points of one press together by this at the most: sensors and maps err.
    pub press_max: f32,
}

impl Pattern {
    /// Bytes behind its lists.
    pub(super) fn bytes(&self) -> usize {
        (self.free.capacity() + self.occupied.capacity()) * size_of::<Vec3>()
    }

    fn new(free: Vec<Vec3>) -> Self {
        Self { free, occupied: Vec::new(), touches: 0, weight: 1.0 }
    }

    /// The pattern of a press when the session had so many touches.
    pub(super) fn after(self, touches: usize) -> Self {
        Self { touches, ..self }
    }

    /// There are so many touches now, and between any two the object may have moved so far.
    pub(super) fn age(&mut self, touches: usize, motion: &Looseness) {
        let moves = (touches - self.touches) as f32;
        let moved = moves * motion.position.powi(2) as f32;
        self.weight = left(moved, HALF);
    }

    /// The pattern of a press that touched.
    pub(super) fn of_touch(reading: &Reading, sensor: &SensorDescription, anchor: DVec3) -> Self {
        let session_from_sensor = reading.session_from_sensor();
        let place =
            |x: f64, y: f64, z: f64| (session_from_sensor * DVec3::new(x, y, z) - anchor).as_vec3();
        let image = reading.image();
        let behind = -(sensor.parameters().covering_thickness + BODY);
        let mut pattern = Self::new(Vec::new());
        for (x, y, [low, high]) in samples(reading, sensor) {
            if high < FREE * image.max() {
                pattern.free.push(place(x, y, 0.0));
            } else if low > PRESSED * image.max() {
                pattern.occupied.push(place(x, y, BEYOND));
            }
        }
        let (x, y) = half_sides(sensor);
        let body = [(0.0, 0.0), (-x, -y), (-x, y), (x, -y), (x, y)];
        pattern.free.extend(body.map(|(x, y)| place(x, y, behind)));
        pattern
    }

    /// The pattern of a press that met nothing on its way along the sensor's +z.
    pub(super) fn of_miss(reading: &Reading, sensor: &SensorDescription, anchor: DVec3) -> Self {
        let session_from_sensor = reading.session_from_sensor();
        let way = reading.approach().min(WAY_MAX);
        let steps = (way / STEP).ceil() as usize;
        let mut free = Vec::with_capacity(SIDE * SIDE * (steps + 1));
        for step in 0..=steps {
            let z = -(step as f64 * STEP).min(way);
            free.extend(
                samples(reading, sensor).map(|(x, y, _)| {
                    (session_from_sensor * DVec3::new(x, y, z) - anchor).as_vec3()
                }),
            );
        }
        Self::new(free)
    }

    /// What the press says against a pose: 0 for nothing, less than that in ln.
    #[inline]
    pub(super) fn contradiction(
        &self,
        map: &SurfaceMap,
        pose: &Turned,
        scale: &PatternScale,
    ) -> f32 {
        let solid = map.solid();
        let mut sum = 0.0;
        let free = self.free.iter().filter(|point| solid.is_solid(pose.place(**point)));
        for _point in free {
            sum += scale.point;
            if sum >= scale.press_max {
                return -self.weight * scale.press_max;
            }
        }
        let occupied = self.occupied.iter().filter(|p| solid.is_vacant(pose.place(**p)));
        sum += scale.point * occupied.count() as f32;
        -self.weight * sum.min(scale.press_max)
    }
}

/// Points of the array (x, y in metres), and the lowest and highest pressure of the taxels about
/// each.
fn samples(
    reading: &Reading,
    sensor: &SensorDescription,
) -> impl Iterator<Item = (f64, f64, [f64; 2])> {
    let (image, grid) = (reading.image(), sensor.grid());
    let (half_x, half_y) = half_sides(sensor);
    let (reach_x, reach_y) = (half_x / SIDE as f64 + 1e-9, half_y / SIDE as f64 + 1e-9);
    let half_pitch = 0.5 * grid.pitch + 1e-9;
    (0..SIDE * SIDE).map(move |index| {
        let share = |n: usize| (2 * n + 1) as f64 / SIDE as f64 - 1.0;
        let (x, y) = (half_x * share(index % SIDE), half_y * share(index / SIDE));
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for taxel in 0..grid.n_taxels() {
            let (tx, ty) = grid.center(taxel / grid.cols, taxel % grid.cols);
            // A cell's own taxels; with fewer than four a side, the one that it lies in.
            let (reach_x, reach_y) = (reach_x.max(half_pitch), reach_y.max(half_pitch));
            if (tx - x).abs() <= reach_x && (ty - y).abs() <= reach_y {
                let pressure = image.pressures[taxel];
                range = [range[0].min(pressure), range[1].max(pressure)];
            }
        }
        (x, y, range)
    })
}

/// Half the sides of the array, metres.
fn half_sides(sensor: &SensorDescription) -> (f64, f64) {
    let grid = sensor.grid();
    let half = |n: usize| 0.5 * n as f64 * grid.pitch;
    (half(grid.cols), half(grid.rows))
}

impl Turned {
    /// A point of the session in the object frame.
    #[inline]
    pub(super) fn place(&self, point: Vec3) -> Vec3 {
        self.object_from_session * (point - self.translation)
    }
}

/// A press that met nothing, before the session has an anchor.
#[derive(Clone, Debug)]
pub(super) struct Miss {
    pub(super) reading: Reading,
    pub(super) sensor: SensorDescription,
}

impl Miss {
    /// Bytes with its image, about.
    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>() + self.reading.image().pressures.len() * size_of::<f64>()
    }

    /// Its pattern, once there is an anchor.
    pub(super) fn pattern(&self, anchor: DVec3) -> Pattern {
        Pattern::of_miss(&self.reading, &self.sensor, anchor)
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::belief::test_support::{map_of, places};
    use palpate_core::pose::Pose;
    use palpate_core::reading::SensorId;
    use palpate_core::units::MM;

    const SCALE: PatternScale = PatternScale { point: 0.5, press_max: 3.0 };

    /// A press of a 6×6 sensor (12 mm square in the preset), pressed where `rows` has a `#`.
    fn press(rows: &[&str], pose: Pose) -> Reading {
        let sensor = SensorDescription::digitacts_6x6();
        let pressure = |c| Some(if c == '#' { 10_000.0 } else { 0.0 });
        let pressures: Vec<Option<f64>> = rows.concat().chars().map(pressure).collect();
        Reading::new(SensorId(0), &sensor, &pressures, pose).unwrap()
    }

    const BROAD: [&str; 6] = ["......", ".####.", ".####.", ".####.", ".####.", "......"];
    const SPOT: [&str; 6] = ["......", "......", "..##..", "..##..", "......", "......"];

    /// The sensor's face at a height (m) over the middle of the ellipsoid's broad side, looking
    /// down; its half axes are 40, 30 and 20 mm.
    fn above(height: f64) -> Pose {
        let down = DQuat::from_rotation_x(std::f64::consts::PI);
        Pose::from_parts(down, DVec3::new(0.0, 0.0, 20.0 * MM + height))
    }

    fn contradiction(pattern: &Pattern) -> f32 {
        let pose = Turned::new(glam::Quat::IDENTITY, Vec3::ZERO);
        pattern.contradiction(&map_of(&places(3_000, 0)), &pose, &SCALE)
    }

    fn touch(rows: &[&str], pose: Pose) -> Pattern {
        let sensor = SensorDescription::digitacts_6x6();
        Pattern::of_touch(&press(rows, pose), &sensor, DVec3::ZERO)
    }

    #[test]
    fn a_press_on_the_surface_contradicts_nothing() {
        // Sixteen points of the array and five of the body. About the middle four some taxels of
        // the spot are pressed and some are free; of the broad contact all are pressed there, and
        // some about all others.
        let (spot, broad) = (touch(&SPOT, above(0.0)), touch(&BROAD, above(0.0)));
        assert_eq!((spot.free.len(), spot.occupied.len()), (17, 0));
        assert_eq!((broad.free.len(), broad.occupied.len()), (5, 4));
        for pattern in [spot, broad] {
            assert!(contradiction(&pattern).abs() < 1e-6);
        }
    }

    #[test]
    fn a_press_inside_the_object_and_one_far_from_it_contradict_it() {
        // 15 mm inside all free points are within: the press says no more than it may.
        assert!((contradiction(&touch(&SPOT, above(-15.0 * MM))) + 3.0).abs() < 1e-6);
        // 30 mm above four pressed points have nothing behind them: 4 · 0.5.
        assert!((contradiction(&touch(&BROAD, above(30.0 * MM))) + 2.0).abs() < 1e-6);
    }

    #[test]
    fn a_way_through_the_object_contradicts_it_and_one_beside_it_does_not() {
        let sensor = SensorDescription::digitacts_6x6();
        let miss = |x: f64, way: f64| {
            // Below the object, having come down along z.
            let pose = above(-60.0 * MM);
            let pose = Pose::from_parts(pose.rotation, pose.translation + DVec3::X * x);
            let reading = press(&["......"; 6], pose).after_approach(way);
            contradiction(&Pattern::of_miss(&reading, &sensor, DVec3::ZERO))
        };
        assert!((miss(0.0, 0.1) + 3.0).abs() < 1e-6);
        assert!(miss(0.07, 0.1).abs() < 1e-6, "70 mm beside");
        assert!(miss(0.0, 0.0).abs() < 1e-6, "nobody said that it came through");
    }
}
