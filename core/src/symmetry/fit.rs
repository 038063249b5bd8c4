//! Self-registration of a map: the nearest motion under which its patches match each other.
//!
//! Robust Gauss–Newton steps (Geman and McClure, 1987) from each moved patch to its match:
//! along the match's normal, softly along the surface, which the map only samples, and by the
//! normals, as in the refinement of a pose.

use glam::{DQuat, DVec3};
use nalgebra::{Matrix6, Vector3, Vector6};

use super::cloud::Cloud;
use crate::pose::Pose;
use crate::units::{DEG, MM};

/// Misfit at which a patch has lost three quarters of its weight.
const OUTLIER: f64 = 3.0;

/// Fits `motion` (object to object), in at most `steps_max` steps on one patch in `stride`.
pub(super) fn fit(cloud: &Cloud, motion: Pose, steps_max: usize, stride: usize) -> Pose {
    let mut motion = motion;
    for _step in 0..steps_max {
        let Some((moved, turned)) = step(cloud, &motion, stride) else { break };
        let rotation = DQuat::from_scaled_axis(turned) * motion.rotation;
        motion = Pose::from_parts(rotation, motion.translation + moved);
        if moved.length() < 0.01 * MM && turned.length() < 0.02 * DEG {
            break;
        }
    }
    motion
}

/// One step: a translation (metres) and a rotation about the object's origin (rad).
fn step(cloud: &Cloud, motion: &Pose, stride: usize) -> Option<(DVec3, DVec3)> {
    // Free directions stay, as if known to 20 mm and 30°.
    let (position, rotation) = ((20.0 * MM).powi(-2), (30.0 * DEG).powi(-2));
    let free = Vector6::new(position, position, position, rotation, rotation, rotation);
    let (mut hessian, mut gradient) = (Matrix6::from_diagonal(&free), Vector6::zeros());
    for patch in (0..cloud.len()).step_by(stride) {
        let found = cloud.explain(motion, patch);
        let Some(other) = found.by else { continue };
        let weight = (1.0 + (found.misfit / OUTLIER).powi(2)).powi(-2);
        let lever = motion.turn(cloud.positions[patch]);
        let off = cloud.positions[other] - (lever + motion.translation);
        let outward = cloud.normals[other];
        let facing = motion.turn(cloud.normals[patch]);
        let (first, second) = outward.any_orthonormal_pair();
        // A turn by ω moves the patch by ω × lever: along d by ω · (lever × d).
        for (along, information) in
            [(outward, cloud.across), (first, cloud.along[other]), (second, cloud.along[other])]
        {
            let moves = (along, lever.cross(along));
            add(&mut hessian, &mut gradient, moves, off.dot(along), weight * information);
        }
        for along in [first, second] {
            let turns = (DVec3::ZERO, facing.cross(along));
            let bent = (outward - facing).dot(along);
            let information = cloud.facing(patch, other);
            add(&mut hessian, &mut gradient, turns, bent, weight * information);
        }
    }
    let change = hessian.cholesky()?.solve(&gradient);
    let part = |from: usize| DVec3::new(change[from], change[from + 1], change[from + 2]);
    Some((part(0), part(3)))
}

/// Adds one equation: moving and turning along `row` closes `residual`.
fn add(
    hessian: &mut Matrix6<f64>,
    gradient: &mut Vector6<f64>,
    row: (DVec3, DVec3),
    residual: f64,
    weight: f64,
) {
    let column = |v: DVec3| Vector3::new(v.x, v.y, v.z);
    let mut both = Vector6::zeros();
    both.fixed_rows_mut::<3>(0).copy_from(&column(row.0));
    both.fixed_rows_mut::<3>(3).copy_from(&column(row.1));
    hessian.ger(weight, &both, &both, 1.0);
    gradient.axpy(weight * residual, &both, 1.0);
}
