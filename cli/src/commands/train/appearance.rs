//! `palpate train`: appearance options and their results.

use clap::{Args, ValueEnum};
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
    appearance_descriptor: Option<DescriptorName>,
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
    clustering: Option<Clustering>,
    /// Maximum number of discriminant axes after the principal components.
    #[arg(long, requires = "appearance", value_parser = clap::value_parser!(u32).range(1..=1000))]
    discriminant_axes: Option<u32>,
    /// Learn nothing else: for readings without poses.
    #[arg(long, requires = "appearance", conflicts_with = "geometric")]
    pub(super) no_sva: bool,
}

/// Clustering method.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Clustering {
    /// A Gaussian mixture.
    Mixture,
    /// A Gaussian mixture with one covariance: for few readings.
    SharedMixture,
    /// One Gaussian for each training object: for few readings of a large array.
    PerObject,
    /// k-means.
    KMeans,
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
            descriptor: self.appearance_descriptor.map(DescriptorName::wire),
            variance_share: self.variance_share,
            clustering: self.clustering.map(|clustering| match clustering {
                Clustering::Mixture => ClusteringKind::Mixture,
                Clustering::SharedMixture => ClusteringKind::SharedMixture,
                Clustering::PerObject => ClusteringKind::PerObject,
                Clustering::KMeans => ClusteringKind::KMeans,
            }),
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

/// Descriptors, by their names on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub(super) enum DescriptorName {
    Vectorize,
    Sift,
    Mr8,
    MomentNormalized,
    PolarFourier,
    PolarFourierRw,
    PolarFourierNi,
    PolarFourierSigned,
    Mnti,
    Steerable,
    Schmid,
    PolarSpectrum,
}

impl DescriptorName {
    pub(super) fn wire(self) -> Descriptor {
        match self {
            Self::Vectorize => Descriptor::Vectorize,
            Self::Sift => Descriptor::Sift,
            Self::Mr8 => Descriptor::Mr8,
            Self::MomentNormalized => Descriptor::MomentNormalized,
            Self::PolarFourier => Descriptor::PolarFourier,
            Self::PolarFourierRw => Descriptor::PolarFourierRw,
            Self::PolarFourierNi => Descriptor::PolarFourierNi,
            Self::PolarFourierSigned => Descriptor::PolarFourierSigned,
            Self::Mnti => Descriptor::Mnti,
            Self::Steerable => Descriptor::Steerable,
            Self::Schmid => Descriptor::Schmid,
            Self::PolarSpectrum => Descriptor::PolarSpectrum,
        }
    }
}
