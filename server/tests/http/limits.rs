//! Tests of limits on requests: each client's share, the memory of bodies and of beliefs.

use std::num::NonZeroU32;
use std::time::Duration;

use futures::future::join_all;
use palpate_core::pose::Pose;
use palpate_server::Access;
use reqwest::{Body, Method};
use serde_json::{Value, json};

use crate::harness::{Answer, BAR, CUBE, Harness, read, touches};

#[tokio::test(flavor = "multi_thread")]
async fn only_a_too_frequent_client_gets_retry_after() {
    let it = Harness::start_with(|config| {
        config.access = Access::Keys;
        config.rate_per_second = NonZeroU32::new(20);
    })
    .await;
    let other = it.new_key("other", "viewer").await;
    let answers = join_all((0..60).map(|_| it.get("/v1/objects"))).await;
    let (refused, taken): (Vec<&Answer>, Vec<_>) =
        answers.iter().partition(|answer| answer.status == 429);
    assert!(refused.len() >= 20 && taken.len() >= 10, "{} refused", refused.len());
    for answer in refused {
        let problem = answer.problem(429, "too-many-requests", None);
        assert!(problem["detail"].as_str().unwrap().contains("20 requests a second"));
        assert_eq!(answer.headers["retry-after"], "1");
        assert!(answer.headers["ratelimit"].to_str().unwrap().starts_with("\"requests\";r=0;"));
    }
    for answer in taken {
        assert_eq!(answer.status, 200);
        let policy = &answer.headers["ratelimit-policy"];
        assert_eq!(policy, "\"requests\";q=20;qu=\"requests\";w=1");
    }
    assert_eq!(it.send_as(Some(&other), Method::GET, "/v1/objects").await.status, 200);
    for _ in 0..30 {
        it.get("/livez").await.expect(200);
    }
    tokio::time::sleep(Duration::from_millis(300)).await;
    it.get("/v1/objects").await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn one_session_does_not_take_all_memory() {
    let it = Harness::trained().await;
    let (busy, other) = (it.session(json!({})).await, it.session(json!({})).await);
    let readings = json!({"readings": touches(BAR, 20, 5, Pose::IDENTITY)});
    let path = format!("/v1/sessions/{busy}/readings");
    let others = async {
        let path = format!("/v1/sessions/{other}/readings");
        it.post(&path, &readings).await.expect(200)
    };
    let requests = join_all((0..100).map(|_| it.post(&path, &readings)));
    let (answers, _) = futures::join!(requests, others);
    let taken = answers.iter().filter(|answer| answer.status == 200).count();
    let refused: Vec<&Answer> = answers.iter().filter(|answer| answer.status != 200).collect();
    assert!(taken >= 33 && !refused.is_empty(), "{taken} taken");
    for answer in refused {
        answer.problem(429, "too-many-requests", None);
        let policy = &answer.headers["ratelimit-policy"];
        assert_eq!(policy, "\"session\";q=32;qu=\"concurrent-requests\"");
        assert_eq!(answer.headers["retry-after"], "1");
    }
    let session = it.get(&format!("/v1/sessions/{busy}")).await.expect(200);
    assert_eq!(session["n_readings"], 20 * taken, "what was refused stored nothing");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_memory_of_all_bodies_is_limited() {
    let it = Harness::start_with(|config| config.bodies_bytes_max = 8 << 10).await;
    let long = json!({"name": "vase", "description": "x".repeat(10_000)});
    let whole = it.post("/v1/objects", &long).await;
    whole.problem(503, "overloaded", None);
    assert_eq!(whole.headers["ratelimit-policy"], "\"bodies\";q=8192;qu=\"content-bytes\"");
    // In pieces it first meets its client's share of the space.
    let pieces: Vec<Result<Vec<u8>, std::io::Error>> =
        long.to_string().into_bytes().chunks(1000).map(|piece| Ok(piece.to_vec())).collect();
    let request = it.client.post(it.url("/v1/objects")).header("content-type", "application/json");
    let streamed = request.body(Body::wrap_stream(futures::stream::iter(pieces))).send().await;
    read(streamed.unwrap()).await.problem(429, "too-many-requests", None);
    // The space is free again, and a fitting body is accepted.
    for n in 0..20 {
        let object = json!({"name": format!("vase-{n}"), "description": "x".repeat(1900)});
        it.post("/v1/objects", &object).await.expect(201);
    }
}

/// Bytes of the beliefs, from the server's metrics.
pub(crate) async fn belief_bytes(it: &Harness) -> usize {
    let ready = it.get("/readyz").await.expect(200);
    let checks = ready["checks"].as_array().unwrap();
    let memory = checks.iter().find(|check| check["name"] == "memory").unwrap();
    let detail = memory["detail"].as_str().unwrap();
    let words: Vec<&str> = detail.split(' ').collect();
    let bytes = |pair: &[&str]| {
        let number: f64 = pair[0].parse().ok()?;
        let units = ["B", "kB", "MB", "GB"];
        let power = units.iter().position(|unit| pair[1].starts_with(unit))?;
        Some((number * 1000_f64.powi(power as i32)) as usize)
    };
    // "B" begins none of the others.
    let found = words.windows(2).find_map(bytes);
    found.unwrap_or_else(|| panic!("no number in {detail}"))
}

/// Beliefs of eight sessions whose readings come in turn.
async fn in_turn(it: &Harness, max: usize) -> Vec<Value> {
    let mut sessions = Vec::new();
    for _ in 0..8 {
        sessions.push(it.session(json!({})).await);
    }
    // One session is followed; its belief is evicted nevertheless.
    let path = format!("/v1/sessions/{}/events", sessions[0]);
    let _followed = it.client.get(it.url(&path)).send().await.unwrap();
    let mut believed = Vec::new();
    for reading in touches(BAR, 12, 77, Pose::IDENTITY) {
        for session in &sessions {
            let path = format!("/v1/sessions/{session}/readings");
            let added = it.post(&path, &json!({"readings": [reading]})).await.expect(200);
            let mut belief = added["belief"].clone();
            belief.as_object_mut().unwrap().remove("session");
            believed.push(belief);
        }
        // The bytes that one request adds are over the limit until the next comes.
        it.get(&format!("/v1/sessions/{}/belief", sessions[0])).await.expect(200);
        let bytes = belief_bytes(it).await;
        assert!(bytes <= max + max / 4, "{bytes} of {max}");
    }
    believed
}

#[tokio::test(flavor = "multi_thread")]
async fn beliefs_are_equal_when_few_fit_in_memory() {
    let it = Harness::trained().await;
    let with_plenty = in_turn(&it, usize::MAX / 2).await;
    let all = belief_bytes(&it).await;
    assert!(all > 8 * 1000, "{all}");
    let few = all / 3;
    let it = it.restart_with(|config| config.belief_memory_bytes_max = few).await;
    assert_eq!(in_turn(&it, few).await, with_plenty);
    let longest = touches(CUBE, 3, 9, Pose::IDENTITY);
    let session = it.session(json!({})).await;
    it.post(&format!("/v1/sessions/{session}/readings"), &json!({"readings": longest}))
        .await
        .expect(200);
}
