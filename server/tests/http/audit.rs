//! Tests of the audit log: entries of changes and refusals, and queries.

use std::num::NonZeroU32;

use palpate_server::Access;
use palpate_store::audit::RingSizes;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{Harness, quiet_reading};

async fn entries(it: &Harness, query: &str) -> Vec<Value> {
    let page = it.get(&format!("/v1/audit{query}")).await.expect(200);
    page["items"].as_array().unwrap().clone()
}

fn brief(entries: &[Value]) -> Vec<(&str, &str, u64)> {
    let of = |entry: &'_ Value, field: &str| entry[field].as_str().map(str::len);
    entries
        .iter()
        .map(|entry| {
            assert!(of(entry, "request_id").is_some_and(|n| n > 0), "{entry}");
            assert_eq!(entry["address"], "127.0.0.1");
            let operation = entry["operation"].as_str().unwrap();
            let name = entry["key_name"].as_str().unwrap_or("-");
            (operation, name, entry["status"].as_u64().unwrap_or(0))
        })
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn changes_are_logged_with_key_and_outcome() {
    let mut it = Harness::guarded().await;
    let admin = it.key.clone();
    let trainer = it.new_key("teacher", "trainer").await;
    it.key = Some(trainer);
    let made = it.post("/v1/objects", &json!({"name": "mug"})).await;
    let made_at = made.headers["location"].to_str().unwrap().to_owned();
    made.expect(201);
    it.post("/v1/objects", &json!({"name": "mug"})).await.problem(409, "conflict", None);
    it.get("/v1/objects/mug").await.expect(200);
    it.send(Method::DELETE, "/v1/keys/teacher", None).await.problem(403, "forbidden", None);
    it.send(Method::DELETE, "/v1/objects/mug", None).await.expect(204);
    it.key = admin;

    let found = entries(&it, "").await;
    let expected = [
        ("delete_object", "teacher", 204),
        ("revoke_key", "teacher", 403),
        ("create_object", "teacher", 409),
        ("create_object", "teacher", 201),
        ("create_key", "admin", 201),
    ];
    assert_eq!(brief(&found), expected);
    assert_eq!(found[0]["resource"], "/v1/objects/mug");
    assert_eq!(found[2]["resource"], "/v1/objects");
    assert_eq!(found[3]["resource"], made_at.as_str(), "something new goes by its own path");
    assert_eq!(found[3]["role"], "trainer");
    assert!(!it.get("/v1/audit").await.text.contains("palpate_"), "no secret is in the log");

    let it = it.restart().await;
    assert_eq!(entries(&it, "").await, found, "the log outlives a restart");
    assert_eq!(brief(&entries(&it, "?operation=create_object&limit=1").await), expected[2..3]);
    assert_eq!(brief(&entries(&it, "?key=admin").await), expected[4..]);
    let id = found[0]["key_id"].as_str().unwrap();
    assert_eq!(brief(&entries(&it, &format!("?key={id}")).await), expected[..4]);
    let at = found[3]["at"].as_str().unwrap();
    let since = entries(&it, &format!("?since={at}")).await;
    assert!(since.len() >= 4 && since[..4] == found[..4], "{since:?}");
    let until = entries(&it, &format!("?until={at}")).await;
    assert_eq!(until.len() + since.len(), found.len());
    assert_eq!(until[..], found[since.len()..]);
}

#[tokio::test(flavor = "multi_thread")]
async fn pages_of_the_log_go_from_newest_to_oldest() {
    let it = Harness::start_with(|config| config.audit_entries_max.changes = 5).await;
    for number in 0..7 {
        it.post("/v1/objects", &json!({"name": format!("object-{number}")})).await.expect(201);
    }
    let mut seqs = Vec::new();
    let mut cursor = String::new();
    loop {
        let page = it.get(&format!("/v1/audit?limit=2{cursor}")).await.expect(200);
        let items = page["items"].as_array().unwrap();
        seqs.extend(items.iter().map(|entry| entry["seq"].as_u64().unwrap()));
        let Some(next) = page["next_cursor"].as_str() else { break };
        cursor = format!("&cursor={next}");
    }
    assert_eq!(seqs, [7, 6, 5, 4, 3], "the oldest two have left the log");
}

#[tokio::test(flavor = "multi_thread")]
async fn sessions_are_logged_and_readings_are_not() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let readings = json!({"readings": [quiet_reading()]});
    it.post(&format!("/v1/sessions/{session}/readings"), &readings).await.expect(200);
    it.send(Method::POST, &format!("/v1/sessions/{session}/close"), None).await.expect(200);
    it.send(Method::DELETE, &format!("/v1/sessions/{session}"), None).await.expect(204);
    let found = entries(&it, "?limit=4").await;
    let expected = [
        ("delete_session", "-", 204),
        ("close_session", "-", 200),
        ("create_session", "-", 201),
        ("start_training", "-", 202),
    ];
    assert_eq!(brief(&found), expected);
    assert_eq!(found[2]["resource"], format!("/v1/sessions/{session}"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flood_without_keys_is_one_entry_and_hides_no_key() {
    let mut it = Harness::guarded().await;
    it.post("/v1/objects", &json!({"name": "mug"})).await.expect(201);
    let robot = it.new_key("arm", "robot").await;
    for _ in 0..60 {
        it.send_as(None, Method::GET, "/v1/objects").await.problem(401, "unauthenticated", None);
    }
    let refused = it.send_as(Some(&robot), Method::GET, "/v1/objects").await;
    refused.problem(403, "forbidden", None);
    let found = entries(&it, "").await;
    let expected = [
        ("list_objects", "arm", 403),
        ("list_objects", "-", 401),
        ("create_key", "admin", 201),
        ("create_object", "admin", 201),
    ];
    assert_eq!(brief(&found), expected);
    assert_eq!(found[1]["n"], 60);
    assert!(found[1]["last_at"].is_string());
    for (place, ring) in ["refused", "strangers", "changes", "changes"].into_iter().enumerate() {
        assert_eq!(found[place]["ring"], ring);
    }
    assert_eq!(entries(&it, "?ring=refused").await, found[..1]);
    assert_eq!(entries(&it, "?ring=changes").await, found[2..]);

    // Counts survive a restart.
    it = it.restart().await;
    assert_eq!(entries(&it, "").await, found);
}

#[tokio::test(flavor = "multi_thread")]
async fn failed_changes_displace_no_entries_and_are_slowed() {
    let it = Harness::start_with(|config| {
        config.access = Access::Keys;
        config.audit_entries_max = RingSizes { changes: 3, refused: 5, strangers: 5 };
        config.failed_changes_per_minute = NonZeroU32::new(10).unwrap();
    })
    .await;
    it.post("/v1/objects", &json!({"name": "mug"})).await.expect(201);
    let robot = it.new_key("arm", "robot").await;
    let delete = |path: String| {
        let robot = robot.clone();
        let it = &it;
        async move { it.send_as(Some(&robot), Method::DELETE, &path).await }
    };
    for number in 0..10 {
        let path = format!("/v1/sessions/0198a0d0-0000-7000-8000-00000000000{number}");
        delete(path).await.problem(404, "not-found", None);
    }
    let slowed = delete("/v1/sessions/0198a0d0-0000-7000-8000-000000000000".to_owned()).await;
    slowed.problem(429, "too-many-requests", None);
    assert!(slowed.headers.contains_key("retry-after"));
    assert!(slowed.headers["ratelimit"].to_str().unwrap().starts_with("\"failed-changes\";r=0"));
    // Reads are not slowed, nor is another key.
    it.send_as(Some(&robot), Method::GET, "/v1/sessions").await.expect(200);
    it.send(Method::DELETE, "/v1/objects/mug", None).await.expect(204);
    let found = entries(&it, "").await;
    let expected = [
        ("delete_object", "admin", 204),
        ("delete_session", "arm", 429),
        ("delete_session", "arm", 404),
        ("create_key", "admin", 201),
        ("create_object", "admin", 201),
    ];
    assert_eq!(brief(&found), expected);
    assert_eq!(found[2]["n"], 10);
}

#[tokio::test(flavor = "multi_thread")]
async fn leases_are_logged_as_one_counted_entry() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    for _ in 0..3 {
        let path = format!("/v1/sessions/{session}/lease");
        it.post(&path, &json!({"seconds": 60})).await.expect(200);
    }
    let found = entries(&it, "?limit=2").await;
    assert_eq!(brief(&found), [("extend_session", "-", 200), ("create_session", "-", 201)]);
    assert_eq!(found[0]["n"], 3);
    assert_eq!(found[0]["resource"], format!("/v1/sessions/{session}/lease"));
}

#[tokio::test(flavor = "multi_thread")]
async fn readiness_shows_figures_to_holders_of_keys_only() {
    let it = Harness::guarded().await;
    let figures = |readiness: &Value| {
        let checks = readiness["checks"].as_array().unwrap();
        checks.iter().filter(|check| check["detail"] != "passed").count()
    };
    assert_eq!(figures(&it.send_as(None, Method::GET, "/readyz").await.expect(200)), 0);
    let wrong = it.send_as(Some("palpate_x"), Method::GET, "/readyz").await;
    assert_eq!(figures(&wrong.expect(200)), 0, "it stays open to supervisors");
    assert_eq!(figures(&it.get("/readyz").await.expect(200)), 6);
    let open = Harness::start().await;
    assert_eq!(figures(&open.get("/readyz").await.expect(200)), 6);
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_queries_are_refused_by_field() {
    let it = Harness::start().await;
    for (query, pointer) in [
        ("since=yesterday", "?since"),
        ("until=2026-13-01T00:00:00Z", "?until"),
        ("operation=drop_tables", "?operation"),
        ("limit=0", "?limit"),
        ("cursor=x", "?cursor"),
        ("who=me", "?who"),
        ("ring=all", "?ring"),
    ] {
        let answer = it.get(&format!("/v1/audit?{query}")).await;
        answer.problem(422, "invalid-value", Some(pointer));
    }
}
