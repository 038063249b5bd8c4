//! Work on parts of a divided catalogue as bytes: requests, the part that answers them, and replies.
//!
//! A part has the maps of one block of objects and no state. It reads the observations, the options
//! and the objects' beliefs from a request, does the same work as a whole model does, and replies
//! with what has changed. So a divided belief equals a whole one bit for bit, if all parts run the
//! same code. Requests may hold anything: nothing here panics on them.

use std::sync::Arc;

use palpate_core::stop::Stop;

use super::object::ObjectBelief;
use super::work::Work;
pub use crate::coding::NotWork;
use crate::coding::{Coded, put_all};
use crate::model::{OBJECTS_PER_BLOCK, Outline, SurfaceModel};
use crate::observe::observation::{Observation, Says};
use crate::observe::press_space::PressSpace;
use crate::options::SurfaceOptions;
use crate::propose::proposals::PairEvidence;
use crate::propose::retrieval::estimate;
use crate::verify::density::Kernel;
use crate::verify::evidence::Evidence;
use crate::verify::hypothesis::Hypothesis;
use crate::verify::motion_prior::{MotionPrior, StatedOf};
use crate::verify::null_model::self_match;
use crate::verify::stated_prior::StatedPrior;

/// First byte of requests and replies: the version of both, and of the mathematics between them.
const VERSION: u8 = 3;

/// The kind of a request, its second byte.
const OUTLINES: u8 = 0;
const WORK: u8 = 1;
const LOOK_UP: u8 = 2;

/// What a touch can say.
const KINDS: [Says; 3] = [Says::All, Says::Normal, Says::Position];

/// Estimates of one pair of touches, by object.
pub(super) type Estimates = Vec<Option<PairEvidence>>;

/// Answers a request from the maps of one block ([`SurfaceModel::of_block`]).
///
/// # Errors
/// [`NotWork`] when the bytes are no request to a block of this many objects.
pub fn answer(block: &SurfaceModel, request: &[u8]) -> Result<Vec<u8>, NotWork> {
    let mut from = request;
    let mut reply = vec![VERSION];
    if u8::take(&mut from)? != VERSION {
        return Err(NotWork);
    }
    match u8::take(&mut from)? {
        OUTLINES if from.is_empty() => outlines_of(block).put(&mut reply),
        WORK => worked(block, from)?.iter().for_each(|object| put_found(object, &mut reply)),
        LOOK_UP => looked_up(block, from)?.put(&mut reply),
        _ => return Err(NotWork),
    }
    Ok(reply)
}

/// The request for the outlines of a block's objects.
#[must_use]
pub fn outlines_request() -> Vec<u8> {
    vec![VERSION, OUTLINES]
}

/// The outlines of a block's objects from the reply.
///
/// # Errors
/// [`NotWork`] when the bytes are no such reply.
pub fn outlines(reply: &[u8]) -> Result<Vec<Outline>, NotWork> {
    let mut from = replied(reply)?;
    let found = Vec::<Outline>::take(&mut from)?;
    if from.is_empty() { Ok(found) } else { Err(NotWork) }
}

/// The outlines of the objects of a model that has their maps.
fn outlines_of(block: &SurfaceModel) -> Vec<Outline> {
    let options = &SurfaceOptions::default().widened(block.calibration.width);
    let kernel = &Kernel::new(options);
    let outline = |object: usize| Outline {
        radius: block.radius(object),
        reach: block.reach(object),
        symmetry: block.symmetry(object).clone(),
        self_matches: KINDS.map(|says| {
            block.self_match(object, says as usize, |map| {
                self_match(map, &block.space, kernel, options, says)
            })
        }),
    };
    (0..block.maps().len()).map(outline).collect()
}

/// The beginning of all requests for work by the same observations.
pub(super) fn work_begun(evidence: &Evidence<'_>) -> Vec<u8> {
    let mut to = vec![VERSION, WORK];
    evidence.options.put(&mut to);
    (evidence.touches.len() as u32).put(&mut to);
    put_all(evidence.touches, &mut to);
    (evidence.spaces.len() as u32).put(&mut to);
    put_all(evidence.spaces, &mut to);
    to
}

/// The request for work on some objects of a block, by their indices in the catalogue.
pub(super) fn work_request(
    mut begun: Vec<u8>,
    work: &Work,
    objects: &[ObjectBelief],
    of_block: &[usize],
) -> Vec<u8> {
    let to = &mut begun;
    let first = of_block.first().map_or(0, |object| object - object % OBJECTS_PER_BLOCK);
    let stated = of_block.first().and_then(|object| objects[*object].motion_prior.stated.as_ref());
    stated.is_some().put(to);
    if let Some(StatedOf { prior, .. }) = stated {
        prior.put(first..objects.len().min(first + OBJECTS_PER_BLOCK), to);
    }
    work.only(of_block).put(to);
    (of_block.len() as u32).put(to);
    for object in of_block {
        (object - first).put(to);
        put_asked(&objects[*object], to);
    }
    begun
}

/// Applies the reply of a block to the objects that it worked on. After an error they must not be
/// used.
pub(super) fn take_worked(
    reply: &[u8],
    objects: &mut [ObjectBelief],
    of_block: &[usize],
) -> Result<(), NotWork> {
    let mut from = replied(reply)?;
    for object in of_block {
        take_found(&mut objects[*object], &mut from)?;
    }
    if from.is_empty() { Ok(()) } else { Err(NotWork) }
}

/// The request for a look-up of the newest touch with its partners; `wanted` has the objects of the
/// block.
pub(super) fn look_up_request(
    newest: &Observation,
    partners: &[&Observation],
    wanted: &[bool],
    options: &SurfaceOptions,
) -> Vec<u8> {
    let mut to = vec![VERSION, LOOK_UP];
    options.put(&mut to);
    newest.put(&mut to);
    (partners.len() as u32).put(&mut to);
    put_all(partners.iter().copied(), &mut to);
    wanted.to_vec().put(&mut to);
    to
}

/// The estimates of each partner from the reply of a block of `n_objects`.
pub(super) fn looked_up_by(
    reply: &[u8],
    n_partners: usize,
    n_objects: usize,
) -> Result<Vec<Estimates>, NotWork> {
    let mut from = replied(reply)?;
    let found = Vec::<Estimates>::take(&mut from)?;
    let fits = found.len() == n_partners && found.iter().all(|of| of.len() == n_objects);
    if from.is_empty() && fits { Ok(found) } else { Err(NotWork) }
}

/// The reply without its version.
fn replied(mut reply: &[u8]) -> Result<&[u8], NotWork> {
    if u8::take(&mut reply)? == VERSION { Ok(reply) } else { Err(NotWork) }
}

/// The objects after the work that a request asks for.
fn worked(block: &SurfaceModel, mut from: &[u8]) -> Result<Vec<ObjectBelief>, NotWork> {
    let from = &mut from;
    let options = SurfaceOptions::take(from)?;
    let (touches, spaces) = (Vec::<Observation>::take(from)?, Vec::<PressSpace>::take(from)?);
    let stated = bool::take(from)?.then(|| StatedPrior::take(from, &options)).transpose()?;
    let stated = stated.map(|(prior, objects)| (Arc::new(prior), objects));
    let work = Work::take(from)?;
    let (mut objects, mut maps) = (Vec::new(), Vec::new());
    for _ in 0..u32::take(from)? {
        let index = usize::take(from)?;
        maps.push(Arc::clone(block.maps().get(index).ok_or(NotWork)?));
        let mut object = take_asked(from)?;
        if let Some((prior, of)) = &stated {
            let named = of.start.checked_add(index).filter(|named| of.contains(named));
            let (prior, object_index) = (Arc::clone(prior), named.ok_or(NotWork)?);
            object.motion_prior.stated = Some(StatedOf { prior, object: object_index });
        }
        objects.push(object);
    }
    if !from.is_empty() || !work.fits(touches.len(), objects.len()) {
        return Err(NotWork);
    }
    let (kernel, stop) = (Kernel::new(&options), Stop::never());
    let evidence = Evidence {
        maps: &maps,
        kernel: &kernel,
        touches: &touches,
        spaces: &spaces,
        options: &options,
        stop: &stop,
    };
    work.run(&mut objects, &evidence);
    Ok(objects)
}

/// The estimates that a request asks for.
fn looked_up(block: &SurfaceModel, mut from: &[u8]) -> Result<Vec<Estimates>, NotWork> {
    let from = &mut from;
    let options = SurfaceOptions::take(from)?;
    let newest = Observation::take(from)?;
    let (partners, wanted) = (Vec::<Observation>::take(from)?, Vec::<bool>::take(from)?);
    let joint = block.joint_pairs().ok_or(NotWork)?;
    if !from.is_empty() || wanted.len() != block.maps().len() {
        return Err(NotWork);
    }
    let partners: Vec<&Observation> = partners.iter().collect();
    Ok(estimate(joint, &newest, &partners, &wanted, &options))
}

/// Appends what work reads of an object.
fn put_asked(object: &ObjectBelief, to: &mut Vec<u8>) {
    put_found(object, to);
    object.retrieval_score.put(to);
    let MotionPrior { poses, position, angle, stated: _ } = &object.motion_prior;
    poses.put(to);
    [*position, *angle].put(to);
}

fn take_asked(from: &mut &[u8]) -> Result<ObjectBelief, NotWork> {
    let mut object = ObjectBelief::default();
    take_found(&mut object, from)?;
    object.retrieval_score = Coded::take(from)?;
    let poses = Coded::take(from)?;
    let (position, angle) = Coded::take(from)?;
    object.motion_prior = MotionPrior { poses, position, angle, stated: None };
    Ok(object)
}

/// Appends what work changes of an object.
fn put_found(object: &ObjectBelief, to: &mut Vec<u8>) {
    let ObjectBelief { hypotheses, log_evidence, pair, .. } = object;
    hypotheses.put(to);
    log_evidence.put(to);
    pair.put(to);
}

fn take_found(object: &mut ObjectBelief, from: &mut &[u8]) -> Result<(), NotWork> {
    object.hypotheses = Vec::<Hypothesis>::take(from)?;
    object.log_evidence = Coded::take(from)?;
    object.pair = Coded::take(from)?;
    Ok(())
}
