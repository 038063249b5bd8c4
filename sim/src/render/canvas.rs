//! A picture with a z-buffer, and its PNG encoder.

use glam::DVec3;

/// Pixels beside the triangle that are looked at in each row: rounding at both ends.
const ENDS_PER_ROW: f64 = 4.0;

/// Pixels and their depths, larger nearer to the viewer.
pub(super) struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<[u8; 3]>,
    depth: Vec<f64>,
}

impl Canvas {
    pub(super) fn new(width: usize, height: usize, background: [u8; 3]) -> Self {
        let n = width * height;
        Self { width, height, pixels: vec![background; n], depth: vec![f64::NEG_INFINITY; n] }
    }

    /// Draws a triangle given in pixels (x right, y down, z towards the viewer).
    pub(super) fn add_triangle(&mut self, corners: &[DVec3; 3], color: [u8; 3]) {
        let [a, b, c] = *corners;
        let doubled_area = (b - a).truncate().perp_dot((c - a).truncate());
        if doubled_area.abs() < 1e-12 {
            return;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        for y in pixels_between(low.y, high.y, self.height) {
            let row = y as f64 + 0.5;
            let Some((from, to)) = within_row(corners, row) else { continue };
            for x in pixels_between(from, to, self.width) {
                let offset = DVec3::new(x as f64 + 0.5, row, 0.0) - a;
                let weight_b = offset.truncate().perp_dot((c - a).truncate()) / doubled_area;
                let weight_c = (b - a).truncate().perp_dot(offset.truncate()) / doubled_area;
                if weight_b < -1e-9 || weight_c < -1e-9 || weight_b + weight_c > 1.0 + 1e-9 {
                    continue;
                }
                let z = a.z + weight_b * (b.z - a.z) + weight_c * (c.z - a.z);
                let idx = y * self.width + x;
                if z > self.depth[idx] {
                    self.depth[idx] = z;
                    self.pixels[idx] = color;
                }
            }
        }
    }

    /// Draws a dot unless more than `through` pixels of depth hide its middle.
    pub(super) fn add_dot(&mut self, at: DVec3, through: f64, radius: f64, color: [u8; 3]) {
        if at.x < 0.0 || at.y < 0.0 || at.x >= self.width as f64 || at.y >= self.height as f64 {
            return;
        }
        if self.depth[at.y as usize * self.width + at.x as usize] > at.z + through {
            return;
        }
        for y in pixels_between(at.y - radius, at.y + radius, self.height) {
            for x in pixels_between(at.x - radius, at.x + radius, self.width) {
                let (dx, dy) = (x as f64 + 0.5 - at.x, y as f64 + 0.5 - at.y);
                if dx * dx + dy * dy <= radius * radius {
                    self.pixels[y * self.width + x] = color;
                }
            }
        }
    }

    /// Fills a square of `size` pixels.
    pub(super) fn fill(&mut self, left: usize, top: usize, size: usize, color: [u8; 3]) {
        for y in top..(top + size).min(self.height) {
            self.pixels[y * self.width..][left..(left + size).min(self.width)].fill(color);
        }
    }

    /// Number of pixels of one color.
    #[cfg(test)]
    pub(super) fn count(&self, color: [u8; 3]) -> usize {
        self.pixels.iter().filter(|pixel| **pixel == color).count()
    }

    /// The picture at half its size, each pixel the mean of four, as a PNG file whose background is
    /// transparent, with a named text.
    pub(super) fn to_small_png(&self, text: (&str, &str)) -> Vec<u8> {
        let (width, height) = (self.width / 2, self.height / 2);
        let mut pixels = Vec::with_capacity(4 * width * height);
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let four = [0, 1, self.width, self.width + 1].map(|at| 2 * (y * self.width + x) + at);
            let drawn = four.iter().filter(|at| self.depth[**at] > f64::NEG_INFINITY);
            let drawn: Vec<[u8; 3]> = drawn.map(|at| self.pixels[*at]).collect();
            let sum =
                |channel: usize| drawn.iter().map(|it| usize::from(it[channel])).sum::<usize>();
            let mean = |channel| (sum(channel) / drawn.len().max(1)) as u8;
            pixels.extend([mean(0), mean(1), mean(2), (255 * drawn.len() / 4) as u8]);
        }
        png(width, height, png::ColorType::Rgba, &pixels, Some(text))
    }

    /// The picture as a PNG file.
    pub(super) fn to_png(&self) -> Vec<u8> {
        png(self.width, self.height, png::ColorType::Rgb, self.pixels.as_flattened(), None)
    }
}

fn png(
    width: usize,
    height: usize,
    color: png::ColorType,
    pixels: &[u8],
    text: Option<(&str, &str)>,
) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Eight);
    if let Some((name, text)) = text {
        encoder
            .add_text_chunk(name.to_owned(), text.to_owned())
            .expect("names and numbers are Latin");
    }
    let mut writer = encoder.write_header().expect("writing to memory does not fail");
    writer.write_image_data(pixels).expect("the pixels fill the picture");
    drop(writer);
    bytes
}

/// About how many pixels [`Canvas::add_triangle`] looks at.
pub(super) fn pixels_of(&[a, b, c]: &[DVec3; 3]) -> f64 {
    let area = 0.5 * (b - a).truncate().perp_dot((c - a).truncate()).abs();
    let rows = a.y.max(b.y).max(c.y) - a.y.min(b.y).min(c.y) + 1.0;
    area + ENDS_PER_ROW * rows
}

/// The smallest and the largest x of a triangle in the row of pixels around `y`.
fn within_row(corners: &[DVec3; 3], y: f64) -> Option<(f64, f64)> {
    let (low, high) = (y - 0.5, y + 0.5);
    let mut span: Option<(f64, f64)> = None;
    for (from, to) in [(0, 1), (1, 2), (2, 0)] {
        let (from, to) = (corners[from], corners[to]);
        if from.y.max(to.y) < low || from.y.min(to.y) > high {
            continue;
        }
        let rise = to.y - from.y;
        let shares = match rise.abs() < 1e-12 {
            true => [0.0, 1.0],
            false => [low, high].map(|edge| ((edge - from.y) / rise).clamp(0.0, 1.0)),
        };
        for x in shares.map(|share| from.x + share * (to.x - from.x)) {
            let (least, most) = span.unwrap_or((x, x));
            span = Some((least.min(x), most.max(x)));
        }
    }
    span
}

/// The pixels whose centers may lie between two coordinates.
fn pixels_between(low: f64, high: f64, n: usize) -> std::ops::Range<usize> {
    let from = (low - 0.5).floor().max(0.0) as usize;
    let to = ((high + 0.5).ceil().max(0.0) as usize).min(n);
    from.min(to)..to
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a pixel's centre is in a triangle, by the signs of three areas.
    fn is_in(corners: &[DVec3; 3], x: usize, y: usize) -> bool {
        let at = DVec3::new(x as f64 + 0.5, y as f64 + 0.5, 0.0).truncate();
        let [a, b, c] = corners.map(DVec3::truncate);
        let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| (to - from).perp_dot(at - from));
        sides.iter().all(|side| *side > 1e-6) || sides.iter().all(|side| *side < -1e-6)
    }

    #[test]
    fn a_triangle_covers_the_pixels_whose_centres_it_has() {
        for turn in 0..24 {
            let angle = f64::from(turn) * 0.37;
            let corner = |share: f64, radius: f64| {
                let (sin, cos) = (angle + share).sin_cos();
                DVec3::new(20.0 + radius * cos, 20.0 + radius * sin, 0.0)
            };
            // Some reach beyond the picture, some are slivers.
            let corners = [
                corner(0.0, 26.0),
                corner(0.1 * f64::from(turn % 5) + 0.02, 24.0),
                corner(3.0, 9.0),
            ];
            let mut canvas = Canvas::new(40, 40, [0; 3]);
            canvas.add_triangle(&corners, [9; 3]);
            let inside = |at: usize| is_in(&corners, at % 40, at / 40);
            let drawn = |at: usize| canvas.pixels[at] == [9; 3];
            assert!((0..1600).all(|at| !inside(at) || drawn(at)), "{corners:?}");
            let n = (0..1600).filter(|at| drawn(*at)).count();
            assert!(n >= 1 && n <= (0..1600).filter(|at| inside(*at)).count() + 2, "{n}");
        }
    }
}
