//! Features of many touches, laid out for comparison with several at once.
//!
//! Results equal those of [`ratio`](super::agreement::ratio) to the bit; eight touches are
//! computed side by side. Their features fill one cache line.

use std::ops::Range;

use super::agreement::{Feature, N_AXES, STEPS, StoredFeature, kernel_of, ratio_of};

/// Patches that are compared at once.
const LANES: usize = 8;

/// The features of [`LANES`] touches, axis by axis.
type Block = [[i8; LANES]; N_AXES];

/// Features of touches in their order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Features {
    /// Blocks of features; the last one is padded with zeros.
    blocks: Vec<Block>,
    len: usize,
}

impl Features {
    /// Features in their order.
    pub fn new<'a>(features: impl ExactSizeIterator<Item = &'a StoredFeature>) -> Self {
        let len = features.len();
        let mut blocks = vec![Block::default(); len.div_ceil(LANES)];
        for (index, feature) in features.enumerate() {
            let block = &mut blocks[index / LANES];
            block.iter_mut().zip(feature).for_each(|(axis, value)| axis[index % LANES] = *value);
        }
        Self { blocks, len }
    }

    /// Number of patches.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are no features.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Appends the [`ratio`](super::agreement::ratio) of `feature` at each patch of `range` to
    /// `found`, in their order.
    ///
    /// # Panics
    /// When `range` is not within the touches.
    pub fn ratios(
        &self,
        feature: &Feature,
        range: Range<usize>,
        [softness, density]: [f32; 2],
        found: &mut Vec<f32>,
    ) {
        assert!(range.end <= self.len, "{range:?} of {} touches", self.len);
        found.reserve(range.len());
        let mut next = range.start;
        while next < range.end {
            let (block, first) = (next / LANES, next % LANES);
            // Loops, since `map` of an array is not inlined here.
            let mut ratios = squares(feature, &self.blocks[block]);
            for ratio in &mut ratios {
                *ratio = ratio_of(kernel_of(*ratio, softness), density);
            }
            let last = LANES.min(range.end - block * LANES);
            found.extend_from_slice(&ratios[first..last]);
            next += last - first;
        }
    }

    /// The sum over all patches of their agreement with `feature`
    /// ([`kernel`](super::agreement::kernel)).
    #[must_use]
    pub fn agreement(&self, feature: &Feature, softness: f32) -> f32 {
        let mut left = self.len;
        let mut sum = 0.0;
        for block in &self.blocks {
            let mut agreements = squares(feature, block);
            for agreement in &mut agreements {
                *agreement = kernel_of(*agreement, softness);
            }
            sum += agreements[..left.min(LANES)].iter().sum::<f32>();
            left = left.saturating_sub(LANES);
        }
        sum
    }

    /// Bytes in memory.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.blocks.as_slice())
    }
}

/// Squared distances (in deviations) of a feature from those of a block.
#[inline]
fn squares(feature: &Feature, block: &Block) -> [f32; LANES] {
    let mut squares = [0.0; LANES];
    for (value, axis) in feature.iter().zip(block) {
        for (square, stored) in squares.iter_mut().zip(axis) {
            let difference = value - f32::from(*stored) * (1.0 / STEPS);
            *square += difference * difference;
        }
    }
    squares
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::agreement::{kernel, ratio, stored};
    use palpate_core::rng::{Purpose, Stream};

    fn some(n: usize) -> Vec<Feature> {
        let mut stream = Stream::new(1, Purpose::Shape, 0);
        (0..n).map(|_| [0.0; N_AXES].map(|_: f32| stream.uniform(-9.0, 9.0) as f32)).collect()
    }

    #[test]
    fn all_at_once_touches_agree_as_one_by_one_to_the_bit() {
        let known: Vec<StoredFeature> = some(53).iter().map(stored).collect();
        let features = Features::new(known.iter());
        // Seven blocks of 64 bytes.
        assert_eq!((features.len(), features.bytes(), features.is_empty()), (53, 7 * 64, false));
        for feature in some(20) {
            for range in [0..53, 7..50, 16..32, 9..9] {
                let mut found = vec![7.0];
                features.ratios(&feature, range.clone(), [1.5, 0.03], &mut found);
                let alone = known[range].iter().map(|other| ratio(&feature, other, 1.5, 0.03));
                let expected: Vec<f32> = std::iter::once(7.0).chain(alone).collect();
                assert_eq!(found, expected);
            }
            let sum: f32 = known.iter().map(|other| kernel(&feature, other, 1.5)).sum();
            let found = features.agreement(&feature, 1.5);
            assert!((found / sum - 1.0).abs() < 1e-5, "{found} {sum}");
        }
        let none = Features::default();
        assert!(none.is_empty() && none.agreement(&[0.0; N_AXES], 1.0).abs() < 1e-9);
    }
}
