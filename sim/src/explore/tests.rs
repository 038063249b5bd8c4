//! What an exploration must hold: free motions, frequencies, determinism, readings on the mesh.

use palpate_core::sensor::SensorDescription;

use super::*;
use crate::mesh::tests_support::sphere;
use crate::noise::NoiseLevel;
use crate::shapes;

fn simulator(name: &str) -> PressSimulator {
    PressSimulator::new(shapes::example(name).unwrap(), SensorDescription::digitacts_6x6())
}

fn explored(
    simulator: &PressSimulator,
    n: usize,
    seed: u64,
    config: &ExploreConfig,
) -> Exploration {
    let place = Pose::from_parts(
        Stream::new(seed, Purpose::ObjectPose, 0).rotation(),
        DVec3::new(5.0 * MM, -8.0 * MM, 3.0 * MM),
    );
    explore(simulator, place, n, seed, config, &mut |_, _| ControlFlow::Continue(())).unwrap()
}

#[test]
fn look() {
    let mut total = 0.0;
    for name in ["mug", "hammer", "screwdriver"] {
        let simulator = simulator(name);
        for local in [0.0, 0.5, 1.0] {
            let config = ExploreConfig {
                local,
                iterations_max: 3000,
                ..ExploreConfig::for_simulator(&simulator)
            };
            let begun = std::time::Instant::now();
            let found = explored(&simulator, 100, 1, &config);
            let seconds = begun.elapsed().as_secs_f64();
            total += seconds;
            println!(
                "{name} {local} {} in {seconds:.2} {:?}",
                found.touches.len(),
                found.statistics
            );
        }
    }
    println!("{total}");
}
