//! Log-likelihoods of the taxel classes at every position of one planar map, for single look-ups.
//!
//! Values are relative to an unmapped position. Not here: planes for whole rows of bins
//! (`planes`).

use glam::DVec2;
use rayon::prelude::*;

use crate::occupancy::{ClassTable, ClassifiedPress, ContactClass, OccupancyGrid};
use palpate_core::pose::Pose;
use palpate_core::units::MM;

/// Distance between samples of a [`ClassField`], metres. Chosen: a fifth of a map's usual cell.
const FIELD_SAMPLE: f64 = 0.2 * MM;

/// Classes of a taxel.
pub(super) const N_CLASSES: usize = 3;

/// ln Pr(class | position) less ln Pr(class | an unmapped position), for one object.
#[derive(Clone, Debug)]
pub(super) struct Relative<'a> {
    map: &'a OccupancyGrid,
    table: &'a ClassTable,
    pub(super) unknown: [f64; N_CLASSES],
}

const CLASSES: [ContactClass; N_CLASSES] =
    [ContactClass::InContact, ContactClass::NoContact, ContactClass::Unknown];

impl<'a> Relative<'a> {
    pub(super) fn new(map: &'a OccupancyGrid, table: &'a ClassTable) -> Self {
        let prior = (map.prior() / (1.0 - map.prior())).ln();
        let unknown = CLASSES.map(|class| table.probability(class, prior).ln());
        Self { map, table, unknown }
    }

    fn at(&self, place: DVec2) -> [f32; N_CLASSES] {
        self.mean_at(std::iter::once(place))
    }

    /// The mean probability over several positions, relative to an unmapped one.
    pub(super) fn mean_at(&self, places: impl Iterator<Item = DVec2>) -> [f32; N_CLASSES] {
        let (mut sums, mut n) = ([0.0; N_CLASSES], 0.0);
        for place in places {
            let log_odds = self.map.log_odds_at(place.extend(self.map.shape().min().z));
            for (sum, class) in sums.iter_mut().zip(CLASSES) {
                *sum += self.table.probability(class, log_odds);
            }
            n += 1.0;
        }
        std::array::from_fn(|class| ((sums[class] / n).ln() - self.unknown[class]) as f32)
    }
}

/// Distance from the object's origin beyond which a map has no cells, metres.
pub(super) fn radius(map: &OccupancyGrid) -> f64 {
    let shape = map.shape();
    let low = shape.min().truncate() - 0.5 * shape.cell();
    let n = DVec2::new(shape.n()[0] as f64, shape.n()[1] as f64);
    let high = low + (n + 1.0) * shape.cell();
    low.abs().max(high.abs()).length()
}

/// The class log-likelihoods of one planar map, for single look-ups.
#[derive(Clone, Debug)]
pub struct ClassField {
    radius: f64,
    side: usize,
    values: Vec<[f32; N_CLASSES]>,
    unknown: [f64; N_CLASSES],
}

impl ClassField {
    /// Samples a map every 0.2 mm.
    #[must_use]
    pub fn new(map: &OccupancyGrid, table: &ClassTable) -> Self {
        let relative = Relative::new(map, table);
        let radius = radius(map);
        let side = (2.0 * radius / FIELD_SAMPLE).ceil() as usize + 1;
        let mut values = vec![[0.0; N_CLASSES]; side * side];
        values.par_chunks_mut(side).enumerate().for_each(|(row, values)| {
            for (col, value) in values.iter_mut().enumerate() {
                let place = DVec2::new(col as f64, row as f64) * FIELD_SAMPLE - radius;
                *value = relative.at(place);
            }
        });
        Self { radius, side, values, unknown: relative.unknown }
    }

    /// ln Pr(press | the object at a planar pose), each taxel at the nearest sample.
    #[must_use]
    pub fn log_likelihood(&self, press: &ClassifiedPress, session_from_object: &Pose) -> f64 {
        let object_from_session = session_from_object.inverse();
        let along_x = object_from_session.turn(glam::DVec3::X).truncate() / FIELD_SAMPLE;
        let along_y = object_from_session.turn(glam::DVec3::Y).truncate() / FIELD_SAMPLE;
        let first = object_from_session.translation.truncate() / FIELD_SAMPLE
            + (self.radius / FIELD_SAMPLE + 0.5);
        let mut sum = 0.0;
        for (point, class) in press.taxels() {
            let place = first + point.x * along_x + point.y * along_y;
            let (col, row) = (place.x.floor(), place.y.floor());
            sum += self.unknown[*class as usize];
            let side = self.side as f64;
            if col >= 0.0 && row >= 0.0 && col < side && row < side {
                let value = &self.values[row as usize * self.side + col as usize];
                sum += f64::from(value[*class as usize]);
            }
        }
        sum
    }
}
