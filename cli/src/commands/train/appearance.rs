//! `palpate train`: appearance options and their results.

use clap::Args;
use palpate_client::schemas::{
    AppearanceSummary, AppearanceTraining, ClusteringKind, Descriptor, FeatureSource,
};

/// Appearance options.
#[derive(Debug, Args)]
#[group(multiple = true)]
pub(super) struct AppearanceArgs {
    /// Also learn appearance classes, for the methods `appearance…`.
    #[arg(long)]
    appearance: bool,
    /// Descriptor for these classes [default: mnti].
    #[arg(long, value_enum, requires = "appearance", conflicts_with = "features")]
    appearance_descriptor: Option<Descriptor>,
    /// Compare the features that clients send with their readings instead of images.
    #[arg(long, requires = "appearance")]
    features: bool,
    /// Candidates for the number of classes; held-back readings choose [default: 48].
    #[arg(long, requires = "appearance", value_delimiter = ',',
        value_parser = clap::value_parser!(u32).range(2..=400))]
    appearance_classes: Vec<u32>,
    /// Share of the features' variance to keep, 0.5 to 1 [default: 0.99].
    #[arg(long, requires = "appearance")]
    variance_share: Option<f64>,
    /// Clustering method for these classes [default: mixture].
    #[arg(long, value_enum, requires = "appearance")]
    clustering: Option<ClusteringKind>,
    /// Maximum number of discriminant axes after the principal components.
    #[arg(long, requires = "appearance", value_parser = clap::value_parser!(u32).range(1..=1000))]
    discriminant_axes: Option<u32>,
    /// Learn nothing else: for readings without poses.
    #[arg(long, requires = "appearance", conflicts_with = "geometric")]
    pub(super) no_sva: bool,
}

impl AppearanceArgs {
    /// The appearance part of the request; `None` if not requested.
    pub(super) fn wire(&self) -> Option<AppearanceTraining> {
        if !self.appearance {
            return None;
        }
        let classes = &self.appearance_classes;
        Some(AppearanceTraining {
            source: self.features.then_some(FeatureSource::Features),
            descriptor: self.appearance_descriptor,
            variance_share: self.variance_share,
            clustering: self.clustering,
            n_classes: (!classes.is_empty()).then(|| classes.clone()),
            discriminant_axes: self.discriminant_axes,
            report_readings: None,
        })
    }
}

/// The appearance part of the result, as lines.
pub(super) fn appearance_words(summary: &AppearanceSummary) -> String {
    let warnings = summary.warnings.iter().map(|warning| format!("\nwarning: {warning}"));
    format!(
        "\nappearance: {} classes of {} values, {:.1} % right after {} held-back readings{}",
        summary.n_classes,
        summary.n_components,
        summary.accuracy * 100.0,
        summary.n_readings,
        warnings.collect::<String>()
    )
}
