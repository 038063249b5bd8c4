//! Ranges of what a sensor's description leaves open, from which families are drawn.
//!
//! A number of the coupling that differs from its default is known, and a stated range is as
//! stated; everything else has the range of the level of knowledge. Lengths in metres.

use super::coupling::{CROSS_TALK_MAX, CoveringEdge, MARGIN_MAX, SpreadKernel};
use super::description::{SensorDescription, SensorError, within};

/// Limits of the factor on the point spread. Chosen: a spread that is wrong by more is another
/// sensor.
const SPREAD_FACTOR: (f64, f64) = (0.01, 10.0);

/// Limits of the factor on pressures. Chosen as those of the spread.
const STIFFNESS: (f64, f64) = (0.1, 10.0);

/// Largest stiffening. Chosen: eleven times as stiff at full indentation, beyond what rubber
/// does.
const STIFFENING_MAX: f64 = 10.0;

/// Ranges of what a description leaves open. A range is (low, high).
#[derive(Clone, Debug, PartialEq)]
pub struct SensorRanges {
    /// Factor on the point spread.
    pub spread_factor: (f64, f64),
    /// Shapes of the spread.
    pub kernels: Vec<SpreadKernel>,
    /// Extent of the covering beyond the array, metres.
    pub margin: (f64, f64),
    /// Effects of the covering's end.
    pub edges: Vec<CoveringEdge>,
    /// Cross-talk of neighbours.
    pub cross_talk: (f64, f64),
    /// Factor on the pressures of the force curve; drawn evenly in its logarithm.
    pub stiffness: (f64, f64),
    /// Excess of the pressure ratio at full indentation over that at first touch
    /// ([`bent`](super::family::bent)).
    pub stiffening: (f64, f64),
    /// Relative standard deviation of the taxels' gains.
    pub gain_spread: f64,
    /// Largest relative deviation of a press through hysteresis.
    pub hysteresis: f64,
}

/// Ranges that the sensor's owner states; `None` is that of the level of knowledge. Units as in
/// [`SensorRanges`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StatedRanges {
    /// Factor on the point spread.
    pub spread_factor: Option<(f64, f64)>,
    /// Shapes of the spread.
    pub kernels: Option<Vec<SpreadKernel>>,
    /// Extent of the covering beyond the array, metres.
    pub margin: Option<(f64, f64)>,
    /// Effects of the covering's end.
    pub edges: Option<Vec<CoveringEdge>>,
    /// Cross-talk of neighbours.
    pub cross_talk: Option<(f64, f64)>,
    /// Factor on the pressures of the force curve.
    pub stiffness: Option<(f64, f64)>,
    /// Excess of the pressure ratio at full indentation.
    pub stiffening: Option<(f64, f64)>,
}

/// Ranges of a level of knowledge, for what is neither stated nor known. Units as in
/// [`SensorRanges`], but the covering's extent counts in pitches.
struct Open {
    spread_factor: (f64, f64),
    margin_pitches: f64,
    cross_talk: (f64, f64),
    stiffness: (f64, f64),
    stiffening: (f64, f64),
    gain_spread: f64,
    hysteresis: f64,
}

/// What a data sheet leaves open. Chosen, without a measurement. A sheet states the thickness of
/// a covering but not its spread: equation 2.5 holds for one material. It states neither the edge
/// nor the stiffness: a factor of two each way, and up to 2.5 times as stiff at full indentation.
/// Cross-talk, gains and hysteresis are what sheets call good to mediocre.
const DATA_SHEET: Open = Open {
    spread_factor: (0.3, 1.4),
    margin_pitches: 4.0,
    cross_talk: (0.0, 0.15),
    stiffness: (0.5, 2.0),
    stiffening: (0.0, 1.5),
    gain_spread: 0.07,
    hysteresis: 0.05,
};

/// What is open if only the grid is sure. Chosen: each range of [`DATA_SHEET`] about twice as
/// wide, those of factors in their logarithm.
const UNKNOWN: Open = Open {
    spread_factor: (0.15, 2.0),
    margin_pitches: 6.0,
    cross_talk: (0.0, 0.25),
    stiffness: (0.25, 4.0),
    stiffening: (0.0, 3.0),
    gain_spread: 0.15,
    hysteresis: 0.1,
};

impl SensorRanges {
    /// The ranges of a description from a data sheet.
    #[must_use]
    pub fn data_sheet(description: &SensorDescription, stated: &StatedRanges) -> Self {
        Self::of(description, stated, &DATA_SHEET)
    }

    /// The ranges of a description whose numbers are guesses, but for the grid.
    #[must_use]
    pub fn unknown(description: &SensorDescription, stated: &StatedRanges) -> Self {
        Self::of(description, stated, &UNKNOWN)
    }

    fn of(description: &SensorDescription, stated: &StatedRanges, open: &Open) -> Self {
        let known = description.parameters().coupling;
        let above_zero = |number: f64| (number > 0.0).then_some(number);
        let point = |number: f64| (number, number);
        let kernel = (known.kernel != SpreadKernel::default()).then(|| vec![known.kernel]);
        let edge = (known.edge != CoveringEdge::default()).then(|| vec![known.edge]);
        let margin = stated.margin.or(known.margin.map(point));
        let cross_talk = stated.cross_talk.or(above_zero(known.cross_talk).map(point));
        Self {
            spread_factor: stated.spread_factor.unwrap_or(open.spread_factor),
            kernels: stated.kernels.clone().or(kernel).unwrap_or(SpreadKernel::ALL.to_vec()),
            margin: margin.unwrap_or((0.0, open.margin_pitches * description.grid().pitch)),
            edges: stated.edges.clone().or(edge).unwrap_or(CoveringEdge::ALL.to_vec()),
            cross_talk: cross_talk.unwrap_or(open.cross_talk),
            stiffness: stated.stiffness.unwrap_or(open.stiffness),
            stiffening: stated.stiffening.unwrap_or(open.stiffening),
            gain_spread: above_zero(known.gain_spread).unwrap_or(open.gain_spread),
            hysteresis: above_zero(known.hysteresis).unwrap_or(open.hysteresis),
        }
    }
}

impl StatedRanges {
    /// Whether no range is stated.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`SensorError`] names the first range that is out of its limits, out of order or empty.
    pub fn check(&self) -> Result<(), SensorError> {
        let ranges = [
            ("spread_factor", self.spread_factor, SPREAD_FACTOR),
            ("margin", self.margin, (0.0, MARGIN_MAX)),
            ("cross_talk", self.cross_talk, (0.0, CROSS_TALK_MAX)),
            ("stiffness", self.stiffness, STIFFNESS),
            ("stiffening", self.stiffening, (0.0, STIFFENING_MAX)),
        ];
        for (field, range, (least, most)) in ranges {
            let Some((low, high)) = range else { continue };
            within(field, low, least, most)?;
            within(field, high, least, most)?;
            if low > high {
                return Err(SensorError::Order { field, low, high });
            }
        }
        let lists = [
            ("kernels", self.kernels.as_ref().is_some_and(Vec::is_empty)),
            ("edges", self.edges.as_ref().is_some_and(Vec::is_empty)),
        ];
        match lists.into_iter().find(|(_, is_empty)| *is_empty) {
            Some((field, _)) => Err(SensorError::Empty { field }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::{Coupling, SensorParameters};
    use crate::units::MM;

    fn ending(coupling: Coupling) -> SensorDescription {
        let known = SensorDescription::digitacts_6x6().parameters().clone();
        SensorDescription::new(SensorParameters { coupling, ..known }).unwrap()
    }

    #[test]
    fn numbers_that_differ_from_their_default_are_known() {
        let coupling = Coupling {
            margin: Some(1.0 * MM),
            edge: CoveringEdge::LosesForce,
            hysteresis: 0.2,
            ..Coupling::default()
        };
        let ranges = SensorRanges::data_sheet(&ending(coupling), &StatedRanges::default());
        assert_eq!((ranges.margin, ranges.hysteresis), ((1.0 * MM, 1.0 * MM), 0.2));
        assert_eq!(ranges.edges, [CoveringEdge::LosesForce]);
        assert_eq!(ranges.kernels, SpreadKernel::ALL);
        assert_eq!(ranges.cross_talk, (0.0, 0.15));
    }

    #[test]
    fn stated_ranges_take_the_place_of_all_others() {
        let coupling = Coupling { cross_talk: 0.1, ..Coupling::default() };
        let stated = StatedRanges {
            cross_talk: Some((0.05, 0.2)),
            edges: Some(vec![CoveringEdge::Continues]),
            ..StatedRanges::default()
        };
        let ranges = SensorRanges::data_sheet(&ending(coupling), &stated);
        assert_eq!(ranges.cross_talk, (0.05, 0.2));
        assert_eq!(ranges.edges, [CoveringEdge::Continues]);
        assert_eq!(ranges.spread_factor, (0.3, 1.4));
    }

    #[test]
    fn an_unknown_sensor_leaves_more_open_than_a_data_sheet() {
        let known = SensorDescription::digitacts_6x6();
        let none = StatedRanges::default();
        let [sheet, unknown] =
            [SensorRanges::data_sheet(&known, &none), SensorRanges::unknown(&known, &none)];
        for (inner, outer) in [
            (sheet.spread_factor, unknown.spread_factor),
            (sheet.margin, unknown.margin),
            (sheet.cross_talk, unknown.cross_talk),
            (sheet.stiffness, unknown.stiffness),
            (sheet.stiffening, unknown.stiffening),
        ] {
            let contains = outer.0 <= inner.0 && inner.1 < outer.1;
            assert!(contains, "{inner:?} {outer:?}");
        }
        assert!(unknown.gain_spread > sheet.gain_spread);
        let coupling = Coupling { margin: Some(1.0 * MM), ..Coupling::default() };
        let ending = SensorRanges::unknown(&ending(coupling), &none);
        assert_eq!(ending.margin, (1.0 * MM, 1.0 * MM), "a stated extent is known");
    }

    #[test]
    fn the_first_invalid_range_is_named() {
        let check = |stated: StatedRanges, expected: SensorError| {
            assert_eq!(stated.check(), Err(expected));
        };
        let none = StatedRanges::default;
        assert_eq!(none().check(), Ok(()));
        let turned = StatedRanges { stiffness: Some((2.0, 0.5)), ..none() };
        check(turned, SensorError::Order { field: "stiffness", low: 2.0, high: 0.5 });
        let empty = StatedRanges { edges: Some(Vec::new()), ..none() };
        check(empty, SensorError::Empty { field: "edges" });
        let far = StatedRanges { margin: Some((0.0, 1.0)), ..none() };
        let range = SensorError::Range { field: "margin", found: 1.0, low: 0.0, high: 0.1 };
        check(far, range);
    }
}
