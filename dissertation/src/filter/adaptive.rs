//! The adaptive histogram: bins of poses that are split only where the evidence is.
//!
//! Chapter 3's histogram filter spends the same effort on every bin. Here a bin far behind
//! the best one sleeps: it is credited with the score of a typical reading and wakes up when
//! the best has fallen back to it, so that no pose is lost for good. The best bins are split
//! in halves along their widest axes and their children scored on all readings, best first,
//! within a budget per reading. Scores are in the log domain; bins of one depth have one
//! size. Not here: the likelihood of a reading in a bin (a [`BinLikelihood`]).

mod division;

pub use division::Division;

/// Measurement model for poses of `D` axes.
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

    /// [`BinLikelihood::log_likelihood`] of a pose that explains the reading well enough.
    /// When all active bins are worse, they fall back against sleeping ones.
    fn expected(&self, reading: usize) -> f64;

    /// A cheap approximation of [`BinLikelihood::log_likelihood`], reliable for bins far behind.
    fn screen(&mut self, object: u32, center: &[f64; D], depth: usize, reading: usize) -> f64;
}

/// Thresholds and budgets of the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Distance behind the best within which bins are evaluated, nats.
    pub keep: f64,
    /// Distance behind the best within which bins are split, nats.
    pub split: f64,
    /// Largest penalty of one reading for a bin, nats.
    pub floor: f64,
    /// With more active bins than this, only this many, the best of a screening, are evaluated.
    pub screened_max: usize,
    /// Exponent of the screening's score for the bins that are not evaluated, 0 to 1.
    pub screen_temper: f64,
    /// Maximum evaluations that splitting may cost per reading.
    pub evaluations_max: usize,
    /// Maximum number of bins.
    pub bins_max: usize,
}

/// A bin of poses of one object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin<const D: usize> {
    /// The object.
    pub object: u32,
    /// Number of splits from the first bins.
    pub depth: u32,
    /// Number of readings it has been scored on; the others count as typical.
    pub n_scored: u32,
    /// Centre of the bin, in the axes' own units.
    pub center: [f64; D],
    /// ln of the likelihood relative to typical readings, plus ln of the object's prior.
    pub score: f64,
}

/// The adaptive histogram over objects and poses.
#[derive(Clone, Debug)]
pub struct AdaptiveHistogram<const D: usize> {
    division: Division<D>,
    log_prior: Vec<f64>,
    bins: Vec<Bin<D>>,
    /// The score of a typical reading for the active bins, by reading.
    typical: Vec<f64>,
}

impl<const D: usize> AdaptiveHistogram<D> {
    /// Bytes of the bins.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let numbers = self.log_prior.capacity() + self.typical.capacity();
        self.bins.capacity() * size_of::<Bin<D>>() + numbers * size_of::<f64>()
    }

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

    /// The division of the poses.
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

    /// Adds the next reading, which the model knows under the next index.
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

    /// Screens many bins and returns the best; the others keep the screening's score.
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

    /// The score of this reading in the bin that explains all readings best; −∞ without any.
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

    /// Scores sleeping bins on their missed readings while they are within reach of the best.
    fn wake(&mut self, model: &mut impl BinLikelihood<D>, effort: &Effort) {
        let mut best = self.best_complete();
        for at in 0..self.bins.len() {
            let mut bin = self.bins[at];
            best = best.max(self.score(&mut bin, best, model, effort));
            self.bins[at] = bin;
        }
    }

    /// Scores a bin on its missed readings while it is within reach of `best`; its score when
    /// that is complete, else −∞.
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

    /// Splits the bins of the largest mass, in rounds, within the budget.
    fn split(&mut self, model: &mut impl BinLikelihood<D>, effort: &Effort) {
        let mut left = effort.evaluations_max;
        let mut best = self.best_complete();
        loop {
            let worth = self.worth_splitting(best, left, effort);
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

    /// The better half of the splittable bins, largest mass first, limited to what `left`
    /// evaluations pay for.
    fn worth_splitting(&self, best: f64, left: usize, effort: &Effort) -> Vec<usize> {
        let depth_max = self.division.depth_max();
        let worth = |bin: &Bin<D>| {
            bin.n_scored as usize == self.typical.len()
                && bin.score >= best - effort.split
                && (bin.depth as usize) < depth_max
        };
        let bins = self.bins.iter().enumerate().filter(|(_, bin)| worth(bin));
        let mut order: Vec<(f64, usize)> = bins.map(|(at, bin)| (self.log_mass(bin), at)).collect();
        // Only half at a time, so that children compete with the rest. A split has at least
        // two children; the first bin beyond the budget ends the rounds.
        let affordable = left / (2 * self.typical.len().max(1)) + 1;
        let n = order.len().div_ceil(2).min(affordable);
        let by_mass = |a: &(f64, usize), b: &(f64, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        if n < order.len() {
            order.select_nth_unstable_by(n, by_mass);
            order.truncate(n);
        }
        order.sort_unstable_by(by_mass);
        order.into_iter().map(|entry| entry.1).collect()
    }

    /// Drops the worst bins when there are too many.
    fn limit(&mut self, effort: &Effort) {
        if self.bins.len() > effort.bins_max {
            self.bins.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.object.cmp(&b.object)));
            self.bins.truncate(effort.bins_max);
        }
    }
}

#[cfg(test)]
mod tests;
