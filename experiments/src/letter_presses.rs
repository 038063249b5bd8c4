//! Presses on raised letters for appearance: anywhere on a letter, or at the rig's planned places.
//!
//! The simulated letters of section 4.4.4.1 are approached from above only; the places are drawn
//! uniformly over the letter's face, at any angle, as the sampler draws them by area.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use anyhow::Context as _;
use glam::DVec3;
use palpate_core::metric::{Inertia, Symmetry, SymmetryOrder};
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_core::units::{KPA, MM};
use palpate_sim::letters::{Font, Letter, RotationOrder};
use palpate_sim::rig::{
    LetterField, N_ANGLES, PlanarPose, Rig, RigNoise, SPACING, plan, rig_sensor,
};

/// Half the side of the square in which places are drawn, larger than any letter.
const REACH: f64 = 30.0 * MM;

/// Contact threshold of a planned press: five standard deviations of the physical rig's noise.
pub const CONTACT: f64 = 3.5 * KPA;

/// First index of the streams of drawn presses, disjoint from those of the rig's planned sessions.
const STREAM_BASE: u64 = 1 << 62;

/// First index of the streams of jittered presses.
const JITTERED: u64 = STREAM_BASE | 1 << 61;

/// The font of a file, or the built-in one.
///
/// # Errors
/// When the file cannot be read or is no font of letters.
pub fn font_of(path: Option<&Path>) -> anyhow::Result<Font> {
    let Some(path) = path else { return Ok(Font::built_in()) };
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    Font::from_bytes(bytes).with_context(|| format!("{} is not a usable font", path.display()))
}

/// Letters of a font, to be pressed.
pub struct RaisedLetters {
    letters: Vec<Letter>,
    fields: Vec<LetterField>,
}

impl RaisedLetters {
    /// The letters of the built-in font.
    ///
    /// # Errors
    /// When the font lacks a symbol.
    pub fn new(symbols: &str) -> anyhow::Result<Self> {
        Self::of_font(symbols, &Font::built_in())
    }

    /// The letters of a font.
    ///
    /// # Errors
    /// When the font lacks a symbol.
    pub fn of_font(symbols: &str, font: &Font) -> anyhow::Result<Self> {
        let letter = |symbol: char| {
            font.letter(symbol).cloned().with_context(|| format!("the font has no {symbol}"))
        };
        let letters: Vec<Letter> = symbols.chars().map(letter).collect::<anyhow::Result<_>>()?;
        Ok(Self::of_letters(letters, &rig_sensor()))
    }

    /// Letters blurred for a sensor, which presses them.
    #[must_use]
    pub fn of_letters(letters: Vec<Letter>, sensor: &SensorDescription) -> Self {
        let fields = letters.iter().map(|letter| LetterField::new(letter, sensor)).collect();
        Self { letters, fields }
    }

    /// The letters' outlines.
    #[must_use]
    pub fn letters(&self) -> &[Letter] {
        &self.letters
    }

    /// `n` presses of every letter anywhere on its face. Equal sets of a rig are equal; `set`
    /// separates training from tests.
    #[must_use]
    pub fn anywhere(&self, rig: &Rig, seed: u64, set: u64, n: usize) -> Vec<Vec<Reading>> {
        let presses = |(letter, field): (&Letter, &LetterField)| {
            let index = STREAM_BASE | u64::from(u32::from(letter.symbol())) << 8 | set;
            let mut stream = Stream::new(seed, Purpose::RigNoise, index);
            (0..n).map(|_| rig.press(field, place_on(letter, &mut stream), &mut stream)).collect()
        };
        self.letters.iter().zip(&self.fields).map(presses).collect()
    }

    /// The planned presses of section 3.2.3 of every letter, those that missed it included.
    #[must_use]
    pub fn session(&self, rig: &Rig, repetition: u32) -> Vec<Vec<Reading>> {
        self.fields.iter().map(|field| rig.session(field, repetition)).collect()
    }

    /// As many presses of every letter, each at a planned pose moved by at most half of the plan's
    /// step in place and angle: no place is pressed twice. `set` separates training from tests.
    #[must_use]
    pub fn jittered(&self, rig: &Rig, seed: u64, set: u64) -> Vec<Vec<Reading>> {
        let presses = |(letter, field): (&Letter, &LetterField)| {
            let symbol = u64::from(u32::from(letter.symbol()));
            let mut stream = Stream::new(seed, Purpose::RigNoise, JITTERED | symbol << 8 | set);
            let press = |at: PlanarPose| {
                let (place, turn) = (0.5 * SPACING, PI / N_ANGLES as f64);
                let at = PlanarPose {
                    x: at.x + stream.uniform(-place, place),
                    y: at.y + stream.uniform(-place, place),
                    angle: at.angle + stream.uniform(-turn, turn),
                };
                rig.press(field, at, &mut stream)
            };
            plan().into_iter().map(press).collect()
        };
        self.letters.iter().zip(&self.fields).map(presses).collect()
    }

    /// The planned presses of section 3.2.3 of every letter, `repetitions` times 192, without
    /// those that missed the letter.
    #[must_use]
    pub fn planned(&self, rig: &Rig, repetitions: u32) -> Vec<Vec<Reading>> {
        let presses = |field: &LetterField| {
            let all = (0..repetitions).flat_map(|repetition| rig.session(field, repetition));
            all.filter(|reading| reading.image().max() > CONTACT).collect()
        };
        self.fields.iter().map(presses).collect()
    }
}

/// What errors of a letter's pose are measured by.
pub struct LetterShape {
    inertia: Inertia,
    symmetry: Symmetry,
}

impl LetterShape {
    /// Mass and symmetry of a letter's face.
    ///
    /// # Panics
    /// Never: a letter covers cells of half a millimetre.
    #[must_use]
    pub fn of(letter: &Letter) -> Self {
        let order = match (letter.symbol(), letter.rotation_order()) {
            // Equation 3.21: an O has no angle.
            ('O', _) | (_, RotationOrder::Continuous) => SymmetryOrder::Continuous,
            (_, RotationOrder::Finite(n)) => SymmetryOrder::Finite(n),
        };
        let mask = letter.mask(0.5 * MM, 0.0);
        let face: Vec<DVec3> = mask.covered().map(|at| at.extend(0.0)).collect();
        let masses = face.iter().map(|at| (*at, 1.0));
        let inertia =
            Inertia::of_points(masses).expect("a letter covers cells of half a millimetre");
        let through = letter.centroid().extend(0.0);
        Self { inertia, symmetry: Symmetry { order, axis: DVec3::Z, through } }
    }

    /// The inertial distance of two poses of the letter modulo its symmetry, metres.
    #[must_use]
    pub fn error(&self, found: &Pose, truth: &Pose) -> f64 {
        self.inertia.distance_modulo(found, truth, &self.symmetry)
    }
}

/// A rig with the sensor of section 3.2.3 in it.
#[must_use]
pub fn rig(noise: RigNoise, seed: u64) -> Rig {
    Rig::new(SensorId(0), &rig_sensor(), noise, seed)
}

/// Draws a place uniformly over the letter's face, and an angle.
#[must_use]
pub fn place_on(letter: &Letter, stream: &mut Stream) -> PlanarPose {
    loop {
        let (x, y) = (stream.uniform(-REACH, REACH), stream.uniform(-REACH, REACH));
        if letter.contains(x, y) {
            return PlanarPose { x, y, angle: stream.uniform(0.0, TAU) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presses_anywhere_are_on_the_letter_and_sets_differ() {
        let letters = RaisedLetters::new("IO").unwrap();
        let rig = rig(RigNoise::none(), 101);
        let presses = letters.anywhere(&rig, 101, 0, 40);
        assert_eq!(presses, letters.anywhere(&rig, 101, 0, 40));
        assert_ne!(presses, letters.anywhere(&rig, 101, 1, 40));
        for (letter, presses) in letters.letters().iter().zip(&presses) {
            for press in presses {
                let at = press.session_from_sensor().translation;
                assert!(letter.contains(at.x, at.y));
                assert!(press.image().max() > CONTACT);
            }
        }
    }

    #[test]
    fn jittered_presses_stay_within_half_a_step_of_the_plan() {
        let letters = RaisedLetters::new("IO").unwrap();
        let rig = rig(RigNoise::none(), 101);
        let presses = letters.jittered(&rig, 101, 0);
        assert_ne!(presses, letters.jittered(&rig, 101, 1));
        assert_eq!(presses[0].len(), 192);
        for (press, planned) in presses[0].iter().zip(plan()) {
            let at = PlanarPose::of(press.session_from_sensor());
            let off = (at.x - planned.x).abs().max((at.y - planned.y).abs());
            assert!(off <= 0.5 * SPACING + 1e-12 && off > 0.0, "{at:?}");
        }
    }

    #[test]
    fn planned_presses_that_miss_are_left_out() {
        let letters = RaisedLetters::new("I").unwrap();
        let found = letters.planned(&rig(RigNoise::physical(), 101), 2)[0].len();
        assert!((100..384).contains(&found), "{found}");
    }
}
