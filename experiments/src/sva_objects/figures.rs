//! Plots of `sva-objects`, and the trials that stay wrong.

use palpate_sim::plot::{Line, Panel};

use super::{Method, PoseError, Step, SvaObjects, at};
use crate::objects::TestObject;
use crate::played::Wrong;
use crate::report::Report;

/// One row for each trial that is still wrong after ten readings or at the end.
pub(super) fn report_confusions(
    report: &mut Report,
    config: &SvaObjects,
    objects: &[TestObject],
    methods: &[Method],
    steps: &[Step],
) {
    let late = [10, config.readings];
    for step in steps.iter().filter(|s| late.contains(&s.readings) && s.named != s.object) {
        report.labelled(
            &[
                ("method", methods[step.method].name),
                ("object", &objects[step.object].name),
                ("confused_with", &objects[step.named].name),
            ],
            Wrong {
                readings: step.readings,
                trial: step.trial,
                stated_probability: step.probability,
            },
        );
    }
}

pub(super) fn panel(
    config: &SvaObjects,
    methods: &[Method],
    steps: &[Step],
    title: &str,
    y: &str,
    value: impl Fn(&[f64], &[PoseError]) -> f64,
) -> Panel {
    let line = |(index, method): (usize, &Method)| Line {
        name: method.name.to_owned(),
        points: (1..=config.readings)
            .map(|readings| {
                let (right, errors) = at(steps, index, readings);
                (readings as f64, value(&right, &errors))
            })
            .collect(),
    };
    Panel {
        title: title.to_owned(),
        x: "readings".to_owned(),
        y: y.to_owned(),
        lines: methods.iter().enumerate().map(line).collect(),
    }
}
