//! What a belief has concluded, as bytes: to keep it somewhere, and to go on from there.
//!
//! Touches and contact patterns follow from the readings at little cost; what costs is the
//! search, and its conclusions are few numbers. So a belief is resumed by looking at its
//! readings again without searching, and then taking over the conclusions. It is the belief
//! that was kept, bit for bit, if the same code made them from the same model.

use glam::{Mat3, Quat, Vec3};
use thiserror::Error;

use super::carried::Carried;
use super::hypothesis::Hypothesis;
use super::motion::AMPLITUDES;
use super::turned::Turned;
use super::{ObjectState, PairEvidence, SurfaceBelief, is_impossible};
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;

/// Bytes are not the conclusions of a belief over this model after these readings.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("these are not the conclusions of a belief after these readings")]
pub struct NotConclusions;

impl SurfaceBelief {
    /// The conclusions from the readings so far, little-endian.
    #[must_use]
    pub fn conclusions(&self) -> Vec<u8> {
        let mut out = Writer(Vec::new());
        for count in [self.objects.len(), self.n_readings, self.touches.len(), self.stage] {
            out.count(count);
        }
        out.count(self.moving.len());
        out.double(self.unknown);
        self.log_prior.iter().for_each(|log| out.double(*log));
        for belief in self.beliefs() {
            belief.objects.iter().for_each(|state| out.object(state));
        }
        out.0
    }

    /// Takes note of a reading whose conclusions [`SurfaceBelief::resume`] brings.
    pub fn retrace(&mut self, reading: &Reading, sensor: &SensorDescription) {
        self.witness(reading, sensor);
    }

    /// Takes note of a motion (see [`SurfaceBelief::loosen`]) in the same way.
    pub fn retrace_motion(&mut self) {
        self.witness_motion();
    }

    /// Takes over conclusions from readings that were all retraced, in their order.
    ///
    /// # Errors
    /// [`NotConclusions`]; the belief is of no use then.
    pub fn resume(&mut self, conclusions: &[u8]) -> Result<(), NotConclusions> {
        let mut from = Reader(conclusions);
        let counts = [self.objects.len(), self.n_readings, self.touches.len()];
        for count in counts {
            if from.count()? != count {
                return Err(NotConclusions);
            }
        }
        self.stage = from.count()?;
        let n_moving = from.count()?;
        self.unknown = from.double()?;
        for log in &mut self.log_prior {
            *log = from.double()?;
        }
        for (state, log_prior) in self.objects.iter_mut().zip(&self.log_prior) {
            *state = from.object(is_impossible(*log_prior))?;
        }
        // All that is believed of a moving object but its poses follows from the touches.
        self.moving = match n_moving {
            0 => Vec::new(),
            AMPLITUDES if self.options.motion.is_none() => self.all_moving(),
            _ => return Err(NotConclusions),
        };
        for moving in &mut self.moving {
            for state in &mut moving.objects {
                *state = from.object(state.is_ruled_out)?;
            }
        }
        if from.0.is_empty() { Ok(()) } else { Err(NotConclusions) }
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

    fn object(&mut self, state: &ObjectState) {
        self.double(state.log_evidence);
        self.double(state.standing);
        let (pair, carried) = (&state.pair, &state.carried);
        self.floats(&[pair.geometry, pair.evidence, pair.looks]);
        self.floats(&[carried.position, carried.angle]);
        self.count(carried.poses.len());
        for (pose, weight) in &carried.poses {
            self.floats(&pose.object_from_session.to_cols_array());
            self.floats(&pose.translation.to_array());
            self.floats(&[*weight]);
        }
        self.count(state.hypotheses.len());
        for hypothesis in &state.hypotheses {
            self.floats(&hypothesis.rotation.to_array());
            self.floats(&hypothesis.translation.to_array());
            self.floats(&[hypothesis.score]);
        }
    }
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], NotConclusions> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(NotConclusions)?;
        self.0 = rest;
        Ok(*taken)
    }

    fn count(&mut self) -> Result<usize, NotConclusions> {
        Ok(u32::from_le_bytes(self.take()?) as usize)
    }

    fn double(&mut self) -> Result<f64, NotConclusions> {
        Ok(f64::from_le_bytes(self.take()?))
    }

    fn floats<const N: usize>(&mut self) -> Result<[f32; N], NotConclusions> {
        let mut floats = [0.0; N];
        for x in &mut floats {
            *x = f32::from_le_bytes(self.take()?);
        }
        Ok(floats)
    }

    /// So many items of `bytes` each; a count that the rest cannot hold is refused at once.
    fn list<T>(
        &mut self,
        bytes: usize,
        item: impl Fn(&mut Self) -> Result<T, NotConclusions>,
    ) -> Result<Vec<T>, NotConclusions> {
        let n = self.count()?;
        if n > self.0.len() / bytes {
            return Err(NotConclusions);
        }
        (0..n).map(|_| item(self)).collect()
    }

    fn object(&mut self, is_ruled_out: bool) -> Result<ObjectState, NotConclusions> {
        let (log_evidence, standing) = (self.double()?, self.double()?);
        let [geometry, evidence, looks] = self.floats()?;
        let [position, angle] = self.floats()?;
        let poses = self.list(13 * size_of::<f32>(), |from| {
            let object_from_session = Mat3::from_cols_array(&from.floats()?);
            let translation = Vec3::from_array(from.floats()?);
            let [weight] = from.floats()?;
            Ok((Turned { object_from_session, translation }, weight))
        })?;
        let hypotheses = self.list(8 * size_of::<f32>(), |from| {
            let rotation = Quat::from_array(from.floats()?);
            let translation = Vec3::from_array(from.floats()?);
            let [score] = from.floats()?;
            Ok(Hypothesis { rotation, translation, score })
        })?;
        Ok(ObjectState {
            hypotheses,
            log_evidence,
            pair: PairEvidence { geometry, evidence, looks },
            standing,
            carried: Carried { poses, position, angle },
            is_ruled_out,
        })
    }
}
