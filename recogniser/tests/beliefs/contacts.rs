//! Contacts without an image: recognition by positions and normals, by positions alone, and
//! beside presses.

use glam::DVec3;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::SensorId;
use palpate_core::reading::point_contact::{ContactNumbers, PointContact};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;
use palpate_recogniser::belief::SurfaceBelief;

use crate::ellipsoids::*;

const POSITION: f64 = 1.0 * MM;
const NORMAL: f64 = 0.1;

/// Contacts at random places of an ellipsoid in a pose, with the errors that they state.
fn contacts(object: usize, pose: &Pose, n: usize, normals: bool, seed: u64) -> Vec<PointContact> {
    let mut stream = Stream::new(seed, Purpose::Sampling, object as u64);
    let half = HALF_AXES[object];
    let mut contact = || {
        let on_sphere = stream.direction();
        let normal = pose.turn((on_sphere / half).normalize());
        let mut off = |deviation: f64| {
            deviation * DVec3::new(stream.normal(), stream.normal(), stream.normal())
        };
        let position = *pose * (on_sphere * half) + off(POSITION);
        let felt = (normal + off(NORMAL)).normalize();
        let numbers = ContactNumbers {
            touched: true,
            position: position.to_array(),
            position_deviation: POSITION,
            normal: normals.then_some(felt.to_array()),
            normal_deviation: normals.then_some(NORMAL),
            force: None,
        };
        PointContact::new(SensorId(0), numbers).unwrap()
    };
    (0..n).map(|_| contact()).collect()
}

/// The mean over sessions of the true object's probability, and the share of right names.
fn recognised(n: usize, normals: bool) -> (f64, f64) {
    let (mut sum, mut right) = (0.0, 0.0);
    let sessions: Vec<(usize, u64)> =
        (0..N_OBJECTS).flat_map(|object| (0..4).map(move |seed| (object, 40 + seed))).collect();
    for (object, seed) in &sessions {
        let pose = some_pose(*seed);
        let mut belief = belief();
        for contact in contacts(*object, &pose, n, normals, *seed) {
            belief.add_contact(&contact);
        }
        let answer = belief.answer(1);
        let total = answer.probabilities.iter().sum::<f64>() + answer.unknown;
        assert!((total - 1.0).abs() < 1e-9);
        sum += answer.probabilities[*object];
        right += f64::from(u8::from(answer.best_object() == Some(ObjectIdx(*object as u32))));
    }
    let n = sessions.len() as f64;
    (sum / n, right / n)
}

#[test]
fn ten_contacts_with_normals_name_the_object() {
    let (probability, right) = recognised(10, true);
    assert!(probability > 0.8 && right > 0.85, "{probability} {right}");
}

#[test]
fn positions_alone_name_the_object_after_more_contacts() {
    let (probability, right) = recognised(16, false);
    assert!(probability > 0.6 && right > 0.8, "{probability} {right}");
}

#[test]
fn one_contact_says_nothing_about_the_identity() {
    let mut belief = belief();
    let before = belief.posterior();
    belief.add_contact(&contacts(1, &Pose::IDENTITY, 1, true, 5)[0]);
    assert_eq!(belief.posterior(), before);
    assert_eq!((belief.n_touches(), belief.n_readings()), (1, 1));
}

#[test]
fn presses_and_contacts_add_up_and_resume_alike() {
    let pose = some_pose(3);
    let presses = touches(2, 3, 2);
    let contacts = contacts(2, &pose, 4, true, 9);
    let sensor = six_by_six();
    let mut belief = belief();
    let mut resumed = crate::ellipsoids::belief();
    for (index, contact) in contacts.iter().enumerate() {
        belief.add_contact(contact);
        resumed.retrace_contact(contact);
        if let Some(press) = presses.get(index) {
            let press = press.moved_by(pose);
            belief.add(&press, &sensor);
            resumed.retrace(&press, &sensor);
        }
    }
    resumed.resume(&belief.checkpoint()).unwrap();
    assert_eq!(resumed.posterior(), belief.posterior());
    let answer = belief.answer(1);
    assert_eq!(answer.best_object(), Some(ObjectIdx(2)), "{answer:?}");
    assert!(answer.probabilities[2] > 0.8, "{answer:?}");
    let fit = |belief: &SurfaceBelief, contact| belief.log_predictive_of_contact(contact).unwrap();
    let wrong = self::contacts(2, &some_pose(8), 1, true, 9).remove(0);
    assert!(fit(&belief, &contacts[0]) > fit(&belief, &wrong) + 3.0);
}
