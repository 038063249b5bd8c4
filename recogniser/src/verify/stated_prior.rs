//! The density of a stated pose prior: a camera's word beside the uniform prior.
//!
//! Equations R32 and R33 of docs/camera-model.md. All densities are ratios to the uniform prior: a
//! place anywhere in the workspace volume, turned any way. So no statement is 1, ln 0.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::{DQuat, DVec3, Mat3, Quat, Vec3};
use nalgebra::{Matrix3, Vector3};
use palpate_core::object::ObjectIdx;
use palpate_core::reading::Looseness;

use super::gaussian::{inside, normals, quasi_normal, single};
use crate::observe::inverse_pose::InversePose;
use crate::options::SurfaceOptions;
use crate::pose_prior::{PoseHypothesis, PosePrior, PosePriorError, Workspace, block};
use posed::{GivenTurn, StatedPose};

/// Squared deviations beyond which a hypothesis says nothing: its density is below e⁻²⁵ of the peak.
const FAR: f32 = 50.0;

/// Chosen: share of objects outside the catalogue that the camera confuses with a known object, and
/// that stand in its pose. The others have any orientation.
const ALIKE: f32 = 0.5;

/// Least share of a hypothesis inside the workspace.
const INSIDE_MIN: f64 = 1e-3;

/// A statement, checked against a catalogue, and what it says of the objects.
#[derive(Clone, Debug)]
pub(crate) struct Statement {
    prior: PosePrior,
    objects: Vec<ObjectShare>,
    /// ln p(o) of equation R32.
    pub(crate) log_objects: Vec<f64>,
    /// Typical radius of an object, metres.
    radius: f64,
    /// Variances by moves before the first touch: of the position (m²) and of the angle (rad²).
    moved: [f64; 2],
}

/// Factors of one object in equation R32, each divided by p(o).
#[derive(Clone, Copy, Debug)]
struct ObjectShare {
    /// Of hypotheses of any object, and of those that name another one.
    base: f32,
    /// Of hypotheses that name it.
    named: f32,
    /// Of the uniform prior.
    wrong: f32,
}

impl Statement {
    /// The statement beside the prior of the objects (ln, normalised). `radius` is that of a
    /// typical object, metres.
    pub(crate) fn new(
        prior: &PosePrior,
        log_prior: &[f64],
        radius: f32,
    ) -> Result<Self, PosePriorError> {
        prior.check(log_prior.len())?;
        let before: Vec<f64> = log_prior.iter().map(|log| log.exp()).collect();
        let base = by_class(prior, &before)?;
        let total: f64 = prior.hypotheses.iter().map(|h| h.weight).sum();
        let hypotheses = prior.hypotheses.iter();
        let hypotheses =
            hypotheses.map(|h| PoseHypothesis { weight: h.weight / total, ..h.clone() }).collect();
        let prior = PosePrior { hypotheses, ..prior.clone() };
        let right = 1.0 - prior.wrong;
        let names = |object: usize| {
            let of = |h: &&PoseHypothesis| h.object == Some(ObjectIdx(object as u32));
            prior.hypotheses.iter().filter(of).map(|h| h.weight).sum::<f64>()
        };
        let named: f64 =
            prior.hypotheses.iter().filter(|h| h.object.is_some()).map(|h| h.weight).sum();
        // Equation R32: hypotheses of any object count by the class, the others by their name,
        // which is wrong as often as the pose.
        let of = |object: usize| {
            let known = (1.0 - named + prior.wrong * named) * base[object];
            if before[object] > 0.0 {
                right * (known + right * names(object)) + prior.wrong * before[object]
            } else {
                0.0
            }
        };
        let all: Vec<f64> = (0..before.len()).map(of).collect();
        let sum: f64 = all.iter().sum();
        let share = |object: usize| {
            let p = all[object];
            let over = |x: f64| if p > 0.0 { (x / p) as f32 } else { 0.0 };
            ObjectShare {
                base: over(right * base[object]),
                named: over(right * right),
                wrong: over(prior.wrong * before[object]),
            }
        };
        let objects = (0..before.len()).map(share).collect();
        let log_objects = all.iter().map(|p| (p / sum).ln()).collect();
        Ok(Self { prior, objects, log_objects, radius: f64::from(radius), moved: [0.0; 2] })
    }

    /// Loosens it for a move of the object before its first touch.
    pub(crate) fn loosen(&mut self, motion: &Looseness) {
        self.moved[0] += motion.position.powi(2);
        self.moved[1] += motion.angle.powi(2);
    }

    /// Bytes of its lists.
    pub(crate) fn bytes(&self) -> usize {
        self.prior.hypotheses.capacity() * size_of::<PoseHypothesis>()
            + self.objects.capacity() * (size_of::<ObjectShare>() + size_of::<f64>())
    }
}

/// The prior of the objects times a detector's weights; it sums to 1.
fn by_class(prior: &PosePrior, before: &[f64]) -> Result<Vec<f64>, PosePriorError> {
    if prior.class_weights.is_empty() {
        return Ok(before.to_vec());
    }
    let mut weighed = vec![0.0; before.len()];
    for (ObjectIdx(object), weight) in &prior.class_weights {
        weighed[*object as usize] += weight * before[*object as usize];
    }
    let sum: f64 = weighed.iter().sum();
    if !(sum > 0.0 && sum.is_finite()) {
        return Err(PosePriorError::Weights { of: "classes" });
    }
    Ok(weighed.iter().map(|weight| weight / sum).collect())
}

/// A statement relative to a session's anchor, prepared for look-ups.
#[derive(Clone, Debug)]
pub(crate) struct StatedPrior {
    statement: Arc<Statement>,
    anchor: DVec3,
    /// Volume of the null distribution, cubic metres.
    volume: f64,
    /// Variances that one hypothesis of the search stands for: m², rad².
    alike: [f64; 2],
    poses: Vec<StatedPose>,
    /// The workspace relative to the anchor.
    bounds: Option<[Vec3; 2]>,
}

impl StatedPrior {
    /// A statement relative to an anchor.
    pub(crate) fn new(statement: Arc<Statement>, anchor: DVec3, options: &SurfaceOptions) -> Self {
        let volume = f64::from(options.scale.workspace);
        let alike = [options.merge_distance, options.merge_angle].map(|x| f64::from(x).powi(2));
        let (poses, bounds) = (Vec::new(), None);
        Self { statement, anchor, volume, alike, poses, bounds }.drifted([0.0; 2])
    }

    /// The same after motion of the object since, with variances of m² and rad².
    pub(crate) fn drifted(&self, more: [f64; 2]) -> Self {
        let Self { statement, anchor, volume, alike, .. } = self;
        let moved = statement.moved;
        let variance = |n: usize| moved[n] + alike[n] + more[n];
        let wider = PoseHypothesis::diagonal(variance(0).sqrt(), variance(1).sqrt());
        let normals = normals();
        let pose = |hypothesis: &PoseHypothesis| {
            let covariance = hypothesis.covariance + wider;
            StatedPose::new(hypothesis, covariance, *anchor, statement, *volume, &normals)
        };
        let poses = statement.prior.hypotheses.iter().map(pose).collect();
        let bounds = statement.prior.workspace;
        let bounds = bounds.map(|it| [it.low - *anchor, it.high - *anchor].map(|c| c.as_vec3()));
        Self { poses, bounds, statement: Arc::clone(statement), ..*self }
    }

    /// ln p(T | o) of an object, relative to the uniform prior. Equation R33 of
    /// docs/camera-model.md.
    pub(crate) fn log_density(&self, object: usize, pose: &InversePose) -> f32 {
        let share = self.statement.objects[object];
        let is_inside = self.holds(pose.translation);
        let mut right = 0.0;
        for stated in self.poses.iter().filter(|_| is_inside) {
            let off = pose.translation - stated.translation;
            if off.length_squared() > stated.reach {
                continue;
            }
            match stated.object {
                None => right += share.base * stated.weight * stated.density(off, pose),
                Some(ObjectIdx(named)) => {
                    let density = stated.density(off, pose);
                    let taken = self.statement.prior.wrong as f32 * share.base;
                    let place = (1.0 - ALIKE) * self.place_by(stated, off, 0.0);
                    right += taken * stated.weight * (ALIKE * density + place);
                    if named as usize == object {
                        right += share.named * stated.weight * density;
                    }
                }
            }
        }
        if self.poses.is_empty() && is_inside {
            right = share.base * self.emptiness() as f32;
        }
        (right + share.wrong).max(f32::MIN_POSITIVE).ln()
    }

    /// ln of the density of an unknown object that was touched `n` times about `place`, relative
    /// to the uniform prior: it stands where the camera says too. Equation R34.
    pub(crate) fn log_unknown(&self, place: Vec3, n: f64) -> f64 {
        let variance = self.statement.radius.powi(2) / (3.0 * n);
        let wrong = self.statement.prior.wrong;
        ((1.0 - wrong) * self.place(place, variance) + wrong).ln()
    }

    /// Density of an object's place by all hypotheses, whatever they name, when it is known with a
    /// `variance` (m²) along each axis.
    pub(crate) fn place(&self, at: Vec3, variance: f64) -> f64 {
        if self.poses.is_empty() {
            let Some([low, high]) = self.bounds else { return 1.0 };
            return self.emptiness() * inside(at.as_dvec3(), [low, high], variance);
        }
        let by = |stated: &StatedPose| {
            let density = self.place_by(stated, at - stated.translation, variance);
            f64::from(stated.weight * density)
        };
        self.poses.iter().map(by).sum()
    }

    /// Shares of an object's prior: of hypotheses that say its pose, as (index, share); of places
    /// alone; and of the uniform prior. Each is relative to p(o).
    pub(crate) fn shares(&self, object: usize) -> (Vec<(usize, f64)>, f64, f64) {
        let share = self.statement.objects[object];
        let (mut posed, mut placed) = (Vec::new(), 0.0);
        for (index, stated) in self.poses.iter().enumerate() {
            let weight = f64::from(stated.weight);
            match stated.object {
                None => posed.push((index, f64::from(share.base) * weight)),
                Some(ObjectIdx(named)) => {
                    let taken = self.statement.prior.wrong * f64::from(share.base) * weight;
                    let is_it = named as usize == object;
                    let named = if is_it { f64::from(share.named) * weight } else { 0.0 };
                    posed.push((index, named + f64::from(ALIKE) * taken));
                    placed += (1.0 - f64::from(ALIKE)) * taken;
                }
            }
        }
        if self.poses.is_empty() {
            placed = f64::from(share.base);
        }
        (posed, placed, f64::from(share.wrong))
    }

    /// Number of hypotheses.
    pub(crate) fn n_poses(&self) -> usize {
        self.poses.len()
    }

    /// `n` quasi-random rotations of a hypothesis from the `first` on, each with where the object
    /// then stands.
    pub(crate) fn draws(&self, hypothesis: usize, first: usize, n: usize) -> Drawn {
        let stated = &self.poses[hypothesis];
        let GivenTurn { factor, gain, left, inverse } = stated.given_turn();
        let draw = |n: usize| {
            let turned = factor * quasi_normal(n);
            let moved = gain * turned;
            let by = DQuat::from_scaled_axis(DVec3::new(turned.x, turned.y, turned.z)).as_quat();
            let moved = Vec3::new(moved.x as f32, moved.y as f32, moved.z as f32);
            ((by * stated.rotation).normalize(), stated.translation + moved)
        };
        let peak = stated.scale * self.volume / (TAU.powf(1.5) * left.determinant().sqrt());
        Drawn {
            poses: (first..first + n).map(draw).collect(),
            inverse: single(&inverse),
            peak: peak as f32,
        }
    }

    /// A hypothesis as the distribution of its rotation, and of the place given each.
    pub(crate) fn turning(&self, hypothesis: usize) -> Turning {
        let stated = &self.poses[hypothesis];
        let GivenTurn { gain, left, inverse, .. } = stated.given_turn();
        let peak = stated.scale * self.volume / (TAU.powf(1.5) * left.determinant().sqrt());
        Turning {
            rotation: stated.rotation,
            translation: stated.translation,
            turn: single(&block(&stated.covariance, 3, 3)),
            gain: single(&gain),
            inverse: single(&inverse),
            peak: peak as f32,
        }
    }

    /// Whether the workspace has a place.
    pub(crate) fn holds(&self, place: Vec3) -> bool {
        let holds = |[low, high]: [Vec3; 2]| place.cmpge(low).all() && place.cmple(high).all();
        self.bounds.is_none_or(holds)
    }

    /// Density of a place in the box.
    fn emptiness(&self) -> f64 {
        let volume = |it: Workspace| it.edges().to_array().iter().product::<f64>();
        self.statement.prior.workspace.map_or(1.0, |it| (self.volume / volume(it)).max(1.0))
    }

    fn place_by(&self, stated: &StatedPose, off: Vec3, variance: f64) -> f32 {
        let covariance = block(&stated.covariance, 0, 0) + Matrix3::identity() * variance;
        let Some(inverse) = covariance.try_inverse() else { return 0.0 };
        let off = Vector3::new(off.x, off.y, off.z).map(f64::from);
        let peak = self.volume / (TAU.powf(1.5) * covariance.determinant().sqrt());
        let square = (off.transpose() * inverse * off)[0];
        (stated.scale * peak * (-0.5 * square).exp()) as f32
    }
}

/// Rotations of a hypothesis, and the distribution of the place given each.
#[derive(Clone, Debug)]
pub(crate) struct Drawn {
    /// Rotation, and mean of the place.
    pub(crate) poses: Vec<(Quat, Vec3)>,
    inverse: Mat3,
    peak: f32,
}

impl Drawn {
    /// The density of a place that is seen from the object, turned one way.
    pub(crate) fn near(&self, object_from_session: &Mat3) -> Near {
        let inverse = *object_from_session * self.inverse * object_from_session.transpose();
        Near { inverse, peak: self.peak }
    }
}

/// The distribution of the rotation of a hypothesis, and of the place given it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turning {
    /// Its mean.
    pub(crate) rotation: Quat,
    pub(crate) translation: Vec3,
    /// Covariance of the rotation vector from the mean, about the session's axes, rad².
    pub(crate) turn: Mat3,
    /// Place per rotation.
    gain: Mat3,
    inverse: Mat3,
    peak: f32,
}

impl Turning {
    /// Squared deviations of a place where the object is turned from the mean.
    pub(crate) fn square(&self, turned: Vec3, place: Vec3) -> f32 {
        let off = place - self.translation - self.gain * turned;
        off.dot(self.inverse * off)
    }

    /// Density of a place that is off by this square.
    pub(crate) fn density(&self, square: f32) -> f32 {
        self.peak * (-0.5 * square).exp()
    }
}

/// Density of the place of an object that is turned one way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Near {
    inverse: Mat3,
    peak: f32,
}

impl Near {
    /// Density of a place that lies `off` the mean, in the object frame; `None` where it is
    /// negligible.
    #[inline]
    pub(crate) fn density(&self, off: Vec3) -> Option<f32> {
        let square = off.dot(self.inverse * off);
        (square <= FAR).then(|| self.peak * (-0.5 * square).exp())
    }
}

mod posed;
#[cfg(test)]
mod tests;
