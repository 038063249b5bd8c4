//! Tests of TLS end to end, with a certificate made here, and of invalid files.

use std::path::PathBuf;
use std::time::Duration;

use palpate_server::tls::{TlsError, TlsFiles};
use palpate_server::{Access, Server, StartError};
use rcgen::{CertificateParams, KeyPair};
use tempfile::TempDir;

use crate::harness::config;

/// A folder with a certificate for this machine's address, its key, and another key.
struct Files {
    folder: TempDir,
    certificate_pem: String,
}

impl Files {
    fn make() -> Self {
        let folder = TempDir::new().unwrap();
        let key = KeyPair::generate().unwrap();
        let names = vec!["127.0.0.1".to_owned(), "localhost".to_owned()];
        let certificate = CertificateParams::new(names).unwrap().self_signed(&key).unwrap();
        let files = Self { folder, certificate_pem: certificate.pem() };
        files.write("server.pem", &certificate.pem());
        files.write("server.key", &key.serialize_pem());
        files.write("other.key", &KeyPair::generate().unwrap().serialize_pem());
        files.write("empty.pem", "");
        files.write("broken.pem", "-----BEGIN CERTIFICATE-----\n*\n-----END CERTIFICATE-----\n");
        files
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn pair(&self, certificate: &str, key: &str) -> TlsFiles {
        let look_every = Duration::from_millis(20);
        TlsFiles { certificate: self.path(certificate), key: self.path(key), look_every }
    }

    fn client(&self) -> reqwest::Client {
        let _ = rustls::crypto::ring::default_provider().install_default();
        let trusted = reqwest::Certificate::from_pem(self.certificate_pem.as_bytes()).unwrap();
        let client = reqwest::Client::builder().tls_certs_only([trusted]);
        client.timeout(Duration::from_secs(30)).build().unwrap()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_with_a_certificate_speaks_tls_and_stops_gracefully() {
    let (files, data) = (Files::make(), TempDir::new().unwrap());
    let mut config = config(data.path());
    config.tls = Some(files.pair("server.pem", "server.key"));
    config.access = Access::Keys;
    let mut server = Server::start(config).await.unwrap();
    let (address, key) = (server.address(), server.take_admin_key().unwrap());
    assert!(address.starts_with("https://127.0.0.1:"), "{address}");
    let client = files.client();
    let sessions = client.get(format!("{address}/v1/sessions")).bearer_auth(&key).send().await;
    let sessions = sessions.unwrap();
    assert_eq!(sessions.status(), 200);
    assert_eq!(sessions.headers()["strict-transport-security"], "max-age=31536000");
    let audit = client.get(format!("{address}/v1/audit")).send().await.unwrap();
    assert_eq!(audit.status(), 401);

    // Neither a plain HTTP client nor a silent one delays others.
    let plain = address.replace("https", "http");
    assert!(client.get(format!("{plain}/livez")).send().await.is_err());
    let silent = tokio::net::TcpStream::connect(server.local_addr()).await.unwrap();
    let stranger = reqwest::Client::builder().tls_certs_only([]).build().unwrap();
    assert!(stranger.get(format!("{address}/livez")).send().await.is_err(), "nobody it trusts");
    assert_eq!(client.get(format!("{address}/livez")).send().await.unwrap().status(), 200);

    // Requests under way are answered when the server stops: this one's body is still coming.
    let (sender, receiver) = tokio::sync::mpsc::channel::<Result<Vec<u8>, std::io::Error>>(1);
    let body = reqwest::Body::wrap_stream(tokio_stream::wrappers::ReceiverStream::new(receiver));
    sender.send(Ok(b"{\"name\": ".to_vec())).await.unwrap();
    let late = client.post(format!("{address}/v1/objects")).bearer_auth(&key);
    let late = late.header("content-type", "application/json").body(body);
    let late = tokio::spawn(late.send());
    let arrived = "palpate_occupied{resource=\"bodies\"} 9";
    let metrics = format!("{address}/metrics");
    let is_here = async {
        loop {
            let seen = client.get(&metrics).bearer_auth(&key).send().await.unwrap();
            if seen.text().await.unwrap().lines().any(|line| line == arrived) {
                break;
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    };
    tokio::time::timeout(Duration::from_secs(60), is_here)
        .await
        .expect("the body's first bytes arrive");
    let stopping = tokio::spawn(server.shutdown());
    sender.send(Ok(b"\"mug\"}".to_vec())).await.unwrap();
    drop(sender);
    assert_eq!(late.await.unwrap().unwrap().status(), 201);
    stopping.await.unwrap();
    drop(silent);
    assert!(client.get(format!("{address}/livez")).send().await.is_err());
}

#[tokio::test(flavor = "multi_thread")]
async fn new_certificates_apply_to_new_clients_unless_invalid() {
    let (files, next, data) = (Files::make(), Files::make(), TempDir::new().unwrap());
    let mut config = config(data.path());
    config.tls = Some(files.pair("server.pem", "server.key"));
    let server = Server::start(config).await.unwrap();
    let alive = format!("{}/livez", server.address());
    let open = files.client();
    assert_eq!(open.get(&alive).send().await.unwrap().status(), 200);
    assert!(next.client().get(&alive).send().await.is_err(), "it is not shown yet");

    for name in ["server.key", "server.pem"] {
        std::fs::copy(next.path(name), files.path(name)).unwrap();
    }
    // A new client each time, since a connection keeps its certificate.
    while next.client().get(&alive).send().await.is_err() {}
    assert!(files.client().get(&alive).send().await.is_err(), "the old one is shown no more");
    assert_eq!(open.get(&alive).send().await.unwrap().status(), 200, "who was there may stay");

    files.write("server.pem", "nothing");
    tokio::time::sleep(Duration::from_millis(200)).await;
    assert_eq!(next.client().get(&alive).send().await.unwrap().status(), 200);
    server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_files_are_named_with_their_fault() {
    let (files, data) = (Files::make(), TempDir::new().unwrap());
    let start = async |certificate: &str, key: &str| {
        let mut config = config(data.path());
        config.tls = Some(files.pair(certificate, key));
        match Server::start(config).await.unwrap_err() {
            StartError::Tls(error) => error,
            other => panic!("{other}"),
        }
    };
    let missing = start("missing.pem", "server.key").await;
    assert!(matches!(missing, TlsError::Read { .. }), "{missing}");
    assert!(missing.to_string().contains("missing.pem"), "{missing}");
    let mismatch = start("server.pem", "other.key").await;
    assert!(matches!(mismatch, TlsError::Mismatch { .. }), "{mismatch}");
    for (certificate, key, said) in [
        ("empty.pem", "server.key", "has no certificate"),
        ("server.key", "server.key", "has no certificate"),
        ("server.pem", "empty.pem", "has no private key"),
        ("server.pem", "server.pem", "has no private key"),
        ("broken.pem", "server.key", "is not PEM"),
    ] {
        let error = start(certificate, key).await.to_string();
        assert!(error.contains(said), "{error}");
    }
}
