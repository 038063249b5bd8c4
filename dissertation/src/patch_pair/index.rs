//! The pair index of one object: packed posting lists keyed (class, class, distance bin).
//!
//! Source: section 5.3.6's hash multi-map, laid out as sorted blocks: a table of offsets and
//! one array of 6-byte postings. A pair is stored once, under its classes in ascending order;
//! a query of two equal classes matches it in both orders.

use std::ops::Range;

use super::distance::DistanceBins;
use palpate_core::vocabulary::{Association, ClassIdx};

/// Maximum number of patches of an object: a posting names a patch in two bytes.
pub const MAX_PATCHES: usize = 1 << 16;

/// One stored pair of patches: the first is of the lower class of its key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Posting {
    /// The patch of the key's first class.
    pub first: u16,
    /// The patch of the key's second class.
    pub second: u16,
    /// Pr(first given its class) · Pr(second given its class), in 65,535ths.
    pub weight: u16,
}

/// All pairs of an object's patches, by appearance and distance.
#[derive(Clone, Debug, PartialEq)]
pub struct PairIndex {
    n_classes: usize,
    distances: DistanceBins,
    offsets: Vec<u32>,
    postings: Vec<Posting>,
}

/// The indexed properties of a patch.
pub struct IndexedPatch<'a> {
    /// Position in the object frame, metres.
    pub position: [f32; 3],
    /// Appearance classes.
    pub classes: &'a [Association],
}

impl PairIndex {
    /// Indexes every unordered pair of patches whose distance has a bin.
    #[must_use]
    pub fn build(patches: &[IndexedPatch<'_>], n_classes: usize, distances: DistanceBins) -> Self {
        let n_keys = n_classes * (n_classes + 1) / 2 * usize::from(distances.n());
        let mut counts = vec![0u32; n_keys + 1];
        for_each_entry(patches, n_classes, distances, |key, _| counts[key + 1] += 1);
        for key in 1..counts.len() {
            counts[key] += counts[key - 1];
        }
        let offsets = counts.clone();
        let empty = Posting { first: 0, second: 0, weight: 0 };
        let mut postings = vec![empty; offsets[n_keys] as usize];
        for_each_entry(patches, n_classes, distances, |key, posting| {
            postings[counts[key] as usize] = posting;
            counts[key] += 1;
        });
        Self { n_classes, distances, offsets, postings }
    }

    /// Restores an index from its stored arrays.
    ///
    /// `None` when they are inconsistent: offsets of the wrong length or falling, or postings
    /// that name a patch at or beyond `n_patches`.
    #[must_use]
    pub fn from_parts(
        n_classes: usize,
        distances: DistanceBins,
        offsets: Vec<u32>,
        postings: Vec<Posting>,
        n_patches: usize,
    ) -> Option<Self> {
        let n_keys = n_classes * (n_classes + 1) / 2 * usize::from(distances.n());
        let fits = offsets.len() == n_keys + 1
            && offsets.first() == Some(&0)
            && offsets.windows(2).all(|pair| pair[0] <= pair[1])
            && offsets.last().is_some_and(|last| *last as usize == postings.len())
            && postings
                .iter()
                .all(|posting| usize::from(posting.first.max(posting.second)) < n_patches);
        fits.then_some(Self { n_classes, distances, offsets, postings })
    }

    /// The distance bins of the keys.
    #[must_use]
    pub fn distances(&self) -> DistanceBins {
        self.distances
    }

    /// The number of appearance classes of the keys.
    #[must_use]
    pub fn n_classes(&self) -> usize {
        self.n_classes
    }

    /// The start of each key's postings; one more entry than there are keys.
    #[must_use]
    pub fn offsets(&self) -> &[u32] {
        &self.offsets
    }

    /// All postings, in the order of their keys.
    #[must_use]
    pub fn postings(&self) -> &[Posting] {
        &self.postings
    }

    /// The memory of the index, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.offsets.as_slice()) + size_of_val(self.postings.as_slice())
    }

    /// The most likely appearance class of each patch of `range`: the one with the largest
    /// sum of weights in the pairs that name the patch. `None` for a patch without pairs.
    #[must_use]
    pub fn likeliest_classes(&self, range: Range<usize>) -> Vec<Option<ClassIdx>> {
        let mut tally = vec![0u64; range.len() * self.n_classes];
        let n_bins = usize::from(self.distances.n());
        let pairs =
            (0..self.n_classes).flat_map(|low| (low..self.n_classes).map(move |c| (low, c)));
        for (pair, (low, high)) in pairs.enumerate() {
            let (begin, end) = (self.offsets[pair * n_bins], self.offsets[(pair + 1) * n_bins]);
            for posting in &self.postings[begin as usize..end as usize] {
                for (patch, class) in [(posting.first, low), (posting.second, high)] {
                    if range.contains(&usize::from(patch)) {
                        let row = usize::from(patch) - range.start;
                        tally[row * self.n_classes + class] += u64::from(posting.weight);
                    }
                }
            }
        }
        tally.chunks(self.n_classes.max(1)).map(likeliest).collect()
    }

    /// Sums of the postings' weights: by class, each posting under both of its classes, and by
    /// distance bin.
    #[must_use]
    pub fn masses(&self) -> (Vec<f64>, Vec<f64>) {
        let n_bins = usize::from(self.distances.n());
        let (mut classes, mut bins) = (vec![0.0; self.n_classes], vec![0.0; n_bins]);
        let pairs =
            (0..self.n_classes).flat_map(|low| (low..self.n_classes).map(move |c| (low, c)));
        for (pair, (low, high)) in pairs.enumerate() {
            for (bin, sum) in bins.iter_mut().enumerate() {
                let key = pair * n_bins + bin;
                let list = self.offsets[key] as usize..self.offsets[key + 1] as usize;
                let weights = self.postings[list].iter().map(|p| u64::from(p.weight));
                let mass = weights.sum::<u64>() as f64 / f64::from(u16::MAX);
                classes[low] += mass;
                classes[high] += mass;
                *sum += mass;
            }
        }
        (classes, bins)
    }

    /// Calls `visit(patch a, patch b, weight)` for every stored ordered pair whose patch a is
    /// of class `a`, patch b of class `b`, and whose distance lies in `bin`.
    pub fn matches(
        &self,
        a: ClassIdx,
        b: ClassIdx,
        bin: u16,
        mut visit: impl FnMut(u16, u16, f64),
    ) {
        let (low, high) = (a.0.min(b.0), a.0.max(b.0));
        let key = key_of(self.n_classes, self.distances.n(), low, high, bin);
        let list = &self.postings[self.offsets[key] as usize..self.offsets[key + 1] as usize];
        for posting in list {
            let weight = f64::from(posting.weight) / f64::from(u16::MAX);
            if a.0 <= b.0 {
                visit(posting.first, posting.second, weight);
            }
            if b.0 <= a.0 {
                visit(posting.second, posting.first, weight);
            }
        }
    }
}

/// The class with the largest sum, the first of equals; `None` when all are 0.
fn likeliest(sums: &[u64]) -> Option<ClassIdx> {
    let most = sums.iter().copied().max().filter(|most| *most > 0)?;
    sums.iter().position(|sum| *sum == most).map(|class| ClassIdx(class as u8))
}

/// The key of classes `low` ≤ `high` and a distance bin.
fn key_of(n_classes: usize, n_bins: u16, low: u8, high: u8, bin: u16) -> usize {
    let (low, high) = (usize::from(low), usize::from(high));
    let classes = low * (2 * n_classes - low + 1) / 2 + (high - low);
    classes * usize::from(n_bins) + usize::from(bin)
}

fn for_each_entry(
    patches: &[IndexedPatch<'_>],
    n_classes: usize,
    distances: DistanceBins,
    mut visit: impl FnMut(usize, Posting),
) {
    for (b, patch_b) in patches.iter().enumerate() {
        for (a, patch_a) in patches[..b].iter().enumerate() {
            let Some(bin) = distances.bin(distance(patch_a.position, patch_b.position)) else {
                continue;
            };
            for class_a in patch_a.classes {
                for class_b in patch_b.classes {
                    let weight = (class_a.weight * class_b.weight * f64::from(u16::MAX)) as u16;
                    let (ca, cb) = (class_a.class.0, class_b.class.0);
                    let (first, second) = if ca <= cb { (a, b) } else { (b, a) };
                    let key = key_of(n_classes, distances.n(), ca.min(cb), ca.max(cb), bin);
                    let posting = Posting { first: first as u16, second: second as u16, weight };
                    visit(key, posting);
                }
            }
        }
    }
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f64 {
    let square = |i: usize| f64::from(a[i] - b[i]).powi(2);
    (square(0) + square(1) + square(2)).sqrt()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use palpate_core::rng::{Purpose, Stream};
    use palpate_core::units::MM;

    fn random_patches(n: usize) -> Vec<([f32; 3], Vec<Association>)> {
        let mut stream = Stream::new(2, Purpose::Sampling, 0);
        (0..n)
            .map(|_| {
                let position = (stream.direction() * 30.0 * MM).to_array().map(|v| v as f32);
                let first = stream.index(4) as u8;
                let classes = vec![
                    Association { class: ClassIdx(first), weight: 0.6 },
                    Association { class: ClassIdx((first + 1) % 4), weight: 0.4 },
                ];
                (position, classes)
            })
            .collect()
    }

    fn indexed(patches: &[([f32; 3], Vec<Association>)]) -> PairIndex {
        let patches: Vec<IndexedPatch<'_>> = patches
            .iter()
            .map(|(position, classes)| IndexedPatch { position: *position, classes })
            .collect();
        PairIndex::build(&patches, 4, DistanceBins::new(8.0 * MM, 60.0 * MM, 10).unwrap())
    }

    /// Every ordered pair that a linear search finds for one key.
    fn naive(
        patches: &[([f32; 3], Vec<Association>)],
        bins: DistanceBins,
        key: (u8, u8, u16),
    ) -> BTreeSet<(u16, u16)> {
        let has = |patch: usize, class: u8| patches[patch].1.iter().any(|c| c.class.0 == class);
        let n = patches.len();
        let pairs = (0..n).flat_map(|a| (0..n).map(move |b| (a, b)));
        pairs
            .filter(|(a, b)| a != b && has(*a, key.0) && has(*b, key.1))
            .filter(|(a, b)| bins.bin(distance(patches[*a].0, patches[*b].0)) == Some(key.2))
            .map(|(a, b)| (a as u16, b as u16))
            .collect()
    }

    #[test]
    fn every_key_matches_a_linear_search() {
        let patches = random_patches(40);
        let index = indexed(&patches);
        for a in 0..4u8 {
            for b in 0..4u8 {
                for bin in 0..10 {
                    let mut found = Vec::new();
                    index.matches(ClassIdx(a), ClassIdx(b), bin, |x, y, _| found.push((x, y)));
                    let expected = naive(&patches, index.distances(), (a, b, bin));
                    assert_eq!(found.len(), expected.len(), "no pair twice");
                    assert_eq!(BTreeSet::from_iter(found), expected, "{a} {b} {bin}");
                }
            }
        }
    }

    #[test]
    fn the_weight_is_the_product_of_both_associations() {
        let class = |class, weight| vec![Association { class: ClassIdx(class), weight }];
        let patches = vec![([0.0; 3], class(0, 0.5)), ([0.02, 0.0, 0.0], class(1, 0.4))];
        let index = indexed(&patches);
        let bin = index.distances().bin(20.0 * MM).unwrap();
        let mut weights = Vec::new();
        index.matches(ClassIdx(1), ClassIdx(0), bin, |a, b, weight| weights.push((a, b, weight)));
        assert_eq!((weights[0].0, weights[0].1), (1, 0));
        assert!((weights[0].2 - 0.2).abs() < 1e-4);
    }

    #[test]
    fn likeliest_classes_have_the_largest_pair_weight() {
        let patches = random_patches(40);
        let index = indexed(&patches);
        let heavier = |patch: &([f32; 3], Vec<Association>)| Some(patch.1[0].class);
        let expected: Vec<_> = patches.iter().map(heavier).collect();
        assert_eq!(index.likeliest_classes(0..40), expected);
        assert_eq!(index.likeliest_classes(7..12), expected[7..12]);
        // Their distance is beyond all bins, so that no pair contains them.
        let class = || vec![Association { class: ClassIdx(2), weight: 1.0 }];
        let apart = indexed(&[([0.0; 3], class()), ([1.0, 0.0, 0.0], class())]);
        assert_eq!(apart.likeliest_classes(0..2), [None, None]);
    }

    #[test]
    fn a_posting_takes_at_most_eight_bytes() {
        assert!(size_of::<Posting>() <= 8);
    }

    #[test]
    fn damaged_parts_are_refused() {
        let index = indexed(&random_patches(10));
        let rebuilt = |offsets: Vec<u32>, n_patches| {
            let postings = index.postings().to_vec();
            PairIndex::from_parts(4, index.distances(), offsets, postings, n_patches)
        };
        assert_eq!(rebuilt(index.offsets().to_vec(), 10), Some(index.clone()));
        assert_eq!(rebuilt(index.offsets().to_vec(), 5), None);
        assert_eq!(rebuilt(index.offsets()[1..].to_vec(), 10), None);
    }
}
