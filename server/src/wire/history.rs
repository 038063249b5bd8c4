//! Conversion of a session's history: steps of a replay, and contributions of readings.

use palpate_core::belief::answer::Answer;
use palpate_recogniser::belief::Misfit;
use palpate_schemas as wire;
use palpate_schemas::Method;
use palpate_store::entity::{ReadingId, Session};
use palpate_store::journal::{Entry, Event};

use crate::model::Model;
use crate::wire::session::options;
use crate::wire::{count, misfit, time};

/// Bits below a touch anywhere at which a reading does not fit the others' belief: a touch
/// beside all mapped surface loses 6.6, its pattern of contact may lose 4.3 more.
const UNFIT_BITS: f64 = 8.0;

/// Without fits, increase of the odds of the others' answer without a reading, in bits, from
/// which the reading disagrees: it is evidence against the answer at sixteen to one.
const AGAINST_BITS: f64 = 4.0;

/// Odds beyond 2¹⁰ : 1 count as that: larger ones carry no information.
const ODDS_BITS_MAX: f64 = 10.0;

/// Smallest probability in contributions, so that they are finite.
const PROBABILITY_MIN: f64 = 1e-12;

/// Minimum number of readings for one to be called wrong.
const READINGS_MIN: usize = 3;

/// Maximum number of objects in a step of a replay.
const STEP_OBJECTS_MAX: usize = 10;

/// The belief without a reading.
pub(crate) struct Without {
    pub(crate) answer: Answer,
    /// log₂ likelihood ratio of the reading under that belief against a touch anywhere.
    pub(crate) fit_bits: Option<f64>,
}

/// A reading that is explained.
pub(crate) struct Explained {
    pub(crate) number: u32,
    pub(crate) id: Option<ReadingId>,
    /// How it lies on the likeliest object.
    pub(crate) misfit: Option<Misfit>,
}

/// A journal entry, and the belief after it.
pub(crate) fn step(entry: &Entry, late: bool, answer: &Answer, model: &Model) -> wire::ReplayStep {
    let change = match &entry.event {
        Event::Reading(_) => wire::SessionChange::Reading {
            number: count(entry.seq),
            robot: entry.reading_id.as_ref().map(|id| id.robot.clone()),
            seq: entry.reading_id.as_ref().map(|id| id.seq),
            late,
        },
        Event::Retraction { seq } => wire::SessionChange::Retraction { number: count(*seq) },
        Event::Closed => wire::SessionChange::Closed,
    };
    let shown = |idx: usize| {
        let object = &model.objects[idx];
        let probability = answer.probabilities[idx];
        wire::BestObject { object: object.id, name: object.name.clone(), probability }
    };
    let mut order: Vec<usize> = (0..answer.probabilities.len()).collect();
    order.sort_by(|a, b| answer.probabilities[*b].total_cmp(&answer.probabilities[*a]));
    wire::ReplayStep {
        revision: count(entry.seq + 1),
        change,
        at: time(entry.received_at_ms),
        n_readings: count(answer.n_readings),
        best: answer.best_object().map(|best| shown(best.0 as usize)),
        objects: order.into_iter().take(STEP_OBJECTS_MAX).map(shown).collect(),
        unknown: answer.unknown,
        entropy_bits: answer.entropy_bits,
    }
}

/// The contribution of each reading: `without` are the known beliefs without each.
pub(crate) fn explanation(
    session: &Session,
    revision: u64,
    readings: Vec<Explained>,
    whole: &Answer,
    without: &[Without],
    model: &Model,
) -> wire::Explanation {
    let method = options(session).method;
    let is_comparable = readings.len() >= READINGS_MIN;
    let p = identities(whole);
    let best = most(&p);
    let object = model.objects.get(best);
    let complete = without.len() == readings.len();
    let misfits: Vec<(u32, wire::ReadingMisfit)> = readings
        .iter()
        .filter_map(|reading| Some((reading.number, misfit::misfit(reading.misfit.as_ref()?))))
        .collect();
    let nearest = whole.best_object().filter(|_| !misfits.is_empty()).map(|nearest| {
        let nearest = nearest.0 as usize;
        let (known, probability) = (&model.objects[nearest], whole.probabilities[nearest]);
        wire::NearestObject { object: known.id, name: known.name.clone(), probability }
    });
    let against = match &nearest {
        Some(nearest) if object.is_none() => misfit::against(&nearest.name, &misfits),
        _ => Vec::new(),
    };
    let contribution = |(place, reading): (usize, Explained)| {
        let Explained { number, id, misfit } = reading;
        let (robot, seq) = id.map(|id| (id.robot, id.seq)).unzip();
        let q = without.get(place).map(|without| identities(&without.answer));
        let fit_bits = without.get(place).and_then(|without| without.fit_bits);
        let support_bits = q.as_ref().map(|q| log2_odds(&p, most(q)) - log2_odds(q, most(q)));
        wire::ReadingContribution {
            number,
            robot,
            seq,
            bits: q.as_ref().map(|q| p[best].log2() - q[best].log2()),
            information_bits: q.as_ref().map(|q| divergence_bits(&p, q)),
            support_bits,
            fit_bits,
            misfit: misfit.as_ref().map(misfit::misfit),
            disagrees: is_comparable && disagrees(method, fit_bits, support_bits),
        }
    };
    wire::Explanation {
        session: session.id,
        revision: count(revision),
        answer: wire::ExplainedAnswer {
            object: object.map(|object| object.id),
            name: object.map(|object| object.name.clone()),
            probability: p[best],
        },
        nearest,
        against,
        readings: readings.into_iter().enumerate().map(contribution).collect(),
        complete,
    }
}

/// Whether a reading disagrees with the others: by its fit, for a method that has one.
fn disagrees(method: Method, fit_bits: Option<f64>, support_bits: Option<f64>) -> bool {
    match method {
        Method::Surface => fit_bits.is_some_and(|bits| bits <= -UNFIT_BITS),
        Method::Sva
        | Method::SvaLiteral
        | Method::Geometric
        | Method::GeometricHistogram
        | Method::GeometricParticles
        | Method::Appearance
        | Method::AppearanceLiteral => support_bits.is_some_and(|bits| bits <= -AGAINST_BITS),
    }
}

/// Probabilities of all objects and, last, of "none of these".
fn identities(answer: &Answer) -> Vec<f64> {
    let all = answer.probabilities.iter().chain([&answer.unknown]);
    all.map(|p| p.max(PROBABILITY_MIN)).collect()
}

/// The index of the most probable one; the first of equal ones.
fn most(p: &[f64]) -> usize {
    (0..p.len()).fold(0, |best, place| if p[place] > p[best] { place } else { best })
}

/// log₂ of the odds of one against all others together, clamped.
fn log2_odds(p: &[f64], place: usize) -> f64 {
    let others: f64 = p.iter().enumerate().filter(|(other, _)| *other != place).map(|o| o.1).sum();
    (p[place] / others).log2().clamp(-ODDS_BITS_MAX, ODDS_BITS_MAX)
}

/// The Kullback–Leibler divergence of `q` from `p`, bits.
fn divergence_bits(p: &[f64], q: &[f64]) -> f64 {
    p.iter().zip(q).map(|(p, q)| p * (p / q).log2()).sum::<f64>().max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-12, "{found} instead of {expected}");
    }

    #[test]
    fn bits_match_hand_computed_values() {
        let (p, q) = ([0.5, 0.25, 0.25], [0.25, 0.5, 0.25]);
        // 0.5 · log2 2 + 0.25 · log2 ½ + 0.25 · log2 1.
        check(divergence_bits(&p, &q), 0.25);
        check(divergence_bits(&p, &p), 0.0);
        // Odds of 1 : 1, and of 1 : 3.
        check(log2_odds(&p, 0), 0.0);
        check(log2_odds(&p, 1), -(3.0_f64.log2()));
        assert_eq!((most(&p), most(&q), most(&[0.3, 0.4, 0.4])), (0, 1, 1));
    }

    #[test]
    fn odds_are_clamped() {
        check(log2_odds(&[1.0 - 1e-9, 1e-9], 0), 10.0);
        check(log2_odds(&[1.0 - 1e-9, 1e-9], 1), -10.0);
    }
}
