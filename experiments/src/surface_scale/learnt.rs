//! The objects of a large catalogue, touched and mapped.
//!
//! The appearance space is learnt from the first hundred objects; every other object is made,
//! touched, mapped and dropped. Touches can be kept in a folder, so that a run that was interrupted
//! goes on where it was.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context as _;
use glam::DVec3;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::training::TrainingSet;
use palpate_recogniser::model::{AppearanceSpace, EvidenceCalibration, SurfaceMap, SurfaceModel};
use palpate_recogniser::train::{learn_space, map_surface};
use palpate_sim::kept::Kept;
use rayon::prelude::*;

use super::thousand::Growth;
use super::{SurfaceScale, report_left_out};
use crate::families::Families;
use crate::objects::{self, TestObject};
use crate::report::{Progress, Report};

/// Objects that are touched side by side.
const SIDE_BY_SIDE: usize = 32;

/// All objects of the largest catalogue.
pub(crate) struct Learnt {
    pub(crate) model: SurfaceModel,
    pub(crate) test: Vec<Vec<Reading>>,
    pub(super) names: Vec<String>,
}

/// Objects that were touched, in the order of the families.
struct Taken<'a> {
    config: &'a SurfaceScale,
    growth: &'a Growth,
    kept: Option<Kept>,
    /// The families never end; if more than half of their members fail, the cause is not the
    /// objects.
    objects: std::iter::Take<&'a mut Families>,
    /// Test readings and names of those so far.
    test: Vec<Vec<Reading>>,
    names: Vec<String>,
}

/// The model of all objects, and their test readings. Objects that cannot be touched often
/// enough are left out and named in a row.
///
/// # Errors
/// When too few objects can be touched, they cannot be learnt from, or touches cannot be kept.
pub(super) fn learn(
    config: &SurfaceScale,
    growth: &Growth,
    objects: &mut Families,
    report: &mut Report,
    progress: Progress<'_>,
) -> anyhow::Result<Learnt> {
    let (sensor, largest) = (&config.touches.sensor, growth.largest());
    let open = |folder: &PathBuf| {
        Kept::open(folder).with_context(|| format!("cannot use --kept {}", folder.display()))
    };
    let mut taken = Taken {
        config,
        growth,
        kept: config.kept.as_ref().map(open).transpose()?,
        objects: objects.take(2 * largest),
        test: Vec::with_capacity(largest),
        names: Vec::new(),
    };
    let mut first = Vec::new();
    while first.len() < growth.space_objects.min(largest) {
        let wanted = growth.space_objects.min(largest) - first.len();
        first.extend(taken.next(wanted, report, progress)?);
    }
    let sets: Vec<TrainingSet<'_>> =
        first.iter().map(|readings| TrainingSet { readings, sensor }).collect();
    let space = learn_space(&sets, config.seed)?;
    let mut maps = mapped(&first, &space, sensor, growth)?;
    drop(first);
    while maps.len() < largest {
        let next = taken.next(largest - maps.len(), report, progress)?;
        maps.extend(mapped(&next, &space, sensor, growth)?);
    }
    let Taken { test, names, .. } = taken;
    let model = SurfaceModel::new(space, EvidenceCalibration::default(), maps);
    Ok(Learnt { model, test, names })
}

fn mapped(
    readings: &[Vec<Reading>],
    space: &AppearanceSpace,
    sensor: &SensorDescription,
    growth: &Growth,
) -> anyhow::Result<Vec<Arc<SurfaceMap>>> {
    let map = |readings: &Vec<Reading>| {
        let set = TrainingSet { readings, sensor };
        Ok(Arc::new(map_surface(&set, space, &growth.surface(), Some(DVec3::ZERO))?))
    };
    readings.par_iter().map(map).collect()
}

impl Taken<'_> {
    /// Training readings of at most `wanted` further objects.
    fn next(
        &mut self,
        wanted: usize,
        report: &mut Report,
        progress: Progress<'_>,
    ) -> anyhow::Result<Vec<Vec<Reading>>> {
        progress("touching objects", self.test.len(), self.growth.largest());
        let candidates = self.objects.by_ref().take(wanted.min(SIDE_BY_SIDE));
        let candidates: Vec<TestObject> = candidates.collect::<anyhow::Result<_>>()?;
        anyhow::ensure!(
            !candidates.is_empty(),
            "{} of {} objects can be touched",
            self.test.len(),
            2 * self.growth.largest()
        );
        let (counts, seed) =
            ([self.growth.train_readings, self.growth.test_readings], 2 * self.config.seed);
        let touched = |object: &TestObject| {
            let (sensor, kept) = (&self.config.touches.sensor, self.kept.as_ref());
            objects::touch_or_read(object, sensor, (counts, [seed, seed + 1]), kept)
        };
        let both = candidates.par_iter().map(touched);
        let both = both.collect::<std::io::Result<Vec<_>>>().context("cannot keep touches")?;
        let mut train = Vec::new();
        for (object, both) in candidates.into_iter().zip(both) {
            match both {
                Ok([trained, tested]) => {
                    self.test.push(tested);
                    self.names.push(object.name);
                    train.push(trained);
                }
                Err(error) => report_left_out(report, &object, &error),
            }
        }
        Ok(train)
    }
}
