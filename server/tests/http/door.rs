//! Tests of occupied resources: connections, incomplete bodies, unread answers.

use std::io::ErrorKind;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use palpate_server::tls::TlsFiles;
use palpate_server::{Access, Server};
use rcgen::{CertificateParams, KeyPair};
use reqwest::Client;
use serde_json::json;
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};

use crate::harness::{CUBE, Harness, config, off_box, quiet_reading};

/// Long enough for any step of a test on a busy machine.
const LONG: Duration = Duration::from_secs(60);

async fn connect(address: SocketAddr, said: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(said.as_bytes()).await.unwrap();
    stream
}

/// Like `connect`, with a small window: an answer waits on the server's side.
async fn connect_narrow(address: SocketAddr, said: &str) -> TcpStream {
    let socket = TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(4096).unwrap();
    let mut stream = socket.connect(address).await.unwrap();
    stream.write_all(said.as_bytes()).await.unwrap();
    stream
}

/// All bytes of a connection until it is closed.
async fn rest(mut stream: TcpStream) -> String {
    let mut said = Vec::new();
    // A reset is an end as well.
    let read = tokio::time::timeout(LONG, stream.read_to_end(&mut said)).await;
    let said = String::from_utf8_lossy(&said).into_owned();
    assert!(read.is_ok(), "the server does not close the connection, and said {said:?}");
    said
}

/// The head of an answer; its body stays unread.
async fn head(stream: &mut TcpStream) -> String {
    let mut said = Vec::new();
    while !said.ends_with(b"\r\n\r\n") {
        said.push(stream.read_u8().await.unwrap());
    }
    String::from_utf8(said).unwrap()
}

/// Whether the server has not closed a connection.
fn is_open(stream: &TcpStream) -> bool {
    let mut bytes = [0; 256];
    loop {
        match stream.try_read(&mut bytes) {
            Ok(0) => return false,
            Ok(_) => {}
            Err(error) => return error.kind() == ErrorKind::WouldBlock,
        }
    }
}

/// A client with new connections.
fn stranger() -> Client {
    Client::builder().timeout(LONG).build().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn unfinished_headers_release_their_connections() {
    let it = Harness::start_with(|config| {
        config.connections_max = 16;
        config.patience.headers = Duration::from_millis(1500);
    })
    .await;
    let address = it.server.local_addr();
    let mut open = Vec::new();
    for _ in 0..40 {
        open.push(connect(address, "GET /v1/objects HTTP/1.1\r\nHost: localhost\r\nX: ").await);
    }
    for path in ["/livez", "/v1/objects"] {
        let answer = stranger().get(it.url(path)).send().await.unwrap();
        assert_eq!(answer.status(), 200, "{path} while every connection is taken");
    }
    // Slowly arriving bytes do not extend the deadline.
    let mut dripping = open.pop().unwrap();
    let dripped = async {
        while dripping.write_all(b"x").await.is_ok() {
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    };
    tokio::time::timeout(LONG, dripped).await.expect("the server closes it");
    for stream in open {
        rest(stream).await;
    }
    assert_eq!(stranger().get(it.url("/v1/objects")).send().await.unwrap().status(), 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn strangers_at_many_addresses_do_not_close_the_door() {
    let it = Harness::start_with(|config| {
        config.connections_max = 64;
        config.access = Access::Keys;
    })
    .await;
    let said = "GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n";
    let mut held = Vec::new();
    let connect = async |n: u8| {
        let socket = TcpSocket::new_v4().unwrap();
        socket.bind(SocketAddr::from(([127, 0, 0, n], 0))).unwrap();
        let mut stream = socket.connect(it.server.local_addr()).await.unwrap();
        stream.write_all(said.as_bytes()).await.unwrap();
        head(&mut stream).await;
        stream
    };
    for n in (2..34).chain([2; 64]) {
        held.push(connect(n).await);
    }
    // The connection of a robot with a key is made, and kept while more strangers come.
    let request = |client: &Client| {
        let request = client.get(it.url("/v1/objects")).bearer_auth(it.key.as_ref().unwrap());
        async move { request.send().await.unwrap().status() }
    };
    let robot = stranger();
    for n in 34..250 {
        if n % 20 == 0 {
            assert_eq!(request(&robot).await, 200);
            assert_eq!(request(&stranger()).await, 200);
        }
        held.push(connect(n).await);
    }
    // The door is full of strangers; the others were closed for newer ones, soon after these came.
    let begin = Instant::now();
    loop {
        let n_open = held.iter().filter(|stream| is_open(stream)).count();
        assert!(n_open > 32, "{n_open} are kept");
        if n_open <= 64 {
            break;
        }
        assert!(begin.elapsed() < LONG, "{n_open} are open");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_names_one_host() {
    let it = Harness::start().await;
    for (lines, status) in [
        ("Host: localhost\r\n", "200"),
        ("", "400"),
        ("Host:\r\n", "400"),
        ("Host: localhost\r\nHost: localhost\r\n", "400"),
        ("Host: localhost\r\nHost: evil.example\r\n", "400"),
        ("Host: localhost\r\nOrigin: null\r\nOrigin: null\r\n", "400"),
    ] {
        for path in ["/livez", "/", "/v1/objects", "/nothing"] {
            let said = format!("GET {path} HTTP/1.1\r\n{lines}Connection: close\r\n\r\n");
            let answer = rest(connect(it.server.local_addr(), &said).await).await;
            let expected = if path == "/nothing" && status == "200" { "404" } else { status };
            assert!(answer.starts_with(&format!("HTTP/1.1 {expected} ")), "{said}: {answer}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn idle_connections_are_closed_and_used_ones_kept() {
    let it = Harness::start_with(|config| {
        config.patience.headers = Duration::from_millis(800);
        config.patience.idle = Duration::from_millis(2500);
    })
    .await;
    let request = "GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n";
    let mut stream = connect(it.server.local_addr(), request).await;
    // Longer than the limit of headers, shorter than that of idle connections.
    tokio::time::sleep(Duration::from_millis(1300)).await;
    stream.write_all(request.as_bytes()).await.unwrap();
    let said = rest(stream).await;
    assert_eq!(said.matches("HTTP/1.1 200 OK").count(), 2, "{said}");
}

#[tokio::test(flavor = "multi_thread")]
async fn headers_longer_than_the_buffer_are_refused() {
    let it = Harness::start().await;
    let long =
        format!("GET /livez HTTP/1.1\r\nHost: localhost\r\nX: {}\r\n\r\n", "x".repeat(80_000));
    let said = rest(connect(it.server.local_addr(), &long).await).await;
    assert!(said.starts_with("HTTP/1.1 431"), "{said}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_early_answer_reaches_a_client_that_still_sends() {
    let it = Harness::start_with(|config| config.bodies_bytes_max = 8 << 10).await;
    let address = it.server.local_addr();
    for chunk in [1 << 10, 64 << 10] {
        let said = "POST /v1/objects HTTP/1.1\r\nHost: localhost\r\n\
                    Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n\r\n";
        let mut stream = connect(address, said).await;
        let piece = format!("{chunk:x}\r\n{}\r\n", "x".repeat(chunk));
        // All of it is sent before a byte of the answer is read, most of it after the refusal.
        for _ in 0..64 {
            stream.write_all(piece.as_bytes()).await.unwrap();
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
        let answer = rest(stream).await;
        // A client's share or the whole space: it depends on the bytes received at once.
        let is_refused = ["HTTP/1.1 429 ", "HTTP/1.1 503 "].iter().any(|s| answer.starts_with(s));
        assert!(is_refused, "{answer:?}");
        assert!(answer.to_ascii_lowercase().contains("connection: close\r\n"), "{answer}");
        assert!(answer.ends_with('}'), "the whole answer came: {answer}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn announced_bodies_hold_no_slot_and_no_memory() {
    let it = Harness::start_with(|config| {
        config.requests_max = 8;
        config.bodies_bytes_max = 1 << 20;
        config.patience.body = Duration::from_millis(1500);
    })
    .await;
    let promise = "POST /v1/objects HTTP/1.1\r\nHost: localhost\r\n\
        Content-Type: application/json\r\nContent-Length: 900000\r\n\r\n{\"name\": ";
    let mut open = Vec::new();
    for _ in 0..40 {
        open.push(connect(it.server.local_addr(), promise).await);
    }
    it.post("/v1/objects", &json!({"name": "vase"})).await.expect(201);
    for stream in open {
        let said = rest(stream).await;
        assert!(said.starts_with("HTTP/1.1 408"), "{said}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn unread_answers_are_bounded_and_released() {
    let it = Harness::start_with(|config| {
        // Space for three meshes that are read block by block.
        config.answers_bytes_max = 3 << 20;
        config.patience.answer = Duration::from_secs(4);
    })
    .await;
    it.post("/v1/objects", &json!({"name": "cube"})).await.expect(201);
    let comments = format!("# {}\n", "x".repeat(1000)).repeat(16 << 10);
    let mesh = format!("{}{comments}", off_box(CUBE));
    it.put_mesh("cube", &mesh).await.expect(200);
    let request = "GET /v1/objects/cube/mesh HTTP/1.1\r\nHost: localhost\r\n\r\n";
    let mut unread = Vec::new();
    for _ in 0..6 {
        unread.push(connect_narrow(it.server.local_addr(), request).await);
    }
    // Each has its head when all have arrived: the first ones fill the space, the others are refused.
    let mut heads = Vec::new();
    for stream in &mut unread {
        heads.push(tokio::time::timeout(LONG, head(stream)).await.expect("a head"));
    }
    let given = heads.iter().filter(|head| head.starts_with("HTTP/1.1 200 ")).count();
    assert!((1..=3).contains(&given), "{heads:?}");
    for head in heads.iter().filter(|head| !head.starts_with("HTTP/1.1 200 ")) {
        assert!(head.starts_with("HTTP/1.1 429 "), "{head}");
        let policy = "ratelimit-policy: \"answers\"";
        assert!(head.to_ascii_lowercase().contains(policy), "{head}");
    }
    it.get("/v1/objects").await.expect(200);
    let given_back = async {
        loop {
            let answer = it.client.get(it.url("/v1/objects/cube/mesh")).send().await.unwrap();
            if answer.status() == 200 {
                break answer.bytes().await.unwrap().len();
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    };
    let bytes = tokio::time::timeout(LONG, given_back).await.expect("stalled readers are closed");
    assert_eq!(bytes, mesh.len());
    drop(unread);
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn short_unread_answers_release_their_connections() {
    let patience = Duration::from_secs(1);
    let it = Harness::start_with(|config| {
        config.patience.answer = patience;
        config.patience.idle = 10 * LONG;
    })
    .await;
    it.post("/v1/objects", &json!({"name": "cube"})).await.expect(201);
    let mesh = format!("{}{}", off_box(CUBE), format!("# {}\n", "x".repeat(1000)).repeat(64));
    it.put_mesh("cube", &mesh).await.expect(200);
    let request = "GET /v1/objects/cube/mesh HTTP/1.1\r\nHost: localhost\r\n\r\n";
    let mut unread = Vec::new();
    for _ in 0..8 {
        unread.push(connect_narrow(it.server.local_addr(), request).await);
    }
    tokio::time::sleep(5 * patience).await;
    for stream in unread {
        let said = rest(stream).await;
        assert!(said.len() < mesh.len(), "the server waited with {} bytes", said.len());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn silent_connections_do_not_block_tls() {
    let (files, data) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let key = KeyPair::generate().unwrap();
    let names = vec!["127.0.0.1".to_owned()];
    let certificate = CertificateParams::new(names).unwrap().self_signed(&key).unwrap();
    let path = |name: &str| files.path().join(name);
    std::fs::write(path("server.pem"), certificate.pem()).unwrap();
    std::fs::write(path("server.key"), key.serialize_pem()).unwrap();
    let mut config = config(data.path());
    config.tls = Some(TlsFiles {
        certificate: path("server.pem"),
        key: path("server.key"),
        look_every: LONG,
    });
    config.access = Access::Keys;
    // The silent ones outlive the test: only free space lets others in.
    config.patience.handshake = Duration::from_secs(600);
    let server = Server::start(config).await.unwrap();
    let mut silent = Vec::new();
    for _ in 0..300 {
        silent.push(TcpStream::connect(server.local_addr()).await.unwrap());
    }
    let _ = rustls::crypto::ring::default_provider().install_default();
    let trusted = reqwest::Certificate::from_pem(certificate.pem().as_bytes()).unwrap();
    let client = Client::builder().tls_certs_only([trusted]).timeout(LONG).build().unwrap();
    let livez = client.get(format!("{}/livez", server.address())).send().await.unwrap();
    assert_eq!(livez.status(), 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_of_readings_is_limited_in_bytes() {
    let it = Harness::start().await;
    it.post("/v1/objects", &json!({"name": "cube"})).await.expect(201);
    let mut reading = quiet_reading();
    reading["feature"] = json!(vec![0; 4096]);
    let readings = json!({"readings": vec![reading; 300]});
    it.post("/v1/objects/cube/readings", &readings).await.expect(200);
    let (mut cursor, mut seen) = (String::new(), Vec::new());
    loop {
        let path = format!("/v1/objects/cube/readings?limit=1000{cursor}");
        let page = it.get(&path).await.expect(200);
        let items = page["items"].as_array().unwrap();
        // 4096 numbers of eight bytes and an image: 4 MiB have 127 readings.
        assert!((120..=127).contains(&items.len()) || page["next_cursor"].is_null());
        seen.extend(items.iter().map(|item| item["index"].as_u64().unwrap()));
        let Some(next) = page["next_cursor"].as_str() else { break };
        cursor = format!("&cursor={next}");
    }
    assert_eq!(seen, (0..300).collect::<Vec<u64>>());
}
