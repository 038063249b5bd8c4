//! Arguments that experiments share, and the values that arguments may have.

use std::path::{Path, PathBuf};

use clap::Args;
use palpate_core::sensor::SensorDescription;
use palpate_core::units::MM;
use palpate_sim::shapes;
use serde::Serialize;

use crate::objects::{self, TestObject};

/// The objects that an experiment touches: the ten built-in ones unless told otherwise.
#[derive(Args, Clone, Debug, Serialize)]
pub struct ObjectSet {
    /// A folder of meshes to touch instead of the ten built-in objects.
    #[arg(long, value_name = "DIR")]
    pub meshes: Option<PathBuf>,
    /// Touch the public benchmark: 25 generated objects, of which ten are the built-in ones.
    #[arg(long, conflicts_with = "meshes")]
    pub public: bool,
    /// Largest dimension in millimetres to which every object is scaled.
    #[arg(long, default_value_t = 80.0, value_parser = millimetres)]
    pub size_mm: f64,
}

impl ObjectSet {
    /// The objects, scaled.
    ///
    /// # Errors
    /// When the folder or a file in it cannot be read, or it holds no mesh.
    pub fn load(&self) -> anyhow::Result<Vec<TestObject>> {
        match &self.meshes {
            Some(folder) => self.load_folder(folder),
            None if self.public => objects::generated(&shapes::PUBLIC_NAMES, self.size()),
            None => objects::generated(&shapes::NAMES, self.size()),
        }
    }

    /// The meshes of another folder, scaled alike.
    ///
    /// # Errors
    /// When the folder or a file in it cannot be read, or it holds no mesh.
    pub fn load_folder(&self, folder: &Path) -> anyhow::Result<Vec<TestObject>> {
        objects::from_folder(folder, self.size())
    }

    /// Whether a set of objects was given, so that the default does not apply.
    #[must_use]
    pub fn is_named(&self) -> bool {
        self.public || self.meshes.is_some()
    }

    /// Largest dimension of every object, metres.
    #[must_use]
    pub fn size(&self) -> f64 {
        self.size_mm * MM
    }
}

/// The readings of every object, all of one sensor: those that it is learnt from, and others that
/// its trials choose from.
#[derive(Args, Clone, Debug, Serialize)]
pub struct TouchSet {
    /// Training readings per object.
    #[arg(long, default_value_t = 1_000, value_parser = count)]
    pub train_readings: usize,
    /// Test readings per object.
    #[arg(long, default_value_t = 100, value_parser = count)]
    pub test_readings: usize,
    /// The sensor.
    #[arg(skip = SensorDescription::digitacts_6x6())]
    #[serde(skip)]
    pub sensor: SensorDescription,
}

/// The default arguments of an experiment.
///
/// # Panics
/// When an argument has no default.
#[must_use]
pub fn defaults<T: Args>() -> T {
    let command = T::augment_args(clap::Command::new("defaults"));
    let matches = command.get_matches_from(["defaults"]);
    T::from_arg_matches(&matches).expect("every argument has a default")
}

/// A size in millimetres.
///
/// # Errors
/// When it is not from 5 to 2000.
pub fn millimetres(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(size) if (5.0..=2_000.0).contains(&size) => Ok(size),
        _ => Err("expected millimetres from 5 to 2000".to_owned()),
    }
}

/// A number of things.
///
/// # Errors
/// When it is not from 1 to 1000000.
pub fn count(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(n) if (1..=1_000_000).contains(&n) => Ok(n),
        _ => Err("expected a number from 1 to 1000000".to_owned()),
    }
}

/// A share.
///
/// # Errors
/// When it is not from 0 to 1.
pub fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("expected a share from 0 to 1".to_owned()),
    }
}
