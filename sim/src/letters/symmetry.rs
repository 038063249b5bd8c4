//! Rotational symmetry of letters, and pairs of letters with similar shapes under a rotation.
//!
//! The overlap of two shapes is the area they share over the area that either covers, 1 for
//! equal shapes. A rotation-invariant method cannot distinguish such pairs.

use std::f64::consts::TAU;

use glam::DVec2;
use palpate_core::units::{DEG, MM};

use super::{Letter, Mask};

/// Overlap above which a turned letter counts as itself. Letters are drawn by eye: the X of a
/// typeface is narrower above than below, its S smaller, by more than a sensor resolves.
pub const SAME_SHAPE: f64 = 0.97;

/// Overlap above which presses confuse two letters: n and u, b and q, d and p reach it in the
/// usual typefaces.
pub const LOOK_ALIKE: f64 = 0.85;

/// Side of a cell for symmetries, metres.
const FINE_CELL: f64 = 0.1 * MM;

/// Side of a cell for pairs, metres.
const PAIR_CELL: f64 = 0.4 * MM;

/// Largest order of symmetry that is tried.
const FOLDS_MAX: u32 = 8;

/// Order of a shape's rotational symmetry about its centroid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RotationOrder {
    /// The shape coincides with itself after every 1/n of a turn; 1 is a shape without symmetry.
    Finite(u32),
    /// The shape coincides with itself at every angle.
    Continuous,
}

/// Two letters that are nearly one shape under a rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LookAlike {
    /// The letter that stays.
    pub first: char,
    /// The letter that is turned.
    pub second: char,
    /// The angle by which the second is turned about its centroid, counter-clockwise, radians.
    pub angle: f64,
    /// Their overlap at that angle, 0 to 1.
    pub overlap: f64,
}

impl Letter {
    /// The order of the letter's symmetry about its centroid: its overlap with itself is at
    /// least [`SAME_SHAPE`] after 1/n of a turn.
    #[must_use]
    pub fn rotation_order(&self) -> RotationOrder {
        let shape = Shape::new(self, FINE_CELL);
        let meets_itself = |angle: f64| shape.overlap(&shape, angle, DVec2::ZERO) >= SAME_SHAPE;
        if (1..24).all(|step| meets_itself(TAU * f64::from(step) / 24.0)) {
            return RotationOrder::Continuous;
        }
        let folds = (2..=FOLDS_MAX).rev().find(|n| meets_itself(TAU / f64::from(*n)));
        RotationOrder::Finite(folds.unwrap_or(1))
    }
}

/// The pairs of `letters` whose overlap reaches `overlap_min` (0 to 1) under the best
/// rotation and a small shift, greatest overlap first; [`LOOK_ALIKE`] is a reasonable bound.
#[must_use]
pub fn look_alikes(letters: &[Letter], overlap_min: f64) -> Vec<LookAlike> {
    let shapes: Vec<Shape> = letters.iter().map(|letter| Shape::new(letter, PAIR_CELL)).collect();
    let mut found = Vec::new();
    for (idx, first) in shapes.iter().enumerate() {
        for (second, letter) in shapes.iter().zip(letters).skip(idx + 1) {
            // The overlap of areas a ≤ b is at most a / b.
            let (a, b) = (first.covered.len() as f64, second.covered.len() as f64);
            if a.min(b) < overlap_min * a.max(b) {
                continue;
            }
            let (angle, overlap) = best_overlap(first, second);
            if overlap >= overlap_min {
                let (first, second) = (letters[idx].symbol, letter.symbol);
                found.push(LookAlike { first, second, angle, overlap });
            }
        }
    }
    found.sort_by(|a, b| b.overlap.total_cmp(&a.overlap));
    found
}

/// Steps of one climb. Every step raises the overlap; the bound guards against rounding.
const CLIMB_STEPS_MAX: usize = 1000;

/// The angle and overlap of the best rotation of `second` onto `first`: every 6°, then
/// refined by ever smaller steps of angle and shift.
fn best_overlap(first: &Shape, second: &Shape) -> (f64, f64) {
    let at = |angle: f64, shift: DVec2| first.overlap(second, angle, shift);
    let mut coarse: Vec<(f64, f64)> = (0..60)
        .map(|step| f64::from(step) * 6.0 * DEG)
        .map(|angle| (angle, at(angle, DVec2::ZERO)))
        .collect();
    coarse.sort_by(|a, b| b.1.total_cmp(&a.1));
    let refined = coarse[..3].iter().map(|&(mut angle, mut best)| {
        let (mut shift, mut turn, mut step) = (DVec2::ZERO, 3.0 * DEG, 0.8 * MM);
        for _ in 0..CLIMB_STEPS_MAX {
            if step <= 0.1 * MM {
                break;
            }
            let neighbours = [
                (turn, DVec2::ZERO),
                (-turn, DVec2::ZERO),
                (0.0, DVec2::new(step, 0.0)),
                (0.0, DVec2::new(-step, 0.0)),
                (0.0, DVec2::new(0.0, step)),
                (0.0, DVec2::new(0.0, -step)),
            ];
            let better = neighbours
                .map(|(by, along)| (angle + by, shift + along))
                .map(|(angle, shift)| (angle, shift, at(angle, shift)))
                .into_iter()
                .max_by(|a, b| a.2.total_cmp(&b.2))
                .filter(|neighbour| neighbour.2 > best);
            match better {
                Some(found) => (angle, shift, best) = found,
                None => (turn, step) = (0.5 * turn, 0.5 * step),
            }
        }
        (angle, best)
    });
    let (angle, overlap) = refined.fold((0.0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
    (angle.rem_euclid(TAU), overlap)
}

/// A letter's mask, and the centres of its covered cells about its centroid.
struct Shape {
    mask: Mask,
    centroid: DVec2,
    covered: Vec<DVec2>,
}

impl Shape {
    fn new(letter: &Letter, cell: f64) -> Self {
        let (mask, centroid) = (letter.mask(cell, cell), letter.centroid());
        let covered = mask.covered().map(|at| at - centroid).collect();
        Self { mask, centroid, covered }
    }

    /// The overlap with `other`, turned by `angle` (radians) about its centroid, which lies
    /// `shift` (metres) from ours.
    fn overlap(&self, other: &Self, angle: f64, shift: DVec2) -> f64 {
        let (turn, place) = (DVec2::from_angle(angle), self.centroid + shift);
        let hits =
            other.covered.iter().filter(|at| self.mask.is_covered(turn.rotate(**at) + place));
        let shared = hits.count() as f64;
        shared / (self.covered.len() as f64 + other.covered.len() as f64 - shared)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::{Font, Polygon};

    fn polygon(corners: impl Iterator<Item = DVec2>) -> Letter {
        let outline = corners.map(|corner| corner * MM).collect();
        Letter::centered('O', vec![Polygon { outline, holes: vec![] }]).unwrap()
    }

    fn star(n: u32) -> Letter {
        polygon((0..2 * n).map(|idx| {
            let radius = if idx % 2 == 0 { 12.0 } else { 4.0 };
            radius * DVec2::from_angle(TAU * f64::from(idx) / f64::from(2 * n))
        }))
    }

    #[test]
    fn stars_have_as_many_folds_as_points() {
        for n in 2..=8 {
            assert_eq!(star(n).rotation_order(), RotationOrder::Finite(n), "{n}");
        }
    }

    #[test]
    fn a_disc_is_continuous_and_a_leaning_triangle_has_order_1() {
        let disc =
            polygon((0..90).map(|step| 10.0 * DVec2::from_angle(f64::from(step) * 4.0 * DEG)));
        assert_eq!(disc.rotation_order(), RotationOrder::Continuous);
        let leaning = [(0.0, 0.0), (20.0, 0.0), (18.0, 9.0)].map(DVec2::from);
        assert_eq!(polygon(leaning.into_iter()).rotation_order(), RotationOrder::Finite(1));
    }

    #[test]
    fn built_in_letters_have_their_drawn_symmetries() {
        let font = Font::built_in();
        for letter in font.letters() {
            // S, s, Z and z are smaller above than below: after half a turn they overlap
            // themselves by less than 0.97 and are distinguishable.
            let folds = if "HINOXlox".contains(letter.symbol()) { 2 } else { 1 };
            assert_eq!(letter.rotation_order(), RotationOrder::Finite(folds), "{}", letter.symbol);
        }
    }

    #[test]
    fn letters_equal_under_a_turn_are_found() {
        let pairs = look_alikes(Font::built_in().letters(), LOOK_ALIKE);
        let names: Vec<String> =
            pairs.iter().map(|pair| format!("{}{}", pair.first, pair.second)).collect();
        assert_eq!(names.len(), 7, "{names:?}");
        for (name, overlap_min) in [("dp", 0.97), ("bq", 0.97), ("il", 0.85), ("ad", 0.85)] {
            let pair = names.iter().position(|found| found == name).map(|idx| pairs[idx]).unwrap();
            assert!(pair.overlap > overlap_min, "{pair:?}");
            let half_turn = (pair.angle - 180.0 * DEG).abs() < 3.0 * DEG;
            assert_eq!(half_turn, ["dp", "bq"].contains(&name), "{pair:?}");
        }
    }
}
