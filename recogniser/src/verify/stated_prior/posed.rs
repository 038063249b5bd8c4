//! A hypothesis of a stated prior, relative to the anchor and prepared for look-ups.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Mat3, Quat, Vec3};
use nalgebra::{Cholesky, Matrix3, Matrix6, Vector3};
use palpate_core::object::ObjectIdx;

use super::{FAR, INSIDE_MIN, Statement};
use crate::observe::inverse_pose::InversePose;
use crate::pose_prior::{PoseHypothesis, block};
use crate::verify::gaussian::{normalizer, share_inside, single};

/// A hypothesis relative to the anchor.
#[derive(Clone, Debug)]
pub(super) struct StatedPose {
    pub(super) object: Option<ObjectIdx>,
    pub(super) weight: f32,
    pub(super) rotation: Quat,
    pub(super) translation: Vec3,
    pub(super) covariance: Matrix6<f64>,
    /// The inverse of the Cholesky factor of the covariance: blocks of place, place to rotation,
    /// and rotation.
    whitening: [Mat3; 3],
    /// ln of the peak of the density.
    log_peak: f32,
    /// Factor of the density of a place: at most the workspace is as wide as can be, and only the
    /// part inside the box counts.
    pub(super) scale: f64,
    /// Largest squared distance at which it says anything, m².
    pub(super) reach: f32,
}

impl StatedPose {
    pub(super) fn new(
        hypothesis: &PoseHypothesis,
        covariance: Matrix6<f64>,
        anchor: DVec3,
        statement: &Statement,
        volume: f64,
        normals: &[Vector3<f64>],
    ) -> Self {
        let pose = &hypothesis.session_from_object;
        let factor = Cholesky::new(covariance).expect("checked").l();
        let white = factor.try_inverse().expect("positive on its diagonal");
        let place = block(&covariance, 0, 0);
        let occupied = TAU.powf(1.5) * place.determinant().sqrt();
        let inside = statement
            .prior
            .workspace
            .map_or(1.0, |space| share_inside(&place, pose.translation, space));
        let scale = (occupied / volume).max(1.0) / inside.max(INSIDE_MIN);
        let turns = normalizer(&block(&covariance, 3, 3), normals);
        let root: f64 = (0..6).map(|n| factor[(n, n)].ln()).sum();
        let uniform = (volume * 8.0 * PI * PI).ln();
        let log_peak = uniform + scale.ln() - 3.0 * TAU.ln() - root - turns.ln();
        Self {
            object: hypothesis.object,
            weight: hypothesis.weight as f32,
            rotation: pose.rotation.as_quat(),
            translation: (pose.translation - anchor).as_vec3(),
            covariance,
            whitening: [(0, 0), (3, 0), (3, 3)].map(|(r, c)| single(&block(&white, r, c))),
            log_peak: log_peak as f32,
            scale,
            reach: FAR * place.trace() as f32,
        }
    }

    /// The distribution of the place given the rotation.
    pub(super) fn given_turn(&self) -> GivenTurn {
        let (place, cross) = (block(&self.covariance, 0, 0), block(&self.covariance, 0, 3));
        let turn = block(&self.covariance, 3, 3);
        let factor = Cholesky::new(turn).expect("checked").l();
        let gain = cross * turn.try_inverse().expect("checked");
        let left = place - gain * cross.transpose();
        let inverse = left.try_inverse().expect("positive definite");
        GivenTurn { factor, gain, left, inverse }
    }

    /// Density of a pose that lies `off` the mean.
    pub(super) fn density(&self, off: Vec3, pose: &InversePose) -> f32 {
        let [place, across, turn] = self.whitening;
        let rotation = Quat::from_mat3(&pose.object_from_session).conjugate();
        let turned = rotation * self.rotation.conjugate();
        let turned = if turned.w < 0.0 { -turned } else { turned };
        let square = (place * off).length_squared()
            + (across * off + turn * turned.to_scaled_axis()).length_squared();
        if square > FAR { 0.0 } else { (self.log_peak - 0.5 * square).exp() }
    }
}

/// The place of an object given its rotation.
pub(super) struct GivenTurn {
    /// Cholesky factor of the covariance of the rotation.
    pub(super) factor: Matrix3<f64>,
    /// Place per rotation.
    pub(super) gain: Matrix3<f64>,
    /// Covariance of the place that is left.
    pub(super) left: Matrix3<f64>,
    /// Its inverse.
    pub(super) inverse: Matrix3<f64>,
}
