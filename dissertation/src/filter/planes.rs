//! Log-likelihoods of the taxel classes over a planar map, laid out for fast sums.
//!
//! Translation of an object is a pure shift of its map, so one rotated copy of the class
//! log-likelihoods per angle serves all translations: a taxel adds one window of its class's
//! plane. Planes are sampled `m` times a bin and stored by phase, so that a window is
//! contiguous. Values are relative to an unmapped position. Not here: beliefs (`histogram`,
//! `particle`).

use std::f64::consts::TAU;

use glam::DVec2;
use rayon::prelude::*;

use super::class_field::{N_CLASSES, Relative, radius};
use crate::occupancy::{ClassTable, ClassifiedPress, ContactClass, OccupancyGrid};
use palpate_core::units::MM;

/// Largest distance between samples of a plane, metres; a taxel is looked up within half of
/// it along each axis.
pub const SAMPLE_MAX: f64 = 0.4 * MM;

/// Smallest distance between samples of a plane, metres; narrower bins share samples. Chosen:
/// a tenth of a map's usual cell, so that a look-up is nearly exact and a plane's size is
/// bounded for any request.
pub const SAMPLE_MIN: f64 = 0.1 * MM;

/// The part of a bin that represents it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BinShare {
    /// Its centre, as printed: a coarse bin contradicts a truth that lies off its centre.
    Center,
    /// All of it: a taxel's probability is the mean over the bin's extent along x, y and
    /// angle, at 27 points (the centre and a third of the sides to each side of it).
    Extent,
}

impl BinShare {
    /// The sample offsets along one axis of unit length.
    fn steps(self) -> &'static [f64] {
        match self {
            Self::Center => &[0.0],
            Self::Extent => &[-1.0 / 3.0, 0.0, 1.0 / 3.0],
        }
    }
}

/// Number of samples of a plane per bin, and their distance.
#[derive(Clone, Copy, Debug)]
struct Phases {
    per_bin: usize,
    step: f64,
    bin: f64,
}

impl Phases {
    fn new(bin: f64) -> Self {
        if bin < SAMPLE_MIN {
            return Self { per_bin: 1, step: SAMPLE_MIN, bin };
        }
        let per_bin = (bin / SAMPLE_MAX).ceil().max(1.0) as usize;
        Self { per_bin, step: bin / per_bin as f64, bin }
    }

    /// Whether several bins share a sample.
    fn is_shared(&self) -> bool {
        self.bin < self.step
    }
}

/// Memory layout of the planes of one object.
#[derive(Clone, Copy, Debug)]
struct Layout {
    radius: f64,
    x: Phases,
    y: Phases,
    /// Slots of a phase along x and y.
    slots: [usize; 2],
}

impl Layout {
    fn new(radius: f64, bin: DVec2) -> Self {
        let (x, y) = (Phases::new(bin.x), Phases::new(bin.y));
        let slots = [x, y].map(|axis| {
            let samples = (2.0 * radius / axis.step).ceil() as usize + 1;
            samples.div_ceil(axis.per_bin)
        });
        Self { radius, x, y, slots }
    }

    /// Samples along x.
    fn row(&self) -> usize {
        self.x.per_bin * self.slots[0]
    }

    /// Samples of a plane.
    fn plane(&self) -> usize {
        self.row() * self.y.per_bin * self.slots[1]
    }

    /// The phase and the slot (which may lie outside) of the sample nearest to a coordinate.
    fn place(&self, along: f64, axis: Phases) -> (usize, i64) {
        let sample = ((along + self.radius) / axis.step).round() as i64;
        let per_bin = axis.per_bin as i64;
        (sample.rem_euclid(per_bin) as usize, sample.div_euclid(per_bin))
    }

    /// Index of the sample nearest to a coordinate along one axis; `None` outside.
    fn stored(&self, along: f64, axis: Phases, n_slots: usize) -> Option<usize> {
        let (phase, slot) = self.place(along, axis);
        (0..n_slots as i64).contains(&slot).then(|| phase * n_slots + slot as usize)
    }
}

/// The planes of one object at all angles.
#[derive(Clone, Debug)]
pub(super) struct ObjectPlanes {
    layout: Layout,
    /// Angle, class, phase of y, slot of y, phase of x, slot of x.
    values: Vec<f32>,
    unknown: [f64; N_CLASSES],
}

/// A window of a plane for the first bin: the values that one taxel adds to all bins of an angle.
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
        let layout = Layout::new(radius(map), bin);
        let Layout { radius, x, y, slots } = layout;
        let (row, plane) = (layout.row(), layout.plane());
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
                // Samples count the translation less the taxel's position.
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
        Self { layout, values, unknown: relative.unknown }
    }

    /// Bytes of the planes.
    pub(super) fn bytes(&self) -> usize {
        self.values.len() * size_of::<f32>()
    }

    /// Bytes of the planes that [`ObjectPlanes::new`] would make.
    pub(super) fn bytes_of(map: &OccupancyGrid, bin: DVec2, n_angles: usize) -> usize {
        let plane = Layout::new(radius(map), bin).plane();
        plane.saturating_mul(n_angles * N_CLASSES * size_of::<f32>())
    }

    /// ln Pr(press) at unmapped positions, the reference of all values.
    pub(super) fn unknown(&self, press: &ClassifiedPress) -> f64 {
        press.taxels().iter().map(|(_, class)| self.unknown[*class as usize]).sum()
    }

    fn window(&self, angle: usize, class: ContactClass, first_bin_from_taxel: DVec2) -> Window<'_> {
        let Layout { x, y, slots, .. } = self.layout;
        let row = self.layout.row();
        let (phase_x, first_x) = self.layout.place(first_bin_from_taxel.x, x);
        let (phase_y, first_y) = self.layout.place(first_bin_from_taxel.y, y);
        let offset = phase_y * slots[1] * row + phase_x * slots[0];
        let plane = &self.plane(angle, class)[offset..];
        Window { plane, first: [first_x, first_y], row }
    }

    fn plane(&self, angle: usize, class: ContactClass) -> &[f32] {
        let size = self.layout.plane();
        let start = (angle * N_CLASSES + class as usize) * size;
        &self.values[start..start + size]
    }

    /// Adds the log-likelihood of a press to all bins of an angle. `first_bin` is the
    /// translation of the first (metres), `n` the bins along x and y, x fastest in `sums`.
    pub(super) fn add_all(
        &self,
        angle: usize,
        press: &ClassifiedPress,
        first_bin: DVec2,
        n: [usize; 2],
        sums: &mut [f32],
    ) {
        if self.layout.x.is_shared() || self.layout.y.is_shared() {
            return self.gather_all(angle, press, first_bin, n, sums);
        }
        for (point, class) in press.taxels() {
            let window = self.window(angle, *class, first_bin - point.truncate());
            let inside = |axis: usize| {
                let (first, slots) = (window.first[axis], self.layout.slots[axis] as i64);
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

    /// [`Self::add_all`] for bins that share samples: every bin takes the nearest sample.
    fn gather_all(
        &self,
        angle: usize,
        press: &ClassifiedPress,
        first_bin: DVec2,
        n: [usize; 2],
        sums: &mut [f32],
    ) {
        let Layout { x, y, slots, .. } = self.layout;
        let row = self.layout.row();
        let (mut cols, mut lines) = (Vec::new(), Vec::new());
        for (point, class) in press.taxels() {
            let (plane, at) = (self.plane(angle, *class), first_bin - point.truncate());
            let stored = |n: usize, first: f64, axis: Phases, n_slots: usize| {
                let place = move |bin: usize| first + bin as f64 * axis.bin;
                (0..n).map(move |bin| self.layout.stored(place(bin), axis, n_slots))
            };
            cols.clear();
            cols.extend(stored(n[0], at.x, x, slots[0]));
            lines.clear();
            lines.extend(stored(n[1], at.y, y, slots[1]));
            for (line, sums) in lines.iter().zip(sums.chunks_exact_mut(n[0])) {
                let Some(line) = line else { continue };
                for (col, sum) in cols.iter().zip(sums) {
                    *sum += col.map_or(0.0, |col| plane[line * row + col]);
                }
            }
        }
    }

    /// [`Self::add_all`] for some bins of an angle: `sums[i]` belongs to the bin `bins[i]`.
    pub(super) fn add_some(
        &self,
        angle: usize,
        press: &ClassifiedPress,
        first_bin: DVec2,
        (n_x, bins): (usize, &[u32]),
        sums: &mut [f32],
    ) {
        let Layout { x, y, slots, .. } = self.layout;
        let row = self.layout.row();
        for (point, class) in press.taxels() {
            let window = self.window(angle, *class, first_bin - point.truncate());
            let (plane, at) = (self.plane(angle, *class), first_bin - point.truncate());
            for (sum, bin) in sums.iter_mut().zip(bins) {
                let [bin_x, bin_y] = [*bin as usize % n_x, *bin as usize / n_x];
                if x.is_shared() || y.is_shared() {
                    let col = self.layout.stored(at.x + bin_x as f64 * x.bin, x, slots[0]);
                    let line = self.layout.stored(at.y + bin_y as f64 * y.bin, y, slots[1]);
                    if let (Some(col), Some(line)) = (col, line) {
                        *sum += plane[line * row + col];
                    }
                    continue;
                }
                let slot_x = window.first[0] + bin_x as i64;
                let slot_y = window.first[1] + bin_y as i64;
                let inside = (0..slots[0] as i64).contains(&slot_x)
                    && (0..slots[1] as i64).contains(&slot_y);
                if inside {
                    *sum += window.plane[slot_y as usize * window.row + slot_x as usize];
                }
            }
        }
    }
}

/// Centre of the k-th of n angles of the full turn, radians.
pub(super) fn center_of_angle(k: usize, n: usize) -> f64 {
    (k as f64 + 0.5) * TAU / n as f64
}
