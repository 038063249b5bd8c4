//! The memory of a training, estimated before it starts from the readings of its objects.

/// Bytes for each reading, and for each of its values, that are kept of all objects until the
/// training ends.
///
/// Fitted with [`WORK_VALUE_BYTES`]: three boxes, 32 × 32 taxels and two threads took 232 MB with
/// 1,000 touches of each and 955 MB with 4,000, 97 and 99 % of the estimate.
const READING_BYTES: u64 = 300;
const VALUE_BYTES: u64 = 15;
/// Bytes for each value of the readings of an object that a thread works on.
const WORK_VALUE_BYTES: u64 = 95;

/// The readings that an object is trained from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Load {
    pub(crate) n_readings: u64,
    /// Number of values of each: its taxels, and the client's feature.
    pub(crate) n_values: u64,
}

impl Load {
    fn values(self) -> u64 {
        self.n_readings.saturating_mul(self.n_values)
    }

    fn kept(self) -> u64 {
        let readings = self.n_readings.saturating_mul(READING_BYTES);
        readings.saturating_add(self.values().saturating_mul(VALUE_BYTES))
    }
}

/// Bytes of a training of these objects on a number of threads.
pub(crate) fn memory_bytes(loads: &[Load], n_threads: usize) -> u64 {
    let kept = loads.iter().fold(0_u64, |sum, load| sum.saturating_add(load.kept()));
    let mut values: Vec<u64> = loads.iter().map(|load| load.values()).collect();
    values.sort_unstable_by_key(|values| std::cmp::Reverse(*values));
    let largest = values.iter().take(n_threads.max(1)).fold(0_u64, |a, b| a.saturating_add(*b));
    kept.saturating_add(largest.saturating_mul(WORK_VALUE_BYTES))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_factor_of_the_product_counts() {
        let load = |n_readings, n_values| Load { n_readings, n_values };
        let mb = |loads: &[Load]| memory_bytes(loads, 2) / 1_000_000;
        assert_eq!(mb(&[load(1000, 1024); 3]), 241);
        assert_eq!(mb(&[load(4000, 1024); 3]), 966);
        assert_eq!(mb(&[load(20_000, 1024); 3]), 4830);
        assert_eq!(mb(&[load(20_000, 128 * 128); 3]), 77_022);
        assert_eq!(mb(&[load(20_000, 36 + 4096)]), 9096);
        // Many objects of the usual sensor.
        assert_eq!(mb(&[load(2400, 36); 100]), 218);
        assert_eq!(memory_bytes(&[load(u64::MAX, 2); 2], 2), u64::MAX);
        assert_eq!(memory_bytes(&[], 2), 0);
    }
}
