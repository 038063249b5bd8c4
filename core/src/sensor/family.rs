//! Families of sensors: all sensors that one description may stand for.
//!
//! Pressing a mesh with many sensors of a family makes maps and calibration include what the
//! description leaves open. Every draw is a complete description. Not here: pressing
//! (`palpate_sim::sampler::family`).

use super::coupling::{Coupling, MARGIN_MAX};
use super::description::{SensorDescription, SensorParameters};
use super::force_curve::ForceCurve;
use super::ranges::{SensorRanges, StatedRanges};
use crate::rng::Stream;
use crate::units::MM;

/// Smallest point spread, metres: the lower limit of a description.
const POINT_SPREAD_MIN: f64 = 0.01 * MM;

/// Number of segments of a bent force curve. Chosen: between two knots a line is then within
/// 0.1 % of the full pressure.
const CURVE_SEGMENTS: usize = 16;

/// Smallest rise of a bent force curve as a share of that of the curve. Chosen: small, since only
/// curves that flatten out need it.
const RISE_MIN: f64 = 1e-3;

/// Trust in a sensor's description.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SensorKnowledge {
    /// The numbers were measured on this sensor: presses follow the description exactly.
    Measured,
    /// The numbers come from a data sheet: geometry and range are right; spread, edge and
    /// stiffness may differ.
    #[default]
    DataSheet,
    /// Only the grid is right; the other numbers are guesses.
    Unknown,
}

/// The sensors that a description may stand for.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorFamily {
    description: SensorDescription,
    /// `None`: the description itself.
    ranges: Option<SensorRanges>,
}

impl SensorFamily {
    /// The family of a description at a level of knowledge.
    #[must_use]
    pub fn new(description: SensorDescription, knowledge: SensorKnowledge) -> Self {
        Self::within(description, knowledge, &StatedRanges::default())
    }

    /// The family of a description at a level of knowledge; ranges that are stated take the place
    /// of the level's.
    #[must_use]
    pub fn within(
        description: SensorDescription,
        knowledge: SensorKnowledge,
        stated: &StatedRanges,
    ) -> Self {
        let ranges = match knowledge {
            SensorKnowledge::Measured => None,
            SensorKnowledge::DataSheet => Some(SensorRanges::data_sheet(&description, stated)),
            SensorKnowledge::Unknown => Some(SensorRanges::unknown(&description, stated)),
        };
        Self { description, ranges }
    }

    /// What the description leaves open; `None` when that is nothing.
    #[must_use]
    pub fn ranges(&self) -> Option<&SensorRanges> {
        self.ranges.as_ref()
    }

    /// The description that names the family; readings are interpreted by it.
    #[must_use]
    pub fn description(&self) -> &SensorDescription {
        &self.description
    }

    /// Whether all draws are the description itself.
    #[must_use]
    pub fn is_single(&self) -> bool {
        self.ranges.is_none()
    }

    /// One sensor of the family: the same grid, range, noise and image order.
    ///
    /// # Panics
    /// Never: draws stay within the limits of a description.
    #[must_use]
    pub fn draw(&self, stream: &mut Stream) -> SensorDescription {
        let Some(ranges) = &self.ranges else { return self.description.clone() };
        let known = self.description.parameters().clone();
        let mut within = |(low, high): (f64, f64)| stream.uniform(low, high);
        let spread = known.point_spread * within(ranges.spread_factor);
        let margin = within(ranges.margin);
        let cross_talk = within(ranges.cross_talk);
        let stiffness = within((ranges.stiffness.0.ln(), ranges.stiffness.1.ln())).exp();
        let stiffening = within(ranges.stiffening);
        let kernel = ranges.kernels[stream.index(ranges.kernels.len())];
        let edge = ranges.edges[stream.index(ranges.edges.len())];
        let coupling = Coupling {
            kernel,
            margin: Some(margin.min(MARGIN_MAX)),
            edge,
            cross_talk,
            gain_spread: ranges.gain_spread,
            hysteresis: ranges.hysteresis,
        };
        let force_curve = bent(&known.force_curve, known.covering_thickness, stiffness, stiffening);
        let parameters = SensorParameters {
            point_spread: spread.clamp(POINT_SPREAD_MIN, 50.0 * MM),
            force_curve,
            coupling,
            ..known
        };
        SensorDescription::new(parameters).expect("a draw is within a description's limits")
    }
}

/// A force curve with `stiffness` times the pressure of `curve` at full indentation (`thickness`,
/// metres). The ratio of both pressures is 1 + `stiffening` times as large there as at first touch.
/// Below a stiffening of −0.5 a line would fall towards full indentation; there the pressure rises
/// by a thousandth of what `curve` rises instead.
///
/// # Panics
/// For a stiffness that is not positive or a stiffening of −1 or less.
#[must_use]
pub fn bent(curve: &ForceCurve, thickness: f64, stiffness: f64, stiffening: f64) -> ForceCurve {
    let knots = curve.knots();
    let cuts = (CURVE_SEGMENTS / (knots.len() - 1)).max(1);
    let pressure = |d: f64| {
        let share = (1.0 + stiffening * d / thickness) / (1.0 + stiffening);
        stiffness * share * curve.pressure(d)
    };
    let between = |pair: &[(f64, f64)]| {
        let (from, to) = (pair[0].0, pair[1].0);
        (1..=cuts).map(move |cut| from + (to - from) * cut as f64 / cuts as f64)
    };
    let displacements: Vec<f64> = knots.windows(2).flat_map(between).collect();
    let mut bent = vec![(0.0, 0.0)];
    for d in displacements {
        let (before, last) = bent[bent.len() - 1];
        let rise = curve.pressure(d) - curve.pressure(before);
        bent.push((d, pressure(d).max(last + RISE_MIN * stiffness * rise)));
    }
    ForceCurve::new(bent).expect("every knot is above the last")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Purpose;
    use crate::units::KPA;

    #[test]
    fn draws_keep_the_geometry_and_differ_in_what_is_open() {
        let known = SensorDescription::digitacts_6x6();
        let family = SensorFamily::new(known.clone(), SensorKnowledge::DataSheet);
        let mut stream = Stream::new(3, Purpose::SensorFamily, 0);
        let mut margins = Vec::new();
        for _ in 0..200 {
            let drawn = family.draw(&mut stream);
            let (a, b) = (known.parameters(), drawn.parameters());
            assert_eq!((a.grid, a.noise, a.image_order), (b.grid, b.noise, b.image_order));
            assert!((a.saturation - b.saturation).abs() < 1e-9);
            let factor = b.point_spread / a.point_spread;
            assert!((0.3..=1.4).contains(&factor), "{factor}");
            let full = b.force_curve.pressure(b.covering_thickness) / a.saturation;
            assert!((0.5 - 1e-9..=2.0 + 1e-9).contains(&full), "{full}");
            margins.push(b.coupling.margin.unwrap());
        }
        assert!(margins.iter().any(|m| *m < 1.0 * MM) && margins.iter().any(|m| *m > 7.0 * MM));
    }

    #[test]
    fn a_measured_sensor_is_its_own_family() {
        let known = SensorDescription::digitacts_6x6();
        let family = SensorFamily::new(known.clone(), SensorKnowledge::Measured);
        let mut stream = Stream::new(3, Purpose::SensorFamily, 0);
        assert!(family.is_single());
        assert_eq!(family.draw(&mut stream), known);
    }

    #[test]
    fn a_bent_curve_has_the_stated_stiffness() {
        // A line to 20 kPa at 2 mm, half as stiff and stiffening by 1: at 2 mm 10 kPa, at
        // 1 mm 10/2 · (1 + 1/2)/(1 + 1) = 3.75 kPa.
        let line = ForceCurve::new(vec![(0.0, 0.0), (2.0 * MM, 20.0 * KPA)]).unwrap();
        let bent = bent(&line, 2.0 * MM, 0.5, 1.0);
        assert!((bent.pressure(2.0 * MM) - 10.0 * KPA).abs() < 1e-6);
        assert!((bent.pressure(1.0 * MM) - 3.75 * KPA).abs() < 1e-6);
        // As soft at full indentation as it gets: it rises all the same.
        let soft = super::bent(&line, 2.0 * MM, 1.0, -0.9);
        assert!(soft.knots().windows(2).all(|pair| pair[0].1 < pair[1].1), "{soft:?}");
        assert!(soft.pressure(1.0 * MM) > 10.0 * KPA, "most of it at first touch");
    }
}
