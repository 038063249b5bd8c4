//! Confusion and affinity side by side, as an SVG.

use std::fmt::Write;

use palpate_client::schemas::AppearanceReport;

/// The side of a cell, pixels.
const CELL: f64 = 16.0;
/// Width of the names, pixels.
const NAMES: f64 = 120.0;
/// Height of a matrix's title, pixels.
const TITLE: f64 = 24.0;
/// Colours of 0 and 1.
const WHITE: [f64; 3] = [255.0, 255.0, 255.0];
const BLUE: [f64; 3] = [8.0, 48.0, 107.0];

/// Both matrices of a report.
pub(super) fn svg(report: &AppearanceReport) -> String {
    let names: Vec<&str> = report.objects.iter().map(|object| object.name.as_str()).collect();
    let side = names.len() as f64 * CELL;
    let (width, height) = (2.0 * (NAMES + side) + CELL, TITLE + NAMES + side + CELL);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    let confusion = format!("Confusion after {} readings", report.n_readings);
    panel(&mut out, 0.0, &confusion, &names, &report.confusion);
    panel(&mut out, NAMES + side, "Affinity of histograms", &names, &report.affinity);
    out + "</svg>\n"
}

/// One matrix, with its left edge at `left`.
fn panel(out: &mut String, left: f64, title: &str, names: &[&str], rows: &[Vec<f64>]) {
    let (x0, y0) = (left + NAMES, TITLE + NAMES);
    text(out, [x0, 16.0], "font-weight=\"bold\"", title);
    for (place, name) in names.iter().enumerate() {
        let along = (place as f64 + 0.75) * CELL;
        text(out, [x0 - 4.0, y0 + along], "text-anchor=\"end\"", name);
        let [x, y] = [x0 + along, y0 - 4.0];
        text(out, [x, y], &format!("transform=\"rotate(-90 {x} {y})\""), name);
    }
    for (row, values) in rows.iter().enumerate() {
        for (col, value) in values.iter().enumerate() {
            let (x, y) = (x0 + col as f64 * CELL, y0 + row as f64 * CELL);
            let (from, to) = (escaped(names[row]), escaped(names[col]));
            write_line(
                out,
                format_args!(
                    "<rect x=\"{x}\" y=\"{y}\" width=\"{CELL}\" height=\"{CELL}\" fill=\"{}\" \
                 stroke=\"#ddd\"><title>{from}, {to}: {value:.3}</title></rect>",
                    color(*value)
                ),
            );
        }
    }
}

fn text(out: &mut String, [x, y]: [f64; 2], attributes: &str, content: &str) {
    let content = escaped(content);
    write_line(out, format_args!("<text x=\"{x}\" y=\"{y}\" {attributes}>{content}</text>"));
}

fn write_line(out: &mut String, line: std::fmt::Arguments<'_>) {
    writeln!(out, "{line}").expect("a string takes everything");
}

/// The colour of a share, 0 to 1.
fn color(share: f64) -> String {
    let share = share.clamp(0.0, 1.0);
    let [r, g, b] = [0, 1, 2].map(|i| (WHITE[i] + share * (BLUE[i] - WHITE[i])).round() as u8);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Escapes text for SVG. The server's object names need it not, others may.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_run_from_white_to_blue() {
        assert_eq!((color(0.0).as_str(), color(1.0).as_str()), ("#ffffff", "#08306b"));
        assert_eq!(color(-3.0), "#ffffff");
        // The mean of 255 and 8, 48, 107.
        assert_eq!(color(0.5), "#8498b5");
    }

    #[test]
    fn names_cannot_break_the_picture() {
        assert_eq!(escaped("<a&b>"), "&lt;a&amp;b&gt;");
    }
}
