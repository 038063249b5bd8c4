//! The load tool, against a stand-in with known delays and refusals, and against a real
//! server with small limits.

use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use axum::Router;
use axum::extract::State;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use axum::routing::post;
use palpate_client::{Client, RetryPolicy};
use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::SensorDescription;
use palpate_load::{
    self as load, Arrivals, Counts, LoadConfig, LoadReport, MemorySource, Mix, Operation, Touches,
};
use palpate_schemas::{BeliefDetail, SessionsQuery};
use palpate_server::{Config, Server};
use tokio::time::Instant;

/// Reaction of the stand-in to readings.
#[derive(Clone, Copy)]
enum Readings {
    /// All requests wait while a second passes that begins with the reading of this number.
    StallAt(u64),
    /// No reading is ever answered.
    Never,
    /// All readings are refused with a retry time of an hour.
    Refuse,
}

struct StandIn {
    readings: Readings,
    n: AtomicU64,
    stalled_until: Mutex<Option<Instant>>,
}

fn session(number: u64) -> String {
    format!(
        r#"{{"id":"{}","catalogue":"default","version":1,"method":"surface","frame_id":null,
        "state":"open","n_readings":0,"ttl_s":null,"created_at":"","closed_at":null}}"#,
        uuid::Uuid::from_u128(u128::from(number))
    )
}

async fn add(State(state): State<Arc<StandIn>>) -> Response {
    let number = state.n.fetch_add(1, Ordering::SeqCst);
    match state.readings {
        Readings::StallAt(at) => {
            if number == at {
                let until = Instant::now() + Duration::from_secs(1);
                *state.stalled_until.lock().unwrap() = Some(until);
            }
            let until = *state.stalled_until.lock().unwrap();
            if let Some(until) = until {
                tokio::time::sleep_until(until).await;
            }
        }
        Readings::Never => std::future::pending().await,
        Readings::Refuse => {
            let late = [("retry-after", "3600")];
            return (StatusCode::TOO_MANY_REQUESTS, late, "busy").into_response();
        }
    }
    let added = r#"{"session":"00000000-0000-0000-0000-000000000002","n_new":1,"n_repeated":0,
        "n_readings":1,"belief":null}"#;
    added.into_response()
}

async fn stand_in(readings: Readings) -> Client {
    let state = Arc::new(StandIn { readings, n: AtomicU64::new(0), stalled_until: None.into() });
    let create =
        |State(state): State<Arc<StandIn>>| async move { session(state.n.load(Ordering::SeqCst)) };
    let app = Router::new()
        .route("/v1/sessions", post(create))
        .route("/v1/sessions/{session}/readings", post(add))
        .route("/v1/sessions/{session}/close", post(|| async { session(0) }))
        .with_state(state);
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async move { axum::serve(listener, app).await.unwrap() });
    Client::new(&format!("http://{address}")).unwrap()
}

/// Touches for a stand-in that ignores them.
fn touches() -> Touches {
    let sensor = SensorDescription::digitacts_6x6();
    let image = [Some(0.0); 36];
    let reading = Reading::new(SensorId(1), &sensor, &image, Pose::IDENTITY);
    Touches::new(vec![vec![reading.unwrap()]]).unwrap()
}

fn config(rate: f64, seconds: u64) -> LoadConfig {
    LoadConfig {
        seed: 101,
        catalogue: "load".to_owned(),
        method: None,
        belief: BeliefDetail::Full,
        rates: vec![rate],
        arrivals: Arrivals::Constant,
        duration: Duration::from_secs(seconds),
        warmup: Duration::ZERO,
        soak: None,
        sessions: 8,
        readings_per_session: 1_000,
        mix: "readings=1".parse::<Mix>().unwrap(),
        in_flight_max: 500,
        polite: false,
    }
}

async fn run(config: &LoadConfig, client: &Client, touches: Touches) -> LoadReport {
    let client = client.with_policy(RetryPolicy::never(), Duration::from_secs(20));
    load::run(config, &client, touches, &MemorySource::Metrics, |_| {}).await.unwrap()
}

/// Every request that was due is in exactly one of the counts.
#[track_caller]
fn check_sums(counts: &Counts) {
    let answered = counts.accepted + counts.refused_429 + counts.refused_503 + counts.other;
    assert_eq!(answered + counts.errors, counts.sent, "{counts:?}");
    assert_eq!(counts.sent + counts.not_sent + counts.held_back, counts.offered, "{counts:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stall_delays_every_request_due_meanwhile() {
    let client = stand_in(Readings::StallAt(50)).await;
    let report = run(&config(100.0, 2), &client, touches()).await;
    let step = &report.steps[0];
    assert_eq!((step.counts.offered, step.counts.errors), (200, 0));
    check_sums(&step.counts);
    // About 100 of 200 requests were due in the second of the stall and waited for its end.
    // The slowest tenth, 20, are those of its first 0.2 s: they waited for 0.8 s or longer,
    // and the slowest hundredth, 2, for 0.98 s. A loop that waits for answers would have sent
    // 8 of them.
    let latency = step.accepted_latency.unwrap();
    assert!(latency.p90_ms > 750.0 && latency.p99_ms > 950.0, "{latency:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn unsent_requests_are_counted() {
    let client = stand_in(Readings::Never).await;
    let sender = client.with_policy(RetryPolicy::never(), Duration::from_secs(2));
    let config = LoadConfig { in_flight_max: 5, ..config(100.0, 1) };
    let report = load::run(&config, &sender, touches(), &MemorySource::Metrics, |_| {}).await;
    let step = &report.unwrap().steps[0];
    assert_eq!(step.counts.offered, 100);
    check_sums(&step.counts);
    assert_eq!(step.counts.errors, 5, "the five readings under way are given up");
    assert!(step.counts.not_sent > 50, "{:?}", step.counts);
    assert!(step.messages[0].contains("did not answer in time"), "{:?}", step.messages);
}

#[tokio::test(flavor = "multi_thread")]
async fn polite_robots_wait_as_long_as_retry_after_says() {
    let client = stand_in(Readings::Refuse).await;
    let rude = run(&config(100.0, 1), &client, touches()).await.steps.remove(0);
    let polite = LoadConfig { polite: true, ..config(100.0, 1) };
    let polite = run(&polite, &client, touches()).await.steps.remove(0);
    check_sums(&rude.counts);
    check_sums(&polite.counts);
    assert!(polite.counts.refused_429 >= 8, "each robot was refused once: {:?}", polite.counts);
    assert!(polite.counts.refused_429 < rude.counts.refused_429, "{:?}", polite.counts);
    assert!(polite.counts.held_back > rude.counts.held_back, "{:?}", polite.counts);
    assert!(polite.refused_latency.is_some());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_small_server_refuses_overload_and_keeps_what_it_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let small = Config {
        listen,
        compute_threads: 1,
        compute_queue_max: 1,
        ..Config::new(folder.path().join("data"))
    };
    let server = Server::start(small).await.unwrap();
    let client = Client::new(&format!("http://{}", server.local_addr())).unwrap();
    let quiet = |_: &str, _: usize, _: usize| {};
    load::prepare(&client, "load", 20, 101, &quiet).await.unwrap();
    load::prepare(&client, "load", 20, 101, &quiet).await.unwrap();
    let version = client.current_version("load").await.unwrap().version;
    assert_eq!(version, 1, "what is known is not trained again");
    let touches = Touches::of_catalogue(&client, "load", 5, 101, &quiet).await.unwrap();
    assert_eq!(touches.n_objects(), 10);
    let config = LoadConfig {
        sessions: 40,
        readings_per_session: 6,
        mix: "readings=8,beliefs=1,next-touches=1".parse().unwrap(),
        arrivals: Arrivals::Poisson,
        ..config(500.0, 2)
    };
    let report = run(&config, &client, touches).await;
    let step = &report.steps[0];
    check_sums(&step.counts);
    assert_eq!((step.counts.other, step.counts.errors), (0, 0), "{:?}", step.messages);
    assert!(step.counts.refused_503 > 0 && step.counts.accepted > 50, "{:?}", step.counts);
    let of = |operation| step.operations.iter().find(|o| o.operation == operation).unwrap();
    let mut stored = 0;
    let mut query = SessionsQuery { limit: Some(1000), ..SessionsQuery::default() };
    loop {
        let page = client.sessions(&query).await.unwrap();
        stored += page.items.iter().map(|session| u64::from(session.n_readings)).sum::<u64>();
        query.cursor = page.next_cursor;
        if query.cursor.is_none() {
            break;
        }
    }
    // Refused readings were not stored, accepted ones were.
    assert_eq!(stored, of(Operation::Reading).counts.accepted);
    let closed = of(Operation::Close).counts.accepted;
    assert!(of(Operation::Create).counts.accepted > closed && closed > 0);
    assert!(load::picture(&report).contains("accepted requests"));
    server.shutdown().await;
}
