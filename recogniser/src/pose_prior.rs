//! A camera's word: what is known of the object and its pose before the first touch.
//!
//! Equations R32 to R35 of docs/camera-model.md. A session states it once; touches may overrule it.

use glam::DVec3;
use nalgebra::{Matrix3, Matrix6};
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use thiserror::Error;

/// Default share of statements that are wrong: ζ_c of equation R32.
pub const WRONG: f64 = 0.1;

/// Maximum number of hypotheses of one statement.
pub const HYPOTHESES_MAX: usize = 64;

/// A 6 × 6 covariance of a pose: x, y, z in metres, then the rotation vector about the session's
/// axes in radians.
pub type Covariance = Matrix6<f64>;

/// A possible pose of the object.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseHypothesis {
    /// The object that was seen; `None` holds for any object.
    pub object: Option<ObjectIdx>,
    /// Mean of its pose.
    pub session_from_object: Pose,
    /// Covariance of the pose, symmetric and positive definite.
    pub covariance: Covariance,
    /// Weight beside the other hypotheses, at least 0.
    pub weight: f64,
}

/// A box in the session frame that holds the origin of the object's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workspace {
    /// The corner with the smallest coordinates, metres.
    pub low: DVec3,
    /// The corner with the largest coordinates, metres.
    pub high: DVec3,
}

/// A statement about the object and its pose.
#[derive(Clone, Debug, PartialEq)]
pub struct PosePrior {
    /// Possible poses, at most [`HYPOTHESES_MAX`]. None: every pose in the workspace.
    pub hypotheses: Vec<PoseHypothesis>,
    /// A detector's weights of objects, which multiply the prior; an object that is not listed has
    /// the weight 0. None: all objects weigh the same.
    pub class_weights: Vec<(ObjectIdx, f64)>,
    /// Where the object is.
    pub workspace: Option<Workspace>,
    /// Share of statements that are wrong, above 0 and below 1.
    pub wrong: f64,
}

impl Default for PosePrior {
    fn default() -> Self {
        let (hypotheses, class_weights) = (Vec::new(), Vec::new());
        Self { hypotheses, class_weights, workspace: None, wrong: WRONG }
    }
}

/// Error of a statement.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum PosePriorError {
    /// It states nothing.
    #[error("a pose prior without hypotheses, class weights and workspace, expected one of them")]
    Nothing,
    /// Too many hypotheses.
    #[error("{found} hypotheses, expected at most {HYPOTHESES_MAX}")]
    Hypotheses {
        /// Their number.
        found: usize,
    },
    /// The share of wrong statements is impossible.
    #[error("share of wrong statements of {found}, expected above 0 and below 1")]
    Wrong {
        /// The share.
        found: f64,
    },
    /// An object that the catalogue lacks.
    #[error("object {found} of a catalogue of {n_objects}")]
    Object {
        /// Its index.
        found: u32,
        /// Objects of the catalogue.
        n_objects: usize,
    },
    /// Weights that are no weights.
    #[error(
        "weights of {of}, expected finite numbers of at least 0, not all 0 for possible objects"
    )]
    Weights {
        /// Whose weights.
        of: &'static str,
    },
    /// A covariance that is none.
    #[error("covariance of hypothesis {hypothesis}, expected symmetric and positive definite")]
    Covariance {
        /// Index of the hypothesis.
        hypothesis: usize,
    },
    /// A workspace without volume.
    #[error("workspace of no volume, expected low < high along each axis")]
    Workspace,
}

impl PoseHypothesis {
    /// The covariance of independent deviations along each axis (m) and about each axis (rad).
    #[must_use]
    pub fn diagonal(position: f64, angle: f64) -> Covariance {
        let (p, r) = (position.powi(2), angle.powi(2));
        Matrix6::from_diagonal(&[p, p, p, r, r, r].into())
    }

    /// A covariance from 36 numbers, row-major; `None` unless they are one.
    #[must_use]
    pub fn full(rows: &[f64]) -> Option<Covariance> {
        let matrix = (rows.len() == 36).then(|| Matrix6::from_row_slice(rows))?;
        is_covariance(&matrix).then_some(matrix)
    }
}

impl Workspace {
    /// Its edges, metres.
    #[must_use]
    pub fn edges(&self) -> DVec3 {
        self.high - self.low
    }
}

impl PosePrior {
    /// Whether it states anything.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.hypotheses.is_empty() && self.class_weights.is_empty() && self.workspace.is_none()
    }

    /// Checks every number for a catalogue of this many objects.
    ///
    /// # Errors
    /// [`PosePriorError`] names the first fault.
    pub fn check(&self, n_objects: usize) -> Result<(), PosePriorError> {
        if self.is_empty() {
            return Err(PosePriorError::Nothing);
        }
        let found = self.hypotheses.len();
        if found > HYPOTHESES_MAX {
            return Err(PosePriorError::Hypotheses { found });
        }
        if !(self.wrong > 0.0 && self.wrong < 1.0) {
            return Err(PosePriorError::Wrong { found: self.wrong });
        }
        let named = self.hypotheses.iter().filter_map(|hypothesis| hypothesis.object);
        let listed = self.class_weights.iter().map(|(object, _)| *object);
        if let Some(ObjectIdx(found)) = named.chain(listed).find(|o| o.0 as usize >= n_objects) {
            return Err(PosePriorError::Object { found, n_objects });
        }
        let weights: Vec<f64> = self.hypotheses.iter().map(|h| h.weight).collect();
        check_weights("hypotheses", &weights)?;
        let weights: Vec<f64> = self.class_weights.iter().map(|(_, weight)| *weight).collect();
        check_weights("classes", &weights)?;
        for (hypothesis, stated) in self.hypotheses.iter().enumerate() {
            if !is_covariance(&stated.covariance) {
                return Err(PosePriorError::Covariance { hypothesis });
            }
        }
        let has_volume = |space: Workspace| {
            let edges = space.edges();
            edges.is_finite() && edges.min_element() > 0.0
        };
        let has_volume = self.workspace.is_none_or(has_volume);
        has_volume.then_some(()).ok_or(PosePriorError::Workspace)
    }
}

fn check_weights(of: &'static str, weights: &[f64]) -> Result<(), PosePriorError> {
    let are_valid = weights.iter().all(|weight| weight.is_finite() && *weight >= 0.0);
    let are_some = weights.is_empty() || weights.iter().any(|weight| *weight > 0.0);
    (are_valid && are_some).then_some(()).ok_or(PosePriorError::Weights { of })
}

/// Largest difference of entries that should be equal, relative to the deviations.
const ASYMMETRY_MAX: f64 = 1e-6;

/// Whether a matrix is a covariance: finite, symmetric, and positive definite.
fn is_covariance(matrix: &Matrix6<f64>) -> bool {
    if !matrix.iter().all(|x| x.is_finite()) || (0..6).any(|n| matrix[(n, n)] <= 0.0) {
        return false;
    }
    let deviation = |n: usize| matrix[(n, n)].sqrt();
    let is_symmetric = (0..36).all(|at| {
        let (row, col) = (at / 6, at % 6);
        let apart = (matrix[(row, col)] - matrix[(col, row)]).abs();
        apart <= ASYMMETRY_MAX * deviation(row) * deviation(col)
    });
    // Scaled to correlations, so that metres and radians have one condition.
    let scaled = Matrix6::from_fn(|row, col| matrix[(row, col)] / deviation(row) / deviation(col));
    is_symmetric && scaled.cholesky().is_some()
}

/// A 3 × 3 block of a covariance.
pub(crate) fn block(matrix: &Matrix6<f64>, row: usize, col: usize) -> Matrix3<f64> {
    matrix.fixed_view::<3, 3>(row, col).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(object: Option<u32>) -> PosePrior {
        let hypothesis = PoseHypothesis {
            object: object.map(ObjectIdx),
            session_from_object: Pose::IDENTITY,
            covariance: PoseHypothesis::diagonal(0.01, 0.2),
            weight: 1.0,
        };
        PosePrior { hypotheses: vec![hypothesis], ..PosePrior::default() }
    }

    #[test]
    fn every_fault_of_a_statement_is_named() {
        assert_eq!(seen(Some(2)).check(3), Ok(()));
        assert_eq!(PosePrior::default().check(3), Err(PosePriorError::Nothing));
        let error = PosePriorError::Object { found: 3, n_objects: 3 };
        assert_eq!(seen(Some(3)).check(3), Err(error));
        let mut negative = seen(None);
        negative.hypotheses[0].weight = -1.0;
        assert_eq!(negative.check(3), Err(PosePriorError::Weights { of: "hypotheses" }));
        let mut flat = seen(None);
        flat.hypotheses[0].covariance[(4, 4)] = 0.0;
        assert_eq!(flat.check(3), Err(PosePriorError::Covariance { hypothesis: 0 }));
        let sure = PosePrior { wrong: 0.0, ..seen(None) };
        assert_eq!(sure.check(3), Err(PosePriorError::Wrong { found: 0.0 }));
        let low = DVec3::ZERO;
        let workspace = Some(Workspace { low, high: DVec3::new(1.0, 0.0, 1.0) });
        let without = PosePrior { workspace, ..PosePrior::default() };
        assert_eq!(without.check(3), Err(PosePriorError::Workspace));
    }

    #[test]
    fn correlations_beyond_one_are_no_covariance() {
        let mut matrix = PoseHypothesis::diagonal(0.01, 0.2);
        // 0.001 is a correlation of a half between 0.01 m and 0.2 rad; 0.0021 is beyond one.
        (matrix[(0, 5)], matrix[(5, 0)]) = (0.001, 0.001);
        assert!(is_covariance(&matrix));
        matrix[(5, 0)] = 0.0;
        assert!(!is_covariance(&matrix), "not symmetric");
        (matrix[(0, 5)], matrix[(5, 0)]) = (0.002_1, 0.002_1);
        assert!(!is_covariance(&matrix));
    }
}
