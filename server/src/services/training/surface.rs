//! Training of surfaces, and calibration of their evidence.
//!
//! A tenth of an object's readings is held out of its surface for the calibration. A mesh that a
//! family of sensors presses has touches of its own for that, by sensors that its surface does not
//! know. The symmetry is that of the mesh, or found in all readings. A training that extends a version
//! uses its appearance space, and learns the calibration again for all objects together.

use std::borrow::Cow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use palpate_core::reading::Reading;
use palpate_core::symmetry::{Finding, Symmetry};
use palpate_core::training::TrainingSet;
use palpate_dissertation::sva::model::ObjectMap;
use palpate_recogniser::belief::calibrate::{HeldBack, READINGS};
use palpate_recogniser::belief::hold_out::{Split, calibrated, split};
use palpate_recogniser::model::{AppearanceSpace, SurfaceMap};
use palpate_recogniser::model::{CalibrationBasis, EvidenceCalibration, SurfaceModel};
use palpate_recogniser::train::{SurfaceConfig, find_symmetry, learn_space, map_surface};
use palpate_schemas::{JobStage, SurfaceReport};
use rayon::prelude::*;

use super::base::extended;
use super::material::Material;
use super::unseen::{self, Unseen};
use super::{Plan, Progress, Sources, TrainingFailure, step};
use crate::wire::count;

/// Results of the training.
pub(super) struct Learnt {
    /// The surfaces of all objects of the new version.
    pub(super) model: Arc<SurfaceModel>,
    /// The new surfaces, in the plan's order.
    pub(super) new: Vec<Arc<SurfaceMap>>,
    /// The source of each new object's symmetry.
    pub(super) decided: Vec<Decided>,
}

/// Source of an object's symmetry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Decided {
    ByMesh,
    ByTouches,
    /// Undetermined: about this many more touches are needed.
    Not {
        touches_needed: usize,
    },
}

/// Trains the surfaces of all objects, in the frames of their pair `maps` if there are any.
pub(super) fn learn(
    plan: &Plan,
    materials: &[Material],
    maps: &[ObjectMap],
    sources: &Sources<'_>,
    progress: &Progress<'_>,
) -> Result<Learnt, TrainingFailure> {
    let total = materials.len() + 1;
    step(progress, JobStage::Surface, 0, total)?;
    let config = SurfaceConfig::default();
    let splits: Vec<Parts<'_>> = materials.iter().map(parts_of).collect();
    let sets: Vec<TrainingSet<'_>> = splits
        .iter()
        .zip(materials)
        .map(|(split, material)| TrainingSet { readings: &split.kept, ..material.set() })
        .collect();
    let base = plan.base.as_ref().map(|base| base.model.surface()).transpose()?;
    let space = match base {
        Some(known) => known.space.clone(),
        None => learn_space(&sets, plan.seed).map_err(|source| {
            // Those held out for the calibration, too.
            let n_touches = materials.iter().map(|material| material.touched.n_touches).sum();
            TrainingFailure::Space { n_touches, source }
        })?,
    };
    let (new, decided): (Vec<_>, Vec<_>) =
        map_all(materials, &sets, maps, &space, &config, progress)?.into_iter().unzip();
    let model = match (&plan.base, base) {
        (Some(base), Some(known)) => {
            let places = base.places(materials);
            let maps = extended(known.maps(), &places, new.clone());
            let stop = || progress(JobStage::Surface, materials.len(), total);
            let unseen = unseen::gather(plan, base, &places, known, sources, &stop)?;
            let unseen = extended(&by_object(&unseen), &places, held_back(materials, &splits));
            recalibrated(known, maps, &unseen, plan.seed)
        }
        _ => {
            let default = EvidenceCalibration::default();
            let model = Arc::new(SurfaceModel::new(space, default, new.clone()));
            calibrated(model, &held_back(materials, &splits), plan.seed)
        }
    };
    step(progress, JobStage::Surface, total, total)?;
    Ok(Learnt { model, new, decided })
}

/// The readings of an object's surface, and those of the calibration.
struct Parts<'a> {
    kept: Cow<'a, [Reading]>,
    held_back: Cow<'a, [Reading]>,
}

fn parts_of(material: &Material) -> Parts<'_> {
    if let Some(held_back) = &material.held_back {
        let kept = Cow::Borrowed(&material.readings[..]);
        return Parts { kept, held_back: Cow::Borrowed(held_back) };
    }
    let Split { mut kept, held_back } = split(material.set().readings);
    kept.extend_from_slice(material.for_surface());
    Parts { kept: Cow::Owned(kept), held_back: Cow::Owned(held_back) }
}

fn map_all(
    materials: &[Material],
    sets: &[TrainingSet<'_>],
    maps: &[ObjectMap],
    space: &AppearanceSpace,
    config: &SurfaceConfig,
    progress: &Progress<'_>,
) -> Result<Vec<(Arc<SurfaceMap>, Decided)>, TrainingFailure> {
    let done = AtomicUsize::new(0);
    let map_one = |(index, (material, set)): (usize, (&Material, &TrainingSet<'_>))| {
        // All parts of an object are in one frame.
        let origin = maps.get(index).map(ObjectMap::origin_in_training).or(material.origin);
        let map = map_surface(set, space, config, origin).map_err(|source| {
            TrainingFailure::Surface { object: material.object.name.clone(), source }
        })?;
        let (symmetry, decided) = symmetry(material, map.origin_in_training());
        let now = done.fetch_add(1, Ordering::Relaxed) + 1;
        step(progress, JobStage::Surface, now, materials.len() + 1)?;
        Ok((Arc::new(map.with_symmetry(symmetry)), decided))
    };
    materials.par_iter().zip(sets).enumerate().map(map_one).collect()
}

/// The symmetry by the mesh if there is one, else by the touches.
fn symmetry(material: &Material, origin_in_training: DVec3) -> (Symmetry, Decided) {
    if let (Some(symmetry), Some(origin)) = (&material.symmetry, material.origin) {
        return (symmetry.seen_from(origin_in_training - origin), Decided::ByMesh);
    }
    match find_symmetry(&material.set(), origin_in_training) {
        Finding::Settled(symmetry) => (symmetry, Decided::ByTouches),
        Finding::Undetermined { touches_needed } => {
            (Symmetry::NONE, Decided::Not { touches_needed })
        }
    }
}

/// Held-out readings of each new object.
fn held_back<'a>(materials: &'a [Material], splits: &'a [Parts<'a>]) -> Vec<HeldBack<'a>> {
    let of = |(split, material): (&'a Parts<'a>, &'a Material)| HeldBack {
        readings: &split.held_back,
        sensor: material.set().sensor,
        run: material.held_back.is_some().then_some(READINGS),
    };
    splits.iter().zip(materials).map(of).collect()
}

fn by_object(unseen: &[Unseen]) -> Vec<HeldBack<'_>> {
    unseen
        .iter()
        .map(|one| HeldBack { readings: &one.readings, sensor: &one.sensor, run: one.run })
        .collect()
}

/// The known model with further maps. If none of these has held-out readings, the calibration
/// stays unchanged: it does not depend on the number of objects. It also stays if it was fitted to
/// sessions, which tell more of the sensor in use than held-out readings.
fn recalibrated(
    known: &SurfaceModel,
    maps: Vec<Arc<SurfaceMap>>,
    unseen: &[HeldBack<'_>],
    seed: u64,
) -> Arc<SurfaceModel> {
    let extended = Arc::new(known.with_maps(maps));
    if matches!(known.calibration.basis, CalibrationBasis::Sessions { .. }) {
        return extended;
    }
    let model = calibrated(extended, unseen, seed);
    let is_learnt = |basis| matches!(basis, CalibrationBasis::HeldBack { .. });
    if is_learnt(known.calibration.basis) && !is_learnt(model.calibration.basis) {
        return Arc::new(Arc::unwrap_or_clone(model).with_calibration(known.calibration));
    }
    model
}

/// The report on a surface.
pub(super) fn report(map: &SurfaceMap) -> SurfaceReport {
    SurfaceReport {
        n_patches: count(map.patches().len()),
        n_pairs: count(map.pairs().len()),
        bytes: map.bytes() as u64,
    }
}
