//! Checked query of a list of sessions: filters, times and order.

use std::ops::Bound;

use palpate_schemas as wire;
use palpate_schemas::SessionState;
use uuid::Uuid;

use super::ids::Range;
use crate::wire::Invalid;
use crate::wire::labels::Wanted;

/// A checked query of a list.
pub(super) struct Search {
    query: wire::SessionsQuery,
    labels: Wanted,
    since_ms: Option<u64>,
    until_ms: Option<u64>,
}

impl Search {
    pub(super) fn new(query: wire::SessionsQuery) -> Result<Self, Invalid> {
        let time = |name: &str, asked: &Option<String>| {
            asked.as_deref().map(|asked| moment(name, asked)).transpose()
        };
        let labels = Wanted::new(query.labels.as_deref())?;
        let (since_ms, until_ms) = (time("?since", &query.since)?, time("?until", &query.until)?);
        if query.object.is_some() && query.none_of_these == Some(true) {
            let detail = "came with `object`, expected one of the two";
            return Err(Invalid::field("?none_of_these", detail));
        }
        Ok(Self { query, labels, since_ms, until_ms })
    }

    /// The ids of the requested times, in the requested order.
    pub(super) fn range(&self) -> Range {
        let since = self.since_ms.map_or(Bound::Unbounded, |ms| Bound::Included(first_id(ms)));
        let until = self.until_ms.map_or(Bound::Unbounded, |ms| Bound::Excluded(first_id(ms)));
        Range { order: self.query.order.unwrap_or_default(), low: since, high: until }
    }

    /// Whether only open sessions fit.
    pub(super) fn is_of_open(&self) -> bool {
        self.query.state == Some(SessionState::Open)
    }

    /// Whether a session fits.
    pub(super) fn fits(&self, session: &wire::Session) -> bool {
        let query = &self.query;
        query.state.is_none_or(|state| session.state == state)
            && query.catalogue.as_ref().is_none_or(|name| session.catalogue == *name)
            && query.method.is_none_or(|method| session.method == method)
            && query.robot.as_ref().is_none_or(|robot| is_of(session, robot))
            && query.with_truth.is_none_or(|with| session.truth.is_some() == with)
            && self.labels.fits(&session.labels)
            && query.cell.as_ref().is_none_or(|cell| session.cell.as_ref() == Some(cell))
            && (query.object.is_none() && query.none_of_these.is_none()
                || taken_for(session).is_some_and(|taken| self.fits_object(&taken)))
    }

    fn fits_object(&self, taken: &Taken<'_>) -> bool {
        let is_none = matches!(taken, Taken::NoneOfThese);
        let is_object = |asked: &String| match taken {
            Taken::Object { id, name } => *name == asked.as_str() || id.to_string() == *asked,
            Taken::NoneOfThese => false,
        };
        self.query.object.as_ref().is_none_or(is_object)
            && self.query.none_of_these.is_none_or(|wanted| wanted == is_none)
    }
}

/// Whether a robot of this name, or of a name that begins as `asked` does before its `*`, touched.
fn is_of(session: &wire::Session, asked: &str) -> bool {
    let fits = |name: &String| match asked.strip_suffix('*') {
        Some(beginning) => name.starts_with(beginning),
        None => name == asked,
    };
    session.touched_by.iter().any(fits)
}

/// Whether every word of a search is in the id, a robot, the catalogue, the method, a label or the
/// likeliest answer of a session, in any case.
pub(super) fn has_words(session: &wire::Session, search: &str) -> bool {
    let best = session.latest.iter().flat_map(|latest| &latest.best).map(|best| &best.name);
    let labels = session.labels.iter().map(|(key, value)| format!("{key}={value}"));
    let mut text = format!("{} {} {:?}", session.id, session.catalogue, session.method);
    for part in session.touched_by.iter().chain(best).cloned().chain(labels) {
        text.push(' ');
        text.push_str(&part);
    }
    let text = text.to_lowercase();
    search.to_lowercase().split_whitespace().all(|word| text.contains(word))
}

/// Object of a session, as far as it is known.
enum Taken<'a> {
    Object { id: Uuid, name: &'a str },
    NoneOfThese,
}

/// The truth about a session, or without one its likeliest answer; `None` without either.
fn taken_for(session: &wire::Session) -> Option<Taken<'_>> {
    if let Some(truth) = &session.truth {
        return Some(match (truth.object, &truth.name) {
            (Some(id), name) => Taken::Object { id, name: name.as_deref().unwrap_or_default() },
            (None, _) => Taken::NoneOfThese,
        });
    }
    let latest = session.latest.as_ref()?;
    Some(match &latest.best {
        Some(best) if best.probability >= latest.unknown => {
            Taken::Object { id: best.object, name: &best.name }
        }
        _ => Taken::NoneOfThese,
    })
}

/// The least id of a millisecond: ids begin with their time.
fn first_id(ms: u64) -> Uuid {
    Uuid::from_u128(u128::from(ms.min((1 << 48) - 1)) << 80)
}

/// A time of a query, milliseconds since 1970.
fn moment(name: &str, asked: &str) -> Result<u64, Invalid> {
    let ms = crate::wire::moment(asked).and_then(|ms| u64::try_from(ms).ok());
    ms.ok_or_else(|| {
        let detail = format!("came {asked:?}, expected a time such as 2026-03-01T08:00:00Z");
        Invalid::field(name, detail)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_of_a_time_lie_between_those_of_its_bounds() {
        let at = |ms: u64| {
            let stamp = uuid::Timestamp::from_unix(
                uuid::NoContext,
                ms / 1000,
                (ms % 1000) as u32 * 1_000_000,
            );
            Uuid::new_v7(stamp)
        };
        let ms = moment("?since", "2026-03-01T08:00:00Z").unwrap();
        assert_eq!(ms, 1_772_352_000_000);
        assert!(at(ms) >= first_id(ms) && at(ms) < first_id(ms + 1));
        assert!(at(ms - 1) < first_id(ms));
        assert!(moment("?until", "9999-12-31T23:59:59Z").unwrap() > ms);
        assert!(moment("?since", "yesterday").is_err());
        assert!(moment("?since", "1960-01-01T00:00:00Z").is_err());
    }
}
