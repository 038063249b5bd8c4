//! Display while the robots touch: a table redrawn in place on a terminal, otherwise a line per
//! object.

use std::time::Duration;

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

use crate::output::{self, Output};
use crate::progress::is_watched;
use crate::trial::{Step, TrialResult};

/// Table of the robots.
pub(super) struct Screen {
    output: Output,
    live: Option<Live>,
}

struct Live {
    all: MultiProgress,
    // A bar that is dropped leaves its line on the terminal.
    _header: ProgressBar,
    robots: Vec<ProgressBar>,
    trials: ProgressBar,
}

impl Screen {
    /// Creates a screen for the given robots and trials.
    pub(super) fn new(n_robots: usize, n_trials: usize, output: Output) -> Self {
        if !is_watched() {
            output.say(header());
            return Self { output, live: None };
        }
        let style = |template: &str| {
            ProgressStyle::with_template(template)
                .expect("the templates are well formed")
                .progress_chars("█▉▊▋▌▍▎▏░")
        };
        let all = MultiProgress::new();
        let line = |template: &str, text: String| {
            let bar = all.add(ProgressBar::new(n_trials as u64).with_style(style(template)));
            bar.set_message(text);
            bar
        };
        let header = line("{msg}", header());
        header.tick();
        let robots = (1..=n_robots).map(|robot| line("{msg}", format!("robot-{robot}"))).collect();
        let trials = line("{msg} {bar:32} {pos}/{len}", "objects touched".to_owned());
        trials.enable_steady_tick(Duration::from_millis(200));
        Self { output, live: Some(Live { all, _header: header, robots, trials }) }
    }

    /// Shows that a robot turns to the next object.
    pub(super) fn begins(&self, robot: usize, truth: &str) {
        if let Some(live) = &self.live {
            live.robots[robot].set_message(format!("robot-{:<3} touches the {truth}", robot + 1));
        }
    }

    /// Shows a robot's touch and the belief after it.
    pub(super) fn touched(&self, robot: usize, truth: &str, step: &Step) {
        if let Some(live) = &self.live {
            live.robots[robot].set_message(row(robot, truth, step));
        }
    }

    /// Shows that a robot is done with an object.
    pub(super) fn ends(&self, robot: usize, result: &TrialResult) {
        match &self.live {
            Some(live) => live.trials.inc(1),
            None => self.output.say(row(robot, &result.truth, &result.last)),
        }
    }

    /// Shows that a robot has nothing left to do.
    pub(super) fn rests(&self, robot: usize) {
        if let Some(live) = &self.live {
            live.robots[robot].finish_with_message(format!("robot-{:<3} done", robot + 1));
        }
    }

    /// Removes the table; the summary follows.
    pub(super) fn clear(&self) {
        if let Some(live) = &self.live {
            // A closed terminal need not be cleared.
            let _ = live.all.clear();
        }
    }
}

fn header() -> String {
    format!(
        "{:<9} {:<13} {:>7}  {:<13} {:<10} {:>6} {:>9} {:>9} {:>8} named",
        "robot", "object", "touches", "believed", "", "", "entropy", "position", "angle"
    )
}

fn row(robot: usize, truth: &str, step: &Step) -> String {
    let verdict = if step.right { "✓" } else { "✗" };
    format!(
        "robot-{:<3} {truth:<13} {:>7}  {:<13} {} {:>5.1}% {:>4.2} bits {:>9} {:>8} {verdict}",
        robot + 1,
        step.touches,
        step.answer,
        output::bar(step.probability),
        step.probability * 100.0,
        step.entropy_bits,
        step.position_error.map_or("–".to_owned(), output::mm),
        step.angle_error.map_or("–".to_owned(), output::degrees),
    )
}
