//! Times the Gaussian mixture for `tests/peers/gmm_sklearn.py`: writes the features and fits
//! them.
//!
//! Usage: `gmm_peer FILE N DIMENSION COMPONENTS STARTS TOLERANCE`. The features (f64, little
//! endian, row-major) go to FILE; one line with milliseconds, the mean ln density reached and
//! the number of components goes to standard output.

#![allow(
    clippy::disallowed_methods,
    clippy::print_stdout,
    reason = "a measurement needs a clock, a file and a voice; the library has none"
)]

use palpate_core::rng::{Purpose, Stream};
use palpate_core::vocabulary::gmm::{MixtureConfig, fit_mixture};

/// Features like those in training: unequal, overlapping clouds of falling variance.
fn features(n: usize, dimension: usize, n_clouds: usize) -> Vec<Vec<f64>> {
    let mut stream = Stream::new(101, Purpose::Shape, 0);
    let falling = |axis: usize| 0.9_f64.powi(axis as i32);
    let centers: Vec<Vec<f64>> = (0..n_clouds)
        .map(|_| (0..dimension).map(|axis| 1.5 * falling(axis) * stream.normal()).collect())
        .collect();
    (0..n)
        .map(|_| {
            let center = &centers[stream.index(n_clouds)];
            let shared = stream.normal();
            (0..dimension)
                .map(|axis| center[axis] + falling(axis) * (stream.normal() + 0.5 * shared))
                .collect()
        })
        .collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, n, dimension, n_components, n_starts, tolerance] = arguments.as_slice() else {
        return Err("expected FILE N DIMENSION COMPONENTS STARTS TOLERANCE".into());
    };
    let n_components: usize = n_components.parse()?;
    let features = features(n.parse()?, dimension.parse()?, n_components);
    let bytes: Vec<u8> = features.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    std::fs::write(file, bytes)?;
    let config = MixtureConfig {
        n_starts: n_starts.parse()?,
        tolerance: tolerance.parse()?,
        ..MixtureConfig::with_components(n_components)
    };
    let start = std::time::Instant::now();
    let fit = fit_mixture(&features, &config, 101);
    let elapsed_ms = 1e3 * start.elapsed().as_secs_f64();
    let reached = fit.mean_log_density.last().copied().unwrap_or(f64::NAN);
    println!("{elapsed_ms} {reached} {}", fit.mixture.components().len());
    Ok(())
}
