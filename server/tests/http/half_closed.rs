//! Tests of clients that close their direction of a connection, and of those that have gone.

use std::net::SocketAddr;
use std::time::Duration;

use palpate_core::pose::Pose;
use serde_json::json;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};

use crate::harness::{BAR, CUBE, Harness, off_box, touches};

const LONG: Duration = Duration::from_secs(120);

/// Sends requests, closes the sending direction, and reads to the end.
async fn half_closed(address: SocketAddr, said: &str) -> String {
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(said.as_bytes()).await.unwrap();
    stream.shutdown().await.unwrap();
    let mut heard = Vec::new();
    // A reset is an end as well.
    let read = tokio::time::timeout(LONG, stream.read_to_end(&mut heard)).await;
    assert!(read.is_ok(), "the server does not close the connection");
    String::from_utf8_lossy(&heard).into_owned()
}

fn post(path: &str, body: &str) -> String {
    format!(
        "POST {path} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n\
         Content-Length: {}\r\n\r\n{body}",
        body.len()
    )
}

#[tokio::test(flavor = "multi_thread")]
async fn a_half_closed_connection_gets_its_answers() {
    let it = Harness::trained().await;
    let address = it.server.local_addr();
    let session = it.session(json!({})).await;
    let get = |path: &str| format!("GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n");
    let short = json!({"readings": touches(BAR, 2, 5, Pose::IDENTITY)}).to_string();
    let readings = format!("/v1/sessions/{session}/readings");
    for said in [
        get("/livez"),
        get("/openapi.json"),
        get("/v1/objects"),
        "GET /livez HTTP/1.0\r\n\r\n".to_owned(),
        post(&readings, &short),
    ] {
        let heard = half_closed(address, &said).await;
        assert!(heard.contains(" 200 OK\r\n"), "{said}: {heard}");
    }
    let heard = half_closed(address, &get("/livez").repeat(3)).await;
    assert_eq!(heard.matches("HTTP/1.1 200 OK").count(), 3, "pipelined: {heard}");
    // An answer that takes longer than a client that has gone is waited for.
    let long = json!({"readings": touches(CUBE, 300, 6, Pose::IDENTITY)}).to_string();
    let heard = half_closed(address, &post(&readings, &long)).await;
    let last = heard.rsplit("HTTP/1.1 ").next().unwrap();
    assert!(last.starts_with("200 OK") && last.ends_with('}'), "{heard}");
    // A request that is not complete is refused, and is not kept.
    let cut = &post(&readings, &short)[..400];
    let heard = half_closed(address, cut).await;
    assert!(heard.starts_with("HTTP/1.1 400 ") && heard.contains("middle of the body"), "{heard}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_slow_reader_gets_all_of_a_long_answer() {
    let it = Harness::start().await;
    it.post("/v1/objects", &json!({"name": "cube"})).await.expect(201);
    let comments = format!("# {}\n", "x".repeat(1000)).repeat(8 << 10);
    let mesh = format!("{}{comments}", off_box(CUBE));
    it.put_mesh("cube", &mesh).await.expect(200);
    let socket = TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(256 << 10).unwrap();
    let mut stream = socket.connect(it.server.local_addr()).await.unwrap();
    let said = "GET /v1/objects/cube/mesh HTTP/1.1\r\nHost: localhost\r\n\r\n";
    stream.write_all(said.as_bytes()).await.unwrap();
    stream.shutdown().await.unwrap();
    // Longer than a pause after which a client counts as gone.
    tokio::time::sleep(Duration::from_secs(3)).await;
    let mut heard = Vec::new();
    tokio::time::timeout(LONG, stream.read_to_end(&mut heard)).await.unwrap().unwrap();
    assert!(String::from_utf8_lossy(&heard).ends_with(&mesh[mesh.len() - 100..]));
    assert!(heard.len() > mesh.len(), "{} of {}", heard.len(), mesh.len());
}
