//! Versions whose objects are divided among members: this server has the outlines of all objects,
//! and asks the members that hold the maps.

use std::fmt;
use std::sync::{Arc, Weak};
use std::time::Duration;

use palpate_core::stop::Stop;
use palpate_recogniser::belief::parts::{outlines, outlines_request};
use palpate_recogniser::model::{Outline, Parts, SurfaceMap, SurfaceModel, Unanswered};
use palpate_store::catalogue::{Catalogues as Table, Manifest};
use palpate_store::error::StoreError;
use palpate_store::model::TrainedModel;
use palpate_store::model_codec::Surfaces;
use uuid::Uuid;

use super::blocks::{Blocks, n_blocks};
use crate::members::{Block, Reply};

/// Time in which members answer with the outlines of all objects. Chosen: they may have to read
/// gigabytes first.
const OUTLINED_WITHIN: Duration = Duration::from_secs(60);

/// Number of maps read for one question. Chosen: a hundred megabytes; only next touches ask for more,
/// and only before several places were touched, when most objects are likely.
const MAPS_AT_ONCE: usize = 128;

/// The maps of a version, wherever they are.
pub(super) struct Elsewhere {
    /// Gone when the server has stopped.
    blocks: Weak<Blocks>,
    catalogue: Uuid,
    version: u32,
    /// Time for all answers, unless the usual.
    within: Option<Duration>,
}

impl fmt::Debug for Elsewhere {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { catalogue, version, .. } = self;
        write!(formatter, "Elsewhere({catalogue}, {version})")
    }
}

impl Parts for Elsewhere {
    fn ask(&self, requests: Vec<(usize, Vec<u8>)>) -> Vec<Result<Vec<u8>, Unanswered>> {
        let Some(blocks) = self.blocks.upgrade() else {
            return requests.iter().map(|_| Err(Unanswered)).collect();
        };
        let mut answers: Vec<Option<Vec<u8>>> = requests.iter().map(|_| None).collect();
        let block = |place: usize| {
            let number = u32::try_from(requests[place].0).unwrap_or(u32::MAX);
            Block { catalogue: self.catalogue, version: self.version, number }
        };
        let (near, far): (Vec<usize>, Vec<usize>) =
            (0..requests.len()).partition(|place| blocks.is_near(&block(*place)));
        let of = |place: &usize| (block(*place).number, requests[*place].1.clone());
        let (version, members) = ((self.catalogue, self.version), blocks.members());
        // The others work while this one does.
        let asked = members.ask(version, far.iter().map(of).collect(), self.within);
        let own = |places: &[usize]| {
            let items = places.iter().map(|place| (block(*place), &requests[*place].1[..]));
            blocks.replies(&items.collect::<Vec<_>>())
        };
        for (place, reply) in near.iter().zip(own(&near)) {
            answers[*place] = answered(reply);
        }
        for (place, answer) in far.iter().zip(asked.wait()) {
            answers[*place] = answer;
        }
        // What nobody answered this member may have to hold from now on.
        let missing = far.iter().copied().filter(|place| answers[*place].is_none());
        let missing: Vec<usize> = missing.filter(|place| members.is_own(&block(*place))).collect();
        for (place, reply) in missing.iter().zip(own(&missing)) {
            answers[*place] = answered(reply);
        }
        let n_missing = answers.iter().filter(|answer| answer.is_none()).count();
        metrics::counter!("palpate_blocks_unanswered_total").increment(n_missing as u64);
        answers.into_iter().map(|answer| answer.ok_or(Unanswered)).collect()
    }

    fn maps(&self, objects: &[usize]) -> Vec<Result<Arc<SurfaceMap>, Unanswered>> {
        let blocks = self.blocks.upgrade();
        let map = |(place, object): (usize, &usize)| {
            if !is_drawn(place, objects.len()) {
                return Err(Unanswered);
            }
            let blocks = blocks.as_ref().ok_or(Unanswered)?;
            blocks.map((self.catalogue, self.version), *object).map_err(|error| {
                tracing::warn!("Cannot read the map of object {object}: {error}");
                Unanswered
            })
        };
        objects.iter().enumerate().map(map).collect()
    }
}

/// Whether a map of `n` that are wanted at once is read: all if they are few, otherwise ones at equal
/// distances.
fn is_drawn(place: usize, n: usize) -> bool {
    let share = |place: usize| place * MAPS_AT_ONCE / n.max(1);
    n <= MAPS_AT_ONCE || place == 0 || share(place) != share(place - 1)
}

fn answered(reply: Reply) -> Option<Vec<u8>> {
    match reply {
        Reply::Answer(answer) => Some(answer),
        Reply::NotHeld | Reply::NotUnderstood | Reply::Overloaded => None,
    }
}

/// A version by the outlines of all its objects; the number of blocks without an answer if there
/// are any. Blocks the thread.
pub(super) fn outlined(
    table: &Table,
    blocks: &Arc<Blocks>,
    manifest: &Manifest,
    stop: &Stop,
) -> Result<Result<TrainedModel, u32>, StoreError> {
    let (catalogue, version) = (manifest.catalogue, manifest.version);
    let parts = |within| Elsewhere { blocks: Arc::downgrade(blocks), catalogue, version, within };
    let n_objects = manifest.objects.len();
    let requests = 0..n_blocks(n_objects) as usize;
    let requests = requests.map(|block| (block, outlines_request())).collect();
    let replies = parts(Some(OUTLINED_WITHIN)).ask(requests);
    let of_block = |reply: &Result<Vec<u8>, Unanswered>| outlines(reply.as_ref().ok()?).ok();
    let found: Vec<Option<Vec<Outline>>> = replies.iter().map(of_block).collect();
    let n_missing = found.iter().filter(|outlines| outlines.is_none()).count() as u32;
    let all: Vec<Outline> = found.into_iter().flatten().flatten().collect();
    if n_missing > 0 || all.len() != n_objects {
        return Ok(Err(n_missing));
    }
    let mut core = table.shared(manifest, stop)?;
    let Surfaces { space, calibration, .. } = table.surfaces(manifest, 0..0, stop)?;
    let surfaces = SurfaceModel::divided(space, calibration, all, Arc::new(parts(None)));
    core.surface = Some(Arc::new(surfaces));
    Ok(Ok(core))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_maps_some_at_equal_distances_are_read() {
        let drawn = |n: usize| (0..n).filter(|place| is_drawn(*place, n)).collect::<Vec<_>>();
        assert_eq!(drawn(0).len(), 0);
        assert_eq!(drawn(MAPS_AT_ONCE).len(), MAPS_AT_ONCE);
        for n in [MAPS_AT_ONCE + 1, 1000, 10_000] {
            let places = drawn(n);
            assert_eq!(places.len(), MAPS_AT_ONCE);
            let gaps = places.windows(2).map(|pair| pair[1] - pair[0]);
            assert!(gaps.max() <= Some(n.div_ceil(MAPS_AT_ONCE)), "{n}");
        }
    }
}
