//! Units: all values are SI; these constants make literals read as printed.
//!
//! `3.0 * MM` is a length in metres, `2.0 * KPA` a pressure in pascal. Not here: conversions
//! at the edge of the system (plots, command line).

/// One millimetre, in metres.
pub const MM: f64 = 1e-3;
/// One kilopascal, in pascal.
pub const KPA: f64 = 1e3;
/// One degree, in radians.
pub const DEG: f64 = std::f64::consts::PI / 180.0;
/// One inch, in metres (the dissertation gives coverings in inches).
pub const INCH: f64 = 25.4 * MM;

/// A number in a message: at most six significant digits, very large and very small ones with an
/// exponent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown(pub f64);

impl std::fmt::Display for Shown {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let size = self.0.abs();
        if size == 0.0 || !size.is_finite() {
            return write!(f, "{}", self.0);
        }
        // Five digits after the first; the shortest form of the rounded number.
        let scientific = format!("{:.5e}", self.0);
        let rounded: f64 = scientific.parse().unwrap_or(self.0);
        if (1e-4..1e7).contains(&size) { write!(f, "{rounded}") } else { write!(f, "{rounded:e}") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_messages_have_at_most_six_digits() {
        let shown = |value: f64| Shown(value).to_string();
        assert_eq!(shown(27_711_999.999_999_996), "2.7712e7");
        assert_eq!(shown(4_100.000_000_000_01), "4100");
        assert_eq!(
            (shown(0.1 + 0.2), shown(1e308), shown(0.0)),
            ("0.3".into(), "1e308".into(), "0".into())
        );
        assert_eq!(
            (shown(-1.5), shown(1e-9), shown(f64::NAN)),
            ("-1.5".into(), "1e-9".into(), "NaN".into())
        );
        assert_eq!(shown(78.125), "78.125");
    }
}
