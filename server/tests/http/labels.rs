//! Tests of labels, of lists that search for them and for sessions, and of aliases.

use palpate_core::pose::Pose;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{Answer, BAR, CUBE, Harness, touches};

/// A session that touched a box, by a robot.
async fn touched(it: &Harness, request: Value, size: [f64; 3], robot: &str) -> String {
    let session = it.session(request).await;
    let mut readings = touches(size, 6, 5, Pose::IDENTITY);
    for (seq, reading) in readings.iter_mut().enumerate() {
        (reading["robot"], reading["seq"]) = (json!(robot), json!(seq));
    }
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &json!({"readings": readings})).await.expect(200);
    session
}

async fn put(it: &Harness, path: &str, body: &Value) -> Answer {
    let body = ("application/json", serde_json::to_vec(body).unwrap());
    it.send(Method::PUT, path, Some(body)).await
}

async fn ids(it: &Harness, query: &str) -> Vec<String> {
    let page = it.get(&format!("/v1/sessions?{query}")).await.expect(200);
    let items = page["items"].as_array().unwrap();
    items.iter().map(|one| one["id"].as_str().unwrap().to_owned()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn sessions_are_found_by_all_that_is_known_of_them() {
    let it = Harness::trained().await;
    let labels = json!({"site": "oslo", "shift": "night"});
    let cube = touched(&it, json!({"labels": labels}), CUBE, "left").await;
    let bar = touched(&it, json!({"labels": {"site": "rome"}}), BAR, "right").await;
    let sva = touched(&it, json!({"method": "sva"}), BAR, "left").await;
    let all = [cube.clone(), bar.clone(), sva.clone()];
    assert_eq!(ids(&it, "").await, all);
    assert_eq!(ids(&it, "order=newest").await, [&*sva, &*bar, &*cube]);
    assert_eq!(ids(&it, "robot=left").await, [&*cube, &*sva]);
    assert_eq!(ids(&it, "robot=le*").await, [&*cube, &*sva]);
    assert_eq!(ids(&it, "robot=le").await, Vec::<String>::new(), "the beginning has its mark");
    assert_eq!(ids(&it, "method=sva").await, [&*sva]);
    assert_eq!(ids(&it, "labels=site").await, [&*cube, &*bar]);
    assert_eq!(ids(&it, "labels=site:oslo,shift").await, [&*cube]);
    assert_eq!(ids(&it, "object=cube").await, [&*cube], "the likeliest answer");
    assert_eq!(ids(&it, "catalogue=other").await, [""; 0]);

    // The truth counts for more than the answer, and an end changes neither.
    let close = format!("/v1/sessions/{cube}/close");
    let closed = it.post(&close, &json!({"none_of_these": true})).await.expect(200);
    assert_eq!(closed["latest"]["best"]["name"], "cube");
    assert_eq!(closed["touched_by"], json!(["left"]));
    assert_eq!(ids(&it, "object=cube").await, [""; 0]);
    assert_eq!(ids(&it, "none_of_these=true").await, [&*cube]);
    assert_eq!(ids(&it, "with_truth=false").await, [&*bar, &*sva]);
    assert_eq!(ids(&it, "state=open&order=newest").await, [&*sva, &*bar]);
    assert_eq!(ids(&it, "state=closed&robot=left").await, [&*cube]);

    let created = it.get(&format!("/v1/sessions/{bar}")).await.expect(200)["created_at"].clone();
    let created = created.as_str().unwrap();
    assert_eq!(ids(&it, &format!("since={created}")).await, [&*bar, &*sva]);
    assert_eq!(ids(&it, &format!("until={created}")).await, [&*cube]);
    it.get("/v1/sessions?since=yesterday").await.problem(422, "invalid-value", Some("?since"));
    let both = it.get("/v1/sessions?object=cube&none_of_these=true").await;
    both.problem(422, "invalid-value", Some("?none_of_these"));
}

#[tokio::test(flavor = "multi_thread")]
async fn pages_of_a_search_go_on_in_either_order() {
    let it = Harness::trained().await;
    let mut made = Vec::new();
    for n in 0..5 {
        let labels = json!({"parity": (n % 2).to_string()});
        made.push(it.session(json!({"labels": labels})).await);
    }
    for (order, expected) in [("oldest", [0, 2, 4]), ("newest", [4, 2, 0])] {
        let (mut found, mut cursor) = (Vec::new(), String::new());
        loop {
            let path = format!("/v1/sessions?labels=parity:0&limit=2&order={order}{cursor}");
            let page = it.get(&path).await.expect(200);
            let items = page["items"].as_array().unwrap().clone();
            assert!(items.len() <= 2);
            found.extend(items.iter().map(|one| one["id"].as_str().unwrap().to_owned()));
            let Some(next) = page["next_cursor"].as_str() else { break };
            cursor = format!("&cursor={next}");
        }
        assert_eq!(found, expected.map(|n| made[n].clone()), "{order}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_session_came_to_is_kept_when_it_expires() {
    let it = Harness::trained().await;
    let session = it.session(json!({"ttl_s": 1})).await;
    let mut readings = touches(CUBE, 6, 5, Pose::IDENTITY);
    for (seq, reading) in readings.iter_mut().enumerate() {
        (reading["robot"], reading["seq"]) = (json!("arm"), json!(seq));
    }
    let path = format!("/v1/sessions/{session}/readings?belief=none");
    it.post(&path, &json!({"readings": readings})).await.expect(200);
    let mut kept = Value::Null;
    for _ in 0..200 {
        let found = it.get("/v1/sessions?state=closed&object=cube").await.expect(200);
        kept = found["items"][0].clone();
        if kept != Value::Null {
            break;
        }
        tokio::time::sleep(std::time::Duration::from_millis(100)).await;
    }
    assert_eq!((&kept["id"], &kept["ended"]), (&json!(session), &json!("expired")));
    assert_eq!(kept["touched_by"], json!(["arm"]));
    let it = it.restart().await;
    let again = it.get(&format!("/v1/sessions/{session}")).await.expect(200);
    assert_eq!(again["latest"], kept["latest"], "not formed again");
}

#[tokio::test(flavor = "multi_thread")]
async fn labels_of_everything_are_set_searched_and_kept() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    it.post("/v1/objects", &json!({"name": "mug", "labels": {"site": "oslo"}})).await.expect(201);
    let sensor = json!({"name": "thumb", "preset": "digitacts-6x6", "labels": {"site": "oslo"}});
    it.post("/v1/sensors", &sensor).await.expect(201);
    let labels = json!({"labels": {"site": "oslo", "cell": "b 7"}});
    let things = [
        ("sessions", session.as_str()),
        ("objects", "cube"),
        ("sensors", "digitacts-6x6"),
        ("catalogues", "default"),
    ];
    for (kind, thing) in things {
        let path = format!("/v1/{kind}/{thing}/labels");
        let set = put(&it, &path, &labels).await.expect(200);
        assert_eq!(set["labels"], labels["labels"], "{kind}");
        let bad = json!({"labels": {"site": "a,b"}});
        let refused = put(&it, &path, &bad).await;
        refused.problem(422, "invalid-value", Some("/labels/site"));
    }
    let it = it.restart().await;
    let n = |page: Value| page["items"].as_array().unwrap().len();
    for (kind, expected) in [("sessions", 1), ("objects", 2), ("sensors", 2), ("catalogues", 1)] {
        let found = it.get(&format!("/v1/{kind}?labels=site:oslo")).await.expect(200);
        assert_eq!(n(found), expected, "{kind}");
        let found = it.get(&format!("/v1/{kind}?labels=site:oslo,cell:b%207")).await.expect(200);
        assert_eq!(n(found), 1, "{kind}");
        let refused = it.get(&format!("/v1/{kind}?labels=a%20b")).await;
        refused.problem(422, "invalid-value", Some("?labels"));
    }
    let sensor = it.get("/v1/sensors/digitacts-6x6").await.expect(200);
    assert_eq!(sensor["labels"]["cell"], "b 7", "not the one that was cached");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_alias_opens_sessions_and_keeps_its_version() {
    let it = Harness::trained().await;
    let again = json!({"readings_per_object": 60, "n_classes": 8, "seed": 3});
    let job = it.post("/v1/catalogues/default/trainings", &again).await.expect(202);
    it.finished(job["id"].as_str().unwrap()).await;
    let path = "/v1/catalogues/default/aliases/candidate";
    let set = put(&it, path, &json!({"version": 1})).await.expect(200);
    assert_eq!(set["aliases"], json!({"candidate": 1}));
    let session = it.post("/v1/sessions", &json!({"alias": "candidate"})).await.expect(201);
    assert_eq!(session["version"], 1);
    assert_eq!(it.post("/v1/sessions", &json!({})).await.expect(201)["version"], 2);
    let both = it.post("/v1/sessions", &json!({"alias": "candidate", "version": 1})).await;
    both.problem(422, "invalid-value", Some("/alias"));
    let unknown = it.post("/v1/sessions", &json!({"alias": "next"})).await;
    unknown.problem(422, "invalid-value", Some("/alias"));

    let session = session["id"].as_str().unwrap();
    it.send(Method::DELETE, &format!("/v1/sessions/{session}"), None).await.expect(204);
    let version = "/v1/catalogues/default/versions/1";
    let refused = it.send(Method::DELETE, version, None).await.problem(409, "wrong-state", None);
    assert!(refused["detail"].as_str().unwrap().contains("candidate"), "{refused}");
    let it = it.restart().await;
    let missing = put(&it, path, &json!({"version": 9})).await;
    missing.problem(422, "invalid-value", Some("/version"));
    for wrong in ["current", "12", "a b"] {
        let path = format!("/v1/catalogues/default/aliases/{}", wrong.replace(' ', "%20"));
        let refused = put(&it, &path, &json!({"version": 1})).await;
        refused.problem(422, "invalid-value", Some("/alias"));
    }
    it.send(Method::DELETE, path, None).await.expect(204);
    it.send(Method::DELETE, path, None).await.problem(404, "not-found", None);
    it.send(Method::DELETE, version, None).await.expect(204);
}
