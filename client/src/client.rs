//! The client of a server: address, options, and the path of every call.

use std::fmt;
use std::time::{Duration, SystemTime};

use backon::Retryable;
use palpate_schemas::retry_after::retry_after;
use palpate_schemas::{Liveness, Problem, Readiness, Version};
use reqwest::{Response, Url};
use serde::de::DeserializeOwned;

use crate::error::Error;
use crate::request::{Content, Request};
use crate::retry::{RetryPolicy, is_worth_repeating};

/// Length at which a body other than a problem document is cut off in errors.
const BODY_SHOWN_MAX: usize = 200;

/// Options of a client.
#[derive(Clone, PartialEq)]
pub struct ClientOptions {
    /// Time limit of a connection attempt.
    pub connect_timeout: Duration,
    /// Time limit of an answer, per attempt; event streams have none.
    pub request_timeout: Duration,
    /// Retry policy.
    pub retry: RetryPolicy,
    /// API key, sent as a bearer token.
    pub key: Option<String>,
    /// The only certificate authority to trust, as PEM. Default: the system's.
    pub authority_pem: Option<Vec<u8>>,
}

impl fmt::Debug for ClientOptions {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // A key must not appear in a log.
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
    /// Creates a client of the server at `address`, such as `http://127.0.0.1:7411`. It does not
    /// connect yet.
    ///
    /// # Errors
    /// [`Error::Address`], [`Error::AddressOfApi`], [`Error::Key`], [`Error::Authority`] and
    /// [`Error::SetUp`].
    pub fn new(address: &str) -> Result<Self, Error> {
        Self::with_options(address, ClientOptions::default())
    }

    /// Creates a client with options.
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
        if server.path().trim_end_matches('/').ends_with("/v1") {
            return Err(Error::AddressOfApi { found: address.to_owned() });
        }
        // Keep a provider that is already installed.
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
            // No certificates are needed here, and some machines have none.
            http = http.tls_certs_only([]);
        }
        if is_loopback(&server) {
            http = http.no_proxy();
        }
        let http = http.build().map_err(|source| Error::SetUp { source })?;
        Ok(Self { http, server, options })
    }

    /// A copy of the client with another retry policy and time limit. Both share connections.
    #[must_use]
    pub fn with_policy(&self, retry: RetryPolicy, request_timeout: Duration) -> Self {
        let options = ClientOptions { retry, request_timeout, ..self.options.clone() };
        Self { options, ..self.clone() }
    }

    /// Address of the server.
    #[must_use]
    pub fn address(&self) -> &str {
        self.server.as_str().trim_end_matches('/')
    }

    /// Checks that the server answers.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn alive(&self) -> Result<Liveness, Error> {
        self.send(Request::get(["livez"])).await
    }

    /// Checks that the server is ready.
    ///
    /// # Errors
    /// [`Error`]; a server that is not ready is an [`Error::Status`].
    pub async fn ready(&self) -> Result<Readiness, Error> {
        self.send(Request::get(["readyz"])).await
    }

    /// Returns the version of the server.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn version(&self) -> Result<Version, Error> {
        self.send(Request::get(["version"])).await
    }

    /// Returns the server's metrics in the Prometheus text format.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn metrics(&self) -> Result<String, Error> {
        let text = self.send_for_file(Request::get(["metrics"])).await?;
        Ok(String::from_utf8_lossy(&text).into_owned())
    }

    /// Returns the server's OpenAPI description.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn openapi(&self) -> Result<serde_json::Value, Error> {
        self.send(Request::get(["openapi.json"])).await
    }

    /// Sends a request, with retries where they are safe, and parses the answer.
    pub(crate) async fn send<T: DeserializeOwned>(&self, request: Request) -> Result<T, Error> {
        let url = self.url(&request);
        let body = self.send_for_bytes(&request, &url).await?;
        serde_json::from_slice(&body)
            .map_err(|source| Error::Unexpected { url: url.to_string(), source })
    }

    /// Sends a request whose answer is empty.
    pub(crate) async fn send_for_nothing(&self, request: Request) -> Result<(), Error> {
        let url = self.url(&request);
        self.send_for_bytes(&request, &url).await.map(|_| ())
    }

    /// Sends a request whose answer is a file.
    pub(crate) async fn send_for_file(&self, request: Request) -> Result<Vec<u8>, Error> {
        let url = self.url(&request);
        self.send_for_bytes(&request, &url).await
    }

    /// Opens an event stream, without a time limit.
    pub(crate) async fn open_events(&self, request: &Request) -> Result<Response, Error> {
        let url = self.url(request);
        let sent = self.build(request, &url).header("accept", "text/event-stream").send().await;
        accepted(&url, sent.map_err(|error| transport_error(&url, error))?).await
    }

    /// Opens an answer to be streamed, without a time limit.
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

/// The answer if it is a success, otherwise the problem.
async fn accepted(url: &Url, answer: Response) -> Result<Response, Error> {
    let status = answer.status();
    if status.is_success() {
        return Ok(answer);
    }
    let text = |name| answer.headers().get(name).and_then(|value| value.to_str().ok());
    let retry_after =
        text("retry-after").and_then(|asked| retry_after(asked, text("date"), SystemTime::now()));
    let body = answer.bytes().await.map_err(|error| transport_error(url, error))?;
    if let Ok(problem) = serde_json::from_slice::<Problem>(&body) {
        return Err(Error::Problem { problem: Box::new(problem), retry_after });
    }
    let body = String::from_utf8_lossy(&body).chars().take(BODY_SHOWN_MAX).collect();
    Err(Error::Status { url: url.to_string(), status: status.as_u16(), body, retry_after })
}
