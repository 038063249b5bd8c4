//! Objects from our own generator that fill large catalogues: letters and procedural objects.

use anyhow::Context as _;
use palpate_sim::letters::Font;
use palpate_sim::shapes::assembled;

use super::{LETTER, LETTERS, ORDER_SEED};
use crate::objects::TestObject;

/// Thickness of a letter as a share of its largest side.
const THICKNESS_SHARE: f64 = 0.15;

/// The capital letters of the built-in font as solids.
pub(super) fn letters(size: f64) -> anyhow::Result<Vec<TestObject>> {
    let font = Font::built_in();
    let solid = |symbol: char| {
        let letter = font.letter(symbol).with_context(|| format!("the font has no {symbol}"))?;
        let side = letter.solid(1e-3).largest_dimension();
        let mesh = letter.solid(THICKNESS_SHARE * side);
        Ok(TestObject::new(format!("{LETTER}{symbol}"), &mesh, size))
    };
    LETTERS.chars().map(solid).collect()
}

/// Procedural objects, the same for every seed of an experiment.
pub(super) fn procedural(n: usize, size: f64) -> anyhow::Result<Vec<TestObject>> {
    let object = |index: usize| {
        let mesh = assembled(ORDER_SEED, index as u64)
            .with_context(|| format!("procedural object {index} never hangs together"))?;
        Ok(TestObject::new(format!("procedural {index}"), &mesh, size))
    };
    (0..n).map(object).collect()
}
