//! The attacks of the second review, each of which once worked: what a stranger can make grow,
//! lists of nothings, costs that no count shows, and a second way in.
//!
//! Not here: 2.7, a clock that jumps (`server/tests/clock.rs`), and 2.14, another program that uses
//! up the disk's reserve (`another_program_cannot_use_up_the_reserve` in
//! `store/tests/store/keeping.rs`).

use std::net::{IpAddr, Ipv4Addr};
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use reqwest::{Client, Method};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};

use super::attacks::{Prey, rest};
use super::foe::Foe;
use crate::http::{Outcome, client_with, send};

/// Bytes of padding of an invented method.
const PADDING: usize = 20_000;
/// Bytes of a body of nothings.
const NOTHINGS: usize = 8 << 20;
/// Robots with a loose base in one session.
const BASES: usize = 30;
/// Readings of a batch that no object explains.
const CONTRADICTIONS: usize = 1000;
/// Addresses of each attacker that open connections, and connections of each.
const ADDRESSES: u8 = 4;
const CONNECTIONS: usize = 400;
/// Calibrations of the sensor whose package attackers fetch.
const CALIBRATIONS: usize = 100;
/// Time that the slow receiver of webhooks takes for each event.
const RECEIVER_PAUSE: Duration = Duration::from_millis(300);
/// Maximum time until the receiver hears of a training beside washed events.
const HEARD_PATIENCE: Duration = Duration::from_secs(90);
/// Name of the sensor with many calibrations.
const PAD: &str = "pad-of-many";

/// Sends unknown methods over one connection.
pub(super) async fn invented_methods(foe: &Foe) -> Vec<String> {
    let padding = "M".repeat(PADDING);
    let mut connection: Option<TcpStream> = None;
    let mut n = 0;
    while foe.goes_on() {
        n += 1;
        if connection.is_none() {
            connection = foe.connect(foe.address()).await;
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
        let Some(stream) = &mut connection else { continue };
        foe.count();
        let said =
            format!("M{}X{n}{padding} /livez HTTP/1.1\r\nHost: localhost\r\n\r\n", foe.number);
        let mut answer = [0; 4096];
        let asked = async {
            stream.write_all(said.as_bytes()).await?;
            stream.read(&mut answer).await
        };
        let answered = tokio::time::timeout(Duration::from_secs(3), asked).await;
        if !matches!(answered, Ok(Ok(1..))) {
            connection = None;
        }
    }
    Vec::new()
}

/// Sends lists whose items take a few bytes on the wire and many in memory.
pub(super) async fn nothings(foe: &Foe, prey: &Prey) -> Vec<String> {
    let session = format!("/v1/sessions/{}", prey.long_session);
    let json_list = |before: &str, item: &str, after: &str| {
        let n = NOTHINGS / item.len();
        [before, &item.repeat(n), item.trim_end_matches(','), after].concat().into_bytes()
    };
    // {"readings": [{"sensor": ""}, …]} in MessagePack: an array of 32 bits of length.
    let n = NOTHINGS / 9;
    let mut packed = b"\x81\xa8readings\xdd".to_vec();
    packed.extend((n as u32).to_be_bytes());
    packed.extend(b"\x81\xa6sensor\xa0".repeat(n));
    let bodies = [
        ("forwarded", "application/json", json_list("{\"from\":0,\"entries\":[", "{},", "]}")),
        ("readings", "application/json", json_list("{\"readings\":[", "{},", "]}")),
        ("readings", "application/json", json_list("{\"readings\":[{\"image\":[", "1,", "]}]}")),
        ("readings", "application/msgpack", packed),
    ];
    let mut worked = Vec::new();
    while foe.goes_on() {
        for (path, content_type, body) in &bodies {
            foe.count();
            let url = format!("{}{session}/{path}", foe.url);
            let request = foe.robot.post(url).header("content-type", *content_type);
            let answer = request.body(body.clone()).send().await;
            if let Ok(answer) = answer
                && answer.status().is_success()
            {
                worked.push(format!("a list of nothings was taken: {path} as {content_type}"));
            }
        }
    }
    worked
}

/// Opens a session and returns its path.
async fn opened(foe: &Foe, body: &Value) -> Option<String> {
    let (status, made) = foe.ask(&foe.robot, Method::POST, "/v1/sessions", Some(body)).await?;
    let id = made["id"].as_str().filter(|_| status == 201)?;
    Some(format!("/v1/sessions/{id}"))
}

/// Posts readings of many robots whose bases are hardly known.
pub(super) async fn loose_bases(foe: &Foe, prey: &Prey) -> Vec<String> {
    let name = |n: usize| format!("loose-{}-{n}", foe.number);
    let base = json!({"position_m": 0.1, "angle_rad": 1.0});
    let robots: Vec<Value> = (0..BASES).map(|n| json!({"robot": name(n), "base": base})).collect();
    let session = json!({"catalogue": "default", "robots": robots});
    while foe.goes_on() {
        let Some(path) = opened(foe, &session).await else { continue };
        let reading = |n: usize| {
            let mut reading = prey.touches[n % prey.touches.len()].clone();
            (reading["robot"], reading["seq"]) = (json!(name(n)), json!(0));
            reading
        };
        let readings: Vec<Value> = (0..BASES).map(reading).collect();
        let body = json!({ "readings": readings });
        foe.ask(&foe.robot, Method::POST, &format!("{path}/readings"), Some(&body)).await;
    }
    Vec::new()
}

/// Posts a thousand readings at once that no object explains.
pub(super) async fn contradictions(foe: &Foe, prey: &Prey) -> Vec<String> {
    let readings: Vec<&Value> = prey.touches.iter().cycle().take(CONTRADICTIONS).collect();
    let body = json!({ "readings": readings });
    while foe.goes_on() {
        let Some(path) = opened(foe, &json!({"catalogue": "default"})).await else { continue };
        foe.ask(&foe.robot, Method::POST, &format!("{path}/readings"), Some(&body)).await;
    }
    Vec::new()
}

/// Opens silent connections from several addresses.
pub(super) async fn many_addresses(foe: &Foe) -> Vec<String> {
    for n in 0..ADDRESSES {
        let address: IpAddr = Ipv4Addr::new(127, 0, 1 + foe.number, n).into();
        for _ in 0..CONNECTIONS {
            if !foe.goes_on() {
                break;
            }
            foe.count();
            if let Some(stream) = foe.connect(address).await {
                foe.held.lock().unwrap_or_else(PoisonError::into_inner).push(stream);
            }
        }
    }
    rest(foe).await
}

/// Forwards readings in the name of other keys' robots, and sessions of times to come.
pub(super) async fn forwarded(foe: &Foe, prey: &Prey) -> Vec<String> {
    let Some(set) = &prey.set else { return Vec::new() };
    let mut worked = Vec::new();
    let body = json!({"cell": format!("foe-{}", foe.number), "version_hash": set.version_hash,
        "session": {"catalogue": "default", "version": 1}});
    let mut turn = usize::from(foe.number);
    while foe.goes_on() {
        turn += 1;
        for time in ["ffffffff-ffff", "0190ffff-ffff"] {
            let id = format!("{time}-7{:03x}-8{:03x}-{turn:012x}", foe.number, foe.number);
            let path = format!("/v1/sessions/{id}");
            let made = foe.ask(&foe.robot, Method::PUT, &path, Some(&body)).await;
            let Some((200, _)) = made else { continue };
            if time.starts_with('f') {
                worked.push(format!("a session of the year 10889 was made: {id}"));
            }
            let (name, _) = &prey.robots[turn % prey.robots.len()];
            let mut reading = prey.touches[0].clone();
            (reading["robot"], reading["seq"]) = (json!(name), json!(1_000_000 + turn));
            let entries = json!({"from": 0, "entries": [{ "reading": reading }]});
            let path = format!("{path}/forwarded");
            let answer = foe.ask(&foe.robot, Method::POST, &path, Some(&entries)).await;
            if let Some((200, body)) = answer {
                worked.push(format!("forwarded as {name}: {body}"));
            }
        }
    }
    worked
}

/// Makes decisions, each of which is an event for the webhooks, beside a training whose end is one.
pub(super) async fn washed_outbox(foe: &Foe, prey: &Prey) -> Vec<String> {
    let Some(set) = &prey.set else { return Vec::new() };
    if foe.number == 0 {
        let training = json!({"objects": ["cube", "bar"], "readings_per_object": 60,
            "n_classes": 8, "seed": 5});
        let path = format!("{}/v1/catalogues/washed/trainings", foe.url);
        send(&set.trainer, Method::POST, path, Some(&training)).await;
    }
    let session = json!({"catalogue": "default", "risk": 0.4});
    let body = json!({ "readings": prey.touches[..8] });
    while foe.goes_on() {
        let Some(path) = opened(foe, &session).await else { continue };
        foe.ask(&foe.robot, Method::POST, &format!("{path}/readings"), Some(&body)).await;
        foe.ask(&foe.robot, Method::DELETE, &path, None).await;
    }
    Vec::new()
}

/// Fetches the package of a sensor with many calibrations.
pub(super) async fn packages(foe: &Foe) -> Vec<String> {
    let path = format!("/v1/sensors/{PAD}/package");
    while foe.goes_on() {
        foe.ask(&foe.viewer, Method::GET, &path, None).await;
    }
    Vec::new()
}

/// Requests a training whose readings take more memory than the server has.
pub(super) async fn large_training(foe: &Foe, prey: &Prey) -> Vec<String> {
    let Some(set) = &prey.set else { return Vec::new() };
    let mut worked = Vec::new();
    let path = format!("/v1/catalogues/huge-{}/trainings", foe.number);
    let training = json!({"objects": ["cube", "bar"], "sensor": set.large_sensor,
        "readings_per_object": 20_000, "seed": 1});
    while foe.goes_on() {
        foe.count();
        let asked = send(&set.trainer, Method::POST, format!("{}{path}", foe.url), Some(&training));
        if let Outcome::Done(job) = asked.await {
            worked.push(format!("was taken: {job}"));
            let job = format!("{}/v1/jobs/{}/cancel", foe.url, job["id"].as_str().unwrap_or(""));
            send(&set.trainer, Method::POST, job, None).await;
        }
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    worked
}

/// Follows the sessions of all honest robots with each of many streams that are never read.
pub(super) async fn wide_streams(foe: &Foe, prey: &Prey) -> Vec<String> {
    let current = |(_, now): &(String, super::honest::Now)| {
        now.lock().unwrap_or_else(PoisonError::into_inner).0.clone()
    };
    let followed: Vec<String> = prey.robots.iter().map(current).collect();
    let said = format!(
        "GET /v1/events?sessions={} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {}\r\n\r\n",
        followed.join(","),
        foe.viewer_key
    );
    for _ in 0..CONNECTIONS {
        if !foe.goes_on() {
            break;
        }
        foe.open(&said).await;
    }
    rest(foe).await
}

/// Sends requests with a second `Host`, and webhooks whose address contains that of a cloud's
/// metadata (ISATAP).
pub(super) async fn disguised(foe: &Foe, prey: &Prey) -> Vec<String> {
    let Some(set) = &prey.set else { return Vec::new() };
    let hook = json!({"url": "http://[::5efe:a9fe:a9fe]/", "events": ["session.decided"]});
    let hook = hook.to_string();
    let disguises = [
        ("GET /v1/sessions", "Host: localhost\r\nHost: evil.example", ""),
        ("POST /v1/webhooks", "Host: localhost", hook.as_str()),
    ];
    let mut worked = Vec::new();
    while foe.goes_on() {
        for (asked, fields, body) in disguises {
            foe.count();
            tokio::time::sleep(Duration::from_millis(5)).await;
            let said = format!(
                "{asked} HTTP/1.1\r\n{fields}\r\nAuthorization: Bearer {}\r\nConnection: close\r\n\
                 Content-Type: application/json\r\nContent-Length: {}\r\n\r\n{body}",
                set.admin_key,
                body.len()
            );
            let Some(mut stream) = foe.connect(foe.address()).await else { continue };
            let mut status = [0; 12];
            let answered = async {
                stream.write_all(said.as_bytes()).await?;
                stream.read_exact(&mut status).await
            };
            let answered = tokio::time::timeout(Duration::from_secs(3), answered).await;
            if matches!(answered, Ok(Ok(_))) && status.starts_with(b"HTTP/1.1 2") {
                worked.push(format!("was let in: {asked} with {fields} {body}"));
            }
        }
    }
    worked
}

/// Everything that these attacks need before they begin.
pub(super) struct Set {
    pub(super) trainer: Client,
    pub(super) admin_key: String,
    pub(super) large_sensor: String,
    pub(super) version_hash: String,
    /// Whether the receiver of webhooks heard of the training in `washed`.
    pub(super) heard: std::sync::Arc<AtomicBool>,
}

/// Makes sensors and a webhook with a slow receiver; the keys are those of attackers.
pub(super) async fn set(
    admin: &Client,
    [trainer_key, admin_key]: [String; 2],
    url: &str,
    indentations: &Value,
) -> anyhow::Result<Set> {
    let trainer = client_with(&trainer_key)?;
    let post = |client: &Client, path: String, body: Value| {
        let client = client.clone();
        async move {
            match send(&client, Method::POST, format!("{url}{path}"), Some(&body)).await {
                Outcome::Done(body) => Ok(body),
                other => anyhow::bail!("cannot set up {path}: {other:?}"),
            }
        }
    };
    let pad = json!({"name": PAD, "preset": "digitacts-6x6"});
    post(&trainer, "/v1/sensors".to_owned(), pad).await?;
    for _ in 0..CALIBRATIONS {
        let path = format!("/v1/sensors/{PAD}/calibration");
        post(&trainer, path, indentations.clone()).await?;
    }
    let large = json!({"name": "wide-skin", "description": {"grid": {"rows": 64, "cols": 64,
        "pitch": 0.001, "taxel_width": 0.0009}, "covering_thickness": 0.00254,
        "saturation": 20_000.0, "noise": 100.0, "quantisation": 78.125}});
    let large = post(&trainer, "/v1/sensors".to_owned(), large).await?;
    let package = format!("{url}/v1/catalogues/default/versions/1/package");
    let package = send(admin, Method::GET, package, None).await.done().unwrap_or_default();
    let heard = std::sync::Arc::new(AtomicBool::new(false));
    let listener = TcpListener::bind("127.0.0.1:0").await?;
    let address = listener.local_addr()?;
    tokio::spawn(receive(listener, std::sync::Arc::clone(&heard)));
    let webhook = json!({"url": format!("http://{address}/events"),
        "events": ["session.decided", "training.finished"]});
    post(admin, "/v1/webhooks".to_owned(), webhook).await?;
    Ok(Set {
        trainer,
        admin_key,
        large_sensor: large["name"].as_str().unwrap_or_default().to_owned(),
        version_hash: package["hash"].as_str().unwrap_or_default().to_owned(),
        heard,
    })
}

/// A slow receiver of webhooks that notes the end of the training in `washed`.
async fn receive(listener: TcpListener, heard: std::sync::Arc<AtomicBool>) {
    while let Ok((mut stream, _)) = listener.accept().await {
        let heard = std::sync::Arc::clone(&heard);
        tokio::spawn(async move {
            let mut said = Vec::new();
            let mut piece = [0; 8192];
            while let Ok(n @ 1..) = stream.read(&mut piece).await {
                said.extend_from_slice(&piece[..n]);
                let text = String::from_utf8_lossy(&said);
                let Some((head, body)) = text.split_once("\r\n\r\n") else { continue };
                let length = head.lines().find_map(|line| {
                    let (name, value) = line.split_once(": ")?;
                    name.eq_ignore_ascii_case("content-length")
                        .then(|| value.parse::<usize>().ok())?
                });
                if body.len() < length.unwrap_or(0) {
                    continue;
                }
                if body.contains("training.finished") && body.contains("washed") {
                    heard.store(true, Ordering::Relaxed);
                }
                tokio::time::sleep(RECEIVER_PAUSE).await;
                let _ = stream.write_all(b"HTTP/1.1 200 OK\r\nContent-Length: 0\r\n\r\n").await;
                said.clear();
            }
        });
    }
}

/// Checks that the receiver hears of the training, although its events were to be washed away.
pub(super) async fn outbox(heard: &AtomicBool) -> Vec<String> {
    let begun = std::time::Instant::now();
    while !heard.load(Ordering::Relaxed) {
        if begun.elapsed() > HEARD_PATIENCE {
            return vec!["the end of a training was washed out of a webhook's outbox".to_owned()];
        }
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    Vec::new()
}
