//! One attempt to deliver: a POST that follows no redirect, uses no proxy, resolves its host
//! itself, and ends after a while.

use std::error::Error as _;
use std::net::SocketAddr;
use std::sync::OnceLock;
use std::time::{Duration, SystemTime};

use palpate_schemas::retry_after::retry_after;
use reqwest::dns::{Addrs, Name, Resolve, Resolving};
use reqwest::header::HeaderValue;
use reqwest::{Client, Response, StatusCode, header, redirect};

use super::signature::signatures;
use super::target;

/// Time limit of an attempt, from the name's resolution to the answer.
const TIMEOUT: Duration = Duration::from_secs(10);
/// Number of bytes of an answer that are read, so that the connection can be used again.
const ANSWER_BYTES_MAX: usize = 1024;
/// Maximum length of an error in the history, characters.
const ERROR_CHARS_MAX: usize = 300;

/// Sends to webhooks.
pub(super) struct Sender {
    /// Made by the first attempt: few servers send anything.
    client: OnceLock<Result<Client, String>>,
    allows_private: bool,
}

/// A message for a receiver.
pub(super) struct Message<'a> {
    pub(super) url: &'a str,
    pub(super) secrets: Vec<&'a [u8]>,
    pub(super) id: String,
    pub(super) now_ms: u64,
    pub(super) body: String,
}

/// Outcome of an attempt.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Sent {
    /// Status of the answer, if there was one.
    pub(super) status: Option<u16>,
    /// Why it failed; `None` after a success.
    pub(super) error: Option<String>,
    /// The pause that the receiver asks for.
    pub(super) asked_pause: Option<Duration>,
}

impl Sender {
    pub(super) fn new(allows_private: bool) -> Self {
        Self { client: OnceLock::new(), allows_private }
    }

    /// Sends a message once.
    pub(super) async fn send(&self, message: Message<'_>) -> Sent {
        // The settings of the server may be others than when the webhook was made, and a client
        // connects to an address in a URL without resolving it.
        let checked = target::url(message.url, self.allows_private);
        let client = self.client.get_or_init(|| client(self.allows_private));
        let (url, client) = match (checked, client) {
            (Ok(url), Ok(client)) => (url, client),
            (Err(error), _) => return failed(None, error.to_string()),
            (_, Err(error)) => return failed(None, error.clone()),
        };
        let timestamp_s = message.now_ms / 1000;
        let Message { secrets, id, body, .. } = message;
        let signature = signatures(secrets, &id, timestamp_s, &body);
        let request = client
            .post(url)
            .header(header::CONTENT_TYPE, "application/json")
            .header("webhook-id", id)
            .header("webhook-timestamp", timestamp_s)
            .header("webhook-signature", signature)
            .body(body);
        match request.send().await {
            Ok(answer) => answered(answer).await,
            Err(error) => failed(None, reason(error)),
        }
    }
}

fn client(allows_private: bool) -> Result<Client, String> {
    // Fails if somebody was earlier, with the same one.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let made = Client::builder()
        .user_agent(concat!("palpate/", env!("CARGO_PKG_VERSION")))
        .redirect(redirect::Policy::none())
        .no_proxy()
        .referer(false)
        .timeout(TIMEOUT)
        .pool_max_idle_per_host(1)
        .pool_idle_timeout(Duration::from_secs(30))
        .dns_resolver(Checked { allows_private })
        .build();
    made.map_err(|error| format!("this server cannot send: {}", reason(error)))
}

/// The outcome according to an answer.
async fn answered(mut answer: Response) -> Sent {
    let status = answer.status();
    let text =
        |name| answer.headers().get(name).and_then(|value: &HeaderValue| value.to_str().ok());
    let asked_pause = text(header::RETRY_AFTER)
        .and_then(|asked| retry_after(asked, text(header::DATE), SystemTime::now()));
    let mut n_read = 0;
    while n_read < ANSWER_BYTES_MAX
        && let Ok(Some(chunk)) = answer.chunk().await
    {
        n_read += chunk.len();
    }
    let error = match status {
        status if status.is_success() => None,
        status if status.is_redirection() => {
            Some(format!("the receiver answered {status}, and redirects are not followed"))
        }
        StatusCode::GONE => Some(format!("the receiver answered {status}: it wants no more")),
        status => Some(format!("the receiver answered {status}")),
    };
    Sent { status: Some(status.as_u16()), error, asked_pause }
}

fn failed(status: Option<u16>, error: String) -> Sent {
    let error = error.chars().take(ERROR_CHARS_MAX).collect();
    Sent { status, error: Some(error), asked_pause: None }
}

/// An error in words: the innermost cause, which says most, without the URL.
fn reason(error: reqwest::Error) -> String {
    if error.is_timeout() {
        return format!("no answer within {} s", TIMEOUT.as_secs());
    }
    let error = error.without_url();
    let mut words = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        words = cause.to_string();
        source = cause.source();
    }
    words
}

/// Resolves names, and leaves out the addresses to which nothing may be sent.
struct Checked {
    allows_private: bool,
}

impl Resolve for Checked {
    fn resolve(&self, name: Name) -> Resolving {
        let allows_private = self.allows_private;
        Box::pin(async move {
            let found: Vec<SocketAddr> =
                tokio::net::lookup_host((name.as_str(), 0)).await?.collect();
            let check = |address: &SocketAddr| target::check(address.ip(), allows_private);
            let permitted: Vec<SocketAddr> =
                found.iter().filter(|address| check(address).is_ok()).copied().collect();
            if permitted.is_empty()
                && let Some(Err(refused)) = found.first().map(check)
            {
                return Err(refused.into());
            }
            Ok(Box::new(permitted.into_iter()) as Addrs)
        })
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
    use tokio::net::TcpListener;

    use super::*;

    #[tokio::test]
    async fn a_receiver_asks_for_a_pause_by_a_date() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}/hook", listener.local_addr().unwrap());
        tokio::spawn(async move {
            let (mut stream, _) = listener.accept().await.unwrap();
            let answer = "HTTP/1.1 503 Busy\r\nDate: Fri, 27 Nov 2026 20:42:00 GMT\r\n\
                Retry-After: Fri, 27 Nov 2026 23:59:59 GMT\r\nContent-Length: 0\r\n\r\n";
            assert!(stream.read(&mut [0; 4096]).await.unwrap() > 0);
            stream.write_all(answer.as_bytes()).await.unwrap();
        });
        let (id, body) = ("1".to_owned(), "{}".to_owned());
        let message = Message { url: &url, secrets: vec![b"secret"], id, now_ms: 1000, body };
        let sent = Sender::new(true).send(message).await;
        assert_eq!(sent.asked_pause, Some(Duration::from_secs(3 * 3600 + 17 * 60 + 59)));
    }

    async fn refused(url: &str) -> String {
        let (id, body) = ("1".to_owned(), "{}".to_owned());
        let message = Message { url, secrets: vec![b"secret"], id, now_ms: 1000, body };
        let sent = Sender::new(false).send(message).await;
        assert_eq!(sent.status, None);
        sent.error.unwrap()
    }

    #[tokio::test]
    async fn a_name_that_leads_to_this_machine_is_refused() {
        let error = refused("https://localhost:9/hook").await;
        assert!(error.contains("--webhook-allow-private"), "{error}");
        let error = refused("https://127.0.0.1:9/hook").await;
        assert!(error.contains("--webhook-allow-private"), "{error}");
    }
}
