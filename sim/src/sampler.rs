//! Training touches: places drawn from the surface, touched, and kept when they converge.
//!
//! Source: section 4.4.1.2: a triangle by its area, a point in it, the sensor a little way
//! off and facing it, a small turn, then the controllers. Added: a share of the touches goes
//! to parts of the object with few touches, since drawing by area leaves out necks and
//! shafts. Each attempt has its own stream, so the readings do not depend on the number of
//! threads.

pub mod family;
pub mod rays;

use std::borrow::Cow;
use std::ops::ControlFlow;

use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::{DEG, MM};
use rayon::prelude::*;
use thiserror::Error;

use crate::controller::{ContactConfig, Outcome, touch};
use crate::press::PressSimulator;
pub use crate::surface::SurfacePoint;
use crate::surface::{N_SLICES, Surface};

/// Choice of places, and the controllers' limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplerConfig {
    /// Distance of the sensor's start from the surface, metres.
    pub offset: f64,
    /// Largest tilt of the sensor's start away from the surface's normal, radians.
    pub tilt_max: f64,
    /// Share of touches for parts with few touches, 0 to 1.
    pub coverage: f64,
    /// Maximum attempts for each reading.
    pub attempts_per_reading_max: usize,
    /// The controllers' limits.
    pub contact: ContactConfig,
}

impl SamplerConfig {
    /// 2 mm off, up to 10° of tilt, half of the touches by coverage.
    #[must_use]
    pub fn for_simulator(simulator: &PressSimulator) -> Self {
        let noise_level = simulator.config().noise_level;
        Self {
            offset: 2.0 * MM,
            tilt_max: 10.0 * DEG,
            coverage: 0.5,
            attempts_per_reading_max: 60,
            contact: ContactConfig::for_sensor(simulator.sensor(), noise_level),
        }
    }
}

/// Error of a sample with fewer readings than requested.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum SampleError {
    /// Too many attempts failed: the object is too small for the sensor, or out of its reach.
    #[error(
        "{accepted} of {wanted} touches converged in {attempts} attempts, expected all: \
         the object is too small or too hollow for the sensor"
    )]
    TooFewTouches {
        /// Number of readings taken.
        accepted: usize,
        /// Number of readings requested.
        wanted: usize,
        /// Number of attempts.
        attempts: usize,
    },
    /// The progress function stopped the work.
    #[error("stopped after {accepted} of {wanted} touches")]
    Stopped {
        /// Number of readings taken.
        accepted: usize,
        /// Number of readings requested.
        wanted: usize,
    },
}

/// Maximum attempts between two evaluations of the coverage.
const BATCH_MAX: usize = 128;

/// Attempts by one sensor of a family. Chosen: a thousand touches are by more than a hundred
/// sensors.
const TOUCHES_PER_SENSOR: usize = 8;

/// Takes `n` readings of the object, in the mesh's frame, all determined by `seed`.
///
/// `progress` receives the number of readings so far and `n` after every batch, and may stop
/// the work.
///
/// # Errors
/// [`SampleError`] when too many attempts fail or `progress` stops.
pub fn sample(
    simulator: &PressSimulator,
    sensor: SensorId,
    n: usize,
    seed: u64,
    config: &SamplerConfig,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<Vec<Reading>, SampleError> {
    let same = |_| Cow::Borrowed(simulator);
    sample_with(&same, simulator.surface(), sensor, n, seed, config, progress)
}

/// Takes readings as [`sample`] does; `sensors` gives the simulator for each index of a sensor,
/// which makes [`TOUCHES_PER_SENSOR`] attempts.
fn sample_with<'a>(
    sensors: &dyn Fn(usize) -> Cow<'a, PressSimulator>,
    surface: &Surface,
    sensor: SensorId,
    n: usize,
    seed: u64,
    config: &SamplerConfig,
    progress: &mut dyn FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<Vec<Reading>, SampleError> {
    let mut readings = Vec::with_capacity(n);
    let mut coverage = Coverage::new(n, config.coverage);
    let attempts_max = n.saturating_mul(config.attempts_per_reading_max).saturating_add(200);
    let mut attempts = 0;
    while readings.len() < n {
        if attempts >= attempts_max {
            let accepted = readings.len();
            return Err(SampleError::TooFewTouches { accepted, wanted: n, attempts });
        }
        let batch = (n - readings.len()).min(BATCH_MAX);
        let first = attempts / TOUCHES_PER_SENSOR;
        let after = (attempts + batch).div_ceil(TOUCHES_PER_SENSOR);
        let simulators: Vec<Cow<'_, PressSimulator>> = (first..after).map(sensors).collect();
        let outcomes: Vec<(Option<usize>, Option<Reading>)> = (attempts..attempts + batch)
            .into_par_iter()
            .map(|attempt| {
                let mut stream = Stream::new(seed, Purpose::Sampling, attempt as u64);
                let slice = coverage.choose(&mut stream);
                let place = surface.draw(slice, &mut stream);
                let simulator = &simulators[attempt / TOUCHES_PER_SENSOR - first];
                (slice, touch_at(simulator, sensor, &place, config, &mut stream))
            })
            .collect();
        attempts += batch;
        for (slice, reading) in outcomes {
            coverage.add(surface, slice, reading.as_ref());
            readings.extend(reading);
        }
        if progress(readings.len(), n).is_break() {
            return Err(SampleError::Stopped { accepted: readings.len(), wanted: n });
        }
    }
    Ok(readings)
}

/// One converged reading somewhere on the object, as from a robot guided by a camera.
///
/// Places are drawn by area and by slices, as for training, from `stream` alone.
///
/// # Errors
/// [`SampleError::TooFewTouches`] when the permitted attempts all fail.
pub fn touch_anywhere(
    simulator: &PressSimulator,
    sensor: SensorId,
    config: &SamplerConfig,
    stream: &mut Stream,
) -> Result<Reading, SampleError> {
    let attempts = config.attempts_per_reading_max + 200;
    let coverage = Coverage::new(1, config.coverage);
    (0..attempts)
        .find_map(|_| {
            let slice = coverage.choose(stream);
            let place = simulator.surface().draw(slice, stream);
            touch_at(simulator, sensor, &place, config, stream)
        })
        .ok_or(SampleError::TooFewTouches { accepted: 0, wanted: 1, attempts })
}

/// Touches one place of the surface, facing it but for a small tilt; `None` when the sensor
/// does not fit there or the controllers do not come to rest.
#[must_use]
pub fn touch_at(
    simulator: &PressSimulator,
    sensor: SensorId,
    place: &SurfacePoint,
    config: &SamplerConfig,
    stream: &mut Stream,
) -> Option<Reading> {
    let start = start_at(simulator, place, config, stream)?;
    match touch(simulator, start, &config.contact, stream) {
        Outcome::Converged(contact) => {
            Some(simulator.reading(sensor, contact.object_from_sensor, &contact.pressures))
        }
        Outcome::Missed | Outcome::NoConvergence | Outcome::Unreachable => None,
    }
}

/// The `object_from_sensor` at which the touch of a place starts; `None` when the sensor does
/// not fit there.
pub(crate) fn start_at(
    simulator: &PressSimulator,
    place: &SurfacePoint,
    config: &SamplerConfig,
    stream: &mut Stream,
) -> Option<Pose> {
    let facing = facing_pose(place, config.offset, stream);
    let near_surface = place.point + 0.01 * config.offset * place.normal;
    let collides = simulator.heights(facing, 0.0).lowest() < 0.0;
    let fits = !collides && simulator.is_clear_between(near_surface, facing.translation);
    fits.then(|| tilted(facing, config.tilt_max, stream))
}

/// The sensor `offset` metres off a place, facing it, turned at random about the normal.
fn facing_pose(place: &SurfacePoint, offset: f64, stream: &mut Stream) -> Pose {
    let roll = DQuat::from_rotation_z(stream.uniform(0.0, std::f64::consts::TAU));
    let towards = DQuat::from_rotation_arc(DVec3::Z, -place.normal);
    Pose::from_parts(towards * roll, place.point + offset * place.normal)
}

/// A pose turned by up to `tilt_max` about a random axis in the sensor's plane.
fn tilted(pose: Pose, tilt_max: f64, stream: &mut Stream) -> Pose {
    let (direction, angle) =
        (stream.uniform(0.0, std::f64::consts::TAU), stream.uniform(0.0, tilt_max));
    let axis = DVec3::new(direction.cos(), direction.sin(), 0.0);
    Pose::from_parts(pose.rotation * DQuat::from_axis_angle(axis, angle), pose.translation)
}

/// Number of touches of each slice of the object, and their targets.
struct Coverage {
    accepted: [usize; 3 * N_SLICES],
    attempted: [usize; 3 * N_SLICES],
    quota: f64,
    share: f64,
}

impl Coverage {
    fn new(n: usize, share: f64) -> Self {
        let quota = (share * n as f64 / N_SLICES as f64).max(1.0);
        Self { accepted: [0; 3 * N_SLICES], attempted: [0; 3 * N_SLICES], quota, share }
    }

    /// A slice that needs touches; `None` to draw by area.
    fn choose(&self, stream: &mut Stream) -> Option<usize> {
        if stream.uniform(0.0, 1.0) >= self.share {
            return None;
        }
        let weights = self.weights();
        let total: f64 = weights.iter().sum();
        let mut left = stream.uniform(0.0, total);
        weights.iter().position(|weight| {
            left -= weight;
            *weight > 0.0 && left < 0.0
        })
    }

    /// The missing touches of each slice, reduced where attempts have failed.
    fn weights(&self) -> [f64; 3 * N_SLICES] {
        std::array::from_fn(|slice| {
            let missing = (self.quota - self.accepted[slice] as f64).max(0.0);
            let hope = (self.accepted[slice] + 2) as f64 / (self.attempted[slice] + 2) as f64;
            missing * hope.clamp(0.02, 1.0)
        })
    }

    fn add(&mut self, surface: &Surface, slice: Option<usize>, reading: Option<&Reading>) {
        if let Some(slice) = slice {
            self.attempted[slice] += 1;
        }
        if let Some(reading) = reading {
            for slice in surface.slices_at(reading.session_from_sensor().translation) {
                self.accepted[slice] += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::sensor::SensorDescription;

    use super::*;
    use crate::mesh::tests_support::{cuboid, sphere, tube};

    const SENSOR: SensorId = SensorId(7);

    fn simulator(mesh: crate::mesh::Mesh) -> PressSimulator {
        PressSimulator::new(mesh, SensorDescription::digitacts_6x6())
    }

    fn readings(simulator: &PressSimulator, n: usize, seed: u64) -> Vec<Reading> {
        let config = SamplerConfig::for_simulator(simulator);
        sample(simulator, SENSOR, n, seed, &config, &mut |_, _| ControlFlow::Continue(())).unwrap()
    }

    #[test]
    fn readings_depend_on_the_seed_and_not_on_threads() {
        let simulator = simulator(sphere(30.0 * MM, 40));
        let with_threads = |n_threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            pool.install(|| readings(&simulator, 150, 11))
        };
        let one = with_threads(1);
        assert_eq!(one, with_threads(3));
        assert_ne!(one, readings(&simulator, 150, 12));
    }

    #[test]
    fn touches_of_a_sphere_face_its_center_just_inside() {
        let simulator = simulator(sphere(30.0 * MM, 60));
        for reading in readings(&simulator, 60, 1) {
            let pose = reading.session_from_sensor();
            let outward = pose.translation.normalize();
            assert!(pose.turn(DVec3::Z).angle_between(-outward) < 6.0 * DEG);
            let inside = 30.0 * MM - pose.translation.length();
            assert!((0.3 * MM..2.4 * MM).contains(&inside), "{inside}");
            assert_eq!(reading.sensor(), SENSOR);
        }
    }

    #[test]
    fn a_sensor_does_not_fit_into_a_narrow_tube() {
        // A cup: outer radius 12, inner radius 6 mm, too narrow for a sensor 12 mm wide.
        let profile =
            [(0.1, -35.0), (12.0, -35.0), (12.0, 35.0), (6.0, 35.0), (6.0, -25.0), (0.1, -25.0)];
        let rings: Vec<(f64, f64)> = profile
            .windows(2)
            .flat_map(|pair| {
                (0..20).map(|step| {
                    let along = f64::from(step) / 20.0;
                    let mix = |a: f64, b: f64| (a + (b - a) * along) * MM;
                    (mix(pair[0].0, pair[1].0), mix(pair[0].1, pair[1].1))
                })
            })
            .collect();
        let simulator = simulator(tube(100, |ring| rings[ring as usize]));
        assert!(simulator.mesh().is_watertight());
        for reading in readings(&simulator, 100, 2) {
            let at = reading.session_from_sensor().translation;
            let within = at.truncate().length() < 6.0 * MM && at.z.abs() < 24.0 * MM;
            assert!(!within, "touched the inside at {at}");
        }
    }

    #[test]
    fn a_thin_shaft_gets_its_share() {
        // A ball of radius 15 mm with a shaft of radius 2 mm: 8 % of the area, half the length.
        let simulator = simulator(tube(80, |ring| {
            let z = (f64::from(ring) - 39.5) * MM;
            let ball = (15.0f64 * 15.0 - (z / MM + 24.5).powi(2)).max(4.0).sqrt();
            (ball * MM, z)
        }));
        let all = readings(&simulator, 300, 3);
        let in_tenth = |tenth: i32| {
            let (low, high) = (f64::from(tenth) * 8.0 * MM, f64::from(tenth + 1) * 8.0 * MM);
            let z = |reading: &&Reading| {
                (low..high).contains(&(reading.session_from_sensor().translation.z + 40.0 * MM))
            };
            all.iter().filter(z).count()
        };
        // In tenth 4 the sensor, 12 mm wide, mostly collides with the ball.
        for tenth in [0, 1, 2, 3, 5, 6, 7, 8, 9] {
            assert!(in_tenth(tenth) >= 10, "{} touches in tenth {tenth}", in_tenth(tenth));
        }
        assert!(in_tenth(4) >= 1);
    }

    #[test]
    fn an_object_too_small_to_feel_is_reported() {
        let simulator = simulator(cuboid(DVec3::splat(0.1 * MM)));
        let config = SamplerConfig::for_simulator(&simulator);
        let error =
            sample(&simulator, SENSOR, 5, 1, &config, &mut |_, _| ControlFlow::Continue(()));
        assert!(matches!(error, Err(SampleError::TooFewTouches { accepted: 0, wanted: 5, .. })));
        let mut stream = Stream::new(1, Purpose::ReadingChoice, 0);
        assert!(touch_anywhere(&simulator, SENSOR, &config, &mut stream).is_err());
    }

    #[test]
    fn progress_is_reported_and_may_stop() {
        let simulator = simulator(sphere(30.0 * MM, 24));
        let config = SamplerConfig::for_simulator(&simulator);
        let mut told = Vec::new();
        let result = sample(&simulator, SENSOR, 400, 1, &config, &mut |done, total| {
            told.push((done, total));
            if done > 150 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert!(matches!(result, Err(SampleError::Stopped { wanted: 400, .. })));
        assert!(told.len() >= 2 && told.iter().all(|(_, total)| *total == 400));
    }
}
