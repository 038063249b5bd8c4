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

/// A number of bytes in a message: three digits, in decimal units (1 MB is 10⁶ bytes).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bytes(pub u64);

impl std::fmt::Display for Bytes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (mut value, mut unit) = (self.0 as f64, 0);
        // What rounds to 1000 is written in the next unit.
        while value >= 999.5 && unit < 4 {
            (value, unit) = (value / 1000.0, unit + 1);
        }
        let digits = match value {
            _ if unit == 0 => 0,
            99.95.. => 0,
            9.995.. => 1,
            _ => 2,
        };
        write!(f, "{value:.digits$} {}", ["B", "kB", "MB", "GB", "TB"][unit])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_have_three_digits_and_decimal_units() {
        let shown = |n: u64| Bytes(n).to_string();
        assert_eq!([0, 999, 1000, 12_345].map(shown), ["0 B", "999 B", "1.00 kB", "12.3 kB"]);
        assert_eq!(
            [370_294, 999_499, 999_500, 64 << 20, 2_500_000_000].map(shown),
            ["370 kB", "999 kB", "1.00 MB", "67.1 MB", "2.50 GB"]
        );
        assert_eq!(shown(3_000_000_000_000_000), "3000 TB");
    }

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
