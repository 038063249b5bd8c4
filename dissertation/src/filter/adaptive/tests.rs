//! Tests of the adaptive histogram on points of a line.

use super::*;

/// Readings of a point on a line, each with deviation `sigma`; object 1 is never observed.
/// The likelihood of a bin is that of its best point.
struct Points {
    readings: Vec<f64>,
    sigma: f64,
    half: Vec<f64>,
    evaluated: usize,
}

impl BinLikelihood<1> for Points {
    fn log_likelihood(&mut self, object: u32, c: &[f64; 1], depth: usize, at: usize) -> f64 {
        self.evaluated += 1;
        let off = ((self.readings[at] - c[0]).abs() - self.half[depth]).max(0.0);
        let wrong = if object == 1 { 5.0 } else { 0.0 };
        (-0.5 * (off / self.sigma).powi(2)).max(-200.0) - wrong
    }

    fn expected(&self, _reading: usize) -> f64 {
        -2.0
    }

    fn screen(&mut self, object: u32, center: &[f64; 1], depth: usize, at: usize) -> f64 {
        self.log_likelihood(object, center, depth, at)
    }
}

const EFFORT: Effort = Effort {
    keep: 30.0,
    split: 10.0,
    floor: 50.0,
    screened_max: 1_000,
    screen_temper: 1.0,
    evaluations_max: 400,
    bins_max: 1_000,
};

fn run(readings: &[f64], effort: &Effort) -> (AdaptiveHistogram<1>, Points) {
    let division = Division::new([0.0], [1.0], [10], [1.0], 0.001, 1);
    let half = (0..=division.depth_max()).map(|d| 0.5 * division.widths(d)[0]).collect();
    let mut model = Points { readings: readings.to_vec(), sigma: 0.01, half, evaluated: 0 };
    let mut histogram = AdaptiveHistogram::new(division, &[0.5_f64.ln(); 2]);
    for _ in readings {
        histogram.add(&mut model, effort);
    }
    (histogram, model)
}

fn best(histogram: &AdaptiveHistogram<1>) -> Bin<1> {
    *histogram.bins().iter().max_by(|a, b| a.score.total_cmp(&b.score)).unwrap()
}

#[test]
fn widths_and_shares_halve_down_to_the_smallest() {
    let division = Division::new([0.0; 2], [1.0, 4.0], [2, 2], [1.0, 1.0], 0.5, 2);
    // 0.5 × 2 → only y is widest: 0.5 × 1, 0.5 × 0.5.
    assert_eq!(division.depth_max(), 2);
    assert_eq!(division.widths(2).map(f64::to_bits), [0.5, 0.5].map(f64::to_bits));
    assert!((division.log_share(2) - (1.0_f64 / 16.0).ln()).abs() < 1e-12);
    let children = division.children(&[0.25, 1.0], 0);
    assert_eq!(children, vec![[0.25, 0.5], [0.25, 1.5]]);
}

#[test]
fn the_position_is_found_finer_than_the_first_bins() {
    let (histogram, _) = run(&[0.333, 0.331, 0.335], &EFFORT);
    let found = best(&histogram);
    assert_eq!(found.object, 0);
    assert!((found.center[0] - 0.333).abs() < 0.01, "{found:?}");
    // Splitting replaces a bin by its children: the shares still sum to the objects'.
    let total: f64 = histogram
        .bins()
        .iter()
        .map(|bin| histogram.division().log_share(bin.depth as usize).exp())
        .sum();
    assert!((total - 2.0).abs() < 1e-9, "{total}");
}

#[test]
fn a_sleeping_bin_wakes_when_the_best_falls_back() {
    // One outlier puts the truth 50 nats behind; it sleeps, and comes back.
    let (histogram, _) = run(&[0.9, 0.1, 0.1, 0.1], &EFFORT);
    let found = best(&histogram);
    assert!((found.center[0] - 0.1).abs() < 0.02, "{found:?}");
    assert_eq!(found.n_scored, 4);
}

#[test]
fn evaluations_stay_within_the_budget() {
    let none = Effort { evaluations_max: 0, ..EFFORT };
    let (histogram, model) = run(&[0.5], &none);
    assert_eq!(model.evaluated, 20);
    assert_eq!(histogram.bins().len(), 20);
}

#[test]
fn a_screening_drops_bins_far_behind() {
    let few = Effort { screened_max: 4, evaluations_max: 0, ..EFFORT };
    let (histogram, model) = run(&[0.33], &few);
    assert_eq!(model.evaluated, 24);
    assert!((best(&histogram).center[0] - 0.35).abs() < 1e-12);
}
