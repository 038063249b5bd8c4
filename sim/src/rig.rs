//! The 2-D pressing rig: a flat letter pressed against the sensor at planned planar poses.
//!
//! Source: section 3.2.3. Frame: the letter's (`letters`), its face in z = 0. The sensor
//! presses straight down: its z is the letter's −z, its x lies at the pose's angle, and its
//! origin is [`Rig::indentation`] below the face, where the face's whole area would read 16
//! of 20 kPa. A press shows the letter's shape blurred by the covering; [`RigNoise`] adds the
//! errors of a mechanism and of a real array. [`planar_presses`] presses flat meshes in the
//! same way.

mod field;
mod noise;
mod plan;
mod planar;
mod unmatched;

use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;

pub use field::LetterField;
pub use noise::RigNoise;
pub use plan::{N_ANGLES, N_POSITIONS, PlanarPose, SPACING, plan};
pub use planar::{PLANAR_PRESSES_MAX, PlanarError, PlanarPlan, planar_presses};
pub use unmatched::Unmatched;
use unmatched::{Wander, bent};

use crate::letters::Letter;
use crate::press::in_row_major_order;

/// Indentation of a letter into the covering, as a fraction of the covering's thickness.
/// Under the presets' straight force curve the face reads 16 of 20 kPa where it fills the
/// blur, and the strongest taxel of a press on an A reads 11 kPa on average, so gains and
/// depths rarely saturate.
pub const INDENTATION: f64 = 0.8;

/// A sensor in the rig; its taxels' gains stay the same for every letter and repetition.
#[derive(Clone, Debug)]
pub struct Rig {
    id: SensorId,
    sensor: SensorDescription,
    noise: RigNoise,
    seed: u64,
    gains: Vec<f64>,
    powers: Vec<f64>,
    centers: Vec<(f64, f64)>,
}

/// The sensor of section 3.2.3: 6 × 6 DigiTacts under the thinnest covering.
#[must_use]
pub fn rig_sensor() -> SensorDescription {
    SensorDescription::digitacts_6x6_thin()
}

impl Rig {
    /// The rig with one sensor in it. `seed` determines the sensor's gains and the noise of
    /// its presses; rigs of the same seed have equal gains under any covering.
    ///
    /// Readings are in the sensor frame's order, whatever the driver's.
    #[must_use]
    pub fn new(id: SensorId, sensor: &SensorDescription, noise: RigNoise, seed: u64) -> Self {
        let sensor = in_row_major_order(sensor);
        let mut stream = Stream::new(seed, Purpose::RigGains, 0);
        let grid = sensor.grid();
        let gains = (0..grid.n_taxels()).map(|_| noise.gain(&mut stream)).collect();
        let powers = noise.unmatched.powers(grid.n_taxels(), &mut stream);
        let centers =
            (0..grid.n_taxels()).map(|taxel| grid.center(taxel / grid.cols, taxel % grid.cols));
        let centers = centers.collect();
        Self { id, sensor, noise, seed, gains, powers, centers }
    }

    /// The sensor, in the order of its readings.
    #[must_use]
    pub fn sensor(&self) -> &SensorDescription {
        &self.sensor
    }

    /// The gain of every taxel, row-major: the ratio of the reported to the actual pressure.
    #[must_use]
    pub fn gains(&self) -> &[f64] {
        &self.gains
    }

    /// Indentation of the face into the covering, metres.
    #[must_use]
    pub fn indentation(&self) -> f64 {
        INDENTATION * self.sensor.parameters().covering_thickness
    }

    /// A letter blurred for this rig's sensor; drawn once for all its presses.
    #[must_use]
    pub fn field(&self, letter: &Letter) -> LetterField {
        LetterField::new(letter, &self.sensor)
    }

    /// `object_from_sensor` of the sensor that presses at `at`.
    #[must_use]
    pub fn object_from_sensor(&self, at: PlanarPose) -> Pose {
        at.object_from_sensor(self.indentation())
    }

    /// One press of a letter. The reading has the planned pose; the true pose is off by the
    /// rig's placement error, which is not reported.
    #[must_use]
    pub fn press(&self, field: &LetterField, at: PlanarPose, stream: &mut Stream) -> Reading {
        self.reading(&self.pressures(field, at, stream), at)
    }

    /// The pressures that the sensor reports for a press at `at`: pascal, row-major.
    #[must_use]
    pub fn pressures(&self, field: &LetterField, at: PlanarPose, stream: &mut Stream) -> Vec<f64> {
        let parameters = self.sensor.parameters();
        let placed = self.noise.placed(at, stream);
        let lie = self.noise.lie(stream);
        let depth = self.indentation() * lie.depth;
        let (sin, cos) = placed.angle.sin_cos();
        let displaced = |&(x, y): &(f64, f64)| {
            let in_letter = (placed.x + cos * x + sin * y, placed.y + sin * x - cos * y);
            let [face, along_x, along_y] = field.at(in_letter.0, in_letter.1);
            // Contribution of a slope: ∫ spread · mask · slope · (place − sensor).
            let slope = lie.slope_x * (along_x - placed.x * face)
                + lie.slope_y * (along_y - placed.y * face);
            depth * (face + slope)
        };
        let saturation = parameters.saturation;
        let responds = |((center, gain), power): ((&(f64, f64), &f64), &f64)| {
            let pressure = parameters.force_curve.pressure(displaced(center));
            bent(gain * pressure, *power, saturation)
        };
        let taxels = self.centers.iter().zip(&self.gains).zip(&self.powers);
        let mut pressures: Vec<f64> = taxels.map(responds).collect();
        self.noise.unmatched.leak(&mut pressures, self.sensor.grid().cols);
        for pressure in &mut pressures {
            *pressure = self.noise.measured(*pressure, saturation, stream);
        }
        pressures
    }

    /// All 192 presses of the plan, in its order: one repetition of section 3.2.3. Equal
    /// letters and repetitions give equal readings, independent of earlier presses.
    #[must_use]
    pub fn session(&self, field: &LetterField, repetition: u32) -> Vec<Reading> {
        let symbol = u64::from(u32::from(field.symbol()));
        let session = symbol << 43 | u64::from(repetition) << 11;
        let wander = Wander::new(self.noise.unmatched, self.seed, session);
        plan()
            .into_iter()
            .enumerate()
            .map(|(press, at)| {
                let index = session | press as u64;
                let mut stream = Stream::new(self.seed, Purpose::RigNoise, index);
                self.reading(&self.pressures(field, wander.moved(at, press), &mut stream), at)
            })
            .collect()
    }

    fn reading(&self, pressures: &[f64], at: PlanarPose) -> Reading {
        let pressures: Vec<Option<f64>> = pressures.iter().copied().map(Some).collect();
        Reading::new(self.id, &self.sensor, &pressures, self.object_from_sensor(at))
            .expect("a rig's image has the sensor's shape and finite pressures")
    }
}

#[cfg(test)]
mod tests;
