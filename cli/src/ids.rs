//! Ids of sessions as people type them: whole, or the last digits that tables and pages show.

use std::str::FromStr;

use anyhow::bail;
use palpate_client::Client;
use palpate_client::schemas::SessionsQuery;
use uuid::Uuid;

/// Fewest digits that may stand for an id.
const DIGITS_MIN: usize = 4;
/// Number of the newest sessions among which an id is looked up by its last digits.
const LOOKED_UP: usize = 10_000;
/// Sessions of one page.
const PAGE: u32 = 1000;

/// A session's id, or the last digits of one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum SessionName {
    /// The whole id.
    Id(Uuid),
    /// Its last digits, in small letters.
    Ends(String),
}

impl FromStr for SessionName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_digits = text.bytes().all(|byte| byte.is_ascii_hexdigit());
        match Uuid::parse_str(text) {
            Ok(id) => Ok(Self::Id(id)),
            Err(_) if is_digits && (DIGITS_MIN..32).contains(&text.len()) => {
                Ok(Self::Ends(text.to_lowercase()))
            }
            Err(_) => Err(format!(
                "{text:?} is no id of a session: expected one such as \
                 0198a0d0-0000-7000-8000-000000000000, or at least its last {DIGITS_MIN} digits"
            )),
        }
    }
}

impl SessionName {
    /// The id of the session, looked up among the newest sessions if only its end is known.
    pub(crate) async fn id(&self, client: &Client) -> anyhow::Result<Uuid> {
        let end = match self {
            Self::Id(id) => return Ok(*id),
            Self::Ends(end) => end,
        };
        let mut query = SessionsQuery { limit: Some(PAGE), ..SessionsQuery::default() };
        let mut found = Vec::new();
        for _ in 0..LOOKED_UP / PAGE as usize {
            let page = client.sessions(&query).await?;
            let ids = page.items.iter().map(|session| session.id);
            found.extend(ids.filter(|id| id.simple().to_string().ends_with(end.as_str())));
            query.cursor = page.next_cursor;
            if query.cursor.is_none() {
                break;
            }
        }
        match found[..] {
            [id] => Ok(id),
            [] => bail!("none of the newest {LOOKED_UP} sessions has an id that ends with {end}"),
            [first, second, ..] => {
                bail!("several sessions have ids that end with {end}: {first}, {second}")
            }
        }
    }
}

/// The ids of several sessions.
pub(crate) async fn ids(names: &[SessionName], client: &Client) -> anyhow::Result<Vec<Uuid>> {
    let mut ids = Vec::with_capacity(names.len());
    for name in names {
        ids.push(name.id(client).await?);
    }
    Ok(ids)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_is_typed_whole_or_by_its_end() {
        let id = "0198a0d0-0000-7000-8000-00006580ecdc";
        assert_eq!(id.parse(), Ok(SessionName::Id(id.parse().unwrap())));
        assert_eq!("6580ECDC".parse(), Ok(SessionName::Ends("6580ecdc".to_owned())));
        for wrong in ["nope", "cdc", "", "0198a0d0-0000"] {
            let error = wrong.parse::<SessionName>().unwrap_err();
            assert!(error.contains("is no id of a session"), "{error}");
        }
    }
}
