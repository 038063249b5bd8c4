//! The experiments of sections 4.4.2.3, 4.4.2.4 and 4.4.3: blind exploration and its controllers.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use palpate_core::units::MM;
use palpate_experiments::controllers::{self, Controllers};
use palpate_experiments::explorations::ExplorationTrials;
use palpate_experiments::object_trials::ObjectTrials;
use palpate_experiments::report::{Outcome, Progress};
use palpate_experiments::{exploration, perturbation};

use super::{count, meshes_of, millimetres};

#[derive(Debug, Subcommand)]
pub(super) enum ExplorationExperiment {
    /// Figures 4.11 and 4.12: strategies of exploration, and the sampler's readings.
    Exploration(RunArgs),
    /// Figure 4.13: objects that move each time they are touched.
    Perturbation(RunArgs),
    /// Figure 4.17: convergence of the contact controllers under noise.
    Controllers {
        /// A folder of meshes; the built-in objects when not given.
        #[arg(long, value_name = "DIR")]
        meshes: Option<PathBuf>,
        /// Which of them is touched.
        #[arg(long, default_value = "dragon", value_name = "NAME")]
        object: String,
        /// How many seeds, from --seed on.
        #[arg(long, default_value_t = 3, value_parser = count)]
        seeds: usize,
        /// Touches that must converge at each level of noise and seed.
        #[arg(long, default_value_t = 100, value_parser = count)]
        successes: usize,
    },
}

/// What is explored how often.
#[derive(Args, Debug)]
pub(super) struct RunArgs {
    /// A folder of meshes; the built-in objects when not given.
    #[arg(long, value_name = "DIR")]
    meshes: Option<PathBuf>,
    /// Largest dimension to which every object is scaled.
    #[arg(long, default_value_t = 80.0, value_parser = millimetres)]
    size_mm: f64,
    /// Explorations an object, of 100 readings each.
    #[arg(long, default_value_t = 3, value_parser = count)]
    runs: usize,
    /// Trials an object, shared by its explorations.
    #[arg(long, default_value_t = 100, value_parser = count)]
    trials: usize,
}

impl RunArgs {
    fn config(self, seed: u64) -> ExplorationTrials {
        let Self { meshes, size_mm, runs, trials } = self;
        let size = size_mm * MM;
        let objects = ObjectTrials { meshes, size, seed, trials, ..ObjectTrials::default() };
        ExplorationTrials { objects, runs }
    }

    fn line(&self, name: &str) -> String {
        let Self { meshes, size_mm, runs, trials } = self;
        let meshes = meshes_of(meshes);
        format!("{name}{meshes} --size-mm {size_mm} --runs {runs} --trials {trials}")
    }
}

impl ExplorationExperiment {
    /// Runs the experiment; takes minutes.
    pub(super) fn run(
        self,
        seed: u64,
        command: String,
        progress: Progress<'_>,
    ) -> anyhow::Result<Outcome> {
        match self {
            Self::Exploration(args) => exploration::run(&args.config(seed), command, progress),
            Self::Perturbation(args) => perturbation::run(&args.config(seed), command, progress),
            Self::Controllers { meshes, object, seeds, successes } => {
                let config = Controllers { meshes, object, seed, seeds, successes };
                controllers::run(&config, command, progress)
            }
        }
    }

    /// The command line that runs it, without the seed.
    pub(super) fn line(&self) -> String {
        match self {
            Self::Exploration(args) => args.line("exploration"),
            Self::Perturbation(args) => args.line("perturbation"),
            Self::Controllers { meshes, object, seeds, successes } => {
                let meshes = meshes_of(meshes);
                format!(
                    "controllers{meshes} --object {object} --seeds {seeds} --successes {successes}"
                )
            }
        }
    }
}
