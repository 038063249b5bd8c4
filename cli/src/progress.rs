//! Progress of long work: a bar on a terminal, otherwise an occasional line.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use palpate_client::schemas::{Job, JobStage, JobState};

use crate::output::{Output, plain};

/// Whether standard error is a terminal.
pub(crate) fn is_watched() -> bool {
    std::io::stderr().is_terminal()
}

/// Templates of a stage with a known and an unknown number of steps.
const COUNTED: &str = "{msg:<34} {bar:32} {pos}/{len} {eta}";
const BEGUN: &str = "{msg:<34} {bar:32} {pos}/{len} {elapsed}";
const STEPS: &str = "{msg:<24} {bar:32} {pos}/{len} {elapsed}";
const UNCOUNTED: &str = "{msg:<34} {spinner} {elapsed}";

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template)
        .expect("the templates are well formed")
        .progress_chars("█▉▊▋▌▍▎▏░")
}

/// Progress of an experiment: its stage, steps done and total.
pub(crate) struct StepProgress(Option<ProgressBar>);

impl StepProgress {
    /// A bar, or nothing without a terminal.
    pub(crate) fn new() -> Self {
        Self(is_watched().then(|| {
            let bar = ProgressBar::new(0).with_style(style(STEPS));
            bar.enable_steady_tick(Duration::from_millis(200));
            bar
        }))
    }

    /// Shows a step.
    pub(crate) fn show(&self, stage: &str, done: usize, total: usize) {
        if let Some(bar) = &self.0 {
            bar.set_message(plain(stage).into_owned());
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        }
    }

    /// Removes the bar.
    pub(crate) fn clear(&self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}

/// Progress of a training.
pub(crate) struct TrainingProgress {
    bar: Option<ProgressBar>,
    output: Output,
    stage: Option<JobStage>,
}

impl TrainingProgress {
    /// Shows nothing before the first report.
    pub(crate) fn new(output: Output) -> Self {
        let bar = is_watched().then(|| {
            let bar = ProgressBar::new(0).with_style(style(UNCOUNTED));
            bar.enable_steady_tick(Duration::from_millis(200));
            bar
        });
        Self { bar, output, stage: None }
    }

    /// Shows the state of the job.
    pub(crate) fn show(&mut self, job: &Job) {
        let stage = stage_words(job);
        if let Some(bar) = &self.bar {
            let template = match (job.total, job.done) {
                (0, _) => UNCOUNTED,
                // Nothing is done from which the time left could be told.
                (_, 0) => BEGUN,
                _ => COUNTED,
            };
            bar.set_style(style(template));
            bar.set_message(stage);
            // Both at once: the bar is drawn between two calls as well.
            bar.update(|state| {
                state.set_len(u64::from(job.total));
                state.set_pos(u64::from(job.done));
            });
        } else if job.stage.is_some() && job.stage != self.stage {
            self.output.say(format!("{stage} …"));
        }
        if job.stage != self.stage
            && let Some(bar) = &self.bar
        {
            bar.reset_eta();
        }
        self.stage = job.stage;
    }

    /// Removes the bar.
    pub(crate) fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    /// Hides the bar during a question to the user.
    pub(crate) fn pause(&self) {
        if let Some(bar) = &self.bar {
            bar.disable_steady_tick();
        }
    }

    /// Shows the bar again after [`TrainingProgress::pause`].
    pub(crate) fn resume(&self) {
        if let Some(bar) = &self.bar {
            bar.enable_steady_tick(Duration::from_millis(200));
        }
    }
}

fn stage_words(job: &Job) -> &'static str {
    match (job.state, job.stage) {
        (JobState::Queued, _) => "Waiting for other jobs",
        (_, Some(JobStage::Sampling)) if job.recalibration.is_some() => "Reading the sessions",
        (_, Some(JobStage::Sampling)) => "Touching the meshes in simulation",
        (_, Some(JobStage::Vocabulary)) => "Learning the vocabulary of touch",
        (_, Some(JobStage::Mapping)) => "Mapping the objects",
        (_, Some(JobStage::Surface)) => "Learning the surfaces",
        (_, Some(JobStage::Geometric)) => "Learning maps of contact",
        (_, Some(JobStage::Appearance)) => "Learning classes of appearance",
        (_, Some(JobStage::Replaying)) => "Replaying the sessions",
        (_, Some(JobStage::Storing)) => "Storing the version",
        (_, None) if job.recalibration.is_some() => "Recalibrating",
        (_, None) => "Training",
    }
}
