//! The exponential function in single precision, inlined into loops that call it millions of
//! times.
//!
//! A call of the system's function costs more, and its last bit depends on the processor;
//! this one consists of additions and multiplications, whose results are the same everywhere.

use std::f32::consts::LOG2_E;

/// ln 2 in two parts, the first with few enough bits that its multiples are exact.
const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];

/// Adding it rounds to the nearest integer, which is then in the low bits.
const ROUNDING: f32 = 12_582_912.0;

/// Range of arguments with normal results.
const RANGE: [f32; 2] = [-87.0, 88.0];

/// eˣ to 2 parts in 10⁷; x is clamped to −87 ..= 88.
#[inline]
#[must_use]
pub fn exp(x: f32) -> f32 {
    let x = x.clamp(RANGE[0], RANGE[1]);
    // eˣ = 2ⁿ eʳ with |r| ≤ ½ ln 2.
    let shifted = x * LOG2_E + ROUNDING;
    let n = shifted - ROUNDING;
    let r = x - n * LN_2[0] - n * LN_2[1];
    let tail = 0.5 + r * (0.166_666_66 + r * (0.041_666_66 + r * (0.008_333_4 + r * 0.001_388_9)));
    let power = f32::from_bits(shifted.to_bits().wrapping_add(127) << 23);
    power * (1.0 + r + r * r * tail)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_matches_the_library_function() {
        let mut worst = 0.0f64;
        for step in -86_999..=87_999 {
            let x = step as f32 * 0.001;
            let exact = f64::from(x).exp();
            worst = worst.max((f64::from(exp(x)) / exact - 1.0).abs());
        }
        assert!(worst < 2.5e-7, "{worst:e}");
        assert!((exp(0.0) - 1.0).abs() < f32::EPSILON);
    }

    #[test]
    fn arguments_are_clamped_to_the_range() {
        assert_eq!(exp(-1e6).to_bits(), exp(-87.0).to_bits());
        assert_eq!(exp(f32::NEG_INFINITY).to_bits(), exp(-87.0).to_bits());
        assert_eq!(exp(1e6).to_bits(), exp(88.0).to_bits());
        assert!(exp(-87.0) > 0.0 && exp(88.0).is_finite());
    }
}
