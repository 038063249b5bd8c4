//! Who wrote what: keys of readings, names of robots, numbers per key.

use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{Answer, Harness, quiet_reading};

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
        let it = Harness::guarded().await;
        it.train().await;
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
    // Its own next number is still its own.
    assert_eq!(lab.post(&a, "arm-A", 1).await.expect(200)["n_new"], 1);
    assert_eq!(lab.post(&b, "arm-B", 1).await.expect(200)["n_new"], 1);
    let found = lab.it.get("/v1/audit?ring=refused").await.expect(200)["items"].clone();
    assert_eq!(
        (&found[0]["operation"], &found[0]["key_name"]),
        (&json!("add_readings"), &json!("key-b"))
    );

    // Over a restart too, and in another session.
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
    // Numbers count per key: what the other one wrote takes none of its own.
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
async fn readings_withdrawals_and_leases_say_which_key_wrote_them() {
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
async fn without_keys_names_belong_to_nobody() {
    let it = Harness::start().await;
    it.train().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &readings("arm-A", 0)).await.expect(200);
    assert_eq!(it.post(&path, &readings("arm-A", 0)).await.expect(200)["n_repeated"], 1);
    let page = it.get(&path).await.expect(200);
    assert_eq!(page["items"][0]["written_by"], Value::Null);
    assert_eq!(it.get("/v1/robots").await.expect(200)["items"], json!([]));
}
