//! The space of a press: the points that it shows to be free, and those that it shows to be
//! occupied.
//!
//! Negative evidence. At free taxels, in the sensor's body, and along the way of a miss there is
//! no material; behind pressed taxels there is. `model::solid` holds a map's material;
//! `verify::free_space` compares both. Points are relative to the session's anchor, metres.

use glam::{DVec3, Vec3};
use palpate_core::reading::point_contact::PointContact;
use palpate_core::reading::{Looseness, Reading};
use palpate_core::sensor::SensorDescription;

use super::placement::{apart_by, kept};

/// Points along each side of the array, at most.
const SIDE: usize = 4;

/// Distance of these points, metres.
const BETWEEN: f64 = 0.003;

/// Share of the maximum below which taxels are free.
const FREE: f64 = 0.1;

/// Share of the maximum above which taxels are pressed.
const PRESSED: f64 = 0.6;

/// Depth of the occupied point behind a pressed taxel, beyond the covering, metres.
const BEYOND: f64 = 0.001;

/// Thickness of the sensor's body behind its covering, metres.
const BODY: f64 = 0.004;

/// Steps along the way of a miss, metres.
const STEP: f64 = 0.005;

/// Longest part of that way that is used, metres.
const WAY_MAX: f64 = 0.3;

/// Deviation of the object's motion that halves the weight of a press, metres.
const HALF: f32 = 0.003;

/// Points that a press shows to be free or occupied.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PressSpace {
    pub(crate) free: Vec<Vec3>,
    pub(crate) occupied: Vec<Vec3>,
    /// The number of touches at the press, its own included.
    touches: usize,
    /// Variance (m²) of the points' place by the sensor itself: that of a contact without an image.
    own: f32,
    /// Probability that no earlier press was at its place.
    novelty: f32,
    /// Weight: its novelty, less after motion of the object.
    pub(crate) weight: f32,
}

impl PressSpace {
    /// Heap bytes of its lists.
    pub(crate) fn bytes(&self) -> usize {
        (self.free.capacity() + self.occupied.capacity()) * size_of::<Vec3>()
    }

    fn new(free: Vec<Vec3>) -> Self {
        Self { free, occupied: Vec::new(), touches: 0, own: 0.0, novelty: 1.0, weight: 1.0 }
    }

    /// The space of a press at which the session had this many touches.
    pub(crate) fn after(self, touches: usize) -> Self {
        Self { touches, ..self }
    }

    /// Discounts it for motion between any two of the session's `touches`. Equation R14 of
    /// docs/recogniser.md.
    pub(crate) fn discount(&mut self, touches: usize, motion: &Looseness) {
        let moves = (touches - self.touches) as f32;
        let moved = moves * motion.position.powi(2) as f32;
        self.weight = self.novelty * kept(moved + self.own, HALF);
    }

    /// The space of a press of this novelty.
    pub(crate) fn of_novelty(self, novelty: f32) -> Self {
        Self { novelty, weight: novelty * self.weight, ..self }
    }

    /// The space of a miss with its novelty beside `earlier` presses: a miss along the way of an
    /// earlier one shows nothing new unless the object has moved by `drift` between them. Equation
    /// R2 of docs/recogniser.md.
    pub(crate) fn weighed(self, earlier: &[Self], drift: Option<&Looseness>) -> Self {
        let moved = |other: &Self| {
            let moves = self.touches.saturating_sub(other.touches) as f32;
            drift.map_or(0.0, |by| 3.0 * moves * by.position.powi(2) as f32)
        };
        let repeats = |other: &Self| {
            let is_alike = other.free.len() == self.free.len() && other.occupied.is_empty();
            let apart = self.free.iter().zip(&other.free).map(|(a, b)| a.distance(*b));
            let apart = apart.fold(0.0, f32::max).hypot(moved(other).sqrt());
            if is_alike { other.novelty * (1.0 - apart_by(apart)) } else { 0.0 }
        };
        let novelty = earlier.iter().map(|other| 1.0 - repeats(other)).product();
        self.of_novelty(novelty)
    }

    /// The space of a contact without an image that touched: nothing is known about the sensor's
    /// body, and that something is there the density of the touch says already.
    pub(crate) fn of_contact() -> Self {
        Self::new(Vec::new())
    }

    /// The space of a contact without an image that touched nothing: its position, and its way
    /// there. Equation R11a of docs/recogniser.md.
    pub(crate) fn of_missed_contact(contact: &PointContact, anchor: DVec3) -> Self {
        let back = contact.normal().map_or(DVec3::ZERO, |normal| normal.direction);
        let way = contact.approach().min(WAY_MAX);
        let steps = (way / STEP).ceil() as usize;
        let point = |step: usize| {
            (contact.position() + (step as f64 * STEP).min(way) * back - anchor).as_vec3()
        };
        let own = contact.position_deviation().powi(2) as f32;
        Self { own, weight: kept(own, HALF), ..Self::new((0..=steps).map(point).collect()) }
    }

    /// The space of a touch.
    pub(crate) fn of_touch(reading: &Reading, sensor: &SensorDescription, anchor: DVec3) -> Self {
        let session_from_sensor = reading.session_from_sensor();
        let place = |x: f64, y: f64, z: f64| {
            let at = sensor.on_covering(x, y) + z * DVec3::Z;
            (session_from_sensor * at - anchor).as_vec3()
        };
        let image = reading.image();
        let behind = -(sensor.parameters().covering_thickness + BODY);
        let mut space = Self::new(Vec::new());
        // A single taxel or row does not show which part of it is pressed.
        let shown = samples(reading, sensor).filter(|_| sensor.grid().is_area());
        for (x, y, [low, high]) in shown {
            if high < FREE * image.max() {
                space.free.push(place(x, y, 0.0));
            } else if low > PRESSED * image.max() {
                space.occupied.push(place(x, y, BEYOND));
            }
        }
        let (x, y) = half_sides(sensor);
        // A finger is narrow behind its skin.
        let corners = [(0.0, 0.0), (-x, -y), (-x, y), (x, -y), (x, y)];
        let n = if sensor.radius().is_some() { 1 } else { corners.len() };
        space.free.extend(corners[..n].iter().map(|(x, y)| place(*x, *y, behind)));
        space
    }

    /// The space of a miss along the sensor's +z.
    pub(crate) fn of_miss(reading: &Reading, sensor: &SensorDescription, anchor: DVec3) -> Self {
        let session_from_sensor = reading.session_from_sensor();
        let way = reading.approach().min(WAY_MAX);
        let steps = (way / STEP).ceil() as usize;
        let mut free = Vec::with_capacity(SIDE * SIDE * (steps + 1));
        for step in 0..=steps {
            let back = (step as f64 * STEP).min(way) * DVec3::Z;
            free.extend(samples(reading, sensor).map(|(x, y, _)| {
                (session_from_sensor * (sensor.on_covering(x, y) - back) - anchor).as_vec3()
            }));
        }
        Self::new(free)
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
    let points = |half: f64| ((2.0 * half / BETWEEN - 1e-9).ceil() as usize).clamp(1, SIDE);
    let (n_x, n_y) = (points(half_x), points(half_y));
    let (reach_x, reach_y) = (half_x / n_x as f64 + 1e-9, half_y / n_y as f64 + 1e-9);
    let half_pitch = 0.5 * grid.pitch + 1e-9;
    (0..n_x * n_y).map(move |index| {
        let share = |n: usize, of: usize| (2 * n + 1) as f64 / of as f64 - 1.0;
        let (x, y) = (half_x * share(index % n_x, n_x), half_y * share(index / n_x, n_y));
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for taxel in 0..grid.n_taxels() {
            let (tx, ty) = grid.center(taxel / grid.cols, taxel % grid.cols);
            // The taxels of a cell; with fewer than four per side, the one that contains it.
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

/// A miss before the session has an anchor.
#[derive(Clone, Debug)]
pub(crate) enum Miss {
    /// A press, with its sensor.
    Press { reading: Reading, sensor: SensorDescription },
    /// A contact without an image.
    Contact(PointContact),
}

impl Miss {
    /// Bytes with its image, about.
    pub(crate) fn bytes(&self) -> usize {
        let heap = match self {
            Self::Press { reading, .. } => reading.image().pressures.len() * size_of::<f64>(),
            Self::Contact(_) => 0,
        };
        size_of::<Self>() + heap
    }

    /// Its space, once there is an anchor.
    pub(crate) fn space(&self, anchor: DVec3) -> PressSpace {
        match self {
            Self::Press { reading, sensor } => PressSpace::of_miss(reading, sensor, anchor),
            Self::Contact(contact) => PressSpace::of_missed_contact(contact, anchor),
        }
    }
}
