//! Attacks on other servers, one after the other on one folder: with TLS, on a full disk,
//! without keys, and restored from a snapshot.
//!
//! There are no other clients; checked is whether the server still does its work, and refuses
//! what it must.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use rcgen::{CertificateParams, KeyPair};
use reqwest::header::{AUTHORIZATION, HOST, HeaderMap, HeaderValue, ORIGIN};
use reqwest::{Client, ClientBuilder, Method};
use serde::Serialize;
use serde_json::json;
use tokio::net::{TcpSocket, TcpStream};

use super::{FOES, key};
use crate::Access;
use crate::http::{Outcome, answer, client, send};
use crate::serving::Serving;

/// Connections that each attacker opens at the door of TLS.
const CONNECTIONS: usize = 150;
/// Time within which the server must accept another connection.
const PATIENCE: Duration = Duration::from_secs(3);
/// Number of writes of each attacker on a full disk.
const WRITES: usize = 25;
/// Names of another site.
const FOREIGN: &str = "lab.evil.example";

/// One attack on its own server.
#[derive(Debug, Default, Serialize)]
pub(super) struct Aside {
    attack: &'static str,
    finding: u8,
    attempts: u64,
    worked: u64,
    #[serde(skip)]
    pub(super) faults: Vec<String>,
}

impl Aside {
    fn new(attack: &'static str, finding: u8) -> Self {
        Self { attack, finding, ..Self::default() }
    }

    /// Counts an attempt, and its fault if it failed.
    fn expect(&mut self, holds: bool, otherwise: impl FnOnce() -> String) {
        self.attempts += 1;
        if !holds {
            self.worked += 1;
            self.faults.push(format!("{}: {}", self.attack, otherwise()));
        }
    }
}

/// Paths and material of the attacks.
struct Place {
    command: PathBuf,
    folder: PathBuf,
    certificate: String,
}

impl Place {
    fn data(&self) -> PathBuf {
        self.folder.join("aside")
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    fn serve(&self, data: &Path, access: Access, more: &[String]) -> anyhow::Result<Serving> {
        match Serving::start_with(&self.command, data, access, more)? {
            Ok(serving) => Ok(serving),
            Err(refused) => bail!("the server does not start: {}", refused.0),
        }
    }

    /// A client that trusts the certificate and opens a connection for each request.
    fn client(&self, key: Option<&str>) -> anyhow::Result<Client> {
        let mut headers = HeaderMap::new();
        if let Some(key) = key {
            headers.insert(AUTHORIZATION, HeaderValue::from_str(&format!("Bearer {key}"))?);
        }
        let trusted = reqwest::Certificate::from_pem(self.certificate.as_bytes())?;
        let builder: ClientBuilder = Client::builder().tls_certs_only([trusted]);
        let builder = builder.timeout(PATIENCE).pool_max_idle_per_host(0);
        Ok(builder.default_headers(headers).build()?)
    }
}

/// Attacks all servers.
pub(super) async fn attack(
    command: &Path,
    folder: &Path,
    within: Duration,
) -> anyhow::Result<Vec<Aside>> {
    let pair = KeyPair::generate().context("cannot make a key")?;
    let names = vec!["127.0.0.1".to_owned(), "localhost".to_owned()];
    let certificate = CertificateParams::new(names)?.self_signed(&pair)?.pem();
    let place = Place { command: command.to_owned(), folder: folder.to_owned(), certificate };
    std::fs::write(place.path("server.pem"), &place.certificate)?;
    std::fs::write(place.path("server.key"), pair.serialize_pem())?;
    let file = |name: &str| place.path(name).display().to_string();
    let tls =
        ["--tls-cert".to_owned(), file("server.pem"), "--tls-key".to_owned(), file("server.key")];

    let serving = place.serve(&place.data(), Access::Keys, &tls)?;
    let admin_key = serving.admin_key.clone().context("no key was made")?;
    let admin = place.client(Some(&admin_key))?;
    let url = serving.url.clone();
    let leaked = key(&admin, &url, "leaked", "trainer").await?;
    let silent = silent_tls(&place, &url, within).await?;
    let told = readiness(&place, &url).await?;
    let taken = admin.post(format!("{url}/v1/snapshots")).send().await?.bytes().await?;
    std::fs::write(place.path("before.snapshot"), &taken)?;
    let metrics = admin.get(format!("{url}/metrics")).send().await?.text().await?;
    let free = figure(&metrics, "palpate_store_free_bytes").context("no figure of free bytes")?;
    let said = serving.end()?;
    let private = private(&place, &admin_key, &said)?;

    let full = full_disk(&place, &admin_key, &leaked, free).await?;
    let foreign = foreign_names(&place).await?;
    let restored = restored(&place, &leaked).await?;
    Ok(vec![silent, full, restored, private, foreign, told])
}

/// A metric's value.
fn figure(metrics: &str, name: &str) -> Option<f64> {
    let line = metrics.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    line.and_then(|value| value.trim().parse().ok())
}

/// 4: silent connections to TLS; others must be accepted meanwhile.
async fn silent_tls(place: &Place, url: &str, within: Duration) -> anyhow::Result<Aside> {
    let mut found = Aside::new("silent_tls_connections", 4);
    let server: SocketAddr = url.trim_start_matches("https://").parse()?;
    let stranger = place.client(None)?;
    let mut held: Vec<TcpStream> = Vec::new();
    let until = Instant::now() + within;
    for n in 0..CONNECTIONS * usize::from(FOES) {
        let socket = TcpSocket::new_v4()?;
        let address: IpAddr = Ipv4Addr::new(127, 0, 0, 30 + (n % usize::from(FOES)) as u8).into();
        socket.bind(SocketAddr::new(address, 0))?;
        if let Ok(Ok(stream)) = tokio::time::timeout(PATIENCE, socket.connect(server)).await {
            held.push(stream);
        }
        if n % 100 == 0 {
            let asked = Instant::now();
            let let_in = stranger.get(format!("{url}/livez")).send().await;
            found.expect(let_in.is_ok(), || format!("no answer after {:?}", asked.elapsed()));
        }
    }
    while Instant::now() < until {
        let let_in = stranger.get(format!("{url}/livez")).send().await;
        found.expect(let_in.is_ok(), || format!("{} silent ones close the door", held.len()));
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    Ok(found)
}

/// 22: information about the store for a caller without a key.
async fn readiness(place: &Place, url: &str) -> anyhow::Result<Aside> {
    let mut found = Aside::new("figures_for_strangers", 22);
    let stranger = place.client(None)?;
    let ready = send(&stranger, Method::GET, format!("{url}/readyz"), None).await.done();
    let ready = ready.context("it is not ready")?;
    for check in ready["checks"].as_array().context("no checks")? {
        let is_plain = ["passed", "failed"].contains(&check["detail"].as_str().unwrap_or_default());
        found.expect(is_plain, || format!("a stranger is told {check}"));
    }
    let storage = send(&stranger, Method::GET, format!("{url}/v1/storage"), None).await;
    found.expect(storage.refused() == Some(401), || format!("{storage:?}"));
    Ok(found)
}

/// 15 and 16: files that other users of the machine may read, and the place of the first key.
fn private(place: &Place, admin_key: &str, said: &str) -> anyhow::Result<Aside> {
    let mut found = Aside::new("another_user_of_the_machine", 15);
    found.expect(!said.contains(admin_key), || "the first key is in the log".to_owned());
    let mut folders = vec![place.data()];
    while let Some(folder) = folders.pop() {
        found.expect(is_private(&folder)?, || format!("others may enter {}", folder.display()));
        for entry in std::fs::read_dir(&folder)? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else {
                found.expect(is_private(&path)?, || format!("others may read {}", path.display()));
            }
        }
    }
    Ok(found)
}

#[cfg(unix)]
fn is_private(path: &Path) -> anyhow::Result<bool> {
    use std::os::unix::fs::PermissionsExt;
    Ok(std::fs::metadata(path)?.permissions().mode() & 0o077 == 0)
}

#[cfg(not(unix))]
fn is_private(_path: &Path) -> anyhow::Result<bool> {
    Ok(true)
}

/// 5: a key leaks when the disk is full. It can be revoked, and space can be freed.
async fn full_disk(
    place: &Place,
    admin_key: &str,
    leaked: &str,
    free: f64,
) -> anyhow::Result<Aside> {
    let mut found = Aside::new("leaked_key_on_a_full_disk", 5);
    // Three quarters of the reserve are free: below it, above the half for plain removals.
    let reserve = ["--disk-reserve-mb".to_owned(), ((free * 4.0 / 3.0) as u64 >> 20).to_string()];
    let room = place.serve(&place.data(), Access::Keys, &[])?;
    let foe = place.client(Some(leaked))?;
    let body = json!({ "name": "spare" });
    let made = send(&foe, Method::POST, format!("{}/v1/objects", room.url), Some(&body)).await;
    made.done().context("cannot make an object")?;
    room.kill()?;
    let serving = place.serve(&place.data(), Access::Keys, &reserve)?;
    let url = serving.url.clone();
    let admin = place.client(Some(admin_key))?;
    for n in 0..WRITES * usize::from(FOES) {
        let body = json!({ "name": format!("filler-{n}") });
        let stored = send(&foe, Method::POST, format!("{url}/v1/objects"), Some(&body)).await;
        found.expect(stored.refused() == Some(507), || format!("was stored: {stored:?}"));
    }
    for path in ["/v1/keys/leaked", "/v1/objects/spare"] {
        let removed = send(&admin, Method::DELETE, format!("{url}{path}"), None).await;
        found.expect(matches!(removed, Outcome::Done(_)), || format!("{path}: {removed:?}"));
    }
    let again = send(&foe, Method::GET, format!("{url}/v1/whoami"), None).await;
    found.expect(again.refused() == Some(401), || format!("the leaked key: {again:?}"));
    let audit = format!("{url}/v1/audit?operation=revoke_key");
    let audit = send(&admin, Method::GET, audit, None).await.done().unwrap_or_default();
    let is_there = audit["items"].as_array().is_some_and(|entries| !entries.is_empty());
    found.expect(is_there, || "the audit log does not say so".to_owned());
    serving.kill()?;
    Ok(found)
}

/// 21 and 2.15: a page of another site, or of the same name by another scheme, reaches a server
/// without keys.
async fn foreign_names(place: &Place) -> anyhow::Result<Aside> {
    let mut found = Aside::new("another_sites_page", 21);
    let serving = place.serve(&place.data(), Access::Open, &[])?;
    let http = client()?;
    for path in ["/v1/objects", "/v1/sessions", "/v1/keys", "/v1/audit", "/v1/storage"] {
        let get = || http.get(format!("{}{path}", serving.url));
        let rebound = answer(get().header(HOST, FOREIGN)).await;
        found.expect(rebound.refused() == Some(403), || format!("{path}: {rebound:?}"));
        for origin in [format!("http://{FOREIGN}"), serving.url.replace("http:", "file:")] {
            let crossed = answer(get().header(ORIGIN, &origin)).await;
            let otherwise = || format!("{path} from {origin}: {crossed:?}");
            found.expect(crossed.refused() == Some(403), otherwise);
        }
    }
    serving.kill()?;
    Ok(found)
}

/// 12: a snapshot from before a key's revocation does not bring it back unnoticed.
async fn restored(place: &Place, leaked: &str) -> anyhow::Result<Aside> {
    let mut found = Aside::new("revoked_key_in_a_snapshot", 12);
    let restore = |data: &Path, more: &[&str]| {
        let mut command = Command::new(&place.command);
        command.args(["snapshot", "restore"]).arg(place.path("before.snapshot"));
        command.arg("--data").arg(data).args(more);
        command.output()
    };
    let unsaid = restore(&place.path("unsaid"), &[])?;
    found.expect(!unsaid.status.success(), || "its keys came back unasked".to_owned());
    let current = place.data().display().to_string();
    let data = place.path("restored");
    let done = restore(&data, &["--keys", "newer", "--current", &current])?;
    if !done.status.success() {
        bail!("cannot restore: {}", String::from_utf8_lossy(&done.stderr));
    }
    let serving = place.serve(&data, Access::Keys, &[])?;
    let foe = place.client(Some(leaked))?;
    let asked: Outcome = send(&foe, Method::GET, format!("{}/v1/whoami", serving.url), None).await;
    found.expect(asked.refused() == Some(401), || format!("the revoked key: {asked:?}"));
    serving.kill()?;
    Ok(found)
}
