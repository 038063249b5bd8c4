//! k-medoids by FasterPAM: the vocabulary's centres are observed features.
//!
//! Source: Partitioning Around Medoids as in section 5.3.2 (Kaufman and Rousseeuw, 1990),
//! with the eager swaps of Schubert and Rousseeuw (2021), which reach the same kind of
//! optimum in O(n²) a pass. Deterministic from a stream.

use crate::descriptor::affinity;
use crate::rng::Stream;

/// Independent starts; the result of least cost is kept.
const N_STARTS: usize = 5;

/// Dissimilarities between all pairs of a set, row-major.
struct Distances {
    n: usize,
    values: Vec<f32>,
}

impl Distances {
    fn of(features: &[Vec<f64>]) -> Self {
        let n = features.len();
        let mut values = vec![0.0f32; n * n];
        for a in 0..n {
            for b in 0..a {
                let distance = (1.0 - affinity(&features[a], &features[b])) as f32;
                values[a * n + b] = distance;
                values[b * n + a] = distance;
            }
        }
        Self { n, values }
    }

    fn row(&self, a: usize) -> &[f32] {
        &self.values[a * self.n..(a + 1) * self.n]
    }
}

/// The nearest and second nearest medoid of one feature.
#[derive(Clone, Copy)]
struct Near {
    first: usize,
    first_distance: f32,
    second_distance: f32,
}

/// Chooses `k` of the features as medoids such that the sum of 1 − affinity to the nearest
/// one is a local optimum under swaps, the best of five starts; returns their indices,
/// ascending.
///
/// If there are fewer features than `k`, all are medoids. Work is O(n²) a pass; for more than
/// a few thousand features pass a sub-sample (as CLARA does).
#[must_use]
pub fn choose_medoids(features: &[Vec<f64>], k: usize, stream: &mut Stream) -> Vec<usize> {
    let n = features.len();
    if n <= k {
        return (0..n).collect();
    }
    let distances = Distances::of(features);
    let mut best: Option<(f64, Vec<usize>)> = None;
    for _start in 0..N_STARTS {
        let mut medoids = spread_out(&distances, k, stream);
        // Each accepted swap lowers the cost; the bound only guards against rounding.
        for _pass in 0..100 {
            if !improve(&distances, &mut medoids) {
                break;
            }
        }
        let cost =
            assign(&distances, &medoids).iter().map(|near| f64::from(near.first_distance)).sum();
        if best.as_ref().is_none_or(|(lowest, _)| cost < *lowest) {
            best = Some((cost, medoids));
        }
    }
    let mut medoids = best.map(|(_, medoids)| medoids).unwrap_or_default();
    medoids.sort_unstable();
    medoids
}

/// k-means++ seeding on dissimilarities.
fn spread_out(distances: &Distances, k: usize, stream: &mut Stream) -> Vec<usize> {
    let mut medoids = vec![stream.index(distances.n)];
    let mut nearest: Vec<f32> = distances.row(medoids[0]).to_vec();
    while medoids.len() < k {
        let total: f64 = nearest.iter().map(|distance| f64::from(*distance)).sum();
        let mut left = stream.uniform(0.0, total.max(f64::MIN_POSITIVE));
        let drawn = nearest.iter().position(|distance| {
            left -= f64::from(*distance);
            left < 0.0
        });
        let unused = || (0..distances.n).find(|index| !medoids.contains(index)).unwrap_or(0);
        let chosen = drawn.filter(|index| !medoids.contains(index)).unwrap_or_else(unused);
        for (near, distance) in nearest.iter_mut().zip(distances.row(chosen)) {
            *near = near.min(*distance);
        }
        medoids.push(chosen);
    }
    medoids
}

/// One pass over all candidates with eager swaps; true when any swap was made.
fn improve(distances: &Distances, medoids: &mut [usize]) -> bool {
    let mut near = assign(distances, medoids);
    let mut losses = removal_losses(&near, medoids.len());
    let mut swapped = false;
    for candidate in 0..distances.n {
        if medoids.contains(&candidate) {
            continue;
        }
        let (position, gain) = best_swap(distances, &near, &losses, candidate);
        if gain > 1e-4 {
            medoids[position] = candidate;
            near = assign(distances, medoids);
            losses = removal_losses(&near, medoids.len());
            swapped = true;
        }
    }
    swapped
}

fn assign(distances: &Distances, medoids: &[usize]) -> Vec<Near> {
    let nothing = Near { first: 0, first_distance: f32::MAX, second_distance: f32::MAX };
    let mut near = vec![nothing; distances.n];
    for (position, medoid) in medoids.iter().enumerate() {
        for (entry, distance) in near.iter_mut().zip(distances.row(*medoid)) {
            if *distance < entry.first_distance {
                entry.second_distance = entry.first_distance;
                (entry.first, entry.first_distance) = (position, *distance);
            } else if *distance < entry.second_distance {
                entry.second_distance = *distance;
            }
        }
    }
    near
}

/// The increase of the cost when each medoid is removed.
fn removal_losses(near: &[Near], k: usize) -> Vec<f64> {
    let mut losses = vec![0.0; k];
    for entry in near {
        losses[entry.first] += f64::from(entry.second_distance - entry.first_distance);
    }
    losses
}

/// The medoid that the candidate replaces best, and the decrease of the cost.
fn best_swap(
    distances: &Distances,
    near: &[Near],
    losses: &[f64],
    candidate: usize,
) -> (usize, f64) {
    let mut gains: Vec<f64> = losses.iter().map(|loss| -loss).collect();
    let mut shared = 0.0;
    for (entry, distance) in near.iter().zip(distances.row(candidate)) {
        if *distance < entry.first_distance {
            shared += f64::from(entry.first_distance - distance);
            gains[entry.first] += f64::from(entry.second_distance - entry.first_distance);
        } else if *distance < entry.second_distance {
            gains[entry.first] += f64::from(entry.second_distance - distance);
        }
    }
    let best = gains.iter().enumerate().fold((0, f64::NEG_INFINITY), |best, (position, gain)| {
        if *gain > best.1 { (position, *gain) } else { best }
    });
    (best.0, best.1 + shared)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Purpose;

    fn on_circle(angles: &[f64]) -> Vec<Vec<f64>> {
        angles.iter().map(|angle| vec![angle.cos(), angle.sin()]).collect()
    }

    fn cost(features: &[Vec<f64>], medoids: &[usize]) -> f64 {
        let nearest = |feature: &Vec<f64>| {
            medoids
                .iter()
                .map(|medoid| 1.0 - affinity(feature, &features[*medoid]))
                .fold(f64::MAX, f64::min)
        };
        features.iter().map(nearest).sum()
    }

    /// The best of all pairs of medoids, by trying them all.
    fn exact_pair(features: &[Vec<f64>]) -> f64 {
        let n = features.len();
        let pairs = (0..n).flat_map(|a| (0..a).map(move |b| [a, b]));
        pairs.map(|pair| cost(features, &pair)).fold(f64::MAX, f64::min)
    }

    #[test]
    fn small_sets_reach_the_exact_optimum() {
        for seed in 0..20 {
            let mut stream = Stream::new(seed, Purpose::Clustering, 0);
            let angles: Vec<f64> = (0..12).map(|_| stream.uniform(0.0, 3.0)).collect();
            let features = on_circle(&angles);
            let found = cost(&features, &choose_medoids(&features, 2, &mut stream));
            assert!(found <= exact_pair(&features) * 1.000_1 + 1e-6, "seed {seed}: {found}");
        }
    }

    #[test]
    fn no_single_swap_improves_a_larger_set() {
        let mut stream = Stream::new(4, Purpose::Clustering, 0);
        let angles: Vec<f64> = (0..60).map(|_| stream.uniform(0.0, 6.0)).collect();
        let features = on_circle(&angles);
        let medoids = choose_medoids(&features, 5, &mut stream);
        let reached = cost(&features, &medoids);
        for position in 0..5 {
            for candidate in 0..60 {
                let mut swapped = medoids.clone();
                swapped[position] = candidate;
                assert!(cost(&features, &swapped) > reached - 2e-4);
            }
        }
    }

    #[test]
    fn three_clear_groups_get_one_medoid_each() {
        let features = on_circle(&[0.0, 0.1, 0.2, 2.0, 2.1, 2.2, 4.0, 4.1, 4.2]);
        let mut stream = Stream::new(3, Purpose::Clustering, 0);
        assert_eq!(choose_medoids(&features, 3, &mut stream), [1, 4, 7]);
    }

    #[test]
    fn fewer_features_than_classes_are_all_medoids() {
        let mut stream = Stream::new(3, Purpose::Clustering, 0);
        assert_eq!(choose_medoids(&on_circle(&[0.0, 1.0]), 5, &mut stream), [0, 1]);
    }
}
