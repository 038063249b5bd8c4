//! What every taxel class says at every place of a planar map, laid out for fast sums.
//!
//! Translation of an object is a pure shift of its map, so one rotated copy of the class
//! log-likelihoods an angle serves all translations: a taxel adds one window of its class's
//! plane. Planes are sampled `m` times a bin and stored by phase, so that a window is
//! contiguous. Values are relative to a place of which the map knows nothing.
//! Not here: beliefs (`histogram`, `particle`).

use std::f64::consts::TAU;

use glam::DVec2;
use rayon::prelude::*;

use crate::occupancy::{ClassTable, ClassifiedPress, ContactClass, OccupancyGrid};
use crate::pose::Pose;
use crate::units::MM;

/// The largest distance between samples of a plane, metres; a taxel is looked up within half
/// of it along each axis.
pub const SAMPLE_MAX: f64 = 0.4 * MM;

/// Distance between samples of a [`ClassField`], metres.
const FIELD_SAMPLE: f64 = 0.2 * MM;

const N_CLASSES: usize = 3;

/// ln Pr(class | place) less ln Pr(class | a place the map does not know), for one object.
#[derive(Clone, Debug)]
struct Relative<'a> {
    map: &'a OccupancyGrid,
    table: &'a ClassTable,
    unknown: [f64; N_CLASSES],
}

const CLASSES: [ContactClass; N_CLASSES] =
    [ContactClass::InContact, ContactClass::NoContact, ContactClass::Unknown];

impl<'a> Relative<'a> {
    fn new(map: &'a OccupancyGrid, table: &'a ClassTable) -> Self {
        let prior = (map.prior() / (1.0 - map.prior())).ln();
        let unknown = CLASSES.map(|class| table.probability(class, prior).ln());
        Self { map, table, unknown }
    }

    fn at(&self, place: DVec2) -> [f32; N_CLASSES] {
        self.mean_at(std::iter::once(place))
    }

    /// The mean probability over several places, relative to one that the map does not know.
    fn mean_at(&self, places: impl Iterator<Item = DVec2>) -> [f32; N_CLASSES] {
        let (mut sums, mut n) = ([0.0; N_CLASSES], 0.0);
        for place in places {
            let log_odds = self.map.log_odds_at(place.extend(self.map.shape().min().z));
            for (sum, class) in sums.iter_mut().zip(CLASSES) {
                *sum += self.table.probability(class, log_odds);
            }
            n += 1.0;
        }
        std::array::from_fn(|class| ((sums[class] / n).ln() - self.unknown[class]) as f32)
    }

    /// How far from the object's origin the map says anything, metres.
    fn radius(&self) -> f64 {
        let shape = self.map.shape();
        let low = shape.min().truncate() - 0.5 * shape.cell();
        let n = DVec2::new(shape.n()[0] as f64, shape.n()[1] as f64);
        let high = low + (n + 1.0) * shape.cell();
        low.abs().max(high.abs()).length()
    }
}

/// The class log-likelihoods of one planar map, for single look-ups.
#[derive(Clone, Debug)]
pub struct ClassField {
    radius: f64,
    side: usize,
    values: Vec<[f32; N_CLASSES]>,
    unknown: [f64; N_CLASSES],
}

impl ClassField {
    /// Samples a map every 0.2 mm.
    #[must_use]
    pub fn new(map: &OccupancyGrid, table: &ClassTable) -> Self {
        let relative = Relative::new(map, table);
        let radius = relative.radius();
        let side = (2.0 * radius / FIELD_SAMPLE).ceil() as usize + 1;
        let mut values = vec![[0.0; N_CLASSES]; side * side];
        values.par_chunks_mut(side).enumerate().for_each(|(row, values)| {
            for (col, value) in values.iter_mut().enumerate() {
                let place = DVec2::new(col as f64, row as f64) * FIELD_SAMPLE - radius;
                *value = relative.at(place);
            }
        });
        Self { radius, side, values, unknown: relative.unknown }
    }

    /// ln Pr(press | the object at a planar pose), each taxel at the nearest sample.
    #[must_use]
    pub fn log_likelihood(&self, press: &ClassifiedPress, session_from_object: &Pose) -> f64 {
        let object_from_session = session_from_object.inverse();
        let along_x = object_from_session.turn(glam::DVec3::X).truncate() / FIELD_SAMPLE;
        let along_y = object_from_session.turn(glam::DVec3::Y).truncate() / FIELD_SAMPLE;
        let first = object_from_session.translation.truncate() / FIELD_SAMPLE
            + (self.radius / FIELD_SAMPLE + 0.5);
        let mut sum = 0.0;
        for (point, class) in press.taxels() {
            let place = first + point.x * along_x + point.y * along_y;
            let (col, row) = (place.x.floor(), place.y.floor());
            sum += self.unknown[*class as usize];
            let side = self.side as f64;
            if col >= 0.0 && row >= 0.0 && col < side && row < side {
                let value = &self.values[row as usize * self.side + col as usize];
                sum += f64::from(value[*class as usize]);
            }
        }
        sum
    }
}

/// What a bin stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BinShare {
    /// Its centre, as printed: a coarse bin contradicts the truth that lies off its centre.
    Center,
    /// All of it: a taxel's probability is the mean over the bin's extent along x, y and
    /// angle, by 27 places (the centre and a third of the sides to each side of it).
    Extent,
}

impl BinShare {
    /// The steps along one axis of unit length at which a bin is sampled.
    fn steps(self) -> &'static [f64] {
        match self {
            Self::Center => &[0.0],
            Self::Extent => &[-1.0 / 3.0, 0.0, 1.0 / 3.0],
        }
    }
}

/// How many samples of a plane lie in one bin, and how far they are apart.
#[derive(Clone, Copy, Debug)]
struct Phases {
    per_bin: usize,
    step: f64,
}

impl Phases {
    fn new(bin: f64) -> Self {
        let per_bin = (bin / SAMPLE_MAX).ceil().max(1.0) as usize;
        Self { per_bin, step: bin / per_bin as f64 }
    }
}

/// The planes of one object at all angles.
#[derive(Clone, Debug)]
pub(super) struct ObjectPlanes {
    radius: f64,
    x: Phases,
    y: Phases,
    /// Slots of a phase along x and y.
    slots: [usize; 2],
    /// Angle, class, phase of y, slot of y, phase of x, slot of x.
    values: Vec<f32>,
    unknown: [f64; N_CLASSES],
}

/// A window of a plane for the first bin: what one taxel adds to all bins of an angle.
struct Window<'a> {
    plane: &'a [f32],
    /// Slot of the first bin along x and y; may lie outside.
    first: [i64; 2],
    row: usize,
}

impl ObjectPlanes {
    /// Planes for bins of `bin` metres along x and y and `n_angles` angles, of which the k-th
    /// is centred on (k + ½)·2π/n.
    pub(super) fn new(
        map: &OccupancyGrid,
        table: &ClassTable,
        bin: DVec2,
        n_angles: usize,
        share: BinShare,
    ) -> Self {
        let relative = Relative::new(map, table);
        let radius = relative.radius();
        let (x, y) = (Phases::new(bin.x), Phases::new(bin.y));
        let slots = [x, y].map(|axis| {
            let samples = (2.0 * radius / axis.step).ceil() as usize + 1;
            samples.div_ceil(axis.per_bin)
        });
        let row = x.per_bin * slots[0];
        let plane = row * y.per_bin * slots[1];
        let mut values = vec![0.0f32; n_angles * N_CLASSES * plane];
        values.par_chunks_mut(N_CLASSES * plane).enumerate().for_each(|(k, planes)| {
            let turned = |step: f64| {
                DVec2::from_angle(-center_of_angle(k, n_angles) - step * TAU / n_angles as f64)
            };
            let turns: Vec<DVec2> = share.steps().iter().map(|step| turned(*step)).collect();
            for idx in 0..plane {
                let (at_y, at_x) = (idx / row, idx % row);
                // Sample = slot · per_bin + phase, stored phase first.
                let col = at_x % slots[0] * x.per_bin + at_x / slots[0];
                let line = at_y % slots[1] * y.per_bin + at_y / slots[1];
                // Samples count the translation less the taxel's place.
                let shift = DVec2::new(col as f64 * x.step, line as f64 * y.step) - radius;
                let moved = share
                    .steps()
                    .iter()
                    .flat_map(|x| share.steps().iter().map(move |y| DVec2::new(*x, *y) * bin));
                let places = moved
                    .flat_map(|moved| turns.iter().map(move |turn| turn.rotate(-(shift + moved))));
                let value = relative.mean_at(places);
                for class in 0..N_CLASSES {
                    planes[class * plane + idx] = value[class];
                }
            }
        });
        Self { radius, x, y, slots, values, unknown: relative.unknown }
    }

    /// Bytes of the planes.
    pub(super) fn bytes(&self) -> usize {
        self.values.len() * size_of::<f32>()
    }

    /// ln Pr(press) under a map that knows nothing: what all values are relative to.
    pub(super) fn unknown(&self, press: &ClassifiedPress) -> f64 {
        press.taxels().iter().map(|(_, class)| self.unknown[*class as usize]).sum()
    }

    fn window(&self, angle: usize, class: ContactClass, first_bin_from_taxel: DVec2) -> Window<'_> {
        let row = self.x.per_bin * self.slots[0];
        let size = row * self.y.per_bin * self.slots[1];
        let start = (angle * N_CLASSES + class as usize) * size;
        let place = |along: f64, axis: Phases| {
            let sample = ((along + self.radius) / axis.step).round() as i64;
            let per_bin = axis.per_bin as i64;
            (sample.rem_euclid(per_bin) as usize, sample.div_euclid(per_bin))
        };
        let (phase_x, first_x) = place(first_bin_from_taxel.x, self.x);
        let (phase_y, first_y) = place(first_bin_from_taxel.y, self.y);
        let offset = phase_y * self.slots[1] * row + phase_x * self.slots[0];
        let plane = &self.values[start + offset..start + size];
        Window { plane, first: [first_x, first_y], row }
    }

    /// Adds what a press says to all bins of an angle. `first_bin` is the translation of the
    /// first (metres), `n` the bins along x and y, x fastest in `sums`.
    pub(super) fn add_all(
        &self,
        angle: usize,
        press: &ClassifiedPress,
        first_bin: DVec2,
        n: [usize; 2],
        sums: &mut [f32],
    ) {
        for (point, class) in press.taxels() {
            let window = self.window(angle, *class, first_bin - point.truncate());
            let inside = |axis: usize| {
                let (first, slots) = (window.first[axis], self.slots[axis] as i64);
                let clip = |bin: i64| bin.clamp(0, n[axis] as i64) as usize;
                clip(-first)..clip(slots - first)
            };
            let (bins_x, bins_y) = (inside(0), inside(1));
            if bins_x.is_empty() {
                continue;
            }
            let first_slot = (window.first[0] + bins_x.start as i64) as usize;
            for bin_y in bins_y {
                let slot_y = (window.first[1] + bin_y as i64) as usize;
                let values = &window.plane[slot_y * window.row + first_slot..][..bins_x.len()];
                let sums = &mut sums[bin_y * n[0]..][bins_x.clone()];
                sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
            }
        }
    }

    /// The same for some bins of an angle: `sums[i]` belongs to the bin `bins[i]`.
    pub(super) fn add_some(
        &self,
        angle: usize,
        press: &ClassifiedPress,
        first_bin: DVec2,
        (n_x, bins): (usize, &[u32]),
        sums: &mut [f32],
    ) {
        for (point, class) in press.taxels() {
            let window = self.window(angle, *class, first_bin - point.truncate());
            for (sum, bin) in sums.iter_mut().zip(bins) {
                let slot_x = window.first[0] + i64::from(*bin) % n_x as i64;
                let slot_y = window.first[1] + i64::from(*bin) / n_x as i64;
                let inside = (0..self.slots[0] as i64).contains(&slot_x)
                    && (0..self.slots[1] as i64).contains(&slot_y);
                if inside {
                    *sum += window.plane[slot_y as usize * window.row + slot_x as usize];
                }
            }
        }
    }
}

/// The angle on which the k-th of n bins of the full turn is centred, radians.
pub(super) fn center_of_angle(k: usize, n: usize) -> f64 {
    (k as f64 + 0.5) * TAU / n as f64
}
