//! Sessions with objects, shared by the experiments on the surface recogniser.
//!
//! A trial draws a pose (any rotation, ±200 mm along each axis) and presents test readings of
//! one object, drawn at random; after each one the recogniser answers. Trial n of an object is
//! the same for every recogniser, however many trials each plays. Errors of pose count only
//! when the identity is right; angles are given plain and modulo the object's symmetry.

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use palpate_core::belief::answer::Answer;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::symmetry::Symmetry;
use palpate_core::units::MM;
use palpate_dissertation::sva::model::SvaModel;
use palpate_dissertation::sva::{SvaBelief, SvaOptions};
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::model::SurfaceModel;
use palpate_recogniser::options::SurfaceOptions;

use crate::cpu_time::thread_seconds;
use crate::disturbance::{Disturbance, Presented};
use crate::played::{Played, PoseError, Step};
use crate::report::Progress;

/// Maximum distance of an object from the session's origin along each axis, metres.
const REACH: f64 = 200.0 * MM;

/// Poses that an answer states.
const N_MODES: usize = 8;

/// A trained recogniser.
pub enum Recogniser {
    /// Spatially varying appearance, section 5.5.1.
    Sva {
        /// Model of the catalogue.
        catalogue: Arc<SvaModel>,
        /// Options of the recogniser.
        options: SvaOptions,
    },
    /// Propose, verify, refine.
    Surface {
        /// Model of the catalogue.
        model: Arc<SurfaceModel>,
        /// Options of the recogniser.
        options: SurfaceOptions,
    },
}

enum Belief {
    Sva(Box<SvaBelief>),
    Surface(Box<SurfaceBelief>),
}

impl Recogniser {
    fn begin(&self) -> anyhow::Result<Belief> {
        Ok(match self {
            Self::Sva { catalogue, options } => {
                Belief::Sva(Box::new(SvaBelief::new(catalogue.clone(), *options, None)?))
            }
            Self::Surface { model, options } => {
                Belief::Surface(Box::new(SurfaceBelief::new(model.clone(), *options, None)?))
            }
        })
    }

    /// The object named after each of the rising `counts` of the first readings of a session
    /// with an object that rests, as far as the session may know.
    ///
    /// # Errors
    /// When the sensor does not fit what was trained.
    pub fn names(
        &self,
        readings: &[Reading],
        sensor: &SensorDescription,
        counts: &[usize],
    ) -> anyhow::Result<Vec<Option<ObjectIdx>>> {
        let mut belief = self.begin()?;
        let mut named = Vec::with_capacity(counts.len());
        let last = counts.last().copied().unwrap_or(0);
        for (before, reading) in readings.iter().take(last).enumerate() {
            let answer = belief.add_reading(reading, sensor)?;
            if counts.contains(&(before + 1)) {
                named.push(answer.best_object());
            }
        }
        Ok(named)
    }

    /// Memory of its maps, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match self {
            Self::Sva { catalogue, .. } => {
                catalogue.objects.iter().map(|o| o.index().bytes()).sum()
            }
            Self::Surface { model, .. } => model.bytes(),
        }
    }
}

impl Belief {
    fn add(&mut self, heard: &Presented, sensor: &SensorDescription) -> anyhow::Result<Answer> {
        if let (Self::Surface(belief), Some(motion)) = (&mut *self, &heard.moved) {
            belief.announce_move(motion);
        }
        self.add_reading(&heard.reading, sensor)
    }

    fn add_reading(
        &mut self,
        reading: &Reading,
        sensor: &SensorDescription,
    ) -> anyhow::Result<Answer> {
        match self {
            Self::Sva(belief) => {
                belief.add(reading, sensor)?;
                Ok(belief.answer(N_MODES))
            }
            Self::Surface(belief) => {
                belief.add(reading, sensor);
                Ok(belief.answer(N_MODES))
            }
        }
    }
}

/// Sessions that recognisers play.
pub struct Sessions<'a> {
    /// The sensor of the test readings.
    pub sensor: &'a SensorDescription,
    /// The test readings of each object.
    pub test: &'a [Vec<Reading>],
    /// The symmetry of each object.
    pub symmetries: &'a [Symmetry],
    /// The seed of poses and of the choice of readings.
    pub seed: u64,
    /// Readings a trial.
    pub readings: usize,
    /// Number of threads for a reading.
    pub threads: usize,
    /// Disturbance between the touches and the session.
    pub disturbance: Disturbance,
}

impl<'a> Sessions<'a> {
    /// Sessions of `readings` touches without a disturbance, on one thread.
    #[must_use]
    pub fn undisturbed(
        sensor: &'a SensorDescription,
        test: &'a [Vec<Reading>],
        symmetries: &'a [Symmetry],
        seed: u64,
        readings: usize,
    ) -> Self {
        let disturbance = Disturbance::None;
        Self { sensor, test, symmetries, seed, readings, threads: 1, disturbance }
    }

    /// Plays `n` trials, one after the other: the first trial of each of the first `n_objects`
    /// objects, then the second of each, and so on.
    ///
    /// # Errors
    /// When the sensor does not fit what was trained.
    pub fn play(
        &self,
        recogniser: &Recogniser,
        n_objects: usize,
        n: usize,
        progress: Progress<'_>,
    ) -> anyhow::Result<Played> {
        let trials = (0..n).map(|done| (done % n_objects, done / n_objects));
        self.play_these(recogniser, trials, progress)
    }

    /// Plays trials, one after the other: each is an object and a number.
    ///
    /// # Errors
    /// When the sensor does not fit what was trained.
    pub fn play_these(
        &self,
        recogniser: &Recogniser,
        trials: impl ExactSizeIterator<Item = (usize, usize)>,
        progress: Progress<'_>,
    ) -> anyhow::Result<Played> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads).build()?;
        let n = trials.len();
        let mut steps = Vec::with_capacity(n * self.readings);
        let mut cpu = Some(0.0);
        for (done, (object, trial)) in trials.enumerate() {
            progress("trials", done, n);
            let readings = self.presented(object, trial);
            let (played, seconds) = pool.install(|| {
                let begun = thread_seconds();
                let played = self.trial(recogniser, object, trial, &readings);
                (played, thread_seconds().zip(begun).map(|(end, begun)| end - begun))
            });
            steps.extend(played?);
            cpu = cpu.zip(seconds).map(|(sum, seconds)| sum + seconds);
        }
        let cpu_ms = cpu.map(|sum| sum * 1e3 / steps.len() as f64);
        Ok(Played { steps, cpu_ms })
    }

    /// Processor time of a reading, answer included, of `n` sessions whose readings come in turn on
    /// one thread, milliseconds; `None` if the system does not report it.
    ///
    /// # Errors
    /// When the sensor does not fit what was trained.
    pub fn play_in_turn(
        &self,
        recogniser: &Recogniser,
        n_objects: usize,
        n: usize,
    ) -> anyhow::Result<Option<f64>> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        let readings: Vec<Vec<Presented>> =
            (0..n).map(|done| self.presented(done % n_objects, done / n_objects)).collect();
        pool.install(|| {
            let mut beliefs: Vec<Belief> =
                (0..n).map(|_| recogniser.begin()).collect::<anyhow::Result<_>>()?;
            let begun = thread_seconds();
            for turn in 0..self.readings {
                for (belief, readings) in beliefs.iter_mut().zip(&readings) {
                    belief.add(&readings[turn], self.sensor)?;
                }
            }
            let seconds = thread_seconds().zip(begun).map(|(end, begun)| end - begun);
            Ok(seconds.map(|seconds| seconds * 1e3 / (n * self.readings) as f64))
        })
    }

    /// Probabilities after each touch of a trial: one per object, then that of
    /// none of these.
    ///
    /// # Errors
    /// When the sensor does not fit what was trained.
    pub fn probabilities(
        &self,
        recogniser: &Recogniser,
        object: usize,
        trial: usize,
    ) -> anyhow::Result<Vec<Vec<f64>>> {
        let mut belief = recogniser.begin()?;
        let mut stated = Vec::with_capacity(self.readings);
        for heard in self.presented(object, trial) {
            let mut answer = belief.add(&heard, self.sensor)?;
            answer.probabilities.push(answer.unknown);
            stated.push(answer.probabilities);
        }
        Ok(stated)
    }

    fn index(&self, object: usize, trial: usize) -> u64 {
        (trial * self.test.len() + object) as u64
    }

    fn true_pose(&self, object: usize, trial: usize) -> Pose {
        let mut stream = Stream::new(self.seed, Purpose::ObjectPose, self.index(object, trial));
        let position = DVec3::from_array([0; 3].map(|_| stream.uniform(-REACH, REACH)));
        Pose::from_parts(stream.rotation(), position)
    }

    /// The readings of a trial as they reach the session, drawn without replacement until all
    /// have been used: a robot does not touch one place twice in exactly the same way.
    #[must_use]
    pub fn presented(&self, object: usize, trial: usize) -> Vec<Presented> {
        let index = self.index(object, trial);
        let mut choice = Stream::new(self.seed, Purpose::ReadingChoice, index);
        let test = &self.test[object];
        let mut rest = Vec::new();
        let readings = (0..self.readings).map(|_| {
            if rest.is_empty() {
                rest.extend(0..test.len());
            }
            test[rest.swap_remove(choice.index(rest.len()))].clone()
        });
        let mut stream = Stream::new(self.seed, Purpose::Perturbation, index);
        let pose = self.true_pose(object, trial);
        self.disturbance.present(readings.collect(), pose, &mut stream)
    }

    /// Error of a pose against that of the object in a trial.
    #[must_use]
    pub fn error(&self, object: usize, trial: usize, found: &Pose) -> PoseError {
        self.error_from(object, &self.true_pose(object, trial), found)
    }

    fn error_from(&self, object: usize, truth: &Pose, found: &Pose) -> PoseError {
        PoseError {
            translation: found.distance_to(truth),
            angle: self.symmetries[object].distance(found, truth).1,
            plain_angle: found.angle_to(truth),
        }
    }

    fn trial(
        &self,
        recogniser: &Recogniser,
        object: usize,
        trial: usize,
        presented: &[Presented],
    ) -> anyhow::Result<Vec<Step>> {
        let mut belief = recogniser.begin()?;
        let mut steps = Vec::with_capacity(presented.len());
        for (before, heard) in presented.iter().enumerate() {
            let started = Instant::now();
            let answer = belief.add(heard, self.sensor)?;
            let wall_ms = started.elapsed().as_secs_f64() * 1e3;
            let named = answer.best_object().unwrap_or(ObjectIdx(0)).0 as usize;
            let mode = answer.modes.iter().find(|mode| mode.object.0 as usize == object);
            let found = mode.filter(|_| named == object).map(|mode| mode.session_from_object);
            let truth = &heard.session_from_object;
            let error = found.map(|found| self.error_from(object, truth, &found));
            let probability = answer.probabilities[named];
            let (readings, unknown) = (before + 1, answer.unknown);
            steps.push(Step {
                object,
                trial,
                readings,
                named,
                probability,
                unknown,
                error,
                wall_ms,
            });
        }
        Ok(steps)
    }
}
