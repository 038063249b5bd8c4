//! Places of contacts in an implicit uniform grid over the workspace.
//!
//! Source: section 4.2.1, local strategy: a cell with contacts is chosen with probability
//! inversely proportional to their number, then one of its contacts uniformly.

use std::collections::BTreeMap;

use glam::DVec3;
use palpate_core::rng::Stream;

/// Contacts by cell; only cells with contacts exist.
#[derive(Clone, Debug)]
pub(super) struct ContactCells {
    width: f64,
    cells: BTreeMap<[i64; 3], Vec<DVec3>>,
}

impl ContactCells {
    /// No contacts yet; cells are `width` metres wide.
    pub(super) fn new(width: f64) -> Self {
        Self { width, cells: BTreeMap::new() }
    }

    /// Adds a contact, metres in the session frame.
    pub(super) fn add(&mut self, position: DVec3) {
        let cell = (position / self.width).floor().to_array().map(|index| index as i64);
        self.cells.entry(cell).or_default().push(position);
    }

    /// A contact drawn at random; `None` if there is none.
    pub(super) fn draw(&self, stream: &mut Stream) -> Option<DVec3> {
        let weight = |contacts: &Vec<DVec3>| 1.0 / contacts.len() as f64;
        let total: f64 = self.cells.values().map(weight).sum();
        let mut left = stream.uniform(0.0, total);
        let chosen = self.cells.values().find(|contacts| {
            left -= weight(contacts);
            left < 0.0
        });
        // Rounding may leave a remainder of weight after the last cell.
        let contacts = chosen.or_else(|| self.cells.values().next_back())?;
        Some(contacts[stream.index(contacts.len())])
    }
}

#[cfg(test)]
mod tests {
    use palpate_core::rng::Purpose;

    use super::*;

    #[test]
    fn cell_probability_is_inverse_to_its_contacts() {
        let mut cells = ContactCells::new(0.02);
        let mut stream = Stream::new(1, Purpose::Exploration, 0);
        assert_eq!(cells.draw(&mut stream), None);
        // One contact in the cell x < 0, three in the cell x > 0: 3/4 to 1/4, and each of the
        // three 1/12.
        cells.add(DVec3::new(-0.001, 0.001, 0.001));
        let crowded = [0.001, 0.011, 0.019].map(|x| DVec3::new(x, 0.001, 0.001));
        crowded.iter().for_each(|contact| cells.add(*contact));
        let n = 6000;
        let mut counts = [0; 4];
        for _ in 0..n {
            let drawn = cells.draw(&mut stream).unwrap();
            let idx = crowded.iter().position(|contact| *contact == drawn);
            counts[idx.map_or(0, |idx| idx + 1)] += 1;
        }
        // Deviations: sqrt(6000·3/16) = 34 and sqrt(6000·11/144) = 21; five of each.
        assert!((4330..=4670).contains(&counts[0]), "{counts:?}");
        assert!(counts[1..].iter().all(|count| (395..=605).contains(count)), "{counts:?}");
    }
}
