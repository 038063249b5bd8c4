//! The filters of chapter 3 as printed, as beliefs over maps of contact alone.
//!
//! Source: sections 3.3.3 and 3.3.4. Both fold presses of classes in the plane's frame (or
//! the session's, for solids); poses there are `frame_from_object`. Presses are classified as
//! in training.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DQuat, DVec2, DVec3};

use super::marginals::{self, Marginals, Share};
use super::prepared::{Planes, PreparedGeometry};
use super::{BeliefMemory, GeometricError, PosePrior, PrintedFilter};
use crate::filter::histogram::{Extent, PlanarBins, PlanarHistogram};
use crate::filter::particle::{Particle, ParticleFilter, PoseRegion};
use crate::geometric::model::{GeometricMap, GeometricModel};
use crate::occupancy::{InverseModel, log_likelihood};
use palpate_core::belief::answer::{Answer, ModeScale, WeightedPose, answer};
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::stop::Stop;
use palpate_core::units::MM;

/// Number of cells of a plotted axis.
const MARGINAL_CELLS: usize = 72;
/// Extent of a particle for plotting, equal to its noise in a time step: metres, rad.
const SMEAR: [f64; 2] = [1.0 * MM, 0.1];
/// Largest distance between particles of one mode: metres, rad.
const MODE_REACH: [f64; 2] = [4.0 * MM, 0.5];

/// A belief of one of the printed filters.
#[derive(Clone, Debug)]
pub(super) struct PrintedBelief {
    model: Arc<GeometricModel>,
    inverse: InverseModel,
    log_prior: Vec<f64>,
    space: Space,
    n_readings: usize,
    filter: Filter,
    /// Counted while a belief holds them.
    _planes: Option<Arc<Planes>>,
    stop: Stop,
}

#[derive(Clone, Debug)]
enum Filter {
    Histogram(PlanarHistogram, PlanarBins),
    /// With the likelihood's exponent.
    Particles(ParticleFilter, f64),
}

/// The poses that are possible.
#[derive(Clone, Copy, Debug)]
enum Space {
    /// In a plane: x, y, and every angle about the one in the middle.
    Plane { session_from_plane: Pose, center: [f64; 2], half: f64, angle: f64 },
    /// About a pose.
    Solid { middle: Pose, half: DVec3, half_angle: f64 },
}

impl PrintedBelief {
    /// Bytes of the filter.
    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>()
            + match &self.filter {
                Filter::Histogram(histogram, _) => histogram.bytes(),
                Filter::Particles(filter, _) => filter.bytes(),
            }
    }

    pub(super) fn new(
        prepared: &PreparedGeometry,
        prior: &PosePrior,
        filter: &PrintedFilter,
        seed: u64,
        log_prior: &[f64],
    ) -> Result<Self, GeometricError> {
        let model = prepared.model();
        let space = Space::new(model, prior)?;
        let mut planes = None;
        let filter = match (filter, &space) {
            (PrintedFilter::Histogram { n }, Space::Plane { center, half, .. }) => {
                let (center, half) = (DVec2::from_array(*center), DVec2::splat(*half));
                let bins = PlanarBins { n: *n, center, half };
                let model = Arc::clone(&**planes.insert(prepared.planes(&bins)?));
                let filter = PlanarHistogram::new(model, bins, Extent::Exhaustive, 1.0);
                Filter::Histogram(filter, bins)
            }
            (PrintedFilter::Histogram { .. }, Space::Solid { .. }) => {
                return Err(GeometricError::PlanarOnly);
            }
            (PrintedFilter::Particles(options), _) => {
                let (region, n_objects) = (space.region(), model.maps.len());
                let filter = ParticleFilter::new(*options, region, n_objects, seed);
                Filter::Particles(filter, options.exponent)
            }
        };
        let (inverse, log_prior) = (InverseModel::default(), log_prior.to_vec());
        Ok(Self {
            model: Arc::clone(model),
            inverse,
            log_prior,
            space,
            n_readings: 0,
            filter,
            _planes: planes,
            stop: Stop::never(),
        })
    }

    /// Memory of [`PrintedBelief::new`], without creating it.
    pub(super) fn memory(
        prepared: &PreparedGeometry,
        prior: &PosePrior,
        filter: &PrintedFilter,
    ) -> Result<BeliefMemory, GeometricError> {
        let space = Space::new(prepared.model(), prior)?;
        let n_objects = prepared.model().maps.len();
        match (filter, space) {
            (PrintedFilter::Histogram { n }, Space::Plane { center, half, .. }) => {
                let (center, half) = (DVec2::from_array(center), DVec2::splat(half));
                let bins = PlanarBins { n: *n, center, half };
                let own = bins.count() * n_objects * size_of::<f32>();
                let (tables, has) = (prepared.planes_bytes(&bins), prepared.has_planes(&bins));
                Ok(BeliefMemory::new(own, tables, has))
            }
            (PrintedFilter::Histogram { .. }, Space::Solid { .. }) => {
                Err(GeometricError::PlanarOnly)
            }
            (PrintedFilter::Particles(options), _) => {
                Ok(BeliefMemory::new(options.n * size_of::<Particle>(), 0, true))
            }
        }
    }

    /// Makes long loops unwind once `stop` is requested ([`Stop::check`]).
    pub(super) fn heed(&mut self, stop: &Stop) {
        self.stop = stop.clone();
        if let Filter::Histogram(filter, _) = &mut self.filter {
            filter.heed(stop);
        }
    }

    pub(super) fn add(&mut self, reading: &Reading, sensor: &SensorDescription) {
        let frame_from_session = self.space.session_from_frame().inverse();
        let press = self.inverse.classified(&reading.moved_by(frame_from_session), sensor);
        match &mut self.filter {
            Filter::Histogram(filter, _) => filter.add(press),
            Filter::Particles(filter, exponent) => {
                let (maps, table) = (&self.model.maps, &self.model.table);
                // The prior enters once: the particles contain it from then on.
                let weight = if self.n_readings == 0 { exponent.recip() } else { 0.0 };
                filter.add(|object, pose| match self.log_prior[object] {
                    f64::NEG_INFINITY => f64::NEG_INFINITY,
                    prior => {
                        self.stop.check();
                        weight * prior
                            + log_likelihood(&press, &maps[object].occupancy, table, pose)
                    }
                });
            }
        }
        self.n_readings += 1;
    }

    /// The histogram answers bin centres (equation 3.17), particles the means of their clusters.
    pub(super) fn answer(&self, n_modes: usize, n_readings: usize) -> Answer {
        let (logs, poses, scale) = match &self.filter {
            Filter::Histogram(filter, bins) => self.of_bins(filter, bins),
            Filter::Particles(filter, _) => self.of_particles(filter),
        };
        answer(&logs, poses, n_modes, &scale, n_readings)
    }

    fn of_bins(
        &self,
        filter: &PlanarHistogram,
        bins: &PlanarBins,
    ) -> (Vec<f64>, Vec<WeightedPose>, ModeScale) {
        let logs = filter.log_identities();
        let logs = logs.iter().zip(&self.log_prior).map(|(log, prior)| log + prior).collect();
        let best = |object| {
            let (pose, log) = filter.mode(object)?;
            Some(self.weighted(object, pose, log + self.log_prior[object]))
        };
        let poses = (0..self.model.maps.len()).filter_map(best).collect();
        let scale = ModeScale {
            distance: 0.0,
            angle: 0.0,
            position_deviation: bins.sides().max_element() / 12.0_f64.sqrt(),
            rotation_deviation: TAU / bins.n[2] as f64 / 12.0_f64.sqrt(),
        };
        (logs, poses, scale)
    }

    fn of_particles(&self, filter: &ParticleFilter) -> (Vec<f64>, Vec<WeightedPose>, ModeScale) {
        let prior = |object: usize| if self.n_readings == 0 { self.log_prior[object] } else { 0.0 };
        let identities = filter.identities();
        let log = |(object, identity): (usize, &f64)| identity.ln() + prior(object);
        let logs = identities.iter().enumerate().map(log).collect();
        let weighted = |particle: &Particle| {
            let log = particle.log_weight + prior(particle.object);
            self.weighted(particle.object, particle.session_from_object, log)
        };
        let scale = ModeScale {
            distance: MODE_REACH[0],
            angle: MODE_REACH[1],
            position_deviation: SMEAR[0],
            rotation_deviation: SMEAR[1],
        };
        (logs, filter.particles().iter().map(weighted).collect(), scale)
    }

    fn weighted(&self, object: usize, frame_from_object: Pose, log_weight: f64) -> WeightedPose {
        let session_from_object = self.session_from_object(object, frame_from_object);
        WeightedPose { object: ObjectIdx(object as u32), session_from_object, log_weight }
    }

    /// The marginals of one object; `None` when it is impossible.
    pub(super) fn marginals(&self, object: ObjectIdx) -> Option<Marginals> {
        let object = object.0 as usize;
        self.model.maps.get(object)?;
        let boxes: Vec<PoseBox> = match &self.filter {
            Filter::Histogram(filter, bins) => {
                let side = 0.5 * bins.sides();
                let half = [side.x, side.y, PI / bins.n[2] as f64, 0.0, 0.0, 0.0];
                let logs = filter.logs(object);
                let best = logs.iter().map(|(_, log)| *log).fold(f64::NEG_INFINITY, f64::max);
                let around = |(bin, log): &(usize, f64)| {
                    let center = self.space.coordinates(&bins.session_from_object(*bin));
                    pose_box(center, half, (log - best).exp())
                };
                logs.iter().map(around).collect()
            }
            Filter::Particles(filter, _) => {
                let [place, turn] = SMEAR;
                let half = match self.space {
                    Space::Plane { .. } => [place, place, turn, 0.0, 0.0, 0.0],
                    Space::Solid { .. } => [place, place, place, turn, turn, turn],
                };
                let around = |particle: &Particle| {
                    let center = self.space.coordinates(&particle.session_from_object);
                    pose_box(center, half, particle.log_weight.exp())
                };
                let own = filter.particles().iter().filter(|particle| particle.object == object);
                own.map(around).collect()
            }
        };
        if boxes.iter().all(|(_, _, weight)| *weight <= 0.0) {
            return None;
        }
        let shares: Vec<Share<'_>> = boxes
            .iter()
            .map(|(low, high, probability)| Share { low, high, probability: *probability })
            .collect();
        Some(self.space.marginals(&shares))
    }

    /// A pose in the session; a planar object lies with its pressed face in the plane.
    fn session_from_object(&self, object: usize, frame_from_object: Pose) -> Pose {
        let lowered = match self.space {
            Space::Plane { .. } => {
                let height = self.model.maps[object].occupancy.shape().min().z;
                let translation = frame_from_object.translation - DVec3::new(0.0, 0.0, height);
                Pose { translation, ..frame_from_object }
            }
            Space::Solid { .. } => frame_from_object,
        };
        self.space.session_from_frame() * lowered
    }
}

/// A box along the plotted axes, from its lowest to its highest corner, and its weight.
type PoseBox = ([f64; 6], [f64; 6], f64);

fn pose_box(center: [f64; 6], half: [f64; 6], weight: f64) -> PoseBox {
    let ends = |sign: f64| std::array::from_fn(|axis| center[axis] + sign * half[axis]);
    (ends(-1.0), ends(1.0), weight)
}

impl Space {
    /// # Errors
    /// [`GeometricError`] when the maps are of the other kind, or not every turn is possible.
    fn new(model: &GeometricModel, prior: &PosePrior) -> Result<Self, GeometricError> {
        let is_planar = |map: &Arc<GeometricMap>| map.occupancy.shape().is_planar();
        match *prior {
            PosePrior::Planar { session_from_plane, center, half_extent, angle, half_angle } => {
                if !model.maps.iter().all(is_planar) {
                    return Err(GeometricError::NotPlanar);
                }
                if half_angle < PI - 1e-6 {
                    return Err(GeometricError::EveryTurn { found: half_angle });
                }
                Ok(Self::Plane { session_from_plane, center, half: half_extent, angle })
            }
            PosePrior::Bounded { session_from_object, half_extent, half_angle } => {
                if model.maps.iter().any(is_planar) {
                    return Err(GeometricError::NotSolid);
                }
                Ok(Self::Solid { middle: session_from_object, half: half_extent, half_angle })
            }
        }
    }

    fn session_from_frame(&self) -> Pose {
        match self {
            Self::Plane { session_from_plane, .. } => *session_from_plane,
            Self::Solid { .. } => Pose::IDENTITY,
        }
    }

    fn region(&self) -> PoseRegion {
        match *self {
            Self::Plane { center: [x, y], half, .. } => {
                let (center, half) = (DVec3::new(x, y, 0.0), DVec3::splat(half));
                PoseRegion::Planar { center, half }
            }
            Self::Solid { middle, half, half_angle } => {
                PoseRegion::Solid { center: middle, half, angle_max: half_angle }
            }
        }
    }

    /// The coordinates of a pose along the plotted axes.
    fn coordinates(&self, frame_from_object: &Pose) -> [f64; 6] {
        let DVec3 { x, y, z } = frame_from_object.translation;
        match self {
            Self::Plane { angle, .. } => {
                let along = frame_from_object.turn(DVec3::X);
                let turn = (along.y.atan2(along.x) - angle + PI).rem_euclid(TAU) - PI + angle;
                [x, y, turn, 0.0, 0.0, 0.0]
            }
            Self::Solid { middle, .. } => {
                let turned = frame_from_object.rotation * middle.rotation.conjugate();
                let turned: DQuat = if turned.w < 0.0 { -turned } else { turned };
                let DVec3 { x: rx, y: ry, z: rz } = turned.to_scaled_axis();
                [x, y, z, rx, ry, rz]
            }
        }
    }

    fn marginals(&self, shares: &[Share<'_>]) -> Marginals {
        let axis = |(index, name, middle, half): (usize, &'static str, f64, f64)| {
            let range = (middle - half, middle + half);
            marginals::axis(name, index, range, MARGINAL_CELLS, shares)
        };
        match *self {
            Self::Plane { center, half, angle, .. } => {
                let axes =
                    [(0, "x", center[0], half), (1, "y", center[1], half), (2, "theta", angle, PI)];
                let (low, high) = (center.map(|c| c - half), center.map(|c| c + half));
                let plane = marginals::plane(low, high, MARGINAL_CELLS, shares);
                Marginals { axes: axes.map(axis).to_vec(), plane: Some(plane) }
            }
            Self::Solid { middle, half, half_angle } => {
                let at = middle.translation;
                let axes = [
                    (0, "x", at.x, half.x),
                    (1, "y", at.y, half.y),
                    (2, "z", at.z, half.z),
                    (3, "rx", 0.0, half_angle),
                    (4, "ry", 0.0, half_angle),
                    (5, "rz", 0.0, half_angle),
                ];
                Marginals { axes: axes.map(axis).to_vec(), plane: None }
            }
        }
    }
}

#[cfg(test)]
mod tests;
