//! The 52 letters of a font: parsed, scaled and checked once.
//!
//! Built in is Quicksand Bold, round and plain like the dissertation's letters, its I given
//! cross-bars; any TrueType or OpenType font can be given instead. Source: section 4.4.4.1
//! and its footnote 3.

use glam::DVec2;
use palpate_core::units::MM;
use thiserror::Error;
use ttf_parser::{Face, FaceParsingError, GlyphId};

use super::outline::{Flattener, united};
use super::{CAP_HEIGHT, Letter, Polygon, SYMBOLS, bounds};

/// Largest distance of a flattened curve from the font's, metres.
const TOLERANCE: f64 = 0.01 * MM;

/// Width of the cross-bars added to a capital I without any, as a fraction of its height:
/// that of a usual slab serif.
const CROSS_BAR_WIDTH: f64 = 0.42;

/// Ratio of width to stroke below which an I has no cross-bars.
const CROSS_BARS_FROM: f64 = 1.5;

/// The letters A to Z and a to z of a font.
#[derive(Clone, Debug, PartialEq)]
pub struct Font {
    letters: Vec<Letter>,
}

/// Error of bytes that are not a font of raised letters.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum FontError {
    /// The bytes are not a font.
    #[error("not a TrueType or OpenType font: {0}")]
    Parse(#[from] FaceParsingError),
    /// A letter is not in the font, or has no outline.
    #[error("the font has no outline for {symbol:?}, expected one for each of A to Z and a to z")]
    Missing {
        /// The letter.
        symbol: char,
    },
}

impl Font {
    /// Quicksand Bold 3.000, which is part of the program (`sim/fonts`).
    ///
    /// # Panics
    /// Never: a test reads the font that is built in.
    #[must_use]
    pub fn built_in() -> Self {
        Self::from_bytes(include_bytes!("../../fonts/Quicksand-Bold.ttf").to_vec())
            .expect("the font that comes with the program has all letters")
    }

    /// Parses the font of a file's bytes. An I without cross-bars gets two, 0.42 of its
    /// height wide and as thick as its stem.
    ///
    /// # Errors
    /// [`FontError`] when the bytes are not a font or a letter has no outline.
    pub fn from_bytes(bytes: Vec<u8>) -> Result<Self, FontError> {
        let face = Face::parse(&bytes, 0)?;
        // Flatten finely enough for any scale that follows: the height of H decides it.
        let height = polygons(&face, 'H', 1.0).and_then(|polygons| height(&polygons));
        let height = height.ok_or(FontError::Missing { symbol: 'H' })?;
        let scale = CAP_HEIGHT / height;
        let letters = SYMBOLS.chars().map(|symbol| {
            let missing = FontError::Missing { symbol };
            let mut found = polygons(&face, symbol, TOLERANCE / scale).ok_or(missing)?;
            for polygon in &mut found {
                let holes = polygon.holes.iter_mut().flatten();
                polygon.outline.iter_mut().chain(holes).for_each(|corner| *corner *= scale);
            }
            let found = if symbol == 'I' { with_cross_bars(found) } else { found };
            Letter::centered(symbol, found).ok_or(missing)
        });
        Ok(Self { letters: letters.collect::<Result<_, _>>()? })
    }

    /// All letters, in the order of [`SYMBOLS`].
    #[must_use]
    pub fn letters(&self) -> &[Letter] {
        &self.letters
    }

    /// One letter; `None` for anything but A to Z and a to z.
    #[must_use]
    pub fn letter(&self, symbol: char) -> Option<&Letter> {
        self.letters.iter().find(|letter| letter.symbol() == symbol)
    }
}

/// The polygons of a glyph in the font's units; `None` without a glyph or an outline.
fn polygons(face: &Face<'_>, symbol: char, tolerance: f64) -> Option<Vec<Polygon>> {
    let glyph: GlyphId = face.glyph_index(symbol)?;
    let mut flattener = Flattener::new(tolerance);
    face.outline_glyph(glyph, &mut flattener)?;
    Some(united(&flattener.into_contours()))
}

fn height(polygons: &[Polygon]) -> Option<f64> {
    let (low, high) = bounds(polygons.iter().flat_map(|polygon| &polygon.outline))?;
    (high.y > low.y).then_some(high.y - low.y)
}

/// A capital I with cross-bars: its own, or two added to its stem.
fn with_cross_bars(polygons: Vec<Polygon>) -> Vec<Polygon> {
    let Some(stem) = Letter::centered('I', polygons.clone()) else { return polygons };
    let size = stem.size();
    let stroke = stroke_at_middle(&stem);
    if size.x >= CROSS_BARS_FROM * stroke {
        return polygons;
    }
    let bar_width = CROSS_BAR_WIDTH * size.y;
    let bar = |bottom: f64| {
        let (x, top) = (0.5 * bar_width, bottom + stroke);
        vec![(-x, bottom), (x, bottom), (x, top), (-x, top)].into_iter().map(DVec2::from).collect()
    };
    let mut contours: Vec<Vec<DVec2>> = stem.contours().map(<[DVec2]>::to_vec).collect();
    contours.extend([bar(-0.5 * size.y), bar(0.5 * size.y - stroke)]);
    united(&contours)
}

/// Width of the letter's stroke at half its height, metres.
fn stroke_at_middle(letter: &Letter) -> f64 {
    let n = 2000;
    let step = letter.size().x / f64::from(n);
    let at = |column: i32| (f64::from(column) + 0.5 - 0.5 * f64::from(n)) * step;
    step * (0..n).filter(|column| letter.contains(at(*column), 0.0)).count() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_font_has_all_letters_at_one_scale() {
        let font = Font::built_in();
        assert_eq!(font.letters().len(), 52);
        let size = |symbol| font.letter(symbol).unwrap().size();
        assert!((size('H').y - 25.0 * MM).abs() < 1e-6, "{}", size('H').y);
        // Lower case keeps its proportion: v stands on the line and is 0.76 of H high.
        assert!((size('v').y / size('H').y - 0.764).abs() < 5e-3, "{}", size('v'));
        for letter in font.letters() {
            let size = letter.size();
            let share = letter.area() / (size.x * size.y);
            assert!(size.max_element() < 36.0 * MM && (0.15..1.0).contains(&share), "{letter:?}");
        }
        assert_eq!(font.letter('1'), None);
    }

    #[test]
    fn letters_have_the_expected_parts_and_holes() {
        let font = Font::built_in();
        let parts = |symbol| {
            let letter = font.letter(symbol).unwrap();
            let holes = letter.polygons().iter().map(|polygon| polygon.holes.len()).sum::<usize>();
            (letter.polygons().len(), holes)
        };
        for (symbol, expected) in [
            ('A', (1, 1)),
            ('B', (1, 2)),
            ('C', (1, 0)),
            ('O', (1, 1)),
            ('i', (2, 0)),
            ('g', (1, 1)),
        ] {
            assert_eq!(parts(symbol), expected, "{symbol}");
        }
    }

    #[test]
    fn the_capital_i_has_cross_bars() {
        let font = Font::built_in();
        let i = font.letter('I').unwrap();
        assert!(i.contains(4.5 * MM, 11.5 * MM) && i.contains(-4.5 * MM, -11.5 * MM));
        assert!(i.contains(0.0, 0.0) && !i.contains(4.5 * MM, 0.0));
    }

    #[test]
    fn an_i_without_cross_bars_gets_two() {
        let bar = [(-2.0, 0.0), (2.0, 0.0), (2.0, 25.0), (-2.0, 25.0)];
        let outline = bar.map(|(x, y)| DVec2::new(x, y) * MM).to_vec();
        let barred = with_cross_bars(vec![Polygon { outline, holes: vec![] }]);
        let i = Letter::centered('I', barred).unwrap();
        // 0.42 · 25 = 10.5 mm wide, bars as thick as the stem: 100 + 2 · 4 · 6.5 = 152 mm².
        assert!((i.size() - DVec2::new(10.5, 25.0) * MM).length() < 1e-7, "{}", i.size());
        assert!((i.area() - 152e-6).abs() < 0.2e-6, "{}", i.area());
    }

    #[test]
    fn bytes_that_are_not_a_font_are_refused() {
        assert!(matches!(Font::from_bytes(vec![0; 64]), Err(FontError::Parse(_))));
    }
}
