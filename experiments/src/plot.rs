//! Line plots as SVG, small enough to write by hand.

use std::fmt::Write as _;

/// One line of a plot.
pub struct Line {
    /// Its name in the legend.
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
    for (index, line) in panel.lines.iter().enumerate() {
        let color = COLORS[index % COLORS.len()];
        let points: Vec<String> = line
            .points
            .iter()
            .filter(|p| p.0.is_finite() && p.1.is_finite())
            .map(|p| place(*p))
            .map(|(x, y)| format!("{x:.1},{y:.1}"))
            .collect();
        let offset = 10.0 + 14.0 * index as f64;
        let legend_y = if ends_high { TOP + plot_height - offset } else { TOP + 4.0 + offset };
        let _ = write!(
            out,
            "<polyline fill=\"none\" stroke=\"{color}\" stroke-width=\"2\" points=\"{}\"/>\
             <text x=\"{}\" y=\"{legend_y}\" text-anchor=\"end\" fill=\"{color}\">{}</text>",
            points.join(" "),
            LEFT + plot_width - 4.0,
            escape(&line.name)
        );
    }
    out
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
    fn axes_end_at_round_numbers() {
        assert!((nice(0.93) - 1.0).abs() < 1e-12);
        assert!((nice(37.0) - 50.0).abs() < 1e-9);
    }
}
