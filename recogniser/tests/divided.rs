//! A catalogue divided over members: its beliefs equal those of the whole one, bit for bit, and a
//! part that does not answer is missing.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

mod ellipsoids;
mod members;

use std::sync::Arc;
use std::sync::atomic::Ordering;

use glam::{DQuat, DVec3};
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::point_contact::{ContactNumbers, PointContact};
use palpate_core::reading::{Base, Looseness, Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::stop::Stop;
use palpate_core::units::MM;
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::model::SurfaceModel;
use palpate_recogniser::next_touch::interest::interest;
use palpate_recogniser::next_touch::{NextTouchOptions, rank};
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::pose_prior::{PoseHypothesis, PosePrior};

use ellipsoids::{MODEL, six_by_six, some_pose, touches};
use members::{Members, N_OBJECTS, WHOLE, divided, touches_of};

const MOTION: Looseness = Looseness { position: 2.5 * MM, angle: 0.05 };

/// A step of a session.
#[derive(Clone)]
enum Step {
    Press(Reading),
    Contact(PointContact),
    Moved(Looseness),
}

/// A session: how it begins, and its steps.
struct Session {
    options: SurfaceOptions,
    prior: Option<Vec<f64>>,
    stated: Option<PosePrior>,
    steps: Vec<Step>,
}

impl Session {
    fn of(steps: impl IntoIterator<Item = Step>) -> Self {
        let options = SurfaceOptions::default();
        Self { options, prior: None, stated: None, steps: steps.into_iter().collect() }
    }

    fn begun(&self, model: &Arc<SurfaceModel>) -> SurfaceBelief {
        let prior = self.prior.as_deref();
        let belief = SurfaceBelief::new(Arc::clone(model), self.options, prior).unwrap();
        match &self.stated {
            Some(stated) => belief.with_pose_prior(stated).unwrap(),
            None => belief,
        }
    }
}

fn take(belief: &mut SurfaceBelief, step: &Step) {
    match step {
        Step::Press(reading) => belief.add(reading, &six_by_six()),
        Step::Contact(contact) => belief.add_contact(contact),
        Step::Moved(motion) => belief.announce_move(motion),
    }
}

fn pressed(object: usize, n: usize, seed: u64, pose: Pose) -> Vec<Step> {
    let touches = touches_of(object, n, seed).into_iter();
    touches.map(|reading| Step::Press(reading.moved_by(pose))).collect()
}

fn miss(pose: Pose, beside: f64, approach: f64) -> Step {
    let at = Pose::from_parts(pose.rotation, pose.translation + DVec3::X * beside);
    let nothing = Reading::new(SensorId(0), &six_by_six(), &[Some(0.0); 36], at).unwrap();
    Step::Press(nothing.after_approach(approach))
}

/// Contacts without an image where presses would be, with or without normals.
fn contacts(object: usize, n: usize, seed: u64, pose: Pose, normals: bool) -> Vec<Step> {
    let contact = |reading: Reading| {
        let at = reading.moved_by(pose).session_from_sensor();
        let numbers = ContactNumbers {
            touched: true,
            position: at.translation.to_array(),
            position_deviation: MM,
            normal: normals.then_some((-at.turn(DVec3::Z)).to_array()),
            normal_deviation: normals.then_some(0.1),
            force: None,
        };
        Step::Contact(PointContact::new(SensorId(0), numbers).unwrap())
    };
    touches_of(object, n, seed).into_iter().map(contact).collect()
}

/// Presses of an object that moves before each of them.
fn moving(object: usize, n: usize, by: Looseness, seed: u64) -> Vec<Step> {
    let mut stream = Stream::new(seed, Purpose::Perturbation, object as u64);
    let mut pose = some_pose(object as u64);
    let step = |reading: Reading| {
        let mut three = |by: f64| by * DVec3::from_array([0; 3].map(|_| stream.normal()));
        let (shift, turn) = (three(by.position), DQuat::from_scaled_axis(three(by.angle)));
        pose = Pose::from_parts(turn * pose.rotation, pose.translation + shift);
        Step::Press(reading.moved_by(pose))
    };
    touches_of(object, n, seed).into_iter().map(step).collect()
}

/// Everything that a belief tells, with every bit of its numbers.
fn told(belief: &SurfaceBelief, next: &Reading) -> Vec<String> {
    let posterior: Vec<u64> = belief.posterior().iter().map(|p| p.to_bits()).collect();
    let samples = belief.samples(60, &mut Stream::new(5, Purpose::NextTouch, 1));
    let options = NextTouchOptions { n_approaches: 4, seed: 4, ..NextTouchOptions::default() };
    let best = belief.answer(1).best_object().unwrap();
    vec![
        format!("{posterior:?}"),
        format!("{:?}", belief.checkpoint()),
        format!("{:?}", belief.answer(4)),
        format!("{samples:?}"),
        format!("{:?}", rank(belief, None, &options, &mut || false)),
        format!("{:?}", belief.log_predictive(next, &six_by_six())),
        format!("{:?}", belief.misfit(best, next, &six_by_six())),
    ]
}

#[track_caller]
fn check(session: &Session) {
    check_on(&WHOLE, session);
}

/// Plays a session by the whole model and by divided ones, and compares all that they tell.
#[track_caller]
fn check_on(model: &Arc<SurfaceModel>, session: &Session) {
    let next = touches_of(3, 1, 99).remove(0);
    let mut whole = session.begun(model);
    let members = [1, 2, 3].map(|n| Arc::new(Members::new(model, n)));
    let models = members.each_ref().map(|members| divided(model, members));
    let mut parts = models.each_ref().map(|model| session.begun(model));
    for (n, step) in session.steps.iter().enumerate() {
        take(&mut whole, step);
        let expected = told(&whole, &next);
        for belief in &mut parts {
            take(belief, step);
            assert_eq!(told(belief, &next), expected, "after step {n}");
            assert!(belief.missing_objects().is_empty());
        }
    }
    let n_asked = members.each_ref().map(|members| members.n_asked.load(Ordering::Relaxed));
    assert!(n_asked.iter().all(|n| *n >= session.steps.len()), "{n_asked:?}");
}

#[test]
fn presses_and_misses_are_told_alike() {
    let pose = some_pose(1);
    let steps = [miss(pose, 0.5, 0.1)].into_iter().chain(pressed(70, 5, 2, pose));
    let steps = steps.chain([miss(pose, 0.02, 0.1), miss(pose, 1.0, 0.1)]);
    check(&Session::of(steps.chain(pressed(70, 3, 3, pose))));
}

#[test]
fn an_object_of_the_small_last_block_is_told_alike() {
    check(&Session::of(pressed(N_OBJECTS - 3, 6, 2, some_pose(2))));
}

#[test]
fn a_small_catalogue_is_told_alike() {
    let pose = some_pose(9);
    let steps = touches(1, 5, 2).into_iter().map(|reading| Step::Press(reading.moved_by(pose)));
    check_on(&MODEL, &Session::of(steps.chain([miss(pose, 0.02, 0.1)])));
}

#[test]
fn an_unknown_object_is_told_alike() {
    check(&Session::of(pressed(N_OBJECTS + 7, 6, 2, some_pose(3))));
}

#[test]
fn contacts_without_an_image_are_told_alike() {
    let pose = some_pose(4);
    let with = contacts(12, 3, 2, pose, true).into_iter();
    check(&Session::of(with.chain(pressed(12, 2, 3, pose)).chain(contacts(12, 2, 4, pose, false))));
}

#[test]
fn contacts_without_normals_are_told_alike() {
    check(&Session::of(contacts(80, 6, 2, some_pose(5), false)));
}

#[test]
fn an_announced_move_is_told_alike() {
    let pose = some_pose(6);
    let moved = [Step::Moved(MOTION), miss(pose, 0.5, 0.1), Step::Moved(MOTION)];
    let steps = pressed(100, 4, 2, pose).into_iter().chain(moved);
    check(&Session::of(steps.chain(pressed(100, 4, 3, pose))));
}

#[test]
fn announced_drift_and_bases_are_told_alike() {
    let looseness = Looseness { position: 3.0 * MM, angle: 0.05 };
    let based = |(n, step): (usize, Step)| match step {
        Step::Press(reading) if n % 3 != 0 => {
            Step::Press(reading.with_base(Base { robot: n as u32 % 3, looseness }))
        }
        other => other,
    };
    let steps = moving(33, 6, MOTION, 7).into_iter().enumerate().map(based);
    let options = SurfaceOptions { motion: Some(MOTION), ..SurfaceOptions::default() };
    check(&Session { options, ..Session::of(steps) });
}

#[test]
fn unannounced_drift_is_told_alike() {
    let far = Looseness { position: 10.0 * MM, angle: 0.3 };
    let session = Session::of(moving(0, 9, far, 6));
    let mut whole = session.begun(&WHOLE);
    let n_drifting = |step: &Step| {
        take(&mut whole, step);
        // The fifth word of a checkpoint.
        whole.checkpoint()[16]
    };
    let found: Vec<u8> = session.steps.iter().map(n_drifting).collect();
    assert!(found.contains(&3), "{found:?}");
    check(&session);
}

#[test]
fn stated_poses_and_priors_are_told_alike() {
    let pose = some_pose(8);
    let hypothesis = |object, off: f64, weight| PoseHypothesis {
        object,
        session_from_object: Pose::from_parts(pose.rotation, pose.translation + DVec3::X * off),
        covariance: PoseHypothesis::diagonal(10.0 * MM, 0.17),
        weight,
    };
    let hypotheses = vec![hypothesis(Some(ObjectIdx(90)), 0.004, 2.0), hypothesis(None, 0.1, 1.0)];
    let stated = Some(PosePrior { hypotheses, ..PosePrior::default() });
    let prior = (0..N_OBJECTS).map(|object| [1.0, 0.0, 3.0][object % 3]).collect();
    let steps = pressed(90, 3, 2, pose).into_iter().chain([miss(pose, 0.02, 0.1)]);
    let session = Session::of(steps.chain(pressed(90, 2, 3, pose)));
    check(&Session { stated: stated.clone(), prior: Some(prior), ..session });
    let options = SurfaceOptions { motion: Some(MOTION), ..SurfaceOptions::default() };
    check(&Session { stated, options, ..Session::of(pressed(90, 3, 2, pose)) });
}

#[test]
fn a_checkpoint_of_one_is_resumed_by_the_other() {
    let session = Session::of(pressed(70, 5, 2, some_pose(1)));
    let model = divided(&WHOLE, &Arc::new(Members::new(&WHOLE, 2)));
    let next = touches_of(3, 1, 99).remove(0);
    let (mut played, mut resumed) = (session.begun(&WHOLE), session.begun(&model));
    for step in &session.steps {
        take(&mut played, step);
        let Step::Press(reading) = step else { panic!("presses alone") };
        resumed.retrace(reading, &six_by_six());
    }
    resumed.resume(&played.checkpoint()).unwrap();
    assert_eq!(told(&resumed, &next), told(&played, &next));
}

#[test]
fn interest_points_need_a_few_maps() {
    let members = Arc::new(Members::new(&WHOLE, 2));
    let model = divided(&WHOLE, &members);
    let of = |model| interest(model, ObjectIdx(70), &Stop::never());
    assert_eq!(of(&model), of(&WHOLE));
    members.silent.lock().unwrap().insert(1);
    assert!(of(&model).is_err());
}

#[test]
fn a_divided_model_is_small() {
    let model = divided(&WHOLE, &Arc::new(Members::new(&WHOLE, 3)));
    assert!(model.is_divided() && model.n_objects() == N_OBJECTS && model.maps().is_empty());
    assert!(model.bytes() * 500 < WHOLE.bytes(), "{} {}", model.bytes(), WHOLE.bytes());
}
