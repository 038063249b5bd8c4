//! The belief of a session: a mixture of components over the motion of the object.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::belief::MismatchError;
use palpate_core::belief::answer::Answer;
use palpate_core::log_prob::normalize;
use palpate_core::reading::point_contact::PointContact;
use palpate_core::reading::{Looseness, Reading};
use palpate_core::rng::Stream;
use palpate_core::sensor::SensorDescription;
use palpate_core::stop::Stop;

use super::answers::{Weighed, answer};
use super::checkpoint::{Checkpoint, NotCheckpoint};
use super::common::Common;
use super::component::{Component, Observed};
use super::felt::{Given, Tool};
use super::motion::{
    AMPLITUDES, Motion, NEGLIGIBLE, TOUCHES_MIN, amplitudes, known, leader, log_priors,
};
use super::object::is_impossible;
use super::posterior::{Explained, log_posterior};
use super::samples::{PoseSample, Posed, samples};
use super::stage::Stage;
use crate::model::SurfaceModel;
use crate::observe::observation::Observation;
use crate::observe::press_space::Miss;
use crate::options::SurfaceOptions;
use crate::verify::stated_prior::Statement;

/// Least prior of an object when a posterior becomes a prior, so that no posterior rules it out
/// for good; a stated prior of zero does.
const SURE: f64 = 1e-12;

/// A belief over the identity and pose of one object, from the readings so far.
#[derive(Clone, Debug)]
pub struct SurfaceBelief {
    common: Common,
    n_readings: usize,
    /// The first touch, to which poses are relative because they are in single precision.
    anchor: DVec3,
    /// Presses that met nothing before there was an anchor.
    misses: Vec<Miss>,
    /// What the session states about the object and its pose.
    statement: Option<Arc<Statement>>,
    /// The tool of the first touch; the error of its centre is shared by all its touches.
    first_tool: Option<Tool>,
    /// Whether the object may have moved since its first touch.
    may_have_moved: bool,
    /// The object rests, or drifts as announced.
    rest: Component,
    /// Components of unannounced drift; empty while rest explains the touches well.
    drifting: Vec<Component>,
}

impl SurfaceBelief {
    /// The belief before any reading. `prior` holds the objects' weights; `None` is uniform. An
    /// object with a weight of zero is not searched.
    ///
    /// # Errors
    /// [`MismatchError::Prior`] when the weights do not fit the catalogue.
    pub fn new(
        model: Arc<SurfaceModel>,
        options: SurfaceOptions,
        prior: Option<&[f64]>,
    ) -> Result<Self, MismatchError> {
        let common = Common::new(model, options, prior)?;
        Ok(Self {
            rest: Component::new(Motion::announced(options.motion), &common),
            drifting: Vec::new(),
            common,
            n_readings: 0,
            anchor: DVec3::ZERO,
            misses: Vec::new(),
            statement: None,
            first_tool: None,
            may_have_moved: false,
        })
    }

    /// Adds a reading. A miss is evidence of free space.
    pub fn add(&mut self, reading: &Reading, sensor: &SensorDescription) {
        self.take(Given::Press(reading, sensor));
    }

    /// Adds a contact without an image. One that touched nothing is evidence of free space.
    pub fn add_contact(&mut self, contact: &PointContact) {
        self.take(Given::Contact(contact));
    }

    fn take(&mut self, given: Given<'_>) {
        let leader = self.leader();
        let observed = self.observe(given);
        self.rest.add(&self.common, &observed, leader.is_none());
        for (index, drifting) in self.drifting.iter_mut().enumerate() {
            drifting.add(&self.common, &observed, leader == Some(index));
        }
        self.doubt_rest();
    }

    /// Turns a reading or a contact into observations.
    fn observe(&mut self, given: Given<'_>) -> Observed {
        self.n_readings += 1;
        let n = self.n_touches();
        let Some(touch) = given.touch(&self.common.model.space) else {
            if n == 0 {
                self.misses.push(given.miss());
                return Observed { touch: None, spaces: Vec::new() };
            }
            let space = given.miss().space(self.anchor).after(n);
            let drift = self.common.options.motion;
            let space = space.weighed(self.rest.spaces(), drift.as_ref());
            return Observed { touch: None, spaces: vec![space] };
        };
        let mut spaces = Vec::new();
        if n == 0 {
            if !self.may_have_moved {
                self.anchor = touch.position;
                self.state();
            }
            let misses = std::mem::take(&mut self.misses);
            for miss in &misses {
                let space = miss.space(self.anchor).weighed(&spaces, None);
                spaces.push(space);
            }
        }
        let (space, scale) = (&self.common.model.space, &self.common.options.scale);
        let mut touch = Observation::new(&touch, self.anchor, space, scale).with_base(given.base());
        // A contact without an image states its own place, whatever its tool's centre is.
        if let Some(tool) = given.tool()
            && *self.first_tool.get_or_insert(tool) != tool
        {
            touch = touch.with_own_tool();
        }
        let rest = self.rest.explained();
        let touch = touch.weighed(rest.touches, rest.motion.drift());
        let space = given.space_of_touch(self.anchor).after(n + 1);
        spaces.push(space.of_novelty(touch.novelty));
        Observed { touch: Some(touch), spaces }
    }

    /// Starts drifting components beside rest when rest explains the touches poorly, and drops
    /// them when rest explains them well and is almost certain.
    fn doubt_rest(&mut self) {
        let rest = self.rest.explained();
        let is_at_rest = rest.motion == Motion::Rest;
        if !is_at_rest || rest.stage != Stage::Poses || rest.n_places() < TOUCHES_MIN {
            return;
        }
        let is_poor = self.rest.is_poor(&self.common);
        if is_poor && self.drifting.is_empty() {
            let mut drifting = self.all_drifting();
            drifting.iter_mut().for_each(|drifting| drifting.start(&self.common));
            self.drifting = drifting;
        } else if !is_poor && !self.drifting.is_empty() {
            let drifts: f64 = self.joint().iter().skip(1).map(|row| known(row)).sum();
            if drifts < NEGLIGIBLE {
                self.drifting = Vec::new();
            }
        }
    }

    /// A drifting component for each amplitude, with the poses of rest.
    fn all_drifting(&self) -> Vec<Component> {
        let amplitudes = amplitudes(&self.common.model, &self.common.options.scale);
        amplitudes.map(|drift| self.rest.drifting(drift)).to_vec()
    }

    /// Announces that the object may have moved since the last touch, by deviations of `motion`:
    /// the probabilities of the objects remain, and the pose becomes uncertain.
    pub fn announce_move(&mut self, motion: &Looseness) {
        if self.n_touches() == 0 {
            self.observe_move(motion);
            self.rest.inflate(motion);
            return;
        }
        // The touches so far decide on unannounced drift: the poses are those of the likeliest
        // component, by the prior of before, since the new one contains these touches already.
        // Later touches decide whether the drift continues.
        let leader = self.leader();
        let mut probabilities = self.posterior();
        let prior = &mut self.common.prior;
        prior.unknown = probabilities.pop().unwrap_or(0.0).clamp(SURE, 1.0 - SURE);
        let known: f64 = probabilities.iter().sum();
        let share = |p: f64| (p / known.max(f64::MIN_POSITIVE)).max(SURE).ln();
        for (log_prior, p) in prior.log_objects.iter_mut().zip(probabilities) {
            if !is_impossible(*log_prior) {
                *log_prior = share(p);
            }
        }
        let leader = leader.map(|index| self.drifting.swap_remove(index));
        self.drifting = Vec::new();
        self.rest.move_on(leader, motion, &self.common.prior.log_objects);
        self.observe_move(motion);
    }

    /// Records a move: earlier touches no longer show the object's place.
    fn observe_move(&mut self, motion: &Looseness) {
        if self.n_touches() == 0 {
            self.misses.clear();
            if let Some(statement) = &mut self.statement {
                Arc::make_mut(statement).loosen(motion);
            }
        } else {
            self.may_have_moved = true;
            self.rest.forget_observations();
        }
    }

    /// Makes long loops unwind once `stop` is requested ([`Stop::check`]).
    pub fn heed(&mut self, stop: &Stop) {
        self.common.stop = stop.clone();
    }

    /// The model of the catalogue's objects.
    #[must_use]
    pub fn model(&self) -> &SurfaceModel {
        &self.common.model
    }

    /// The number of readings.
    #[must_use]
    pub fn n_readings(&self) -> usize {
        self.n_readings
    }

    /// The number of readings that touched something, since the last announced move.
    #[must_use]
    pub fn n_touches(&self) -> usize {
        self.rest.explained().touches.len()
    }

    /// Probability that poses explain the touches: 0 until two places are felt.
    pub(crate) fn posed(&self) -> f64 {
        if self.n_touches() < 2 { 0.0 } else { self.leading().posed() }
    }

    /// Bytes of memory without the model, which sessions share.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of::<Self>()
            + self.components().map(Component::bytes).sum::<usize>()
            + self.drifting.capacity() * size_of::<Component>()
            + self.common.prior.log_objects.capacity() * size_of::<f64>()
            + self.misses.iter().map(Miss::bytes).sum::<usize>()
            + self.statement.as_ref().map_or(0, |statement| statement.bytes())
    }

    /// The probability of each object, then of "none of these". Equations R16 and R18 of
    /// docs/recogniser.md.
    #[must_use]
    pub fn posterior(&self) -> Vec<f64> {
        let mut joint = self.joint().into_iter();
        let mut all = joint.next().unwrap_or_default();
        for drifting in joint {
            all.iter_mut().zip(drifting).for_each(|(sum, p)| *sum += p);
        }
        all
    }

    /// The belief as an answer with at most `n_modes` poses. Poses that are equivalent under the
    /// object's symmetry are merged.
    #[must_use]
    pub fn answer(&self, n_modes: usize) -> Answer {
        let joint = self.joint();
        let weighed = self.components().zip(&joint).map(|(component, joint)| {
            let of = component.explained();
            let posed = component.posed();
            Weighed { touches: of.touches, objects: of.objects, joint, posed }
        });
        let weighed: Vec<Weighed<'_>> = weighed.collect();
        let answer = answer(&self.common, self.anchor, &weighed, self.posterior(), n_modes);
        Answer { n_readings: self.n_readings, ..answer }
    }

    /// About `n` poses of the likeliest objects, drawn from the posterior; none before the first
    /// touch. Their probabilities are given that the object is a known one, and sum to 1 minus
    /// the share of omitted poses.
    #[must_use]
    pub fn samples(&self, n: usize, stream: &mut Stream) -> Vec<PoseSample> {
        let (of, posed) = (self.leading().explained(), self.leading().posed());
        let (touches, objects) = (of.touches, of.objects);
        let posed = Posed { anchor: self.anchor, touches, objects, posed };
        samples(&self.common, &posed, &self.posterior(), n, stream)
    }

    /// The conclusions from the readings so far, as bytes, little-endian.
    #[must_use]
    pub fn checkpoint(&self) -> Vec<u8> {
        let conclusions = |component: &Component| {
            let of = component.explained();
            (of.objects.to_vec(), of.places.clone())
        };
        let checkpoint = Checkpoint {
            n_readings: self.n_readings,
            n_touches: self.n_touches(),
            stage: self.rest.explained().stage,
            prior: self.common.prior.clone(),
            components: self.components().map(conclusions).collect(),
        };
        checkpoint.to_bytes()
    }

    /// Records a reading whose conclusions follow from [`SurfaceBelief::resume`].
    pub fn retrace(&mut self, reading: &Reading, sensor: &SensorDescription) {
        let observed = self.observe(Given::Press(reading, sensor));
        self.rest.observe(&observed);
    }

    /// [`SurfaceBelief::retrace`] of a contact without an image.
    pub fn retrace_contact(&mut self, contact: &PointContact) {
        let observed = self.observe(Given::Contact(contact));
        self.rest.observe(&observed);
    }

    /// Records an announced move (see [`SurfaceBelief::announce_move`]) whose conclusions follow
    /// from [`SurfaceBelief::resume`].
    pub fn retrace_move(&mut self, motion: &Looseness) {
        self.observe_move(motion);
    }

    /// Restores the conclusions of a checkpoint after all its readings were retraced in their
    /// order.
    ///
    /// # Errors
    /// [`NotCheckpoint`]; the belief must not be used afterwards.
    pub fn resume(&mut self, bytes: &[u8]) -> Result<(), NotCheckpoint> {
        let n_objects = self.common.prior.log_objects.len();
        let Checkpoint { n_readings, n_touches, stage, prior, components } =
            Checkpoint::from_bytes(bytes, n_objects)?;
        if (n_readings, n_touches) != (self.n_readings, self.n_touches()) {
            return Err(NotCheckpoint);
        }
        // Everything about a drifting component except its poses follows from the touches.
        self.drifting = match components.len() {
            1 => Vec::new(),
            n if n == 1 + AMPLITUDES && self.rest.explained().motion == Motion::Rest => {
                self.all_drifting()
            }
            _ => return Err(NotCheckpoint),
        };
        self.common.prior = prior;
        let all = std::iter::once(&mut self.rest).chain(&mut self.drifting);
        for (component, (objects, places)) in all.zip(components) {
            component.conclude(stage, objects, places);
        }
        Ok(())
    }

    /// The component at rest, and the parts that all components share.
    pub(super) fn at_rest(&self) -> (&Common, Explained<'_>) {
        (&self.common, self.rest.explained())
    }

    /// The joint probabilities of component (rest first) and object, "none of these" last.
    fn joint(&self) -> Vec<Vec<f64>> {
        let both = self.components().zip(log_priors(self.drifting.len()));
        let logs = both.flat_map(|(component, log_prior)| {
            let logs = log_posterior(&self.common, &component.explained());
            logs.into_iter().map(move |log| log + log_prior)
        });
        let all = normalize(&logs.collect::<Vec<f64>>());
        all.chunks(self.common.prior.log_objects.len() + 1).map(<[f64]>::to_vec).collect()
    }

    fn components(&self) -> impl Iterator<Item = &Component> {
        std::iter::once(&self.rest).chain(&self.drifting)
    }

    /// Index of the drifting component that is likelier than any other; `None` if rest is likelier.
    fn leader(&self) -> Option<usize> {
        if self.drifting.is_empty() { None } else { leader(&self.joint()) }
    }

    /// The likeliest component.
    fn leading(&self) -> &Component {
        self.leader().map_or(&self.rest, |index| &self.drifting[index])
    }
}

mod examined;
mod patches;
mod questions;
mod stating;
#[cfg(test)]
mod tests;
