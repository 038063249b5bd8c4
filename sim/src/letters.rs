//! Raised letters to press: all 52 of a font, as flat shapes and as solids.
//!
//! Frame of a letter: origin at the centre of its bounding box, x right and y up as one reads
//! it, metres; a raised letter's face lies in z = 0 and +z points out of it. Capitals are
//! [`CAP_HEIGHT`] high, and one scale serves the whole font, so small letters keep their
//! proportions. Source: sections 3.2.3 and 4.4.4. Not here: pressing them (`rig`).

mod font;
mod mask;
mod outline;
mod solid;
mod symmetry;

use glam::DVec2;
use palpate_core::units::MM;

pub use font::{Font, FontError};
pub use mask::Mask;
pub use symmetry::{LOOK_ALIKE, LookAlike, RotationOrder, SAME_SHAPE, look_alikes};

/// The height of the capital H, metres (section 3.2.3: letters of about 2.5 cm).
pub const CAP_HEIGHT: f64 = 25.0 * MM;

/// The letters of a font, in this order.
pub const SYMBOLS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz";

/// A polygon with holes: corners in metres, the outline counter-clockwise, holes clockwise.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    /// The corners of the outline.
    pub outline: Vec<DVec2>,
    /// The corners of each hole.
    pub holes: Vec<Vec<DVec2>>,
}

/// One letter: polygons that neither cross nor overlap.
#[derive(Clone, Debug, PartialEq)]
pub struct Letter {
    symbol: char,
    polygons: Vec<Polygon>,
    half_size: DVec2,
}

impl Letter {
    /// A letter of the given polygons, moved so that their bounding box has its centre at the
    /// origin; `None` when there is no polygon.
    fn centered(symbol: char, mut polygons: Vec<Polygon>) -> Option<Self> {
        let (low, high) = bounds(polygons.iter().flat_map(|polygon| &polygon.outline))?;
        let center = 0.5 * (low + high);
        for polygon in &mut polygons {
            let holes = polygon.holes.iter_mut().flatten();
            polygon.outline.iter_mut().chain(holes).for_each(|corner| *corner -= center);
        }
        Some(Self { symbol, polygons, half_size: 0.5 * (high - low) })
    }

    /// The letter's character.
    #[must_use]
    pub fn symbol(&self) -> char {
        self.symbol
    }

    /// The letter's polygons; a dot is a separate one.
    #[must_use]
    pub fn polygons(&self) -> &[Polygon] {
        &self.polygons
    }

    /// Width and height of its bounding box, metres.
    #[must_use]
    pub fn size(&self) -> DVec2 {
        2.0 * self.half_size
    }

    /// The letter's area, square metres.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.contours().map(signed_area).sum()
    }

    /// The centroid of the letter's area, metres.
    #[must_use]
    pub fn centroid(&self) -> DVec2 {
        let moment: DVec2 = self
            .contours()
            .flat_map(edges)
            .map(|(from, to)| from.perp_dot(to) * (from + to) / 6.0)
            .sum();
        moment / self.area()
    }

    /// Whether the letter covers a point (metres).
    #[must_use]
    pub fn contains(&self, x: f64, y: f64) -> bool {
        // A ray to the right crosses the contours an odd number of times (even-odd rule; the
        // polygons neither cross nor overlap).
        let crossings = self.contours().flat_map(edges).filter(|(from, to)| {
            let level = (from.y > y) != (to.y > y);
            level && from.x + (y - from.y) / (to.y - from.y) * (to.x - from.x) > x
        });
        crossings.count() % 2 == 1
    }

    /// All contours: outlines and holes.
    fn contours(&self) -> impl Iterator<Item = &[DVec2]> {
        self.polygons.iter().flat_map(|polygon| {
            std::iter::once(polygon.outline.as_slice())
                .chain(polygon.holes.iter().map(Vec::as_slice))
        })
    }
}

/// The smallest and the largest corner of a box around points; `None` without any.
fn bounds<'a>(points: impl IntoIterator<Item = &'a DVec2>) -> Option<(DVec2, DVec2)> {
    points.into_iter().fold(None, |bounds: Option<(DVec2, DVec2)>, point| {
        let (low, high) = bounds.unwrap_or((*point, *point));
        Some((low.min(*point), high.max(*point)))
    })
}

/// The area within a contour, positive when it runs counter-clockwise.
fn signed_area(contour: &[DVec2]) -> f64 {
    0.5 * edges(contour).map(|(from, to)| from.perp_dot(to)).sum::<f64>()
}

/// The edges of a closed contour, from corner to corner.
fn edges(contour: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    contour.iter().enumerate().map(|(corner, from)| (*from, contour[(corner + 1) % contour.len()]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame of 20 × 10 mm with a hole of 10 × 4 mm at its right end, far from the origin.
    fn frame() -> Letter {
        let corners = |x0: f64, y0: f64, x1: f64, y1: f64| {
            [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| DVec2::new(x, y) * MM).to_vec()
        };
        let mut hole = corners(109.0, 53.0, 119.0, 57.0);
        hole.reverse();
        let outline = corners(100.0, 50.0, 120.0, 60.0);
        Letter::centered('D', vec![Polygon { outline, holes: vec![hole] }]).unwrap()
    }

    #[test]
    fn a_frame_has_its_size_area_and_centroid() {
        let frame = frame();
        assert!((frame.size() - DVec2::new(20.0, 10.0) * MM).length() < 1e-12);
        // 200 mm² less 40 mm² centred 4 mm to the right: x = −40 · 4 / 160 = −1 mm.
        assert!((frame.area() - 160e-6).abs() < 1e-15);
        assert!((frame.centroid() - DVec2::new(-1.0, 0.0) * MM).length() < 1e-12);
    }

    #[test]
    fn a_point_in_a_hole_is_not_covered() {
        let frame = frame();
        assert!(frame.contains(-4.0 * MM, 0.0) && frame.contains(4.0 * MM, 4.0 * MM));
        assert!(!frame.contains(4.0 * MM, 0.0));
        assert!(!frame.contains(-11.0 * MM, 0.0) && !frame.contains(0.0, 5.1 * MM));
    }
}
