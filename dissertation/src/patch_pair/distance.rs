//! Bins of the distance between two patches.
//!
//! Source: section 5.3.4, equation 5.20, with the readings of `docs/equations.md`: distances
//! are Euclidean; the map stores the one bin of a distance, a query spreads over at most two
//! by a box of one bin's width.

use thiserror::Error;

/// Uniform bins over a range of distances, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistanceBins {
    min: f64,
    max: f64,
    n: u16,
}

/// Error of numbers that are not a range of distance bins.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("distance bins from {min} m to {max} m in {n}, expected 0 <= min < max and at least one")]
pub struct DistanceBinsError {
    min: f64,
    max: f64,
    n: u16,
}

impl DistanceBins {
    /// `n` bins from `min` to `max` metres.
    ///
    /// # Errors
    /// [`DistanceBinsError`] unless 0 ≤ `min` < `max`, both finite, and `n` > 0.
    pub fn new(min: f64, max: f64, n: u16) -> Result<Self, DistanceBinsError> {
        if min.is_finite() && max.is_finite() && 0.0 <= min && min < max && n > 0 {
            Ok(Self { min, max, n })
        } else {
            Err(DistanceBinsError { min, max, n })
        }
    }

    /// Start of the first bin, metres.
    #[must_use]
    pub fn min(&self) -> f64 {
        self.min
    }

    /// The end of the last bin, metres.
    #[must_use]
    pub fn max(&self) -> f64 {
        self.max
    }

    /// The number of bins.
    #[must_use]
    pub fn n(&self) -> u16 {
        self.n
    }

    /// The bin of a distance.
    #[must_use]
    pub fn bin(&self, distance: f64) -> Option<u16> {
        self.bin_at(self.position(distance))
    }

    /// The bins that a box of one bin's width around `distance` covers, with the share of
    /// each; bins beyond the range are left out.
    #[must_use]
    pub fn covering(&self, distance: f64) -> [Option<(u16, f64)>; 2] {
        let low = self.position(distance) - 0.5;
        let upper_share = low - low.floor();
        let part = |position: f64, share: f64| {
            let bin = if share > 0.0 { self.bin_at(position) } else { None };
            bin.map(|bin| (bin, share))
        };
        [part(low.floor(), 1.0 - upper_share), part(low.floor() + 1.0, upper_share)]
    }

    fn position(&self, distance: f64) -> f64 {
        (distance - self.min) / (self.max - self.min) * f64::from(self.n)
    }

    fn bin_at(&self, position: f64) -> Option<u16> {
        (position >= 0.0 && position < f64::from(self.n)).then_some(position as u16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_core::units::MM;

    #[test]
    fn a_distance_at_a_bins_center_covers_that_bin_alone() {
        // Equation 5.20: 40 bins over 30–160 mm are 3.25 mm wide; bin 2 is centred at 38.125.
        let bins = DistanceBins::new(30.0 * MM, 160.0 * MM, 40).unwrap();
        let covering = bins.covering(38.125 * MM);
        let main = covering.into_iter().flatten().find(|(_, share)| *share > 0.5).unwrap();
        assert_eq!(main.0, 2);
        assert!((main.1 - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_distance_between_two_bins_is_shared() {
        // Width 1 mm; 3.75 mm is 0.25 mm above the centre of bin 3: shares 0.75 and 0.25.
        let bins = DistanceBins::new(0.0, 10.0 * MM, 10).unwrap();
        let [low, high] = bins.covering(3.75 * MM);
        assert_eq!((low.unwrap().0, high.unwrap().0), (3, 4));
        assert!((low.unwrap().1 - 0.75).abs() < 1e-9 && (high.unwrap().1 - 0.25).abs() < 1e-9);
    }

    #[test]
    fn distances_out_of_range_have_no_bin() {
        let bins = DistanceBins::new(8.0 * MM, 110.0 * MM, 40).unwrap();
        assert_eq!(bins.bin(7.9 * MM), None);
        assert_eq!(bins.bin(110.1 * MM), None);
        assert_eq!(bins.bin(8.0 * MM), Some(0));
        assert!(bins.covering(200.0 * MM).iter().all(Option::is_none));
    }

    #[test]
    fn an_empty_range_is_refused() {
        assert!(DistanceBins::new(0.03, 0.03, 40).is_err());
        assert!(DistanceBins::new(f64::NAN, 0.03, 40).is_err());
        assert!(DistanceBins::new(0.0, 0.03, 0).is_err());
    }
}
