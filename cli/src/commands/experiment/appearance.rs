//! The experiments of chapter 4 and section 5.3.3: appearance without geometry.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use palpate_experiments::consistency::{self, Consistency};
use palpate_experiments::letters_appearance::{self, LettersAppearance};
use palpate_experiments::object_trials::ObjectTrials;
use palpate_experiments::real_frames::{self, RealFrames};
use palpate_experiments::report::{Outcome, Progress};
use palpate_experiments::sim_to_real::{self, SimToReal};
use palpate_experiments::{covering_thickness, descriptors, noise, resolution};

use super::{count, meshes_of};

#[derive(Debug, Subcommand)]
pub(super) enum AppearanceExperiment {
    /// Figure 4.8: every descriptor on ten objects, accuracy against readings.
    Descriptors(ObjectArgs),
    /// Figure 4.14: appearance under coverings of 0.04 to 0.20 inch.
    CoveringThickness(ObjectArgs),
    /// Figure 4.15: appearance with 6×6, 14×14 and 26×26 taxels over 12 mm.
    Resolution(ObjectArgs),
    /// Figure 4.16: appearance under noise of up to 40 % of the sensing range.
    Noise(ObjectArgs),
    /// Figure 4.19: raised letters by appearance alone, 52 simulated and 5 on the rig.
    LettersAppearance {
        /// Trials a letter.
        #[arg(long, default_value_t = 50, value_parser = count)]
        trials: usize,
    },
    /// Figure 4.20: letters learnt in simulation, recognised with another sensor.
    SimToReal {
        /// How many sensors, from --seed on.
        #[arg(long, default_value_t = 3, value_parser = count)]
        seeds: usize,
    },
    /// Real frames of a 28×50 array, without poses.
    RealFrames {
        /// The folder that holds frames.csv.
        #[arg(long, value_name = "DIR")]
        data: PathBuf,
    },
    /// Figure 5.2: how alike touches are, against how far apart they are.
    Consistency {
        /// A folder of meshes; the built-in objects when not given.
        #[arg(long, value_name = "DIR")]
        meshes: Option<PathBuf>,
        /// The object that is touched.
        #[arg(long, default_value = "dragon")]
        object: String,
    },
}

/// Which objects are touched, and how often they are asked for.
#[derive(Args, Debug)]
pub(super) struct ObjectArgs {
    /// A folder of meshes; the built-in objects when not given.
    #[arg(long, value_name = "DIR")]
    meshes: Option<PathBuf>,
    /// Trials an object.
    #[arg(long, default_value_t = 100, value_parser = count)]
    trials: usize,
}

impl ObjectArgs {
    fn config(self, seed: u64) -> ObjectTrials {
        let Self { meshes, trials } = self;
        ObjectTrials { meshes, trials, seed, ..ObjectTrials::default() }
    }

    fn line(&self, name: &str) -> String {
        format!("{name}{} --trials {}", meshes_of(&self.meshes), self.trials)
    }
}

impl AppearanceExperiment {
    /// Runs the experiment; takes minutes.
    pub(super) fn run(
        self,
        seed: u64,
        command: String,
        progress: Progress<'_>,
    ) -> anyhow::Result<Outcome> {
        match self {
            Self::Descriptors(args) => descriptors::run(&args.config(seed), command, progress),
            Self::CoveringThickness(args) => {
                covering_thickness::run(&args.config(seed), command, progress)
            }
            Self::Resolution(args) => resolution::run(&args.config(seed), command, progress),
            Self::Noise(args) => noise::run(&args.config(seed), command, progress),
            Self::LettersAppearance { trials } => {
                let config = LettersAppearance { seed, trials, ..LettersAppearance::default() };
                letters_appearance::run(&config, command, progress)
            }
            Self::SimToReal { seeds } => {
                let config = SimToReal { seed, seeds, ..SimToReal::default() };
                sim_to_real::run(&config, command, progress)
            }
            Self::RealFrames { data } => {
                real_frames::run(&RealFrames::new(data, seed), command, progress)
            }
            Self::Consistency { meshes, object } => {
                let config = Consistency { meshes, object, seed, ..Consistency::default() };
                consistency::run(&config, command, progress)
            }
        }
    }

    /// The command line that runs it, without the seed.
    pub(super) fn line(&self) -> String {
        match self {
            Self::Descriptors(args) => args.line("descriptors"),
            Self::CoveringThickness(args) => args.line("covering-thickness"),
            Self::Resolution(args) => args.line("resolution"),
            Self::Noise(args) => args.line("noise"),
            Self::LettersAppearance { trials } => format!("letters-appearance --trials {trials}"),
            Self::SimToReal { seeds } => format!("sim-to-real --seeds {seeds}"),
            Self::RealFrames { data } => format!("real-frames --data {}", data.display()),
            Self::Consistency { meshes, object } => {
                format!("consistency{} --object {object}", meshes_of(meshes))
            }
        }
    }
}
