//! Everything that ends or is deleted by age, with a clock that jumps: nothing is lost by a jump, and
//! ages go on. A program of its own, because the clock is that of all servers in a process.

#![expect(clippy::unwrap_used, reason = "a test fails where it unwraps")]

#[path = "http/harness.rs"]
#[expect(dead_code, reason = "other tests use the rest")]
mod harness;

use std::time::{Duration, Instant};

use palpate_core::pose::Pose;
use palpate_server::{Access, set_clock_ahead};
use reqwest::Method;
use serde_json::{Value, json};

use harness::{CUBE, Harness, touches};

const DAY_MS: i64 = 86_400_000;
/// Time for which ended sessions are kept, which is also the pause between two looks at them.
const KEPT: Duration = Duration::from_secs(10);

fn reading() -> Value {
    json!({"readings": touches(CUBE, 1, 5, Pose::IDENTITY)})
}

/// What ends by age, or could: its name, and the path at which it is found.
struct Things {
    rows: Vec<(&'static str, String)>,
    /// Secrets of a key that expires, and of one that was replaced with a time of grace.
    secrets: Vec<String>,
    closed: String,
    open: Vec<String>,
}

impl Things {
    async fn new(it: &Harness) -> Self {
        let short = json!({"name": "short", "role": "viewer", "expires_in_s": 3600});
        let short = it.post("/v1/keys", &short).await.expect(201);
        let replaced = it.new_key("replaced", "viewer").await;
        it.post("/v1/keys/replaced/rotate", &json!({"grace_s": 3600})).await.expect(200);
        let hook = json!({"url": "https://mes.example/x", "events": ["training.finished"]});
        let hook = it.post("/v1/webhooks", &hook).await.expect(201);
        let (idle, leased) = (json!({"ttl_s": 3600}), json!({"ttl_s": 5}));
        let open = vec![it.session(idle).await, it.session(leased).await];
        let lease = format!("/v1/sessions/{}/lease", open[1]);
        it.post(&lease, &json!({"seconds": 3600})).await.expect(200);
        let closed = it.session(json!({})).await;
        it.post(&format!("/v1/sessions/{closed}/readings"), &reading()).await.expect(200);
        it.post(&format!("/v1/sessions/{closed}/close"), &json!({})).await.expect(200);
        let job =
            it.get("/v1/jobs").await.expect(200)["items"][0]["id"].as_str().unwrap().to_owned();
        let rows = vec![
            ("a session without readings", format!("/v1/sessions/{}", open[0])),
            ("a session with a lease", format!("/v1/sessions/{}", open[1])),
            ("an ended session", format!("/v1/sessions/{closed}/readings")),
            ("a key that expires", "/v1/keys/short".to_owned()),
            ("a job", format!("/v1/jobs/{job}")),
            ("a picture", "/v1/objects/cube/thumbnail.png".to_owned()),
            ("a webhook", format!("/v1/webhooks/{}", hook["webhook"]["id"].as_str().unwrap())),
            ("the first entries of the audit log", "/v1/audit?operation=rotate_key".to_owned()),
        ];
        let secrets = vec![short["secret"].as_str().unwrap().to_owned(), replaced];
        Self { rows, secrets, closed, open }
    }

    async fn are_there(&self, it: &Harness, when: &str) {
        for (what, path) in &self.rows {
            let found = it.get(path).await;
            assert_eq!(found.status, 200, "{what} {when}: {}", found.text);
            assert!(!found.text.contains("\"items\":[]"), "{what} {when}: {}", found.text);
        }
        for session in &self.open {
            let shown = it.get(&format!("/v1/sessions/{session}")).await.expect(200);
            assert_eq!(shown["state"], "open", "{when}: {shown}");
            let path = format!("/v1/sessions/{session}/readings");
            it.post(&path, &reading()).await.expect(200);
        }
    }

    async fn keys_are_valid(&self, it: &Harness, when: &str) {
        for secret in &self.secrets {
            let known = it.send_as(Some(secret), Method::GET, "/v1/whoami").await;
            assert_eq!(known.status, 200, "{when}: {}", known.text);
        }
    }
}

async fn until(begin: Instant, s: f64) {
    tokio::time::sleep(Duration::from_secs_f64(s).saturating_sub(begin.elapsed())).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_clock_that_jumps_ends_and_deletes_nothing() {
    let it = Harness::trained_with(|config| {
        config.access = Access::Keys;
        config.session_kept = Some(KEPT);
    })
    .await;
    let begin = Instant::now();
    let things = Things::new(&it).await;
    things.are_there(&it, "before").await;
    things.keys_are_valid(&it, "before").await;
    // Ended sessions are looked at ten seconds after the start.
    set_clock_ahead(2 * DAY_MS);
    until(begin, 12.0).await;
    things.are_there(&it, "while the clock is ahead").await;
    set_clock_ahead(0);
    things.are_there(&it, "after the clock was ahead").await;
    things.keys_are_valid(&it, "after the clock was ahead").await;
    set_clock_ahead(-365 * DAY_MS);
    until(begin, 14.0).await;
    things.are_there(&it, "while the clock is behind").await;
    set_clock_ahead(0);
    things.are_there(&it, "after the clock was behind").await;
    // With a clock that is right, what is old enough goes.
    let path = format!("/v1/sessions/{}", things.closed);
    while it.get(&path).await.status == 200 {
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    let mut left = Things { rows: things.rows, ..things };
    left.rows.retain(|(what, _)| *what != "an ended session");
    // A start with a clock that is ahead.
    set_clock_ahead(30 * DAY_MS);
    let it = it
        .restart_with(|config| {
            config.access = Access::Keys;
            config.session_kept = Some(KEPT);
        })
        .await;
    left.are_there(&it, "after a start with a clock that is ahead").await;
    set_clock_ahead(0);
    left.are_there(&it, "after that").await;
    left.keys_are_valid(&it, "after that").await;
}
