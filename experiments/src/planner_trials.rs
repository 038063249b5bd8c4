//! Figures 4.8 and 4.14 to 4.16 on readings of the exploring planner, beside the sampler's.
//!
//! The dissertation tests these figures on the planner's readings. They cost far more time than
//! the sampler's, so they are taken on request.

use clap::Args;
use palpate_dissertation::appearance::model::AppearanceModel;
use palpate_sim::plot::{Line, Panel, svg};
use serde::Serialize;

use crate::appearance_trials::{Point, line};
use crate::arguments::count;
use crate::explorations::{ExplorationTrials, Run, Strategy, report_curves};
use crate::object_trials::{ObjectTrials, Setting, TOP_DESCRIPTORS, panel, rows};
use crate::objects::TestObject;
use crate::report::{Outcome, Progress, Report};

/// Probability of the local strategy.
const LOCAL: f64 = 0.5;

/// Arguments of the experiments of figures 4.8 and 4.14 to 4.16.
#[derive(Args, Clone, Debug, Serialize)]
pub struct PlannerTrials {
    /// Objects, training, and tests on the sampler's readings.
    #[command(flatten)]
    #[serde(flatten)]
    pub objects: ObjectTrials,
    /// Explorations per object, whose readings test the models as well.
    #[arg(long, value_parser = count)]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub explorations: Option<usize>,
}

/// Explorations in one setting.
pub struct Planned {
    trials: ExplorationTrials,
    runs: Vec<Run>,
}

impl PlannerTrials {
    /// The explorations of a setting, as printed, if any are asked for.
    ///
    /// # Errors
    /// When the planner does not obtain enough readings.
    pub fn explore(
        &self,
        objects: &[TestObject],
        setting: &Setting,
    ) -> anyhow::Result<Option<Planned>> {
        let Some(runs) = self.explorations else { return Ok(None) };
        let trials = ExplorationTrials { objects: self.objects.clone(), runs };
        let runs = trials.explore(objects, setting, &strategy())?;
        Ok(Some(Planned { trials, runs }))
    }

    /// Runs the descriptors of figures 4.14 to 4.16 in every setting, with a panel per
    /// descriptor, and another for explorations.
    ///
    /// # Errors
    /// When objects cannot be read, touched, explored or learnt.
    pub fn sweep(&self, settings: &[Setting], progress: Progress<'_>) -> anyhow::Result<Outcome> {
        let objects = self.objects.objects()?;
        let mut report = Report::default();
        let mut lines: Vec<[Vec<Line>; 2]> =
            TOP_DESCRIPTORS.iter().map(|_| [Vec::new(), Vec::new()]).collect();
        for (done, setting) in settings.iter().enumerate() {
            progress(&format!("touching, {}", setting.name), done, settings.len());
            let touched = self.objects.touch(&objects, setting)?;
            progress(&format!("exploring, {}", setting.name), done, settings.len());
            let planned = self.explore(&objects, setting)?;
            for (descriptor, [sampled, explored]) in TOP_DESCRIPTORS.iter().zip(&mut lines) {
                let name = descriptor.name();
                progress(&format!("{}, {name}", setting.name), done, settings.len());
                let appearance = self.objects.appearance(*descriptor);
                let tested = self.objects.test(&touched, setting, &appearance)?;
                rows(&mut report, setting, name, &objects, &tested.curve);
                sampled.push(line(&setting.name, &tested.curve));
                if let Some(planned) = &planned {
                    let curve = planned.report(&mut report, setting, name, &tested.model);
                    explored.push(line(&setting.name, &curve));
                }
            }
        }
        Ok(Outcome { report, plot: svg(&panels(lines)), pictures: Vec::new() })
    }
}

impl Planned {
    /// Adds the rows and the summary of a model on the explorations; the curve on readings drawn
    /// from them.
    pub fn report(
        &self,
        report: &mut Report,
        setting: &Setting,
        method: &str,
        model: &AppearanceModel,
    ) -> Vec<Point> {
        let curves = self.trials.curves(model, setting, &self.runs);
        report_curves(report, setting, method, &strategy(), &curves);
        curves.drawn
    }
}

/// The printed planner; global and local targets are equally likely.
fn strategy() -> Strategy {
    let (name, key) = ("planner".to_owned(), "explored".to_owned());
    Strategy { name, key, ..Strategy::printed(LOCAL) }
}

/// A panel for each descriptor, and one for its explored readings if there are any.
fn panels(lines: Vec<[Vec<Line>; 2]>) -> Vec<Panel> {
    let mut panels = Vec::new();
    for (descriptor, [sampled, explored]) in TOP_DESCRIPTORS.iter().zip(lines) {
        panels.push(panel(descriptor.name(), sampled));
        if !explored.is_empty() {
            panels.push(panel(&format!("{}, explored", descriptor.name()), explored));
        }
    }
    panels
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::object_trials;

    /// A run small enough for a test, with one exploration of each of ten objects.
    pub(crate) fn small() -> PlannerTrials {
        PlannerTrials { objects: object_trials::tests::small(), explorations: Some(1) }
    }
}
