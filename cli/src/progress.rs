//! Progress of long work: a bar on a terminal, now and then a line elsewhere.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use palpate_client::schemas::{Job, JobStage, JobState};

use crate::output::{Output, plain};

/// Whether a person watches the standard error.
pub(crate) fn is_watched() -> bool {
    std::io::stderr().is_terminal()
}

/// A stage that says how much there is to do, and one that does not.
const COUNTED: &str = "{msg:<34} {bar:32} {pos}/{len} {eta}";
const STEPS: &str = "{msg:<24} {bar:32} {pos}/{len} {elapsed}";
const UNCOUNTED: &str = "{msg:<34} {spinner} {elapsed}";

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template)
        .expect("the templates are well formed")
        .progress_chars("█▉▊▋▌▍▎▏░")
}

/// How far an experiment is: what it does, steps done and in all.
pub(crate) struct StepProgress(Option<ProgressBar>);

impl StepProgress {
    /// A bar, or nothing when nobody watches.
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

    /// Takes the bar away.
    pub(crate) fn clear(&self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}

/// How far a training is, shown as it goes on.
pub(crate) struct TrainingProgress {
    bar: Option<ProgressBar>,
    output: Output,
    stage: Option<JobStage>,
}

impl TrainingProgress {
    /// Nothing is shown before the first report.
    pub(crate) fn new(output: Output) -> Self {
        let bar = is_watched().then(|| {
            let bar = ProgressBar::new(0).with_style(style(UNCOUNTED));
            bar.enable_steady_tick(Duration::from_millis(200));
            bar
        });
        Self { bar, output, stage: None }
    }

    /// Shows where the job stands.
    pub(crate) fn show(&mut self, job: &Job) {
        let stage = stage_words(job);
        if let Some(bar) = &self.bar {
            bar.set_style(style(if job.total > 0 { COUNTED } else { UNCOUNTED }));
            bar.set_message(stage);
            bar.set_length(u64::from(job.total));
            bar.set_position(u64::from(job.done));
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

    /// Takes the bar away.
    pub(crate) fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    /// Leaves the terminal alone while something is asked.
    pub(crate) fn pause(&self) {
        if let Some(bar) = &self.bar {
            bar.disable_steady_tick();
        }
    }

    /// Goes on after [`TrainingProgress::pause`].
    pub(crate) fn resume(&self) {
        if let Some(bar) = &self.bar {
            bar.enable_steady_tick(Duration::from_millis(200));
        }
    }
}

fn stage_words(job: &Job) -> &'static str {
    match (job.state, job.stage) {
        (JobState::Queued, _) => "Waiting for other trainings",
        (_, Some(JobStage::Sampling)) => "Touching the meshes in simulation",
        (_, Some(JobStage::Vocabulary)) => "Learning the vocabulary of touch",
        (_, Some(JobStage::Mapping)) => "Mapping the objects",
        (_, Some(JobStage::Surface)) => "Learning the surfaces",
        (_, Some(JobStage::Geometric)) => "Learning maps of contact",
        (_, Some(JobStage::Appearance)) => "Learning classes of appearance",
        (_, Some(JobStage::Storing)) => "Storing the version",
        (_, None) => "Training",
    }
}
