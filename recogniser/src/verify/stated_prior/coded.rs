//! A stated prior as bytes, for work on a part of the objects.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;

use super::{ObjectShare, StatedPrior, Statement};
use crate::coding::{Coded, NotWork};
use crate::options::SurfaceOptions;
use crate::pose_prior::{PoseHypothesis, PosePrior, Workspace};

/// Cap on variances that are read (m², rad²): far more than any session has.
const VARIANCE_MAX: f64 = 1e6;

impl Coded for ObjectShare {
    fn put(&self, to: &mut Vec<u8>) {
        let Self { base, named, wrong } = self;
        [*base, *named, *wrong].put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        let [base, named, wrong] = Coded::take(from)?;
        Ok(Self { base, named, wrong })
    }
}

impl Coded for PoseHypothesis {
    fn put(&self, to: &mut Vec<u8>) {
        let Self { object, session_from_object, covariance, weight } = self;
        object.put(to);
        session_from_object.put(to);
        covariance.put(to);
        weight.put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        let (object, session_from_object) = Coded::take(from)?;
        let (covariance, weight) = Coded::take(from)?;
        Ok(Self { object, session_from_object, covariance, weight })
    }
}

impl Coded for Workspace {
    fn put(&self, to: &mut Vec<u8>) {
        let Self { low, high } = self;
        low.put(to);
        high.put(to);
    }

    fn take(from: &mut &[u8]) -> Result<Self, NotWork> {
        let (low, high) = Coded::take(from)?;
        Ok(Self { low, high })
    }
}

impl StatedPrior {
    /// Appends the prior as it holds for a range of the objects. What follows from the rest is
    /// left out.
    pub(crate) fn put(&self, objects: Range<usize>, to: &mut Vec<u8>) {
        let Self { statement, anchor, more, .. } = self;
        let Statement { prior, objects: all, radius, moved, .. } = &**statement;
        let PosePrior { hypotheses, workspace, wrong, .. } = prior;
        hypotheses.put(to);
        workspace.put(to);
        [*wrong, *radius].put(to);
        moved.put(to);
        anchor.put(to);
        more.put(to);
        objects.start.put(to);
        all[objects].to_vec().put(to);
    }

    /// Reads the prior of a range of objects, and that range.
    pub(crate) fn take(
        from: &mut &[u8],
        options: &SurfaceOptions,
    ) -> Result<(Self, Range<usize>), NotWork> {
        let (hypotheses, workspace) = Coded::take(from)?;
        let [wrong, radius] = Coded::take(from)?;
        let (moved, anchor): ([f64; 2], DVec3) = Coded::take(from)?;
        let (more, first): ([f64; 2], usize) = Coded::take(from)?;
        let objects = Vec::<ObjectShare>::take(from)?;
        let prior = PosePrior { hypotheses, class_weights: Vec::new(), workspace, wrong };
        let variances = moved.iter().chain(&more);
        let is_sound = variances.into_iter().all(|x| (0.0..=VARIANCE_MAX).contains(x))
            && anchor.is_finite()
            && (prior.is_empty() || prior.check(usize::MAX).is_ok());
        let last = first.checked_add(objects.len()).filter(|_| is_sound).ok_or(NotWork)?;
        let log_objects = Vec::new();
        let statement = Statement { prior, first, objects, log_objects, radius, moved };
        let blank = Self::without_poses(Arc::new(statement), anchor, options);
        let stated = blank.placed(more).ok_or(NotWork)?;
        let can_draw = stated.poses.iter().all(|pose| pose.given_turn().is_some());
        if can_draw { Ok((stated, first..last)) } else { Err(NotWork) }
    }
}
