//! What a simulated camera says about the object and its pose, true or not.

use glam::{DQuat, DVec3};
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::rng::Stream;
use palpate_core::units::{DEG, MM};
use palpate_recogniser::pose_prior::{PoseHypothesis, PosePrior};

/// What a camera says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Saying {
    /// Nothing.
    Nothing,
    /// A pose of any object, off by 10 mm and 10° about each axis, as it states.
    Off10,
    /// The same off by 30 mm and 30°.
    Off30,
    /// Off by 30 mm and 30°, but it states 10 mm and 10°.
    Understated,
    /// The object, and a pose off by 10 mm and 10°.
    Named,
    /// Another object, and a pose off by 10 mm and 10°.
    WrongObject,
    /// As `Named`, but in a tenth of the sessions anywhere within half a metre, turned any way.
    WrongPose10,
    /// A pose of any object anywhere within half a metre, turned any way.
    WrongPose,
    /// A detector's weights: 0.7 for the true object and the rest for four others.
    Classes,
}

/// All of them.
pub(super) const SAYINGS: [Saying; 9] = [
    Saying::Nothing,
    Saying::Off10,
    Saying::Off30,
    Saying::Understated,
    Saying::Named,
    Saying::WrongObject,
    Saying::WrongPose10,
    Saying::WrongPose,
    Saying::Classes,
];

/// Share of sessions in which the pose of `WrongPose10` is wrong.
const WRONG_POSES: f64 = 0.1;

/// Farthest wrong pose along each axis, metres.
const FAR: f64 = 500.0 * MM;

/// The detector's weight of the true object, and the number of objects that share the rest.
const CLASS: (f64, usize) = (0.7, 4);

impl Saying {
    /// Its name in rows and keys.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Off10 => "off_10",
            Self::Off30 => "off_30",
            Self::Understated => "understated",
            Self::Named => "named",
            Self::WrongObject => "wrong_object",
            Self::WrongPose10 => "wrong_pose_in_10",
            Self::WrongPose => "wrong_pose",
            Self::Classes => "classes",
        }
    }

    /// The statement about one of `n_objects` that lies at `truth`.
    pub(super) fn said(
        self,
        object: usize,
        n_objects: usize,
        truth: &Pose,
        stream: &mut Stream,
    ) -> Option<PosePrior> {
        let (small, large) = ([10.0 * MM, 10.0 * DEG], [30.0 * MM, 30.0 * DEG]);
        let mut another = || (object + 1 + stream.index(n_objects - 1)) % n_objects;
        let (named, off, stated) = match self {
            Self::Nothing => return None,
            Self::Off10 => (None, Some(small), small),
            Self::Off30 => (None, Some(large), large),
            Self::Understated => (None, Some(large), small),
            Self::Named => (Some(object), Some(small), small),
            Self::WrongObject => (Some(another()), Some(small), small),
            Self::WrongPose10 => {
                let is_wrong = stream.uniform(0.0, 1.0) < WRONG_POSES;
                (Some(object), (!is_wrong).then_some(small), small)
            }
            Self::WrongPose => (None, None, small),
            Self::Classes => {
                let (own, n) = CLASS;
                let mut class_weights = vec![(ObjectIdx(object as u32), own)];
                let rest = (1.0 - own) / n as f64;
                class_weights.extend((0..n).map(|_| (ObjectIdx(another() as u32), rest)));
                return Some(PosePrior { class_weights, ..PosePrior::default() });
            }
        };
        let pose = match off {
            Some([moved, turned]) => {
                let mut off = |by: f64| DVec3::from_array([0; 3].map(|_| by * stream.normal()));
                let (moved, turned) = (off(moved), DQuat::from_scaled_axis(off(turned)));
                Pose::from_parts(turned * truth.rotation, truth.translation + moved)
            }
            None => {
                let far = DVec3::from_array([0; 3].map(|_| stream.uniform(-FAR, FAR)));
                Pose::from_parts(stream.rotation(), truth.translation + far)
            }
        };
        let hypothesis = PoseHypothesis {
            object: named.map(|object| ObjectIdx(object as u32)),
            session_from_object: pose,
            covariance: PoseHypothesis::diagonal(stated[0], stated[1]),
            weight: 1.0,
        };
        Some(PosePrior { hypotheses: vec![hypothesis], ..PosePrior::default() })
    }
}
