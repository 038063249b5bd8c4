//! Section 4.3.1.2 and 4.4.2.1 again: how classes are made, and how histograms are compared.
//!
//! Readings of ten objects are classified by k-means and by a mixture of as many classes. A trial
//! draws readings of one object without replacement; the histogram of their classes is compared
//! with those of all objects by every rule of `compare`, and the nearest object is named. Equation
//! 4.17 as printed, which sums joint densities, is a rule of the mixture alone. Classes as images
//! (figure 4.7), confusion and affinity (4.9, 4.10) are drawn in `pictures`.

mod compare;
mod pictures;

use palpate_core::contact::touches;
use palpate_core::descriptor::DescriptorKind;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;
use palpate_dissertation::appearance::model::AppearanceModel;
use palpate_dissertation::appearance::train::{AppearanceConfig, ClusteringMethod};
use palpate_sim::plot::svg;
use rayon::prelude::*;

use crate::appearance_trials::{line, train_with_vocabulary_of};
use crate::object_trials::{ObjectTrials, Setting, panel};
use crate::report::{Outcome, Progress, Report};
use compare::{Comparison, Known, Rule, Seen};

/// The descriptors whose histograms are compared.
const DESCRIPTORS: [DescriptorKind; 3] =
    [DescriptorKind::PolarFourier, DescriptorKind::Mnti, DescriptorKind::MomentNormalized];

/// Counts of readings after which objects are named.
const COUNTS: [usize; 8] = [1, 2, 5, 10, 20, 40, 60, 100];

/// Counts that the summary states.
const STATED_AT: [usize; 3] = [5, 20, 60];

/// Runs the experiment.
///
/// # Errors
/// When objects cannot be read, touched or learnt.
pub fn run(config: &ObjectTrials, progress: Progress<'_>) -> anyhow::Result<Outcome> {
    let objects = config.objects()?;
    let setting = Setting::printed("6×6, 0.10 inch");
    progress("touching objects", 0, 1);
    let touched = config.touch(&objects, &setting)?;
    let (mut report, mut panels, mut pictures) = (Report::default(), Vec::new(), Vec::new());
    let methods = [("mixture", ClusteringMethod::Mixture), ("k_means", ClusteringMethod::KMeans)];
    for (done, descriptor) in DESCRIPTORS.into_iter().enumerate() {
        let mut lines = Vec::new();
        for (clustering_name, clustering) in methods {
            progress(&format!("{}, {clustering_name}", descriptor.name()), done, DESCRIPTORS.len());
            let appearance = AppearanceConfig { clustering, ..config.appearance(descriptor) };
            let model = train_with_vocabulary_of(
                config.vocabulary_readings,
                &touched.training,
                &setting.sensor,
                &appearance,
                config.seed,
            )?;
            if clustering == ClusteringMethod::Mixture {
                pictures.push(pictures::of(descriptor, &objects, &model)?);
            }
            let comparison = Comparison {
                known: Known::new(&model),
                seen: seen(&model, &touched.test, &setting.sensor),
            };
            for rule in Rule::ALL {
                if rule == Rule::LiteralJoint && clustering == ClusteringMethod::KMeans {
                    continue;
                }
                let name = format!("{}_{clustering_name}_{}", descriptor.name(), rule.name());
                let points = comparison.accuracies(rule, &COUNTS, config.trials, config.seed);
                for point in &points {
                    report.labelled(&[("method", &name)], point);
                }
                for point in points.iter().filter(|point| STATED_AT.contains(&point.readings)) {
                    let key = format!("{name}_accuracy_at_{}", point.readings);
                    report.summarise(&key, point.accuracy);
                    let key = format!("{name}_standard_error_at_{}", point.readings);
                    report.summarise(&key, point.standard_error);
                }
                if clustering == ClusteringMethod::Mixture || rule == Rule::Divergence {
                    lines.push(line(&format!("{clustering_name}, {}", rule.name()), &points));
                }
            }
        }
        panels.push(panel(descriptor.name(), lines));
    }
    Ok(Outcome { report, plot: svg(&panels), pictures })
}

/// The test readings in a model's classes, one list an object; presses without contact are left
/// out.
fn seen(
    model: &AppearanceModel,
    readings: &[Vec<Reading>],
    sensor: &SensorDescription,
) -> Vec<Vec<Seen>> {
    let of_reading = |reading: &Reading| {
        let touching = touches(reading, sensor).then(|| reading.image());
        let features = model.vocabulary.describe(touching?)?;
        let feature = model.vocabulary.reduce(features.row(0));
        let clustering = &model.vocabulary.clustering;
        Some(Seen { shares: clustering.shares(&feature), joint: clustering.log_joint(&feature) })
    };
    let of_object = |readings: &Vec<Reading>| readings.iter().filter_map(of_reading).collect();
    readings.par_iter().map(of_object).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object_trials::tests::small;

    #[test]
    fn a_small_run_compares_every_rule_and_both_clusterings() {
        let outcome = run(&small(), &|_, _, _| ()).unwrap();
        let summary = &outcome.report.summary;
        for rule in Rule::ALL {
            let key = format!("polar_fourier_mixture_{}_accuracy_at_20", rule.name());
            let accuracy = summary[&key];
            assert!((0.1..=1.0).contains(&accuracy), "{key}: {accuracy}");
        }
        assert!(summary["polar_fourier_mixture_divergence_accuracy_at_20"] > 0.6, "{summary:?}");
        assert!(summary["mnti_k_means_chi_squared_accuracy_at_20"] > 0.3, "{summary:?}");
        assert_eq!(outcome.pictures.len(), 3);
        assert!(!summary.contains_key("mnti_k_means_literal_joint_accuracy_at_20"));
    }
}
