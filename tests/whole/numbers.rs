//! Every number in a request, at its smallest and its largest value, against a real server.
//!
//! The server must answer within ten seconds of two cores and within a gigabyte, and stay alive; it
//! must abandon slow work within a second after its caller hangs up. Seconds are processor time of
//! the server, which does not depend on the load of the machine, but does on its speed. The fields
//! come from `schemas/openapi.json`, the requests around them from a table here; the test fails
//! for a number that no request has. Not here: the content of the answers.

pub(crate) mod fields;
pub(crate) mod requests;

use std::path::Path;
use std::time::Duration;

use futures::stream::{self, StreamExt};
use palpate_tests::{memory_kib, processor_seconds};
use reqwest::{Client, Method, StatusCode};
use serde_json::{Value, json};

use crate::command::Serving;
use fields::{Field, operations};
use requests::{Base, bases, placeholders};

/// Maximum processor time that the server uses until an answer, for all requests under way: ten
/// seconds of two cores.
const ANSWERED_WITHIN_CORE_SECONDS: f64 = 20.0;
/// Time after which a client gives up; it only ends a test that hangs.
const PATIENCE: Duration = Duration::from_secs(1800);
/// Memory that the server may take beyond its idle size, KiB.
const ROOM_KIB: u64 = 1 << 20;
/// Number of concurrent requests.
const AT_ONCE: usize = 2;
/// Maximum time of a training before it is cancelled.
const TRAINING: Duration = Duration::from_secs(2);

/// Processor time above which a request is repeated by a caller who hangs up.
const SLOW_CORE_SECONDS: f64 = 0.4;
/// Time until that caller hangs up.
const HUNG_UP: Duration = Duration::from_millis(150);
/// Maximum processor time that the server uses after its caller has gone: one second of two
/// cores.
const WORKED_ON_CORE_SECONDS: f64 = 2.0;
/// Duration of a measurement of it, and the share of one core that housekeeping may use.
const WATCHED: Duration = Duration::from_millis(500);
/// Minimum number of measurements: work may begin late.
const WATCHES: usize = 3;
const HOUSEKEEPING: f64 = 0.3;

/// A server and its client.
pub(crate) struct Asked {
    client: Client,
    url: String,
}

/// One request with one number changed.
struct Case {
    name: String,
    method: Method,
    path: String,
    body: Option<Value>,
}

impl Asked {
    pub(crate) fn new(url: &str) -> Self {
        Self::within(url, PATIENCE)
    }

    /// A client that waits no longer than `patience` for an answer, then hangs up.
    fn within(url: &str, patience: Duration) -> Self {
        // Another test of this binary may have been quicker.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let client = Client::builder().timeout(patience).build().unwrap();
        Self { client, url: url.to_owned() }
    }

    /// Sends a request; its status and body.
    pub(crate) async fn send(
        &self,
        method: &Method,
        path: &str,
        body: Option<&Value>,
    ) -> Result<(StatusCode, Value), reqwest::Error> {
        let mut request = self.client.request(method.clone(), format!("{}{path}", self.url));
        if let Some(body) = body {
            request = request.json(body).header("if-match", "\"1\"");
        }
        let response = request.send().await?;
        let (status, bytes) = (response.status(), response.bytes().await?);
        Ok((status, serde_json::from_slice(&bytes).unwrap_or_default()))
    }

    /// Sends a request that must succeed.
    pub(crate) async fn must(&self, method: Method, path: &str, body: Option<&Value>) -> Value {
        let (status, value) = self.send(&method, path, body).await.unwrap();
        assert!(status.is_success(), "{method} {path}: {status} {value}");
        value
    }

    /// Stores an object's mesh.
    pub(crate) async fn put_mesh(&self, object: &str, stl: Vec<u8>) {
        let url = format!("{}/v1/objects/{object}/mesh?format=stl&unit=m", self.url);
        let put = self.client.put(url).header("content-type", "application/octet-stream");
        assert!(put.body(stl).send().await.unwrap().status().is_success());
    }

    /// Waits for the end of a training, or cancels it when it takes too long.
    pub(crate) async fn end(&self, job: &Value, within: Duration) -> String {
        let path = format!("/v1/jobs/{}", job["id"].as_str().unwrap());
        let begun = std::time::Instant::now();
        let mut is_cancelled = false;
        loop {
            let shown = self.must(Method::GET, &path, None).await;
            let state = shown["state"].as_str().unwrap().to_owned();
            if !matches!(state.as_str(), "queued" | "running") {
                return state;
            }
            if begun.elapsed() > within && !is_cancelled {
                // It may have ended by itself meanwhile.
                let cancelled = self.send(&Method::POST, &format!("{path}/cancel"), None).await;
                let (status, value) = cancelled.unwrap();
                assert!(status.is_success() || status == StatusCode::CONFLICT, "{status} {value}");
                is_cancelled = true;
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }

    /// Sends a request that must not stop or stall the server; its status, body and the processor
    /// time until its answer.
    async fn ask(
        &self,
        name: &str,
        process: u32,
        (method, path, body): (&Method, &str, Option<&Value>),
    ) -> Result<(StatusCode, Value, f64), String> {
        let before = processor_seconds(process).unwrap();
        let answer = self.send(method, path, body).await;
        let (status, answer) = answer.map_err(|error| format!("{name}: no answer: {error:?}"))?;
        let used = processor_seconds(process).unwrap_or(before) - before;
        is_fine(name, status, &answer)?;
        match used <= ANSWERED_WITHIN_CORE_SECONDS {
            true => Ok((status, answer, used)),
            false => Err(format!("{name}: answered after {used:.1} core seconds")),
        }
    }

    /// Runs a case to its end: a new session is used, a training is waited for. The most processor
    /// time of an answer.
    async fn play(&self, case: &Case, process: u32) -> Result<f64, String> {
        let Case { name, method, path, body } = case;
        let (status, made, mut most) =
            self.ask(name, process, (method, path, body.as_ref())).await?;
        if status == StatusCode::ACCEPTED {
            self.end(&made, TRAINING).await;
        }
        if status == StatusCode::CREATED && path == "/v1/sessions" {
            let session = format!("/v1/sessions/{}", made["id"].as_str().unwrap_or_default());
            let readings = requests::readings(&made["catalogue"]);
            let uses = [
                (Method::POST, "readings", Some(&readings)),
                (Method::GET, "belief?poses=100", None),
                (Method::GET, "marginals", None),
                (Method::DELETE, "", None),
            ];
            for (method, what, body) in uses {
                let name = format!("{name}, then {method} {what}");
                let path = format!("{session}/{what}");
                let request = (&method, path.trim_end_matches('/'), body);
                let (.., used) = self.ask(&name, process, request).await?;
                most = most.max(used);
            }
        }
        if status == StatusCode::CREATED && path == "/v1/sensors" {
            let training = requests::training_with(&made["name"]);
            let name = format!("{name}, then a training with it");
            let path = "/v1/catalogues/probing/trainings";
            let request = (&Method::POST, path, Some(&training));
            let (status, job, _) = self.ask(&name, process, request).await?;
            if status == StatusCode::ACCEPTED {
                self.end(&job, TRAINING).await;
            }
        }
        Ok(most)
    }
}

/// Runs the slow cases with a caller who hangs up, and names those that keep the server busy.
async fn hang_up(url: &str, process: u32, slow: &[&Case]) -> Vec<String> {
    let hasty = Asked::within(url, HUNG_UP);
    let mut faults = Vec::new();
    for case in slow {
        // The first run checked the answer.
        let _ = hasty.play(case, process).await;
        let mut used = 0.0;
        for watch in 1.. {
            let before = processor_seconds(process).unwrap();
            tokio::time::sleep(WATCHED).await;
            let more = processor_seconds(process).unwrap() - before;
            let is_idle = more <= HOUSEKEEPING * WATCHED.as_secs_f64();
            if is_idle && watch >= WATCHES {
                break;
            }
            used += more;
            if used > WORKED_ON_CORE_SECONDS {
                faults.push(format!("{}: works on after its caller left", case.name));
                break;
            }
        }
    }
    faults
}

/// A refusal or a stated bound is fine; a fault of the server is not.
fn is_fine(name: &str, status: StatusCode, answer: &Value) -> Result<(), String> {
    let overloaded = "urn:palpate:problem:overloaded";
    let is_fine = !status.is_server_error()
        || (status == StatusCode::SERVICE_UNAVAILABLE && answer["type"] == overloaded);
    if is_fine { Ok(()) } else { Err(format!("{name}: {status} {answer}")) }
}

/// Whether a number just beyond a limit is refused, in few digits that are beyond it, too. A
/// refusal for another reason says nothing of the number.
fn is_told(case: &Case, limit: f64, status: StatusCode, answer: &Value) -> Result<(), String> {
    let error = &answer["errors"][0];
    let field = error["pointer"].as_str().and_then(|pointer| pointer.rsplit('/').next());
    let own = case.name.split(" = ").next().and_then(|pointer| pointer.rsplit('/').next());
    let is_elsewhere = field != own;
    if status.is_client_error() && (status != StatusCode::UNPROCESSABLE_ENTITY || is_elsewhere) {
        return Ok(());
    }
    let told = error["detail"].as_str().unwrap_or_default();
    let mut numbers = told.split([' ', ',']).filter_map(|word| word.parse::<f64>().ok());
    let is_long = told
        .split(|c: char| !c.is_ascii_digit())
        .any(|digits| digits.trim_start_matches('0').len() > 17);
    let is_told = numbers.next().is_some_and(|found| found.to_bits() != limit.to_bits());
    if status.is_client_error() && is_told && !is_long {
        return Ok(());
    }
    Err(format!("{}, beyond {limit}: {status} {told:?}", case.name))
}

/// The cases of a field in a request that has it.
fn cases(base: &Base, field: &Field, values: &[Value]) -> Vec<Case> {
    let with = |bound: &Value| {
        let name = format!("{} {} {} = {bound}", base.method, base.path, field.pointer);
        let (mut path, mut body) = (base.path.clone(), base.body.clone());
        match (&field.place, &mut body) {
            (fields::Place::Body, Some(body)) => *field.find(body)? = bound.clone(),
            (fields::Place::Body, None) => return None,
            (fields::Place::Query, _) => path = format!("{path}?{}={bound}", field.pointer),
            (fields::Place::Path, _) => return None,
        }
        // A name already in use must not make the request fail.
        if let Some(made) = body.as_mut().and_then(|body| body.get_mut("name")) {
            let unique: String = name.chars().filter(char::is_ascii_alphanumeric).collect();
            *made = json!(unique[unique.len().saturating_sub(60)..]);
        }
        Some(Case { name, method: base.method.clone(), path, body })
    };
    values.iter().filter_map(with).collect()
}

/// Whether a case waits for a job.
fn has_training(path: &str) -> bool {
    path.ends_with("/trainings") || path.ends_with("/calibrations") || path == "/v1/sensors"
}

/// All cases, those just beyond a limit, and the fields that no request of the table has.
fn all_cases(placeholders: &[(String, Vec<String>)]) -> (Vec<Case>, Vec<(Case, f64)>, Vec<String>) {
    let description = Path::new(env!("CARGO_MANIFEST_DIR")).join("../schemas/openapi.json");
    let description: Value = serde_json::from_slice(&std::fs::read(description).unwrap()).unwrap();
    let (mut found, mut beyond, mut missing) = (Vec::new(), Vec::new(), Vec::new());
    for operation in operations(&description) {
        let bases = bases(&operation, placeholders);
        for field in &operation.fields {
            if field.place == fields::Place::Path {
                let bound = |bound: &Value| Case {
                    name: format!("{} {} {}", operation.method, operation.path, field.pointer),
                    method: operation.method.clone(),
                    path: requests::with_number(
                        &operation.path,
                        &field.pointer,
                        bound,
                        placeholders,
                    ),
                    body: None,
                };
                found.extend(field.bounds.iter().map(bound));
                continue;
            }
            let own = bases.iter().flat_map(|base| cases(base, field, &field.bounds));
            let own: Vec<Case> = own.collect();
            for (limit, number) in &field.beyond {
                let number = [json!(number)];
                let own = bases.iter().flat_map(|base| cases(base, field, &number));
                beyond.extend(own.map(|case| (case, *limit)));
            }
            if own.is_empty() {
                missing.push(format!("{} {} {}", operation.method, operation.path, field.pointer));
            }
            found.extend(own);
        }
    }
    (found, beyond, missing)
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn no_number_in_a_request_stops_or_stalls_the_server() {
    let folder = tempfile::tempdir().unwrap();
    let mut serving = Serving::start(folder.path(), &[]);
    requests::set_up(&Asked::new(&serving.url)).await;
    let idle_kib = memory_kib(serving.process(), "VmSize").unwrap();
    let (ended, log) = tokio::task::spawn_blocking(move || serving.stop()).await.unwrap();
    assert!(ended.success(), "{log}");

    let mut serving = Serving::start_within(folder.path(), &[], idle_kib + ROOM_KIB);
    let asked = Asked::new(&serving.url);
    let placeholders = placeholders(&asked).await;
    let (cases, beyond, missing) = all_cases(&placeholders);
    assert!(missing.is_empty(), "no request of the table has these numbers: {missing:#?}");
    assert!(cases.len() > 300, "{} cases", cases.len());
    // Trainings run one at a time: they come last, one after the other.
    let (trainings, quick): (Vec<Case>, Vec<Case>) =
        cases.into_iter().partition(|case| has_training(&case.path));
    let process = serving.process();
    let playing = stream::iter(&quick).map(async |case| (case, asked.play(case, process).await));
    let played: Vec<(&Case, Result<f64, String>)> =
        playing.buffer_unordered(AT_ONCE).collect().await;
    let is_slow = |used: &f64| *used > SLOW_CORE_SECONDS;
    let slow = played.iter().filter(|(_, played)| played.as_ref().is_ok_and(is_slow));
    let slow: Vec<&Case> = slow.map(|(case, _)| *case).collect();
    let mut faults = hang_up(&serving.url, process, &slow).await;
    faults.extend(played.into_iter().filter_map(|(_, played)| played.err()));
    for (case, limit) in &beyond {
        let (status, answer) =
            asked.send(&case.method, &case.path, case.body.as_ref()).await.unwrap();
        faults.extend(is_told(case, *limit, status, &answer).err());
    }
    for case in &trainings {
        faults.extend(asked.play(case, process).await.err());
    }
    let alive = asked.send(&Method::GET, "/readyz", None).await;
    let alive = alive.map(|(status, _)| status);
    let log = if matches!(alive, Ok(StatusCode::OK)) { String::new() } else { serving.stop().1 };
    assert!(matches!(alive, Ok(StatusCode::OK)), "{alive:?} {faults:#?} {log}");
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn fields_are_found_at_any_depth_of_a_schema() {
    let description = json!({
        "paths": {"/a": {"post": {"requestBody": {"content": {"application/json": {
            "schema": {"$ref": "#/components/schemas/A"}}}}, "parameters": [
            {"name": "n", "in": "query", "schema": {"type": "integer", "minimum": 1}}]}}},
        "components": {"schemas": {
            "A": {"type": "object", "properties": {"list": {"type": ["array", "null"],
                "items": {"oneOf": [{"type": "null"}, {"$ref": "#/components/schemas/B"}]}}}},
            "B": {"properties": {"x": {"type": ["number", "null"], "maximum": 2.5}}}}}});
    let operation = operations(&description).remove(0);
    let fields: Vec<(&str, &[Value])> =
        operation.fields.iter().map(|field| (&field.pointer[..], &field.bounds[..])).collect();
    let expected =
        [("n", [json!(1), json!(i64::from(i32::MAX))]), ("/list/*/x", [json!(-1e308), json!(2.5)])];
    assert_eq!(fields.len(), 2);
    for ((pointer, bounds), (expected, numbers)) in fields.into_iter().zip(&expected) {
        assert_eq!((pointer, bounds), (*expected, &numbers[..]));
    }
    let mut body = json!({"list": [{"x": null}]});
    *operation.fields[1].find(&mut body).unwrap() = json!(7);
    assert_eq!(body, json!({"list": [{"x": 7}]}));
}
