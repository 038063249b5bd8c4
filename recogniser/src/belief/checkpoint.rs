//! Checkpoints: the conclusions of a belief as bytes, from which it can be resumed.
//!
//! Observations are cheap to compute from the readings; the search is expensive, and its
//! conclusions are few numbers. A belief is therefore resumed by observing its readings again
//! without searching, and then restoring the conclusions. The result equals the stored belief
//! bit for bit if the same code and the same model produced both.

use bytes::{Buf, BufMut, TryGetError};
use glam::{Mat3, Quat, Vec3};
use thiserror::Error;

use super::common::Prior;
use super::motion::AMPLITUDES;
use super::object::{ObjectBelief, is_impossible};
use super::places::Places;
use super::stage::Stage;
use crate::observe::inverse_pose::InversePose;
use crate::propose::proposals::PairEvidence;
use crate::verify::hypothesis::Hypothesis;
use crate::verify::motion_prior::MotionPrior;

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
    pub(super) components: Vec<(Vec<ObjectBelief>, Places)>,
}

impl From<TryGetError> for NotCheckpoint {
    fn from(_too_short: TryGetError) -> Self {
        Self
    }
}

impl Checkpoint {
    /// The bytes, little-endian.
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut to = Vec::new();
        let (n_objects, n_drifting) = (self.prior.log_objects.len(), self.components.len() - 1);
        let stage = self.stage.number();
        for count in [n_objects, self.n_readings, self.n_touches, stage, n_drifting] {
            to.put_u32_le(count as u32);
        }
        to.put_f64_le(self.prior.unknown);
        self.prior.log_objects.iter().for_each(|log| to.put_f64_le(*log));
        for (objects, places) in &self.components {
            objects.iter().for_each(|object| put_object(&mut to, object));
            put_places(&mut to, places);
        }
        to
    }

    /// The checkpoint of a belief over this many objects.
    pub(super) fn from_bytes(mut from: &[u8], n_objects: usize) -> Result<Self, NotCheckpoint> {
        if count(&mut from)? != n_objects {
            return Err(NotCheckpoint);
        }
        let (n_readings, n_touches) = (count(&mut from)?, count(&mut from)?);
        let stage = Stage::from_number(count(&mut from)?).ok_or(NotCheckpoint)?;
        let n_drifting = count(&mut from)?;
        if n_drifting > AMPLITUDES {
            return Err(NotCheckpoint);
        }
        let unknown = from.try_get_f64_le()?;
        let log_objects = (0..n_objects).map(|_| from.try_get_f64_le());
        let log_objects = log_objects.collect::<Result<Vec<f64>, _>>()?;
        let mut components = Vec::new();
        for _ in 0..=n_drifting {
            let objects = log_objects.iter().map(|log| object(&mut from, is_impossible(*log)));
            let objects = objects.collect::<Result<Vec<ObjectBelief>, _>>()?;
            components.push((objects, places(&mut from)?));
        }
        let prior = Prior { log_objects, unknown };
        from.is_empty()
            .then_some(Self { n_readings, n_touches, stage, prior, components })
            .ok_or(NotCheckpoint)
    }
}

fn put_floats(to: &mut Vec<u8>, floats: &[f32]) {
    floats.iter().for_each(|x| to.put_f32_le(*x));
}

fn put_object(to: &mut Vec<u8>, object: &ObjectBelief) {
    to.put_f64_le(object.log_evidence);
    to.put_f64_le(object.retrieval_score);
    let (pair, prior) = (&object.pair, &object.motion_prior);
    put_floats(to, &[pair.geometry, pair.evidence, pair.appearance]);
    put_floats(to, &[prior.position, prior.angle]);
    to.put_u32_le(prior.poses.len() as u32);
    for (pose, weight) in &prior.poses {
        put_floats(to, &pose.object_from_session.to_cols_array());
        put_floats(to, &pose.translation.to_array());
        to.put_f32_le(*weight);
    }
    to.put_u32_le(object.hypotheses.len() as u32);
    for hypothesis in &object.hypotheses {
        put_floats(to, &hypothesis.rotation.to_array());
        put_floats(to, &hypothesis.translation.to_array());
        put_floats(to, &hypothesis.tool.to_array());
        to.put_f32_le(hypothesis.score);
    }
}

fn put_places(to: &mut Vec<u8>, places: &Places) {
    let Places { one, two, paired, first: (stage, first), pair } = places;
    [one, two, paired].into_iter().for_each(|share| to.put_f64_le(*share));
    to.put_u32_le(stage.number() as u32);
    for logs in [first, pair] {
        to.put_u32_le(logs.len() as u32);
        logs.iter().for_each(|log| to.put_f64_le(*log));
    }
}

fn places(from: &mut &[u8]) -> Result<Places, NotCheckpoint> {
    let (one, two, paired) =
        (from.try_get_f64_le()?, from.try_get_f64_le()?, from.try_get_f64_le()?);
    let stage = Stage::from_number(count(from)?).ok_or(NotCheckpoint)?;
    let mut logs = || {
        let n = count(from)?;
        if n > from.len() / size_of::<f64>() {
            return Err(NotCheckpoint);
        }
        Ok((0..n).map(|_| from.try_get_f64_le()).collect::<Result<Vec<f64>, _>>()?)
    };
    let (first, pair) = (logs()?, logs()?);
    Ok(Places { one, two, paired, first: (stage, first), pair })
}

fn count(from: &mut &[u8]) -> Result<usize, NotCheckpoint> {
    Ok(from.try_get_u32_le()? as usize)
}

fn floats<const N: usize>(from: &mut &[u8]) -> Result<[f32; N], NotCheckpoint> {
    let mut floats = [0.0; N];
    for x in &mut floats {
        *x = from.try_get_f32_le()?;
    }
    Ok(floats)
}

/// Reads a list of items of `N` floats each; refuses a count that exceeds the remaining bytes.
fn list<const N: usize, T>(
    from: &mut &[u8],
    item: impl Fn([f32; N]) -> T,
) -> Result<Vec<T>, NotCheckpoint> {
    let n = count(from)?;
    if n > from.len() / (N * size_of::<f32>()) {
        return Err(NotCheckpoint);
    }
    (0..n).map(|_| floats(from).map(&item)).collect()
}

fn object(from: &mut &[u8], is_ruled_out: bool) -> Result<ObjectBelief, NotCheckpoint> {
    let (log_evidence, retrieval_score) = (from.try_get_f64_le()?, from.try_get_f64_le()?);
    let [geometry, evidence, appearance, position, angle] = floats(from)?;
    let poses = list(from, |[a, b, c, d, e, f, g, h, i, x, y, z, weight]| {
        let object_from_session = Mat3::from_cols_array(&[a, b, c, d, e, f, g, h, i]);
        let translation = Vec3::new(x, y, z);
        (InversePose { object_from_session, translation, tool: Vec3::ZERO }, weight)
    })?;
    let hypotheses = list(from, |[i, j, k, real, x, y, z, a, b, c, score]| {
        let rotation = Quat::from_array([i, j, k, real]);
        let (translation, tool) = (Vec3::new(x, y, z), Vec3::new(a, b, c));
        Hypothesis { rotation, translation, tool, score }
    })?;
    Ok(ObjectBelief {
        hypotheses,
        log_evidence,
        pair: PairEvidence { geometry, evidence, appearance },
        retrieval_score,
        motion_prior: MotionPrior { poses, position, angle, stated: None },
        is_ruled_out,
    })
}
