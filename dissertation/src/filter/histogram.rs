//! The histogram filter of chapter 3: bins over identity, x, y and angle.
//!
//! Source: section 3.3.4, equations 3.14–3.17, in the log domain. The state is
//! `session_from_object` in the session's x-y plane, its translation within a box, its angle
//! the full turn; a bin stands for its centre. Bins that fell far behind the best can be left
//! out, and then cost nothing. Not here: bins that split (`adaptive`), forces.

use std::sync::Arc;

use glam::{DQuat, DVec2};

use super::planes::{BinShare, ObjectPlanes, center_of_angle};
use crate::occupancy::{ClassTable, ClassifiedPress, OccupancyGrid, log_likelihood};
use palpate_core::log_prob::log_sum_exp;
use palpate_core::pose::Pose;
use palpate_core::stop::Stop;

/// Fraction of active bins below which a sparse angle is looked up bin by bin.
const SPARSE_SHARE: f64 = 0.125;

/// Division of an object's planar poses: equal boxes along x, y and angle (Table 3.1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarBins {
    /// Bins along x, y and the angle, each at least 1.
    pub n: [usize; 3],
    /// Centre of the box of the object's origin, session frame, metres.
    pub center: DVec2,
    /// Half the box's sides, metres, positive.
    pub half: DVec2,
}

impl PlanarBins {
    /// Number of bins of an object.
    #[must_use]
    pub fn count(&self) -> usize {
        self.n.iter().product()
    }

    /// A bin's sides along x and y, metres.
    #[must_use]
    pub fn sides(&self) -> DVec2 {
        2.0 * self.half / DVec2::new(self.n[0] as f64, self.n[1] as f64)
    }

    /// The translation of the first bin, metres.
    fn first(&self) -> DVec2 {
        self.center - self.half + 0.5 * self.sides()
    }

    /// The centre of a bin: angle slowest, x fastest.
    #[must_use]
    pub fn session_from_object(&self, bin: usize) -> Pose {
        let [x, y, n_angles] = self.n;
        let place = DVec2::new((bin % x) as f64, (bin / x % y) as f64);
        let angle = center_of_angle(bin / (x * y), n_angles);
        let translation = self.first() + place * self.sides();
        Pose { rotation: DQuat::from_rotation_z(angle), translation: translation.extend(0.0) }
    }
}

/// Planes of every object, shared by all sessions.
#[derive(Clone, Debug)]
pub struct HistogramModel {
    maps: Vec<OccupancyGrid>,
    table: ClassTable,
    planes: Vec<ObjectPlanes>,
    sides: DVec2,
    n_angles: usize,
}

impl HistogramModel {
    /// Plans planar maps (object frames) for bins of these sides and number of angles. Sides
    /// below [`SAMPLE_MIN`](super::planes::SAMPLE_MIN) take no more memory than that side.
    /// `share` is the part of a bin that represents it; the literal extent always takes its
    /// centre.
    #[must_use]
    pub fn new(
        maps: Vec<OccupancyGrid>,
        table: ClassTable,
        bins: &PlanarBins,
        share: BinShare,
    ) -> Self {
        let (sides, n_angles) = (bins.sides(), bins.n[2]);
        let planes =
            maps.iter().map(|map| ObjectPlanes::new(map, &table, sides, n_angles, share)).collect();
        Self { maps, table, planes, sides, n_angles }
    }

    /// Bytes of all planes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.planes.iter().map(ObjectPlanes::bytes).sum()
    }

    /// Bytes of the planes that one of `maps` adds to [`HistogramModel::new`] for these bins,
    /// without creating any.
    #[must_use]
    pub fn bytes_of(map: &OccupancyGrid, bins: &PlanarBins) -> usize {
        ObjectPlanes::bytes_of(map, bins.sides(), bins.n[2])
    }
}

/// The bins in which a press is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    /// All bins at their exact centres, one by one: equation 3.14 as printed.
    Literal,
    /// All bins, by planes.
    Exhaustive,
    /// The bins at most `nats` behind the best, by planes.
    Sparse {
        /// ln of the ratio at which a bin is left out, positive.
        nats: f64,
        /// Return of left-out bins.
        reseed: Reseed,
    },
}

/// Return of left-out bins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reseed {
    /// Never.
    Never,
    /// When every active bin explains a press worse than an unmapped position: all presses
    /// are then evaluated in all bins again.
    WhenWorseThanNothing,
}

/// The bins of one object and angle.
#[derive(Clone, Debug)]
struct Slab {
    /// Natural logarithms of the bins in `active`, or of all; the best of all slabs is near 0.
    logs: Vec<f32>,
    /// The active bins, ascending; `None` for all.
    active: Option<Vec<u32>>,
}

/// A belief over identity and planar pose.
#[derive(Clone, Debug)]
pub struct PlanarHistogram {
    model: Arc<HistogramModel>,
    bins: PlanarBins,
    extent: Extent,
    exponent: f64,
    slabs: Vec<Slab>,
    presses: Vec<ClassifiedPress>,
    stop: Stop,
}

impl PlanarHistogram {
    /// Bytes of the bins and of the presses, without the shared planes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let slab = |slab: &Slab| {
            let active = slab.active.as_ref().map_or(0, Vec::capacity);
            slab.logs.capacity() * size_of::<f32>() + active * size_of::<u32>()
        };
        let presses: usize = self.presses.iter().map(ClassifiedPress::bytes).sum();
        size_of::<Self>() + self.slabs.iter().map(slab).sum::<usize>() + presses
    }

    /// A uniform belief. `exponent` tempers every press (1 is as printed).
    ///
    /// # Panics
    /// When the bins' sides or angles are not those of the model.
    #[must_use]
    pub fn new(
        model: Arc<HistogramModel>,
        bins: PlanarBins,
        extent: Extent,
        exponent: f64,
    ) -> Self {
        let same = (bins.sides() - model.sides).length() < 1e-9 * model.sides.length();
        assert!(same && bins.n[2] == model.n_angles, "the model is prepared for other bins");
        let slabs = uniform(model.maps.len() * bins.n[2], bins.n[0] * bins.n[1]);
        Self { model, bins, extent, exponent, slabs, presses: Vec::new(), stop: Stop::never() }
    }

    /// Makes long loops unwind once `stop` is requested ([`Stop::check`]).
    pub fn heed(&mut self, stop: &Stop) {
        self.stop = stop.clone();
    }

    /// Multiplies in a press (session frame): equation 3.14 for the bins of the extent.
    pub fn add(&mut self, press: ClassifiedPress) {
        let explained = self.multiply(&press);
        self.presses.push(press);
        if let Extent::Sparse { reseed: Reseed::WhenWorseThanNothing, .. } = self.extent
            && !explained
        {
            self.slabs = uniform(self.slabs.len(), self.bins.n[0] * self.bins.n[1]);
            let presses = std::mem::take(&mut self.presses);
            presses.iter().for_each(|press| {
                self.multiply(press);
            });
            self.presses = presses;
        }
        if let Extent::Sparse { nats, .. } = self.extent {
            self.drop_behind(nats);
        }
    }

    /// Natural logarithms of the objects' unnormalised probabilities: equation 3.15's sums.
    #[must_use]
    pub fn log_identities(&self) -> Vec<f64> {
        let of_object = |slabs: &[Slab]| {
            log_sum_exp(slabs.iter().flat_map(|slab| &slab.logs).map(|log| f64::from(*log)))
        };
        self.slabs.chunks(self.bins.n[2]).map(of_object).collect()
    }

    /// The mode of one object: its best bin's centre and logarithm (equations 3.16–3.17);
    /// `None` when no bin of it is active.
    #[must_use]
    pub fn mode(&self, object: usize) -> Option<(Pose, f64)> {
        let n_angles = self.bins.n[2];
        let slabs = self.slabs[object * n_angles..][..n_angles].iter().enumerate();
        let all = slabs.flat_map(|(angle, slab)| {
            slab.logs.iter().enumerate().map(move |(idx, log)| (angle, slab, idx, *log))
        });
        // The first of equals, so that the answer does not depend on the left-out bins.
        let (angle, slab, idx, log) = all.reduce(|a, b| if b.3 > a.3 { b } else { a })?;
        let bin = slab.active.as_ref().map_or(idx, |active| active[idx] as usize);
        let pose = self.bins.session_from_object(angle * self.bins.n[0] * self.bins.n[1] + bin);
        Some((pose, f64::from(log)))
    }

    /// The active bins of one object, with their logarithms (as [`Self::mode`]'s).
    #[must_use]
    pub fn logs(&self, object: usize) -> Vec<(usize, f64)> {
        let ([x, y, n_angles], mut left) = (self.bins.n, Vec::new());
        for (angle, slab) in self.slabs[object * n_angles..][..n_angles].iter().enumerate() {
            left.extend(slab.logs.iter().enumerate().map(|(idx, log)| {
                let bin = slab.active.as_ref().map_or(idx, |active| active[idx] as usize);
                (angle * x * y + bin, f64::from(*log))
            }));
        }
        left
    }

    /// Number of active bins of all objects.
    #[must_use]
    pub fn n_active(&self) -> usize {
        self.slabs.iter().map(|slab| slab.logs.len()).sum()
    }

    /// Adds a press to all active bins and normalises the best to 0; returns whether some bin
    /// explains it better than an unmapped position.
    fn multiply(&mut self, press: &ClassifiedPress) -> bool {
        let (mut best, mut explained) = (f32::NEG_INFINITY, false);
        let mut sums = Vec::new();
        for (idx, slab) in self.slabs.iter_mut().enumerate() {
            self.stop.check();
            if slab.logs.is_empty() {
                continue;
            }
            let (object, angle) = (idx / self.bins.n[2], idx % self.bins.n[2]);
            let unknown = self.model.planes[object].unknown(press);
            match self.extent {
                Extent::Literal => {
                    sum_literally(&self.model, &self.bins, (object, angle), press, &mut sums);
                    sums.iter_mut().for_each(|sum| *sum -= unknown as f32);
                }
                Extent::Exhaustive | Extent::Sparse { .. } => {
                    sum_by_planes(&self.model, &self.bins, (object, angle), press, slab, &mut sums);
                }
            }
            for (log, sum) in slab.logs.iter_mut().zip(&sums) {
                explained |= *sum >= 0.0;
                *log += (self.exponent * (f64::from(*sum) + unknown)) as f32;
                best = best.max(*log);
            }
        }
        self.slabs.iter_mut().flat_map(|slab| &mut slab.logs).for_each(|log| *log -= best);
        explained
    }

    /// Leaves out the bins that are more than `nats` behind the best, which is at 0.
    fn drop_behind(&mut self, nats: f64) {
        let limit = -nats as f32;
        for slab in &mut self.slabs {
            let keeps = slab.logs.iter().filter(|log| **log >= limit).count();
            if keeps == slab.logs.len() {
                continue;
            }
            let name = |idx: usize| slab.active.as_ref().map_or(idx as u32, |active| active[idx]);
            let left = slab.logs.iter().enumerate().filter(|(_, log)| **log >= limit);
            let (active, logs) = left.map(|(idx, log)| (name(idx), *log)).unzip();
            *slab = Slab { logs, active: Some(active) };
        }
    }
}

fn uniform(n_slabs: usize, n_bins: usize) -> Vec<Slab> {
    vec![Slab { logs: vec![0.0; n_bins], active: None }; n_slabs]
}

/// ln Pr(press) of every bin of an object's angle, at the bin's exact centre.
fn sum_literally(
    model: &HistogramModel,
    bins: &PlanarBins,
    (object, angle): (usize, usize),
    press: &ClassifiedPress,
    sums: &mut Vec<f32>,
) {
    let n = bins.n[0] * bins.n[1];
    sums.clear();
    sums.extend((angle * n..(angle + 1) * n).map(|bin| {
        let pose = bins.session_from_object(bin);
        log_likelihood(press, &model.maps[object], &model.table, &pose) as f32
    }));
}

/// ln Pr(press) of the active bins, by planes, relative to an unmapped position.
fn sum_by_planes(
    model: &HistogramModel,
    bins: &PlanarBins,
    (object, angle): (usize, usize),
    press: &ClassifiedPress,
    slab: &Slab,
    sums: &mut Vec<f32>,
) {
    let (planes, first, [n_x, n_y, _]) = (&model.planes[object], bins.first(), bins.n);
    sums.clear();
    match &slab.active {
        Some(active) if (active.len() as f64) < SPARSE_SHARE * (n_x * n_y) as f64 => {
            sums.resize(active.len(), 0.0);
            planes.add_some(angle, press, first, (n_x, active), sums);
        }
        Some(active) => {
            let mut all = vec![0.0; n_x * n_y];
            planes.add_all(angle, press, first, [n_x, n_y], &mut all);
            sums.extend(active.iter().map(|bin| all[*bin as usize]));
        }
        None => {
            sums.resize(n_x * n_y, 0.0);
            planes.add_all(angle, press, first, [n_x, n_y], sums);
        }
    }
}

#[cfg(test)]
mod tests;
