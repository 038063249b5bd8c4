//! The experiments on the hybrid recogniser.

use std::path::PathBuf;

use clap::Subcommand;
use palpate_core::units::MM;
use palpate_experiments::hybrid_objects::{self, HybridObjects};
use palpate_experiments::report::{Outcome, Progress};

use super::{count, meshes_of, millimetres};

#[derive(Debug, Subcommand)]
pub(super) enum HybridExperiment {
    /// Section 5.5.1 by the hybrid recogniser, beside SVA as served and as printed.
    HybridObjects {
        /// A folder of meshes; the built-in objects when not given.
        #[arg(long, value_name = "DIR")]
        meshes: Option<PathBuf>,
        /// Largest dimension to which every object is scaled.
        #[arg(long, default_value_t = 80.0, value_parser = millimetres)]
        size_mm: f64,
        /// Trials an object.
        #[arg(long, default_value_t = 50, value_parser = count)]
        trials: usize,
        /// Trials an object of the printed method, which is slow.
        #[arg(long, default_value_t = 10, value_parser = count)]
        literal_trials: usize,
        /// Training readings an object.
        #[arg(long, default_value_t = 1_000, value_parser = count)]
        train_readings: usize,
        /// Readings a trial.
        #[arg(long, default_value_t = 10, value_parser = count)]
        readings: usize,
    },
}

impl HybridExperiment {
    /// Runs the experiment; takes minutes.
    pub(super) fn run(
        self,
        seed: u64,
        command: String,
        progress: Progress<'_>,
    ) -> anyhow::Result<Outcome> {
        match self {
            Self::HybridObjects {
                meshes,
                size_mm,
                trials,
                literal_trials,
                train_readings,
                readings,
            } => {
                let config = HybridObjects {
                    meshes,
                    size: size_mm * MM,
                    seed,
                    trials,
                    literal_trials,
                    train_readings,
                    readings,
                    ..HybridObjects::default()
                };
                hybrid_objects::run(&config, command, progress)
            }
        }
    }

    /// The command line that runs it, without the seed.
    pub(super) fn line(&self) -> String {
        match self {
            Self::HybridObjects {
                meshes,
                size_mm,
                trials,
                literal_trials,
                train_readings,
                readings,
            } => format!(
                "hybrid-objects{} --size-mm {size_mm} --trials {trials} --literal-trials \
                 {literal_trials} --train-readings {train_readings} --readings {readings}",
                meshes_of(meshes)
            ),
        }
    }
}
