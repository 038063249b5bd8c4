//! Planar presses of any mesh: straight down on a grid over its bounding box.
//!
//! An object that lies flat, such as a letter from a file, is mapped like the rig's letters
//! but through the full imaging model (`press`), with the sensor's own noise. The sensor
//! looks along −z of the mesh's frame; poses are `object_from_sensor`.

use std::f64::consts::TAU;

use glam::DVec3;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;
use rayon::prelude::*;
use thiserror::Error;

use super::{INDENTATION, N_ANGLES, PlanarPose, SPACING};
use crate::press::PressSimulator;

/// Maximum number of presses of one plan.
pub const PLANAR_PRESSES_MAX: usize = 100_000;

/// Streams of planar presses, distinct from those of the rig's letters.
const STREAM_BASE: u64 = 1 << 63;

/// Positions and depth of planar presses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarPlan {
    /// Distance between neighbouring positions, metres.
    pub spacing: f64,
    /// Angles at each position, evenly over the full turn.
    pub n_angles: usize,
    /// Minimum margin of the positions beyond the bounding box, metres.
    pub margin: f64,
    /// Depth of the sensor below the object's highest point, as a fraction of the covering.
    pub indentation: f64,
}

impl Default for PlanarPlan {
    /// The rig's spacing, angles and indentation (section 3.2.3), and a margin of 2 mm, with
    /// which half of a DigiTacts array sees the free space around the object.
    fn default() -> Self {
        let (spacing, n_angles) = (SPACING, N_ANGLES);
        Self { spacing, n_angles, margin: 2.0 * MM, indentation: INDENTATION }
    }
}

/// Error of a plan that cannot be carried out.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum PlanarError {
    /// A number of the plan is out of range.
    #[error("{field} is {found}, expected {expected}")]
    Range {
        /// The field's name.
        field: &'static str,
        /// The given value.
        found: f64,
        /// The permitted values.
        expected: &'static str,
    },
    /// The plan has too many presses for this object.
    #[error(
        "the plan has {found} presses, expected at most {PLANAR_PRESSES_MAX}: space them wider"
    )]
    TooMany {
        /// The number of presses, saturating.
        found: usize,
    },
}

impl PlanarPlan {
    /// The planned poses over a box of the object's frame (metres): positions row by row from
    /// the lowest, all angles at each before the next.
    ///
    /// # Errors
    /// [`PlanarError`] when a number of the plan is out of range or there are too many presses.
    pub fn poses(&self, low: DVec3, high: DVec3) -> Result<Vec<PlanarPose>, PlanarError> {
        let checked = |field, found: f64, usable: bool, expected| {
            if usable { Ok(()) } else { Err(PlanarError::Range { field, found, expected }) }
        };
        let usable = self.spacing.is_finite() && self.spacing > 0.0;
        checked("spacing", self.spacing, usable, "a positive number of metres")?;
        let usable = self.margin.is_finite() && self.margin >= 0.0;
        checked("margin", self.margin, usable, "a number of metres of at least 0")?;
        let usable = self.indentation > 0.0 && self.indentation <= 1.0;
        checked("indentation", self.indentation, usable, "a part of the covering, above 0 to 1")?;
        checked("n_angles", self.n_angles as f64, self.n_angles > 0, "at least 1")?;
        let count = |size: f64| {
            ((size + 2.0 * self.margin) / self.spacing - 1e-9).ceil().max(0.0) as usize + 1
        };
        let (size, middle) = (high - low, 0.5 * (low + high));
        let (n_x, n_y) = (count(size.x), count(size.y));
        let found = n_x.saturating_mul(n_y).saturating_mul(self.n_angles);
        if found > PLANAR_PRESSES_MAX {
            return Err(PlanarError::TooMany { found });
        }
        let along = |middle: f64, index: usize, n: usize| {
            middle + (index as f64 - 0.5 * (n as f64 - 1.0)) * self.spacing
        };
        let pose = |press: usize| {
            let (position, turn) = (press / self.n_angles, press % self.n_angles);
            PlanarPose {
                x: along(middle.x, position % n_x, n_x),
                y: along(middle.y, position / n_x, n_y),
                angle: TAU * turn as f64 / self.n_angles as f64,
            }
        };
        Ok((0..found).map(pose).collect())
    }
}

/// Presses a mesh straight down at every pose of the plan; `seed` determines the noise.
///
/// Readings are in the plan's order and include presses without contact.
///
/// # Errors
/// [`PlanarError`] when the plan does not fit the object.
pub fn planar_presses(
    simulator: &PressSimulator,
    sensor: SensorId,
    plan: &PlanarPlan,
    seed: u64,
) -> Result<Vec<Reading>, PlanarError> {
    let (low, high) = simulator.mesh().bounds();
    let below_top = plan.indentation * simulator.sensor().parameters().covering_thickness;
    let poses = plan.poses(low, high)?;
    let readings = poses.into_par_iter().enumerate().map(|(press, at)| {
        let mut stream = Stream::new(seed, Purpose::RigNoise, STREAM_BASE | press as u64);
        simulator.read(sensor, at.object_from_sensor(below_top - high.z), &mut stream)
    });
    Ok(readings.collect())
}

#[cfg(test)]
mod tests {
    use palpate_core::sensor::{SensorDescription, SensorParameters};

    use super::*;
    use crate::letters::Font;
    use crate::rig::{Rig, RigNoise, rig_sensor};

    fn quiet_sensor() -> SensorDescription {
        let parameters = rig_sensor().parameters().clone();
        SensorDescription::new(SensorParameters { noise: 0.0, quantisation: 0.0, ..parameters })
            .unwrap()
    }

    /// The cosine of two images.
    fn cosine(a: &[f64], b: &[f64]) -> f64 {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
    }

    #[test]
    fn planar_presses_of_a_letter_match_the_rig() {
        let (font, sensor) = (Font::built_in(), quiet_sensor());
        let letter = font.letter('E').unwrap();
        let rig = Rig::new(SensorId(1), &sensor, RigNoise::none(), 1);
        let field = rig.field(letter);
        let mesh = letter.solid(3.0 * MM).translated(DVec3::new(0.0, 0.0, 7.0 * MM));
        let simulator = PressSimulator::new(mesh, sensor);
        let plan = PlanarPlan { n_angles: 4, ..PlanarPlan::default() };
        let readings = planar_presses(&simulator, SensorId(1), &plan, 1).unwrap();
        let (mut meshes, mut rigs, mut mirrored) = (Vec::new(), Vec::new(), Vec::new());
        let mut stream = Stream::new(1, Purpose::RigNoise, 0);
        for reading in &readings {
            let at = PlanarPose::of(reading.session_from_sensor());
            let expected = rig.pressures(&field, at, &mut stream);
            mirrored.extend((0..36).map(|taxel| expected[taxel % 6 * 6 + taxel / 6]));
            rigs.extend(expected);
            meshes.extend(&reading.image().pressures);
        }
        // The simulator draws the letter on points 1 mm apart, the rig on exact areas.
        assert!(cosine(&meshes, &rigs) > 0.995, "{}", cosine(&meshes, &rigs));
        assert!(cosine(&meshes, &mirrored) < 0.9, "{}", cosine(&meshes, &mirrored));
        let total = |values: &[f64]| values.iter().sum::<f64>();
        // The mesh is drawn at points 1 mm apart, a quarter of a stroke.
        let ratio = total(&meshes) / total(&rigs);
        assert!((ratio - 1.0).abs() < 0.06, "{ratio}");
    }

    #[test]
    fn the_plan_covers_the_box_and_its_margin() {
        let (low, high) = (DVec3::new(0.0, 10.0, 0.0) * MM, DVec3::new(20.0, 15.0, 3.0) * MM);
        let plan = PlanarPlan { spacing: 6.0 * MM, n_angles: 2, ..PlanarPlan::default() };
        let poses = plan.poses(low, high).unwrap();
        // 24 mm take 5 positions, 9 mm take 3; centred on (10, 12.5) mm.
        assert_eq!(poses.len(), 5 * 3 * 2);
        assert!((poses[0].x + 2.0 * MM).abs() < 1e-12 && (poses[0].y - 6.5 * MM).abs() < 1e-12);
        assert!((poses[1].angle - TAU / 2.0).abs() < 1e-12);
        let last = poses[29];
        assert!((last.x - 22.0 * MM).abs() < 1e-12 && (last.y - 18.5 * MM).abs() < 1e-12);
    }

    #[test]
    fn impossible_plans_are_refused_by_name() {
        let check = |plan: PlanarPlan| plan.poses(DVec3::ZERO, DVec3::splat(0.1)).unwrap_err();
        let spacing = check(PlanarPlan { spacing: -1.0, ..PlanarPlan::default() });
        assert!(matches!(spacing, PlanarError::Range { field: "spacing", .. }));
        let fine = check(PlanarPlan { spacing: 1e-6, ..PlanarPlan::default() });
        assert!(matches!(fine, PlanarError::TooMany { .. }));
        let deep = check(PlanarPlan { indentation: 1.5, ..PlanarPlan::default() });
        assert!(matches!(deep, PlanarError::Range { field: "indentation", .. }));
    }
}
