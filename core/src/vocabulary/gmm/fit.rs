//! Fits a Gaussian mixture: independent starts from k-means++, EM until convergence.
//!
//! Source: section 4.4.2.1; floors and bounds as in `docs/equations.md`. Every start runs a
//! few steps, and the likeliest continues to convergence (Biernacki, Celeux and Govaert,
//! 2003).

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::steps::{Blocks, Expectation, blocks, expect, maximize, raise_eigenvalues};
use super::{Component, Mixture};
use crate::vocabulary::kmeans::{KMeansConfig, one_start};

/// Covariances of the components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Covariances {
    /// One per component, as printed (equation 4.16).
    Full,
    /// One for all components, beyond print: for few features.
    Shared,
}

/// Configuration of the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MixtureConfig {
    /// Number of components; fewer when there are fewer than (dimension + 1) features each,
    /// or two with a shared covariance.
    pub n_components: usize,
    /// Covariances of the components.
    pub covariances: Covariances,
    /// Independent starts; the likeliest after `short_steps` continues.
    pub n_starts: usize,
    /// EM steps before starts are compared.
    pub short_steps: usize,
    /// Maximum EM steps in total.
    pub max_steps: usize,
    /// EM ends when the mean ln density of a feature gains less than this fraction of itself
    /// (of 1 when it is smaller than 1).
    pub tolerance: f64,
    /// Smallest eigenvalue of a covariance, as a fraction of the features' mean variance.
    pub variance_floor: f64,
}

impl MixtureConfig {
    /// `n_components` components, the best of four starts, a floor of 1e-3.
    #[must_use]
    pub fn with_components(n_components: usize) -> Self {
        Self {
            n_components,
            covariances: Covariances::Full,
            n_starts: 4,
            short_steps: 8,
            max_steps: 200,
            tolerance: 1e-5,
            variance_floor: 1e-3,
        }
    }
}

/// A fitted mixture, and its likelihood over the steps.
#[derive(Clone, Debug, PartialEq)]
pub struct MixtureFit {
    /// The mixture.
    pub mixture: Mixture,
    /// The mean ln density of a feature before each step since a component was last
    /// re-seeded, and of the result; it never falls.
    pub mean_log_density: Vec<f64>,
}

/// Fits a mixture to features, all of one length and finite.
///
/// # Panics
/// Without any feature: there is nothing to fit.
#[must_use]
pub fn fit_mixture(features: &[Vec<f64>], config: &MixtureConfig, seed: u64) -> MixtureFit {
    let fit = fit_mixture_while(features, config, seed, &|| true);
    fit.expect("nobody stops it")
}

/// Like [`fit_mixture`]; calls `go_on` before every step and returns `None` once it is false.
///
/// # Panics
/// Without any feature: there is nothing to fit.
#[must_use]
pub fn fit_mixture_while(
    features: &[Vec<f64>],
    config: &MixtureConfig,
    seed: u64,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Option<MixtureFit> {
    let dimension = features[0].len();
    let features_each = match config.covariances {
        Covariances::Full => dimension + 1,
        Covariances::Shared => 2,
    };
    let bound = (features.len() / features_each).max(1);
    let n_components = config.n_components.clamp(1, bound);
    let data = Data::new(features, config);
    let short = config.short_steps.min(config.max_steps);
    let starts: Vec<Run> = (0..config.n_starts.max(1) as u64)
        .into_par_iter()
        .map(|start| {
            let mut run = Run::start(features, &data, n_components, seed, start);
            run.improve(&data, short, config.tolerance, go_on);
            run
        })
        .collect();
    let best = starts
        .into_iter()
        .reduce(|best, next| if next.log_density() > best.log_density() { next } else { best });
    let mut run = best.expect("there is at least one start");
    run.improve(&data, config.max_steps - short, config.tolerance, go_on);
    go_on().then_some(MixtureFit { mixture: run.mixture, mean_log_density: run.trace })
}

/// The features with their common covariance and the floor derived from it.
struct Data {
    blocks: Blocks,
    /// The covariance of all features together, row-major.
    covariance: Vec<f64>,
    covariances: Covariances,
    floor: f64,
}

impl Data {
    fn new(features: &[Vec<f64>], config: &MixtureConfig) -> Self {
        let blocks = blocks(features);
        let dimension = features[0].len();
        let ones: Vec<_> =
            blocks.iter().map(|block| DMatrix::from_element(block.ncols(), 1, 1.0)).collect();
        let whole = maximize(&blocks, &ones, 0.0).remove(0);
        let covariance = whole.map_or(vec![0.0; dimension * dimension], |all| all.covariance);
        let trace: f64 = covariance.iter().step_by(dimension + 1).sum();
        // Equal features have no variance; any positive floor serves them.
        let floor = (config.variance_floor * trace / dimension as f64).max(1e-12);
        let raised =
            raise_eigenvalues(DMatrix::from_row_slice(dimension, dimension, &covariance), floor);
        let covariance = raised.as_slice().to_vec();
        Self { blocks, covariance, covariances: config.covariances, floor }
    }

    /// The M step. A shared covariance is the mean of the components', by weight.
    fn maximize(&self, shares: &[DMatrix<f64>]) -> Vec<Option<Component>> {
        let floor = match self.covariances {
            Covariances::Full => self.floor,
            Covariances::Shared => 0.0,
        };
        let mut parts = maximize(&self.blocks, shares, floor);
        if self.covariances == Covariances::Shared {
            let dimension = self.blocks[0].nrows();
            let total: f64 = parts.iter().flatten().map(|part| part.weight).sum();
            let mut mean = DMatrix::zeros(dimension, dimension);
            for part in parts.iter().flatten() {
                let own = DMatrix::from_row_slice(dimension, dimension, &part.covariance);
                mean += own * (part.weight / total);
            }
            let shared = raise_eigenvalues(mean, self.floor).as_slice().to_vec();
            parts.iter_mut().flatten().for_each(|part| part.covariance.clone_from(&shared));
        }
        parts
    }
}

/// State of an EM run.
struct Run {
    mixture: Mixture,
    expectation: Expectation,
    trace: Vec<f64>,
    reseeds_left: usize,
}

impl Run {
    /// Classes of one k-means start as the first components.
    fn start(features: &[Vec<f64>], data: &Data, k: usize, seed: u64, start: u64) -> Self {
        let config = KMeansConfig { n_classes: k, n_starts: 1, max_passes: 100 };
        let classes = one_start(features, &config, seed, start);
        let k = classes.centers.len();
        let mut index = 0;
        let shares: Vec<DMatrix<f64>> = data
            .blocks
            .iter()
            .map(|block| {
                let mut shares = DMatrix::zeros(block.ncols(), k);
                for row in 0..block.ncols() {
                    shares[(row, classes.nearest(&features[index + row]))] = 1.0;
                }
                index += block.ncols();
                shares
            })
            .collect();
        let parts = data.maximize(&shares).into_iter().flatten().collect();
        let mixture = Mixture::new(parts).expect("every class has a member and a floor");
        let expectation = expect(&mixture, &data.blocks);
        let trace = vec![expectation.mean_log_density()];
        Self { mixture, expectation, trace, reseeds_left: k }
    }

    fn log_density(&self) -> f64 {
        self.trace.last().copied().unwrap_or(f64::NEG_INFINITY)
    }

    fn improve(
        &mut self,
        data: &Data,
        max_steps: usize,
        tolerance: f64,
        go_on: &(dyn Fn() -> bool + Sync),
    ) {
        for _step in 0..max_steps {
            if !go_on() {
                break;
            }
            let before = self.log_density();
            let reseeded = self.step(data);
            let gain = self.log_density() - before;
            if !reseeded && gain < tolerance * before.abs().max(1.0) {
                break;
            }
        }
    }

    /// One step of EM; true when a component had lost its features and was re-seeded.
    fn step(&mut self, data: &Data) -> bool {
        let maximized = data.maximize(&self.expectation.shares);
        let lost = maximized.iter().filter(|part| part.is_none()).count();
        let mut parts: Vec<Component> = maximized.into_iter().flatten().collect();
        if lost > 0 {
            let n_new = lost.min(self.reseeds_left);
            self.reseeds_left -= n_new;
            parts.extend(self.new_components(data, n_new));
            self.trace.clear();
        }
        self.mixture = Mixture::new(parts).expect("eigenvalues of covariances have a floor");
        self.expectation = expect(&self.mixture, &data.blocks);
        self.trace.push(self.expectation.mean_log_density());
        lost > 0
    }

    /// New components at the features explained worst, as wide as all features.
    fn new_components(&self, data: &Data, n: usize) -> Vec<Component> {
        let densities = &self.expectation.log_densities;
        let mut order: Vec<usize> = (0..densities.len()).collect();
        order.sort_by(|a, b| densities[*a].total_cmp(&densities[*b]).then(a.cmp(b)));
        let columns: Vec<_> = data.blocks.iter().flat_map(DMatrix::column_iter).collect();
        let weight = 1.0 / self.mixture.components.len() as f64;
        order
            .into_iter()
            .take(n)
            .map(|index| Component {
                weight,
                mean: columns[index].iter().copied().collect(),
                covariance: data.covariance.clone(),
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};

    /// Groups of elongated clouds along a diagonal.
    fn clouds(n: usize, groups: usize, seed: u64) -> Vec<Vec<f64>> {
        let mut stream = Stream::new(seed, Purpose::Shape, 0);
        (0..n)
            .map(|index| {
                let center = 6.0 * (index % groups) as f64;
                let along = 2.0 * stream.normal();
                vec![center + along, center - along + 0.5 * stream.normal(), stream.normal()]
            })
            .collect()
    }

    #[test]
    fn the_likelihood_never_falls() {
        for seed in 0..6 {
            let even = seed % 2 == 0;
            let config = MixtureConfig {
                covariances: if even { Covariances::Full } else { Covariances::Shared },
                tolerance: 0.0,
                max_steps: 60,
                ..MixtureConfig::with_components(7)
            };
            let fit = fit_mixture(&clouds(600, 4, seed), &config, seed);
            assert!(fit.mean_log_density.len() > 5);
            for pair in fit.mean_log_density.windows(2) {
                assert!(pair[1] >= pair[0] - 1e-9, "seed {seed}: {pair:?}");
            }
        }
    }

    #[test]
    fn two_clouds_are_found_with_their_covariances() {
        let fit = fit_mixture(&clouds(4_000, 2, 1), &MixtureConfig::with_components(2), 1);
        let mut parts = fit.mixture.components().to_vec();
        parts.sort_by(|a, b| a.mean[0].total_cmp(&b.mean[0]));
        for (part, center) in parts.iter().zip([0.0, 6.0]) {
            // 2,000 features of deviation 2: means to about 0.05, variances 4 to about 0.13.
            assert!((part.weight - 0.5).abs() < 0.03, "{part:?}");
            assert!((part.mean[0] - center).abs() < 0.25 && (part.mean[1] - center).abs() < 0.25);
            assert!((part.covariance[0] - 4.0).abs() < 0.6, "{:?}", part.covariance);
            assert!((part.covariance[1] + 4.0).abs() < 0.6, "{:?}", part.covariance);
            assert!((part.covariance[8] - 1.0).abs() < 0.15, "{:?}", part.covariance);
        }
    }

    #[test]
    fn a_shared_covariance_is_that_within_all_groups() {
        let settings =
            MixtureConfig { covariances: Covariances::Shared, ..MixtureConfig::with_components(2) };
        let fit = fit_mixture(&clouds(4_000, 2, 1), &settings, 1);
        let [a, b] = fit.mixture.components() else { panic!("two components") };
        assert_eq!(a.covariance, b.covariance);
        assert!((a.covariance[0] - 4.0).abs() < 0.4, "{:?}", a.covariance);
        assert!((a.covariance[8] - 1.0).abs() < 0.1, "{:?}", a.covariance);
    }

    #[test]
    fn few_features_bound_the_number_of_components() {
        // 19 features of 3 dimensions: at most 19 / 4 = 4 components.
        let fit = fit_mixture(&clouds(19, 3, 2), &MixtureConfig::with_components(30), 1);
        assert!(fit.mixture.components().len() <= 4);
    }

    #[test]
    fn features_in_a_plane_keep_a_covariance() {
        let flat: Vec<Vec<f64>> = clouds(200, 2, 3)
            .into_iter()
            .map(|feature| vec![feature[0], feature[1], feature[0] - feature[1]])
            .collect();
        let fit = fit_mixture(&flat, &MixtureConfig::with_components(5), 1);
        assert!(fit.mixture.log_density(&flat[0]).is_finite());
        let equal = vec![vec![1.0, 2.0, 3.0]; 40];
        let fit = fit_mixture(&equal, &MixtureConfig::with_components(5), 1);
        assert_eq!(fit.mixture.components().len(), 1);
    }

    #[test]
    fn an_empty_component_restarts_at_the_worst_feature() {
        let mut features = clouds(300, 2, 4);
        features.push(vec![500.0, 500.0, 500.0]);
        let config = MixtureConfig { variance_floor: 1e-9, ..MixtureConfig::with_components(2) };
        let data = Data::new(&features, &config);
        let mut run = Run::start(&features, &data, 2, 1, 0);
        let far = Component {
            weight: 0.5,
            mean: vec![-1e4; 3],
            covariance: run.mixture.components()[0].covariance.clone(),
        };
        let first = run.mixture.components()[0].clone();
        run.mixture = Mixture::new(vec![Component { weight: 0.5, ..first }, far]).unwrap();
        run.expectation = expect(&run.mixture, &data.blocks);
        let worst = run.expectation.log_densities.iter().enumerate();
        let worst = worst.min_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
        assert!(run.step(&data));
        let parts = run.mixture.components();
        assert_eq!(parts.len(), 2);
        assert_eq!(parts[1].mean, features[worst]);
        assert_eq!(run.trace.len(), 1);
    }

    #[test]
    fn the_result_does_not_depend_on_threads() {
        let features = clouds(1_500, 4, 5);
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| fit_mixture(&features, &MixtureConfig::with_components(6), 2))
        };
        assert_eq!(with(1), with(4));
    }
}
