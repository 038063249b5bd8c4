//! k-means++ with independent restarts: the dissertation's first clustering.
//!
//! Source: section 4.4.2.1 and Arthur and Vassilvitskii (2007). Every start draws its own
//! stream. Sums run over chunks of a fixed size in a fixed order, so the number of threads
//! does not change a bit. Not here: soft classes (`gmm`), choosing k (`choice`).

use rayon::prelude::*;

use crate::rng::{Purpose, Stream};

/// Number of features of one parallel task; fixed, so that sums have one order.
const CHUNK: usize = 512;

/// Configuration of k-means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KMeansConfig {
    /// k, the number of classes; fewer are returned when there are fewer distinct features.
    pub n_classes: usize,
    /// Independent starts; the result of least cost is kept.
    pub n_starts: usize,
    /// Maximum passes of a start, even if features still change their class.
    pub max_passes: usize,
}

impl KMeansConfig {
    /// `n_classes` classes, the best of eight starts.
    #[must_use]
    pub fn with_classes(n_classes: usize) -> Self {
        Self { n_classes, n_starts: 8, max_passes: 100 }
    }
}

/// Centres of the classes, and the cost of the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct KMeans {
    /// The centres, each the mean of the features nearest to it.
    pub centers: Vec<Vec<f64>>,
    /// Sum over the features of the squared distance to the nearest centre.
    pub cost: f64,
}

impl KMeans {
    /// The class of a feature: the nearest centre; ties go to the lower index.
    #[must_use]
    pub fn nearest(&self, feature: &[f64]) -> usize {
        nearest(feature, &self.centers).0
    }
}

/// Groups features, all of one length, around `n_classes` centres.
///
/// # Panics
/// Without any feature: there is nothing to group.
#[must_use]
pub fn k_means(features: &[Vec<f64>], config: &KMeansConfig, seed: u64) -> KMeans {
    let starts: Vec<KMeans> = (0..config.n_starts.max(1) as u64)
        .into_par_iter()
        .map(|start| one_start(features, config, seed, start))
        .collect();
    let best =
        starts.into_iter().reduce(|best, next| if next.cost < best.cost { next } else { best });
    best.expect("there is at least one start")
}

/// One independent start: seeding, then Lloyd's passes until nothing changes.
pub(crate) fn one_start(
    features: &[Vec<f64>],
    config: &KMeansConfig,
    seed: u64,
    start: u64,
) -> KMeans {
    let mut stream = Stream::new(seed, Purpose::Clustering, start);
    let mut centers = spread_out(features, config.n_classes, &mut stream);
    let mut members = vec![usize::MAX; features.len()];
    for _pass in 0..config.max_passes {
        let pass = assign(features, &centers);
        if pass.classes == members {
            break;
        }
        centers = means(&pass, features, &centers);
        members = pass.classes;
    }
    drop_unused(features, &mut centers);
    let cost = assign(features, &centers).distances.iter().sum();
    KMeans { centers, cost }
}

/// Greedy k-means++: the first centre uniform, each next one the best of a few drawn with
/// probability ∝ squared distance (Arthur and Vassilvitskii, section 7).
fn spread_out(features: &[Vec<f64>], k: usize, stream: &mut Stream) -> Vec<Vec<f64>> {
    let n_trials = 2 + (k as f64).ln() as usize;
    let first = features[stream.index(features.len())].clone();
    let mut distances: Vec<f64> = features.iter().map(|f| squared_distance(f, &first)).collect();
    let mut centers = vec![first];
    while centers.len() < k {
        let total: f64 = distances.iter().sum();
        if total <= 0.0 {
            break; // every different feature is a centre already
        }
        let drawn: Vec<usize> = (0..n_trials).map(|_| draw(&distances, total, stream)).collect();
        let trials: Vec<(f64, Vec<f64>)> = drawn
            .par_iter()
            .map(|chosen| {
                let nearer = distances.iter().zip(features).map(|(distance, feature)| {
                    distance.min(squared_distance(feature, &features[*chosen]))
                });
                let nearer: Vec<f64> = nearer.collect();
                (nearer.iter().sum(), nearer)
            })
            .collect();
        let best = (1..n_trials)
            .fold(0, |best, trial| if trials[trial].0 < trials[best].0 { trial } else { best });
        centers.push(features[drawn[best]].clone());
        distances.clone_from(&trials[best].1);
    }
    centers
}

/// An index drawn with probability ∝ its distance; `total` is their sum, above 0.
fn draw(distances: &[f64], total: f64, stream: &mut Stream) -> usize {
    let mut left = stream.uniform(0.0, total);
    let drawn = distances.iter().position(|distance| {
        left -= distance;
        left < 0.0
    });
    drawn.unwrap_or_else(|| farthest(distances))
}

/// The class of every feature, and its squared distance from the centre.
struct Pass {
    classes: Vec<usize>,
    distances: Vec<f64>,
}

fn assign(features: &[Vec<f64>], centers: &[Vec<f64>]) -> Pass {
    let (classes, distances) = features.par_iter().map(|feature| nearest(feature, centers)).unzip();
    Pass { classes, distances }
}

/// The mean of each class; an empty class moves to the feature farthest from its own centre.
fn means(pass: &Pass, features: &[Vec<f64>], centers: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let dimension = features[0].len();
    let empty = || (vec![0usize; centers.len()], vec![vec![0.0; dimension]; centers.len()]);
    let partial: Vec<_> = features
        .par_chunks(CHUNK)
        .zip(pass.classes.par_chunks(CHUNK))
        .map(|(features, classes)| {
            let (mut counts, mut sums) = empty();
            for (feature, &class) in features.iter().zip(classes) {
                counts[class] += 1;
                add(&mut sums[class], feature);
            }
            (counts, sums)
        })
        .collect();
    let (mut counts, mut sums) = empty();
    for (chunk_counts, chunk_sums) in &partial {
        for class in 0..centers.len() {
            counts[class] += chunk_counts[class];
            add(&mut sums[class], &chunk_sums[class]);
        }
    }
    let mut distances = pass.distances.clone();
    for (sum, count) in sums.iter_mut().zip(counts) {
        if count > 0 {
            sum.iter_mut().for_each(|value| *value /= count as f64);
        } else {
            let far = farthest(&distances);
            sum.clone_from(&features[far]);
            distances[far] = 0.0;
        }
    }
    sums
}

/// Removes centres that are nearest to no feature (fewer distinct features than classes).
fn drop_unused(features: &[Vec<f64>], centers: &mut Vec<Vec<f64>>) {
    let mut used = vec![false; centers.len()];
    assign(features, centers).classes.into_iter().for_each(|class| used[class] = true);
    let mut used = used.into_iter();
    centers.retain(|_| used.next().unwrap_or(false));
}

fn nearest(feature: &[f64], centers: &[Vec<f64>]) -> (usize, f64) {
    let mut best = (0, f64::INFINITY);
    for (class, center) in centers.iter().enumerate() {
        let distance = squared_distance(feature, center);
        if distance < best.1 {
            best = (class, distance);
        }
    }
    best
}

/// The index of the largest distance; the first of equals.
fn farthest(distances: &[f64]) -> usize {
    let mut best = 0;
    for (index, distance) in distances.iter().enumerate() {
        if *distance > distances[best] {
            best = index;
        }
    }
    best
}

fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

fn add(sum: &mut [f64], values: &[f64]) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scattered(n: usize, groups: usize, seed: u64) -> Vec<Vec<f64>> {
        let mut stream = Stream::new(seed, Purpose::Shape, 0);
        (0..n)
            .map(|index| {
                let center = 10.0 * (index % groups) as f64;
                vec![center + stream.normal(), 0.5 * center + stream.normal()]
            })
            .collect()
    }

    #[test]
    fn the_centers_of_two_pairs_are_their_middles() {
        let features = vec![vec![0.0], vec![2.0], vec![10.0], vec![14.0]];
        let mut found = k_means(&features, &KMeansConfig::with_classes(2), 3);
        found.centers.sort_by(|a, b| a[0].total_cmp(&b[0]));
        assert_eq!(found.centers, [[1.0], [12.0]]);
        assert!((found.cost - 10.0).abs() < 1e-12); // 1 + 1 + 4 + 4
    }

    #[test]
    fn restarts_are_independent() {
        // One cloud in twelve classes: single starts end in different local optima, and the
        // best of many is the best of the single ones.
        let features = scattered(240, 1, 1);
        let one = KMeansConfig { n_classes: 12, n_starts: 1, max_passes: 100 };
        let costs: Vec<f64> =
            (0..8).map(|start| one_start(&features, &one, 5, start).cost).collect();
        let lowest = costs.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(costs.iter().any(|cost| *cost > 1.01 * lowest), "{costs:?}");
        let best = k_means(&features, &KMeansConfig { n_starts: 8, ..one }, 5);
        assert!(best.cost.to_bits() == lowest.to_bits());
    }

    #[test]
    fn every_center_is_the_mean_of_its_members() {
        let features = scattered(300, 4, 2);
        let found = k_means(&features, &KMeansConfig::with_classes(7), 1);
        for (class, center) in found.centers.iter().enumerate() {
            let members: Vec<&Vec<f64>> =
                features.iter().filter(|f| found.nearest(f) == class).collect();
            assert!(!members.is_empty(), "class {class} has no member");
            for axis in 0..2 {
                let mean = members.iter().map(|f| f[axis]).sum::<f64>() / members.len() as f64;
                assert!((center[axis] - mean).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn an_empty_class_moves_to_the_farthest_feature() {
        let features = vec![vec![0.0], vec![1.0], vec![9.0]];
        let centers = vec![vec![0.0], vec![100.0]];
        let moved = means(&assign(&features, &centers), &features, &centers);
        assert_eq!(moved[1], [9.0]);
    }

    #[test]
    fn equal_features_make_one_class() {
        let found = k_means(&vec![vec![1.0, 2.0]; 9], &KMeansConfig::with_classes(4), 1);
        assert_eq!(found.centers, [[1.0, 2.0]]);
    }

    #[test]
    fn the_result_does_not_depend_on_threads() {
        let features = scattered(2_000, 5, 3);
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| k_means(&features, &KMeansConfig::with_classes(9), 7))
        };
        assert_eq!(with(1), with(4));
    }
}
