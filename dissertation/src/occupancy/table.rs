//! Pr(class | log-odds): the probability of a taxel's contact class given the map's log-odds.
//!
//! Source: section 3.3.2, equations 3.7–3.8. The printed classifier (right 90 %, random 10 %)
//! is one such table; one learnt from training presses includes the effect of blur, and is
//! the default. Not here: looking maps up (`grid`) and products over taxels (`likelihood`).

use thiserror::Error;

use super::classify::ContactClass;
use super::grid::OccupancyGrid;
use super::likelihood::ClassifiedPress;

/// Largest log-odds that a [`ClassTable`] distinguishes, in either direction.
pub const TABLE_LOG_ODDS: f64 = 8.0;

/// Rows of a learnt table, half a unit of log-odds each.
const LEARNT_ROWS: usize = 32;

/// Initial count of a learnt row: this many taxels with the classes' overall shares.
const SMOOTHING_TAXELS: f64 = 20.0;

/// Probability of each contact class given the map's log-odds: Pr(class | log-odds).
///
/// Row i belongs to the log-odds `-8 + 16·(i + ½)/n`; values between rows are interpolated,
/// and constant beyond the first and the last. Classes: in contact, no contact, unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct ClassTable(Vec<[f64; 3]>);

/// Error of numbers that are not a table of class probabilities.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum ClassTableError {
    /// There are no rows or too many.
    #[error("{found} rows, expected 1 to 4096")]
    Rows {
        /// Number of rows.
        found: usize,
    },
    /// A row is not a distribution.
    #[error("row {row} is not three positive numbers that sum to 1")]
    Row {
        /// The first such row.
        row: usize,
    },
}

impl ClassTable {
    /// A table from its rows: (in contact, no contact, unknown).
    ///
    /// # Errors
    /// [`ClassTableError`] unless there are 1 to 4096 rows of positive numbers that sum to 1.
    pub fn new(rows: Vec<[f64; 3]>) -> Result<Self, ClassTableError> {
        if !(1..=4096).contains(&rows.len()) {
            return Err(ClassTableError::Rows { found: rows.len() });
        }
        let valid = |row: &[f64; 3]| {
            row.iter().all(|p| *p > 0.0) && (row.iter().sum::<f64>() - 1.0).abs() < 1e-6
        };
        match rows.iter().position(|row| !valid(row)) {
            Some(row) => Err(ClassTableError::Row { row }),
            None => Ok(Self(rows)),
        }
    }

    /// Equation 3.8 with the printed classifier: right nine times out of ten, otherwise any
    /// of the three classes, so 0.9333 / 0.0333 / 0.0333; 512 rows over the log-odds.
    #[must_use]
    pub fn literal() -> Self {
        let (right, wrong) = (0.9 + 0.1 / 3.0, 0.1 / 3.0);
        let row = |idx: usize| {
            let log_odds = TABLE_LOG_ODDS * ((2 * idx + 1) as f64 / 512.0 - 1.0);
            let occupied = logistic(log_odds);
            let touching = right * occupied + wrong * (1.0 - occupied);
            let free = wrong * occupied + right * (1.0 - occupied);
            [touching, free, wrong]
        };
        Self((0..512).map(row).collect())
    }

    /// The rows, smallest log-odds first.
    #[must_use]
    pub fn rows(&self) -> &[[f64; 3]] {
        &self.0
    }

    /// Pr(class | log-odds), between rows interpolated.
    #[must_use]
    pub fn probability(&self, class: ContactClass, log_odds: f64) -> f64 {
        let n = self.0.len();
        let place = (log_odds / TABLE_LOG_ODDS + 1.0) * 0.5 * n as f64 - 0.5;
        let place = place.clamp(0.0, (n - 1) as f64);
        let below = (place as usize).min(n.saturating_sub(2));
        let above = (below + 1).min(n - 1);
        let share = place - below as f64;
        let at = |row: usize| self.0[row][class as usize];
        at(below) + share * (at(above) - at(below))
    }
}

/// The logistic function: the probability of log-odds.
#[must_use]
pub fn logistic(log_odds: f64) -> f64 {
    (1.0 + (-log_odds).exp()).recip()
}

/// The log-odds of a probability within 0 and 1.
#[must_use]
pub fn logit(probability: f64) -> f64 {
    (probability / (1.0 - probability)).ln()
}

/// Learns Pr(class | log-odds) from training presses and their maps: each object's presses
/// (in the object's frame, as its map) are looked up in its map, all counted in one table of
/// 32 rows. Rows start as twenty taxels of the overall shares.
#[must_use]
pub fn learn_table(presses: &[Vec<ClassifiedPress>], maps: &[OccupancyGrid]) -> ClassTable {
    let mut counts = vec![[0.0f64; 3]; LEARNT_ROWS];
    for (presses, map) in presses.iter().zip(maps) {
        for (point, class) in presses.iter().flat_map(ClassifiedPress::taxels) {
            let log_odds = map.log_odds_at(*point);
            let place = (log_odds / TABLE_LOG_ODDS + 1.0) * 0.5 * LEARNT_ROWS as f64;
            let row = (place.max(0.0) as usize).min(LEARNT_ROWS - 1);
            counts[row][*class as usize] += 1.0;
        }
    }
    // One more taxel of each class, so that no share is 0.
    let overall: [f64; 3] =
        std::array::from_fn(|class| 1.0 + counts.iter().map(|row| row[class]).sum::<f64>());
    let n: f64 = overall.iter().sum();
    let rows = counts.iter().map(|row| {
        let total: f64 = row.iter().sum::<f64>() + SMOOTHING_TAXELS;
        std::array::from_fn(|class| (row[class] + SMOOTHING_TAXELS * overall[class] / n) / total)
    });
    ClassTable(rows.collect())
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::occupancy::GridShape;

    #[test]
    fn rows_of_a_table_are_distributions() {
        assert!(ClassTable::new(vec![[0.9, 0.05, 0.05]]).is_ok());
        assert_eq!(ClassTable::new(Vec::new()), Err(ClassTableError::Rows { found: 0 }));
        let bad = vec![[0.5, 0.25, 0.25], [0.5, 0.5, 0.0]];
        assert_eq!(ClassTable::new(bad), Err(ClassTableError::Row { row: 1 }));
    }

    #[test]
    fn the_printed_classifier_matches_hand_computed_values() {
        let table = ClassTable::literal();
        // Odds of 3:1 in favour: 0.9333·0.75 + 0.0333·0.25 = 0.70833.
        let touching = table.probability(ContactClass::InContact, 3.0_f64.ln());
        assert!((touching - 0.708_333).abs() < 1e-5, "{touching}");
        let free = table.probability(ContactClass::NoContact, 0.0);
        assert!((free - 0.483_333).abs() < 1e-5, "{free}");
        for log_odds in [-20.0, 0.0, 20.0] {
            let unknown = table.probability(ContactClass::Unknown, log_odds);
            assert!((unknown - 0.1 / 3.0).abs() < 1e-12);
        }
        // Beyond the last row, whose log-odds are 7.98: 0.03333 + 0.9·0.99966.
        let sure = table.probability(ContactClass::InContact, 50.0);
        assert!((sure - 0.933_03).abs() < 1e-5, "{sure}");
    }

    #[test]
    fn values_between_rows_are_interpolated() {
        let table = ClassTable::new(vec![[0.2, 0.6, 0.2], [0.6, 0.2, 0.2]]).unwrap();
        // Rows at −4 and 4: at −2 a quarter of the way.
        assert!((table.probability(ContactClass::InContact, -2.0) - 0.3).abs() < 1e-12);
        assert!((table.probability(ContactClass::NoContact, 9.0) - 0.2).abs() < 1e-12);
    }

    #[test]
    fn a_learnt_row_counts_taxels_over_its_prior() {
        // One cell of log-odds 4.25 lies in row (4.25/8 + 1)·16 = 24; 60 touch and 20 do not.
        let shape = GridShape::new(DVec3::splat(-1.0), 2.0, [1, 1, 1]).unwrap();
        let map = OccupancyGrid::from_parts(shape, 0.5, vec![4.25]).unwrap();
        let taxels = (0..80).map(|taxel| {
            let class = if taxel < 60 { ContactClass::InContact } else { ContactClass::NoContact };
            (DVec3::ZERO, class)
        });
        let press = ClassifiedPress::from_taxels(taxels.collect());
        let table = learn_table(&[vec![press]], &[map]);
        // Shares overall 61/83, 21/83, 1/83: (60 + 20·61/83)/100 = 0.746988.
        assert!((table.rows()[24][0] - 0.746_988).abs() < 1e-6, "{:?}", table.rows()[24]);
        assert!((table.rows()[0][2] - 1.0 / 83.0).abs() < 1e-12);
        assert!(ClassTable::new(table.rows().to_vec()).is_ok());
    }
}
