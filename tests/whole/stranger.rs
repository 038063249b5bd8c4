//! Invented values of everything that a request can carry, with and without a key. The memory of a
//! real server must be as before after the values of each place in a request, its metrics in the
//! end.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use palpate_tests::memory_kib;

use crate::command::Serving;

/// Length of an invented value.
const VALUE_BYTES: usize = 4_000;
/// Number of values of a place by the part of a value in it: those in full are 2 MB together;
/// shorter ones weigh more in memory than their text, once each is kept.
const LONG_N: usize = 500;
const SHORT_N: usize = 2_000;
/// Rounds of a place: caches and pools grow in some, what is kept grows in all.
const ROUNDS: usize = 6;
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

/// Bytes of a value that a place carries.
fn carried(place: Place) -> usize {
    let (head, rest) = place(&"~".repeat(VALUE_BYTES));
    let n = head.matches('~').count().max(rest.matches('~').count());
    assert!(n >= 12, "{head}{rest}");
    n
}

/// The requests of a place with values number `from` to `from + n`, for both callers in turn.
fn requests(place: Place, from: usize, n: usize, key: &str) -> Vec<String> {
    let request = |number: usize| {
        // Different in every part.
        let spread = (number as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let value = format!("{spread:016x}").repeat(VALUE_BYTES / 16);
        let (head, rest) = place(&value);
        let has_key = number % 2 == 1 && !rest.starts_with("Authorization");
        let key = if has_key { format!("\r\nAuthorization: Bearer {key}") } else { String::new() };
        let end = if rest.contains("\r\n\r\n") { "" } else { "\r\n\r\n" };
        format!("{head}{key}\r\n{rest}{end}")
    };
    (from..from + n).map(request).collect()
}

/// Sends requests, several on a connection at once; a refusal may end it, then the rest follow
/// on another.
fn send(address: &str, requests: &[String]) {
    let mut rest = requests;
    while !rest.is_empty() {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
        let now = &rest[..rest.len().min(AT_ONCE)];
        let _ = stream.write_all(now.concat().as_bytes());
        rest = &rest[n_answered(&mut stream, now.len()).max(1)..];
    }
}

/// Reads at most `n` answers, until the connection ends; their number.
fn n_answered(stream: &mut TcpStream, n: usize) -> usize {
    let (mut heard, mut block, mut found) = (Vec::new(), [0; 65_536], 0);
    while found < n {
        if let Some(at) = heard.windows(4).position(|four| four == b"\r\n\r\n") {
            let head = String::from_utf8_lossy(&heard[..at]).to_ascii_lowercase();
            let length = head.lines().find_map(|line| line.strip_prefix("content-length: "));
            let end = at + 4 + length.map_or(0, |length| length.parse().unwrap());
            if heard.len() >= end {
                found += 1;
                if head.contains("connection: close") {
                    break;
                }
                heard.drain(..end);
                continue;
            }
        }
        match stream.read(&mut block) {
            Ok(n) if n > 0 => heard.extend_from_slice(&block[..n]),
            _ => break,
        }
    }
    found
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
    // Caches and pools are filled.
    for place in PLACES {
        send(&address, &requests(place, 0, 20, key.trim()));
    }
    state(&serving, &address);
    let (series, mut memory) = state(&serving, &address);
    let (mut faults, mut from) = (Vec::new(), 1_000);
    for (number, place) in PLACES.into_iter().enumerate() {
        let carried = carried(place);
        let n = if carried < VALUE_BYTES / 2 { SHORT_N } else { LONG_N };
        // A quarter of the values as they came: one of the callers' values may be kept alone.
        let room = (n * carried / 4 / 1024) as u64;
        let mut grown = Vec::new();
        while grown.len() < ROUNDS && grown.last().is_none_or(|grown| *grown > room) {
            send(&address, &requests(place, from, n, key.trim()));
            from += n;
            let (_, now) = state(&serving, &address);
            grown.push(now.saturating_sub(memory));
            memory = now;
        }
        println!("place {number}: {n} values of {carried} bytes, {grown:?} KiB");
        if grown.last().is_some_and(|grown| *grown > room) {
            faults.push(format!("place {number}, {n} values of {carried} bytes: {grown:?} KiB"));
        }
    }
    let (series_after, _) = state(&serving, &address);
    let new: Vec<_> = series_after.iter().filter(|one| !series.contains(one)).take(10).collect();
    assert!(
        new.is_empty() && series.len() > 100,
        "{} became {}: {new:?}",
        series.len(),
        series_after.len()
    );
    assert!(faults.is_empty(), "{faults:#?}");
}
