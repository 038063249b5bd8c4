//! Stated pose priors: they help, touches overrule them, and they say nothing by themselves.

use crate::ellipsoids::{MODEL, N_OBJECTS, belief, six_by_six, some_pose, touches};
use glam::{DQuat, DVec3};
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::DEG;
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::pose_prior::{PoseHypothesis, PosePrior, PosePriorError, Workspace};

const DEVIATION: [f64; 2] = [10e-3, 10.0 * DEG];

/// A statement about a pose, of an object or of any.
fn stating(object: Option<u32>, pose: Pose) -> PosePrior {
    let hypothesis = PoseHypothesis {
        object: object.map(ObjectIdx),
        session_from_object: pose,
        covariance: PoseHypothesis::diagonal(DEVIATION[0], DEVIATION[1]),
        weight: 1.0,
    };
    PosePrior { hypotheses: vec![hypothesis], ..PosePrior::default() }
}

/// A pose that is off by the deviations of a statement.
fn nearby(pose: Pose, seed: u64) -> Pose {
    let mut stream = Stream::new(seed, Purpose::Perturbation, 0);
    let mut off = |deviation: f64| DVec3::from_array([0; 3].map(|_| deviation * stream.normal()));
    let (moved, turned) = (off(DEVIATION[0]), off(DEVIATION[1]));
    let turned = DQuat::from_scaled_axis(turned);
    Pose::from_parts(turned * pose.rotation, pose.translation + moved)
}

fn with(prior: &PosePrior) -> SurfaceBelief {
    belief().with_pose_prior(prior).unwrap()
}

/// The belief after `n` touches of an object.
fn after(
    mut belief: SurfaceBelief,
    object: usize,
    pose: Pose,
    n: usize,
    seed: u64,
) -> SurfaceBelief {
    for reading in touches(object, n, seed) {
        belief.add(&reading.moved_by(pose), &six_by_six());
    }
    belief
}

/// The mean probability of the true object over sessions, by what a camera says in each.
fn mean(n: usize, says: impl Fn(usize, Pose, u64) -> Option<PosePrior>) -> f64 {
    let mut sum = 0.0;
    for seed in 0..8 {
        for object in 0..N_OBJECTS {
            let pose = some_pose(10 * seed + object as u64);
            let said = says(object, pose, seed);
            let start = said.map_or_else(belief, |said| with(&said));
            let answer = after(start, object, pose, n, 20 + seed).answer(1);
            sum += answer.probabilities[object];
        }
    }
    sum / (8 * N_OBJECTS) as f64
}

#[test]
fn a_prior_alone_moves_no_object_to_or_from_none_of_these() {
    let said = with(&stating(Some(1), some_pose(1))).answer(3);
    let unsaid = belief().answer(3);
    assert!((said.unknown - unsaid.unknown).abs() < 1e-12, "{} {}", said.unknown, unsaid.unknown);
    // 0.9 · (0.9 + 0.1/3) + 0.1/3 of what is known.
    let expected = 0.95 * (0.9 * (0.9 + 0.1 / 3.0) + 0.1 / 3.0);
    assert!((said.probabilities[1] - expected).abs() < 1e-9, "{:?}", said.probabilities);
    assert!(said.modes.is_empty(), "poses come with the first touch");
}

#[test]
fn one_touch_gives_a_pose_where_a_camera_is_right() {
    let mut near = 0;
    for seed in 0..10 {
        let pose = some_pose(seed);
        let said = with(&stating(None, nearby(pose, seed)));
        let answer = after(said, 0, pose, 1, 40 + seed).answer(64);
        let mode = answer.modes.iter().find(|mode| mode.object == ObjectIdx(0)).unwrap();
        let found = mode.session_from_object;
        near += usize::from(found.distance_to(&pose) < 0.03 && found.angle_to(&pose) < 40.0 * DEG);
    }
    assert!(near >= 9, "{near} of 10");
    let unsaid = after(belief(), 0, some_pose(0), 1, 40).answer(5);
    assert!(unsaid.modes.is_empty());
}

#[test]
fn a_camera_that_is_a_little_off_helps() {
    for n in [1, 2, 3] {
        let without = mean(n, |_, _, _| None);
        let seen = mean(n, |_, pose, seed| Some(stating(None, nearby(pose, seed))));
        assert!(seen > without, "{n} touches: {seen} with, {without} without");
        let named =
            mean(n, |object, pose, seed| Some(stating(Some(object as u32), nearby(pose, seed))));
        assert!(named > 0.9, "{n} touches: {named}");
    }
}

#[test]
fn touches_overrule_a_camera_that_lies() {
    let without = mean(10, |_, _, _| None);
    let misplaced = mean(10, |_, _, seed| Some(stating(None, some_pose(500 + seed))));
    assert!(misplaced > without - 0.02, "wrong pose: {misplaced} for {without}");
    let misnamed = mean(10, |object, pose, seed| {
        Some(stating(Some((object as u32 + 1) % 3), nearby(pose, seed)))
    });
    assert!(misnamed > without - 0.03, "wrong object: {misnamed} for {without}");
    let both = mean(10, |object, _, seed| {
        Some(stating(Some((object as u32 + 1) % 3), some_pose(500 + seed)))
    });
    assert!(both > without - 0.02, "both wrong: {both} for {without}");
}

#[test]
fn an_unknown_object_stays_unknown_where_a_camera_sees_it() {
    // The second object is ruled out, and then touched.
    let prior = [1.0, 0.0, 1.0];
    let options = palpate_recogniser::options::SurfaceOptions::default();
    let start = || SurfaceBelief::new(MODEL.clone(), options, Some(&prior)).unwrap();
    let (mut with, mut without) = (0.0, 0.0);
    for seed in 0..6 {
        let pose = some_pose(seed);
        let said = stating(None, nearby(pose, seed));
        let told = start().with_pose_prior(&said).unwrap();
        with += after(told, 1, pose, 6, 60 + seed).answer(0).unknown / 6.0;
        without += after(start(), 1, pose, 6, 60 + seed).answer(0).unknown / 6.0;
    }
    assert!(with > without - 0.1, "{with} with, {without} without");
}

#[test]
fn a_workspace_rules_poses_out_until_touches_say_otherwise() {
    let pose = some_pose(4);
    let about = |center: DVec3| {
        let (low, high) = (center - DVec3::splat(0.05), center + DVec3::splat(0.05));
        PosePrior { workspace: Some(Workspace { low, high }), ..PosePrior::default() }
    };
    let right = after(with(&about(pose.translation)), 0, pose, 6, 70).answer(1);
    let wrong = after(with(&about(pose.translation + DVec3::X)), 0, pose, 6, 70).answer(1);
    assert!(right.probabilities[0] > 0.9 && wrong.probabilities[0] > 0.9);
}

#[test]
fn a_statement_that_does_not_fit_the_catalogue_is_refused() {
    let error = belief().with_pose_prior(&stating(Some(3), some_pose(1))).unwrap_err();
    assert_eq!(error, PosePriorError::Object { found: 3, n_objects: N_OBJECTS });
}

#[test]
fn a_belief_with_a_statement_resumes_bit_for_bit() {
    let pose = some_pose(2);
    let start = || with(&stating(Some(2), nearby(pose, 1)));
    let readings: Vec<_> = touches(2, 5, 80).iter().map(|r| r.moved_by(pose)).collect();
    let motion = palpate_core::reading::Looseness { position: 0.005, angle: 0.1 };
    for moved_before in [None, Some(0), Some(2)] {
        for cut in 0..=readings.len() {
            let mut whole = start();
            let mut resumed = start();
            let mut kept = whole.checkpoint();
            for (n, reading) in readings.iter().enumerate() {
                if n == cut {
                    kept = whole.checkpoint();
                }
                if moved_before == Some(n) {
                    whole.announce_move(&motion);
                }
                whole.add(reading, &six_by_six());
            }
            if cut == readings.len() {
                kept = whole.checkpoint();
            }
            for (n, reading) in readings[..cut].iter().enumerate() {
                if moved_before == Some(n) {
                    resumed.retrace_move(&motion);
                }
                resumed.retrace(reading, &six_by_six());
            }
            resumed.resume(&kept).unwrap();
            for (n, reading) in readings.iter().enumerate().skip(cut) {
                if moved_before == Some(n) {
                    resumed.announce_move(&motion);
                }
                resumed.add(reading, &six_by_six());
            }
            assert_eq!(resumed.checkpoint(), whole.checkpoint(), "{moved_before:?} {cut}");
        }
    }
}

#[test]
fn drift_uses_up_what_a_camera_said() {
    let options = palpate_recogniser::options::SurfaceOptions {
        motion: Some(palpate_core::reading::Looseness { position: 0.003, angle: 0.03 }),
        ..Default::default()
    };
    let pose = some_pose(6);
    let start = SurfaceBelief::new(MODEL.clone(), options, None).unwrap();
    let said = start.with_pose_prior(&stating(None, nearby(pose, 3))).unwrap();
    let answer = after(said, 1, pose, 5, 90).answer(1);
    assert!(answer.probabilities[1] > 0.8, "{:?}", answer.probabilities);
}
