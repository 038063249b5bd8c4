//! Spans of requests at a collector; the command under test was built with `otlp`.

use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;

use crate::command::Serving;

/// A collector that accepts one batch of spans and returns its bytes.
async fn collect(listener: TcpListener) -> Vec<u8> {
    let (mut stream, _) = listener.accept().await.unwrap();
    let mut bytes = Vec::new();
    loop {
        let mut chunk = vec![0; 65_536];
        let n = stream.read(&mut chunk).await.unwrap();
        bytes.extend_from_slice(&chunk[..n]);
        let end = bytes.windows(4).position(|four| four == b"\r\n\r\n");
        let Some(end) = end.map(|at| at + 4) else { continue };
        let head = String::from_utf8_lossy(&bytes[..end]).to_ascii_lowercase();
        let length = head.lines().find_map(|line| line.strip_prefix("content-length: "));
        if bytes.len() >= end + length.unwrap().trim().parse::<usize>().unwrap() {
            break;
        }
    }
    stream.write_all(b"HTTP/1.1 200 OK\r\ncontent-length: 0\r\n\r\n").await.unwrap();
    bytes
}

fn holds(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}

#[tokio::test(flavor = "multi_thread")]
async fn spans_reach_a_collector_within_the_callers_trace() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let collector = format!("http://{}", listener.local_addr().unwrap());
    let collected = tokio::spawn(collect(listener));
    let folder = tempfile::tempdir().unwrap();
    let options = ["--otlp-endpoint", &collector, "--log-format", "json"];
    let mut serving = Serving::start(folder.path(), &options);
    let trace = "0af7651916cd43dd8448eb211c80319c";
    let asked = reqwest::Client::new()
        .get(format!("{}/v1/objects", serving.url))
        .header("x-request-id", "seen-by-the-collector")
        .header("traceparent", format!("00-{trace}-b7ad6b7169203331-01"))
        .send()
        .await
        .unwrap();
    assert_eq!(asked.headers()["x-request-id"], "seen-by-the-collector");
    let (ended, log) = tokio::task::spawn_blocking(move || serving.stop()).await.unwrap();
    assert!(ended.success(), "{log}");
    for line in log.lines() {
        let entry: Value = serde_json::from_str(line).unwrap_or_else(|_| panic!("no JSON: {line}"));
        assert!(entry["message"].is_string() && entry["level"].is_string(), "{line}");
    }
    let spans = collected.await.unwrap();
    assert!(spans.starts_with(b"POST /v1/traces"));
    let id: Vec<u8> = (0..16)
        .map(|byte| u8::from_str_radix(&trace[2 * byte..2 * byte + 2], 16).unwrap())
        .collect();
    assert!(holds(&spans, &id), "the caller's trace");
    for part in ["GET /v1/objects", "seen-by-the-collector", "palpate"] {
        assert!(holds(&spans, part.as_bytes()), "{part}");
    }
}
