//! Line plots and heat maps as SVG, small enough to write by hand.

pub mod grids;

use std::fmt::Write as _;

/// One line of a plot.
pub struct Line {
    /// Its name in the legend; a line without a name is drawn thin and dotted.
    pub name: String,
    /// Its points; a point that is not finite is left out.
    pub points: Vec<(f64, f64)>,
}

/// One panel: axes and lines.
pub struct Panel {
    /// The title above it.
    pub title: String,
    /// The label of the x axis, with its unit.
    pub x: String,
    /// The label of the y axis, with its unit.
    pub y: String,
    /// The lines.
    pub lines: Vec<Line>,
}

const WIDTH: f64 = 380.0;
const HEIGHT: f64 = 270.0;
const LEFT: f64 = 52.0;
const TOP: f64 = 34.0;
const COLORS: [&str; 6] = ["#0b6e99", "#d1495b", "#66a182", "#edae49", "#574b90", "#444444"];

/// Panels side by side, two a row.
#[must_use]
pub fn svg(panels: &[Panel]) -> String {
    let rows = panels.len().div_ceil(2).max(1);
    let cols = panels.len().clamp(1, 2);
    let (width, height) = (WIDTH * cols as f64, HEIGHT * rows as f64);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    for (index, panel) in panels.iter().enumerate() {
        let (x, y) = (WIDTH * (index % 2) as f64, HEIGHT * (index / 2) as f64);
        let _ = writeln!(svg, "<g transform=\"translate({x} {y})\">{}</g>", draw(panel));
    }
    svg + "</svg>\n"
}

fn draw(panel: &Panel) -> String {
    let (plot_width, plot_height) = (WIDTH - LEFT - 16.0, HEIGHT - TOP - 46.0);
    let finite = || {
        panel
            .lines
            .iter()
            .flat_map(|line| &line.points)
            .filter(|p| p.0.is_finite() && p.1.is_finite())
    };
    let x_max = finite().map(|p| p.0).fold(f64::MIN_POSITIVE, f64::max);
    let y_max = nice(finite().map(|p| p.1).fold(f64::MIN_POSITIVE, f64::max));
    let place = |(x, y): (f64, f64)| {
        (LEFT + x / x_max * plot_width, TOP + plot_height - y / y_max * plot_height)
    };
    let mut out = format!(
        "<text x=\"{}\" y=\"18\" text-anchor=\"middle\" font-size=\"13\">{}</text>",
        LEFT + plot_width / 2.0,
        escape(&panel.title)
    );
    for tick in 0..=4 {
        let value = y_max * f64::from(tick) / 4.0;
        let (_, y) = place((0.0, value));
        let _ = write!(
            out,
            "<line x1=\"{LEFT}\" x2=\"{}\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"#ddd\"/>\
             <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            LEFT + plot_width,
            LEFT - 5.0,
            y + 4.0,
            number(value)
        );
        let across = x_max * f64::from(tick) / 4.0;
        let (x, bottom) = place((across, 0.0));
        let _ = write!(
            out,
            "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            bottom + 15.0,
            number(across)
        );
    }
    let _ = write!(
        out,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\
         <text transform=\"translate(13 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
        LEFT + plot_width / 2.0,
        HEIGHT - 14.0,
        escape(&panel.x),
        TOP + plot_height / 2.0,
        escape(&panel.y)
    );
    // The legend stands at the right, where the lines do not end.
    let ends: Vec<f64> = panel
        .lines
        .iter()
        .filter_map(|line| line.points.iter().rev().find(|point| point.1.is_finite()))
        .map(|point| point.1)
        .collect();
    let ends_high = ends.iter().sum::<f64>() > 0.5 * y_max * ends.len() as f64;
    let named = panel.lines.iter().filter(|line| !line.name.is_empty());
    let unnamed = panel.lines.iter().filter(|line| line.name.is_empty());
    for line in unnamed {
        let _ = write!(
            out,
            "<polyline fill=\"none\" stroke=\"#777\" stroke-width=\"0.7\" \
             stroke-dasharray=\"2 2\" points=\"{}\"/>",
            drawn_points(line, place)
        );
    }
    for (index, line) in named.enumerate() {
        let color = COLORS[index % COLORS.len()];
        let offset = 10.0 + 14.0 * index as f64;
        let legend_y = if ends_high { TOP + plot_height - offset } else { TOP + 4.0 + offset };
        let _ = write!(
            out,
            "<polyline fill=\"none\" stroke=\"{color}\" stroke-width=\"2\" points=\"{}\"/>\
             <text x=\"{}\" y=\"{legend_y}\" text-anchor=\"end\" fill=\"{color}\">{}</text>",
            drawn_points(line, place),
            LEFT + plot_width - 4.0,
            escape(&line.name)
        );
    }
    out
}

/// The finite points of a line, placed.
fn drawn_points(line: &Line, place: impl Fn((f64, f64)) -> (f64, f64)) -> String {
    let finite = line.points.iter().filter(|p| p.0.is_finite() && p.1.is_finite());
    let words: Vec<String> =
        finite.map(|p| place(*p)).map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    words.join(" ")
}

/// A heat map over two logarithmic axes, with a line where it is best in each row.
pub struct Heat {
    /// The title above it.
    pub title: String,
    /// The label of the x axis, with its unit.
    pub x: String,
    /// The label of the y axis, with its unit.
    pub y: String,
    /// The columns' x, rising.
    pub xs: Vec<f64>,
    /// The rows' y, rising upward.
    pub ys: Vec<f64>,
    /// Row-major values; one that is not finite stays grey.
    pub values: Vec<f64>,
    /// The best x of every row.
    pub ridge: Vec<f64>,
}

/// Heat maps side by side.
#[must_use]
pub fn heat_svg(maps: &[Heat]) -> String {
    let width = WIDTH * maps.len() as f64;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {HEIGHT}\" \
         font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"{width}\" height=\"{HEIGHT}\" fill=\"white\"/>\n"
    );
    for (index, map) in maps.iter().enumerate() {
        let x = WIDTH * index as f64;
        let _ = writeln!(svg, "<g transform=\"translate({x} 0)\">{}</g>", draw_heat(map));
    }
    svg + "</svg>\n"
}

fn draw_heat(map: &Heat) -> String {
    let (plot_width, plot_height) = (WIDTH - LEFT - 16.0, HEIGHT - TOP - 46.0);
    let (n_cols, n_rows) = (map.xs.len(), map.ys.len());
    let (cell_width, cell_height) = (plot_width / n_cols as f64, plot_height / n_rows as f64);
    let finite = || map.values.iter().copied().filter(|value| value.is_finite());
    let (low, high) = (finite().fold(f64::MAX, f64::min), finite().fold(f64::MIN, f64::max));
    let mut out = String::new();
    for (index, value) in map.values.iter().enumerate() {
        let x = LEFT + (index % n_cols) as f64 * cell_width;
        let y = TOP + plot_height - (index / n_cols + 1) as f64 * cell_height;
        let share = (value - low) / (high - low).max(f64::MIN_POSITIVE);
        let _ = write!(
            out,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"{}\"/>",
            cell_width + 0.2,
            cell_height + 0.2,
            if value.is_finite() { heat_color(share) } else { "#ccc".to_owned() }
        );
    }
    let along = |x: f64| {
        let place = (x / map.xs[0]).ln() / (map.xs[n_cols - 1] / map.xs[0]).ln();
        LEFT + (place * (n_cols as f64 - 1.0) + 0.5) * cell_width
    };
    let ridge: Vec<String> = (map.ridge.iter().enumerate())
        .filter(|(_, x)| x.is_finite())
        .map(|(row, x)| {
            let y = TOP + plot_height - (row as f64 + 0.5) * cell_height;
            format!("{:.1},{y:.1}", along(*x))
        })
        .collect();
    let _ = write!(
        out,
        "<polyline fill=\"none\" stroke=\"#d1495b\" stroke-width=\"2\" points=\"{}\"/>",
        ridge.join(" ")
    );
    for (title, x, y, size) in [
        (&map.title, LEFT + plot_width / 2.0, 18.0, 13),
        (&map.x, LEFT + plot_width / 2.0, HEIGHT - 14.0, 11),
    ] {
        let _ = write!(
            out,
            "<text x=\"{x}\" y=\"{y}\" text-anchor=\"middle\" font-size=\"{size}\">{}</text>",
            escape(title)
        );
    }
    let _ = write!(
        out,
        "<text transform=\"translate(13 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
        TOP + plot_height / 2.0,
        escape(&map.y)
    );
    for index in [0, n_cols / 2, n_cols - 1] {
        let x = along(map.xs[index]);
        let (bottom, label) = (HEIGHT - 31.0, number(map.xs[index]));
        let _ =
            write!(out, "<text x=\"{x:.1}\" y=\"{bottom}\" text-anchor=\"middle\">{label}</text>");
    }
    for index in [0, n_rows / 2, n_rows - 1] {
        let y = TOP + plot_height - (index as f64 + 0.5) * cell_height + 4.0;
        let (right, label) = (LEFT - 5.0, format!("{:.3}", map.ys[index]));
        let _ = write!(out, "<text x=\"{right}\" y=\"{y:.1}\" text-anchor=\"end\">{label}</text>");
    }
    let range = format!("dark {} to bright {}", number(low), number(high));
    out + &format!(
        "<text x=\"{}\" y=\"{}\" text-anchor=\"end\" fill=\"#444\">{range}</text>",
        LEFT + plot_width,
        TOP - 4.0
    )
}

/// Dark blue at 0 over green to yellow at 1.
fn heat_color(share: f64) -> String {
    let stops = [(43.0, 33.0, 86.0), (28.0, 128.0, 128.0), (240.0, 225.0, 70.0)];
    let place = share.clamp(0.0, 1.0) * 2.0;
    let from = (place as usize).min(1);
    let part = place - from as f64;
    let mix = |a: f64, b: f64| (a + (b - a) * part).round() as u8;
    let (a, b) = (stops[from], stops[from + 1]);
    format!("#{:02x}{:02x}{:02x}", mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}

/// The next of 1, 2, 2.5, 5 times a power of ten.
fn nice(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    [1.0, 2.0, 2.5, 5.0, 10.0]
        .into_iter()
        .map(|step| step * power)
        .find(|step| *step >= value * 0.999)
        .unwrap_or(value)
}

fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_at_the_maximum_is_at_the_top_right() {
        let line = Line { name: "a<b".to_owned(), points: vec![(0.0, 0.0), (20.0, 1.0)] };
        let panel = Panel { title: "t".into(), x: "x".into(), y: "y".into(), lines: vec![line] };
        let drawn = svg(&[panel]);
        assert!(drawn.contains(&format!("{:.1},{TOP:.1}", WIDTH - 16.0)), "{drawn}");
        assert!(drawn.contains("a&lt;b"));
    }

    #[test]
    fn a_line_without_a_name_is_dotted_and_not_in_the_legend() {
        let line = |name: &str| Line { name: name.to_owned(), points: vec![(0.0, 1.0)] };
        let lines = vec![line(""), line("named"), line("")];
        let panel = Panel { title: String::new(), x: String::new(), y: String::new(), lines };
        let drawn = svg(&[panel]);
        assert_eq!(drawn.matches("stroke-dasharray").count(), 2);
        // The first colour is that of the first named line.
        assert_eq!(drawn.matches(COLORS[0]).count(), 2);
        assert!(!drawn.contains(COLORS[1]), "{drawn}");
    }

    #[test]
    fn a_heat_map_omits_missing_values() {
        let map = Heat {
            title: "t".into(),
            x: "x".into(),
            y: "y".into(),
            xs: vec![1.0, 10.0],
            ys: vec![0.1, 1.0],
            values: vec![0.0, 2.0, f64::NAN, 1.0],
            ridge: vec![10.0, f64::NAN],
        };
        let drawn = heat_svg(&[map]);
        assert_eq!((heat_color(0.0), heat_color(1.0)), ("#2b2156".into(), "#f0e146".into()));
        for color in ["#2b2156", "#f0e146", "#ccc", "#1c8080"] {
            assert_eq!(drawn.matches(&format!("fill=\"{color}\"")).count(), 1, "{color}");
        }
    }

    #[test]
    fn axes_end_at_round_numbers() {
        assert!((nice(0.93) - 1.0).abs() < 1e-12);
        assert!((nice(37.0) - 50.0).abs() < 1e-9);
    }
}
