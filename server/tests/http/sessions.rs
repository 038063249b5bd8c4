//! Tests of sessions: beliefs sharpen, retries count once, restarts lose nothing.

use std::time::Duration;

use futures::future::join_all;
use glam::{DQuat, DVec3};
use palpate_core::pose::Pose;
use reqwest::Method;
use serde_json::{Value, json};

use crate::harness::{BAR, CUBE, Harness, quiet_reading, touches};

fn resting_pose() -> Pose {
    Pose::from_parts(DQuat::from_rotation_z(0.4), DVec3::new(0.02, -0.03, 0.05))
}

#[tokio::test(flavor = "multi_thread")]
async fn touches_are_recognised_and_survive_a_restart() {
    let it = Harness::trained().await;
    let session = it
        .session(json!({"frame_id": "base_link", "prior": [
        {"object": "bar", "probability": 0.5}]}))
        .await;
    let path = format!("/v1/sessions/{session}");
    let mut readings = touches(BAR, 12, 77, resting_pose());
    readings.iter_mut().for_each(|reading| reading["frame_id"] = json!("base_link"));
    let before = it.get(&format!("{path}/belief")).await;
    let before = before.expect(200);
    let bar = before["objects"][1]["probability"].as_f64().unwrap();
    let unknown = before["unknown"].as_f64().unwrap();
    assert!((bar - 0.5 * (1.0 - unknown)).abs() < 1e-12 && unknown > 0.0, "{before}");
    let added = it.post(&format!("{path}/readings"), &json!({"readings": readings})).await;
    let added = added.expect(200);
    let belief = &added["belief"];
    assert_eq!((&added["n_new"], &belief["n_readings"]), (&json!(12), &json!(12)));
    assert_eq!(belief["objects"][0]["name"], "bar", "{belief}");
    assert_eq!(belief["poses"][0]["covariance"].as_array().unwrap().len(), 36);
    let answer = it.get(&format!("{path}/belief?poses=2")).await;
    assert!(answer.expect(200)["poses"].as_array().unwrap().len() <= 2);
    let known = answer.headers["etag"].to_str().unwrap().to_owned();
    assert_eq!(known, "\"12\"");
    let request = it.client.get(it.url(&format!("{path}/belief"))).header("if-none-match", known);
    assert_eq!(request.send().await.unwrap().status(), 304);

    let it = it.restart().await;
    let after = it.get(&format!("{path}/belief")).await.expect(200);
    assert_eq!(&after, belief);
    let more = json!({"readings": touches(BAR, 1, 78, resting_pose())});
    let top = it.post(&format!("{path}/readings?belief=top"), &more).await.expect(200);
    assert_eq!(top["belief"]["objects"].as_array().unwrap().len(), 1);
    assert_eq!(top["n_readings"], 13);
    let none = json!({"readings": [quiet_reading()]});
    let none = it.post(&format!("{path}/readings?belief=none"), &none).await.expect(200);
    assert_eq!((&none["belief"], &none["n_readings"]), (&Value::Null, &json!(14)));
    assert_eq!(it.get(&path).await.expect(200)["n_readings"], 14);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_belief_at_a_revision_is_the_answer_of_that_time() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}");
    let mut answered = vec![it.get(&format!("{path}/belief")).await.expect(200)];
    for reading in touches(BAR, 5, 21, resting_pose()) {
        let body = json!({"readings": [reading]});
        let added = it.post(&format!("{path}/readings"), &body).await.expect(200);
        answered.push(added["belief"].clone());
    }
    it.post(&format!("{path}/close"), &json!({})).await.expect(200);
    let it = it.restart().await;
    for (n, belief) in answered.iter().enumerate() {
        let then = it.get(&format!("{path}/belief?at={n}")).await;
        assert_eq!(&then.expect(200), belief);
        assert_eq!(then.headers["etag"], format!("\"{n}\""));
    }
    let one_pose = it.get(&format!("{path}/belief?at=5&poses=1")).await.expect(200);
    assert_eq!(one_pose["poses"].as_array().unwrap().len(), 1);
    let known = it.client.get(it.url(&format!("{path}/belief?at=3")));
    let known = known.header("if-none-match", "\"3\"").send().await.unwrap();
    assert_eq!(known.status(), 304);
    // The sixth entry is the session's end.
    let end = it.get(&format!("{path}/belief?at=6")).await.expect(200);
    assert_eq!((&end["objects"], &end["revision"]), (&answered[5]["objects"], &json!(6)));
    for at in ["7", "-1", "last"] {
        let refused = it.get(&format!("{path}/belief?at={at}")).await;
        refused.problem(422, "invalid-value", Some("?at"));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_repeated_reading_counts_once_and_a_changed_one_is_refused() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}/readings");
    let numbered: Vec<Value> = touches(CUBE, 4, 5, resting_pose())
        .into_iter()
        .enumerate()
        .map(|(seq, mut reading)| {
            reading["robot"] = json!("arm-3");
            reading["seq"] = json!(seq);
            reading
        })
        .collect();
    let post = async |readings: &[Value]| it.post(&path, &json!({"readings": readings})).await;
    let first = post(&numbered[..2]).await.expect(200);
    post(&numbered[2..]).await.expect(200);
    let again = post(&numbered[..2]).await.expect(200);
    assert_eq!(again["belief"], first["belief"], "the stored answer");
    assert_eq!((&again["n_new"], &again["n_repeated"]), (&json!(0), &json!(2)));
    assert_eq!(again["n_readings"], 4);
    let twice = [numbered[3].clone(), numbered[3].clone()];
    assert_eq!(post(&twice).await.expect(200)["n_repeated"], 2);
    let mut changed = numbered[1].clone();
    changed["pose"]["position"][0] = json!(0.5);
    let mixed = [quiet_reading(), changed];
    post(&mixed).await.problem(409, "conflict", Some("/readings/1"));
    let page = it.get(&format!("/v1/sessions/{session}")).await.expect(200);
    assert_eq!(page["n_readings"], 4, "all or none");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reading_repeated_after_a_restart_counts_once() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let path = format!("/v1/sessions/{session}");
    let mut readings = touches(CUBE, 3, 11, resting_pose());
    for (seq, reading) in readings.iter_mut().enumerate() {
        reading["robot"] = json!("arm-3");
        reading["seq"] = json!(seq);
    }
    let first = json!({"readings": readings[..2]});
    let answered = it.post(&format!("{path}/readings"), &first).await.expect(200);
    let both = json!({"readings": readings[1..]});
    it.post(&format!("{path}/readings"), &both).await.expect(200);
    let belief = it.get(&format!("{path}/belief")).await.expect(200);
    let it = it.restart().await;
    for _ in 0..2 {
        let again = it.post(&format!("{path}/readings"), &first).await.expect(200);
        assert_eq!((&again["n_new"], &again["n_repeated"]), (&json!(0), &json!(2)));
        assert_eq!((&again["n_readings"], &again["belief"]), (&json!(3), &answered["belief"]));
    }
    readings[0]["image"][0] = json!(9.0);
    let changed = it.post(&format!("{path}/readings"), &json!({"readings": readings})).await;
    changed.problem(409, "conflict", Some("/readings/0"));
    assert_eq!(it.get(&format!("{path}/belief")).await.expect(200), belief);
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_may_post_to_one_or_many_sessions_at_once() {
    let it = Harness::trained().await;
    let shared = it.session(json!({})).await;
    let own = join_all((0..4).map(|_| it.session(json!({})))).await;
    let readings = touches(CUBE, 16, 6, resting_pose());
    let posts = readings.iter().enumerate().flat_map(|(index, reading)| {
        let body = json!({"readings": [reading]});
        let it = &it;
        [&shared, &own[index % 4]].map(|session| {
            let (path, body) = (format!("/v1/sessions/{session}/readings"), body.clone());
            async move { it.post(&path, &body).await.expect(200) }
        })
    });
    join_all(posts).await;
    let belief = it.get(&format!("/v1/sessions/{shared}/belief")).await.expect(200);
    assert_eq!((&belief["n_readings"], &belief["revision"]), (&json!(16), &json!(16)));
    for session in own {
        let session = it.get(&format!("/v1/sessions/{session}")).await.expect(200);
        assert_eq!(session["n_readings"], 4);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_queue_refuses_with_retry_after_and_stores_nothing() {
    let it = Harness::trained_with(|config| {
        config.compute_threads = 1;
        config.compute_queue_max = 0;
    })
    .await;
    let mut sessions = Vec::new();
    for _ in 0..8 {
        sessions.push(it.session(json!({})).await);
    }
    let body = json!({"readings": touches(CUBE, 24, 8, resting_pose())});
    let posts = sessions.iter().map(|session| {
        let path = format!("/v1/sessions/{session}/readings");
        let (it, body) = (&it, &body);
        async move { it.post(&path, body).await }
    });
    let answers = join_all(posts).await;
    let refused = answers.iter().filter(|answer| answer.status == 503).count();
    assert!((1..8).contains(&refused), "{refused} of 8 refused");
    for (session, answer) in sessions.iter().zip(&answers) {
        let session = it.get(&format!("/v1/sessions/{session}")).await.expect(200);
        if answer.status == 503 {
            answer.problem(503, "overloaded", None);
            assert_eq!(answer.headers["retry-after"], "1");
            assert_eq!(session["n_readings"], 0);
        } else {
            assert_eq!(session["n_readings"], 24);
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn events_contain_beliefs_and_the_end() {
    let it = Harness::trained().await;
    let session = it.session(json!({})).await;
    let other = it.session(json!({})).await;
    let follow = async |path: String| it.client.get(it.url(&path)).send().await.unwrap();
    let one = follow(format!("/v1/sessions/{session}/events")).await;
    let mut both = follow(format!("/v1/events?sessions={session},{other}")).await;
    let open = it.session(json!({})).await;
    let mut still = follow(format!("/v1/sessions/{open}/events")).await;
    assert_eq!(one.headers()["content-type"], "text/event-stream");
    let readings = json!({"readings": [quiet_reading()]});
    let path = format!("/v1/sessions/{session}/readings?belief=none");
    it.post(&path, &readings).await.expect(200);
    it.post(&format!("/v1/sessions/{session}/close"), &json!({})).await.expect(200);
    let text = one.text().await.unwrap();
    let names: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("event: ")).collect();
    assert_eq!(names, ["belief", "belief", "closed"]);
    assert!(text.contains("id: 1\n"), "{text}");
    it.send(Method::DELETE, &format!("/v1/sessions/{other}"), None).await.expect(204);
    let mut seen = String::new();
    while !seen.contains("event: deleted") {
        seen += std::str::from_utf8(&both.chunk().await.unwrap().unwrap()).unwrap();
    }
    assert!(seen.contains("event: closed"));
    while both.chunk().await.unwrap().is_some() {}
    let missing = it.get("/v1/events?sessions=").await;
    missing.problem(422, "invalid-value", Some("?sessions"));
    it.server.shutdown().await;
    while still.chunk().await.unwrap().is_some() {}
}
#[tokio::test(flavor = "multi_thread")]
async fn a_stream_after_the_end_tells_it_and_ends() {
    let it = Harness::trained().await;
    let (closed, expired) = (it.session(json!({})).await, it.session(json!({"ttl_s": 1})).await);
    let readings = json!({"readings": [quiet_reading()]});
    for session in [&closed, &expired] {
        it.post(&format!("/v1/sessions/{session}/readings"), &readings).await.expect(200);
    }
    it.post(&format!("/v1/sessions/{closed}/close"), &json!({})).await.expect(200);
    while it.get(&format!("/v1/sessions/{expired}")).await.expect(200)["state"] == "open" {
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    let names = async |path: &str, last: &str| -> Vec<String> {
        let request = it.client.get(it.url(path)).header("last-event-id", last);
        let text = request.send().await.unwrap().text().await.unwrap();
        let names = text.lines().filter_map(|line| line.strip_prefix("event: "));
        names.map(str::to_owned).collect()
    };
    for session in [&closed, &expired] {
        let path = format!("/v1/sessions/{session}/events");
        let newest = it.get(&format!("/v1/sessions/{session}/belief")).await;
        let newest = newest.expect(200)["revision"].to_string();
        for (last, expected) in [
            ("", &["belief", "closed"][..]),
            ("0", &["belief", "closed"]),
            (&newest, &["closed"]),
            ("77", &["belief", "closed"]),
            ("x", &["belief", "closed"]),
        ] {
            assert_eq!(names(&path, last).await, expected, "after {last:?}");
        }
    }
    let both = format!("/v1/events?sessions={closed},{expired}");
    assert_eq!(names(&both, "").await.iter().filter(|name| *name == "closed").count(), 2);
    it.send(Method::DELETE, &format!("/v1/sessions/{closed}"), None).await.expect(204);
    it.get(&format!("/v1/sessions/{closed}/events")).await.problem(404, "not-found", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_counts_once_for_each_session() {
    let it = Harness::trained_with(|config| config.streams_max = 8).await;
    let mut ids = Vec::new();
    for _ in 0..9 {
        ids.push(it.session(json!({})).await);
    }
    let follow = async |n: usize| {
        let path = format!("/v1/events?sessions={}", ids[..n].join(","));
        it.client.get(it.url(&path)).send().await.unwrap()
    };
    assert_eq!(follow(9).await.status(), 503);
    let open = follow(5).await;
    assert_eq!(open.status(), 200);
    assert_eq!(follow(5).await.status(), 503);
    assert_eq!(follow(3).await.status(), 429, "more than this client's share");
    drop(open);
    let again = async {
        while follow(8).await.status() != 200 {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    tokio::time::timeout(Duration::from_secs(60), again).await.expect("the places are free again");
}

#[tokio::test(flavor = "multi_thread")]
async fn sessions_are_closed_and_deleted() {
    let it = Harness::trained().await;
    let session = it.session(json!({"ttl_s": 600})).await;
    let path = format!("/v1/sessions/{session}");
    let body = json!({"readings": [quiet_reading()]});
    let mut reading = quiet_reading();
    reading["robot"] = json!("arm");
    reading["seq"] = json!(1);
    let repeatable = json!({"readings": [reading]});
    it.post(&format!("{path}/readings"), &repeatable).await.expect(200);
    for _ in 0..2 {
        let closed = it.post(&format!("{path}/close"), &json!({})).await.expect(200);
        assert_eq!((&closed["state"], &closed["n_readings"]), (&json!("closed"), &json!(1)));
        assert_eq!((&closed["ended"], &closed["expires_at"]), (&json!("closed"), &Value::Null));
    }
    let refused = it.post(&format!("{path}/readings"), &body).await;
    let refused = refused.problem(410, "session-ended", None);
    assert!(refused["detail"].as_str().unwrap().contains("was closed at 20"), "{refused}");
    // A retry of a stored reading is answered nevertheless.
    it.post(&format!("{path}/readings"), &repeatable).await.expect(200);
    assert_eq!(it.get(&format!("{path}/belief")).await.expect(200)["n_readings"], 1);
    let list = it.get("/v1/sessions").await.expect(200);
    assert_eq!(list["items"][0]["state"], "closed");
    it.send(Method::DELETE, &path, None).await.expect(204);
    it.get(&path).await.problem(404, "not-found", None);
    it.get(&format!("{path}/belief")).await.problem(404, "not-found", None);
    it.post(&format!("{path}/readings"), &body).await.problem(404, "not-found", None);
}

#[tokio::test(flavor = "multi_thread")]
async fn evicted_sessions_are_rebuilt_from_their_journals() {
    let it = Harness::trained_with(|config| config.beliefs_in_memory_max = 2).await;
    let readings = touches(CUBE, 6, 4, resting_pose());
    let mut sessions = Vec::new();
    for _ in 0..5 {
        sessions.push(it.session(json!({})).await);
    }
    let mut beliefs: Vec<Value> = Vec::new();
    for session in &sessions {
        for reading in &readings {
            let path = format!("/v1/sessions/{session}/readings");
            it.post(&path, &json!({"readings": [reading]})).await.expect(200);
        }
        beliefs.push(it.get(&format!("/v1/sessions/{session}/belief")).await.expect(200));
    }
    for (session, belief) in sessions.iter().zip(&beliefs) {
        let now = it.get(&format!("/v1/sessions/{session}/belief")).await.expect(200);
        assert_eq!(&now, belief);
        assert_eq!(now["n_readings"], 6);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reported_truth_is_scored_against_the_belief() {
    let it = Harness::trained().await;
    let mut closed = Vec::new();
    for truth in
        [json!({"object": "cube"}), json!({"object": "bar"}), json!({"none_of_these": true})]
    {
        let session = it.session(json!({})).await;
        let path = format!("/v1/sessions/{session}");
        let body = json!({"readings": touches(CUBE, 10, 4, resting_pose())});
        it.post(&format!("{path}/readings"), &body).await.expect(200);
        for (wrong, pointer) in [
            (json!({"object": "teapot"}), "/object"),
            (json!({"object": "cube", "none_of_these": true}), "/none_of_these"),
            (json!({"objects": "cube"}), "/objects"),
        ] {
            let refused = it.post(&format!("{path}/close"), &wrong).await;
            refused.problem(422, "invalid-value", Some(pointer));
        }
        // The truth may be reported after the end.
        it.send(Method::POST, &format!("{path}/close"), None).await.expect(200);
        assert_eq!(it.get(&path).await.expect(200)["truth"], Value::Null);
        let told = it.post(&format!("{path}/close"), &truth).await.expect(200)["truth"].clone();
        assert_eq!(it.post(&format!("{path}/close"), &truth).await.expect(200)["truth"], told);
        assert_eq!(it.get(&path).await.expect(200)["truth"], told);
        let other = json!({"object": if told["name"] == "cube" { "bar" } else { "cube" }});
        it.post(&format!("{path}/close"), &other).await.problem(409, "conflict", None);
        let belief = it.get(&format!("{path}/belief")).await.expect(200);
        let given = match told["name"].as_str() {
            None => belief["unknown"].clone(),
            Some(name) => {
                let objects = belief["objects"].as_array().unwrap();
                objects.iter().find(|o| o["name"] == name).unwrap()["probability"].clone()
            }
        };
        assert_eq!(told["probability"], given);
        closed.push(told["was_right"].as_bool().unwrap());
    }
    assert_eq!(closed, [true, false, false]);
    let figures = it.get("/metrics").await.text;
    for line in [
        "palpate_feedback_total{answer=\"right\",object=\"known\"}",
        "palpate_feedback_total{answer=\"wrong\",object=\"unknown\"}",
        "palpate_feedback_probability_bucket{le=\"0.05\"}",
        "palpate_compute_wait_seconds_count",
        "process_resident_memory_bytes",
    ] {
        assert!(figures.contains(line), "{line} is not in {figures}");
    }
}
