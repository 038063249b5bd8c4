//! Ids of sessions as people type them: whole, or the last digits that tables and pages show.

use std::str::FromStr;

use anyhow::bail;
use palpate_client::Client;
use palpate_client::schemas::{SessionOrder, SessionsQuery};
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
        let mut query = SessionsQuery {
            limit: Some(PAGE),
            order: Some(SessionOrder::Newest),
            ..SessionsQuery::default()
        };
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
    use std::io::{BufRead as _, BufReader, Write as _};
    use std::net::TcpListener;

    use serde_json::json;

    use super::*;

    const EXAMPLES: &str = include_str!("../../schemas/examples/responses.json");
    /// Number of pages of the server's sessions.
    const N_PAGES: usize = 20;

    fn id(number: usize) -> Uuid {
        Uuid::from_u128(number as u128 | 0xab << 24)
    }

    /// Address of a server with a session a page; their numbers ascend with their age.
    fn server() -> String {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        let examples: serde_json::Value = serde_json::from_str(EXAMPLES).unwrap();
        let session = examples["list_sessions"]["items"][0].clone();
        std::thread::spawn(move || {
            for stream in listener.incoming().map(Result::unwrap) {
                let mut lines = BufReader::new(&stream).lines().map(Result::unwrap);
                let asked = lines.next().unwrap();
                lines.find(String::is_empty).unwrap();
                let cursor = asked.split("cursor=").nth(1).map_or("0", |rest| &rest[..1]);
                let page = 1 + cursor.parse::<usize>().unwrap();
                let number = if asked.contains("order=newest") { page } else { N_PAGES - page };
                let mut item = session.clone();
                item["id"] = json!(id(number));
                let body = json!({"items": [item], "next_cursor": page.to_string()}).to_string();
                let length = body.len();
                let headers = "content-type: application/json\r\nconnection: close";
                let head = format!("HTTP/1.1 200 OK\r\n{headers}\r\ncontent-length: {length}");
                write!(&stream, "{head}\r\n\r\n{body}").unwrap();
            }
        });
        address
    }

    #[tokio::test]
    async fn an_end_is_looked_up_among_the_newest_sessions() {
        let client = Client::new(&server()).unwrap();
        let found = |number: usize| {
            let end = id(number).simple().to_string()[24..].to_owned();
            let client = &client;
            async move { SessionName::Ends(end).id(client).await }
        };
        assert_eq!(found(1).await.unwrap(), id(1));
        assert_eq!(found(LOOKED_UP / PAGE as usize).await.unwrap(), id(10));
        let none = found(11).await.unwrap_err().to_string();
        assert!(none.contains("none of the newest 10000 sessions"), "{none}");
    }

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
