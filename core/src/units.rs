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

/// A number beyond one of these limits, in its refusal: as [`Shown`], with as many more digits as
/// distinguish it from the limits as those are shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond<const N: usize>(pub f64, pub [f64; N]);

/// Significant digits of a number in a message.
const DIGITS: usize = 6;

impl std::fmt::Display for Shown {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write_number(f, rounded(self.0, DIGITS))
    }
}

impl<const N: usize> std::fmt::Display for Beyond<N> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let limits = self.1.map(|limit| rounded(limit, DIGITS).to_bits());
        let mut forms = (DIGITS..17).map(|digits| rounded(self.0, digits));
        write_number(f, forms.find(|form| !limits.contains(&form.to_bits())).unwrap_or(self.0))
    }
}

fn rounded(value: f64, digits: usize) -> f64 {
    let scientific = format!("{value:.*e}", digits - 1);
    scientific.parse().unwrap_or(value)
}

/// Writes the shortest form that is read as this number.
fn write_number(f: &mut std::fmt::Formatter<'_>, value: f64) -> std::fmt::Result {
    let size = value.abs();
    let is_plain = size == 0.0 || !size.is_finite() || (1e-4..1e7).contains(&size);
    if is_plain { write!(f, "{value}") } else { write!(f, "{value:e}") }
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
    fn a_refused_number_differs_from_the_limit_it_broke() {
        let shown = |value: f64, limit: f64| Beyond(value, [0.0, limit]).to_string();
        assert_eq!(shown(1.000_000_1, 1.0), "1.0000001");
        assert_eq!(shown(f64::next_up(0.5), 0.5), "0.5000000000000001");
        let pi = std::f64::consts::PI;
        assert_eq!(shown(f64::next_up(pi), pi), "3.141593");
        assert_eq!((shown(1e308, 1.0), shown(-1e-300, 1.0)), ("1e308".into(), "-1e-300".into()));
    }

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
