//! Conversion of a glyph's curves to polygons: flattened, united by the non-zero rule, oriented.
//!
//! Lengths are in the font's units until the font scales them.

use glam::DVec2;
use i_overlay::core::fill_rule::FillRule;
use i_overlay::float::simplify::SimplifyShape;
use ttf_parser::OutlineBuilder;

use super::Polygon;

/// Collects a glyph's contours as closed polylines within `tolerance` of its curves.
pub(super) struct Flattener {
    tolerance: f64,
    contours: Vec<Vec<DVec2>>,
}

impl Flattener {
    pub(super) fn new(tolerance: f64) -> Self {
        Self { tolerance, contours: Vec::new() }
    }

    /// The contours, in the order of the glyph.
    pub(super) fn into_contours(self) -> Vec<Vec<DVec2>> {
        self.contours
    }

    fn last(&self) -> DVec2 {
        self.contours.last().and_then(|contour| contour.last()).copied().unwrap_or(DVec2::ZERO)
    }

    fn push(&mut self, point: DVec2) {
        if let Some(contour) = self.contours.last_mut() {
            contour.push(point);
        }
    }

    /// Adds a curve `at` of 0 ..= 1 whose second derivative is at most `bend`. A chord over
    /// 1/n of it is at most bend / (8n²) away.
    fn curve(&mut self, bend: f64, at: impl Fn(f64) -> DVec2) {
        let n = (bend / (8.0 * self.tolerance)).sqrt().ceil().clamp(1.0, 256.0) as usize;
        for step in 1..=n {
            self.push(at(step as f64 / n as f64));
        }
    }
}

impl OutlineBuilder for Flattener {
    fn move_to(&mut self, x: f32, y: f32) {
        self.contours.push(vec![point(x, y)]);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.push(point(x, y));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let (a, b, c) = (self.last(), point(x1, y1), point(x, y));
        let bend = 2.0 * (a - 2.0 * b + c).length();
        self.curve(bend, |t| a.lerp(b, t).lerp(b.lerp(c, t), t));
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let (a, b, c, d) = (self.last(), point(x1, y1), point(x2, y2), point(x, y));
        let bend = 6.0 * (a - 2.0 * b + c).length().max((b - 2.0 * c + d).length());
        self.curve(bend, |t| {
            let (ab, bc, cd) = (a.lerp(b, t), b.lerp(c, t), c.lerp(d, t));
            ab.lerp(bc, t).lerp(bc.lerp(cd, t), t)
        });
    }

    fn close(&mut self) {}
}

fn point(x: f32, y: f32) -> DVec2 {
    DVec2::new(f64::from(x), f64::from(y))
}

/// The area that contours wind around, as polygons that neither cross nor overlap.
pub(super) fn united(contours: &[Vec<DVec2>]) -> Vec<Polygon> {
    let contours: Vec<Vec<[f64; 2]>> = contours
        .iter()
        .map(|contour| contour.iter().map(|corner| corner.to_array()).collect())
        .collect();
    let shapes = contours.simplify_shape(FillRule::NonZero);
    let corners =
        |contour: Vec<[f64; 2]>| contour.into_iter().map(DVec2::from_array).collect::<Vec<_>>();
    shapes
        .into_iter()
        .filter_map(|shape| {
            let mut contours = shape.into_iter().map(corners);
            let outline = contours.next()?;
            Some(Polygon { outline, holes: contours.collect() })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::signed_area;
    use super::*;

    #[test]
    fn a_flattened_quarter_circle_stays_within_the_tolerance() {
        let mut flattener = Flattener::new(0.1);
        flattener.move_to(100.0, 0.0);
        // The cubic that is within 0.03 of a circle of radius 100.
        flattener.curve_to(100.0, 55.228, 55.228, 100.0, 0.0, 100.0);
        let contour = &flattener.into_contours()[0];
        let middles = contour.windows(2).map(|pair| (0.5 * (pair[0] + pair[1])).length());
        assert!(middles.clone().all(|radius| (radius - 100.0).abs() < 0.14), "{contour:?}");
        assert!((8..=24).contains(&contour.len()), "{}", contour.len());
    }

    #[test]
    fn crossing_bars_become_one_polygon_and_holes_stay_holes() {
        let bar = |x: f64, y: f64| {
            [(-x, -y), (x, -y), (x, y), (-x, y)].map(|(x, y)| DVec2::new(x, y)).to_vec()
        };
        let plus = united(&[bar(3.0, 1.0), bar(1.0, 3.0)]);
        assert_eq!((plus.len(), plus[0].holes.len()), (1, 0));
        assert!((signed_area(&plus[0].outline) - 20.0).abs() < 1e-6); // 12 + 12 − 4
        let mut hole = bar(1.0, 1.0);
        hole.reverse();
        let frame = united(&[bar(2.0, 2.0), hole]);
        assert_eq!((frame.len(), frame[0].holes.len()), (1, 1));
        assert!((signed_area(&frame[0].holes[0]) + 4.0).abs() < 1e-6);
    }
}
