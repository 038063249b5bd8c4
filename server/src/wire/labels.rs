//! Checks of labels, and searches by them.

use palpate_schemas::{LabelledQuery, Labels, PageQuery};

use crate::wire::{Invalid, text};

/// Maximum number of labels of a thing, and length of a key and of a value, characters. Chosen:
/// enough for site, cell, shift, order and the like, and little beside a reading.
const LABELS_MAX: usize = 16;
const KEY_MAX: usize = 64;
const VALUE_MAX: usize = 128;

/// Checks new labels.
pub(crate) fn checked(labels: &Labels) -> Result<(), Invalid> {
    if labels.len() > LABELS_MAX {
        let detail = format!("{} labels came, expected at most {LABELS_MAX}", labels.len());
        return Err(Invalid::field("/labels", detail));
    }
    for (key, value) in labels {
        if !is_key(key) {
            let detail = format!(
                "the key {key:?} came, expected 1 to {KEY_MAX} letters, digits, `.`, `_`, `/` or `-`"
            );
            return Err(Invalid::field("/labels", detail));
        }
        let pointer = format!("/labels/{}", key.replace('/', "~1"));
        text(&pointer, value, VALUE_MAX)?;
        if value.contains(',') {
            let detail = format!("came {value:?}, expected a value without a comma");
            return Err(Invalid::field(pointer, detail));
        }
    }
    Ok(())
}

fn is_key(key: &str) -> bool {
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '/' | '-');
    (1..=KEY_MAX).contains(&key.len()) && key.chars().all(fits)
}

/// Labels that are searched for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Wanted(Vec<(String, Option<String>)>);

impl Wanted {
    /// The labels of `?labels=`.
    pub(crate) fn new(asked: Option<&str>) -> Result<Self, Invalid> {
        let Some(asked) = asked else { return Ok(Self::default()) };
        let one = |part: &str| {
            let (key, value) = match part.split_once(':') {
                Some((key, value)) => (key, Some(value.to_owned())),
                None => (part, None),
            };
            if is_key(key) {
                return Ok((key.to_owned(), value));
            }
            let detail =
                format!("came {part:?}, expected `key` or `key:value`, separated by commas");
            Err(Invalid::field("?labels", detail))
        };
        Ok(Self(asked.split(',').map(one).collect::<Result<_, _>>()?))
    }

    /// Whether labels contain all that are wanted.
    pub(crate) fn fits(&self, labels: &Labels) -> bool {
        self.0.iter().all(|(key, wanted)| {
            labels.get(key).is_some_and(|value| wanted.as_ref().is_none_or(|it| it == value))
        })
    }
}

/// The page and the labels of a query.
pub(crate) fn page_and_wanted(query: LabelledQuery) -> Result<(PageQuery, Wanted), Invalid> {
    let LabelledQuery { limit, cursor, labels } = query;
    Ok((PageQuery { limit, cursor }, Wanted::new(labels.as_deref())?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(pairs: &[(&str, &str)]) -> Labels {
        pairs.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect()
    }

    #[test]
    fn labels_that_cannot_be_searched_for_are_refused() {
        let pointer = |pairs| checked(&labels(pairs)).map_err(|e| e.0[0].pointer.clone());
        assert_eq!(pointer(&[("site/line", "Oslo 3"), ("shift", "")]), Ok(()));
        assert_eq!(pointer(&[("a b", "x")]), Err("/labels".to_owned()));
        assert_eq!(pointer(&[("", "x")]), Err("/labels".to_owned()));
        assert_eq!(pointer(&[("a/b", "x,y")]), Err("/labels/a~1b".to_owned()));
        assert_eq!(pointer(&[("a", "x\ny")]), Err("/labels/a".to_owned()));
        let many: Labels = (0..17).map(|n| (format!("k{n}"), String::new())).collect();
        assert!(checked(&many).is_err());
    }

    #[test]
    fn all_wanted_labels_must_be_there_with_their_values() {
        let found = labels(&[("site", "oslo:3"), ("shift", "night")]);
        let fits = |asked| Wanted::new(Some(asked)).unwrap().fits(&found);
        assert!(fits("site:oslo:3") && fits("shift") && fits("shift,site:oslo:3"));
        assert!(!fits("site:oslo") && !fits("shift,cell"));
        assert!(Wanted::new(None).unwrap().fits(&Labels::new()));
        assert!(Wanted::new(Some("site,,shift")).is_err());
    }
}
