//! Invented values of everything that a request can carry, with and without a key: afterwards the
//! metrics and the memory of a real server are as before.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use palpate_tests::memory_kib;

use crate::command::Serving;

/// Number of invented values.
const N: usize = 10_000;
/// Length of a value. All of them are 40 MB, and more than once in memory if they were kept.
const VALUE_BYTES: usize = 4_000;
/// Growth of the memory that is not due to kept values, KiB: a quarter of theirs.
const ROOM_KIB: u64 = 10_000;
/// Number of requests on one connection.
const AT_ONCE: usize = 25;

/// A place of a value: the request with it, of the text before and after further headers.
type Place = fn(&str) -> (String, String);

/// A request with a header.
fn header(name: &str, value: &str) -> (String, String) {
    ("GET /v1/objects HTTP/1.1\r\nHost: localhost".to_owned(), format!("{name}: {value}"))
}

fn get(target: &str) -> (String, String) {
    (format!("GET {target} HTTP/1.1\r\nHost: localhost"), "X: 1".to_owned())
}

fn asked(method: &str, target: &str, body: &str) -> (String, String) {
    let length = body.len();
    let head = format!("{method} {target} HTTP/1.1\r\nHost: localhost");
    (head, format!("Content-Type: application/json\r\nContent-Length: {length}\r\n\r\n{body}"))
}

/// An id of the form that sessions have.
fn id(value: &str) -> String {
    format!("01890000-0000-7000-8000-{}", &value[..12])
}

/// Every part of a request.
const PLACES: [Place; 40] = [
    |v| asked(v, "/livez", ""),
    |v| asked(&v[..12], "/livez", ""),
    |v| asked(&v[..12], "/v1/objects", ""),
    |v| asked(&v[..12], &format!("/{v}"), ""),
    |v| asked("TRACE", &format!("/v1/sessions/{}", id(v)), ""),
    |v| get(&format!("/{v}")),
    |v| get(&format!("/v1/{v}")),
    |v| get(&format!("/v1/objects/{v}")),
    |v| get(&format!("/v1/sessions/{v}")),
    |v| get(&format!("/v1/sessions/{}/belief", id(v))),
    |v| get(&format!("/v1/sessions/{}/events", id(v))),
    |v| get(&format!("/v1/events?sessions={}", id(v))),
    |v| get(&format!("/v1/catalogues/{}/versions/7", &v[..60])),
    |v| get(&format!("/v1/catalogues/default/versions/1/objects/{v}/occupancy")),
    |v| get(&format!("/v1/objects?{v}=1")),
    |v| get(&format!("/v1/objects?cursor={v}")),
    |v| get(&format!("/v1/objects?labels={v}:1")),
    |v| get(&format!("/v1/sessions?labels=line:{}", &v[..60])),
    |v| get(&format!("http://localhost/{v}")),
    |v| header("Origin", &format!("http://{v}")),
    |v| header("User-Agent", v),
    |v| header("X-Request-Id", &v[..64]),
    |v| header("X-Request-Id", v),
    |v| header("Last-Event-ID", v),
    |v| header("If-None-Match", &format!("\"{v}\"")),
    |v| header("Accept", v),
    |v| header("Accept-Encoding", v),
    |v| header("Cookie", v),
    |v| header("Authorization", &format!("Bearer {v}")),
    |v| header("Forwarded", &format!("for={v}")),
    |v| header("Traceparent", &format!("00-{}-{}-01", &v[..32], &v[..16])),
    |v| header("Expect", v),
    |v| header(&format!("X-{}", &v[..60]), v),
    |v| (format!("GET / HTTP/1.1\r\nHost: {v}"), "X: 1".to_owned()),
    |v| asked("POST", &format!("/v1/sessions/{}/readings", id(v)), "{\"readings\": []}"),
    |v| asked("PUT", &format!("/v1/objects/{v}/mesh?unit={v}"), "{}"),
    |v| asked("DELETE", &format!("/v1/objects/{v}"), ""),
    |v| asked("POST", "/v1/sessions", &format!("{{\"{v}\": 1}}")),
    |v| asked("POST", "/v1/sessions", &format!("{{\"catalogue\": \"{v}\"}}")),
    |v| asked("POST", "/v1/objects", &format!("{{\"name\": \"{v}\"}}")),
];

/// The requests with values number `from` to `from + n`, in turn for every place and caller.
fn requests(from: usize, n: usize, key: &str) -> Vec<String> {
    let request = |number: usize| {
        // Different in every part.
        let spread = (number as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let value = format!("{spread:016x}").repeat(VALUE_BYTES / 16);
        let (head, rest) = PLACES[number % PLACES.len()](&value);
        let has_key = number / PLACES.len() % 2 == 1 && !rest.starts_with("Authorization");
        let key = if has_key { format!("\r\nAuthorization: Bearer {key}") } else { String::new() };
        let end = if rest.contains("\r\n\r\n") { "" } else { "\r\n\r\n" };
        format!("{head}{key}\r\n{rest}{end}")
    };
    (from..from + n).map(request).collect()
}

/// Sends requests, several on a connection; a refusal may end it, then the rest follow on another.
fn send(address: &str, requests: &[String]) {
    let mut rest = requests;
    while !rest.is_empty() {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
        let now = &rest[..rest.len().min(AT_ONCE)];
        let mut n_answered = 0;
        for request in now {
            let is_sent = stream.write_all(request.as_bytes()).is_ok();
            n_answered += usize::from(is_sent);
            if !is_sent || !is_answered(&mut stream) {
                break;
            }
        }
        rest = &rest[n_answered.max(1)..];
    }
}

/// Reads one answer; `false` when the connection has ended with it.
fn is_answered(stream: &mut TcpStream) -> bool {
    let (mut heard, mut block) = (Vec::new(), [0; 65_536]);
    loop {
        let text = String::from_utf8_lossy(&heard).to_ascii_lowercase();
        if let Some((head, body)) = text.split_once("\r\n\r\n") {
            let length = head.lines().find_map(|line| line.strip_prefix("content-length: "));
            let length = length.map_or(0, |length| length.parse().unwrap());
            if body.len() >= length {
                return !head.contains("connection: close");
            }
        }
        match stream.read(&mut block) {
            Ok(n) if n > 0 => heard.extend_from_slice(&block[..n]),
            _ => return false,
        }
    }
}

/// The metrics without their values, and the memory in KiB.
fn state(serving: &Serving, address: &str) -> (Vec<String>, u64) {
    let mut stream = TcpStream::connect(address).unwrap();
    let said = "GET /metrics HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    stream.write_all(said.as_bytes()).unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    let (_, figures) = text.split_once("\r\n\r\n").unwrap();
    let series = figures.lines().filter_map(|line| Some(line.rsplit_once(' ')?.0.to_owned()));
    (series.collect(), memory_kib(serving.process(), "VmRSS").unwrap())
}

#[test]
fn invented_values_leave_metrics_and_memory_as_before() {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--access", "keys", "--open-metrics", "--failed-changes", "1000000"];
    let serving = Serving::start(folder.path(), &options);
    let address = serving.url.strip_prefix("http://").unwrap().to_owned();
    let key = std::fs::read_to_string(folder.path().join("admin.key")).unwrap();
    // Every kind of request once for each caller, several times: caches and pools are filled.
    send(&address, &requests(0, 10 * PLACES.len(), key.trim()));
    state(&serving, &address);
    let (series, memory) = state(&serving, &address);
    send(&address, &requests(N, N, key.trim()));
    let (series_after, memory_after) = state(&serving, &address);
    let new: Vec<_> = series_after.iter().filter(|one| !series.contains(one)).take(10).collect();
    assert!(
        new.is_empty() && series.len() > 100,
        "{} became {}: {new:?}",
        series.len(),
        series_after.len()
    );
    assert!(memory_after < memory + ROOM_KIB, "{memory} KiB became {memory_after} KiB");
}
