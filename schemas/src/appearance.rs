//! Appearance on the wire (chapter 4): training bags of features, and the report on held-back
//! readings.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::descriptor::Descriptor;

/// Training options of the methods `appearance…`.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AppearanceTraining {
    /// What is compared: images of readings, or features that clients send. Default: `images`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<FeatureSource>,
    /// Descriptor that turns an image into a feature. Only with `images`. Default: `mnti`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub descriptor: Option<Descriptor>,
    /// Share of the features' variance that the kept principal components hold, 0.5 to 1. Default:
    /// 0.99 (the dissertation: 0.9).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.5, maximum = 1.0)]
    pub variance_share: Option<f64>,
    /// Clustering method for the appearance classes. Default: `mixture`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clustering: Option<ClusteringKind>,
    /// 1 to 10 candidates for the number of classes, each 2 to 400. The candidate that recognises
    /// the held-back readings best wins. Default: 48 alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 10, example = json!([24, 48, 96]))]
    pub n_classes: Option<Vec<u32>>,
    /// Maximum number of discriminant axes after the principal components, 1 to 1000 (beyond the
    /// dissertation). Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 1000)]
    pub discriminant_axes: Option<u32>,
    /// Number of held-back readings in each trial of the report, 1 to 1000. Default: 20.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 1000)]
    pub report_readings: Option<u32>,
}

/// Source of the features.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FeatureSource {
    /// Images of readings, through a descriptor.
    #[default]
    Images,
    /// The `feature` that clients send with each reading: their own code.
    Features,
}

/// Clustering method for the appearance classes.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum ClusteringKind {
    /// A Gaussian mixture with full covariances.
    #[default]
    Mixture,
    /// A Gaussian mixture with one covariance for all classes; for few readings.
    SharedMixture,
    /// One Gaussian per training object; for few readings of a large array.
    PerObject,
    /// k-means: each feature belongs to one class.
    KMeans,
}

/// Summary of the appearance part of a training.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct AppearanceSummary {
    /// Identifier of the vocabulary. Versions with the same identifier share it bit for bit.
    pub vocabulary: String,
    /// Number of feature components after reduction.
    pub n_components: u32,
    /// Number of appearance classes.
    pub n_classes: u32,
    /// Number of held-back readings in each trial.
    pub n_readings: u32,
    /// Share of trials in which the likeliest object was the true one.
    pub accuracy: f64,
    /// Warnings for users, such as objects that are nearly identical.
    pub warnings: Vec<String>,
}

/// Appearance report of a version, computed on held-back readings (figures 4.9 and 4.10). It never
/// changes. Rows and columns of the matrices follow the order of `objects`.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct AppearanceReport {
    /// The catalogue's name.
    pub catalogue: String,
    /// Number of the version.
    pub version: u32,
    /// Identifier of the vocabulary. Versions with the same identifier share it bit for bit.
    pub vocabulary: String,
    /// Source of the features.
    pub source: FeatureSource,
    /// Descriptor that turns images into features; null with features of clients.
    pub descriptor: Option<Descriptor>,
    /// Number of feature components before reduction.
    pub feature_length: u32,
    /// Number of feature components after reduction.
    pub n_components: u32,
    /// Number of appearance classes.
    pub n_classes: u32,
    /// Accuracy of each candidate for the number of classes.
    pub candidates: Vec<ClassCandidate>,
    /// Exponent on the likelihoods that fits the held-back readings best, 0.01 to 1. It accounts
    /// for the dependence between touches of one object.
    pub exponent: f64,
    /// Number of held-back readings in each trial.
    pub n_readings: u32,
    /// Share of trials in which the likeliest object was the true one.
    pub accuracy: f64,
    /// The objects.
    pub objects: Vec<ObjectAppearance>,
    /// Confusion matrix: mean probability of each object (column) when the row's object was
    /// touched. The row of an object without held-back readings is all 0.
    pub confusion: Vec<Vec<f64>>,
    /// Cosine similarity of the objects' histograms, 0 to 1.
    pub affinity: Vec<Vec<f64>>,
    /// Object pairs that touch barely separates, most similar first.
    pub near_duplicates: Vec<NearDuplicate>,
    /// The near duplicates in words, and other warnings for users.
    pub warnings: Vec<String>,
}

/// Accuracy of one number of classes on the held-back readings.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ClassCandidate {
    /// Number of appearance classes.
    pub n_classes: u32,
    /// Share of trials in which the likeliest object was the true one.
    pub accuracy: f64,
    /// Mean probability of the true object; breaks ties.
    pub reliability: f64,
}

/// Appearance of one object.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ObjectAppearance {
    /// The object's id.
    pub id: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// Number of readings in the histogram.
    pub n_readings: u32,
    /// Number of held-back readings.
    pub n_held_back: u32,
    /// Number of readings in each class; soft assignments count in part.
    pub histogram: Vec<f64>,
}

/// Two objects whose touches look nearly the same.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct NearDuplicate {
    /// The name of the earlier object.
    pub first: String,
    /// The name of the later object.
    pub second: String,
    /// Cosine similarity of their histograms, 0 to 1.
    pub affinity: f64,
}
