//! The exponential function in single precision, compiled into the loops that need it millions of
//! times a second.
//!
//! A call of the system's own costs more, and its last bit depends on the processor; this one is
//! made of additions and multiplications, whose results are the same everywhere.

use std::f32::consts::LOG2_E;

/// ln 2 in two parts, the first with few enough bits that its multiples are exact.
const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];

/// Adding it rounds to the nearest integer, which is then in the low bits.
const ROUNDING: f32 = 12_582_912.0;

/// Beyond it results would leave the range of normal numbers.
const RANGE: [f32; 2] = [-87.0, 88.0];

/// eˣ to 2 parts in 10⁷; x beyond −87 and 88 is taken to be that.
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
    fn it_is_the_exponential_function() {
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
    fn beyond_its_range_it_stays_what_it_is_at_the_ends() {
        assert_eq!(exp(-1e6).to_bits(), exp(-87.0).to_bits());
        assert_eq!(exp(f32::NEG_INFINITY).to_bits(), exp(-87.0).to_bits());
        assert_eq!(exp(1e6).to_bits(), exp(88.0).to_bits());
        assert!(exp(-87.0) > 0.0 && exp(88.0).is_finite());
    }
}
