//! Training jobs on the wire: their states, stages and results.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::recalibration::RecalibrateCatalogue;
use crate::shadow::{ShadowReport, ShadowVersion};
use crate::training::StartTraining;

/// A job: a training, a recalibration, or a comparison of two versions.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct Job {
    /// The job's id.
    pub id: Uuid,
    /// Name of the catalogue.
    pub catalogue: String,
    /// State of the job.
    pub state: JobState,
    /// Current stage; null unless the job is running.
    pub stage: Option<JobStage>,
    /// Number of steps done in this stage.
    pub done: u32,
    /// Number of steps in this stage; 0 if unknown.
    pub total: u32,
    /// Estimated seconds until the stage is done.
    pub eta_s: Option<f64>,
    /// The training request, with defaults; empty for other jobs.
    pub training: StartTraining,
    /// The recalibration request, with defaults; null for other jobs.
    #[serde(default)]
    pub recalibration: Option<RecalibrateCatalogue>,
    /// The comparison request, with defaults; null for other jobs.
    #[serde(default)]
    pub shadow: Option<ShadowVersion>,
    /// What a comparison found; null until it succeeds, and for other jobs.
    #[serde(default)]
    pub shadow_report: Option<ShadowReport>,
    /// The version that the job made; of a comparison the version that was tried. Null unless it
    /// succeeded.
    pub version: Option<u32>,
    /// Why the job failed or was cancelled; null otherwise.
    pub reason: Option<String>,
    /// When the job was requested.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// When the job started.
    #[schema(format = DateTime)]
    pub started_at: Option<String>,
    /// When the job ended.
    #[schema(format = DateTime)]
    pub finished_at: Option<String>,
}

/// A page of jobs.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct JobPage {
    /// The jobs, oldest first.
    pub items: Vec<Job>,
    /// The cursor of the next page; null on the last.
    pub next_cursor: Option<String>,
}

/// State of a job.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Waiting for earlier jobs.
    Queued,
    /// Running.
    Running,
    /// Done; `version` is the result.
    Succeeded,
    /// Failed; `reason` says why.
    Failed,
    /// Cancelled by a client.
    Cancelled,
}

impl JobState {
    /// Name of the state on the wire.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }

    /// Whether the state is final.
    #[must_use]
    pub fn is_final(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }
}

/// Stage of a running job.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobStage {
    /// Touching meshes in simulation; steps are readings. For a recalibration: reading the sessions.
    Sampling,
    /// Learning the appearance classes.
    Vocabulary,
    /// Building the pair maps; steps are objects.
    Mapping,
    /// Learning the surfaces, then the calibration; steps are objects, plus one for the
    /// calibration.
    Surface,
    /// Learning contact and pressure maps; steps are objects.
    Geometric,
    /// Learning the appearance classes, then the histograms; steps are the candidates for the
    /// number of classes and the objects.
    Appearance,
    /// Replaying ended sessions: to fit the calibration, where steps are replays, or to compare two
    /// versions, where steps are sessions.
    Replaying,
    /// Writing the version.
    Storing,
}
