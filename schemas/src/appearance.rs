//! Chapter 4 on the wire: training bags of features, and what held-back readings say of them.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::training::Descriptor;

/// What a training is to learn for the methods `appearance…`.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct AppearanceTraining {
    /// What is compared: the readings' images or the features that clients send with them;
    /// `images` when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<FeatureSource>,
    /// How an image becomes a feature; `mnti` when not given. Only with `images`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub descriptor: Option<Descriptor>,
    /// Principal components are kept until they hold this share of the features' variance,
    /// 0.5 to 1; 0.99 when not given (the dissertation: 0.9).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.5, maximum = 1.0)]
    pub variance_share: Option<f64>,
    /// How classes are found; `mixture` when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clustering: Option<ClusteringKind>,
    /// 1 to 10 candidates for the number of classes, each 2 to 400: the one that recognises
    /// the held-back readings best is taken. 48 alone when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(min_items = 1, max_items = 10, example = json!([24, 48, 96]))]
    pub n_classes: Option<Vec<u32>>,
    /// At most this many axes that tell the objects apart, 1 to 1000, after the principal
    /// components (beyond the dissertation); none when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 1000)]
    pub discriminant_axes: Option<u32>,
    /// How many held-back readings a trial of the report draws, 1 to 1000; 20 when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 1000)]
    pub report_readings: Option<u32>,
}

/// What features are made of.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FeatureSource {
    /// The images of readings, by a descriptor.
    #[default]
    Images,
    /// The `feature` that clients send with each reading: a code of their own.
    Features,
}

/// How classes of appearance are found.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq, ToSchema)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum ClusteringKind {
    /// A Gaussian mixture with full covariances.
    #[default]
    Mixture,
    /// A Gaussian mixture with one covariance for all classes: for few readings.
    SharedMixture,
    /// One Gaussian for each training object: for few readings of a large array.
    PerObject,
    /// k-means: a feature belongs to one class.
    KMeans,
}

/// What a training learnt of the objects' appearance, in short.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct AppearanceSummary {
    /// Names the vocabulary: versions with the same name share it, bit by bit.
    pub vocabulary: String,
    /// How many values a feature has after reduction.
    pub n_components: u32,
    /// How many classes there are.
    pub n_classes: u32,
    /// How many held-back readings each trial drew.
    pub n_readings: u32,
    /// Share of the trials whose likeliest object was the true one.
    pub accuracy: f64,
    /// What users should know, such as objects that are nearly the same.
    pub warnings: Vec<String>,
}

/// What held-back readings say of a version's appearance (figures 4.9 and 4.10). It never
/// changes. Rows and columns of the matrices are the `objects` in their order.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct AppearanceReport {
    /// The catalogue's name.
    pub catalogue: String,
    /// The version.
    pub version: u32,
    /// Names the vocabulary: versions with the same name share it, bit by bit.
    pub vocabulary: String,
    /// What features are made of.
    pub source: FeatureSource,
    /// How images become features; null with the clients' own.
    pub descriptor: Option<Descriptor>,
    /// How many values a feature has as it comes.
    pub feature_length: u32,
    /// How many values it has after reduction.
    pub n_components: u32,
    /// How many classes there are.
    pub n_classes: u32,
    /// The candidates for the number of classes, and how they did.
    pub candidates: Vec<ClassCandidate>,
    /// The power of the likelihoods that fits held-back readings best, 0.01 to 1: touches of
    /// one object are not independent.
    pub exponent: f64,
    /// How many held-back readings each trial drew.
    pub n_readings: u32,
    /// Share of the trials whose likeliest object was the true one.
    pub accuracy: f64,
    /// The objects.
    pub objects: Vec<ObjectAppearance>,
    /// Mean probability of each object (column) when the row's object was touched; a row of an
    /// object without held-back readings is all 0.
    pub confusion: Vec<Vec<f64>>,
    /// How alike the objects' histograms are, 0 to 1 (their cosine).
    pub affinity: Vec<Vec<f64>>,
    /// Pairs that touch can hardly tell apart, most alike first.
    pub near_duplicates: Vec<NearDuplicate>,
    /// The same in words, and what else users should know.
    pub warnings: Vec<String>,
}

/// How well a number of classes recognised the held-back readings.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ClassCandidate {
    /// How many classes.
    pub n_classes: u32,
    /// Share of the trials whose likeliest object was the true one.
    pub accuracy: f64,
    /// Mean probability of the true object: breaks ties.
    pub reliability: f64,
}

/// What is known of one object's appearance.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct ObjectAppearance {
    /// The object's id.
    pub id: Uuid,
    /// The object's name when it was trained.
    pub name: String,
    /// How many readings made its histogram.
    pub n_readings: u32,
    /// How many were held back.
    pub n_held_back: u32,
    /// How many of its readings fell into each class; shares count in part.
    pub histogram: Vec<f64>,
}

/// Two objects whose touches look nearly the same.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq, ToSchema)]
pub struct NearDuplicate {
    /// The name of the earlier object.
    pub first: String,
    /// The name of the later object.
    pub second: String,
    /// How alike their histograms are, 0 to 1.
    pub affinity: f64,
}
