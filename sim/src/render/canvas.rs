//! A picture with a z-buffer, and its PNG encoder.

use glam::DVec3;

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
    pub(super) fn add_triangle(&mut self, &[a, b, c]: &[DVec3; 3], color: [u8; 3]) {
        let doubled_area = (b - a).truncate().perp_dot((c - a).truncate());
        if doubled_area.abs() < 1e-12 {
            return;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        for y in pixels_between(low.y, high.y, self.height) {
            for x in pixels_between(low.x, high.x, self.width) {
                let offset = DVec3::new(x as f64 + 0.5, y as f64 + 0.5, 0.0) - a;
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
    /// transparent.
    pub(super) fn to_small_png(&self) -> Vec<u8> {
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
        png(width, height, png::ColorType::Rgba, &pixels)
    }

    /// The picture as a PNG file.
    pub(super) fn to_png(&self) -> Vec<u8> {
        png(self.width, self.height, png::ColorType::Rgb, self.pixels.as_flattened())
    }
}

fn png(width: usize, height: usize, color: png::ColorType, pixels: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().expect("writing to memory does not fail");
    writer.write_image_data(pixels).expect("the pixels fill the picture");
    drop(writer);
    bytes
}

/// The pixels whose centers may lie between two coordinates.
fn pixels_between(low: f64, high: f64, n: usize) -> std::ops::Range<usize> {
    let from = (low - 0.5).floor().max(0.0) as usize;
    let to = ((high + 0.5).ceil().max(0.0) as usize).min(n);
    from.min(to)..to
}
