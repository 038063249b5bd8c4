//! Units: everything inside is SI; these constants make literals read as printed.
//!
//! `3.0 * MM` is a length in metres, `2.0 * KPA` a pressure in pascal.
//! Not here: conversions at the edge of the system (plots, command line).

/// One millimetre, in metres.
pub const MM: f64 = 1e-3;
/// One kilopascal, in pascal.
pub const KPA: f64 = 1e3;
/// One degree, in radians.
pub const DEG: f64 = std::f64::consts::PI / 180.0;
/// One inch, in metres (the dissertation gives coverings in inches).
pub const INCH: f64 = 25.4 * MM;
