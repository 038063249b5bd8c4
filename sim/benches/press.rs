//! Presses and converged readings a second on one core.

use std::hint::black_box;
use std::ops::ControlFlow;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use palpate_core::pose::Pose;
use palpate_core::reading::SensorId;
use palpate_core::sensor::SensorDescription;
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SamplerConfig, sample};
use palpate_sim::shapes;

const N_READINGS: usize = 64;

fn one_core(criterion: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one");
    for name in ["chess_knight", "mug", "screwdriver"] {
        let mesh = shapes::example(name).expect("a shape of that name");
        let simulator = PressSimulator::new(mesh, SensorDescription::digitacts_6x6());
        let config = SamplerConfig::for_simulator(&simulator);
        let readings = |n, seed| {
            sample(&simulator, SensorId(1), n, seed, &config, &mut |_, _| ControlFlow::Continue(()))
                .expect("the shapes can be touched")
        };
        let poses: Vec<Pose> =
            pool.install(|| readings(64, 1)).iter().map(|r| r.session_from_sensor()).collect();

        let mut group = criterion.benchmark_group(name);
        group.throughput(Throughput::Elements(poses.len() as u64));
        group.bench_function("presses", |bencher| {
            bencher.iter(|| poses.iter().for_each(|pose| drop(black_box(simulator.press(*pose)))));
        });
        group.sample_size(10).throughput(Throughput::Elements(N_READINGS as u64));
        let mut seed = 1;
        group.bench_function("converged readings", |bencher| {
            bencher.iter(|| {
                seed += 1;
                pool.install(|| readings(N_READINGS, seed))
            });
        });
        group.finish();
    }
}

criterion_group!(benches, one_core);
criterion_main!(benches);
