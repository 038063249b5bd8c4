//! How the touches of an exploration rest, beside those of the sampler.
//!
//! Section 4.4.2.3 explains accuracy by what a strategy touches. These figures separate two
//! causes of errors: touches that rest otherwise than those of training (off the array's middle,
//! weak, oblique), and places that are few. For the second, every place is touched once more
//! as in training.

use glam::DVec3;
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::{DEG, MM};
use palpate_sim::controller::{ContactConfig, contact_offset};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SamplerConfig, SurfacePoint, touch_at};
use rayon::prelude::*;
use serde::Serialize;

use crate::explorations::Run;
use crate::object_trials::Setting;
use crate::report::Report;
use crate::statistics::{mean, median};

/// Touches nearer to each other than this are at one place, metres.
const PLACE_WIDTH: f64 = 5.0 * MM;

/// Touches of an exploration whose places are counted.
const N_FIRST: usize = 20;

/// Starts of the sensor at one place, until one comes to rest.
const STARTS_MAX: u64 = 6;

/// Part of Press's target below which a touch is weak: its contact is small or beside the array.
/// Chosen on seed 101.
const FIRM: f64 = 0.8;

/// Weight of a reading when only firm touches count.
pub fn firmness(setting: &Setting) -> impl Fn(&Reading) -> f64 + Sync + use<> {
    let target = ContactConfig::for_sensor(&setting.sensor, setting.noise_level).target_pressure;
    move |reading| f64::from(u8::from(mean(&pressures(reading)) >= FIRM * target))
}

/// The pressures of a reading, pascal, row-major in the sensor frame's order.
fn pressures(reading: &Reading) -> Vec<f64> {
    reading.image().pressures.clone()
}

/// A touch at rest.
struct Rest {
    /// Distance of the contact from the array's middle, metres.
    offset: f64,
    /// Mean pressure as a part of Press's target.
    strength: f64,
    /// Angle between the sensor's axis and the normal of the nearest surface, rad.
    tilt: f64,
}

#[derive(Serialize)]
struct Rests {
    touches: usize,
    offset_mm_median: f64,
    strength_mean: f64,
    weak_share: f64,
    tilt_deg_median: f64,
    tilted_30_deg_share: f64,
    /// Places at least 5 mm apart among the first 20 touches.
    places_of_20: f64,
}

/// Readings of one object with the pose of the sensor in the object's frame.
type Posed<'a> = Vec<(Pose, &'a Reading)>;

/// Adds a row and the summary of the touches of explorations.
pub fn report_explored(report: &mut Report, setting: &Setting, source: (&str, &str), runs: &[Run]) {
    let of = |run: &'_ Run| -> Vec<(Vec<Rest>, usize)> {
        let objects = run.simulators.iter().zip(&run.explorations);
        let posed = objects.map(|(simulator, found)| {
            let touches = found.touches.iter().map(|touch| {
                let object_from_session = touch.session_from_object.inverse();
                (object_from_session * touch.reading.session_from_sensor(), &touch.reading)
            });
            describe(simulator, touches.collect())
        });
        posed.collect()
    };
    report_rests(report, setting, source, runs.iter().flat_map(of).collect());
}

/// Adds a row and the summary of the sampler's touches, one list an object.
pub fn report_sampled(
    report: &mut Report,
    setting: &Setting,
    source: (&str, &str),
    run: &Run,
    readings: &[Vec<Reading>],
) {
    let of = |(simulator, readings): (&PressSimulator, &Vec<Reading>)| {
        let posed = readings.iter().map(|reading| (reading.session_from_sensor(), reading));
        describe(simulator, posed.collect())
    };
    let described = run.simulators.iter().zip(readings).map(of).collect();
    report_rests(report, setting, source, described);
}

fn report_rests(
    report: &mut Report,
    setting: &Setting,
    (name, key): (&str, &str),
    described: Vec<(Vec<Rest>, usize)>,
) {
    let places_of_20 = mean(&described.iter().map(|(_, n)| *n as f64).collect::<Vec<_>>());
    let rests: Vec<Rest> = described.into_iter().flat_map(|(rests, _)| rests).collect();
    let of = |value: fn(&Rest) -> f64| rests.iter().map(value).collect::<Vec<_>>();
    let share = |is: fn(&Rest) -> bool| rests.iter().filter(|rest| is(rest)).count() as f64;
    let row = Rests {
        touches: rests.len(),
        offset_mm_median: median(&of(|rest| rest.offset / MM)),
        strength_mean: mean(&of(|rest| rest.strength)),
        weak_share: share(|rest| rest.strength < FIRM) / rests.len() as f64,
        tilt_deg_median: median(&of(|rest| rest.tilt / DEG)),
        tilted_30_deg_share: share(|rest| rest.tilt > 30.0 * DEG) / rests.len() as f64,
        places_of_20,
    };
    let mut state = |figure: &str, value: f64| {
        report.summarise(&format!("{}{key}_{figure}", setting.key), value);
    };
    state("weak_share", row.weak_share);
    state("offset_mm_median", row.offset_mm_median);
    state("tilt_deg_median", row.tilt_deg_median);
    state("places_of_20", row.places_of_20);
    report.labelled(&[("setting", &setting.name), ("rests_of", name)], row);
}

/// The rests of one object's touches, and the number of places of the first.
fn describe(simulator: &PressSimulator, posed: Posed<'_>) -> (Vec<Rest>, usize) {
    let mut places: Vec<DVec3> = Vec::new();
    for (object_from_sensor, _) in posed.iter().take(N_FIRST) {
        let at = object_from_sensor.translation;
        if places.iter().all(|place| place.distance(at) >= PLACE_WIDTH) {
            places.push(at);
        }
    }
    (posed.iter().map(|(pose, reading)| rest(simulator, *pose, reading)).collect(), places.len())
}

fn rest(simulator: &PressSimulator, object_from_sensor: Pose, reading: &Reading) -> Rest {
    let sensor = simulator.sensor();
    let config = ContactConfig::for_sensor(sensor, simulator.config().noise_level);
    let pressures = pressures(reading);
    let contact_in_sensor = contact_offset(sensor, &pressures, config.contact_threshold);
    let (_, normal) = simulator.nearest(object_from_sensor * contact_in_sensor);
    Rest {
        offset: contact_in_sensor.length(),
        strength: mean(&pressures) / config.target_pressure,
        tilt: object_from_sensor.turn(DVec3::Z).angle_between(-normal),
    }
}

/// The place of every explored touch, touched as in training: from the nearest point of the
/// surface, facing it. A place where the sensor does not fit is left out.
#[must_use]
pub fn touched_again(run: &Run, seed: u64) -> Vec<Vec<Reading>> {
    let objects = run.simulators.par_iter().zip(&run.explorations);
    let of = objects.map(|(simulator, found)| {
        let config = SamplerConfig::for_simulator(simulator);
        let again = |(idx, touch): (usize, &palpate_sim::explore::Touch)| {
            let (point, normal) = simulator.nearest(touch.place_in_object());
            let mut stream = Stream::new(seed, Purpose::Sampling, idx as u64);
            let place = SurfacePoint { point, normal };
            (0..STARTS_MAX)
                .find_map(|_| touch_at(simulator, SensorId(0), &place, &config, &mut stream))
        };
        found.touches.iter().enumerate().filter_map(again).collect()
    });
    of.collect()
}
