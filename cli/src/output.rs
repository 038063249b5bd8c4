//! Output of answers: tables and sentences for people, one line of JSON for programs.

use std::borrow::Cow;
use std::io::Write as _;

use comfy_table::{Table, presets};
use palpate_client::schemas::Writer;
use serde::Serialize;

/// Destination of answers. With JSON, standard output holds nothing else.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Output {
    /// Whether the output is for a program.
    pub(crate) json: bool,
}

impl Output {
    /// Prints a message for a person.
    pub(crate) fn say(self, text: impl AsRef<str>) {
        let text = plain(text.as_ref());
        if self.json {
            eprintln!("{text}");
        } else {
            print_line(&text);
        }
    }

    /// Prints the answer: one line of JSON, or `text` of it.
    pub(crate) fn answer<T: Serialize>(
        self,
        answer: &T,
        text: impl FnOnce(&T) -> String,
    ) -> anyhow::Result<()> {
        if self.json {
            print_line(&json_text(&serde_json::to_string(answer)?));
        } else {
            print_line(&plain(&text(answer)));
        }
        Ok(())
    }
}

/// Writes a line to standard output. A closed pipe, such as that of `head`, does not abort the
/// command.
fn print_line(text: &str) {
    if let Err(error) = writeln!(std::io::stdout().lock(), "{text}")
        && error.kind() != std::io::ErrorKind::BrokenPipe
    {
        eprintln!("cannot write to the standard output: {error}");
    }
}

/// Text with terminal control characters escaped as `\u{1b}`. Servers, files and other people's
/// names may contain them. Line ends stay.
pub(crate) fn plain(text: &str) -> Cow<'_, str> {
    escaped(text, |c| c != '\n' && is_control(c), |c| c.escape_unicode().to_string())
}

/// A table cell: line ends are escaped as well, so that a cell stays one row.
fn cell(text: &str) -> Cow<'_, str> {
    escaped(text, is_control, |c| c.escape_unicode().to_string())
}

/// JSON with control characters escaped; the content is the same.
fn json_text(json: &str) -> Cow<'_, str> {
    // All of them are in the basic plane, so four digits suffice.
    escaped(json, is_control, |c| format!("\\u{:04x}", u32::from(c)))
}

fn escaped(
    text: &str,
    is_escaped: impl Fn(char) -> bool,
    escape: impl Fn(char) -> String,
) -> Cow<'_, str> {
    if !text.chars().any(&is_escaped) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_escaped(c) { shown.push_str(&escape(c)) } else { shown.push(c) }
    }
    Cow::Owned(shown)
}

/// Control characters, and marks that change the writing direction.
fn is_control(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// A table with a header, without borders.
pub(crate) fn table<const N: usize>(
    header: [&str; N],
    rows: impl IntoIterator<Item = [String; N]>,
) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header);
    for row in rows {
        table.add_row(row.map(|text| cell(&text).into_owned()));
    }
    table.to_string().lines().map(str::trim_end).collect::<Vec<_>>().join("\n")
}

/// The name of a choice on the wire.
pub(crate) fn word(choice: &impl Serialize) -> String {
    match serde_json::to_value(choice) {
        Ok(serde_json::Value::String(word)) => word,
        _ => "–".to_owned(),
    }
}

/// The key that wrote something.
pub(crate) fn writer(writer: Option<&Writer>) -> String {
    match writer {
        Some(writer) => writer.key_name.clone().unwrap_or_else(|| writer.key_id.to_string()),
        None => "not recorded".to_owned(),
    }
}

/// Metres as millimetres.
pub(crate) fn mm(metres: f64) -> String {
    format!("{:.1} mm", metres * 1e3)
}

/// Radians as degrees.
pub(crate) fn degrees(radians: f64) -> String {
    format!("{:.1}°", radians.to_degrees())
}

/// Explanation of pose errors.
pub(crate) const ERRORS_OF_POSE: &str = "Errors of a pose are those of the nearest pose that looks the same by the symmetry of \
     the mesh.";

/// A share as a bar of ten characters.
pub(crate) fn bar(share: f64) -> String {
    let filled = (share.clamp(0.0, 1.0) * 10.0).round() as usize;
    format!("{}{}", "█".repeat(filled), "░".repeat(10 - filled))
}

/// Median; the mean of the two middle values if their number is even.
pub(crate) fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let upper = *sorted.get(sorted.len() / 2)?;
    let lower = sorted[(sorted.len() - 1) / 2];
    Some(f64::midpoint(lower, upper))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_even_and_odd_many() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), Some(2.5));
    }

    #[test]
    fn nothing_that_is_printed_steers_a_terminal() {
        let evil = "a\u{1b}]0;owned\u{7}\u{9b}2J\u{202e}b";
        let shown = plain(evil);
        assert_eq!(shown, "a\\u{1b}]0;owned\\u{7}\\u{9b}2J\\u{202e}b");
        assert_eq!(plain("two\nlines é"), "two\nlines é");
        let table = table(["name", "of"], [[format!("{evil}\nrow"), "x".to_owned()]]);
        assert_eq!(table.lines().count(), 2, "{table}");
        assert!(!table.contains(|c: char| c != '\n' && is_control(c)), "{table:?}");
        let json = serde_json::to_string(evil).unwrap();
        let shown = json_text(&json);
        assert!(!shown.contains(is_control), "{shown:?}");
        assert_eq!(serde_json::from_str::<String>(&shown).unwrap(), evil);
    }

    #[test]
    fn a_bar_is_always_as_long() {
        for share in [-1.0, 0.0, 0.44, 1.0, 7.0] {
            assert_eq!(bar(share).chars().count(), 10);
        }
        assert_eq!(bar(0.44), "████░░░░░░");
    }
}
