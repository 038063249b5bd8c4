//! Time of one reading in a session, on ten analytic objects of 1,000 patches each.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::training::TrainingSet;
use palpate_dissertation::sva::model::SvaModel;
use palpate_dissertation::sva::train::{TrainingConfig, learn_vocabulary, map_object};
use palpate_dissertation::sva::{SvaBelief, SvaOptions};

/// A touch of an ellipsoid; the width of the blob varies over it.
fn touch(half: DVec3, stream: &mut Stream) -> Reading {
    let on_sphere = stream.direction();
    let facing = DQuat::from_rotation_arc(DVec3::Z, -(on_sphere / half).normalize());
    let spin = DQuat::from_rotation_z(stream.uniform(0.0, std::f64::consts::TAU));
    let (width, height) = (1.2 + on_sphere.x, 1.2 + on_sphere.y);
    let pressures: Vec<Option<f64>> = (0..36)
        .map(|taxel| {
            let (x, y) = (f64::from(taxel % 6) - 2.5, f64::from(taxel / 6) - 2.5);
            let blob = (-0.5 * ((x / width).powi(2) + (y / height).powi(2))).exp();
            Some(12_000.0 * blob + 40.0 * stream.normal())
        })
        .collect();
    let pose = Pose::from_parts(facing * spin, on_sphere * half);
    Reading::new(SensorId(0), &SensorDescription::digitacts_6x6(), &pressures, pose)
        .expect("the image has the sensor's shape")
}

fn one_more_reading(criterion: &mut Criterion) {
    let sensor = SensorDescription::digitacts_6x6();
    let config = TrainingConfig::default();
    let touches = |object: u64, n: usize, seed: u64| -> Vec<Reading> {
        let mut stream = Stream::new(seed, Purpose::Sampling, object);
        let half = DVec3::new(0.040, 0.012 + 0.002 * object as f64, 0.014);
        (0..n).map(|_| touch(half, &mut stream)).collect()
    };
    let readings: Vec<Vec<Reading>> = (0..10).map(|object| touches(object, 1_000, 1)).collect();
    let sets: Vec<TrainingSet<'_>> =
        readings.iter().map(|readings| TrainingSet { readings, sensor: &sensor }).collect();
    let vocabulary = learn_vocabulary(&sets, &config, 1).expect("everything touches");
    let map = |set| map_object(set, &vocabulary, &config, None).expect("1,000 touches");
    let objects = sets.iter().map(|set| Arc::new(map(set))).collect();
    let catalogue = Arc::new(SvaModel { vocabulary, association: config.association, objects });

    let unseen = touches(3, 20, 2);
    for n in [3, 10, 20] {
        let mut belief = SvaBelief::new(catalogue.clone(), SvaOptions::default(), None)
            .expect("an even prior always fits");
        for reading in &unseen[..n - 1] {
            belief.add(reading, &sensor).expect("the catalogue's own sensor");
        }
        criterion.bench_function(&format!("reading {n} of a session"), |bencher| {
            bencher.iter_batched(
                || belief.clone(),
                |mut belief| {
                    belief.add(&unseen[n - 1], &sensor).expect("the catalogue's own sensor");
                    black_box(belief.answer(8))
                },
                BatchSize::LargeInput,
            );
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = one_more_reading
}
criterion_main!(benches);
