//! The experiments on what the surface recogniser does not know, did not train with, or forgot.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use palpate_core::units::MM;
use palpate_experiments::other_physics::{self, OtherPhysics};
use palpate_experiments::ppf_peer::{self, PpfPeer};
use palpate_experiments::report::{Outcome, Progress};
use palpate_experiments::solid_geometry::{self, SolidGeometry};
use palpate_experiments::surface_noise::{self, SurfaceNoise};
use palpate_experiments::thinning::{self, Thinning};
use palpate_experiments::unknown::{self, Unknown};

use super::{count, meshes_of, millimetres};

#[derive(Debug, Subcommand)]
pub(super) enum RobustnessExperiment {
    /// Objects truly held back: who tells them, calibration, and the stop rule.
    Unknown(UnknownArgs),
    /// Trained on the point spread, tested on elastic coverings.
    OtherPhysics(TrialArgs),
    /// Noise, arms that are off, moving objects, and other sensors than trained with.
    SurfaceNoise {
        #[command(flatten)]
        trials: TrialArgs,
        /// Largest dimension to which every object is scaled.
        #[arg(long, default_value_t = 80.0, value_parser = millimetres)]
        size_mm: f64,
        /// Only conditions whose keys begin so; all when not given.
        #[arg(long, value_name = "KEY")]
        only: Option<String>,
    },
    /// Fewer touches kept of each object: what is lost, farthest first and at random.
    Thinning(TrialArgs),
    /// `geometric` with solid maps: how large a box of poses it resolves.
    SolidGeometry {
        /// A folder of meshes; the built-in objects when not given.
        #[arg(long, value_name = "DIR")]
        meshes: Option<PathBuf>,
        /// Trials an object and box.
        #[arg(long, default_value_t = 5, value_parser = count)]
        trials: usize,
    },
    /// OpenCV's point-pair features and ICP on the same touches.
    PpfPeer(PeerArgs),
}

/// Which objects there are, and how sessions touch them.
#[derive(Args, Debug)]
pub(super) struct UnknownArgs {
    /// Procedural objects, which are new ones for every seed.
    #[arg(long, default_value_t = 48)]
    procedural: usize,
    /// A folder of meshes beside them; the built-in objects when there are no others.
    #[arg(long, value_name = "DIR")]
    meshes: Option<PathBuf>,
    /// A folder of further meshes.
    #[arg(long, value_name = "DIR")]
    pool: Option<PathBuf>,
    /// Into so many parts the objects are dealt; each is left out once.
    #[arg(long, default_value_t = 4, value_parser = count)]
    folds: usize,
    /// Sessions of all folds together.
    #[arg(long, default_value_t = 2_400, value_parser = count)]
    sessions: usize,
    /// Sessions of the printed method, which are slow; 0 for none.
    #[arg(long, default_value_t = 4)]
    literal_sessions: usize,
    /// Training readings an object, of which a tenth is held back.
    #[arg(long, default_value_t = 600, value_parser = count)]
    train_readings: usize,
}

/// Which objects there are, and how many trials each method plays.
#[derive(Args, Debug)]
pub(super) struct TrialArgs {
    /// A folder of meshes; the built-in objects when not given.
    #[arg(long, value_name = "DIR")]
    meshes: Option<PathBuf>,
    /// Trials an object.
    #[arg(long, default_value_t = 20, value_parser = count)]
    trials: usize,
    /// Sessions of the printed method a setting, which are slow; 0 for none.
    #[arg(long, default_value_t = 10)]
    literal_sessions: usize,
}

/// What the peer runs on.
#[derive(Args, Debug)]
pub(super) struct PeerArgs {
    /// A folder of meshes; the built-in objects when not given.
    #[arg(long, value_name = "DIR")]
    meshes: Option<PathBuf>,
    /// Trials an object.
    #[arg(long, default_value_t = 5, value_parser = count)]
    trials: usize,
    /// A Python with opencv-contrib-python.
    #[arg(long, default_value = "python3", value_name = "PATH")]
    python: PathBuf,
    /// The peer's script.
    #[arg(long, default_value = "tests/peers/ppf_opencv.py", value_name = "PATH")]
    script: PathBuf,
}

impl RobustnessExperiment {
    /// Runs the experiment; takes minutes.
    pub(super) fn run(
        self,
        seed: u64,
        command: String,
        progress: Progress<'_>,
    ) -> anyhow::Result<Outcome> {
        match self {
            Self::Unknown(args) => {
                let UnknownArgs { procedural, meshes, pool, folds, .. } = args;
                let UnknownArgs { sessions, literal_sessions, train_readings, .. } = args;
                let config = Unknown {
                    procedural,
                    train_readings,
                    meshes,
                    pool,
                    seed,
                    folds,
                    sessions,
                    literal_sessions,
                    ..Unknown::default()
                };
                unknown::run(&config, command, progress)
            }
            Self::OtherPhysics(TrialArgs { meshes, trials, literal_sessions }) => {
                let defaults = OtherPhysics::default();
                let config = OtherPhysics { meshes, seed, trials, literal_sessions, ..defaults };
                other_physics::run(&config, command, progress)
            }
            Self::SurfaceNoise { trials: trial_args, size_mm, only } => {
                let TrialArgs { meshes, trials, literal_sessions } = trial_args;
                let (only, size) = (only.unwrap_or_default(), size_mm * MM);
                let config = SurfaceNoise {
                    meshes,
                    size,
                    seed,
                    trials,
                    literal_sessions,
                    only,
                    ..SurfaceNoise::default()
                };
                surface_noise::run(&config, command, progress)
            }
            Self::Thinning(TrialArgs { meshes, trials, literal_sessions }) => {
                let defaults = Thinning::default();
                let config = Thinning { meshes, seed, trials, literal_sessions, ..defaults };
                thinning::run(&config, command, progress)
            }
            Self::SolidGeometry { meshes, trials } => {
                let config = SolidGeometry { meshes, seed, trials, ..SolidGeometry::default() };
                solid_geometry::run(&config, command, progress)
            }
            Self::PpfPeer(PeerArgs { meshes, trials, python, script }) => {
                let defaults = PpfPeer::default();
                let config = PpfPeer { meshes, seed, trials, python, script, ..defaults };
                ppf_peer::run(&config, command, progress)
            }
        }
    }

    /// The command line that runs it, without the seed.
    pub(super) fn line(&self) -> String {
        match self {
            Self::Unknown(args) => format!(
                "unknown --procedural {}{}{} --folds {} --sessions {} --literal-sessions {} \
                 --train-readings {}",
                args.procedural,
                meshes_of(&args.meshes),
                args.pool
                    .as_ref()
                    .map(|at| format!(" --pool {}", at.display()))
                    .unwrap_or_default(),
                args.folds,
                args.sessions,
                args.literal_sessions,
                args.train_readings
            ),
            Self::OtherPhysics(trials) => trials.line("other-physics"),
            Self::SurfaceNoise { trials, size_mm, only } => {
                let only = only.as_ref().map(|key| format!(" --only {key}")).unwrap_or_default();
                format!("{} --size-mm {size_mm}{only}", trials.line("surface-noise"))
            }
            Self::Thinning(trials) => trials.line("thinning"),
            Self::SolidGeometry { meshes, trials } => {
                format!("solid-geometry{} --trials {trials}", meshes_of(meshes))
            }
            // Where a Python is, is no part of the figures.
            Self::PpfPeer(args) => {
                format!("ppf-peer{} --trials {}", meshes_of(&args.meshes), args.trials)
            }
        }
    }
}

impl TrialArgs {
    fn line(&self, name: &str) -> String {
        format!(
            "{name}{} --trials {} --literal-sessions {}",
            meshes_of(&self.meshes),
            self.trials,
            self.literal_sessions
        )
    }
}
