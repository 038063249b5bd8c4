//! A divided catalogue in one process: members that hold blocks of objects and answer bytes.

#![allow(dead_code, reason = "each test program uses a part of it")]

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock, Mutex};

use glam::DVec3;
use palpate_core::reading::Reading;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::symmetry::{AxisOrder, Symmetry};
use palpate_core::training::TrainingSet;
use palpate_recogniser::belief::parts::{answer, outlines, outlines_request};
use palpate_recogniser::model::{
    OBJECTS_PER_BLOCK, Outline, Parts, SurfaceMap, SurfaceModel, Unanswered,
};
use palpate_recogniser::train::{SurfaceConfig, map_surface};

use crate::ellipsoids::{MODEL, six_by_six, touch_of};

/// Objects of the catalogue: two whole blocks, and one of 22, too few for a joint table of their
/// own.
pub(crate) const N_OBJECTS: usize = 150;

/// Readings of the `index`th ellipsoid of the catalogue.
pub(crate) fn touches_of(index: usize, n: usize, seed: u64) -> Vec<Reading> {
    let mut shape = Stream::new(11, Purpose::Shape, index as u64);
    let half = DVec3::from_array([0; 3].map(|_| shape.uniform(0.012, 0.045)));
    let mut stream = Stream::new(seed, Purpose::Sampling, index as u64);
    (0..n).map(|_| touch_of(half, &six_by_six(), &mut stream)).collect()
}

/// The whole catalogue. Every third object has a half turn.
pub(crate) static WHOLE: LazyLock<Arc<SurfaceModel>> = LazyLock::new(|| {
    let sensor = six_by_six();
    let map = |index: usize| {
        let readings = touches_of(index, 120, 1);
        let set = TrainingSet { readings: &readings, sensor: &sensor };
        let config = SurfaceConfig::default();
        let map = map_surface(&set, &MODEL.space, &config, Some(DVec3::ZERO)).unwrap();
        let half = Symmetry::through(DVec3::ZERO, &[(DVec3::Z, AxisOrder::Finite(2))]);
        Arc::new(if index.is_multiple_of(3) { map.with_symmetry(half) } else { map })
    };
    Arc::new(MODEL.with_maps((0..N_OBJECTS).map(map).collect()))
});

/// Members that share the blocks of a catalogue.
#[derive(Debug)]
pub(crate) struct Members {
    /// The blocks of each member, by their numbers.
    held: Vec<Vec<Option<SurfaceModel>>>,
    maps: Vec<Arc<SurfaceMap>>,
    /// Blocks that do not answer.
    pub(crate) silent: Mutex<BTreeSet<usize>>,
    /// Requests since the beginning.
    pub(crate) n_asked: AtomicUsize,
}

impl Members {
    /// Divides a catalogue over `n` members.
    pub(crate) fn new(whole: &SurfaceModel, n: usize) -> Self {
        let n_objects = whole.n_objects();
        let blocks = whole.maps().chunks(OBJECTS_PER_BLOCK);
        let block = |(block, maps): (usize, &[Arc<SurfaceMap>]), member: usize| {
            let (space, calibration) = (whole.space.clone(), whole.calibration);
            let held = || SurfaceModel::of_block(space, calibration, maps.to_vec(), n_objects);
            (block % n == member).then(held)
        };
        let of_member = |member| blocks.clone().enumerate().map(|of| block(of, member)).collect();
        Self {
            held: (0..n).map(of_member).collect(),
            maps: whole.maps().to_vec(),
            silent: Mutex::default(),
            n_asked: AtomicUsize::new(0),
        }
    }

    fn is_silent(&self, block: usize) -> bool {
        self.silent.lock().unwrap().contains(&block)
    }

    /// The block numbered `block`, of the member that holds it.
    pub(crate) fn block(&self, block: usize) -> &SurfaceModel {
        self.held.iter().find_map(|of| of[block].as_ref()).unwrap()
    }
}

impl Parts for Members {
    fn ask(&self, requests: Vec<(usize, Vec<u8>)>) -> Vec<Result<Vec<u8>, Unanswered>> {
        let reply = |(block, request): (usize, Vec<u8>)| {
            self.n_asked.fetch_add(1, Ordering::Relaxed);
            if self.is_silent(block) {
                return Err(Unanswered);
            }
            Ok(answer(self.block(block), &request).unwrap())
        };
        requests.into_iter().map(reply).collect()
    }

    fn maps(&self, objects: &[usize]) -> Vec<Result<Arc<SurfaceMap>, Unanswered>> {
        let map = |object: &usize| match self.is_silent(object / OBJECTS_PER_BLOCK) {
            true => Err(Unanswered),
            false => Ok(Arc::clone(&self.maps[*object])),
        };
        objects.iter().map(map).collect()
    }
}

/// The model of a catalogue that is divided over these members.
pub(crate) fn divided(whole: &SurfaceModel, members: &Arc<Members>) -> Arc<SurfaceModel> {
    let blocks = 0..whole.n_objects().div_ceil(OBJECTS_PER_BLOCK);
    let of_block = |block| {
        let reply = answer(members.block(block), &outlines_request()).unwrap();
        outlines(&reply).unwrap()
    };
    let all: Vec<Outline> = blocks.flat_map(of_block).collect();
    let parts = Arc::clone(members) as Arc<dyn Parts>;
    Arc::new(SurfaceModel::divided(whole.space.clone(), whole.calibration, all, parts))
}
