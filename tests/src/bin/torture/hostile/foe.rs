//! An attacker with its own address, stolen keys, and connections that it never closes.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::Context;
use reqwest::header::{AUTHORIZATION, HeaderMap, HeaderValue};
use reqwest::{Client, Method};
use serde_json::Value;
use tokio::io::AsyncWriteExt;
use tokio::net::{TcpSocket, TcpStream};

use crate::http::POOLED;

/// Time that an attacker waits for an answer before it hangs up.
const PATIENCE: Duration = Duration::from_secs(3);
/// Pause between requests; the machine that attacks also measures.
const PACE: Duration = Duration::from_millis(5);

/// One attacker.
pub(super) struct Foe {
    pub(super) number: u8,
    pub(super) url: String,
    pub(super) server: SocketAddr,
    pub(super) robot_key: String,
    pub(super) viewer_key: String,
    pub(super) admin_key: String,
    pub(super) robot: Client,
    pub(super) viewer: Client,
    pub(super) stranger: Client,
    /// End of the current attack.
    pub(super) until: Instant,
    /// Connections that stay open until the server closes them.
    pub(super) held: Mutex<Vec<TcpStream>>,
    /// Number of requests sent or connections opened.
    pub(super) attempts: std::sync::atomic::AtomicU64,
}

/// Keys held by an attacker.
pub(super) struct Stolen {
    pub(super) robot: String,
    pub(super) viewer: String,
    pub(super) admin: String,
}

/// The address of an attacker, used by no honest robot.
fn address(number: u8) -> IpAddr {
    Ipv4Addr::new(127, 0, 0, 10 + number).into()
}

impl Foe {
    pub(super) fn new(number: u8, url: &str, keys: Stolen) -> anyhow::Result<Self> {
        let server = url.trim_start_matches("http://").parse().context("no address")?;
        let client = |key: Option<&str>| -> anyhow::Result<Client> {
            let mut headers = HeaderMap::new();
            if let Some(key) = key {
                headers.insert(AUTHORIZATION, HeaderValue::from_str(&format!("Bearer {key}"))?);
            }
            let builder = Client::builder().local_address(address(number)).timeout(PATIENCE);
            let builder = builder.pool_idle_timeout(POOLED);
            Ok(builder.default_headers(headers).build()?)
        };
        Ok(Self {
            number,
            url: url.to_owned(),
            server,
            robot: client(Some(&keys.robot))?,
            viewer: client(Some(&keys.viewer))?,
            stranger: client(None)?,
            robot_key: keys.robot,
            viewer_key: keys.viewer,
            admin_key: keys.admin,
            until: Instant::now(),
            held: Mutex::default(),
            attempts: std::sync::atomic::AtomicU64::new(0),
        })
    }

    /// Whether the attack goes on.
    pub(super) fn goes_on(&self) -> bool {
        Instant::now() < self.until
    }

    pub(super) fn count(&self) {
        self.attempts.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    }

    /// Sends a request and returns its status and body; `None` without an answer.
    pub(super) async fn ask(
        &self,
        client: &Client,
        method: Method,
        path: &str,
        body: Option<&Value>,
    ) -> Option<(u16, Value)> {
        self.count();
        tokio::time::sleep(PACE).await;
        let mut request = client.request(method, format!("{}{path}", self.url));
        if let Some(body) = body {
            request = request.json(body);
        }
        let answer = request.send().await.ok()?;
        let status = answer.status().as_u16();
        let bytes = answer.bytes().await.ok()?;
        Some((status, serde_json::from_slice(&bytes).unwrap_or_default()))
    }

    /// Opens a connection and sends bytes without reading the answer.
    pub(super) async fn open(&self, said: &str) -> bool {
        self.count();
        let Some(mut stream) = self.connect(self.address()).await else { return false };
        let is_sent = stream.write_all(said.as_bytes()).await.is_ok();
        self.held.lock().unwrap_or_else(PoisonError::into_inner).push(stream);
        is_sent
    }

    /// The attacker's own address.
    pub(super) fn address(&self) -> IpAddr {
        address(self.number)
    }

    /// Opens a connection from an address; `None` if the server does not accept it.
    pub(super) async fn connect(&self, from: IpAddr) -> Option<TcpStream> {
        let socket = TcpSocket::new_v4().ok()?;
        socket.bind(SocketAddr::new(from, 0)).ok()?;
        tokio::time::timeout(PATIENCE, socket.connect(self.server)).await.ok()?.ok()
    }
}
