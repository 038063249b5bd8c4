//! The time of one update at 10,000 bins an object: literal, exhaustive and sparse.
//!
//! Every filter takes the same trial of every letter on one thread, before anything else runs.

use std::sync::Arc;
use std::time::Instant;

use palpate_dissertation::filter::histogram::{Extent, HistogramModel, PlanarHistogram};
use palpate_dissertation::filter::planes::BinShare;
use palpate_dissertation::occupancy::{ClassTable, OccupancyGrid};

use super::methods::{SPARSE, adaptive_belief, planar_bins};
use super::{Lab, LettersGeometric, trials};
use crate::report::Report;
use crate::statistics::{mean, median};

/// Readings of the first letter that the literal filter is timed with; it is slow.
const LITERAL_READINGS: usize = 5;

/// Adds the times in milliseconds to the summary.
pub(super) fn updates(report: &mut Report, config: &LettersGeometric, lab: &Lab) {
    let bins = planar_bins([25, 25, 16]);
    let maps: Vec<OccupancyGrid> = lab.model.maps.iter().map(|map| map.occupancy.clone()).collect();
    let n_letters = maps.len();
    let model = Arc::new(HistogramModel::new(maps, ClassTable::literal(), &bins, BinShare::Center));
    let times = |extent: Extent, n_letters: usize, n_readings: usize| {
        let mut times = Vec::new();
        for letter in 0..n_letters {
            let (_, readings) = trials::draw(config, lab, letter, (letter * config.trials) as u64);
            let mut filter = PlanarHistogram::new(model.clone(), bins, extent, 1.0);
            for reading in readings.iter().take(n_readings) {
                let started = Instant::now();
                filter.add(lab.classified(reading));
                times.push(started.elapsed().as_secs_f64() * 1e3);
            }
        }
        times
    };
    let literal = times(Extent::Literal, 1, LITERAL_READINGS);
    let exhaustive = times(Extent::Exhaustive, n_letters, config.readings);
    let sparse = times(SPARSE, n_letters, config.readings);
    report.summarise("update_ms_literal_median", median(&literal));
    report.summarise("update_ms_exhaustive_median", median(&exhaustive));
    report.summarise("update_ms_sparse_median", median(&sparse));
    report.summarise("update_ms_sparse_mean", mean(&sparse));
    report.summarise("ms_per_touch", mean(&adaptive(config, lab)));
    report.summarise("planes_bytes", model.bytes() as f64);
}

/// Time of the default method's first nine readings, with answers, in one trial per letter.
fn adaptive(config: &LettersGeometric, lab: &Lab) -> Vec<f64> {
    let fresh = adaptive_belief(lab);
    let mut times = Vec::new();
    for letter in 0..lab.model.maps.len() {
        let (_, readings) = trials::draw(config, lab, letter, (letter * config.trials) as u64);
        let mut belief = fresh.clone();
        for reading in readings.iter().take(9) {
            let started = Instant::now();
            belief.add(reading, &lab.sensor).expect("the rig presses straight down");
            let answer = belief.answer(1);
            times.push(started.elapsed().as_secs_f64() * 1e3);
            debug_assert!(answer.n_readings > 0);
        }
    }
    times
}
