//! Grids of values as SVG: tactile images with a scale, and matrices with names.

use std::fmt::Write as _;

use palpate_core::sensor::TaxelGrid;

use super::{escape, heat_color, number};

/// A grid of values, drawn as coloured cells.
pub struct Grid {
    /// The title above it.
    pub title: String,
    /// Number of columns.
    pub cols: usize,
    /// Row-major from the top; a value that is not finite is drawn grey.
    pub values: Vec<f64>,
    /// Values of the darkest and of the brightest colour.
    pub range: (f64, f64),
    /// What explains the cells.
    pub legend: Legend,
}

/// What explains the cells of a grid.
pub enum Legend {
    /// Nothing.
    None,
    /// A bar of 5 mm for cells of this width (mm), and the range in this unit; no unit, no range.
    Scale {
        /// Distance between the middles of two cells, mm.
        pitch_mm: f64,
        /// Unit of the values; empty where the range says nothing.
        unit: String,
    },
    /// A name of each row, which is also that of the column, and the value of each cell times 100.
    Names(Vec<String>),
}

/// Longer side of a drawn grid.
const SIDE: f64 = 156.0;
/// Longer side of a matrix with names.
const NAMED_SIDE: f64 = 280.0;
const LEFT: f64 = 12.0;
/// Space left of and below a matrix for its names.
const NAMES: f64 = 92.0;
const TOP: f64 = 26.0;
const BOTTOM: f64 = 30.0;
/// Length of the bar of a scale, mm.
const BAR_MM: f64 = 5.0;

impl Grid {
    /// A tactile image as the object sees the sensor, x to the right and y up: pressures in
    /// pascal, row-major with rows along +y, drawn from 0 to `full` pascal.
    #[must_use]
    pub fn tactile(title: &str, grid: &TaxelGrid, pressures: &[f64], full: f64) -> Self {
        let rows: Vec<&[f64]> = pressures.chunks(grid.cols).collect();
        Self {
            title: title.to_owned(),
            cols: grid.cols,
            values: rows.into_iter().rev().flatten().map(|pressure| pressure / 1e3).collect(),
            range: (0.0, full / 1e3),
            legend: Legend::Scale { pitch_mm: 1e3 * grid.pitch, unit: "kPa".to_owned() },
        }
    }

    /// The same image from 0 to its own maximum, whose size then says nothing.
    #[must_use]
    pub fn scaled(title: &str, grid: &TaxelGrid, values: &[f64]) -> Self {
        let full = values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let scale = Legend::Scale { pitch_mm: 1e3 * grid.pitch, unit: String::new() };
        Self { legend: scale, ..Self::tactile(title, grid, values, full) }
    }

    fn rows(&self) -> usize {
        self.values.len().div_ceil(self.cols.max(1)).max(1)
    }

    /// Place and size of the cells: left, top, side of a cell.
    fn layout(&self) -> (f64, f64, f64) {
        let longer = self.cols.max(self.rows()) as f64;
        match self.legend {
            Legend::Names(_) => (NAMES, TOP, NAMED_SIDE / longer),
            Legend::None | Legend::Scale { .. } => (LEFT, TOP, SIDE / longer),
        }
    }

    /// Width and height of the whole drawing.
    fn size(&self) -> (f64, f64) {
        let (left, top, side) = self.layout();
        let below = if matches!(self.legend, Legend::Names(_)) { NAMES } else { BOTTOM };
        let width = left + side * self.cols as f64 + LEFT;
        (width.max(LEFT + SIDE + LEFT), top + side * self.rows() as f64 + below)
    }
}

/// Grids in rows of `per_row`.
#[must_use]
pub fn grids_svg(grids: &[Grid], per_row: usize) -> String {
    let sizes: Vec<(f64, f64)> = grids.iter().map(Grid::size).collect();
    let width = sizes.iter().map(|size| size.0).fold(0.0, f64::max);
    let height = sizes.iter().map(|size| size.1).fold(0.0, f64::max);
    let cols = per_row.clamp(1, grids.len().max(1));
    let (whole_width, whole_height) =
        (width * cols as f64, height * grids.len().div_ceil(cols) as f64);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {whole_width:.0} \
         {whole_height:.0}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"{whole_width:.0}\" height=\"{whole_height:.0}\" fill=\"white\"/>\n"
    );
    for (index, grid) in grids.iter().enumerate() {
        let (x, y) = (width * (index % cols) as f64, height * (index / cols) as f64);
        let _ = writeln!(svg, "<g transform=\"translate({x:.1} {y:.1})\">{}</g>", draw(grid));
    }
    svg + "</svg>\n"
}

fn draw(grid: &Grid) -> String {
    let (left, top, side) = grid.layout();
    let mut out = format!(
        "<text x=\"{:.1}\" y=\"18\" text-anchor=\"middle\" font-size=\"13\">{}</text>",
        left + 0.5 * side * grid.cols as f64,
        escape(&grid.title)
    );
    for (index, value) in grid.values.iter().enumerate() {
        let x = left + side * (index % grid.cols) as f64;
        let y = top + side * (index / grid.cols) as f64;
        let share = (value - grid.range.0) / (grid.range.1 - grid.range.0).max(f64::MIN_POSITIVE);
        let color = if value.is_finite() { heat_color(share) } else { "#ccc".to_owned() };
        let drawn = side + 0.2;
        let _ = write!(
            out,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{drawn:.1}\" height=\"{drawn:.1}\" \
             fill=\"{color}\"/>"
        );
    }
    match &grid.legend {
        Legend::None => {}
        Legend::Scale { pitch_mm, unit } => scale(&mut out, grid, *pitch_mm, unit),
        Legend::Names(names) => named(&mut out, grid, names),
    }
    out
}

/// The bar of a length, and the range of values.
fn scale(out: &mut String, grid: &Grid, pitch_mm: f64, unit: &str) {
    let (left, top, side) = grid.layout();
    let y = top + side * grid.rows() as f64 + 10.0;
    let end = left + BAR_MM / pitch_mm * side;
    let _ = write!(
        out,
        "<line x1=\"{left}\" x2=\"{end:.1}\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"#222\" \
         stroke-width=\"2\"/><text x=\"{left}\" y=\"{:.1}\">{BAR_MM} mm</text>",
        y + 14.0
    );
    if !unit.is_empty() {
        let (low, high) = (number(grid.range.0), number(grid.range.1));
        let _ = write!(
            out,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{low} to {high} {}</text>",
            left + SIDE,
            y + 14.0,
            escape(unit)
        );
    }
}

/// The names of rows and columns, and the values.
fn named(out: &mut String, grid: &Grid, names: &[String]) {
    let (left, top, side) = grid.layout();
    let below = top + side * grid.rows() as f64;
    for (index, name) in names.iter().enumerate() {
        let middle = side * (index as f64 + 0.5);
        let (x, y, name) = (left + middle, top + middle + 4.0, escape(name));
        let _ = write!(
            out,
            "<text x=\"{:.1}\" y=\"{y:.1}\" text-anchor=\"end\">{name}</text>\
             <text transform=\"translate({:.1} {:.1}) rotate(-90)\" text-anchor=\"end\">{name}\
             </text>",
            left - 5.0,
            x + 4.0,
            below + 6.0
        );
    }
    let middle = 0.5 * (grid.range.0 + grid.range.1);
    for (index, value) in grid.values.iter().enumerate().filter(|(_, value)| value.is_finite()) {
        let x = left + side * ((index % grid.cols) as f64 + 0.5);
        let y = top + side * ((index / grid.cols) as f64 + 0.5) + 4.0;
        let color = if *value < middle { "#fff" } else { "#222" };
        let _ = write!(
            out,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\" fill=\"{color}\">{:.0}</text>",
            100.0 * value
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fills(svg: &str) -> Vec<&str> {
        let cells = svg.split("<rect ").skip(2); // the first is the background
        cells.map(|cell| cell.split("fill=\"").nth(1).unwrap().split('"').next().unwrap()).collect()
    }

    #[test]
    fn the_row_of_largest_y_is_at_the_top() {
        // 2 rows × 3 columns; the last taxel has the largest x and y and is pressed fully.
        let grid = TaxelGrid { rows: 2, cols: 3, pitch: 2e-3, taxel_width: 1.8e-3 };
        let pressures = [0.0, 0.0, 0.0, 0.0, 0.0, 4_000.0];
        let svg = grids_svg(&[Grid::tactile("t", &grid, &pressures, 4_000.0)], 1);
        let (dark, bright) = (heat_color(0.0), heat_color(1.0));
        assert_eq!(fills(&svg), [&dark, &dark, &bright, &dark, &dark, &dark]);
        assert!(svg.contains("0 to 4 kPa") && svg.contains("5 mm"), "{svg}");
    }

    #[test]
    fn the_bar_is_as_long_as_it_says() {
        // Cells of 2 mm are 156 / 6 = 26 wide: 5 mm are 65.
        let grid = TaxelGrid { rows: 6, cols: 6, pitch: 2e-3, taxel_width: 1.8e-3 };
        let svg = grids_svg(&[Grid::scaled("t", &grid, &[1.0; 36])], 1);
        assert!(svg.contains("x1=\"12\" x2=\"77.0\""), "{svg}");
        assert!(!svg.contains("kPa"));
    }

    #[test]
    fn a_matrix_has_names_and_values_and_grey_gaps() {
        let matrix = Grid {
            title: "a<b".to_owned(),
            cols: 2,
            values: vec![0.97, 0.03, f64::NAN, 1.0],
            range: (0.0, 1.0),
            legend: Legend::Names(vec!["mug".to_owned(), "tyre".to_owned()]),
        };
        let svg = grids_svg(&[matrix], 2);
        assert_eq!(svg.matches(">mug<").count(), 2);
        assert!(svg.contains(">97<") && svg.contains(">100<") && svg.contains("a&lt;b"), "{svg}");
        assert_eq!(fills(&svg)[2], "#ccc");
    }
}
