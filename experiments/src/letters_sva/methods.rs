//! The methods that compete on raised letters, trained once per sensor and kind of presses.

use std::sync::Arc;

use glam::DVec3;
use palpate_core::belief::answer::Answer;
use palpate_core::descriptor::DescriptorKind;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_core::symmetry::{AxisOrder, Symmetry};
use palpate_core::training::TrainingSet;
use palpate_dissertation::sva::model::SvaModel;
use palpate_dissertation::sva::train::{
    DistanceRange, TrainingConfig, learn_vocabulary, map_object,
};
use palpate_dissertation::sva::{SvaBelief, SvaOptions};
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::model::SurfaceModel;
use palpate_recogniser::options::SurfaceOptions;
use palpate_recogniser::train::SurfaceConfig;
use palpate_sim::letters::{Letter, RotationOrder};

use crate::printed_sva::{Normals, Printed, PrintedForm};
use crate::trained::train_surface;

/// Poses that an answer states.
const N_MODES: usize = 8;

/// A method and its name in tables and keys.
pub(super) struct Method {
    pub(super) name: &'static str,
    kind: Kind,
}

enum Kind {
    /// The printed filter on printed patches: strict products over 21 × 21 × 9³ bins.
    Printed(Normals),
    /// The printed filter on the service's patches.
    Literal,
    /// `sva` as sessions run it: cubes of 8 mm, MNTI, distances from 8 mm on.
    Served,
    /// The service's filter with the print's plane, distances and descriptor.
    InPlane,
    /// Surface matching as sessions run it.
    Surface,
}

/// All methods, the printed one first.
pub(super) const METHODS: [Method; 6] = [
    Method { name: "as_printed", kind: Kind::Printed(Normals::Known) },
    Method { name: "as_printed_estimated_normals", kind: Kind::Printed(Normals::Estimated) },
    Method { name: "literal", kind: Kind::Literal },
    Method { name: "sva_in_plane", kind: Kind::InPlane },
    Method { name: "sva", kind: Kind::Served },
    Method { name: "surface", kind: Kind::Surface },
];

/// A trained method.
pub(super) struct Trained {
    sensor: SensorDescription,
    model: Model,
}

enum Model {
    Sva { model: Arc<SvaModel>, options: SvaOptions, printed: Option<Box<(Printed, f64)>> },
    Surface(Arc<SurfaceModel>),
}

/// The belief of one trial.
pub(super) struct Belief<'a> {
    sensor: &'a SensorDescription,
    state: State<'a>,
}

enum State<'a> {
    Sva(Box<SvaBelief>),
    Printed(Box<SvaBelief>, &'a Printed),
    Surface(Box<SurfaceBelief>),
}

impl Method {
    /// Trains the method on the presses of every letter.
    pub(super) fn train(
        &self,
        train: &[Vec<Reading>],
        sensor: &SensorDescription,
        letters: &[Letter],
        seed: u64,
    ) -> anyhow::Result<Trained> {
        let sva = |training: TrainingConfig, options: SvaOptions| -> anyhow::Result<Model> {
            let model = Arc::new(train_sva(train, sensor, &training, seed)?);
            Ok(Model::Sva { model, options, printed: None })
        };
        let model = match self.kind {
            Kind::Printed(normals) => {
                let form = PrintedForm { normals, ..PrintedForm::letters() };
                let printed = Printed::learn(train, sensor, form, seed)?;
                let (model, kept) = printed.catalogue(train, sensor)?;
                let options = SvaOptions::literal().in_plane();
                Model::Sva {
                    model: Arc::new(model),
                    options,
                    printed: Some(Box::new((printed, kept))),
                }
            }
            Kind::Literal => sva(of_letters(), SvaOptions::literal().in_plane())?,
            Kind::InPlane => sva(of_letters(), SvaOptions::default().in_plane())?,
            Kind::Served => sva(TrainingConfig::default(), SvaOptions::default())?,
            Kind::Surface => {
                let symmetries: Vec<Symmetry> = letters.iter().map(symmetry).collect();
                let config = SurfaceConfig::default();
                Model::Surface(train_surface(train, &symmetries, sensor, &config, seed)?)
            }
        };
        Ok(Trained { sensor: sensor.clone(), model })
    }
}

/// The service's training with the descriptor and distances of section 5.5.2.
fn of_letters() -> TrainingConfig {
    TrainingConfig {
        descriptor: DescriptorKind::MomentNormalized,
        distances: DistanceRange::Fixed(PrintedForm::letters().distances),
        ..TrainingConfig::default()
    }
}

fn train_sva(
    train: &[Vec<Reading>],
    sensor: &SensorDescription,
    training: &TrainingConfig,
    seed: u64,
) -> anyhow::Result<SvaModel> {
    let sets: Vec<TrainingSet<'_>> =
        train.iter().map(|readings| TrainingSet { readings, sensor }).collect();
    let vocabulary = learn_vocabulary(&sets, training, seed)?;
    let map = |set| map_object(set, &vocabulary, training, Some(DVec3::ZERO)).map(Arc::new);
    let objects: Result<Vec<_>, _> = sets.iter().map(map).collect();
    Ok(SvaModel { vocabulary, association: training.association, objects: objects? })
}

/// The letter's symmetry about the normal of its face.
fn symmetry(letter: &Letter) -> Symmetry {
    let order = match letter.rotation_order() {
        RotationOrder::Continuous => AxisOrder::Continuous,
        RotationOrder::Finite(1) => return Symmetry::NONE,
        RotationOrder::Finite(n) => AxisOrder::Finite(n as u8),
    };
    Symmetry::through(letter.centroid().extend(0.0), &[(DVec3::Z, order)])
}

impl Trained {
    /// Mean number of classes of a printed patch.
    pub(super) fn classes_kept(&self) -> Option<f64> {
        match &self.model {
            Model::Sva { printed, .. } => printed.as_ref().map(|printed| printed.1),
            Model::Surface(_) => None,
        }
    }

    /// A belief before the first reading.
    pub(super) fn begin(&self) -> anyhow::Result<Belief<'_>> {
        let state = match &self.model {
            Model::Sva { model, options, printed } => {
                let belief = Box::new(SvaBelief::new(model.clone(), *options, None)?);
                match printed {
                    None => State::Sva(belief),
                    Some(printed) => State::Printed(belief, &printed.0),
                }
            }
            Model::Surface(model) => {
                let options = SurfaceOptions::default();
                State::Surface(Box::new(SurfaceBelief::new(model.clone(), options, None)?))
            }
        };
        Ok(Belief { sensor: &self.sensor, state })
    }
}

impl Belief<'_> {
    pub(super) fn add(&mut self, reading: &Reading) -> anyhow::Result<()> {
        match &mut self.state {
            State::Sva(belief) => belief.add(reading, self.sensor)?,
            State::Printed(belief, printed) => {
                let patch = printed.patch(reading, self.sensor);
                patch.into_iter().for_each(|patch| belief.add_patch(patch));
            }
            State::Surface(belief) => belief.add(reading, self.sensor),
        }
        Ok(())
    }

    pub(super) fn answer(&self) -> Answer {
        match &self.state {
            State::Sva(belief) | State::Printed(belief, _) => belief.answer(N_MODES),
            State::Surface(belief) => belief.answer(N_MODES),
        }
    }
}
