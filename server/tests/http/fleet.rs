//! Tests of the fleet: open sessions, their robots, and their last changes.

use palpate_core::pose::Pose;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{BAR, Harness, quiet_reading, touches};

async fn fleet(it: &Harness) -> Value {
    it.get("/v1/fleet").await.expect(200)
}

fn ids(fleet: &Value) -> Vec<&str> {
    let sessions = fleet["sessions"].as_array().unwrap();
    sessions.iter().map(|one| one["session"]["id"].as_str().unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn open_sessions_are_listed_by_newest_change_with_robots() {
    let it = Harness::start().await;
    assert_eq!((&fleet(&it).await["n_open"], ids(&fleet(&it).await)), (&json!(0), vec![]));
    it.train().await;
    let (first, second) = (it.session(json!({})).await, it.session(json!({})).await);
    let untouched = fleet(&it).await;
    assert_eq!(ids(&untouched), [second.as_str(), first.as_str()]);
    assert_eq!(untouched["sessions"][0]["last_reading_at"], Value::Null);
    assert_eq!(untouched["sessions"][0]["robots"], json!([]));

    let mut readings = touches(BAR, 3, 5, Pose::IDENTITY);
    for (reading, robot) in readings.iter_mut().zip(["left", "right", "left"]) {
        (reading["robot"], reading["seq"]) = (json!(robot), json!(1));
    }
    readings[2]["seq"] = json!(2);
    let path = format!("/v1/sessions/{first}");
    it.post(&format!("{path}/readings"), &json!({"readings": readings})).await.expect(200);
    let touched = fleet(&it).await;
    assert_eq!(ids(&touched), [first.as_str(), second.as_str()]);
    let one = &touched["sessions"][0];
    assert_eq!(one["robots"], json!(["left", "right"]));
    assert_eq!(one["session"], it.get(&path).await.expect(200));
    let stored = it.get(&format!("{path}/readings")).await.expect(200);
    assert_eq!(one["last_reading_at"], stored["items"][2]["received_at"]);

    // A retraction is a change, but not a reading.
    it.send(Method::DELETE, &format!("{path}/readings/0"), None).await.expect(200);
    let withdrawn = fleet(&it).await;
    assert_eq!(withdrawn["sessions"][0]["last_reading_at"], one["last_reading_at"]);
    assert_eq!(withdrawn["sessions"][0]["session"]["n_readings"], 2);

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
    // A reading without an id names no robot.
    assert_eq!(one["sessions"][0]["robots"], json!([]));
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
