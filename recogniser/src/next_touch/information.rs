//! Information: expected bits from the outcome of a press, by a pairwise bound over the samples.
//!
//! The likeness of the outcomes of two samples is the Bhattacharyya coefficient of their
//! distributions: a miss, or a contact with Gaussian place, normal and appearance (equation
//! R26). If sample i is true, the probability of each other sample is scaled by its likeness to
//! i. The information is the expected ln ratio of belief after to belief before, from the bound
//! on the entropy of a mixture by Kolchinsky and Tracey (2017).

use super::footprint::ExpectedContact;
use crate::model::agreement::STEPS;
use palpate_core::object::ObjectIdx;

/// Scatter of the outcomes of one sample: deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scatter {
    /// Deviation of the contact's position, metres.
    pub(super) position: f32,
    /// Deviation of its normal, rad.
    pub(super) normal: f32,
    /// Variance of its appearance, relative to that between two touches of one place.
    pub(super) appearance: f32,
}

/// The outcome of a press under one sample; positions relative to the press.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Outcome {
    pub(super) object: ObjectIdx,
    pub(super) probability: f32,
    /// The contact, rotated into the session frame; `None` for a miss.
    pub(super) met: Option<ExpectedContact>,
}

/// Likeness of an unknown object's contact to any other.
const UNKNOWN_ALIKE: f32 = 0.05;

/// Least likeness of two outcomes, since no reading is certain.
const ALIKE_MIN: f32 = 0.01;

/// Squared deviations between places at which exp(−x/8) is below [`ALIKE_MIN`].
const FAR: f32 = 37.0;

/// Squared distance of appearances at which heavy tails halve its effect.
const TAIL: f32 = 24.0;

/// Bits of information.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Bits {
    /// Information on the identity, "none of these" included.
    pub(super) identity: f64,
    /// Information on the pose, given the identity.
    pub(super) pose: f64,
}

/// The expected information of a press with these outcomes. Probabilities of the outcomes and
/// `unknown` (of "none of these") sum to 1; equal objects stand together.
pub(super) fn information(outcomes: &[Outcome], unknown: f32, scatter: &Scatter) -> Bits {
    let n = outcomes.len();
    let contact: f32 = outcomes.iter().map(|o| o.probability * o.contact()).sum();
    let contact = if unknown < 1.0 { contact / (1.0 - unknown) } else { 0.0 };
    let mut totals = vec![0.0f32; n];
    let mut own = vec![0.0f32; n];
    for (i, a) in outcomes.iter().enumerate() {
        own[i] += a.probability;
        totals[i] += a.probability;
        for (j, b) in outcomes.iter().enumerate().skip(i + 1) {
            let alike = alike(a, b, scatter);
            totals[i] += b.probability * alike;
            totals[j] += a.probability * alike;
            if a.object == b.object {
                own[i] += b.probability * alike;
                own[j] += a.probability * alike;
            }
        }
    }
    let mut bits = Bits::default();
    let mut prior = 0.0;
    let mut of_unknown = unknown;
    for (i, a) in outcomes.iter().enumerate() {
        if i == 0 || outcomes[i - 1].object != a.object {
            prior = share_of(&outcomes[i..], a.object);
        }
        let both = ((1.0 - contact) * (1.0 - a.contact())).sqrt()
            + UNKNOWN_ALIKE * (contact * a.contact()).sqrt();
        let total = totals[i] + unknown * both;
        of_unknown += a.probability * both;
        let probability = f64::from(a.probability);
        bits.identity += probability * f64::from(own[i] / total / prior).log2();
        bits.pose += probability * f64::from(prior / own[i]).log2();
    }
    if unknown > 0.0 {
        bits.identity -= f64::from(unknown) * f64::from(of_unknown).log2();
    }
    Bits { identity: bits.identity.max(0.0), pose: bits.pose.max(0.0) }
}

/// The information on the identity, bits, if one of several objects is the true one and all were
/// equally probable: `alike` has the likeness of the outcome under each other object to its own.
/// Equation R27a of docs/recogniser.md, and the term of one sample in [`information`].
pub(super) fn bits_if_true(alike: &[f32]) -> f64 {
    let total: f64 = alike.iter().map(|alike| f64::from(*alike)).sum();
    ((1.0 + alike.len() as f64) / (1.0 + total)).log2()
}

/// The probability of the object whose outcomes come first.
fn share_of(outcomes: &[Outcome], object: ObjectIdx) -> f32 {
    outcomes.iter().take_while(|o| o.object == object).map(|o| o.probability).sum()
}

/// The Bhattacharyya coefficient of two outcomes, 1 for equal ones. Equation R26 of
/// docs/recogniser.md.
#[inline]
pub(super) fn alike(a: &Outcome, b: &Outcome, scatter: &Scatter) -> f32 {
    let miss = ((1.0 - a.contact()) * (1.0 - b.contact())).sqrt();
    let (Some(met), Some(other)) = (&a.met, &b.met) else { return miss.max(ALIKE_MIN) };
    let place = met.position.distance_squared(other.position) / scatter.position.powi(2);
    // Beyond this distance the likeness is at its minimum.
    if place > FAR {
        return miss.max(ALIKE_MIN);
    }
    let scattered = 0.5 * (met.normal_deviation.powi(2) + other.normal_deviation.powi(2));
    let normal = met.normal.distance_squared(other.normal) / (scatter.normal.powi(2) + scattered);
    let mut apart = 0.0;
    for (value, other) in met.feature.iter().zip(&other.feature) {
        let difference = (f32::from(*value) - f32::from(*other)) / STEPS;
        apart += difference * difference;
    }
    // Heavy tails: a touch may have any appearance at any place.
    let apart = apart / (1.0 + apart / TAIL) / scatter.appearance;
    let contact = (-0.125 * (place + normal + apart)).exp();
    (miss + (met.contact * other.contact).sqrt() * contact).max(ALIKE_MIN)
}

impl Outcome {
    fn contact(&self) -> f32 {
        self.met.map_or(0.0, |met| met.contact)
    }
}
