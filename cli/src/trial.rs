//! A trial: a simulated robot touches one object repeatedly, and the server's beliefs are compared
//! with the truth.

use std::time::{Duration, Instant};

use anyhow::Context;
use palpate_client::TouchSession;
use palpate_client::schemas::{AskNextTouches, Belief, CloseSession, NextTouch, TrainingReport};
use palpate_core::pose::Pose;
use palpate_core::symmetry::Symmetry;
use serde::Serialize;

use crate::robot::{Robot, wire_pose};
use crate::verdict::{self, Verdict};

/// Deadline long enough to evaluate everything, so that a run is reproducible; milliseconds.
const DEADLINE_MS: u32 = 5_000;

/// Mean number of attempts per touch above which a robot counts as stuck.
const TRIES_PER_TOUCH_MAX: u32 = 10;

/// Stop rule of a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StopRule {
    /// Probability that the likeliest object of the catalogue must reach …
    pub(crate) probability: f64,
    /// … in this many consecutive touches.
    pub(crate) in_a_row: u32,
    /// Maximum number of touches.
    pub(crate) touches_max: u32,
    /// Pause between two touches.
    pub(crate) pause: Duration,
}

/// The truth of a trial.
#[derive(Clone, Debug)]
pub(crate) struct Truth {
    /// Name of the object when it was trained; `None` if the catalogue does not have it.
    pub(crate) object: Option<String>,
    /// Pose of the object frame.
    pub(crate) session_from_object: Pose,
    /// Origin of the object frame in the mesh, metres.
    pub(crate) origin_in_mesh: [f64; 3],
    /// Symmetry of the mesh in the object frame. The symmetry that training found is not the truth.
    pub(crate) symmetry: Symmetry,
}

impl Truth {
    /// Truth of the object that the robot touches. Name and origin come from the version's report,
    /// the symmetry from the mesh (mesh frame).
    pub(crate) fn new(
        robot: &Robot,
        symmetry_in_mesh: &Symmetry,
        object: &str,
        report: &TrainingReport,
    ) -> anyhow::Result<Self> {
        let trained = report
            .objects
            .iter()
            .find(|trained| trained.name == object || trained.id.to_string() == object)
            .ok_or_else(|| {
                let names = report.objects.iter().map(|trained| trained.name.as_str());
                verdict::not_trained(object, names)
            })?;
        Ok(Self {
            object: Some(trained.name.clone()),
            session_from_object: robot.session_from_object(trained.origin_in_mesh),
            origin_in_mesh: trained.origin_in_mesh,
            symmetry: symmetry_in_mesh.seen_from(trained.origin_in_mesh.into()),
        })
    }

    /// The request that closes the session with this truth.
    pub(crate) fn closing(&self) -> CloseSession {
        let pose = self.object.as_ref().map(|_| wire_pose(self.session_from_object));
        CloseSession {
            object: self.object.clone(),
            none_of_these: self.object.is_none().then_some(true),
            pose,
        }
    }

    /// Truth of an object that the catalogue does not have: there is no pose to compare.
    pub(crate) fn none_of_these(robot: &Robot) -> Self {
        let origin_in_mesh = [0.0; 3];
        Self {
            object: None,
            session_from_object: robot.session_from_object(origin_in_mesh),
            origin_in_mesh,
            symmetry: Symmetry::NONE,
        }
    }

    /// Name of the true object, for people.
    pub(crate) fn name(&self) -> &str {
        verdict::name(self.object.as_deref())
    }
}

/// Belief after one more touch, compared with the truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Step {
    /// Number of touches so far, including presses that missed or found no stable contact.
    pub(crate) touches: u32,
    /// Number of touches that touched nothing.
    pub(crate) misses: u32,
    /// The likeliest answer: an object's name, or "none of these".
    pub(crate) answer: String,
    /// The answer's probability.
    pub(crate) probability: f64,
    /// The probability of "none of these".
    pub(crate) unknown: f64,
    /// The likeliest object of the catalogue, even if it is not the answer.
    pub(crate) object: Option<String>,
    /// That object's probability.
    pub(crate) object_probability: f64,
    /// Uncertainty about the identity, bits.
    pub(crate) entropy_bits: f64,
    /// Whether the answer is right.
    pub(crate) right: bool,
    /// Position error of the true object's likeliest pose, metres; among equivalent poses, the one
    /// rotated least from the truth counts.
    #[serde(skip)]
    pub(crate) position_error: Option<f64>,
    /// Orientation error of that pose, radians.
    #[serde(skip)]
    pub(crate) angle_error: Option<f64>,
    /// Orientation error of the reported pose, radians, without regard to symmetry.
    #[serde(skip)]
    pub(crate) plain_angle_error: Option<f64>,
    /// Round-trip time of the reading, milliseconds.
    pub(crate) reading_ms: f64,
}

impl Step {
    /// Compares a belief with the truth.
    fn new(touches: u32, belief: &Belief, truth: &Truth, reading_ms: f64) -> Self {
        let best = belief.objects.first();
        let verdict = Verdict::of(belief);
        let is_true = |name: &str| truth.object.as_deref() == Some(name);
        let mode = belief.poses.iter().find(|mode| is_true(&mode.name));
        let pose = mode.and_then(|mode| Pose::new(mode.pose.position, mode.pose.orientation).ok());
        let nearest = pose.map(|pose| truth.symmetry.nearest_to(&pose, &truth.session_from_object));
        Self {
            touches,
            misses: 0,
            answer: verdict.name().to_owned(),
            probability: verdict.probability,
            unknown: belief.unknown,
            object: best.map(|best| best.name.clone()),
            object_probability: best.map_or(0.0, |best| best.probability),
            entropy_bits: belief.entropy_bits,
            right: verdict.is_right(truth.object.as_deref()),
            position_error: nearest.map(|pose| pose.distance_to(&truth.session_from_object)),
            angle_error: nearest.map(|pose| pose.angle_to(&truth.session_from_object)),
            plain_angle_error: pose.map(|pose| pose.angle_to(&truth.session_from_object)),
            reading_ms,
        }
    }

    /// The position error in millimetres, for output.
    pub(crate) fn position_error_mm(&self) -> Option<f64> {
        self.position_error.map(|metres| metres * 1e3)
    }

    /// The angle error in degrees, for output.
    pub(crate) fn angle_error_deg(&self) -> Option<f64> {
        self.angle_error.map(f64::to_degrees)
    }

    /// The plain angle error in degrees, for output.
    pub(crate) fn plain_angle_error_deg(&self) -> Option<f64> {
        self.plain_angle_error.map(f64::to_degrees)
    }
}

/// Result of a trial.
#[derive(Clone, Debug)]
pub(crate) struct TrialResult {
    /// Name of the true object.
    pub(crate) truth: String,
    /// All steps; never empty.
    pub(crate) steps: Vec<Step>,
    /// The last step.
    pub(crate) last: Step,
}

/// Touches until the stop rule applies; `show` receives every step. A robot guided by the server
/// asks before every touch.
pub(crate) async fn run(
    mut robot: Robot,
    session: &mut TouchSession,
    sensor: &str,
    truth: &Truth,
    rule: StopRule,
    mut show: impl FnMut(&Step),
) -> anyhow::Result<TrialResult> {
    let (mut steps, mut sure, mut tries) = (Vec::<Step>::new(), 0, 0);
    loop {
        tries += 1;
        let told = match robot.wants_to_be_told() {
            true => Some(ask(session, sensor, &robot, tries).await?),
            false => None,
        };
        // The simulation is compute-bound and must not block the threads that talk to the server.
        let (touched, press) = tokio::task::spawn_blocking(move || {
            let press = match &told {
                Some(told) => robot.touch_along(told),
                None => robot.touch().map(Some).map_err(anyhow::Error::from),
            };
            (robot, press)
        })
        .await?;
        robot = touched;
        let Some(press) = press? else {
            anyhow::ensure!(tries < TRIES_PER_TOUCH_MAX * rule.touches_max, "no rest was found");
            continue;
        };
        let begun = Instant::now();
        let belief = session.touch_after(sensor, press.pose, press.image, press.missed).await?;
        let reading_ms = begun.elapsed().as_secs_f64() * 1e3;
        let before = steps.last();
        let n_misses = before.map_or(0, |step| step.misses) + u32::from(press.missed.is_some());
        let step = Step { misses: n_misses, ..Step::new(tries, &belief, truth, reading_ms) };
        show(&step);
        let is_sure = step.object_probability >= rule.probability;
        // A press that touched nothing confirms nothing.
        let counts = u32::from(press.missed.is_none());
        sure = if is_sure { sure + counts } else { 0 };
        steps.push(step.clone());
        if sure >= rule.in_a_row || step.touches >= rule.touches_max {
            return Ok(TrialResult { truth: truth.name().to_owned(), steps, last: step });
        }
        tokio::time::sleep(rule.pause).await;
    }
}

/// Asks where to touch; every attempt draws its own approaches.
async fn ask(
    session: &TouchSession,
    sensor: &str,
    robot: &Robot,
    tries: u32,
) -> anyhow::Result<NextTouch> {
    let question = AskNextTouches {
        sensor: sensor.to_owned(),
        n: Some(1),
        deadline_ms: Some(DEADLINE_MS),
        recenters: Some(true),
        workspace: Some(robot.workspace()),
        seed: Some(u64::from(tries)),
        candidates: None,
    };
    let answer = session.next_touches(&question).await?;
    answer.touches.into_iter().next().context("the server knows no place to touch")
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use palpate_client::schemas::{self, ObjectProbability, PoseHypothesis};
    use palpate_core::symmetry::AxisOrder;

    use super::*;

    fn belief(names: [&str; 2]) -> Belief {
        let id = uuid::Uuid::from_u128(1);
        let half = std::f64::consts::FRAC_PI_8;
        let probability = |(name, probability): (&str, f64)| ObjectProbability {
            object: id,
            name: name.to_owned(),
            probability,
        };
        Belief {
            session: id,
            revision: 1,
            n_readings: 1,
            objects: [(names[0], 0.9), (names[1], 0.1)].map(probability).to_vec(),
            stop: None,
            calibrated: true,
            uncalibrated_reason: None,
            unknown: 0.0,
            entropy_bits: 0.47,
            poses: vec![PoseHypothesis {
                object: id,
                name: "mug".to_owned(),
                weight: 0.9,
                pose: schemas::Pose {
                    position: [0.003, 0.004, 0.0],
                    orientation: [0.0, half.sin(), 0.0, half.cos()],
                },
                session_from_model: schemas::Pose {
                    position: [0.0; 3],
                    orientation: [0.0, 0.0, 0.0, 1.0],
                },
                covariance: vec![0.0; 36],
                symmetry: Vec::new(),
            }],
            warnings: Vec::new(),
        }
    }

    #[test]
    fn a_step_compares_identity_and_pose_with_the_truth() {
        let truth = Truth {
            object: Some("mug".to_owned()),
            session_from_object: Pose::IDENTITY,
            origin_in_mesh: [0.0; 3],
            symmetry: Symmetry::NONE,
        };
        let step = Step::new(3, &belief(["mug", "cup"]), &truth, 1.0);
        assert!(step.right);
        // 3 mm and 4 mm make 5 mm; a turn by π/4 about y.
        assert!((step.position_error_mm().unwrap() - 5.0).abs() < 1e-9);
        assert!((step.angle_error_deg().unwrap() - 45.0).abs() < 1e-9);
        let wrong = Step::new(3, &belief(["cup", "mug"]), &truth, 1.0);
        assert!(!wrong.right);
        // Turned about y by π/4 as answered; of a body of 7 sides the nearest turn is one less,
        // 45° − 360°/7 = −6.43°. The centre is where the answer has it, 5 mm off, and so is
        // the origin in it.
        let symmetry = Symmetry::through(DVec3::ZERO, &[(DVec3::Y, AxisOrder::Finite(7))]);
        let step = Step::new(3, &belief(["mug", "cup"]), &Truth { symmetry, ..truth }, 1.0);
        assert!((step.angle_error_deg().unwrap() - (360.0 / 7.0 - 45.0)).abs() < 1e-9);
        assert!((step.plain_angle_error_deg().unwrap() - 45.0).abs() < 1e-9);
        assert!((step.position_error_mm().unwrap() - 5.0).abs() < 1e-9);
    }

    #[test]
    fn a_step_is_wrong_if_none_of_these_beats_the_true_object() {
        let truth = Truth {
            object: Some("mug".to_owned()),
            session_from_object: Pose::IDENTITY,
            origin_in_mesh: [0.0; 3],
            symmetry: Symmetry::NONE,
        };
        let mut belief = belief(["mug", "cup"]);
        belief.unknown = 0.95;
        let step = Step::new(3, &belief, &truth, 1.0);
        assert_eq!((step.right, step.answer.as_str()), (false, verdict::NONE_OF_THESE));
        assert_eq!((step.probability, step.unknown), (0.95, 0.95));
        assert_eq!((step.object.as_deref(), step.object_probability), (Some("mug"), 0.9));
        let foreign = Truth { object: None, ..truth };
        let step = Step::new(3, &belief, &foreign, 1.0);
        assert_eq!((step.right, step.position_error), (true, None));
    }

    #[test]
    fn an_object_without_a_pose_has_no_errors() {
        let truth = Truth {
            object: Some("cup".to_owned()),
            session_from_object: Pose::IDENTITY,
            origin_in_mesh: [0.0; 3],
            symmetry: Symmetry::NONE,
        };
        let step = Step::new(1, &belief(["cup", "mug"]), &truth, 1.0);
        assert_eq!((step.right, step.position_error, step.angle_error), (true, None, None));
    }
}
