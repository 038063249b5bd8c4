//! Tests of the fleet: open sessions, their robots, and their last changes.

use std::time::Duration;

use palpate_core::pose::Pose;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, quiet_reading, touches};

/// A box unlike the trained ones (mm).
const DISC: [f64; 3] = [110.0, 70.0, 8.0];

async fn fleet(it: &Harness) -> Value {
    it.get("/v1/fleet").await.expect(200)
}

fn found<'a>(fleet: &'a Value, session: &str) -> &'a Value {
    let mut sessions = fleet["sessions"].as_array().unwrap().iter();
    sessions.find(|one| one["session"]["id"] == session).unwrap()
}

/// A session whose object the catalogue lacks, at least as the server believes after some touches.
async fn foreign(it: &Harness) -> String {
    let session = it.session(json!({})).await;
    let readings = touches(DISC, 10, 5, Pose::IDENTITY);
    let path = format!("/v1/sessions/{session}/readings");
    it.post(&path, &json!({"readings": readings})).await.expect(200);
    session
}

/// Whether a session needs attention, and since when its state holds.
async fn needs(it: &Harness, session: &str) -> (bool, Value) {
    let fleet = fleet(it).await;
    let attention = &found(&fleet, session)["attention"];
    (attention["is_needed"].as_bool().unwrap(), attention["since"].clone())
}

/// Waits until the server has formed the belief of a session's newest revision.
async fn formed(it: &Harness, session: &str) -> Value {
    for _ in 0..200 {
        let fleet = it.get("/v1/fleet?trace=true").await.expect(200);
        let one = found(&fleet, session);
        if one["session"]["latest"]["revision"] == one["session"]["revision"] {
            return one.clone();
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    panic!("the belief of {session} is never formed");
}

fn ids(fleet: &Value) -> Vec<&str> {
    let sessions = fleet["sessions"].as_array().unwrap();
    sessions.iter().map(|one| one["session"]["id"].as_str().unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn open_sessions_are_listed_with_robots_and_last_reading() {
    let it = Harness::start().await;
    assert_eq!((&fleet(&it).await["n_open"], ids(&fleet(&it).await)), (&json!(0), vec![]));
    it.train().await;
    let (first, second) = (it.session(json!({})).await, it.session(json!({})).await);
    let untouched = fleet(&it).await;
    assert_eq!(ids(&untouched), [first.as_str(), second.as_str()]);
    assert_eq!(untouched["sessions"][0]["attention"]["level"], "waiting");
    assert_eq!(untouched["sessions"][0]["session"]["latest"], Value::Null);
    assert_eq!(untouched["sessions"][0]["last_reading_at"], Value::Null);
    assert_eq!(untouched["sessions"][0]["session"]["touched_by"], json!([]));

    let mut readings = touches(BAR, 3, 5, Pose::IDENTITY);
    for (reading, robot) in readings.iter_mut().zip(["left", "right", "left"]) {
        (reading["robot"], reading["seq"]) = (json!(robot), json!(1));
    }
    readings[2]["seq"] = json!(2);
    let path = format!("/v1/sessions/{first}");
    it.post(&format!("{path}/readings"), &json!({"readings": readings})).await.expect(200);
    let touched = fleet(&it).await;
    let one = found(&touched, &first);
    assert_eq!(one["session"]["touched_by"], json!(["left", "right"]));
    assert_eq!(one["session"], it.get(&path).await.expect(200));
    let stored = it.get(&format!("{path}/readings")).await.expect(200);
    assert_eq!(one["last_reading_at"], stored["items"][2]["received_at"]);

    // A retraction is a change, but not a reading.
    it.send(Method::DELETE, &format!("{path}/readings/0"), None).await.expect(200);
    let withdrawn = fleet(&it).await;
    let less = found(&withdrawn, &first);
    assert_eq!(less["last_reading_at"], one["last_reading_at"]);
    assert_eq!(less["session"]["n_readings"], 2);

    it.post(&format!("{path}/close"), &json!({})).await.expect(200);
    let it = it.restart().await;
    let closed = fleet(&it).await;
    assert_eq!((&closed["n_open"], ids(&closed)), (&json!(1), vec![second.as_str()]));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_fleet_is_bounded_and_states_the_total() {
    let it = Harness::trained().await;
    let sessions = [it.session(json!({})).await, it.session(json!({})).await];
    let path = format!("/v1/sessions/{}/readings", sessions[0]);
    it.post(&path, &json!({"readings": [quiet_reading()]})).await.expect(200);
    let one = it.get("/v1/fleet?limit=1").await.expect(200);
    assert_eq!((&one["n_open"], ids(&one)), (&json!(2), vec![sessions[0].as_str()]));
    let next = one["next_cursor"].as_str().unwrap();
    let rest = it.get(&format!("/v1/fleet?limit=1&cursor={next}")).await.expect(200);
    assert_eq!((ids(&rest), &rest["next_cursor"]), (vec![sessions[1].as_str()], &Value::Null));
    // A reading without an id names no robot.
    assert_eq!(one["sessions"][0]["session"]["touched_by"], json!([]));
    assert!(one["sessions"][0]["last_reading_at"].is_string());
    it.get("/v1/fleet?limit=0").await.problem(422, "invalid-value", Some("?limit"));
    it.get("/v1/fleet?limit=101").await.problem(422, "invalid-value", Some("?limit"));
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_may_not_read_the_fleet() {
    let it = Harness::guarded().await;
    for (role, status) in [("viewer", 200), ("trainer", 200), ("robot", 403)] {
        let key = it.new_key(role, role).await;
        let answer = it.send_as(Some(&key), Method::GET, "/v1/fleet").await;
        assert_eq!(answer.status, status, "{role}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn sessions_that_need_attention_come_first_until_handled() {
    let it = Harness::trained().await;
    let quiet: Vec<String> = [it.session(json!({})).await, it.session(json!({})).await].into();
    let alarmed = foreign(&it).await;
    let all = fleet(&it).await;
    assert_eq!(ids(&all), [alarmed.as_str(), quiet[0].as_str(), quiet[1].as_str()]);
    assert_eq!((&all["n_needed"], &all["n_open"]), (&json!(1), &json!(3)));
    let attention = &all["sessions"][0]["attention"];
    assert_eq!(attention["level"], "surprising", "{}", all["sessions"][0]);
    assert_eq!(attention["reason"], "probably none of the known objects");
    let needed = it.get("/v1/fleet?needed=true").await.expect(200);
    assert_eq!(ids(&needed), [alarmed.as_str()]);
    let (part, wrong) = (&quiet[1][20..].to_uppercase(), "nobody");
    let found = it.get(&format!("/v1/fleet?search=DEFAULT%20{part}")).await.expect(200);
    assert_eq!((ids(&found), &found["n_open"]), (vec![quiet[1].as_str()], &json!(3)));
    let none = it.get(&format!("/v1/fleet?search={part}%20{wrong}")).await.expect(200);
    assert_eq!(ids(&none), Vec::<&str>::new());
    let long = format!("/v1/fleet?search={}", "x".repeat(201));
    it.get(&long).await.problem(422, "invalid-value", Some("?search"));

    // Acknowledged alarms need nobody, also after a restart, which forms the beliefs again.
    let before = formed(&it, &alarmed).await;
    let seen = json!({"sessions": [alarmed, quiet[0], "00000000-0000-0000-0000-000000000001"]});
    let answer = it.post("/v1/fleet/acknowledgements", &seen).await.expect(200);
    assert_eq!(answer["n_done"], 2);
    assert!(answer["results"][2]["problem"].as_str().unwrap().contains("session"), "{answer}");
    assert!(!needs(&it, &alarmed).await.0);
    let it = it.restart().await;
    let again = formed(&it, &alarmed).await;
    assert_eq!(again["attention"]["is_needed"], false);
    assert_eq!(again["attention"]["level"], "surprising");
    assert_eq!(
        again["session"]["latest"], before["session"]["latest"],
        "the times of readings are stored"
    );

    // Closed in bulk.
    let closing = json!({"sessions": [quiet[0], alarmed]});
    let closed = it.post("/v1/fleet/closings", &closing).await.expect(200);
    assert_eq!(closed["n_done"], 2);
    assert_eq!(ids(&fleet(&it).await), [quiet[1].as_str()]);
    let late = it.post("/v1/fleet/acknowledgements", &closing).await.expect(200);
    assert!(late["results"][0]["problem"].as_str().unwrap().contains("was closed"), "{late}");
}

#[tokio::test(flavor = "multi_thread")]
async fn muted_sessions_need_nobody_until_the_mute_ends() {
    let it = Harness::trained().await;
    let alarmed = foreign(&it).await;
    assert!(needs(&it, &alarmed).await.0);
    let mute = |seconds: u32| json!({"sessions": [alarmed], "mute_s": seconds});
    let path = "/v1/fleet/acknowledgements";
    it.post(path, &mute(600)).await.expect(200);
    let muted = fleet(&it).await;
    let until = &muted["sessions"][0]["attention"]["muted_until"];
    assert!(until.is_string() && muted["n_needed"] == 0, "{muted}");
    it.post(path, &mute(0)).await.expect(200);
    let ended = fleet(&it).await;
    assert_eq!(ended["sessions"][0]["attention"]["muted_until"], Value::Null);
    assert_eq!(ended["n_needed"], 0, "it is acknowledged");
    it.post(path, &mute(604_801)).await.problem(422, "invalid-value", Some("/mute_s"));
    let none = json!({"sessions": []});
    it.post(path, &none).await.problem(422, "invalid-value", Some("/sessions"));
    it.get("/v1/fleet?cursor=7").await.problem(422, "invalid-value", Some("?cursor"));
}

#[tokio::test(flavor = "multi_thread")]
async fn beliefs_that_nobody_asked_for_are_judged_and_counted() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/readings?belief=none");
    let readings = touches(DISC, 10, 5, Pose::IDENTITY);
    it.post(&path, &json!({"readings": readings})).await.expect(200);
    let formed = formed(&it, &session).await;
    assert_eq!(formed["attention"]["is_needed"], true, "{formed}");
    assert_eq!(formed["trace"].as_array().unwrap().last(), Some(&formed["session"]["latest"]));
    let counted = || async {
        let metrics = it.get("/metrics").await.text;
        metrics.contains("palpate_sessions_needing_attention 1")
            && metrics.contains(r#"palpate_sessions_by_attention{level="surprising"} 1"#)
    };
    for _ in 0..150 {
        if counted().await {
            return;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    panic!("{}", it.get("/metrics").await.text);
}

#[tokio::test(flavor = "multi_thread")]
async fn viewers_look_and_trainers_acknowledge() {
    let it = Harness::guarded().await;
    let none = json!({"sessions": ["00000000-0000-0000-0000-000000000001"]});
    for (role, status) in [("viewer", 403), ("trainer", 200), ("robot", 403)] {
        let key = it.new_key(role, role).await;
        let request = it.client.post(it.url("/v1/fleet/acknowledgements")).bearer_auth(key);
        assert_eq!(request.json(&none).send().await.unwrap().status(), status, "{role}");
    }
}
