//! Receiver of webhooks for tests: answers with scripted statuses, records the messages, and
//! verifies their signatures as Standard Webhooks describes.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use axum::Router;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::routing::post;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use ring::hmac;
use serde_json::{Value, json};
use tokio::sync::mpsc;

use crate::harness::Harness;

/// A secret that a client gives: that of the standard's example.
pub(crate) const SECRET: &str = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw";

/// A message that came.
#[derive(Clone, Debug)]
pub(crate) struct Received {
    pub(crate) id: String,
    pub(crate) signature: String,
    pub(crate) timestamp: String,
    pub(crate) body: String,
}

impl Received {
    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap()
    }

    /// Whether one of the signatures is by a secret, `whsec_…`.
    pub(crate) fn is_signed_by(&self, secret: &str) -> bool {
        let secret = STANDARD.decode(secret.strip_prefix("whsec_").unwrap()).unwrap();
        let key = hmac::Key::new(hmac::HMAC_SHA256, &secret);
        let signed = format!("{}.{}.{}", self.id, self.timestamp, self.body);
        let signatures = self.signature.split(' ').map(|one| one.strip_prefix("v1,").unwrap());
        signatures.into_iter().any(|one| {
            hmac::verify(&key, signed.as_bytes(), &STANDARD.decode(one).unwrap()).is_ok()
        })
    }
}

struct Answers {
    /// Statuses of the next answers; then 200.
    statuses: Mutex<VecDeque<u16>>,
    delay: Duration,
    came: mpsc::UnboundedSender<Received>,
}

/// A running receiver.
pub(crate) struct Receiver {
    pub(crate) address: SocketAddr,
    answers: Arc<Answers>,
    came: mpsc::UnboundedReceiver<Received>,
}

impl Receiver {
    pub(crate) async fn start() -> Self {
        Self::start_at("127.0.0.1:0".parse().unwrap(), Duration::ZERO).await
    }

    pub(crate) async fn start_at(address: SocketAddr, delay: Duration) -> Self {
        let (sender, came) = mpsc::unbounded_channel();
        let answers = Arc::new(Answers { statuses: Mutex::default(), delay, came: sender });
        let router = Router::new().route("/hook", post(take)).with_state(Arc::clone(&answers));
        let listener = tokio::net::TcpListener::bind(address).await.unwrap();
        let address = listener.local_addr().unwrap();
        tokio::spawn(async move { axum::serve(listener, router).await.unwrap() });
        Self { address, answers, came }
    }

    /// Answers the next messages with these statuses.
    pub(crate) fn answer(&self, statuses: &[u16]) {
        self.answers.statuses.lock().unwrap().extend(statuses);
    }

    pub(crate) fn url(&self) -> String {
        format!("http://{}/hook", self.address)
    }

    /// The next message.
    pub(crate) async fn next(&mut self) -> Received {
        let next = tokio::time::timeout(Duration::from_secs(300), self.came.recv()).await;
        next.expect("a message comes").unwrap()
    }

    /// Creates a webhook that posts here; its id and secret.
    pub(crate) async fn subscribe(&self, it: &Harness, events: &[&str]) -> (String, String) {
        let request = json!({"url": self.url(), "events": events});
        let made = it.post("/v1/webhooks", &request).await.expect(201);
        let id = made["webhook"]["id"].as_str().unwrap().to_owned();
        (id, made["secret"].as_str().unwrap().to_owned())
    }
}

async fn take(State(answers): State<Arc<Answers>>, headers: HeaderMap, body: Bytes) -> StatusCode {
    let header = |name: &str| headers[name].to_str().unwrap().to_owned();
    assert_eq!(header("content-type"), "application/json");
    let received = Received {
        id: header("webhook-id"),
        signature: header("webhook-signature"),
        timestamp: header("webhook-timestamp"),
        body: String::from_utf8(body.to_vec()).unwrap(),
    };
    answers.came.send(received).unwrap();
    tokio::time::sleep(answers.delay).await;
    let status = answers.statuses.lock().unwrap().pop_front().unwrap_or(200);
    StatusCode::from_u16(status).unwrap()
}
