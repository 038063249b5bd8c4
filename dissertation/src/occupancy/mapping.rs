//! The inverse sensor model: the evidence of presses for the cells around them.
//!
//! Source: section 3.2.2, equations 3.3–3.6; deviations are in `docs/equations.md`, and
//! mapping fails without those of equation 3.4's exponent and prefactor. Poses of readings
//! are `object_from_sensor`. One implementation serves planar and solid grids: in a planar
//! one everything is projected along z. The map depends on the set of readings alone, bit for
//! bit: neither their order nor the number of threads matters.

use glam::DVec3;
use rayon::prelude::*;

use super::classify::{CONTACT_THRESHOLD, ContactClass, WeakPress};
use super::grid::{GridError, GridShape, LOG_ODDS_MAX, OccupancyGrid};
use super::likelihood::ClassifiedPress;
use super::table::logit;
use palpate_core::reading::Reading;
use palpate_core::sensor::SensorDescription;

/// Fraction of the peak weight below which evidence is left out.
const WEIGHT_MIN: f64 = 1e-4;

/// Margin to 0 and 1 of the probabilities of equation 3.5.
const PROBABILITY_MARGIN: f64 = 1e-6;

/// The exponent of equation 3.4.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpreadForm {
    /// A Gaussian of half the point spread, as section 3.2.2 says: exp(−2d²/σ²).
    HalfWidth,
    /// exp(−d²/8σ²), which is twice the spread: half of five letters stay wrong after any
    /// number of presses (`letters-geometric --maps printed-spread`).
    AsPrinted,
}

/// The factor before the exponential of equation 3.4.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Peak {
    /// Unit peak times a reliability, within 0 and 1; independent of units.
    Reliability(f64),
    /// The printed density 1/√(πσ²/4), σ counted in the sensor's pitch.
    AsPrinted,
}

/// Evidence of one taxel for the cells around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseModel {
    /// T of equation 3.3, Pa.
    pub contact_threshold: f64,
    /// Classification of a press below the threshold everywhere.
    pub weak_press: WeakPress,
    /// The exponent of equation 3.4.
    pub spread: SpreadForm,
    /// The factor of equation 3.4.
    pub peak: Peak,
    /// Pr(m): the probability of an unmapped cell, within 0 and 1.
    pub prior: f64,
    /// The largest log-odds of a cell; infinite for no limit.
    pub log_odds_max: f64,
}

impl Default for InverseModel {
    /// The settings of `docs/equations.md`.
    fn default() -> Self {
        Self {
            contact_threshold: CONTACT_THRESHOLD,
            weak_press: WeakPress::Free,
            spread: SpreadForm::HalfWidth,
            peak: Peak::Reliability(0.6),
            prior: 0.5,
            log_odds_max: LOG_ODDS_MAX,
        }
    }
}

impl InverseModel {
    /// Equations 3.3–3.5 as printed, without a limit; `prior` is the fraction of the modelled
    /// area that objects cover.
    #[must_use]
    pub fn literal(prior: f64) -> Self {
        Self {
            weak_press: WeakPress::AsPrinted,
            spread: SpreadForm::AsPrinted,
            peak: Peak::AsPrinted,
            prior,
            log_odds_max: f64::INFINITY,
            ..Self::default()
        }
    }

    /// Equations 3.4–3.6 for one taxel and one cell: the increment of the cell's log-odds
    /// when their centres are `squared` square metres apart.
    #[must_use]
    pub fn evidence(&self, class: ContactClass, squared: f64, spread: f64, pitch: f64) -> f64 {
        let weight = self.peak(spread, pitch) * (-self.rate(spread) * squared).exp();
        let occupied = match class {
            ContactClass::InContact => self.prior + (1.0 - self.prior) * weight,
            ContactClass::NoContact => self.prior - self.prior * weight,
            ContactClass::Unknown => return 0.0,
        };
        logit(occupied.clamp(PROBABILITY_MARGIN, 1.0 - PROBABILITY_MARGIN)) - logit(self.prior)
    }

    /// The factor of the squared distance in the exponent, 1/m².
    fn rate(&self, spread: f64) -> f64 {
        match self.spread {
            SpreadForm::HalfWidth => 2.0 / (spread * spread), // prose of 3.2.2
            SpreadForm::AsPrinted => 1.0 / (8.0 * spread * spread), // equation 3.4
        }
    }

    fn peak(&self, spread: f64, pitch: f64) -> f64 {
        match self.peak {
            Peak::Reliability(reliability) => reliability,
            Peak::AsPrinted => {
                (std::f64::consts::PI * (spread / pitch).powi(2) / 4.0).sqrt().recip()
            }
        }
    }

    /// Distance that evidence reaches, metres.
    #[must_use]
    pub fn reach(&self, sensor: &SensorDescription) -> f64 {
        (-WEIGHT_MIN.ln() / self.rate(sensor.parameters().point_spread)).sqrt()
    }

    /// A reading's taxels with their classes, in the frame of its pose.
    #[must_use]
    pub fn classified(&self, reading: &Reading, sensor: &SensorDescription) -> ClassifiedPress {
        ClassifiedPress::new(reading, sensor, self.contact_threshold, self.weak_press)
    }
}

/// Maps readings of one sensor; poses are `object_from_sensor`. The values are log-odds,
/// equation 3.6 from the prior on, clamped to the model's limit.
///
/// By definition, with evidence beyond [`InverseModel::reach`] left out: `l(cell) =
/// logit(prior) + Σ evidence(class(taxel), |cell − taxel|²)`.
///
/// # Panics
/// When the model's prior is not strictly between 0 and 1.
#[must_use]
pub fn map_occupancy(
    readings: &[Reading],
    sensor: &SensorDescription,
    shape: GridShape,
    model: &InverseModel,
) -> OccupancyGrid {
    let presses: Vec<ClassifiedPress> =
        readings.iter().map(|reading| model.classified(reading, sensor)).collect();
    map_presses(&presses, sensor, shape, model)
}

/// [`map_occupancy`] for classified presses, in the object frame.
///
/// # Panics
/// When the model's prior is not strictly between 0 and 1.
#[must_use]
pub fn map_presses(
    presses: &[ClassifiedPress],
    sensor: &SensorDescription,
    shape: GridShape,
    model: &InverseModel,
) -> OccupancyGrid {
    let evidence = sorted_evidence(presses, &shape);
    let row = RowMapper {
        shape: &shape,
        model,
        reach: model.reach(sensor),
        spread: sensor.parameters().point_spread,
        pitch: sensor.grid().pitch,
    };
    let width = shape.n()[0];
    let mut log_odds = vec![0.0f32; shape.n_cells()];
    log_odds
        .par_chunks_mut(width)
        .enumerate()
        .for_each(|(idx, cells)| row.fill(idx * width, &evidence, cells));
    OccupancyGrid::from_parts(shape, model.prior, log_odds)
        .expect("log-odds of clamped probabilities are finite; the prior is between 0 and 1")
}

/// The shape of a grid that holds all taxels of `readings` (`object_from_sensor`) and
/// `margin` metres around them. Its corners are whole cells away from the object frame's
/// origin, so that grids of one cell side share a lattice.
///
/// `plane` is the height of a planar grid's plane (metres), `None` makes a solid grid.
///
/// # Errors
/// [`GridError`] when the cell is not valid or the grid would be too large.
pub fn shape_around(
    readings: &[Reading],
    sensor: &SensorDescription,
    cell: f64,
    margin: f64,
    plane: Option<f64>,
) -> Result<GridShape, GridError> {
    let (grid, deepest) = (sensor.grid(), sensor.parameters().covering_thickness);
    let (x, y) = grid.center(grid.rows - 1, grid.cols - 1);
    let corners = [(-x, -y), (x, -y), (-x, y), (x, y)];
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for reading in readings {
        for (x, y) in corners {
            for z in [0.0, -deepest] {
                let point = reading.session_from_sensor() * DVec3::new(x, y, z);
                (low, high) = (low.min(point), high.max(point));
            }
        }
    }
    if readings.is_empty() {
        (low, high) = (DVec3::ZERO, DVec3::ZERO);
    }
    GridShape::spanning(low - margin, high + margin, cell, plane)
}

/// A taxel's position and contact class.
type Evidence = (DVec3, ContactClass);

/// All evidence in an order independent of that of the readings, so that sums do not depend on it.
fn sorted_evidence(presses: &[ClassifiedPress], shape: &GridShape) -> Vec<Evidence> {
    let flat = |point: DVec3| if shape.is_planar() { point.with_z(shape.min().z) } else { point };
    let mut evidence: Vec<Evidence> = presses
        .iter()
        .flat_map(ClassifiedPress::taxels)
        .filter(|(_, class)| *class != ContactClass::Unknown)
        .map(|(point, class)| (flat(*point), *class))
        .collect();
    evidence.par_sort_unstable_by(|(a, a_class), (b, b_class)| {
        let axes = a.z.total_cmp(&b.z).then(a.y.total_cmp(&b.y)).then(a.x.total_cmp(&b.x));
        axes.then((*a_class as u8).cmp(&(*b_class as u8)))
    });
    evidence
}

/// Common data of the rows of one map.
struct RowMapper<'a> {
    shape: &'a GridShape,
    model: &'a InverseModel,
    reach: f64,
    spread: f64,
    pitch: f64,
}

impl RowMapper<'_> {
    /// Fills the row of cells that begins with `first`.
    fn fill(&self, first: usize, evidence: &[Evidence], cells: &mut [f32]) {
        let (start, cell) = (self.shape.center(first), self.shape.cell());
        let from = evidence.partition_point(|(point, _)| point.z < start.z - self.reach);
        let to = evidence.partition_point(|(point, _)| point.z <= start.z + self.reach);
        let mut sums = vec![logit(self.model.prior); cells.len()];
        let reach_squared = self.reach * self.reach;
        for (point, class) in &evidence[from..to] {
            let across = (point.y - start.y).powi(2) + (point.z - start.z).powi(2);
            if across > reach_squared {
                continue;
            }
            let along = (reach_squared - across).sqrt();
            let place = |x: f64| ((x - start.x) / cell).clamp(0.0, cells.len() as f64) as usize;
            let range = place(point.x - along)..(place(point.x + along) + 1).min(cells.len());
            for idx in range {
                let squared = (start.x + idx as f64 * cell - point.x).powi(2) + across;
                if squared <= reach_squared {
                    sums[idx] += self.model.evidence(*class, squared, self.spread, self.pitch);
                }
            }
        }
        let limit = self.model.log_odds_max.min(f64::from(f32::MAX));
        for (cell, sum) in cells.iter_mut().zip(sums) {
            *cell = sum.clamp(-limit, limit) as f32;
        }
    }
}

#[cfg(test)]
mod tests;
