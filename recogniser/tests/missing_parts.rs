//! Parts of a catalogue that do not answer, and parts that are asked nonsense.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

mod ellipsoids;
mod members;

use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::belief::parts::{NotWork, answer, outlines, outlines_request};
use palpate_recogniser::model::{OBJECTS_PER_BLOCK, Parts, SurfaceMap, SurfaceModel, Unanswered};
use palpate_recogniser::next_touch::{NextTouchOptions, rank};
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::pose_prior::{PoseHypothesis, PosePrior};

use ellipsoids::{six_by_six, some_pose};
use members::{Members, N_OBJECTS, WHOLE, divided, touches_of};

fn objects_of(block: usize) -> Vec<ObjectIdx> {
    let first = block * OBJECTS_PER_BLOCK;
    (first..N_OBJECTS.min(first + OBJECTS_PER_BLOCK)).map(|o| ObjectIdx(o as u32)).collect()
}

/// A belief over members, and the members.
fn begun() -> (SurfaceBelief, Arc<Members>) {
    let members = Arc::new(Members::new(&WHOLE, 3));
    let model = divided(&WHOLE, &members);
    (SurfaceBelief::new(model, SurfaceOptions::default(), None).unwrap(), members)
}

fn touch(belief: &mut SurfaceBelief, object: usize, touches: std::ops::Range<usize>) {
    let all = touches_of(object, touches.end, 2);
    for reading in &all[touches] {
        belief.add(&reading.clone().moved_by(some_pose(1)), &six_by_six());
    }
}

#[test]
fn a_silent_block_is_missing_from_the_first_touch_on() {
    let (mut belief, members) = begun();
    members.silent.lock().unwrap().insert(1);
    assert!(belief.missing_objects().is_empty(), "nothing was asked yet");
    touch(&mut belief, 10, 0..5);
    assert_eq!(belief.missing_objects(), objects_of(1));
    let answer = belief.answer(3);
    assert_eq!(answer.missing, objects_of(1));
    let [left_out, others] =
        [64..128, 0..64].map(|of| answer.probabilities[of].iter().sum::<f64>());
    assert_eq!(left_out.to_bits(), 0.0f64.to_bits());
    assert!(others > 0.0 && answer.best_object() == Some(ObjectIdx(10)), "{answer:?}");
    let total = answer.probabilities.iter().sum::<f64>() + answer.unknown;
    assert!((total - 1.0).abs() < 1e-9, "{total}");
}

#[test]
fn a_missing_object_is_not_asked_for_again() {
    let (mut belief, members) = begun();
    members.silent.lock().unwrap().insert(1);
    touch(&mut belief, 10, 0..1);
    members.silent.lock().unwrap().clear();
    touch(&mut belief, 10, 1..4);
    assert_eq!(belief.missing_objects(), objects_of(1), "it lacks the first touch");
    // Folded anew it is whole.
    let model = divided(&WHOLE, &members);
    let mut anew = SurfaceBelief::new(model, SurfaceOptions::default(), None).unwrap();
    touch(&mut anew, 10, 0..4);
    let mut whole = SurfaceBelief::new(WHOLE.clone(), SurfaceOptions::default(), None).unwrap();
    touch(&mut whole, 10, 0..4);
    assert!(anew.missing_objects().is_empty());
    assert_eq!(anew.checkpoint(), whole.checkpoint());
    assert_eq!(format!("{:?}", anew.answer(3)), format!("{:?}", whole.answer(3)));
}

#[test]
fn a_block_that_falls_silent_leaves_the_others_as_they_were() {
    for silent_after in 1..6 {
        let (mut belief, members) = begun();
        touch(&mut belief, 70, 0..silent_after);
        let before = belief.posterior();
        assert!(belief.missing_objects().is_empty());
        members.silent.lock().unwrap().insert(0);
        touch(&mut belief, 70, silent_after..silent_after + 1);
        let posterior = belief.posterior();
        // A block without poses may have nothing to be asked for.
        let missing = belief.missing_objects();
        assert!(missing.is_empty() || missing == objects_of(0), "{missing:?}");
        if !missing.is_empty() {
            assert!(posterior[..64].iter().all(|p| p.to_bits() == 0.0f64.to_bits()));
        }
        assert!((posterior.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!(posterior[70] > 0.0 && before.len() == posterior.len());
    }
}

#[test]
fn without_any_part_none_of_these_is_left() {
    let (mut belief, members) = begun();
    members.silent.lock().unwrap().extend(0..3);
    touch(&mut belief, 10, 0..4);
    assert_eq!(belief.missing_objects().len(), N_OBJECTS);
    let answer = belief.answer(3);
    assert!((answer.unknown - 1.0).abs() < 1e-12 && answer.modes.is_empty(), "{answer:?}");
    assert!(belief.samples(20, &mut Stream::new(1, Purpose::NextTouch, 0)).is_empty());
    let ranked = rank(&belief, None, &NextTouchOptions::default(), &mut || false).unwrap();
    assert!(ranked.ranked.is_empty());
    // Later touches send no request.
    let asked = members.n_asked.load(Ordering::Relaxed);
    touch(&mut belief, 10, 4..6);
    assert_eq!(members.n_asked.load(Ordering::Relaxed), asked);
}

#[test]
fn poses_without_a_map_are_missing_from_the_answer_alone() {
    let (mut belief, members) = begun();
    touch(&mut belief, 10, 0..6);
    assert!(!belief.answer(2).modes.is_empty());
    let whole = belief.answer(2);
    members.silent.lock().unwrap().insert(0);
    let answer = belief.answer(2);
    assert!(answer.modes.iter().all(|mode| mode.object.0 >= 64));
    assert!(answer.missing.contains(&ObjectIdx(10)), "{:?}", answer.missing);
    assert_eq!(answer.probabilities, whole.probabilities);
    assert!(belief.missing_objects().is_empty());
    members.silent.lock().unwrap().clear();
    assert_eq!(belief.answer(2), whole);
}

/// Members that record what they are asked, and may garble replies.
#[derive(Debug)]
struct Recorder {
    members: Members,
    asked: Mutex<Vec<(usize, Vec<u8>)>>,
    garbles: bool,
}

impl Parts for Recorder {
    fn ask(&self, requests: Vec<(usize, Vec<u8>)>) -> Vec<Result<Vec<u8>, Unanswered>> {
        self.asked.lock().unwrap().extend(requests.iter().cloned());
        let mut replies = self.members.ask(requests);
        if self.garbles {
            replies.iter_mut().flatten().for_each(|reply| reply.truncate(reply.len() - 1));
        }
        replies
    }

    fn maps(&self, objects: &[usize]) -> Vec<Result<Arc<SurfaceMap>, Unanswered>> {
        self.members.maps(objects)
    }
}

fn recorder(garbles: bool) -> (Arc<SurfaceModel>, Arc<Recorder>) {
    let members = Members::new(&WHOLE, 1);
    let blocks = 0..N_OBJECTS.div_ceil(OBJECTS_PER_BLOCK);
    let of = |block| outlines(&answer(members.block(block), &outlines_request()).unwrap()).unwrap();
    let all = blocks.flat_map(of).collect();
    let recorder = Arc::new(Recorder { members, asked: Mutex::default(), garbles });
    let parts = Arc::clone(&recorder) as Arc<dyn Parts>;
    let (space, calibration) = (WHOLE.space.clone(), WHOLE.calibration);
    (Arc::new(SurfaceModel::divided(space, calibration, all, parts)), recorder)
}

#[test]
fn a_garbled_reply_counts_as_none() {
    let (model, _) = recorder(true);
    let mut belief = SurfaceBelief::new(model, SurfaceOptions::default(), None).unwrap();
    touch(&mut belief, 10, 0..3);
    assert_eq!(belief.missing_objects().len(), N_OBJECTS);
}

/// Requests of every kind.
fn requests() -> (Arc<Recorder>, Vec<(usize, Vec<u8>)>) {
    let (model, recorder) = recorder(false);
    let hypothesis = PoseHypothesis {
        object: Some(ObjectIdx(10)),
        session_from_object: some_pose(1),
        covariance: PoseHypothesis::diagonal(10.0 * MM, 0.17),
        weight: 1.0,
    };
    let stated = PosePrior { hypotheses: vec![hypothesis], ..PosePrior::default() };
    let mut belief = SurfaceBelief::new(model, SurfaceOptions::default(), None).unwrap();
    touch(&mut belief, 10, 0..4);
    let miss = palpate_core::reading::Reading::new(
        palpate_core::reading::SensorId(0),
        &six_by_six(),
        &[Some(0.0); 36],
        Pose::from_parts(some_pose(1).rotation, some_pose(1).translation),
    );
    belief.add(&miss.unwrap(), &six_by_six());
    let model = belief.model().clone();
    let belief = SurfaceBelief::new(Arc::new(model), SurfaceOptions::default(), None).unwrap();
    touch(&mut belief.with_pose_prior(&stated).unwrap(), 10, 0..3);
    let asked = std::mem::take(&mut *recorder.asked.lock().unwrap());
    (recorder, asked)
}

#[test]
fn nonsense_is_refused_or_answered_and_never_panics() {
    let (recorder, asked) = requests();
    assert!(asked.len() > 20);
    let mut stream = Stream::new(3, Purpose::Perturbation, 0);
    let mut n_refused = 0;
    for (block, request) in &asked {
        let block = recorder.members.block(*block);
        assert_eq!(answer(block, &[]), Err(NotWork));
        for end in [1, 2, request.len() / 2, request.len() - 1] {
            assert_eq!(answer(block, &request[..end]), Err(NotWork), "cut off at {end}");
        }
        assert_eq!(answer(block, &[request.as_slice(), &[0]].concat()), Err(NotWork), "too long");
        let other = recorder.members.block(2);
        let _ = answer(other, request);
        for _ in 0..20 {
            let mut bytes = request.clone();
            for _ in 0..=stream.index(4) {
                let at = stream.index(bytes.len());
                bytes[at] = [0, 0xff, 0x7f, 0x80, stream.index(256) as u8][stream.index(5)];
            }
            n_refused += usize::from(answer(block, &bytes).is_err());
        }
    }
    assert!(n_refused > 20, "{n_refused}");
}

#[test]
fn numbers_without_meaning_do_not_panic() {
    let (recorder, asked) = requests();
    let mut stream = Stream::new(4, Purpose::Perturbation, 0);
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e38, -1e38, 0.0, -0.0, 1e-45];
    for (block, request) in &asked {
        for _ in 0..20 {
            let mut bytes = request.clone();
            let at = 2 + stream.index(bytes.len() - 10);
            let number = odd[stream.index(odd.len())];
            if stream.index(2) == 0 {
                bytes[at..at + 4].copy_from_slice(&number.to_le_bytes());
            } else {
                bytes[at..at + 8].copy_from_slice(&f64::from(number).to_le_bytes());
            }
            let _ = answer(recorder.members.block(*block), &bytes);
        }
    }
}

#[test]
fn a_long_list_of_nothing_is_refused_at_once() {
    let block = Members::new(&WHOLE, 1);
    // The options of a request, then four billion touches.
    let (_, asked) = requests();
    let work = asked.iter().map(|(_, request)| request).find(|request| request[1] == 1).unwrap();
    let mut bytes = work[..2 + 31 * 4 + 5 * 8 + 20 * 8 + 1].to_vec();
    bytes.extend([0xff; 4]);
    bytes.extend([0; 1000]);
    assert_eq!(answer(block.block(0), &bytes), Err(NotWork));
}
