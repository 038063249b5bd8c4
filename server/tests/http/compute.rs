//! Tests of computations: they end when their caller has gone, and free their threads.

use std::time::Duration;

use axum::http::StatusCode;
use palpate_core::pose::Pose;
use serde_json::{Value, json};

use crate::geometry::{add_letters, presses, train};
use crate::harness::{Harness, read};

/// Long enough for any step of a test on a busy machine.
const LONG: Duration = Duration::from_secs(180);

/// Number of free slots of the server's compute pool.
async fn places_free(it: &Harness) -> usize {
    let ready = it.get("/readyz").await.text;
    let (before, _) = ready.split_once(" more requests can compute").unwrap();
    before.rsplit('"').next().unwrap().parse().unwrap()
}

/// Waits until the number of free slots is as expected.
async fn until_free(it: &Harness, is_expected: impl Fn(usize) -> bool) {
    let waiting = async { while !is_expected(places_free(it).await) {} };
    tokio::time::timeout(LONG, waiting).await.expect("slots are taken and freed");
}

/// A session of a slow method, and readings that take seconds.
async fn heavy(it: &Harness) -> (String, Value) {
    add_letters(it, &['A', 'E']).await;
    train(it, &json!({"geometric": {"kind": "planar"}})).await;
    let plane = json!({"kind": "planar", "plane": {"position": [0.0, 0.0, 0.0],
        "orientation": [0.0, 0.0, 0.0, 1.0]}});
    let request =
        json!({"method": "geometric_particles", "particles": 100_000, "pose_prior": plane});
    let session = it.session(request).await;
    let readings = presses('A', 10, 5, Pose::IDENTITY);
    let readings: Vec<&Value> = readings.iter().cycle().take(80).collect();
    (session, json!({"readings": readings}))
}

#[tokio::test(flavor = "multi_thread")]
async fn computations_end_when_the_caller_has_gone() {
    let it = Harness::start().await;
    let (session, body) = heavy(&it).await;
    let all = places_free(&it).await;
    let path = format!("/v1/sessions/{session}");
    let posted = it
        .client
        .post(it.url(&format!("{path}/readings")))
        .header("content-type", "application/json")
        .timeout(Duration::from_millis(500))
        .body(body.to_string());
    posted.send().await.expect_err("it takes longer than its caller waits");
    until_free(&it, |n| n >= all).await;

    // The readings are stored and the folded part is kept: a repeated request goes on where one
    // ended. On a busy machine a single reading may take seconds, so each waits longer.
    let mut wait = Duration::from_millis(500);
    let mut asked = 0;
    let belief = loop {
        assert!(asked < 80, "repeated requests make no progress");
        asked += 1;
        let request = it.client.get(it.url(&format!("{path}/belief"))).timeout(wait);
        // The server may give up first, with 503.
        if let Ok(answer) = request.send().await
            && answer.status() != StatusCode::SERVICE_UNAVAILABLE
        {
            break read(answer).await.expect(200);
        }
        wait = LONG.min(wait.mul_f64(1.5));
    };
    assert!(asked > 1, "all of them were folded for nobody");
    assert_eq!(belief["revision"], 80);
}

#[tokio::test(flavor = "multi_thread")]
async fn listings_run_on_the_compute_threads() {
    let it = Harness::start_with(|config| {
        config.compute_threads = 1;
        config.compute_queue_max = 0;
    })
    .await;
    let (session, body) = heavy(&it).await;
    let path = format!("/v1/sessions/{session}/readings");
    let posting = it.post(&path, &body);
    let listed = async {
        until_free(&it, |n| n == 0).await;
        for path in ["/v1/objects", "/v1/sessions", "/v1/jobs", &path] {
            let refused = it.get(path).await;
            refused.problem(503, "overloaded", None);
            assert_eq!(refused.headers["ratelimit-policy"], "\"compute\";q=1;qu=\"places\"");
        }
    };
    tokio::select! {
        posted = posting => panic!("it is not heavy: {posted:?}"),
        () = listed => {}
    }
}
