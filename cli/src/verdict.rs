//! The answer of a belief, including "none of these", and whether it is right.
//!
//! An object of the catalogue and "none of these" are answers of the same kind: the likeliest of
//! them is the answer, and only that one is judged.

use anyhow::bail;
use palpate_client::schemas::{Belief, BestObject, Method, TracePoint};

/// Name of an object that the catalogue does not have, in output.
pub(crate) const NONE_OF_THESE: &str = "none of these";

/// Name of an object that the catalogue does not have, on the command line.
pub(crate) const NONE: &str = "none";

/// The likeliest answer of a belief.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Verdict<'a> {
    /// Name of the object; `None` is "none of these".
    pub(crate) object: Option<&'a str>,
    /// Its probability.
    pub(crate) probability: f64,
}

impl<'a> Verdict<'a> {
    /// The likeliest of the objects and "none of these".
    pub(crate) fn of(belief: &'a Belief) -> Self {
        let best = belief.objects.first().map(|best| (&*best.name, best.probability));
        Self::likelier(best, belief.unknown)
    }

    /// The likelier of a best object and "none of these".
    pub(crate) fn of_best(best: Option<&'a BestObject>, unknown: f64) -> Self {
        Self::likelier(best.map(|best| (&*best.name, best.probability)), unknown)
    }

    /// An object if both are equally likely.
    fn likelier(best: Option<(&'a str, f64)>, unknown: f64) -> Self {
        match best {
            Some((name, probability)) if probability >= unknown => {
                Self { object: Some(name), probability }
            }
            _ => Self { object: None, probability: unknown },
        }
    }

    /// The answer as text.
    pub(crate) fn name(&self) -> &'a str {
        name(self.object)
    }

    /// Whether the answer matches the true object; `None` is an object that the catalogue does not
    /// have.
    pub(crate) fn is_right(&self, truth: Option<&str>) -> bool {
        self.object == truth
    }
}

/// An answer or a truth as text.
pub(crate) fn name(object: Option<&str>) -> &str {
    object.unwrap_or(NONE_OF_THESE)
}

/// The likeliest answer of a session's newest belief, such as `mug 99.2 %`; `–` before the first.
pub(crate) fn in_short(latest: Option<&TracePoint>) -> String {
    let Some(latest) = latest else { return "–".to_owned() };
    let answer = Verdict::of_best(latest.best.as_ref(), latest.unknown);
    format!("{} {:.1} %", answer.name(), 100.0 * answer.probability)
}

/// Fails if the truth is "none of these" and the method cannot answer it.
pub(crate) fn can_answer_none(method: Method) -> anyhow::Result<()> {
    if method == Method::Surface {
        return Ok(());
    }
    bail!("--object {NONE} needs the method surface: no other method answers {NONE_OF_THESE:?}")
}

/// The error for an object that a version does not have.
pub(crate) fn not_trained<'a>(object: &str, names: impl Iterator<Item = &'a str>) -> anyhow::Error {
    let names: Vec<_> = names.collect();
    anyhow::anyhow!(
        "object {object} is not in the trained version, expected one of {}, or {NONE} for an \
         object outside the catalogue",
        names.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use serde_json::json;
    use uuid::Uuid;

    use super::*;

    fn belief(objects: &[(&str, f64)], unknown: f64) -> Belief {
        let id = Uuid::from_u128(1);
        let probability = |(name, probability): &(&str, f64)| json!({"object": id, "name": name, "probability": probability});
        let objects: Vec<_> = objects.iter().map(probability).collect();
        let belief = json!({
            "session": id, "revision": 1, "n_readings": 1, "objects": objects,
            "unknown": unknown, "entropy_bits": 0.5, "poses": [],
        });
        serde_json::from_value(belief).unwrap()
    }

    #[test]
    fn none_of_these_is_an_answer_like_an_object() {
        let sure = belief(&[("mug", 0.001), ("cup", 0.0)], 0.999);
        let verdict = Verdict::of(&sure);
        assert_eq!((verdict.name(), verdict.probability), (NONE_OF_THESE, 0.999));
        assert!(!verdict.is_right(Some("mug")), "a likeliest object that is not the answer");
        assert!(verdict.is_right(None));
        let known = belief(&[("mug", 0.6), ("cup", 0.1)], 0.3);
        let verdict = Verdict::of(&known);
        assert_eq!((verdict.name(), verdict.probability), ("mug", 0.6));
        assert!(verdict.is_right(Some("mug")));
        assert!(!verdict.is_right(Some("cup")) && !verdict.is_right(None));
    }

    #[test]
    fn only_surface_is_right_about_objects_outside_the_catalogue() {
        assert!(can_answer_none(Method::Surface).is_ok());
        let refused = can_answer_none(Method::Appearance).unwrap_err().to_string();
        assert!(refused.contains("surface"), "{refused}");
        let unknown = not_trained("vase", ["mug", "cup"].into_iter()).to_string();
        assert!(unknown.contains("vase") && unknown.contains("mug, cup"), "{unknown}");
        assert!(unknown.contains("none for an object outside"), "{unknown}");
    }
}
