//! Scattering: work is done on the maps of a whole model, or by the parts of a divided one.
//!
//! The objects of a block that does not answer are left out of the belief from then on: without the
//! evidence of one touch they cannot be compared with the others.

use super::object::ObjectBelief;
use super::parts::{
    Estimates, look_up_request, looked_up_by, take_worked, work_begun, work_request,
};
use super::work::Work;
use crate::model::{OBJECTS_PER_BLOCK, Parts, SurfaceModel};
use crate::observe::observation::Observation;
use crate::options::SurfaceOptions;
use crate::propose::retrieval::estimate;
use crate::verify::evidence::Evidence;

/// Does work on all objects that it concerns.
pub(super) fn perform(
    work: &Work,
    objects: &mut [ObjectBelief],
    evidence: &Evidence<'_>,
    model: &SurfaceModel,
) {
    match model.parts() {
        None => work.run(objects, evidence),
        Some(parts) => scatter(work, objects, evidence, parts),
    }
}

fn scatter(work: &Work, objects: &mut [ObjectBelief], evidence: &Evidence<'_>, parts: &dyn Parts) {
    evidence.stop.check();
    let is_concerned = |object: &usize| {
        !objects[*object].is_ruled_out && work.concerns(*object, &objects[*object])
    };
    let concerned: Vec<usize> = (0..objects.len()).filter(is_concerned).collect();
    let blocks: Vec<&[usize]> = concerned.chunk_by(|a, b| block_of(*a) == block_of(*b)).collect();
    if blocks.is_empty() {
        return;
    }
    let begun = work_begun(&work.read_of(evidence));
    let request = |of_block: &&[usize]| {
        (block_of(of_block[0]), work_request(begun.clone(), work, objects, of_block))
    };
    let mut replies = parts.ask(blocks.iter().map(request).collect()).into_iter();
    for of_block in blocks {
        let reply = replies.next().and_then(Result::ok);
        if reply.and_then(|reply| take_worked(&reply, objects, of_block).ok()).is_none() {
            leave_out(objects, block_of(of_block[0]));
        }
    }
}

/// Estimates of the pairs of the newest touch with each partner, for the objects that are `wanted`
/// (`propose::retrieval::estimate`).
pub(super) fn look_up(
    objects: &mut [ObjectBelief],
    model: &SurfaceModel,
    newest: &Observation,
    partners: &[&Observation],
    wanted: &[bool],
    options: &SurfaceOptions,
) -> Vec<Estimates> {
    if let Some(joint) = model.joint_pairs() {
        return estimate(joint, newest, partners, wanted, options);
    }
    let mut all = vec![vec![None; objects.len()]; partners.len()];
    let blocks = wanted.chunks(OBJECTS_PER_BLOCK).enumerate();
    let blocks: Vec<(usize, &[bool])> = blocks.filter(|(_, of)| of.contains(&true)).collect();
    let Some(parts) = model.parts().filter(|_| !blocks.is_empty() && !partners.is_empty()) else {
        return all;
    };
    let request = |(block, wanted): &(usize, &[bool])| {
        (*block, look_up_request(newest, partners, wanted, options))
    };
    let mut replies = parts.ask(blocks.iter().map(request).collect()).into_iter();
    for (block, wanted) in blocks {
        let reply = replies.next().and_then(Result::ok);
        let n = wanted.len();
        let Some(found) = reply.and_then(|reply| looked_up_by(&reply, partners.len(), n).ok())
        else {
            leave_out(objects, block);
            continue;
        };
        let first = block * OBJECTS_PER_BLOCK;
        for (of_partner, found) in all.iter_mut().zip(found) {
            of_partner[first..first + n].copy_from_slice(&found);
        }
    }
    all
}

fn block_of(object: usize) -> usize {
    object / OBJECTS_PER_BLOCK
}

/// Leaves the objects of a block out; those whose prior is zero are not missed.
fn leave_out(objects: &mut [ObjectBelief], block: usize) {
    let of_block = objects.iter_mut().skip(block * OBJECTS_PER_BLOCK).take(OBJECTS_PER_BLOCK);
    of_block.filter(|object| !object.is_ruled_out).for_each(ObjectBelief::leave_out);
}
