//! Tests of authorship: keys of readings, names of robots, numbers per key, and limits of a key.

use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use palpate_server::Access;
use palpate_store::database::Database;
use palpate_store::sled::{SledEngine, SledOptions};
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{Answer, Harness, quiet_reading, read};

fn readings(robot: &str, seq: u64) -> Value {
    let mut reading = quiet_reading();
    (reading["robot"], reading["seq"]) = (json!(robot), json!(seq));
    json!({ "readings": [reading] })
}

/// A server with a session and two robots' keys.
struct Lab {
    it: Harness,
    admin: Option<String>,
    session: String,
}

impl Lab {
    async fn new() -> Self {
        let it = Harness::guarded_and_trained().await;
        let session = it.session(json!({})).await;
        Self { admin: it.key.clone(), it, session }
    }

    async fn post(&mut self, key: &str, robot: &str, seq: u64) -> Answer {
        self.it.key = Some(key.to_owned());
        let path = format!("/v1/sessions/{}/readings", self.session);
        let answer = self.it.post(&path, &readings(robot, seq)).await;
        self.it.key.clone_from(&self.admin);
        answer
    }

    async fn readings(&self) -> Vec<Value> {
        let page = self.it.get(&format!("/v1/sessions/{}/readings", self.session)).await;
        page.expect(200)["items"].as_array().unwrap().clone()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robots_name_belongs_to_the_key_that_used_it_first() {
    let mut lab = Lab::new().await;
    let a = lab.it.new_key("key-a", "robot").await;
    let b = lab.it.new_key("key-b", "robot").await;
    lab.post(&a, "arm-A", 0).await.expect(200);
    let refused = lab.post(&b, "arm-A", 1).await;
    let problem = refused.problem(403, "forbidden", Some("/readings/0/robot"));
    assert!(problem["detail"].as_str().unwrap().contains("arm-A"), "{problem}");
    // Its own next number stays valid.
    assert_eq!(lab.post(&a, "arm-A", 1).await.expect(200)["n_new"], 1);
    assert_eq!(lab.post(&b, "arm-B", 1).await.expect(200)["n_new"], 1);
    let found = lab.it.get("/v1/audit?ring=refused").await.expect(200)["items"].clone();
    assert_eq!(
        (&found[0]["operation"], &found[0]["key_name"]),
        (&json!("add_readings"), &json!("key-b"))
    );

    // After a restart too, and in another session.
    lab.it = lab.it.restart().await;
    lab.session = lab.it.session(json!({})).await;
    lab.post(&b, "arm-A", 0).await.problem(403, "forbidden", Some("/readings/0/robot"));
    let names = lab.it.get("/v1/robots").await.expect(200)["items"].clone();
    assert_eq!(
        (&names[0]["name"], &names[0]["holder"]["key_name"]),
        (&json!("arm-A"), &json!("key-a"))
    );
    assert_eq!(names[1]["name"], "arm-B");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_administrator_rebinds_and_releases_names() {
    let mut lab = Lab::new().await;
    let a = lab.it.new_key("key-a", "robot").await;
    let b = lab.it.new_key("key-b", "robot").await;
    lab.post(&a, "arm-A", 0).await.expect(200);
    let body = Some(("application/json", json!({"key": "key-b"}).to_string().into_bytes()));
    let bound = lab.it.send(Method::PUT, "/v1/robots/arm-A", body.clone()).await.expect(200);
    assert_eq!(bound["holder"]["key_name"], "key-b");
    lab.post(&a, "arm-A", 1).await.problem(403, "forbidden", None);
    // Numbers count per key: those of another key do not conflict.
    assert_eq!(lab.post(&b, "arm-A", 0).await.expect(200)["n_new"], 1);
    assert_eq!(lab.post(&b, "arm-A", 0).await.expect(200)["n_repeated"], 1);

    lab.it.send(Method::DELETE, "/v1/robots/arm-A", None).await.expect(204);
    let gone = lab.it.send(Method::DELETE, "/v1/robots/arm-A", None).await;
    gone.problem(404, "not-found", None);
    assert_eq!(lab.post(&a, "arm-A", 1).await.expect(200)["n_new"], 1);

    // Revoking a key releases its names.
    lab.it.send(Method::DELETE, "/v1/keys/key-a", None).await.expect(204);
    assert_eq!(lab.post(&b, "arm-A", 1).await.expect(200)["n_new"], 1);
    let unknown = Some(("application/json", json!({"key": "nobody"}).to_string().into_bytes()));
    let unknown = lab.it.send(Method::PUT, "/v1/robots/arm-A", unknown).await;
    unknown.problem(422, "invalid-value", Some("/key"));
    lab.it.send(Method::PUT, "/v1/robots/a%1bb", body).await.problem(422, "invalid-value", None);
    let revoked = Some(("application/json", json!({"key": "key-a"}).to_string().into_bytes()));
    let revoked = lab.it.send(Method::PUT, "/v1/robots/arm-A", revoked).await;
    revoked.problem(409, "wrong-state", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn readings_retractions_and_leases_record_their_key() {
    let mut lab = Lab::new().await;
    let a = lab.it.new_key("key-a", "robot").await;
    lab.post(&a, "arm-A", 0).await.expect(200);
    let session = lab.session.clone();
    let path = format!("/v1/sessions/{session}/readings/arm-A/0");
    lab.it.send(Method::DELETE, &path, None).await.expect(200);
    let found = lab.readings().await;
    assert_eq!(found[0]["written_by"]["key_name"], "key-a");
    assert_eq!(found[0]["retraction_written_by"]["key_name"], "admin");
    let lease = format!("/v1/sessions/{session}/lease");
    lab.it.key = Some(a);
    let extended = lab.it.post(&lease, &json!({"seconds": 60})).await.expect(200);
    assert_eq!(extended["leased_by"]["key_name"], "key-a");
    lab.it.key.clone_from(&lab.admin);
    let training = json!({"readings": [quiet_reading()]});
    lab.it.post("/v1/objects", &json!({"name": "ball"})).await.expect(201);
    lab.it.post("/v1/objects/ball/readings", &training).await.expect(200);
    let stored = lab.it.get("/v1/objects/ball/readings").await.expect(200);
    assert_eq!(stored["items"][0]["written_by"]["key_name"], "admin");
}

#[tokio::test(flavor = "multi_thread")]
async fn without_keys_names_have_no_owner() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &readings("arm-A", 0)).await.expect(200);
    assert_eq!(it.post(&path, &readings("arm-A", 0)).await.expect(200)["n_repeated"], 1);
    let page = it.get(&path).await.expect(200);
    assert_eq!(page["items"][0]["written_by"], Value::Null);
    assert_eq!(it.get("/v1/robots").await.expect(200)["items"], json!([]));
}

#[tokio::test(flavor = "multi_thread")]
async fn one_key_cannot_take_all_open_sessions() {
    let mut it = Harness::trained_with(|config| {
        config.access = Access::Keys;
        config.sessions_open_max = 20;
    })
    .await;
    let (greedy, other) = (it.new_key("greedy", "robot").await, it.new_key("other", "robot").await);
    it.key = Some(greedy.clone());
    for _ in 0..15 {
        it.session(json!({})).await;
    }
    let refused = it.post("/v1/sessions", &json!({})).await;
    refused.problem(429, "too-many-requests", None);
    assert!(refused.headers.contains_key("retry-after"));
    it.key = Some(other);
    it.session(json!({})).await;
    // After a restart they count for the same key.
    let mut it = it
        .restart_with(|config| {
            config.access = Access::Keys;
            config.sessions_open_max = 20;
        })
        .await;
    it.key = Some(greedy);
    it.post("/v1/sessions", &json!({})).await.problem(429, "too-many-requests", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_expired_key_stays_expired_after_a_clock_step_back() {
    let it = Harness::guarded().await;
    let request = json!({"name": "arm", "role": "robot", "expires_in_s": 3600});
    let created = it.post("/v1/keys", &request).await.expect(201);
    let arm = created["secret"].as_str().unwrap().to_owned();
    it.send_as(Some(&arm), Method::GET, "/v1/whoami").await.expect(200);
    // Two hours from now was stored before: the clock was set back.
    let it = it
        .restart_after(|folder| {
            let engine = SledEngine::open(folder, &SledOptions::default()).unwrap();
            let database = Database::with_engine(Arc::new(engine)).unwrap();
            let seen = SystemTime::now() + Duration::from_secs(7200);
            let seen = seen.duration_since(UNIX_EPOCH).unwrap().as_millis() as u64;
            let stored = database.latest_time().unwrap();
            assert!(stored > 1_700_000_000_000 && stored < seen, "stored at the end: {stored}");
            futures::executor::block_on(database.store_clock(seen, seen)).unwrap();
        })
        .await;
    let refused = it.send_as(Some(&arm), Method::GET, "/v1/whoami").await;
    let problem = refused.problem(401, "unauthenticated", None);
    assert!(problem["detail"].as_str().unwrap().contains("expired"), "{problem}");
    it.get("/v1/whoami").await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_in_a_path_is_neither_returned_nor_stored() {
    let it = Harness::guarded().await;
    let secret = it.new_key("arm", "robot").await;
    let proof = secret[41..].to_owned();
    let path = format!("/v1/objects/{secret}");
    it.send(Method::DELETE, &path, None).await.problem(404, "not-found", None);
    let answer = it.send_as(None, Method::GET, &path).await;
    answer.problem(401, "unauthenticated", None);
    assert!(!answer.text.contains(&proof), "{}", answer.text);
    let audit = it.get("/v1/audit").await;
    audit.expect(200);
    assert!(
        audit.text.contains("palpate_(a key)") && !audit.text.contains(&proof),
        "{}",
        audit.text
    );
    let described = json!({"name": "mug", "description": format!("my {secret}")});
    it.post("/v1/objects", &described).await.problem(422, "invalid-value", Some("/description"));
}

#[tokio::test(flavor = "multi_thread")]
async fn texts_with_control_characters_are_refused_at_the_field() {
    let it = Harness::trained().await;
    let evil = "a\u{1b}]0;owned\u{7}";
    for (path, body, pointer) in [
        ("/v1/objects", json!({"name": "mug", "description": evil}), "/description"),
        ("/v1/objects", json!({"name": "mug", "description": "a\u{202e}b"}), "/description"),
        ("/v1/objects", json!({"name": "mug", "description": "a\nb"}), "/description"),
        ("/v1/objects", json!({"name": evil}), "/name"),
        ("/v1/sensors", json!({"name": evil, "preset": "digitacts-6x6"}), "/name"),
        ("/v1/keys", json!({"name": evil, "role": "robot"}), "/name"),
        ("/v1/sessions", json!({"frame_id": evil}), "/frame_id"),
        (
            "/v1/sessions",
            json!({"robots": [{"robot": evil, "base": {"position_m": 0.01, "angle_rad": 0.1}}]}),
            "/robots/0/robot",
        ),
    ] {
        it.post(path, &body).await.problem(422, "invalid-value", Some(pointer));
    }
    let session = it.session(json!({})).await;
    for field in ["robot", "frame_id"] {
        let mut body = readings("arm", 0);
        body["readings"][0][field] = json!(evil);
        let answer = it.post(&format!("/v1/sessions/{session}/readings"), &body).await;
        answer.problem(422, "invalid-value", Some(&format!("/readings/0/{field}")));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_open_server_accepts_only_its_own_host_names() {
    let it = Harness::start_with(|config| {
        config.listen = SocketAddr::from((Ipv4Addr::UNSPECIFIED, 0));
        config.insecure_bind = true;
        config.host_names = vec!["palpate.lab".to_owned()];
    })
    .await;
    let port = it.server.local_addr().port();
    let ask = async |host: &str| {
        let url = format!("http://127.0.0.1:{port}/v1/objects");
        let request = it.client.get(url).header("host", host);
        read(request.send().await.unwrap()).await
    };
    for host in
        ["127.0.0.1", "10.1.2.3:7411", "[2001:db8::1]:7411", "localhost", "palpate.lab:7411"]
    {
        ask(host).await.expect(200);
    }
    for host in ["evil.example", "evil.example:7411", "palpate.lab.evil.example"] {
        ask(host).await.problem(403, "forbidden", None);
    }
}
