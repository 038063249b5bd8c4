//! Requests whose answer may never arrive, and the client's knowledge of each afterwards.

use std::time::Duration;

use anyhow::Context;
use reqwest::header::{AUTHORIZATION, HeaderMap, HeaderValue};
use reqwest::{Client, Method};
use serde_json::Value;

/// Maximum time of an answer.
const PATIENCE: Duration = Duration::from_secs(90);

/// Time that an unused connection stays in a client's pool: much less than the time after which
/// `hostile` expects the server to hold nothing, since a server leaves idle connections open.
pub(crate) const POOLED: Duration = Duration::from_secs(15);

/// Result of a request.
#[derive(Debug)]
pub(crate) enum Outcome {
    /// Success, with this body.
    Done(Value),
    /// Refused with this status: the request had no effect.
    Refused(u16, Value),
    /// No answer, or one that does not tell: the request may have had its effect.
    Unknown,
}

impl Outcome {
    /// The body of a success.
    pub(crate) fn done(self) -> Option<Value> {
        match self {
            Self::Done(body) => Some(body),
            Self::Refused(..) | Self::Unknown => None,
        }
    }

    /// The status of a refusal.
    pub(crate) fn refused(&self) -> Option<u16> {
        match self {
            Self::Refused(status, _) => Some(*status),
            Self::Done(_) | Self::Unknown => None,
        }
    }
}

/// A client that never repeats a request by itself.
pub(crate) fn client() -> anyhow::Result<Client> {
    builder().build().context("cannot set up the HTTP client")
}

fn builder() -> reqwest::ClientBuilder {
    Client::builder().timeout(PATIENCE).pool_idle_timeout(POOLED)
}

/// A client that sends a key with every request.
pub(crate) fn client_with(key: &str) -> anyhow::Result<Client> {
    let bearer = HeaderValue::from_str(&format!("Bearer {key}")).context("a key is text")?;
    let headers = HeaderMap::from_iter([(AUTHORIZATION, bearer)]);
    builder().default_headers(headers).build().context("cannot set up the HTTP client")
}

/// Sends a request; `body` as JSON.
pub(crate) async fn send(
    client: &Client,
    method: Method,
    url: String,
    body: Option<&Value>,
) -> Outcome {
    let mut request = client.request(method, url);
    if let Some(body) = body {
        request = request.header("content-type", "application/json").body(body.to_string());
    }
    answer(request).await
}

/// Sends a prepared request.
pub(crate) async fn answer(request: reqwest::RequestBuilder) -> Outcome {
    let Ok(response) = request.send().await else { return Outcome::Unknown };
    let status = response.status();
    let Ok(text) = response.text().await else { return Outcome::Unknown };
    let body = serde_json::from_str(&text).unwrap_or(Value::String(text));
    if status.is_success() {
        return Outcome::Done(body);
    }
    // An answer that came too late says that the request may be stored.
    let detail = body["detail"].as_str().unwrap_or_default();
    if status.as_u16() == 503 && detail.contains("may be stored") {
        return Outcome::Unknown;
    }
    Outcome::Refused(status.as_u16(), body)
}
