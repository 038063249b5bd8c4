//! The experiments on the surface recogniser.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use palpate_core::units::MM;
use palpate_experiments::next_touch::{self, NextTouch};
use palpate_experiments::report::{Outcome, Progress};
use palpate_experiments::surface_objects::{self, SurfaceObjects};
use palpate_experiments::surface_scale::{self, SurfaceScale};

use super::{count, meshes_of, millimetres};

#[derive(Debug, Subcommand)]
pub(super) enum SurfaceExperiment {
    /// Section 5.5.1 by the surface recogniser, beside SVA as served and as printed.
    SurfaceObjects {
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
    /// Catalogues of fifty, a hundred and on demand a thousand objects.
    SurfaceScale(ScaleArgs),
    /// Presses until an object is recognised for good, by how they are chosen.
    NextTouch {
        /// A folder of meshes; the built-in objects when not given.
        #[arg(long, value_name = "DIR")]
        meshes: Option<PathBuf>,
        /// Largest dimension to which every object is scaled.
        #[arg(long, default_value_t = 80.0, value_parser = millimetres)]
        size_mm: f64,
        /// Trials of all objects together.
        #[arg(long, default_value_t = 300, value_parser = count)]
        trials: usize,
        /// Training readings an object.
        #[arg(long, default_value_t = 1_000, value_parser = count)]
        train_readings: usize,
        /// Presses of a trial at most.
        #[arg(long, default_value_t = 20, value_parser = count)]
        readings: usize,
    },
}

/// Which objects catalogues are made of, and how large they are.
#[derive(Args, Debug)]
pub(super) struct ScaleArgs {
    /// A folder of meshes that every catalogue begins with.
    #[arg(long, value_name = "DIR")]
    meshes: Option<PathBuf>,
    /// A folder of further meshes.
    #[arg(long, value_name = "DIR")]
    pool: Option<PathBuf>,
    /// A folder of letters as solids, upper_A to upper_Z.
    #[arg(long, value_name = "DIR")]
    letters: Option<PathBuf>,
    /// Sizes of catalogues.
    #[arg(long, default_values_t = [50, 100], value_delimiter = ',', value_parser = count)]
    objects: Vec<usize>,
    /// Trials an object.
    #[arg(long, default_value_t = 10, value_parser = count)]
    trials: usize,
    /// Sessions of the printed method with each catalogue, which are slow; 0 for none.
    #[arg(long, default_value_t = 20)]
    literal_sessions: usize,
    /// Trials an object of the largest catalogue whose touches the recogniser chooses from the
    /// third on; 0 for none.
    #[arg(long, default_value_t = 2)]
    chosen_trials: usize,
    /// Also a thousand: these objects but the letters, procedural ones, and families of both;
    /// takes long.
    #[arg(long)]
    thousand: bool,
}

impl ScaleArgs {
    fn config(self, seed: u64) -> SurfaceScale {
        let Self { meshes, pool, letters, objects, trials, .. } = self;
        let Self { literal_sessions, chosen_trials, thousand, .. } = self;
        let counts = objects;
        SurfaceScale {
            meshes,
            pool,
            letters,
            counts,
            thousand,
            seed,
            trials,
            literal_sessions,
            chosen_trials,
            ..SurfaceScale::default()
        }
    }

    fn line(&self) -> String {
        let folder = |name: &str, folder: &Option<PathBuf>| {
            folder.as_ref().map(|at| format!(" --{name} {}", at.display())).unwrap_or_default()
        };
        let counts: Vec<String> = self.objects.iter().map(usize::to_string).collect();
        format!(
            "surface-scale{}{}{} --objects {} --trials {} --literal-sessions {} --chosen-trials {}{}",
            meshes_of(&self.meshes),
            folder("pool", &self.pool),
            folder("letters", &self.letters),
            counts.join(","),
            self.trials,
            self.literal_sessions,
            self.chosen_trials,
            if self.thousand { " --thousand" } else { "" }
        )
    }
}

impl SurfaceExperiment {
    /// Runs the experiment; takes minutes.
    pub(super) fn run(
        self,
        seed: u64,
        command: String,
        progress: Progress<'_>,
    ) -> anyhow::Result<Outcome> {
        match self {
            Self::SurfaceObjects {
                meshes,
                size_mm,
                trials,
                literal_trials,
                train_readings,
                readings,
            } => {
                let config = SurfaceObjects {
                    meshes,
                    size: size_mm * MM,
                    seed,
                    trials,
                    literal_trials,
                    train_readings,
                    readings,
                    ..SurfaceObjects::default()
                };
                surface_objects::run(&config, command, progress)
            }
            Self::SurfaceScale(args) => surface_scale::run(&args.config(seed), command, progress),
            Self::NextTouch { meshes, size_mm, trials, train_readings, readings } => {
                let size = size_mm * MM;
                let config = NextTouch { meshes, size, seed, trials, train_readings, readings };
                next_touch::run(&config, command, progress)
            }
        }
    }

    /// The command line that runs it, without the seed.
    pub(super) fn line(&self) -> String {
        match self {
            Self::SurfaceObjects {
                meshes,
                size_mm,
                trials,
                literal_trials,
                train_readings,
                readings,
            } => format!(
                "surface-objects{} --size-mm {size_mm} --trials {trials} --literal-trials \
                 {literal_trials} --train-readings {train_readings} --readings {readings}",
                meshes_of(meshes)
            ),
            Self::SurfaceScale(args) => args.line(),
            Self::NextTouch { meshes, size_mm, trials, train_readings, readings } => format!(
                "next-touch{} --size-mm {size_mm} --trials {trials} --train-readings \
                 {train_readings} --readings {readings}",
                meshes_of(meshes)
            ),
        }
    }
}
