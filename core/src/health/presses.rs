//! Sums over presses, for each taxel: its rest without contact, and its answers beside its
//! neighbours' answers.
//!
//! A press met nothing if all taxels read the same within the contact floor, except few that
//! stand out sharply: a covering blurs what presses on it, so a taxel above those on both sides
//! by more than the covering permits has an offset. A drifting taxel, or a drifting row, thus
//! does not hide itself; two by two drifting taxels look like a contact.

use crate::reading::Reading;
use crate::sensor::{SensorDescription, TaxelGrid};

/// Offset of the whole array, in contact floors, up to which a press may have met nothing.
/// Chosen: 2 % of the range of most sensors, which no flat contact is as uniform as.
const COMMON_FLOORS_MAX: f64 = 4.0;
/// Share of the taxels that may stand out in a press that met nothing. Chosen: beyond a quarter
/// the others do not tell what rest is.
const OUTLIERS_MAX: f64 = 0.25;
/// Share of the blur's response at the next taxel, above which a neighbour responds to a press.
/// Chosen: half, since gains of taxels differ.
const BLUR_SHARE: f64 = 0.5;
/// Response of the blur at the next taxel below which offset and contact look alike. Chosen: a
/// tenth of the smallest contact is a fifth of the noise's five deviations.
const BLUR_MIN: f64 = 0.1;
/// Pressure on both sides, in contact floors, beside which a taxel has to answer. Chosen:
/// with less, noise and gains decide.
const ASKED_FLOORS: f64 = 4.0;
/// Share of the neighbours' mean from which a taxel answers. Chosen: beyond the gains of usable
/// taxels, and the corner of a contact.
const ANSWER_SHARE: f64 = 0.25;
/// Fading of earlier presses in a taxel's latest value. Chosen: it follows a drift within twenty
/// presses, and is certain to a quarter of the noise.
pub const FADING: f64 = 0.1;

/// Sums of one taxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaxelSums {
    /// Number of presses that met nothing and have a value of the taxel.
    pub n_quiet: u32,
    /// Mean of its values in them, Pa.
    pub mean: f64,
    /// Its value of late: their mean with weights that fall by [`FADING`] a press, Pa.
    pub latest: f64,
    /// Number of pairs of successive presses that met nothing, within a session.
    pub n_steps: u32,
    /// Sum of their squared differences, Pa².
    pub steps: f64,
    /// Number of presses that the taxels on both sides of it felt.
    pub n_asked: u32,
    /// Number of those that it felt too.
    pub n_answered: u32,
    /// Sum of its values in the presses that its neighbours felt, Pa.
    pub own: f64,
    /// Sum of its neighbours' means in them, Pa.
    pub around: f64,
    /// Lowest value of all presses, Pa; infinity without any.
    pub low: f64,
    /// Highest value of all presses, Pa; negative infinity without any.
    pub high: f64,
}

impl Default for TaxelSums {
    fn default() -> Self {
        Self {
            n_quiet: 0,
            mean: 0.0,
            latest: 0.0,
            n_steps: 0,
            steps: 0.0,
            n_asked: 0,
            n_answered: 0,
            own: 0.0,
            around: 0.0,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
        }
    }
}

impl TaxelSums {
    /// Standard deviation of its values at rest, Pa, from successive ones, so that drift adds
    /// nothing; `None` without a pair.
    #[must_use]
    pub fn noise(&self) -> Option<f64> {
        (self.n_steps > 0).then(|| (self.steps / (2.0 * f64::from(self.n_steps))).sqrt())
    }

    /// Ratio of its values to its neighbours'; `None` when they felt nothing.
    #[must_use]
    pub fn gain(&self) -> Option<f64> {
        (self.around > 0.0).then(|| self.own / self.around)
    }

    fn rest(&mut self, value: f64, last: Option<f64>) {
        let (n_steps, step) = last.map_or((0, 0.0), |last| (1, value - last));
        let (mean, latest, steps) = (value, value, step * step);
        self.merge(&Self { n_quiet: 1, mean, latest, n_steps, steps, ..Self::default() });
    }

    /// Adds the sums of later presses.
    pub fn merge(&mut self, other: &Self) {
        let (n, m) = (f64::from(self.n_quiet), f64::from(other.n_quiet));
        if m > 0.0 {
            self.mean += (other.mean - self.mean) * m / (n + m);
            // The weights of n presses sum to 1 − (1 − FADING)ⁿ, times a constant.
            let faded = (1.0 - FADING).powf(m);
            let (before, now) = (faded * (1.0 - (1.0 - FADING).powf(n)), 1.0 - faded);
            self.latest += (other.latest - self.latest) * now / (before + now);
        }
        self.n_quiet = self.n_quiet.saturating_add(other.n_quiet);
        self.n_steps = self.n_steps.saturating_add(other.n_steps);
        self.steps += other.steps;
        self.n_asked = self.n_asked.saturating_add(other.n_asked);
        self.n_answered = self.n_answered.saturating_add(other.n_answered);
        self.own += other.own;
        self.around += other.around;
        self.low = self.low.min(other.low);
        self.high = self.high.max(other.high);
    }
}

/// Sums of a sensor's presses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PressSums {
    /// Number of presses.
    pub n_presses: u32,
    /// Number of those that met nothing.
    pub n_quiet: u32,
    /// The taxels; none before the first press.
    pub taxels: Vec<TaxelSums>,
}

impl PressSums {
    /// Adds the sums of later presses of the same sensor.
    pub fn merge(&mut self, other: &Self) {
        self.n_presses = self.n_presses.saturating_add(other.n_presses);
        self.n_quiet = self.n_quiet.saturating_add(other.n_quiet);
        let n_taxels = self.taxels.len().max(other.taxels.len());
        self.taxels.resize(n_taxels, TaxelSums::default());
        self.taxels.iter_mut().zip(&other.taxels).for_each(|(sums, other)| sums.merge(other));
    }
}

/// The presses of one session, in their order.
#[derive(Clone, Debug, Default)]
pub struct PressRun {
    sums: PressSums,
    /// Each taxel's last value at rest.
    last: Vec<Option<f64>>,
}

impl PressRun {
    /// Adds a press of `sensor`. Its missing taxels say nothing.
    pub fn add(&mut self, reading: &Reading, sensor: &SensorDescription) {
        let (values, n_taxels) = (Values::of(reading, sensor), sensor.n_taxels());
        self.sums.taxels.resize(n_taxels, TaxelSums::default());
        self.last.resize(n_taxels, None);
        let met_nothing = values.met_nothing();
        self.sums.n_presses = self.sums.n_presses.saturating_add(1);
        self.sums.n_quiet = self.sums.n_quiet.saturating_add(u32::from(met_nothing));
        let taxels = self.sums.taxels.iter_mut().zip(&mut self.last);
        for (taxel, (sums, last)) in taxels.enumerate() {
            let Some(value) = values.at(taxel) else { continue };
            (sums.low, sums.high) = (sums.low.min(value), sums.high.max(value));
            if met_nothing {
                sums.rest(value, last.replace(value));
            } else if let Some(around) = values.around(taxel) {
                sums.n_asked = sums.n_asked.saturating_add(1);
                let answers = value >= ANSWER_SHARE * around;
                sums.n_answered = sums.n_answered.saturating_add(u32::from(answers));
                (sums.own, sums.around) = (sums.own + value, sums.around + around);
            }
        }
    }

    /// Their sums.
    #[must_use]
    pub fn sums(&self) -> &PressSums {
        &self.sums
    }
}

/// The values of a press.
struct Values<'a> {
    values: Vec<Option<f64>>,
    sensor: &'a SensorDescription,
    floor: f64,
    /// Response of the covering at the next taxel, as a share of the pressed one's.
    blur: f64,
}

impl<'a> Values<'a> {
    fn of(reading: &Reading, sensor: &'a SensorDescription) -> Self {
        let (pitch, spread) = (sensor.grid().pitch, sensor.parameters().point_spread);
        let blur = (-0.5 * (pitch / spread).powi(2)).exp();
        Self { values: reading.values(), sensor, floor: sensor.contact_floor(), blur }
    }

    /// The value of a taxel, unless it is missing.
    fn at(&self, taxel: usize) -> Option<f64> {
        self.values[taxel]
    }

    /// Values beside a taxel, first the two in its row, then the two in its column; `None` beyond
    /// the array and for missing ones. On a skin without rows the pair that is most opposite.
    fn beside(&self, taxel: usize) -> [Option<f64>; 4] {
        if let Some(skin) = self.sensor.listed() {
            let [one, other] =
                skin.opposite_neighbours(taxel).map_or([None; 2], |pair| pair.map(Some));
            return [one, other, None, None].map(|taxel| self.at(taxel?));
        }
        let TaxelGrid { rows, cols, .. } = *self.sensor.grid();
        let (row, col) = (taxel / cols, taxel % cols);
        [
            (col > 0).then(|| taxel - 1),
            (col + 1 < cols).then(|| taxel + 1),
            (row > 0).then(|| taxel - cols),
            (row + 1 < rows).then(|| taxel + cols),
        ]
        .map(|taxel| self.at(taxel?))
    }

    fn met_nothing(&self) -> bool {
        let n_taxels = self.values.len();
        let mut valid: Vec<f64> = (0..n_taxels).filter_map(|taxel| self.at(taxel)).collect();
        let middle = valid.len() / 2;
        if valid.is_empty() {
            return false;
        }
        let common = *valid.select_nth_unstable_by(middle, f64::total_cmp).1;
        if common.abs() > COMMON_FLOORS_MAX * self.floor {
            return false;
        }
        let above = |taxel: usize| Some(self.at(taxel)? - common);
        let stands_out = |taxel: &usize| above(*taxel).is_some_and(|it| it.abs() > self.floor);
        let outliers: Vec<usize> = (0..n_taxels).filter(stands_out).collect();
        let n_max = (OUTLIERS_MAX * n_taxels as f64).floor().max(1.0);
        outliers.len() as f64 <= n_max
            && outliers.iter().all(|taxel| {
                above(*taxel).is_some_and(|above| self.is_sharp(*taxel, above, common))
            })
    }

    /// Whether the covering cannot have blurred a contact into this: a taxel `above` the rest,
    /// with rest on both sides in its row or its column.
    fn is_sharp(&self, taxel: usize, above: f64, common: f64) -> bool {
        let highest = common + BLUR_SHARE * self.blur * above;
        let rests = |pair: &[Option<f64>]| {
            pair.iter().any(Option::is_some) && pair.iter().flatten().all(|value| *value < highest)
        };
        let beside = self.beside(taxel);
        let (row, column) = beside.split_at(2);
        above < 0.0 || self.blur >= BLUR_MIN && (rests(row) || rests(column))
    }

    /// The mean of the neighbours on both sides of a taxel in its row or its column, of a corner
    /// the mean of its two, if they felt the press: contacts are convex, or blurred until they are.
    fn around(&self, taxel: usize) -> Option<f64> {
        let least = ASKED_FLOORS * self.floor;
        let [left, right, up, down] = self.beside(taxel).map(|value| value.filter(|v| *v >= least));
        let pair = |a: Option<f64>, b: Option<f64>| Some((a? + b?) / 2.0);
        match (pair(left, right), pair(up, down)) {
            (Some(along), Some(across)) => Some((along + across) / 2.0),
            (None, None) if self.is_corner(taxel) => pair(left.or(right), up.or(down)),
            (found, None) | (None, found) => found,
        }
    }

    fn is_corner(&self, taxel: usize) -> bool {
        if self.sensor.listed().is_some() {
            return false;
        }
        let TaxelGrid { rows, cols, .. } = *self.sensor.grid();
        let (row, col) = (taxel / cols, taxel % cols);
        (row == 0 || row + 1 == rows) && (col == 0 || col + 1 == cols)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::Pose;
    use crate::reading::SensorId;

    fn sensor() -> SensorDescription {
        SensorDescription::digitacts_6x6()
    }

    /// The sums of presses that are drawn: a digit is that many contact floors.
    fn sums(images: &[&str]) -> PressSums {
        let mut run = PressRun::default();
        for image in images {
            let value = |c: char| match c {
                'x' => None,
                '-' => Some(-2.0 * sensor().contact_floor()),
                '.' => Some(0.0),
                digit => Some(f64::from(digit.to_digit(10).unwrap()) * sensor().contact_floor()),
            };
            let pressures: Vec<_> =
                image.split_whitespace().flat_map(str::chars).map(value).collect();
            let reading = Reading::new(SensorId(1), &sensor(), &pressures, Pose::IDENTITY).unwrap();
            run.add(&reading, &sensor());
        }
        run.sums().clone()
    }

    #[track_caller]
    fn check_quiet(image: &str, expected: bool) {
        assert_eq!(sums(&[image]).n_quiet, u32::from(expected), "{image}");
    }

    #[test]
    fn a_taxel_with_an_offset_does_not_make_a_contact() {
        check_quiet("...... ...... ...... ...... ...... ......", true);
        check_quiet("...... ...... ..9... ...... ...... ......", true);
        check_quiet("9..... ...... ...... ...... ...... .....9", true);
        check_quiet("...... ...... ..-... ...... ...... ......", true);
        // A row whose connector drifts.
        check_quiet("...... 555555 ...... ...... ...... ......", true);
        // The whole array by the same, up to four floors.
        check_quiet("333333 333333 333933 333333 333333 333333", true);
    }

    #[test]
    fn what_the_covering_blurs_is_a_contact() {
        check_quiet("...... ..2... .292.. ..2... ...... ......", true);
        check_quiet("...... ...... ..55.. ..55.. ...... ......", false);
        // A contact blurs to exp(−½ (2 mm / point spread)²) of itself one pitch away; a neighbour
        // with half of that makes the taxel a contact.
        check_quiet("...... ..7... .797.. ..7... ...... ......", false);
        check_quiet("96.... 6..... ...... ...... ...... ......", false);
        check_quiet("5..... 5..... 5..... 5..... 5..... 5.....", true);
        check_quiet("65.... 65.... 65.... 65.... 65.... 65....", false);
        check_quiet("999999 999999 999999 999999 999999 999999", false);
        // A dead taxel in the middle of a contact.
        check_quiet("...... .777.. .7.7.. .777.. ...... ......", false);
    }

    #[test]
    fn taxels_answer_where_their_neighbours_do() {
        let press = "...... .999.. .9.9.. .999.. ...... ......";
        let found = sums(&[press, press, "...... ...... ...... ...... ...... ......"]);
        let dead = found.taxels[2 * 6 + 2];
        assert_eq!((dead.n_asked, dead.n_answered, dead.n_quiet), (2, 0, 1));
        assert_eq!(dead.gain(), Some(0.0));
        // Those on both sides in its row answer for its neighbour, though not those in its column.
        assert_eq!((found.taxels[6 + 2].n_asked, found.taxels[6 + 2].n_answered), (2, 2));
        assert_eq!(found.taxels[6 + 1].n_asked, 0, "the corner of the contact");
        let whole = "...... .999.. .939.. .999.. ...... ......";
        let taxel = sums(&[whole]).taxels[2 * 6 + 2];
        assert_eq!((taxel.n_asked, taxel.n_answered), (1, 1));
        assert!((taxel.gain().unwrap() - 3.0 / 9.0).abs() < 1e-12);
    }

    #[test]
    fn merged_sums_are_those_of_all_presses() {
        let images = [
            "...... ...... ..9... ...... ...... ......",
            "...... ...... ..7... ...... ...... ..x...",
            "...... .777.. .777.. .777.. ...... ......",
            "...... ...... ..5... ...... ...... ......",
        ];
        let (mut merged, whole) = (sums(&images[..1]), sums(&images));
        merged.merge(&sums(&images[1..]));
        assert_eq!((merged.n_presses, merged.n_quiet), (4, 3));
        for (merged, whole) in merged.taxels.iter().zip(&whole.taxels) {
            assert_eq!((merged.n_quiet, merged.n_asked), (whole.n_quiet, whole.n_asked));
            assert!((merged.mean - whole.mean).abs() < 1e-9 * whole.mean.abs().max(1.0));
            assert!((merged.latest - whole.latest).abs() < 1e-9 * whole.mean.abs().max(1.0));
        }
        // 9, 7 and 5 floors: the mean is 7, the noise √((2² + 2²) / 2 / 2).
        let (taxel, floor) = (whole.taxels[2 * 6 + 2], sensor().contact_floor());
        assert!((taxel.mean / floor - 7.0).abs() < 1e-9);
        assert!((taxel.noise().unwrap() / floor - 2.0_f64.sqrt()).abs() < 1e-9);
        assert_eq!(merged.taxels[2 * 6 + 2].n_steps, 1, "none between sessions");
        // Weights 0.81, 0.9 and 1: (7.29 + 6.3 + 5) / 2.71.
        assert!((taxel.latest / floor - 18.59 / 2.71).abs() < 1e-9);
        assert_eq!(whole.taxels[5 * 6 + 2].n_quiet, 2, "a missing taxel says nothing");
    }
}
