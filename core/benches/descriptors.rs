//! Descriptors per second on one core, for images of 6 × 6 and 26 × 26 taxels.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use palpate_core::descriptor::DescriptorKind;
use palpate_core::reading::TactileImage;
use palpate_core::rng::{Purpose, Stream};

/// Images described at a time.
const BATCH: usize = 256;

/// Blobs of random position and width with a little noise.
fn images(side: usize) -> Vec<TactileImage> {
    let image = |index: u64| {
        let mut stream = Stream::new(1, Purpose::Sampling, index);
        let scale = side as f64;
        let (x0, y0) = (stream.uniform(0.3, 0.7) * scale, stream.uniform(0.3, 0.7) * scale);
        let (width, height) = (stream.uniform(0.1, 0.4) * scale, stream.uniform(0.1, 0.4) * scale);
        let pressures = (0..side * side).map(|n| {
            let (x, y) = ((n % side) as f64 - x0, (n / side) as f64 - y0);
            let blob = (-0.5 * ((x / width).powi(2) + (y / height).powi(2))).exp();
            12_000.0 * blob + 40.0 * stream.normal()
        });
        TactileImage { rows: side, cols: side, pressures: pressures.collect() }
    };
    (0..BATCH as u64).map(image).collect()
}

fn descriptors_per_second(criterion: &mut Criterion) {
    let one_core =
        rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread can be started");
    for side in [6, 26] {
        let images = images(side);
        let images: Vec<&TactileImage> = images.iter().collect();
        let mut group = criterion.benchmark_group(format!("describe {side}x{side}"));
        group.throughput(Throughput::Elements(BATCH as u64));
        for kind in DescriptorKind::ALL {
            let plan = kind.plan(side, side);
            group.bench_function(BenchmarkId::from_parameter(kind.name()), |bencher| {
                one_core.install(|| bencher.iter(|| black_box(plan.describe(&images))));
            });
        }
        group.finish();
    }
}

/// Cost of one reading of a session without a prepared plan.
fn plan_and_describe_one(criterion: &mut Criterion) {
    for side in [6, 26] {
        let image = &images(side)[0];
        let mut group = criterion.benchmark_group(format!("plan and describe one {side}x{side}"));
        for kind in [DescriptorKind::PolarFourier, DescriptorKind::Mnti] {
            group.bench_function(BenchmarkId::from_parameter(kind.name()), |bencher| {
                bencher.iter(|| black_box(kind.describe(image)));
            });
        }
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = descriptors_per_second, plan_and_describe_one
}
criterion_main!(benches);
