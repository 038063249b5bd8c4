//! Recognition by geometry: belief over identity and a bounded pose.
//!
//! Chapter 3 with extensions to its filters: force is used, presses are explained with their
//! own depth, tilt and slip, and the histogram refines itself. Planar poses are x, y and θ in
//! a stated plane, solid ones six-dimensional about a nominal pose. Readings are folded in
//! the given order, which affects only the bins that the filter evaluates. The answer does
//! not depend on the number of threads.

mod blur;
mod error;
mod force;
mod marginals;
pub mod model;
mod options;
mod planar;
mod polish;
mod prepared;
mod printed;
mod solid;
mod tables;
pub mod train;

use palpate_core::belief::answer::Answer;
use palpate_core::log_prob::normalize;
use palpate_core::object::ObjectIdx;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::stop::Stop;

pub use error::GeometricError;
pub use marginals::{AxisMarginal, Marginals, PlaneMarginal};
pub use options::{AdaptiveOptions, GeometricFilter, GeometricOptions, PosePrior, PrintedFilter};
pub use prepared::PreparedGeometry;
pub use tables::TableBudget;

use planar::PlanarBelief;
use printed::PrintedBelief;
use solid::SolidBelief;

/// A belief over the identity and pose of one object, from the readings so far.
#[derive(Clone, Debug)]
pub struct GeometricBelief {
    pose: PosePrior,
    n_readings: usize,
    state: State,
}

/// Initial memory of a belief, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BeliefMemory {
    /// Its own memory.
    pub own: usize,
    /// Tables shared with other beliefs of the same kind.
    pub tables: usize,
    /// Tables that no belief has created yet.
    pub missing: usize,
}

impl BeliefMemory {
    fn new(own: usize, tables: usize, has_tables: bool) -> Self {
        Self { own, tables, missing: if has_tables { 0 } else { tables } }
    }
}

/// The filter of a belief.
#[derive(Clone, Debug)]
enum State {
    Planar(Box<PlanarBelief>),
    Printed(Box<PrintedBelief>),
    Solid(Box<SolidBelief>),
}

impl GeometricBelief {
    /// Approximate bytes of memory of this belief, without the shared maps.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let state = match &self.state {
            State::Planar(belief) => belief.bytes(),
            State::Printed(belief) => belief.bytes(),
            State::Solid(belief) => belief.bytes(),
        };
        size_of::<Self>() + state
    }

    /// Checks whether a belief can be created, and its memory; creates nothing.
    ///
    /// # Errors
    /// Those of [`GeometricBelief::new`].
    pub fn memory(
        geometry: &PreparedGeometry,
        options: &GeometricOptions,
        prior: Option<&[f64]>,
    ) -> Result<BeliefMemory, GeometricError> {
        let log_prior = log_prior(prior, geometry.model().maps.len())?;
        options.check()?;
        let n_alive = log_prior.iter().filter(|log| log.is_finite()).count();
        match (&options.pose, &options.filter) {
            (PosePrior::Planar { half_extent, half_angle, .. }, GeometricFilter::Adaptive(it)) => {
                PlanarBelief::memory(geometry, *half_extent, *half_angle, it, n_alive)
            }
            (PosePrior::Bounded { half_extent, half_angle, .. }, GeometricFilter::Adaptive(_)) => {
                SolidBelief::memory(geometry, *half_extent, *half_angle, n_alive)
            }
            (pose, GeometricFilter::Printed(filter)) => {
                PrintedBelief::memory(geometry, pose, filter)
            }
        }
    }

    /// The belief before any reading. `prior` weighs the objects (it is normalised); `None`
    /// is uniform.
    ///
    /// # Errors
    /// [`GeometricError`] when the geometry is not of the kind that the pose prior and the filter
    /// need, or when priors or options are out of range.
    pub fn new(
        geometry: &PreparedGeometry,
        options: GeometricOptions,
        prior: Option<&[f64]>,
    ) -> Result<Self, GeometricError> {
        Self::memory(geometry, &options, prior)?;
        let log_prior = log_prior(prior, geometry.model().maps.len())?;
        let state = match (&options.pose, &options.filter) {
            (plane @ PosePrior::Planar { .. }, GeometricFilter::Adaptive(filter)) => {
                State::Planar(Box::new(PlanarBelief::new(geometry, *plane, *filter, &log_prior)?))
            }
            (solid @ PosePrior::Bounded { .. }, GeometricFilter::Adaptive(filter)) => {
                State::Solid(Box::new(SolidBelief::new(geometry, *solid, *filter, &log_prior)?))
            }
            (pose, GeometricFilter::Printed(filter)) => {
                let seed = options.seed;
                let belief = PrintedBelief::new(geometry, pose, filter, seed, &log_prior)?;
                State::Printed(Box::new(belief))
            }
        };
        Ok(Self { pose: options.pose, n_readings: 0, state })
    }

    /// Makes long loops unwind once `stop` is requested ([`Stop::check`]).
    pub fn heed(&mut self, stop: &Stop) {
        match &mut self.state {
            State::Planar(belief) => belief.heed(stop),
            State::Printed(belief) => belief.heed(stop),
            State::Solid(belief) => belief.heed(stop),
        }
    }

    /// Adds a reading.
    ///
    /// # Errors
    /// [`GeometricError::Shape`] when the image is not the sensor's,
    /// [`GeometricError::Tilt`] when a press on a plane is tilted by more than 30 degrees.
    pub fn add(
        &mut self,
        reading: &Reading,
        sensor: &SensorDescription,
    ) -> Result<(), GeometricError> {
        let (grid, image) = (sensor.grid(), reading.image());
        if (image.rows, image.cols) != (grid.rows, grid.cols) {
            return Err(GeometricError::Shape {
                rows: grid.rows,
                cols: grid.cols,
                found_rows: image.rows,
                found_cols: image.cols,
            });
        }
        match &mut self.state {
            State::Planar(belief) => belief.add(reading, sensor)?,
            State::Printed(belief) => {
                self.pose.check_press(&reading.session_from_sensor())?;
                belief.add(reading, sensor);
            }
            State::Solid(belief) => belief.add(reading, sensor),
        }
        self.n_readings += 1;
        Ok(())
    }

    /// The belief as an answer with at most `n_modes` poses.
    #[must_use]
    pub fn answer(&self, n_modes: usize) -> Answer {
        match &self.state {
            State::Planar(belief) => belief.answer(n_modes, self.n_readings),
            State::Printed(belief) => belief.answer(n_modes, self.n_readings),
            State::Solid(belief) => belief.answer(n_modes, self.n_readings),
        }
    }

    /// The distribution of an object's pose along every axis, given the object; `None` when
    /// the catalogue has no such object or it is impossible.
    #[must_use]
    pub fn marginals(&self, object: ObjectIdx) -> Option<Marginals> {
        match &self.state {
            State::Planar(belief) => belief.marginals(object),
            State::Printed(belief) => belief.marginals(object),
            State::Solid(belief) => belief.marginals(object),
        }
    }

    /// Number of readings.
    #[must_use]
    pub fn n_readings(&self) -> usize {
        self.n_readings
    }
}

/// ln of the objects' prior probabilities.
fn log_prior(prior: Option<&[f64]>, expected: usize) -> Result<Vec<f64>, GeometricError> {
    let Some(weights) = prior else {
        return Ok(vec![-(expected.max(1) as f64).ln(); expected]);
    };
    let valid = weights.iter().all(|weight| weight.is_finite() && *weight >= 0.0);
    if weights.len() != expected || !valid || weights.iter().all(|weight| *weight <= 0.0) {
        return Err(GeometricError::Prior { expected, found: weights.len() });
    }
    let logs: Vec<f64> = weights.iter().map(|weight| weight.ln()).collect();
    Ok(normalize(&logs).into_iter().map(f64::ln).collect())
}
