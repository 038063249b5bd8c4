//! The trials of one method and seed, and its answers after every reading.

use glam::DVec3;
use palpate_core::metric::planar_angle_error;
use palpate_core::pose::Pose;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use rayon::prelude::*;

use super::methods::{Prepared, REACH};
use super::{Lab, LettersGeometric, TestLetter};

/// Numbers of readings after which the pose is estimated; the mode of a particle filter is costly.
pub(super) const POSES_AT: [usize; 12] = [1, 2, 3, 4, 5, 7, 9, 12, 15, 20, 30, 46];

/// A method's answer after one reading of one trial.
pub(super) struct Step {
    pub(super) method: usize,
    pub(super) seed: u64,
    pub(super) letter: usize,
    pub(super) readings: usize,
    pub(super) named: usize,
    pub(super) probability: f64,
    /// Error of the pose; `None` if the letter is wrong or the pose was not estimated.
    pub(super) error: Option<PoseError>,
}

/// Error of an answer, modulo the letter's symmetry.
#[derive(Clone, Copy)]
pub(super) struct PoseError {
    /// Error of the letter's centroid in the plane, metres.
    pub(super) translation: f64,
    /// Error of the angle in the plane, rad.
    pub(super) angle: f64,
    /// Inertial error in the plane, metres.
    pub(super) inertial: f64,
    /// Error of the face along the plane's normal, metres.
    pub(super) height: f64,
}

/// Runs all trials of a seed with one method (its index and itself).
pub(super) fn run(
    config: &LettersGeometric,
    letters: &[TestLetter],
    lab: &Lab,
    (method, prepared): (usize, &Prepared<'_>),
) -> Vec<Step> {
    let trials = (0..letters.len() * config.trials).into_par_iter();
    let run = |trial: usize| {
        let letter = trial / config.trials;
        let (session_from_object, readings) = draw(config, lab, letter, trial as u64);
        let mut belief = prepared.belief(trial as u64);
        let step = |(idx, reading): (usize, &Reading)| {
            belief.add(reading);
            let identities = belief.identities();
            let best = |a: usize, b: usize| if identities[b] > identities[a] { b } else { a };
            let named = (0..identities.len()).reduce(best).unwrap_or(0);
            let asked = named == letter && POSES_AT.contains(&(idx + 1));
            let found = if asked { belief.pose(named) } else { None };
            let error = found
                .map(|found| error(&letters[letter], lab, letter, &found, &session_from_object));
            let (seed, probability, readings) = (lab.seed, identities[named], idx + 1);
            Step { method, seed, letter, readings, named, probability, error }
        };
        readings.iter().enumerate().map(step).collect::<Vec<Step>>()
    };
    trials.flat_map_iter(run).collect()
}

/// The pose of a trial, and its readings in the session frame: the same for every method.
pub(super) fn draw(
    config: &LettersGeometric,
    lab: &Lab,
    letter: usize,
    trial: u64,
) -> (Pose, Vec<Reading>) {
    let mut poses = Stream::new(lab.seed, Purpose::ObjectPose, trial);
    let place = DVec3::new(poses.uniform(-REACH, REACH), poses.uniform(-REACH, REACH), 0.0);
    let angle = poses.uniform(0.0, std::f64::consts::TAU);
    let session_from_object = Pose::from_parts(glam::DQuat::from_rotation_z(angle), place);
    let mut choice = Stream::new(lab.seed, Purpose::ReadingChoice, trial);
    let mut left: Vec<&Reading> = lab.test[letter].iter().collect();
    let readings = (0..config.readings.min(left.len()))
        .map(|_| left.swap_remove(choice.index(left.len())).moved_by(session_from_object))
        .collect();
    (session_from_object, readings)
}

fn error(letter: &TestLetter, lab: &Lab, idx: usize, found: &Pose, truth: &Pose) -> PoseError {
    let centroid = letter.symmetry.through;
    let angle = |pose: &Pose| 2.0 * pose.rotation.z.atan2(pose.rotation.w);
    let height = (found.translation.z - truth.translation.z).abs();
    // The dissertation's poses are planar, and so are its errors.
    let found = &Pose { translation: found.translation.with_z(truth.translation.z), ..*found };
    PoseError {
        height,
        translation: (*found * centroid).distance(*truth * centroid),
        angle: planar_angle_error(angle(found), angle(truth), letter.symmetry.order),
        inertial: lab.inertias[idx].distance_modulo(found, truth, &letter.symmetry),
    }
}
