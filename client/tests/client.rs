//! The client against a small stand-in of a server that misbehaves on purpose.
#![allow(clippy::unwrap_used, reason = "tests may panic, helpers outside of test functions too")]

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use axum::Router;
use axum::http::{StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use axum::routing::any;
use palpate_client::schemas::{
    AddReadings, BeliefDetail, BeliefQuery, CreateObject, CreateSession, ExplainQuery, JobState,
    LabelledQuery, PageQuery, Pose, ProblemType, Reading, ReadingsQuery, ReplayQuery, SetCurrent,
    Stamp,
};
use palpate_client::{Client, ClientOptions, Error, RetryPolicy, Touch};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;
use uuid::Uuid;

const OBJECT: &str = r#"{"id":"00000000-0000-0000-0000-000000000001","name":"mug",
    "description":"","mesh":null,"n_readings":0,"created_at":"","updated_at":""}"#;
const SESSION: &str = r#"{"id":"00000000-0000-0000-0000-000000000002","catalogue":"default",
    "version":1,"method":"sva","frame_id":null,"state":"open","n_readings":0,"ttl_s":null,
    "created_at":"","closed_at":null}"#;
const ADDED: &str = r#"{"session":"00000000-0000-0000-0000-000000000002","n_new":1,
    "n_repeated":0,"n_readings":1,"belief":null}"#;

fn job(state: &str, done: u32) -> String {
    format!(
        r#"{{"id":"00000000-0000-0000-0000-000000000003","catalogue":"default",
        "state":"{state}","stage":null,"done":{done},"total":10,"eta_s":null,"training":{{}},
        "version":null,"reason":null,"created_at":"","started_at":null,"finished_at":null}}"#
    )
    .replace('\n', " ")
}

/// Serves every request by `answer`, which is told how many came before.
async fn serve(
    answer: impl Fn(usize) -> Response + Clone + Send + Sync + 'static,
) -> (Client, Arc<AtomicUsize>) {
    let count = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&count);
    let handler = move || {
        let answer = answer(counted.fetch_add(1, Ordering::SeqCst));
        async move { answer }
    };
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let app = Router::new().fallback(any(handler));
    tokio::spawn(async move { axum::serve(listener, app).await.unwrap() });
    (client(address), count)
}

fn client(address: SocketAddr) -> Client {
    let retry = RetryPolicy {
        attempts_max: 3,
        pause_min: Duration::from_millis(1),
        pause_max: Duration::from_secs(5),
    };
    let options = ClientOptions {
        retry,
        request_timeout: Duration::from_millis(500),
        ..ClientOptions::default()
    };
    Client::with_options(&format!("http://{address}"), options).unwrap()
}

fn refused(status: u16, retry_after: &'static str) -> Response {
    (StatusCode::from_u16(status).unwrap(), [("retry-after", retry_after)], "busy").into_response()
}

fn mug() -> CreateObject {
    CreateObject { name: "mug".to_owned(), ..CreateObject::default() }
}

fn reading(robot: Option<&str>) -> AddReadings {
    let reading = Reading {
        robot: robot.map(str::to_owned),
        seq: robot.map(|_| 1),
        sensor: "s".to_owned(),
        frame_id: None,
        stamp: None,
        pose: Some(Pose { position: [0.0; 3], orientation: [0.0, 0.0, 0.0, 1.0] }),
        image: vec![None],
        feature: None,
        approach_m: None,
        object_moved: None,
        contact: None,
        shear: None,
    };
    AddReadings { readings: vec![reading] }
}

#[tokio::test]
async fn a_busy_server_is_asked_again_when_it_says() {
    let (client, count) = serve(|n| match n {
        0 => refused(503, "1"),
        _ => OBJECT.into_response(),
    })
    .await;
    let begun = Instant::now();
    assert_eq!(client.object("mug").await.unwrap().name, "mug");
    assert_eq!(count.load(Ordering::SeqCst), 2);
    assert!(begun.elapsed() >= Duration::from_secs(1), "Retry-After was not honoured");
}

#[tokio::test]
async fn a_busy_server_may_say_when_by_a_date() {
    let (client, count) = serve(|n| match n {
        0 => {
            let dates = [
                ("date", "Fri, 27 Nov 2026 20:42:00 GMT"),
                ("retry-after", "Fri, 27 Nov 2026 20:42:01 GMT"),
            ];
            (StatusCode::SERVICE_UNAVAILABLE, dates, "busy").into_response()
        }
        _ => OBJECT.into_response(),
    })
    .await;
    let begun = Instant::now();
    assert_eq!(client.object("mug").await.unwrap().name, "mug");
    assert_eq!(count.load(Ordering::SeqCst), 2);
    assert!(begun.elapsed() >= Duration::from_secs(1), "Retry-After was not honoured");
}

#[tokio::test]
async fn what_a_query_asks_for_reaches_the_server() {
    let (asked, mut heard) = tokio::sync::mpsc::unbounded_channel();
    let handler = move |uri: Uri| {
        asked.send(uri.to_string()).unwrap();
        async { StatusCode::NOT_FOUND }
    };
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let client = client(listener.local_addr().unwrap());
    let app = Router::new().fallback(any(handler));
    tokio::spawn(async move { axum::serve(listener, app).await.unwrap() });
    let query = BeliefQuery { poses: Some(2), at: Some(7) };
    assert!(client.belief(Uuid::nil(), query).await.is_err());
    let belief = format!("/v1/sessions/{}/belief?poses=2&at=7", Uuid::nil());
    assert_eq!(heard.recv().await.unwrap(), belief);
    let page = PageQuery { limit: Some(1000), cursor: Some("1000".to_owned()) };
    assert!(client.object_map("default", 3, "mug", &page).await.is_err());
    let map = "/v1/catalogues/default/versions/3/objects/mug/map?limit=1000&cursor=1000";
    assert_eq!(heard.recv().await.unwrap(), map);
    let session = format!("/v1/sessions/{}", Uuid::nil());
    let detail = BeliefDetail::Top;
    assert!(client.retract_robot_reading(Uuid::nil(), "arm/ü", 4, detail).await.is_err());
    let reading = format!("{session}/readings/arm%2F%C3%BC/4?belief=top");
    assert_eq!(heard.recv().await.unwrap(), reading);
    assert!(client.retract_reading(Uuid::nil(), 9, BeliefDetail::None).await.is_err());
    assert_eq!(heard.recv().await.unwrap(), format!("{session}/readings/9?belief=none"));
    let query = ReplayQuery { upto: Some(8), after: Some(2), limit: Some(3), poses: Some(0) };
    assert!(client.replay(Uuid::nil(), query).await.is_err());
    let replay = format!("{session}/replay?upto=8&after=2&limit=3&poses=0");
    assert_eq!(heard.recv().await.unwrap(), replay);
    assert!(client.explain(Uuid::nil(), ExplainQuery { at: Some(5) }).await.is_err());
    assert_eq!(heard.recv().await.unwrap(), format!("{session}/explain?at=5"));
    assert!(client.session_readings(Uuid::nil(), &page).await.is_err());
    let readings = format!("{session}/readings?limit=1000&cursor=1000");
    assert_eq!(heard.recv().await.unwrap(), readings);
}

#[tokio::test]
async fn attempts_are_bounded_and_the_last_error_is_told() {
    let (client, count) = serve(|_| refused(503, "0")).await;
    let error = client.create_object(&mug()).await.unwrap_err();
    assert_eq!((error.status(), count.load(Ordering::SeqCst)), (Some(503), 3));
    assert!(error.to_string().contains("busy"), "{error}");
}

#[tokio::test]
async fn a_wish_that_is_too_long_is_left_to_the_caller() {
    let (client, count) = serve(|_| refused(429, "3600")).await;
    let error = client.object("mug").await.unwrap_err();
    assert_eq!(error.retry_after(), Some(Duration::from_secs(3600)));
    assert_eq!(count.load(Ordering::SeqCst), 1);
}

#[tokio::test]
async fn what_may_have_been_done_is_not_done_twice() {
    let bad_gateway = |n| match n {
        0 => StatusCode::BAD_GATEWAY.into_response(),
        _ => OBJECT.into_response(),
    };
    let (client, count) = serve(bad_gateway).await;
    assert!(client.create_object(&mug()).await.is_err());
    assert_eq!(count.load(Ordering::SeqCst), 1);
    let (client, _) = serve(bad_gateway).await;
    assert!(client.object("mug").await.is_ok());
}

/// A server that reads a request and hangs up, then serves well.
async fn hangs_up_once(answer: &'static str) -> Client {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async move {
        for attempt in 0.. {
            let (mut connection, _) = listener.accept().await.unwrap();
            let mut request = vec![0; 4096];
            let _ = connection.read(&mut request).await;
            if attempt > 0 {
                let head = "HTTP/1.1 200 OK\r\nconnection: close\r\ncontent-length:";
                let response = format!("{head} {}\r\n\r\n{answer}", answer.len());
                connection.write_all(response.as_bytes()).await.unwrap();
            }
        }
    });
    client(address)
}

#[tokio::test]
async fn numbered_readings_are_sent_again_when_the_connection_broke() {
    let client = hangs_up_once(ADDED).await;
    let session = serde_json::from_str::<palpate_client::schemas::Session>(SESSION).unwrap();
    let query = ReadingsQuery::default();
    let added = client.add_readings(session.id, &reading(Some("arm")), query).await.unwrap();
    assert_eq!(added.n_new, 1);
}

#[tokio::test]
async fn readings_without_numbers_are_not_sent_again() {
    let client = hangs_up_once(ADDED).await;
    let session = serde_json::from_str::<palpate_client::schemas::Session>(SESSION).unwrap();
    let query = ReadingsQuery::default();
    let error = client.add_readings(session.id, &reading(None), query).await.unwrap_err();
    assert!(matches!(error, Error::Broken { .. }), "{error}");
}

#[tokio::test]
async fn nobody_there_is_said_as_such() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    drop(listener);
    let error = client(address).version().await.unwrap_err();
    assert!(error.is_unreachable() && matches!(error, Error::Unreachable { .. }), "{error}");
    assert!(error.to_string().contains(&address.to_string()), "{error}");
}

#[tokio::test]
async fn a_silent_server_runs_into_the_time_out() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let options = ClientOptions {
        request_timeout: Duration::from_millis(50),
        retry: RetryPolicy::never(),
        ..ClientOptions::default()
    };
    let address = format!("http://{}", listener.local_addr().unwrap());
    let client = Client::with_options(&address, options).unwrap();
    let error = client.alive().await.unwrap_err();
    assert!(matches!(error, Error::TimedOut { .. }), "{error}");
}

#[tokio::test]
async fn the_servers_words_are_kept() {
    let problem = r#"{"type":"urn:palpate:problem:invalid-value","title":"Invalid value",
        "status":422,"detail":"name is empty","instance":"/v1/objects","request_id":"r1",
        "errors":[{"pointer":"/name","detail":"expected 1 to 64 letters"}]}"#;
    let (client, count) =
        serve(move |_| (StatusCode::UNPROCESSABLE_ENTITY, problem).into_response()).await;
    let error = client.create_object(&mug()).await.unwrap_err();
    assert_eq!(error.kind(), Some(ProblemType::InvalidValue));
    assert_eq!(error.problem().unwrap().errors[0].pointer, "/name");
    assert_eq!(count.load(Ordering::SeqCst), 1);
}

#[tokio::test]
async fn an_answer_of_another_type_is_named() {
    let (client, _) = serve(|_| "{}".into_response()).await;
    let error = client.objects(&LabelledQuery::default()).await.unwrap_err();
    assert!(matches!(error, Error::Unexpected { .. }), "{error}");
    assert!(error.to_string().contains("items"), "{error}");
}

#[tokio::test]
async fn a_switch_names_the_revision_it_has_seen() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let seen = tokio::spawn(async move {
        let (mut connection, _) = listener.accept().await.unwrap();
        let mut request = vec![0; 4096];
        let length = connection.read(&mut request).await.unwrap();
        String::from_utf8_lossy(&request[..length]).into_owned()
    });
    let _ = client(address).set_current_version("default", 2, 7).await;
    let request = seen.await.unwrap();
    assert!(request.starts_with("PUT /v1/catalogues/default/current "), "{request}");
    assert!(request.contains("if-match: \"7\""), "{request}");
    let body = serde_json::to_string(&SetCurrent { version: 2 }).unwrap();
    assert!(request.ends_with(&body), "{request}");
}

#[tokio::test]
async fn a_job_is_followed_though_its_stream_breaks() {
    let events = |jobs: &[String]| {
        let events: String =
            jobs.iter().map(|job| format!(": keep-alive\n\nid: 1\ndata: {job}\n\n")).collect();
        ([("content-type", "text/event-stream")], events).into_response()
    };
    // A stream that ends early; the job itself; a stream that cannot be opened; the job; the end.
    let (client, count) = serve(move |n| match n {
        0 => events(&[job("queued", 0), job("running", 1)]),
        1 => job("running", 2).into_response(),
        2 => StatusCode::BAD_GATEWAY.into_response(),
        3 => job("running", 3).into_response(),
        _ => events(&[job("running", 9), job("succeeded", 10)]),
    })
    .await;
    let mut seen = Vec::new();
    let id = uuid::Uuid::from_u128(3);
    let ended = client.follow_job(id, |job| seen.push(job.done)).await.unwrap();
    assert_eq!(ended.state, JobState::Succeeded);
    assert_eq!(seen, [0, 1, 2, 3, 9, 10]);
    assert_eq!(count.load(Ordering::SeqCst), 5);
}

#[tokio::test]
async fn readings_are_numbered_and_a_failed_one_keeps_its_number() {
    let belief = r#"{"session":"00000000-0000-0000-0000-000000000002","revision":1,
        "n_readings":1,"objects":[],"entropy_bits":0.0,"poses":[]}"#;
    let added = ADDED.replace("\"belief\":null", &format!("\"belief\":{belief}"));
    let (client, _) = serve(move |n| match n {
        0 => SESSION.into_response(),
        1 => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
        _ => added.clone().into_response(),
    })
    .await;
    let mut session = client.touch_session(&CreateSession::default(), "arm").await.unwrap();
    let pose = Pose { position: [0.0; 3], orientation: [0.0, 0.0, 0.0, 1.0] };
    assert!(session.touch("s", pose, vec![None]).await.is_err());
    assert_eq!(session.touch("s", pose, vec![None]).await.unwrap().n_readings, 1);
}

#[tokio::test]
async fn readings_are_stamped_and_a_repeat_keeps_its_stamp() {
    let (asked, mut heard) = tokio::sync::mpsc::unbounded_channel::<String>();
    let belief = r#"{"session":"00000000-0000-0000-0000-000000000002","revision":1,
        "n_readings":1,"objects":[],"entropy_bits":0.0,"poses":[]}"#;
    let added = ADDED.replace("\"belief\":null", &format!("\"belief\":{belief}"));
    let count = Arc::new(AtomicUsize::new(0));
    let handler = move |uri: Uri, body: String| {
        let (asked, added) = (asked.clone(), added.clone());
        let n = count.fetch_add(1, Ordering::SeqCst);
        async move {
            if !uri.path().ends_with("/readings") {
                return SESSION.into_response();
            }
            asked.send(body).unwrap();
            // The first answer is lost, the third press is refused.
            match n {
                1 => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
                3 => StatusCode::UNPROCESSABLE_ENTITY.into_response(),
                _ => added.into_response(),
            }
        }
    };
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let client = client(listener.local_addr().unwrap());
    let app = Router::new().fallback(any(handler));
    tokio::spawn(async move { axum::serve(listener, app).await.unwrap() });
    let mut session = client.touch_session(&CreateSession::default(), "arm").await.unwrap();
    let given = Stamp { sec: 3, nanosec: 5 };
    let press = Touch {
        sensor: "s".to_owned(),
        pose: None,
        image: vec![None],
        approach_m: None,
        ..Touch::default()
    };
    assert!(session.send(press.clone()).await.is_err());
    assert!(session.send(press.clone()).await.is_ok());
    assert!(session.send(press.clone()).await.is_err());
    assert!(session.send(press.clone()).await.is_ok());
    assert!(session.send(Touch { stamp: Some(given), ..press }).await.is_ok());
    let mut sent = Vec::new();
    while sent.len() < 5 {
        let body: AddReadings = serde_json::from_str(&heard.recv().await.unwrap()).unwrap();
        let reading = &body.readings[0];
        sent.push((reading.seq.unwrap(), reading.stamp.unwrap()));
    }
    let numbers: Vec<u64> = sent.iter().map(|(seq, _)| *seq).collect();
    assert_eq!(numbers, [0, 0, 1, 1, 2]);
    let at = |place: usize| (sent[place].1.sec, sent[place].1.nanosec);
    assert_eq!(at(0), at(1), "sent again, it is the same reading");
    assert!(at(0).0 > 1_700_000_000 && at(1) < at(2) && at(2) < at(3), "{sent:?}");
    assert_eq!(sent[4].1, given);
}

#[test]
fn an_address_that_is_none_is_refused() {
    for address in ["", "palpate", "ftp://host", "http://", "127.0.0.1:7411"] {
        let error = Client::new(address).unwrap_err();
        assert!(matches!(error, Error::Address { .. }), "{address}: {error}");
    }
    assert_eq!(Client::new("http://host:1/").unwrap().address(), "http://host:1");
    assert!(Client::new("https://host").is_ok());
}
