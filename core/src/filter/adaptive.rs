//! The adaptive histogram: bins of poses that are split where the evidence is, and only there.
//!
//! Chapter 3's histogram filter spends the same on every bin. Here a bin far behind the best
//! one sleeps: it is credited with what a typical reading gives and wakes up when the best
//! has fallen back to it, so that nothing is lost for good. The best bins are split in
//! halves along their widest axes and their children scored on all readings, best first,
//! within a budget a reading. Scores are in the log domain; bins of one depth have one size.
//! Not here: what a reading says about a bin (a [`BinLikelihood`]).

/// What a filter asks of a measurement model with poses of `D` axes.
pub trait BinLikelihood<const D: usize> {
    /// ln of the density of reading `reading` for `object` somewhere within the bin of this
    /// center and depth; the unit may differ between readings but not between bins.
    fn log_likelihood(
        &mut self,
        object: u32,
        center: &[f64; D],
        depth: usize,
        reading: usize,
    ) -> f64;

    /// What [`BinLikelihood::log_likelihood`] gives a pose that explains the reading well
    /// enough: bins in play that do worse all fall back against sleeping ones.
    fn expected(&self, reading: usize) -> f64;

    /// A cheap stand-in for [`BinLikelihood::log_likelihood`], right in what it puts far behind.
    fn screen(&mut self, object: u32, center: &[f64; D], depth: usize, reading: usize) -> f64;
}

/// How a box of poses is divided: counts of the first bins, and the axes of each split.
#[derive(Clone, Debug, PartialEq)]
pub struct Division<const D: usize> {
    low: [f64; D],
    n: [usize; D],
    /// Widths of a bin by depth, in the axes' own units.
    widths: Vec<[f64; D]>,
    /// ln of the share of the box that a bin fills, by depth.
    log_shares: Vec<f64>,
}

impl<const D: usize> Division<D> {
    /// Divides the box from `low` to `high` into `n` bins along each axis. `lengths` (m a unit
    /// of the axis) compare axes; a split halves all axes that are at least three quarters of
    /// the widest, and there are splits until none is wider than `smallest` (m).
    #[must_use]
    pub fn new(
        low: [f64; D],
        high: [f64; D],
        n: [usize; D],
        lengths: [f64; D],
        smallest: f64,
        axes_max: usize,
    ) -> Self {
        let n = n.map(|n| n.max(1));
        let mut width = [0.0; D];
        for axis in 0..D {
            width[axis] = (high[axis] - low[axis]) / n[axis] as f64;
        }
        let mut widths = vec![width];
        while widths.len() < DEPTH_MAX {
            let metric = |axis: usize| width[axis] * lengths[axis];
            let widest = (0..D).map(metric).fold(0.0, f64::max);
            if widest <= smallest {
                break;
            }
            let mut order: Vec<usize> = (0..D).filter(|a| metric(*a) >= 0.75 * widest).collect();
            order.sort_by(|a, b| metric(*b).total_cmp(&metric(*a)).then(a.cmp(b)));
            for axis in order.into_iter().take(axes_max) {
                width[axis] *= 0.5;
            }
            widths.push(width);
        }
        let log_first: f64 = n.iter().map(|n| -(*n as f64).ln()).sum();
        let log_share = |here: &[f64; D]| {
            let ratio = here.iter().zip(&widths[0]).map(|(here, first)| (here / first).ln());
            log_first + ratio.sum::<f64>()
        };
        let log_shares = widths.iter().map(log_share).collect();
        Self { low, n, widths, log_shares }
    }

    /// The widths of a bin at a depth, in the axes' own units.
    #[must_use]
    pub fn widths(&self, depth: usize) -> [f64; D] {
        self.widths[depth.min(self.widths.len() - 1)]
    }

    /// The deepest bins.
    #[must_use]
    pub fn depth_max(&self) -> usize {
        self.widths.len() - 1
    }

    /// The share of the box that a bin of this depth fills, as ln.
    #[must_use]
    pub fn log_share(&self, depth: usize) -> f64 {
        self.log_shares[depth.min(self.log_shares.len() - 1)]
    }

    fn first_centers(&self) -> impl Iterator<Item = [f64; D]> + '_ {
        let count: usize = self.n.iter().product();
        (0..count).map(|mut index| {
            std::array::from_fn(|axis| {
                let along = (index % self.n[axis]) as f64 + 0.5;
                index /= self.n[axis];
                self.low[axis] + along * self.widths[0][axis]
            })
        })
    }

    /// The centres of a bin's children.
    fn children(&self, center: &[f64; D], depth: usize) -> Vec<[f64; D]> {
        let (here, below) = (self.widths[depth], self.widths[depth + 1]);
        let mut centers = vec![*center];
        for axis in (0..D).filter(|axis| below[*axis] < here[*axis]) {
            let aside = 0.5 * below[axis];
            let mut halves = Vec::with_capacity(2 * centers.len());
            for center in &centers {
                for side in [-aside, aside] {
                    let mut half = *center;
                    half[axis] += side;
                    halves.push(half);
                }
            }
            centers = halves;
        }
        centers
    }
}

/// Deeper trees than this would have bins below a micrometre.
const DEPTH_MAX: usize = 24;

/// How far the filter looks and how much it may spend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Bins this far behind the best are evaluated, nats.
    pub keep: f64,
    /// Bins this far behind the best are split, nats.
    pub split: f64,
    /// No reading counts more than this against a bin, nats.
    pub floor: f64,
    /// When more bins than this are in play, the best of a screening are evaluated, this many.
    pub screened_max: usize,
    /// The exponent of the screening where it decides, 0 to 1.
    pub screen_temper: f64,
    /// The most evaluations that splitting may cost a reading.
    pub evaluations_max: usize,
    /// The most bins that are kept.
    pub bins_max: usize,
}

/// A bin of poses of one object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin<const D: usize> {
    /// Which object.
    pub object: u32,
    /// How often it was split off.
    pub depth: u32,
    /// How many readings it has been scored on; the others count as typical.
    pub n_scored: u32,
    /// The middle of the bin, in the axes' own units.
    pub center: [f64; D],
    /// ln of the likelihood relative to typical readings, and of the object's prior.
    pub score: f64,
}

/// The adaptive histogram over objects and poses.
#[derive(Clone, Debug)]
pub struct AdaptiveHistogram<const D: usize> {
    division: Division<D>,
    log_prior: Vec<f64>,
    bins: Vec<Bin<D>>,
    /// What a typical reading gives the bins in play, by reading.
    typical: Vec<f64>,
}

impl<const D: usize> AdaptiveHistogram<D> {
    /// All first bins of all objects; `log_prior` is ln of the objects' probabilities, and an
    /// object of −∞ has no bins.
    #[must_use]
    pub fn new(division: Division<D>, log_prior: &[f64]) -> Self {
        let mut bins = Vec::new();
        for (object, score) in log_prior.iter().enumerate() {
            if score.is_finite() {
                let (object, depth, n_scored, score) = (object as u32, 0, 0, *score);
                let bin = |center| Bin { object, depth, n_scored, center, score };
                bins.extend(division.first_centers().map(bin));
            }
        }
        Self { division, log_prior: log_prior.to_vec(), bins, typical: Vec::new() }
    }

    /// How the poses are divided.
    #[must_use]
    pub fn division(&self) -> &Division<D> {
        &self.division
    }

    /// All bins, in no meaningful order.
    #[must_use]
    pub fn bins(&self) -> &[Bin<D>] {
        &self.bins
    }

    /// ln of a bin's share of the belief, not normalised.
    #[must_use]
    pub fn log_mass(&self, bin: &Bin<D>) -> f64 {
        bin.score + self.division.log_share(bin.depth as usize)
    }

    /// Takes the next reading into account; the model knows it under the next index.
    pub fn add(&mut self, model: &mut impl BinLikelihood<D>, effort: &Effort) {
        let reading = self.typical.len();
        let best = self.best_score();
        let awake =
            |bin: &Bin<D>| bin.n_scored as usize == reading && bin.score >= best - effort.keep;
        let mut active: Vec<usize> =
            (0..self.bins.len()).filter(|at| awake(&self.bins[*at])).collect();
        if active.len() > effort.screened_max {
            active = self.screen(active, model, effort);
        }
        let mut scored = Vec::with_capacity(active.len());
        for at in active {
            let bin = &self.bins[at];
            let log = model.log_likelihood(bin.object, &bin.center, bin.depth as usize, reading);
            scored.push((at, log));
        }
        let expected = model.expected(reading);
        self.typical.push(self.typical_of(&scored).max(expected));
        for (at, log) in scored {
            self.bins[at].score += self.relative(log, reading, effort);
            self.bins[at].n_scored += 1;
        }
        self.wake(model, effort);
        self.split(model, effort);
        self.limit(effort);
    }

    /// The best of many bins by a screening; the others are scored by it.
    fn screen(
        &mut self,
        active: Vec<usize>,
        model: &mut impl BinLikelihood<D>,
        effort: &Effort,
    ) -> Vec<usize> {
        let reading = self.typical.len();
        let mut screened: Vec<(usize, f64)> = active
            .into_iter()
            .map(|at| {
                let bin = &self.bins[at];
                let log = model.screen(bin.object, &bin.center, bin.depth as usize, reading);
                (at, effort.screen_temper * log)
            })
            .collect();
        let total = |entry: &(usize, f64)| self.bins[entry.0].score + entry.1;
        screened.select_nth_unstable_by(effort.screened_max, |a, b| {
            total(b).total_cmp(&total(a)).then(a.0.cmp(&b.0))
        });
        let left_out = screened.split_off(effort.screened_max);
        let best = screened.iter().map(|entry| entry.1).fold(f64::NEG_INFINITY, f64::max);
        for (at, log) in left_out {
            self.bins[at].score += (log - best).clamp(-effort.floor, 0.0);
            self.bins[at].n_scored += 1;
        }
        let mut chosen: Vec<usize> = screened.into_iter().map(|entry| entry.0).collect();
        chosen.sort_unstable();
        chosen
    }

    /// What the bin that explains everything best got from this reading; −∞ without any.
    fn typical_of(&self, scored: &[(usize, f64)]) -> f64 {
        let total = |entry: &(usize, f64)| self.bins[entry.0].score + entry.1;
        let best = scored.iter().max_by(|a, b| total(a).total_cmp(&total(b)));
        best.map_or(f64::NEG_INFINITY, |entry| entry.1)
    }

    fn relative(&self, log: f64, reading: usize, effort: &Effort) -> f64 {
        (log - self.typical[reading]).max(-effort.floor)
    }

    fn best_score(&self) -> f64 {
        self.bins.iter().map(|bin| bin.score).fold(f64::NEG_INFINITY, f64::max)
    }

    /// The best score of a bin that has been scored on every reading.
    fn best_complete(&self) -> f64 {
        let n = self.typical.len();
        let complete = self.bins.iter().filter(|bin| bin.n_scored as usize == n);
        complete.map(|bin| bin.score).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Scores sleeping bins on what they missed while they are within reach of the best.
    fn wake(&mut self, model: &mut impl BinLikelihood<D>, effort: &Effort) {
        let mut best = self.best_complete();
        for at in 0..self.bins.len() {
            let mut bin = self.bins[at];
            best = best.max(self.score(&mut bin, best, model, effort));
            self.bins[at] = bin;
        }
    }

    /// Scores a bin on the readings it has not seen, as long as it is within reach of `best`;
    /// its score when that is complete, else −∞.
    fn score(
        &self,
        bin: &mut Bin<D>,
        best: f64,
        model: &mut impl BinLikelihood<D>,
        effort: &Effort,
    ) -> f64 {
        while (bin.n_scored as usize) < self.typical.len() {
            if bin.score < best - effort.keep {
                return f64::NEG_INFINITY;
            }
            let reading = bin.n_scored as usize;
            let log = model.log_likelihood(bin.object, &bin.center, bin.depth as usize, reading);
            bin.score += self.relative(log, reading, effort);
            bin.n_scored += 1;
        }
        bin.score
    }

    /// Splits the most massive bins, in rounds, as far as the budget goes.
    fn split(&mut self, model: &mut impl BinLikelihood<D>, effort: &Effort) {
        let mut left = effort.evaluations_max;
        let mut best = self.best_complete();
        loop {
            let worth = self.worth_splitting(best, effort);
            if worth.is_empty() {
                return;
            }
            for at in worth {
                let parent = self.bins[at];
                let centers = self.division.children(&parent.center, parent.depth as usize);
                let cost = centers.len() * self.typical.len();
                if cost > left {
                    return;
                }
                left -= cost;
                for (child, center) in centers.into_iter().enumerate() {
                    let (object, depth) = (parent.object, parent.depth + 1);
                    let score = self.log_prior[object as usize];
                    let mut bin = Bin { object, depth, n_scored: 0, center, score };
                    best = best.max(self.score(&mut bin, best, model, effort));
                    match child {
                        0 => self.bins[at] = bin,
                        _ => self.bins.push(bin),
                    }
                }
            }
        }
    }

    /// The better half of the bins that may be split, most massive first.
    fn worth_splitting(&self, best: f64, effort: &Effort) -> Vec<usize> {
        let depth_max = self.division.depth_max();
        let worth = |bin: &Bin<D>| {
            bin.n_scored as usize == self.typical.len()
                && bin.score >= best - effort.split
                && (bin.depth as usize) < depth_max
        };
        let mut order: Vec<usize> =
            (0..self.bins.len()).filter(|at| worth(&self.bins[*at])).collect();
        let mass = |at: &usize| self.log_mass(&self.bins[*at]);
        order.sort_by(|a, b| mass(b).total_cmp(&mass(a)).then(a.cmp(b)));
        // Only half at a time, so that children compete with what is left.
        order.truncate(order.len().div_ceil(2));
        order
    }

    /// Forgets the worst bins when there are too many.
    fn limit(&mut self, effort: &Effort) {
        if self.bins.len() > effort.bins_max {
            self.bins.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.object.cmp(&b.object)));
            self.bins.truncate(effort.bins_max);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings of a point on a line, each with deviation `sigma`; object 1 is never seen. A
    /// bin is as likely as its best point.
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
    fn widths_halve_down_to_the_smallest_and_shares_with_them() {
        let division = Division::new([0.0; 2], [1.0, 4.0], [2, 2], [1.0, 1.0], 0.5, 2);
        // 0.5 × 2 → only y is widest: 0.5 × 1, 0.5 × 0.5.
        assert_eq!(division.depth_max(), 2);
        assert_eq!(division.widths(2).map(f64::to_bits), [0.5, 0.5].map(f64::to_bits));
        assert!((division.log_share(2) - (1.0_f64 / 16.0).ln()).abs() < 1e-12);
        let children = division.children(&[0.25, 1.0], 0);
        assert_eq!(children, vec![[0.25, 0.5], [0.25, 1.5]]);
    }

    #[test]
    fn the_place_is_found_finer_than_the_first_bins() {
        let (histogram, _) = run(&[0.333, 0.331, 0.335], &EFFORT);
        let found = best(&histogram);
        assert_eq!(found.object, 0);
        assert!((found.center[0] - 0.333).abs() < 0.01, "{found:?}");
        // Splitting replaces a bin by its children: the shares still add up to the objects'.
        let total: f64 = histogram
            .bins()
            .iter()
            .map(|bin| histogram.division().log_share(bin.depth as usize).exp())
            .sum();
        assert!((total - 2.0).abs() < 1e-9, "{total}");
    }

    #[test]
    fn a_sleeping_bin_wakes_when_the_best_falls_back() {
        // One reading far off puts the truth 50 nats behind; it sleeps, and comes back.
        let (histogram, _) = run(&[0.9, 0.1, 0.1, 0.1], &EFFORT);
        let found = best(&histogram);
        assert!((found.center[0] - 0.1).abs() < 0.02, "{found:?}");
        assert_eq!(found.n_scored, 4);
    }

    #[test]
    fn no_more_is_evaluated_than_the_budget() {
        let none = Effort { evaluations_max: 0, ..EFFORT };
        let (histogram, model) = run(&[0.5], &none);
        assert_eq!(model.evaluated, 20);
        assert_eq!(histogram.bins().len(), 20);
    }

    #[test]
    fn a_screening_leaves_out_what_is_far_behind() {
        let few = Effort { screened_max: 4, evaluations_max: 0, ..EFFORT };
        let (histogram, model) = run(&[0.33], &few);
        assert_eq!(model.evaluated, 24);
        assert!((best(&histogram).center[0] - 0.35).abs() < 1e-12);
    }
}
