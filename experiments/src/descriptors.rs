//! Figure 4.8 again: every descriptor on ten objects, accuracy against readings.
//!
//! All descriptors see the same readings of the 6 × 6 sensor under 0.10 inch: held-back ones of
//! the sampler, and those of the exploring planner, on which the dissertation tests. This project adds
//! a reduction by discriminant axes, and the printed share of 90 % of the variance. Confusion
//! and affinity (figures 4.9, 4.10) are rows of the report; `appearance_rules` draws them.

use palpate_core::descriptor::DescriptorKind;
use palpate_dissertation::appearance::train::{AppearanceConfig, DiscriminantConfig};
use palpate_sim::plot::svg;
use serde::Serialize;

use crate::appearance_trials::{Point, accuracy_at, line};
use crate::object_trials::{ObjectTrials, Setting, Tested, panel, rows};
use crate::objects::TestObject;
use crate::planner_trials::PlannerTrials;
use crate::report::{Outcome, Progress, Report};

/// The count at which descriptors are compared.
const COMPARED_AT: usize = 20;

/// Descriptors of the figure's upper half, and related ones.
const UPPER: [DescriptorKind; 6] = [
    DescriptorKind::Mnti,
    DescriptorKind::PolarFourier,
    DescriptorKind::PolarFourierRw,
    DescriptorKind::PolarFourierNi,
    DescriptorKind::MomentNormalized,
    DescriptorKind::PolarFourierSigned,
];

/// Descriptors of the figure's lower half, and the controls.
const LOWER: [DescriptorKind; 6] = [
    DescriptorKind::Vectorize,
    DescriptorKind::Sift,
    DescriptorKind::Mr8,
    DescriptorKind::Steerable,
    DescriptorKind::Schmid,
    DescriptorKind::PolarSpectrum,
];

/// Runs the experiment.
///
/// # Errors
/// When objects cannot be read, touched or learnt.
pub fn run(config: &PlannerTrials, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let objects = config.objects.objects()?;
    let setting = Setting::printed("6×6, 0.10 inch");
    progress("touching objects", 0, 1);
    let touched = config.objects.touch(&objects, &setting)?;
    progress("exploring objects", 0, 1);
    let planned = config.explore(&objects, &setting)?;
    let mut report = Report::default();
    let mut curves: Vec<(String, Vec<Point>)> = Vec::new();
    let methods = methods(&config.objects);
    let mut explored: Vec<(String, Vec<Point>)> = Vec::new();
    for (done, (name, appearance)) in methods.iter().enumerate() {
        progress(name, done, methods.len());
        let tested = config.objects.test(&touched, &setting, appearance)?;
        rows(&mut report, &setting, name, &objects, &tested.curve);
        if shows_matrices(name) {
            matrices(&mut report, name, &objects, &tested);
        }
        if let Some(planned) = &planned {
            let curve = planned.report(&mut report, &setting, name, &tested.model);
            explored.push((name.clone(), curve));
        }
        curves.push((name.clone(), tested.curve));
    }
    best(&mut report, &curves);
    let lines_of = |curves: &[(String, Vec<Point>)], names: &[&str]| {
        let chosen = curves.iter().filter(|(name, _)| names.contains(&name.as_str()));
        chosen.map(|(name, curve)| line(name, curve)).collect()
    };
    let lines = |names: &[&str]| lines_of(&curves, names);
    let mut panels = vec![
        panel("the better half", lines(&UPPER.map(DescriptorKind::name))),
        panel("the other half", lines(&LOWER.map(DescriptorKind::name))),
        panel("beyond print", lines(&OPTIONS)),
    ];
    if planned.is_some() {
        for (title, half) in [("better", UPPER), ("other", LOWER)] {
            let lines = lines_of(&explored, &half.map(DescriptorKind::name));
            panels.push(panel(&format!("the {title} half, explored"), lines));
        }
    }
    Ok(Outcome { report, plot: svg(&panels), pictures: Vec::new() })
}

/// Options compared on MNTI and Polar-Fourier.
const OPTIONS: [&str; 6] = [
    "mnti",
    "mnti_90_percent",
    "mnti_discriminant",
    "polar_fourier",
    "polar_fourier_90_percent",
    "polar_fourier_discriminant",
];

/// Every descriptor by its name, and the options.
fn methods(config: &ObjectTrials) -> Vec<(String, AppearanceConfig)> {
    let plain = |kind: DescriptorKind| (kind.name().to_owned(), config.appearance(kind));
    let mut methods: Vec<_> = UPPER.into_iter().chain(LOWER).map(plain).collect();
    for kind in [DescriptorKind::Mnti, DescriptorKind::PolarFourier] {
        let printed = AppearanceConfig { variance_share: 0.9, ..config.appearance(kind) };
        methods.push((format!("{}_90_percent", kind.name()), printed));
        let discriminant = Some(DiscriminantConfig { n_axes: 8, shrinkage: 0.01 });
        let option = AppearanceConfig { discriminant, ..config.appearance(kind) };
        methods.push((format!("{}_discriminant", kind.name()), option));
    }
    methods
}

/// Figures 4.9 and 4.10 show MNTI and Polar-Fourier.
fn shows_matrices(name: &str) -> bool {
    [DescriptorKind::Mnti, DescriptorKind::PolarFourier].iter().any(|kind| kind.name() == name)
}

/// Adds the best of the dissertation's descriptors, and the best of all methods, to the summary.
fn best(report: &mut Report, curves: &[(String, Vec<Point>)]) {
    let best_of = |all: &dyn Fn(&str) -> bool| {
        let at = |curve: &[Point]| accuracy_at(curve, COMPARED_AT);
        let accuracies = curves.iter().filter(|(name, _)| all(name)).filter_map(|(_, c)| at(c));
        accuracies.fold(f64::NAN, f64::max)
    };
    let printed = |name: &str| !OPTIONS.contains(&name) || !name.contains("_discriminant");
    let ours = |name: &str| name.contains("signed") || name == DescriptorKind::PolarSpectrum.name();
    report.summarise("best_accuracy_at_20", best_of(&|_| true));
    report.summarise("best_printed_accuracy_at_20", best_of(&|n| printed(n) && !ours(n)));
}

#[derive(Serialize)]
struct Pair {
    readings: usize,
    probability: f64,
    affinity: f64,
}

/// Confusion (mean probability after the report's readings) and affinity, a row a pair.
fn matrices(report: &mut Report, name: &str, objects: &[TestObject], tested: &Tested) {
    let model = &tested.model.report;
    for (truth, (confusion, affinity)) in model.confusion.iter().zip(&model.affinity).enumerate() {
        for (named, (probability, affinity)) in confusion.iter().zip(affinity).enumerate() {
            report.labelled(
                &[
                    ("method", name),
                    ("object", &objects[truth].name),
                    ("confused_with", &objects[named].name),
                ],
                Pair { readings: model.n_readings, probability: *probability, affinity: *affinity },
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner_trials::tests::small;

    #[test]
    fn a_small_run_compares_every_descriptor() {
        let outcome = run(&small(), &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        for kind in DescriptorKind::ALL {
            assert!(summary.contains_key(&format!("{}_accuracy_at_20", kind.name())), "{kind:?}");
            let explored = format!("{}_explored_accuracy_at_20", kind.name());
            assert!(summary.contains_key(&explored), "{kind:?}");
        }
        assert!(summary["best_accuracy_at_20"] > 0.6, "{summary:?}");
        assert!(summary["best_printed_accuracy_at_20"] <= summary["best_accuracy_at_20"]);
        assert_eq!(outcome.plot.matches("<polyline").count(), 18 + 12);
    }
}
