//! The client: where the server is, how long to wait, and the one way every call takes.

use std::fmt;
use std::time::Duration;

use backon::Retryable;
use palpate_schemas::{Liveness, Problem, Readiness, Version};
use reqwest::{Response, Url};
use serde::de::DeserializeOwned;

use crate::error::Error;
use crate::request::{Content, Request};
use crate::retry::{RetryPolicy, is_worth_repeating};

/// How much of a body that is no problem document is shown.
const BODY_SHOWN_MAX: usize = 200;

/// How a client behaves.
#[derive(Clone, PartialEq)]
pub struct ClientOptions {
    /// How long a connection may take.
    pub connect_timeout: Duration,
    /// How long an answer may take, once; streams of events are not limited.
    pub request_timeout: Duration,
    /// How often and how patiently calls are made again.
    pub retry: RetryPolicy,
    /// The key to be let in with, sent as a bearer token.
    pub key: Option<String>,
    /// The only authority whose certificates are trusted, as PEM; the system's when not given.
    pub authority_pem: Option<Vec<u8>>,
}

impl fmt::Debug for ClientOptions {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // A key has no business in a log.
        formatter
            .debug_struct("ClientOptions")
            .field("connect_timeout", &self.connect_timeout)
            .field("request_timeout", &self.request_timeout)
            .field("retry", &self.retry)
            .field("has_key", &self.key.is_some())
            .field("has_authority", &self.authority_pem.is_some())
            .finish()
    }
}

impl Default for ClientOptions {
    fn default() -> Self {
        Self {
            connect_timeout: Duration::from_secs(3),
            request_timeout: Duration::from_secs(60),
            retry: RetryPolicy::default(),
            key: None,
            authority_pem: None,
        }
    }
}

/// A client of one server. Cheap to clone; clones share connections.
#[derive(Clone, Debug)]
pub struct Client {
    http: reqwest::Client,
    server: Url,
    options: ClientOptions,
}

impl Client {
    /// A client of the server at `address`, such as `http://127.0.0.1:7411`.
    ///
    /// # Errors
    /// [`Error::Address`], [`Error::Key`], [`Error::Authority`] and [`Error::SetUp`]; the server
    /// is not asked yet.
    pub fn new(address: &str) -> Result<Self, Error> {
        Self::with_options(address, ClientOptions::default())
    }

    /// A client that behaves as `options` say.
    ///
    /// # Errors
    /// As [`Client::new`].
    pub fn with_options(address: &str, options: ClientOptions) -> Result<Self, Error> {
        let address_error = || Error::Address { found: address.to_owned() };
        let server = Url::parse(address).map_err(|_| address_error())?;
        let has_key_form = |key: &String| key.trim().bytes().all(|byte| byte.is_ascii_graphic());
        if !options.key.iter().all(has_key_form) {
            return Err(Error::Key);
        }
        if !matches!(server.scheme(), "http" | "https") || server.host_str().is_none() {
            return Err(address_error());
        }
        // Whoever installed a provider before us chose well enough.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let mut http = reqwest::Client::builder()
            .connect_timeout(options.connect_timeout)
            .redirect(reqwest::redirect::Policy::none())
            .user_agent(concat!("palpate-client/", env!("CARGO_PKG_VERSION")));
        if let Some(pem) = &options.authority_pem {
            let authorities = reqwest::Certificate::from_pem_bundle(pem);
            let authorities = authorities.ok().filter(|found| !found.is_empty());
            http = http.tls_certs_only(authorities.ok_or(Error::Authority)?);
        } else if server.scheme() == "http" {
            // No certificates are needed, and some machines have none.
            http = http.tls_certs_only([]);
        }
        if is_loopback(&server) {
            http = http.no_proxy();
        }
        let http = http.build().map_err(|source| Error::SetUp { source })?;
        Ok(Self { http, server, options })
    }

    /// The same client, which tries again as `retry` says and waits for answers as long as
    /// `request_timeout`. Both share connections.
    #[must_use]
    pub fn with_policy(&self, retry: RetryPolicy, request_timeout: Duration) -> Self {
        let options = ClientOptions { retry, request_timeout, ..self.options.clone() };
        Self { options, ..self.clone() }
    }

    /// The server's address.
    #[must_use]
    pub fn address(&self) -> &str {
        self.server.as_str().trim_end_matches('/')
    }

    /// Whether the server lives.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn alive(&self) -> Result<Liveness, Error> {
        self.send(Request::get(["livez"])).await
    }

    /// Whether the server does its work. One that is not ready is an [`Error::Status`].
    ///
    /// # Errors
    /// [`Error`].
    pub async fn ready(&self) -> Result<Readiness, Error> {
        self.send(Request::get(["readyz"])).await
    }

    /// Which server it is.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn version(&self) -> Result<Version, Error> {
        self.send(Request::get(["version"])).await
    }

    /// The server's figures, as Prometheus's text has them.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn metrics(&self) -> Result<String, Error> {
        let text = self.send_for_file(Request::get(["metrics"])).await?;
        Ok(String::from_utf8_lossy(&text).into_owned())
    }

    /// The API's description, as the server gives it.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn openapi(&self) -> Result<serde_json::Value, Error> {
        self.send(Request::get(["openapi.json"])).await
    }

    /// Makes a call, again where that is safe, and reads its answer.
    pub(crate) async fn send<T: DeserializeOwned>(&self, request: Request) -> Result<T, Error> {
        let url = self.url(&request);
        let body = self.send_for_bytes(&request, &url).await?;
        serde_json::from_slice(&body)
            .map_err(|source| Error::Unexpected { url: url.to_string(), source })
    }

    /// Makes a call whose answer is empty.
    pub(crate) async fn send_for_nothing(&self, request: Request) -> Result<(), Error> {
        let url = self.url(&request);
        self.send_for_bytes(&request, &url).await.map(|_| ())
    }

    /// Makes a call whose answer is a file.
    pub(crate) async fn send_for_file(&self, request: Request) -> Result<Vec<u8>, Error> {
        let url = self.url(&request);
        self.send_for_bytes(&request, &url).await
    }

    /// Opens a stream of events; a stream has no end and hence no time-out.
    pub(crate) async fn open_events(&self, request: &Request) -> Result<Response, Error> {
        let url = self.url(request);
        let sent = self.build(request, &url).header("accept", "text/event-stream").send().await;
        accepted(&url, sent.map_err(|error| transport_error(&url, error))?).await
    }

    /// Opens an answer that is read as it comes; it may be long, and has no time-out.
    pub(crate) async fn open_file(&self, request: &Request) -> Result<Response, Error> {
        let url = self.url(request);
        let sent = self.build(request, &url).send().await;
        accepted(&url, sent.map_err(|error| transport_error(&url, error))?).await
    }

    pub(crate) fn url(&self, request: &Request) -> Url {
        request.url(&self.server)
    }

    async fn send_for_bytes(&self, request: &Request, url: &Url) -> Result<Vec<u8>, Error> {
        let policy = self.options.retry;
        let attempt = || async {
            let sent = self.build(request, url).timeout(self.options.request_timeout).send().await;
            let answer = accepted(url, sent.map_err(|error| transport_error(url, error))?).await?;
            let body = answer.bytes().await.map_err(|error| transport_error(url, error))?;
            Ok(body.to_vec())
        };
        attempt
            .retry(policy.backoff())
            .when(|error| is_worth_repeating(error, request.repeat))
            .adjust(|error, planned| policy.pause(error, planned))
            .notify(|error, pause| {
                tracing::debug!(%error, pause_ms = pause.as_millis(), "Trying {url} again");
            })
            .await
    }

    fn build(&self, request: &Request, url: &Url) -> reqwest::RequestBuilder {
        let mut builder = self.http.request(request.method.clone(), url.clone());
        if let Some(key) = &self.options.key {
            builder = builder.bearer_auth(key.trim());
        }
        for (name, value) in &request.headers {
            builder = builder.header(*name, value);
        }
        match &request.content {
            Content::Nothing => builder,
            Content::Json(json) => {
                builder.header("content-type", "application/json").body(json.clone())
            }
            Content::Raw { media_type, bytes } => {
                builder.header("content-type", *media_type).body(bytes.clone())
            }
        }
    }
}

fn is_loopback(server: &Url) -> bool {
    let host = server.host_str().unwrap_or_default().trim_matches(['[', ']']);
    let address = host.parse::<std::net::IpAddr>();
    host == "localhost" || address.is_ok_and(|address| address.is_loopback())
}

fn transport_error(url: &Url, error: reqwest::Error) -> Error {
    let url = url.to_string();
    let source = error.without_url();
    match () {
        () if source.is_connect() => Error::Unreachable { url, source },
        () if source.is_timeout() => Error::TimedOut { url },
        () => Error::Broken { url, source },
    }
}

/// The answer if it is a success, otherwise the server's words about it.
async fn accepted(url: &Url, answer: Response) -> Result<Response, Error> {
    let status = answer.status();
    if status.is_success() {
        return Ok(answer);
    }
    let header = answer.headers().get("retry-after");
    let retry_after = header
        .and_then(|value| value.to_str().ok())
        .and_then(|value| value.trim().parse().ok())
        .map(Duration::from_secs);
    let body = answer.bytes().await.map_err(|error| transport_error(url, error))?;
    if let Ok(problem) = serde_json::from_slice::<Problem>(&body) {
        return Err(Error::Problem { problem: Box::new(problem), retry_after });
    }
    let body = String::from_utf8_lossy(&body).chars().take(BODY_SHOWN_MAX).collect();
    Err(Error::Status { url: url.to_string(), status: status.as_u16(), body, retry_after })
}
