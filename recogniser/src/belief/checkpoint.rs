//! Checkpoints: the conclusions of a belief as bytes, from which it can be resumed.
//!
//! Observations are cheap to compute from the readings; the search is expensive, and its
//! conclusions are few numbers. A belief is therefore resumed by observing its readings again
//! without searching, and then restoring the conclusions. The result equals the stored belief
//! bit for bit if the same code and the same model produced both.

use glam::{Mat3, Quat, Vec3};
use thiserror::Error;

use super::common::Prior;
use super::motion::AMPLITUDES;
use super::object::{ObjectBelief, is_impossible};
use super::stage::Stage;
use crate::observe::inverse_pose::InversePose;
use crate::propose::proposals::PairEvidence;
use crate::verify::hypothesis::Hypothesis;
use crate::verify::motion_prior::MotionPrior;

/// Numbers of a pose of a motion prior: a rotation matrix, a translation, a share.
const POSE_FLOATS: usize = 13;

/// Numbers of a hypothesis: a quaternion, a translation, a score.
const HYPOTHESIS_FLOATS: usize = 8;

/// Bytes are not the checkpoint of a belief over this model after these readings.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("these bytes are not a checkpoint of a belief after these readings")]
pub struct NotCheckpoint;

/// Conclusions of a belief.
#[derive(Clone, Debug)]
pub(super) struct Checkpoint {
    pub(super) n_readings: usize,
    pub(super) n_touches: usize,
    pub(super) stage: Stage,
    pub(super) prior: Prior,
    /// The objects of each component, rest first.
    pub(super) components: Vec<Vec<ObjectBelief>>,
}

impl Checkpoint {
    /// The bytes, little-endian.
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut out = Writer(Vec::new());
        let n_objects = self.prior.log_objects.len();
        for count in [n_objects, self.n_readings, self.n_touches, self.stage.number()] {
            out.count(count);
        }
        out.count(self.components.len() - 1);
        out.double(self.prior.unknown);
        self.prior.log_objects.iter().for_each(|log| out.double(*log));
        self.components.iter().flatten().for_each(|object| out.object(object));
        out.0
    }

    /// The checkpoint of a belief over this many objects.
    pub(super) fn from_bytes(bytes: &[u8], n_objects: usize) -> Result<Self, NotCheckpoint> {
        let mut from = Reader(bytes);
        if from.count()? != n_objects {
            return Err(NotCheckpoint);
        }
        let (n_readings, n_touches) = (from.count()?, from.count()?);
        let stage = Stage::from_number(from.count()?).ok_or(NotCheckpoint)?;
        let n_drifting = from.count()?;
        if n_drifting > AMPLITUDES {
            return Err(NotCheckpoint);
        }
        let unknown = from.double()?;
        let log_objects: Result<Vec<f64>, _> = (0..n_objects).map(|_| from.double()).collect();
        let log_objects = log_objects?;
        let mut components = Vec::new();
        for _ in 0..=n_drifting {
            let objects = log_objects.iter().map(|log| from.object(is_impossible(*log)));
            components.push(objects.collect::<Result<Vec<ObjectBelief>, _>>()?);
        }
        let prior = Prior { log_objects, unknown };
        let is_all = from.0.is_empty();
        is_all
            .then_some(Self { n_readings, n_touches, stage, prior, components })
            .ok_or(NotCheckpoint)
    }
}

struct Writer(Vec<u8>);

impl Writer {
    fn count(&mut self, n: usize) {
        self.0.extend_from_slice(&(n as u32).to_le_bytes());
    }

    fn double(&mut self, x: f64) {
        self.0.extend_from_slice(&x.to_le_bytes());
    }

    fn floats(&mut self, floats: &[f32]) {
        floats.iter().for_each(|x| self.0.extend_from_slice(&x.to_le_bytes()));
    }

    fn object(&mut self, object: &ObjectBelief) {
        self.double(object.log_evidence);
        self.double(object.retrieval_score);
        let (pair, prior) = (&object.pair, &object.motion_prior);
        self.floats(&[pair.geometry, pair.evidence, pair.appearance]);
        self.floats(&[prior.position, prior.angle]);
        self.count(prior.poses.len());
        for (pose, weight) in &prior.poses {
            self.floats(&pose.object_from_session.to_cols_array());
            self.floats(&pose.translation.to_array());
            self.floats(&[*weight]);
        }
        self.count(object.hypotheses.len());
        for hypothesis in &object.hypotheses {
            self.floats(&hypothesis.rotation.to_array());
            self.floats(&hypothesis.translation.to_array());
            self.floats(&[hypothesis.score]);
        }
    }
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], NotCheckpoint> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(NotCheckpoint)?;
        self.0 = rest;
        Ok(*taken)
    }

    fn count(&mut self) -> Result<usize, NotCheckpoint> {
        Ok(u32::from_le_bytes(self.take()?) as usize)
    }

    fn double(&mut self) -> Result<f64, NotCheckpoint> {
        Ok(f64::from_le_bytes(self.take()?))
    }

    fn floats<const N: usize>(&mut self) -> Result<[f32; N], NotCheckpoint> {
        let mut floats = [0.0; N];
        for x in &mut floats {
            *x = f32::from_le_bytes(self.take()?);
        }
        Ok(floats)
    }

    /// Reads a list of items of `bytes` each; refuses a count that exceeds the remaining bytes.
    fn list<T>(
        &mut self,
        bytes: usize,
        item: impl Fn(&mut Self) -> Result<T, NotCheckpoint>,
    ) -> Result<Vec<T>, NotCheckpoint> {
        let n = self.count()?;
        if n > self.0.len() / bytes {
            return Err(NotCheckpoint);
        }
        (0..n).map(|_| item(self)).collect()
    }

    fn object(&mut self, is_ruled_out: bool) -> Result<ObjectBelief, NotCheckpoint> {
        let (log_evidence, retrieval_score) = (self.double()?, self.double()?);
        let [geometry, evidence, appearance] = self.floats()?;
        let [position, angle] = self.floats()?;
        let poses = self.list(POSE_FLOATS * size_of::<f32>(), |from| {
            let object_from_session = Mat3::from_cols_array(&from.floats()?);
            let translation = Vec3::from_array(from.floats()?);
            let [weight] = from.floats()?;
            Ok((InversePose { object_from_session, translation }, weight))
        })?;
        let hypotheses = self.list(HYPOTHESIS_FLOATS * size_of::<f32>(), |from| {
            let rotation = Quat::from_array(from.floats()?);
            let translation = Vec3::from_array(from.floats()?);
            let [score] = from.floats()?;
            Ok(Hypothesis { rotation, translation, score })
        })?;
        Ok(ObjectBelief {
            hypotheses,
            log_evidence,
            pair: PairEvidence { geometry, evidence, appearance },
            retrieval_score,
            motion_prior: MotionPrior { poses, position, angle },
            is_ruled_out,
        })
    }
}
