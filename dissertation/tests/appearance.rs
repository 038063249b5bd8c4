//! Recognition by appearance on analytic touches, without a simulator or poses.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::ops::ControlFlow;
use std::sync::Arc;

use palpate_core::belief::MismatchError;
use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::training::TrainingSet;
use palpate_dissertation::appearance::model::{AppearanceModel, AppearanceRule};
use palpate_dissertation::appearance::train::{
    AppearanceConfig, AppearanceSet, AppearanceTrainError, ClusteringMethod, DiscriminantConfig,
    appearance_model, learn_appearance_vocabulary, learn_appearance_vocabulary_with_progress,
    object_histogram,
};
use palpate_dissertation::appearance::{
    AppearanceBelief, AppearanceError, AppearanceOptions, Exponent,
};

/// Probabilities of a point, an edge and a plane in touches of the three objects.
const KINDS: [[f64; 3]; 3] = [[0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6]];

/// A touch: a blob whose two widths (taxels) are those of its kind, within a few per cent.
fn touch(kinds: [f64; 3], stream: &mut Stream) -> Reading {
    let drawn = stream.uniform(0.0, 1.0);
    let (width, height) = if drawn < kinds[0] {
        (0.8, 0.8)
    } else if drawn < kinds[0] + kinds[1] {
        (4.0, 0.8)
    } else {
        (4.0, 4.0)
    };
    let spread = stream.uniform(0.9, 1.1);
    let angle = stream.uniform(0.0, std::f64::consts::TAU);
    let (sin, cos) = angle.sin_cos();
    let pressures: Vec<Option<f64>> = (0..36)
        .map(|taxel| {
            let (x, y) = (f64::from(taxel % 6) - 2.5, f64::from(taxel / 6) - 2.5);
            let (u, v) = ((cos * x + sin * y) / width, (cos * y - sin * x) / height);
            Some(12_000.0 * (-0.5 * (u * u + v * v) / spread).exp() + 40.0 * stream.normal())
        })
        .collect();
    // Poses are not used: each touch has another one, as if the object moved.
    let pose = Pose::from_parts(stream.rotation(), stream.direction());
    Reading::new(SensorId(0), &SensorDescription::digitacts_6x6(), &pressures, pose).unwrap()
}

fn touches(kinds: [f64; 3], n: usize, seed: u64) -> Vec<Reading> {
    let mut stream = Stream::new(seed, Purpose::Sampling, (1_000.0 * kinds[0]) as u64);
    (0..n).map(|_| touch(kinds, &mut stream)).collect()
}

fn config() -> AppearanceConfig {
    AppearanceConfig { n_classes: vec![8], n_starts: 2, ..AppearanceConfig::default() }
}

fn learn(config: &AppearanceConfig, kinds: &[[f64; 3]]) -> AppearanceModel {
    let sensor = SensorDescription::digitacts_6x6();
    let readings: Vec<Vec<Reading>> =
        kinds.iter().zip(1..).map(|(kinds, seed)| touches(*kinds, 250, seed)).collect();
    let sets: Vec<AppearanceSet<'_>> = readings
        .iter()
        .map(|readings| AppearanceSet::Readings(TrainingSet { readings, sensor: &sensor }))
        .collect();
    let vocabulary = Arc::new(learn_appearance_vocabulary(&sets, config, 1).unwrap());
    let objects = sets
        .iter()
        .map(|set| Arc::new(object_histogram(set, &vocabulary, config).unwrap()))
        .collect();
    appearance_model(vocabulary, objects, config, 1)
}

fn believe(
    model: &Arc<AppearanceModel>,
    options: AppearanceOptions,
    readings: &[Reading],
) -> AppearanceBelief {
    let mut belief = AppearanceBelief::new(model.clone(), options, None).unwrap();
    for reading in readings {
        belief.add(reading, &SensorDescription::digitacts_6x6()).unwrap();
    }
    belief
}

#[test]
fn unseen_touches_without_poses_name_the_object() {
    let methods = [
        (ClusteringMethod::Mixture, None),
        (ClusteringMethod::SharedMixture, None),
        (ClusteringMethod::KMeans, None),
        (ClusteringMethod::PerObject, None),
        (ClusteringMethod::PerObject, Some(DiscriminantConfig { n_axes: 5, shrinkage: 0.1 })),
        (ClusteringMethod::Mixture, Some(DiscriminantConfig { n_axes: 5, shrinkage: 0.1 })),
    ];
    for (clustering, discriminant) in methods {
        let model = learn(&AppearanceConfig { clustering, discriminant, ..config() }, &KINDS);
        assert!(model.report.accuracy > 0.9, "{:?}", model.report);
        let model = Arc::new(model);
        let rule = AppearanceRule::Mixture;
        let mixture = AppearanceOptions { rule, exponent: Exponent::Calibrated };
        for options in [AppearanceOptions::default(), mixture, AppearanceOptions::literal()] {
            for (object, kinds) in KINDS.iter().enumerate() {
                let answer = believe(&model, options, &touches(*kinds, 40, 77)).answer();
                assert_eq!(answer.best_object(), Some(ObjectIdx(object as u32)), "{answer:?}");
                assert!(answer.modes.is_empty());
                assert_eq!(answer.n_readings, 40);
            }
        }
    }
}

#[test]
fn the_order_of_readings_does_not_change_a_bit() {
    let model = Arc::new(learn(&config(), &KINDS));
    let readings = touches(KINDS[1], 25, 5);
    for rule in [AppearanceRule::Mixture, AppearanceRule::Divergence, AppearanceRule::LiteralJoint]
    {
        let options = AppearanceOptions { rule, exponent: Exponent::Fixed(0.3) };
        let given = believe(&model, options, &readings).answer();
        let mut shuffled = readings.clone();
        let mut stream = Stream::new(3, Purpose::ReadingChoice, 0);
        for _shuffle in 0..5 {
            for place in (1..shuffled.len()).rev() {
                shuffled.swap(place, stream.index(place + 1));
            }
            assert_eq!(believe(&model, options, &shuffled).answer(), given, "{rule:?}");
        }
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| learn(&config(), &KINDS))
    };
    assert_eq!(with(1), with(4));
}

#[test]
fn a_press_without_contact_counts_without_evidence() {
    let model = Arc::new(learn(&config(), &KINDS));
    let readings = touches(KINDS[2], 5, 6);
    let mut belief = believe(&model, AppearanceOptions::default(), &readings);
    let before = belief.answer();
    let sensor = SensorDescription::digitacts_6x6();
    let nothing = Reading::new(SensorId(0), &sensor, &[Some(0.0); 36], Pose::IDENTITY).unwrap();
    belief.add(&nothing, &sensor).unwrap();
    assert_eq!(belief.answer().probabilities, before.probabilities);
    assert_eq!(belief.n_readings(), 6);
}

#[test]
fn before_any_reading_the_prior_is_the_answer() {
    let model = Arc::new(learn(&config(), &KINDS));
    for options in [AppearanceOptions::default(), AppearanceOptions::literal_joint()] {
        let belief = AppearanceBelief::new(model.clone(), options, Some(&[1.0, 3.0, 0.0])).unwrap();
        let found = belief.answer().probabilities;
        for (found, expected) in found.iter().zip([0.25, 0.75, 0.0]) {
            assert!((found - expected).abs() < 1e-12);
        }
    }
    let wrong = AppearanceBelief::new(model.clone(), AppearanceOptions::default(), Some(&[1.0]));
    let expected = MismatchError::Prior { expected: 3, found: 1 };
    assert_eq!(wrong.err(), Some(AppearanceError::Recognise(expected)));
}

#[test]
fn calibration_is_never_more_certain_than_print() {
    let model = learn(&config(), &KINDS);
    assert!((0.01..=1.0).contains(&model.exponent));
    let model = Arc::new(model);
    let readings = touches(KINDS[0], 30, 8);
    let calibrated = believe(&model, AppearanceOptions::default(), &readings).answer();
    let printed = believe(&model, AppearanceOptions::literal(), &readings).answer();
    assert!(calibrated.entropy_bits >= printed.entropy_bits);
}

#[test]
fn the_validation_readings_choose_the_number_of_classes() {
    // One class carries no information; six separate the kinds.
    let model = learn(&AppearanceConfig { n_classes: vec![1, 6], ..config() }, &KINDS);
    assert_eq!(model.vocabulary.n_classes(), 6);
    let [one, six] = model.vocabulary.choices[..] else { panic!("two candidates") };
    assert_eq!((one.n_classes, six.n_classes), (1, 6));
    assert!(one.accuracy < 0.01 && six.accuracy > 0.9, "{one:?} {six:?}");
    assert!((one.reliability - 1.0 / 3.0).abs() < 1e-9);
}

#[test]
fn learning_stops_on_request() {
    let sensor = SensorDescription::digitacts_6x6();
    let readings = touches(KINDS[0], 120, 1);
    let sets = [AppearanceSet::Readings(TrainingSet { readings: &readings, sensor: &sensor })];
    for clustering in [ClusteringMethod::Mixture, ClusteringMethod::KMeans] {
        let config = AppearanceConfig { n_classes: vec![2, 3], clustering, ..config() };
        let stop_at = |last: usize| {
            let progress = move |n_done: usize| {
                if n_done < last { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            };
            learn_appearance_vocabulary_with_progress(&sets, &config, 1, &progress)
        };
        assert_eq!(stop_at(0).err(), Some(AppearanceTrainError::Stopped));
        assert_eq!(stop_at(1).err(), Some(AppearanceTrainError::Stopped));
        let finished = stop_at(2).unwrap();
        assert_eq!(finished, learn_appearance_vocabulary(&sets, &config, 1).unwrap());
    }
}

#[test]
fn an_object_joins_without_changes_and_twins_are_reported() {
    let sensor = SensorDescription::digitacts_6x6();
    let model = learn(&config(), &KINDS);
    assert_eq!(model.report.near_duplicates, []);
    let readings = touches(KINDS[1], 400, 31);
    let set = AppearanceSet::Readings(TrainingSet { readings: &readings, sensor: &sensor });
    let twin = object_histogram(&set, &model.vocabulary, &config()).unwrap();
    assert!((twin.histogram.total() - 320.0).abs() < 1e-9); // a fifth is held back
    let mut objects = model.objects.clone();
    objects.push(Arc::new(twin));
    let joined = appearance_model(model.vocabulary.clone(), objects, &config(), 1);
    assert_eq!(joined.objects[..3], model.objects[..]);
    let pair = joined.report.near_duplicates[0];
    assert_eq!((pair.first, pair.second), (ObjectIdx(1), ObjectIdx(3)));
    assert!(pair.affinity > 0.95);
    // Twins share the probability of each other's touches.
    assert!(joined.report.confusion[1][3] > 0.2 && joined.report.confusion[0][3] < 0.2);
}

#[test]
fn clients_features_use_the_same_machinery() {
    let feature = |object: usize, stream: &mut Stream| -> Vec<f64> {
        (0..4).map(|axis| if axis == object { 1.0 } else { 0.0 } + 0.4 * stream.normal()).collect()
    };
    let features: Vec<Vec<Vec<f64>>> = (0..3)
        .map(|object| {
            let mut stream = Stream::new(object as u64, Purpose::Shape, 0);
            (0..150).map(|_| feature(object, &mut stream)).collect()
        })
        .collect();
    let sets: Vec<AppearanceSet<'_>> =
        features.iter().map(|features| AppearanceSet::Features(features)).collect();
    let vocabulary = Arc::new(learn_appearance_vocabulary(&sets, &config(), 1).unwrap());
    let objects = sets
        .iter()
        .map(|set| Arc::new(object_histogram(set, &vocabulary, &config()).unwrap()))
        .collect();
    let model = Arc::new(appearance_model(vocabulary, objects, &config(), 1));
    let mut belief =
        AppearanceBelief::new(model.clone(), AppearanceOptions::default(), None).unwrap();
    let mut stream = Stream::new(50, Purpose::Shape, 0);
    for _reading in 0..8 {
        belief.add_feature(&feature(2, &mut stream)).unwrap();
    }
    assert_eq!(belief.answer().best_object(), Some(ObjectIdx(2)));
    let short = belief.add_feature(&[1.0]);
    assert_eq!(short, Err(AppearanceError::Feature { expected: 4, found: 1 }));
    let image = belief.add(&touches(KINDS[0], 1, 1)[0], &SensorDescription::digitacts_6x6());
    assert_eq!(image, Err(AppearanceError::FeatureExpected { dimension: 4 }));
}

#[test]
fn mismatched_inputs_are_refused_by_name() {
    let sensor = SensorDescription::digitacts_6x6();
    let readings = touches(KINDS[0], 30, 1);
    let sets = [AppearanceSet::Readings(TrainingSet { readings: &readings, sensor: &sensor })];
    let refused = |config: AppearanceConfig| {
        learn_appearance_vocabulary(&sets, &config, 1).err().map(|error| error.to_string())
    };
    let zero = refused(AppearanceConfig { variance_share: 0.0, ..config() });
    assert_eq!(zero.as_deref(), Some("variance_share is 0, expected 0.01 to 1"));
    let none = refused(AppearanceConfig { n_classes: Vec::new(), ..config() });
    assert_eq!(none.as_deref(), Some("n_classes is empty, expected at least one candidate"));
    let nothing = learn_appearance_vocabulary(&[], &config(), 1);
    assert_eq!(nothing.err(), Some(AppearanceTrainError::NothingTouched));
    let features = [vec![1.0, 2.0]];
    let mixed = [sets[0], AppearanceSet::Features(&features)];
    let mixed = learn_appearance_vocabulary(&mixed, &config(), 1);
    assert_eq!(mixed.err(), Some(AppearanceTrainError::MixedSources));
}
