//! Tests of forwarded sessions: order, repetitions, refusals, and what a cell fetches.

use std::sync::LazyLock;
use std::time::UNIX_EPOCH;

use palpate_core::pose::Pose;
use palpate_server::Forward;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{Answer, CUBE, Harness, content, quiet_reading, touches};

/// Id of the session: of a minute before the first use.
static ID: LazyLock<String> = LazyLock::new(|| id_at(now_ms() - 60_000));

pub(crate) fn now_ms() -> u64 {
    u64::try_from(UNIX_EPOCH.elapsed().unwrap().as_millis()).unwrap()
}

/// A `UUIDv7` of a time, ms since 1970.
pub(crate) fn id_at(ms: u64) -> String {
    let time = format!("{ms:012x}");
    format!("{}-{}-774b-bcce-b302099a8057", &time[..8], &time[8..])
}

/// A server with a trained catalogue, to which cells forward.
struct Central {
    it: Harness,
    hash: String,
}

impl Central {
    async fn start() -> Self {
        let it = Harness::trained().await;
        let package = it.get("/v1/catalogues/default/versions/1/package").await.expect(200);
        Self { hash: package["hash"].as_str().unwrap().to_owned(), it }
    }

    fn session(&self) -> Value {
        json!({"cell": "cell-7", "version_hash": self.hash,
            "session": {"catalogue": "default", "version": 1, "risk": 0.05, "ttl_s": 1}})
    }

    async fn put(&self, id: &str, body: &Value) -> Answer {
        let body = Some(("application/json", body.to_string().into_bytes()));
        self.it.send(Method::PUT, &format!("/v1/sessions/{id}"), body).await
    }

    async fn entries(&self, from: u32, entries: &[Value]) -> Answer {
        let body = json!({"from": from, "entries": entries});
        self.it.post(&format!("/v1/sessions/{}/forwarded", *ID), &body).await
    }

    async fn belief(&self, session: &str) -> Value {
        content(&self.it.get(&format!("/v1/sessions/{session}/belief")).await.expect(200))
    }
}

fn reading(reading: &Value) -> Value {
    json!({ "reading": reading })
}

/// Presses of a cube without ids.
fn presses() -> Vec<Value> {
    touches(CUBE, 6, 5, Pose::IDENTITY)
}

#[tokio::test(flavor = "multi_thread")]
async fn forwarded_entries_count_once_at_their_numbers() {
    let central = Central::start().await;
    let made = central.put(&ID, &central.session()).await.expect(200);
    assert_eq!(
        (&made["id"], &made["cell"], &made["revision"]),
        (&json!(*ID), &json!("cell-7"), &json!(0))
    );
    assert_eq!((&made["ttl_s"], &made["expires_at"]), (&Value::Null, &Value::Null));
    assert_eq!(central.put(&ID, &central.session()).await.expect(200)["id"], *ID);

    let all: Vec<Value> = presses().iter().map(reading).collect();
    let first = central.entries(0, &all[..3]).await.expect(200);
    assert_eq!((&first["n_new"], &first["revision"]), (&json!(3), &json!(3)));
    // The answer was lost: the same again, then with more behind it.
    let again = central.entries(0, &all[..3]).await.expect(200);
    assert_eq!((&again["n_new"], &again["revision"]), (&json!(0), &json!(3)));
    let more = [&all[1..], &[json!({"retracts": 2})]].concat();
    let overlapping = central.entries(1, &more).await.expect(200);
    assert_eq!((&overlapping["n_new"], &overlapping["revision"]), (&json!(4), &json!(7)));

    // The belief is that of the same readings sent directly.
    let direct = central.it.session(json!({"risk": 0.05})).await;
    let path = format!("/v1/sessions/{direct}/readings");
    central.it.post(&path, &json!({"readings": presses()})).await.expect(200);
    central.it.send(Method::DELETE, &format!("{path}/2"), None).await.expect(200);
    assert_eq!(central.belief(&ID).await, central.belief(&direct).await);
    let shown = central.it.get(&format!("/v1/sessions/{}", *ID)).await.expect(200);
    assert_eq!((&shown["n_readings"], &shown["n_retracted"]), (&json!(5), &json!(1)));
    let of_cell = central.it.get("/v1/sessions?cell=cell-7").await.expect(200);
    assert_eq!(of_cell["items"].as_array().unwrap().len(), 1);
    let of_other = central.it.get("/v1/sessions?cell=cell-8").await.expect(200);
    assert_eq!(of_other["items"], json!([]));

    // A closed session still tells a repetition apart from something new.
    central
        .it
        .post(&format!("/v1/sessions/{}/close", *ID), &json!({"object": "cube"}))
        .await
        .expect(200);
    assert_eq!(central.entries(1, &more).await.expect(200)["revision"], 7);
    central.entries(7, &all[..1]).await.problem(410, "session-ended", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn entries_that_do_not_follow_or_differ_are_refused() {
    let central = Central::start().await;
    central.put(&ID, &central.session()).await.expect(200);
    let all: Vec<Value> = presses().iter().map(reading).collect();
    central.entries(0, &all[..2]).await.expect(200);
    central.entries(3, &all[3..]).await.problem(409, "wrong-state", None);
    central.entries(1, &all[2..]).await.problem(409, "conflict", None);
    let pointer = Some("/entries/0/retracts");
    central.entries(2, &[json!({"retracts": 2})]).await.problem(422, "invalid-value", pointer);
    let both = json!({"reading": all[2]["reading"], "retracts": 0});
    let neither = json!({});
    for wrong in [both, neither] {
        central.entries(2, &[wrong]).await.problem(422, "invalid-value", Some("/entries/0"));
    }
    central.entries(2, &[]).await.problem(422, "invalid-value", Some("/entries"));
    let mut unknown = quiet_reading();
    unknown["sensor"] = json!("nothing");
    let refused = central.entries(2, &[reading(&unknown)]).await;
    refused.problem(422, "invalid-value", Some("/entries/0/reading/sensor"));
    // All or nothing: the good one before a bad one is not stored either.
    central.entries(2, &[all[2].clone(), json!({"retracts": 9})]).await.problem(
        422,
        "invalid-value",
        None,
    );
    let shown = central.it.get(&format!("/v1/sessions/{}", *ID)).await.expect(200);
    assert_eq!(shown["revision"], 2);

    // Only its cell writes to it, and a cell writes to no other session.
    let body = json!({"readings": [quiet_reading()]});
    let direct = central.it.post(&format!("/v1/sessions/{}/readings", *ID), &body).await;
    assert!(
        direct.problem(409, "wrong-state", None)["detail"].as_str().unwrap().contains("cell-7")
    );
    let path = format!("/v1/sessions/{}/readings/0", *ID);
    central.it.send(Method::DELETE, &path, None).await.problem(409, "wrong-state", None);
    let own = central.it.session(json!({})).await;
    central.put(&own, &central.session()).await.problem(409, "wrong-state", None);
    let other = json!({"cell": "cell-8", "version_hash": central.hash,
        "session": {"catalogue": "default", "version": 1}});
    central.put(&ID, &other).await.problem(409, "wrong-state", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn sessions_on_other_versions_are_refused_by_name() {
    let central = Central::start().await;
    let with = |field: &str, value: Value| {
        let mut body = central.session();
        body["session"][field] = value;
        body
    };
    let refused =
        central.put(&ID, &with("version", json!(4))).await.problem(404, "not-found", None);
    assert!(refused["detail"].as_str().unwrap().contains("version 4"), "{refused}");
    central.put(&ID, &with("catalogue", json!("own"))).await.problem(404, "not-found", None);
    let pointer = Some("/session/version");
    central.put(&ID, &with("version", Value::Null)).await.problem(422, "invalid-value", pointer);
    let mut other = central.session();
    other["version_hash"] = json!("0".repeat(64));
    let refused = central.put(&ID, &other).await.problem(409, "wrong-state", None);
    assert!(refused["detail"].as_str().unwrap().contains("another content"), "{refused}");
    let no_v7 = "01890a5d-ac96-474b-bcce-b302099a8057";
    let pointer = Some("path:session");
    central.put(no_v7, &central.session()).await.problem(422, "invalid-value", pointer);
    central.it.get(&format!("/v1/sessions/{}", *ID)).await.problem(404, "not-found", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cell_finds_what_waits_again_after_a_restart() {
    let forward = Forward {
        to: "http://127.0.0.1:9".to_owned(),
        cell: "cell-7".to_owned(),
        catalogues: vec!["default".to_owned()],
    };
    let forward = Some(forward);
    let it = Harness::trained_with(|config| config.forward.clone_from(&forward)).await;
    let session = it.session(json!({"unknown_prior": 0.2, "labels": {"shift": "night"}})).await;
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &json!({"readings": presses()})).await.expect(200);
    it.post(&format!("/v1/sessions/{session}/close"), &json!({"object": "cube"})).await.expect(200);
    let mut it = it.restart_with(|config| config.forward.clone_from(&forward)).await;
    let state = it.get("/v1/forwarding").await.expect(200);
    // The seventh entry is the end.
    assert_eq!((&state["sessions_waiting"], &state["cell"]), (&json!(1), &json!("cell-7")));

    let outbox = it.server.take_outbox().unwrap();
    let id = session.parse().unwrap();
    assert_eq!(outbox.waiting(None, 9), [id]);
    let outgoing = outbox.session(id).await.unwrap().unwrap();
    let request = serde_json::to_value(outgoing.request()).unwrap();
    let settings = json!({"catalogue": "default", "version": 1, "method": "surface",
        "unknown_prior": 0.2, "labels": {"shift": "night"}});
    assert_eq!(request["session"], settings);
    assert_eq!(outgoing.n_entries(), 6);
    assert!(outgoing.closing().unwrap().object.is_some());
    let entries = outbox.entries(id, 2).await.unwrap();
    assert_eq!(entries.len(), 4, "the end is no entry to forward");
    assert_eq!(entries[0].reading.as_ref().unwrap().sensor, "digitacts-6x6");
    // A label that is set meanwhile keeps it waiting.
    let labels = Some(("application/json", br#"{"labels": {"shift": "day"}}"#.to_vec()));
    it.send(Method::PUT, &format!("/v1/sessions/{session}/labels"), labels).await.expect(200);
    outbox.forwarded(&outgoing).await.unwrap();
    assert_eq!(outbox.waiting(None, 9), [id]);
    let outgoing = outbox.session(id).await.unwrap().unwrap();
    outbox.forwarded(&outgoing).await.unwrap();
    assert!(outbox.waiting(None, 9).is_empty());
    drop(outbox);
    // Forwarded once is forwarded, unless there is another central service.
    it = it.restart_with(|config| config.forward.clone_from(&forward)).await;
    assert_eq!(it.get("/v1/forwarding").await.expect(200)["sessions_waiting"], 0);
    let elsewhere = forward.map(|it| Forward { to: "http://127.0.0.1:8".to_owned(), ..it });
    it = it.restart_with(|config| config.forward = elsewhere).await;
    assert_eq!(it.get("/v1/forwarding").await.expect(200)["sessions_waiting"], 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cell_takes_versions_and_sensors_over_as_they_are() {
    let central = Central::start().await;
    let forward = Forward {
        to: central.it.server.address(),
        cell: "cell-7".to_owned(),
        catalogues: vec!["default".to_owned()],
    };
    let mut cell = Harness::start_with(|config| config.forward = Some(forward)).await;
    let outbox = cell.server.take_outbox().unwrap();
    let get = async |path: &str| central.it.get(path).await.expect(200);
    let path = "/v1/catalogues/default/versions/1";
    let package = serde_json::from_value(get(&format!("{path}/package")).await).unwrap();
    let mut incoming = outbox.incoming(&package).await.unwrap().unwrap();
    assert!(outbox.adopt(&incoming).await.unwrap_err().to_string().contains("is missing"));
    for hash in incoming.missing() {
        let url = central.it.url(&format!("{path}/blocks/{hash}"));
        let block = central.it.client.get(url).send().await.unwrap().bytes().await.unwrap();
        let forged = outbox.block(&mut incoming, &block[1..]).await.unwrap_err().to_string();
        assert!(forged.contains("another content"), "{forged}");
        outbox.block(&mut incoming, &block).await.unwrap();
    }
    outbox.adopt(&incoming).await.unwrap();
    assert!(outbox.incoming(&package).await.unwrap().is_none());
    let here = cell.get(path).await.expect(200);
    assert_eq!(here, get(path).await);

    let probe = json!({"name": "probe", "preset": "digitacts-6x6"});
    central.it.post("/v1/sensors", &probe).await.expect(201);
    let package = serde_json::from_value(get("/v1/sensors/probe/package").await).unwrap();
    outbox.sensor(&package).await.unwrap();
    outbox.sensor(&package).await.unwrap();
    assert_eq!(cell.get("/v1/sensors/probe").await.expect(200)["name"], "probe");
    assert_eq!(outbox.state().sensors, []);
    // A sensor of its own under the same name stays, and is named.
    let other = json!({"name": "other", "preset": "digitacts-6x6-thin"});
    cell.post("/v1/sensors", &other).await.expect(201);
    let there = json!({"name": "other", "preset": "digitacts-6x6"});
    central.it.post("/v1/sensors", &there).await.expect(201);
    let package = serde_json::from_value(get("/v1/sensors/other/package").await).unwrap();
    outbox.sensor(&package).await.unwrap();
    assert_eq!(outbox.state().sensors[0].name, "other");
}
