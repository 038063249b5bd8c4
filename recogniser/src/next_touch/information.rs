//! Information: expected bits from the outcome of a press, by a pairwise bound over the samples.
//!
//! The likeness of the outcomes of two samples is the Bhattacharyya coefficient of their
//! distributions: a miss, or a contact with Gaussian place, normal and appearance (equation
//! R26). If sample i is true, the probability of each other sample is scaled by its likeness to
//! i. The information is the expected ln ratio of belief after to belief before, from the bound
//! on the entropy of a mixture by Kolchinsky and Tracey (2017).

use std::ops::Range;
use std::sync::Arc;

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

/// How alike the outcomes of one press are under each two samples, and under "none of these".
pub(super) struct Likeness {
    /// Row by row; the last row and column are those of "none of these".
    alike: Vec<f32>,
    /// Probability of a contact under each sample.
    contacts: Vec<f32>,
}

impl Likeness {
    /// Of these outcomes. Their probabilities and `unknown` (of "none of these") sum to 1.
    pub(super) fn of(outcomes: &[Outcome], unknown: f32, scatter: &Scatter) -> Self {
        let contacts: Vec<f32> = outcomes.iter().map(Outcome::contact).collect();
        let contact: f32 = outcomes.iter().map(|o| o.probability * o.contact()).sum();
        let contact = if unknown < 1.0 { contact / (1.0 - unknown) } else { 0.0 };
        let width = outcomes.len() + 1;
        let mut all = vec![1.0; width * width];
        for (i, a) in outcomes.iter().enumerate() {
            let mut set = |j: usize, alike: f32| {
                all[i * width + j] = alike;
                all[j * width + i] = alike;
            };
            for (j, b) in outcomes.iter().enumerate().skip(i + 1) {
                set(j, alike(a, b, scatter));
            }
            let missed = ((1.0 - contact) * (1.0 - a.contact())).sqrt();
            set(width - 1, missed + UNKNOWN_ALIKE * (contact * a.contact()).sqrt());
        }
        Self { alike: all, contacts }
    }

    fn row(&self, sample: usize) -> &[f32] {
        let width = self.contacts.len() + 1;
        &self.alike[sample * width..(sample + 1) * width]
    }

    /// The expected information of the press under a belief.
    pub(super) fn information(&self, belief: &Shares) -> Bits {
        let mut bits = Bits::default();
        for object in &*belief.objects {
            let within = &belief.shares[object.clone()];
            let prior: f32 = within.iter().sum();
            for (sample, share) in object.clone().zip(within) {
                if *share == 0.0 {
                    continue;
                }
                let row = self.row(sample);
                let own = dot(&row[object.clone()], within);
                let total = dot(row, &belief.shares);
                bits.identity += f64::from(*share) * f64::from(own / total / prior).log2();
                bits.pose += f64::from(*share) * f64::from(prior / own).log2();
            }
        }
        Bits { identity: bits.identity.max(0.0), pose: bits.pose.max(0.0) }
    }

    /// The probability of a contact if the object is a known one.
    pub(super) fn contact_probability(&self, belief: &Shares) -> f64 {
        let shares = &belief.shares[..self.contacts.len()];
        let known: f32 = shares.iter().sum();
        if known > 0.0 { f64::from(dot(&self.contacts, shares) / known) } else { 0.0 }
    }

    /// The belief after the press if this sample is the truth: each share is scaled by the likeness
    /// to it. Shares below `least` become 0.
    pub(super) fn after(&self, before: &Shares, truth: usize, least: f32) -> Shares {
        let mut shares: Vec<f32> =
            before.shares.iter().zip(self.row(truth)).map(|(share, alike)| share * alike).collect();
        let total: f32 = shares.iter().sum();
        for share in &mut shares {
            *share = if *share < least * total { 0.0 } else { *share / total };
        }
        Shares { shares, objects: Arc::clone(&before.objects) }
    }
}

/// A belief over samples and "none of these", which comes last.
pub(super) struct Shares {
    shares: Vec<f32>,
    /// The samples of each object, and "none of these".
    objects: Arc<[Range<usize>]>,
}

impl Shares {
    /// The belief over samples, each with its object and share, and "none of these". Samples of one
    /// object stand together.
    pub(super) fn new(samples: impl IntoIterator<Item = (ObjectIdx, f32)>, unknown: f32) -> Self {
        let (of, mut shares): (Vec<ObjectIdx>, Vec<f32>) = samples.into_iter().unzip();
        shares.push(unknown);
        let (mut objects, mut begin) = (Vec::new(), 0);
        for object in of.chunk_by(|a, b| a == b) {
            objects.push(begin..begin + object.len());
            begin += object.len();
        }
        objects.push(begin..begin + 1);
        Self { shares, objects: objects.into() }
    }

    /// The share of each sample, and of "none of these".
    pub(super) fn shares(&self) -> &[f32] {
        &self.shares
    }
}

/// Σ a b, in eight sums side by side, so that the processor adds them at once.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let (wide_a, wide_b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f32 = wide_a.remainder().iter().zip(wide_b.remainder()).map(|(a, b)| a * b).sum();
    let mut sums = [0.0; 8];
    for (a, b) in wide_a.zip(wide_b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f32>() + rest
}

/// The expected information of a press with these outcomes, before any press.
#[cfg(test)]
pub(super) fn information(outcomes: &[Outcome], unknown: f32, scatter: &Scatter) -> Bits {
    let shares = Shares::new(outcomes.iter().map(|o| (o.object, o.probability)), unknown);
    Likeness::of(outcomes, unknown, scatter).information(&shares)
}

/// The information on the identity, bits, if one of several objects is the true one and all were
/// equally probable: `alike` has the likeness of the outcome under each other object to its own.
/// Equation R27a of docs/recogniser.md, and the term of one sample in [`Likeness::information`].
pub(super) fn bits_if_true(alike: &[f32]) -> f64 {
    let total: f64 = alike.iter().map(|alike| f64::from(*alike)).sum();
    ((1.0 + alike.len() as f64) / (1.0 + total)).log2()
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
