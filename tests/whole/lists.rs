//! Every list, map, text and object of every request body, far too long or of another kind,
//! against a real server.
//!
//! The places come from `schemas/openapi.json`. A body has only what leads to its place; the
//! server must refuse it there, whatever else is missing, and grow by at most 64 MiB meanwhile.

use std::collections::BTreeMap;
use std::path::Path;

use palpate_tests::memory_kib;
use reqwest::{Client, Method, StatusCode};
use serde_json::Value;

use crate::command::Serving;
use crate::numbers::fields::{types, walk};

/// Length of a list or map of smallest items, bytes.
const LONG: usize = 8_000_000;
/// Memory by which the server may grow, KiB.
const ROOM_KIB: u64 = 64 << 10;
const JSON: &str = "application/json";
const MSGPACK: &str = "application/msgpack";

/// A place in the bodies of an operation, and what its schemas permit there.
struct Place {
    method: Method,
    path: String,
    pointer: String,
    content_types: Vec<String>,
    permitted: Vec<String>,
    /// The smallest item of its list.
    item: Option<Small>,
}

/// The smallest value of a type: in JSON, and its byte in MessagePack.
type Small = (&'static str, u8);

fn small(schema: &Value) -> Small {
    match types(schema).first() {
        Some(&"string") => ("\"\"", 0xa0),
        Some(&"array") => ("[]", 0x90),
        Some(&"number" | &"integer" | &"boolean") => ("0", 0),
        _ => ("{}", 0x80),
    }
}

/// All places, the root of a body with the pointer "".
fn places() -> Vec<Place> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../schemas/openapi.json");
    let description: Value = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
    let schemas = description["components"]["schemas"].as_object().unwrap();
    let mut found = Vec::new();
    for (path, item) in description["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let content = &operation["requestBody"]["content"];
            if content[JSON].is_null() {
                continue;
            }
            let mut of_body: BTreeMap<String, (Vec<String>, Option<Small>)> = BTreeMap::new();
            walk(&content[JSON]["schema"], "", schemas, 0, &mut |pointer, schema| {
                let (permitted, item) = of_body.entry(pointer.to_owned()).or_default();
                permitted.extend(types(schema).into_iter().map(str::to_owned));
                if schema["items"].is_object() {
                    *item = Some(small(&schema["items"]));
                }
                if schema["additionalProperties"].is_object() {
                    permitted.push("map".to_owned());
                }
            });
            let content_types = content.as_object().into_iter().flatten().map(|(name, _)| name);
            let content_types: Vec<String> = content_types.cloned().collect();
            let path: Vec<&str> = path
                .split('/')
                .map(|part| if part.starts_with('{') { "x" } else { part })
                .collect();
            found.extend(of_body.into_iter().map(|(pointer, (permitted, item))| Place {
                method: Method::from_bytes(method.to_uppercase().as_bytes()).unwrap(),
                path: path.join("/"),
                pointer,
                content_types: content_types.clone(),
                permitted,
                item,
            }));
        }
    }
    found
}

impl Place {
    /// A body with a value at this place and nothing beside it.
    fn json(&self, value: &str) -> Vec<u8> {
        let around = |inner: String, part: &str| match part {
            "*" => format!("[{inner}]"),
            name => format!("{{\"{name}\":{inner}}}"),
        };
        self.pointer
            .split('/')
            .skip(1)
            .collect::<Vec<_>>()
            .into_iter()
            .rev()
            .fold(value.to_owned(), around)
            .into_bytes()
    }

    fn msgpack(&self, value: &[u8]) -> Vec<u8> {
        let mut body = Vec::new();
        for part in self.pointer.split('/').skip(1) {
            if part == "*" {
                body.push(0x91);
            } else {
                body.extend([0x81, 0xa0 | part.len() as u8]);
                body.extend(part.as_bytes());
            }
        }
        body.extend(value);
        body
    }

    /// The values of this length that must be refused here, by content type, with words of the refusal.
    fn bodies(&self, long: usize) -> Vec<(&'static str, Vec<u8>, &'static str)> {
        let permits = |name: &str| self.permitted.iter().any(|one| one == name);
        let (mut json, mut packed): (Vec<(String, _)>, Vec<(Vec<u8>, _)>) =
            (Vec::new(), Vec::new());
        let length = |marker: u8, n: usize| {
            [&[marker][..], &u32::try_from(n).unwrap().to_be_bytes()].concat()
        };
        if let Some((item, byte)) = self.item {
            let n = long / (item.len() + 1);
            json.push((format!("[{item}{}]", format!(",{item}").repeat(n)), "expected at most"));
            packed.push(([length(0xdd, long), vec![byte; long]].concat(), "expected at most"));
        }
        if permits("map") {
            let n = long / 7;
            json.push((format!("{{\"a\":\"\"{}}}", ",\"b\":\"\"".repeat(n)), "expected at most"));
            let entries = b"\xa1a\xa0".repeat(long / 3);
            packed.push(([length(0xdf, long / 3), entries].concat(), "expected at most"));
        } else if permits("object") {
            json.push((format!("{{\"{}\":0}}", "a".repeat(long)), "expected at most"));
        }
        if permits("object") {
            json.extend(["[]", "[0,0]"].map(|list| (list.to_owned(), "expected an object")));
            packed.extend([
                (vec![0x90], "expected an object"),
                (vec![0x91, 0], "expected an object"),
            ]);
        }
        if permits("array") {
            json.push(("{\"0\":0}".to_owned(), "expected a list"));
            packed.push((b"\x81\xa10\x00".to_vec(), "expected a list"));
        }
        if !permits("array") && !permits("object") {
            json.push(("[0]".to_owned(), "came a list"));
            json.push(("{\"a\":null}".to_owned(), "came an object"));
            json.push((format!("\"{}\"", "a".repeat(long / 8)), "expected at most"));
            packed.push((vec![0x91, 0], "came a list"));
            packed.push((b"\x81\xa1a\xc0".to_vec(), "came an object"));
        }
        let json = json.into_iter().map(|(value, words)| (JSON, self.json(&value), words));
        let packed =
            packed.into_iter().map(|(value, words)| (MSGPACK, self.msgpack(&value), words));
        json.chain(packed.filter(|_| self.content_types.iter().any(|one| one == MSGPACK))).collect()
    }
}

/// Readings whose images are as long as permitted, of the shortest numbers.
fn full_images() -> Vec<u8> {
    let image = [&b"\x81\xa5image\xdd"[..], &16_384_u32.to_be_bytes(), &[0; 16_384]].concat();
    [&b"\x81\xa8readings\xdd"[..], &900_u32.to_be_bytes(), &image.repeat(900)].concat()
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn no_list_of_a_request_grows_beyond_its_bound() {
    let folder = tempfile::tempdir().unwrap();
    // What bodies take while they are here: else the allocator keeps those of the last second too.
    let serving = Serving::start_after(folder.path(), "export MIMALLOC_PURGE_DELAY=0");
    let _ = rustls::crypto::ring::default_provider().install_default();
    let client = Client::new();
    let send = async |method: Method, path: &str, content_type: &str, body: Vec<u8>| {
        let request = client.request(method, format!("{}{path}", serving.url));
        let request = request.header("content-type", content_type).header("if-match", "\"1\"");
        let response = request.body(body).send().await.unwrap();
        (response.status(), response.json::<Value>().await.unwrap_or_default())
    };
    // The program's own pages, which count as memory, are read in by short bodies.
    for place in places() {
        for (content_type, body, _) in place.bodies(LONG / 1000) {
            send(place.method.clone(), &place.path, content_type, body).await;
        }
    }
    let before = memory_kib(serving.process(), "VmHWM").unwrap();
    let (mut faults, mut n) = (Vec::new(), 0);
    for place in places() {
        for (content_type, body, words) in place.bodies(LONG) {
            n += 1;
            let shown = String::from_utf8_lossy(&body[..body.len().min(60)]).into_owned();
            let (status, answer) =
                send(place.method.clone(), &place.path, content_type, body).await;
            let pointer = place.pointer.replace('*', "0");
            let said = answer["errors"].as_array().and_then(|errors| {
                let at = errors.iter().find(|error| {
                    error["pointer"].as_str().is_some_and(|at| at.starts_with(&pointer))
                });
                at?["detail"].as_str()
            });
            let is_refused = said.is_some_and(|said| said.contains(words) && said.len() < 1000)
                && answer.to_string().len() < 4000;
            if status != StatusCode::UNPROCESSABLE_ENTITY || !is_refused {
                let Place { method, path, .. } = &place;
                faults.push(format!("{method} {path} {pointer} {content_type} {shown}: {answer}"));
            }
        }
    }
    let grown = memory_kib(serving.process(), "VmHWM").unwrap() - before;
    let path = "/v1/sessions/x/readings";
    let (status, answer) = send(Method::POST, path, MSGPACK, full_images()).await;
    assert_eq!(status, StatusCode::PAYLOAD_TOO_LARGE, "{answer}");
    assert!(faults.is_empty(), "{} of {n}: {faults:#?}", faults.len());
    assert!(grown <= ROOM_KIB, "{n} bodies: {grown} KiB more");
    assert!(n > 1000, "{n} bodies");
}
