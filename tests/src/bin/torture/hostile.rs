//! `hostile`: four attackers with stolen keys and their own addresses, beside sixteen honest
//! robots.
//!
//! The server is started for it, with two gigabytes. Each attack once worked in a review and
//! is bounded in count and time. The run counts honest robots that were delayed or refused,
//! requests that should have been refused, and resources that attackers still hold
//! afterwards.

mod aside;
mod attacks;
mod figures;
mod foe;
mod honest;
mod second;
mod verdicts;

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use palpate_core::rng::{Purpose, Stream};
use reqwest::{Client, Method};
use serde::Serialize;
use serde_json::{Value, json};

use crate::http::{Outcome, answer, client, client_with, send};
use crate::kill;
use crate::material::{Material, off_box};
use crate::robot::Robot;
use crate::serving::Serving;
use crate::{Access, Args};
use aside::Aside;
use attacks::{Attack, Prey, attack};
use figures::{cores_used, given_back, looking, metrics_bytes, peak_mb};
use foe::{Foe, Stolen};
use honest::{Honest, Log, Seen};

/// Virtual memory of the server's process, KiB.
const MEMORY_KIB: u64 = 2 << 20;
const HONEST: usize = 16;
const FOES: u8 = 4;
/// Duration of the quiet baseline, as a multiple of an attack's.
const BASELINE: u32 = 2;
/// Number of lines, of 30 bytes each, of the large mesh.
const MESH_LINES: usize = 1_000_000;
/// Largest growth of the metrics' text in one attack, in bytes: series of routes and refusals that
/// were not there before.
const METRICS_GROWTH: usize = 64 << 10;
/// Number of readings of the long session.
const LONG_SESSION: usize = 190;
/// Number of training readings of the large object.
const LARGE_OBJECT: usize = 1000;

/// Maximum number of faults of a kind that are described.
const SAID: usize = 3;

/// Results of the run.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    honest_p99_ratio: f64,
    honest_refused: u64,
    peak_mb: f64,
    held_after_60_s: u64,
    attacks_that_worked: u64,
    honest_p99_ms_before: f64,
    honest_p99_ms_during: f64,
    honest_requests: usize,
    idle_cores_after: f64,
    /// Longest time for which a viewer's list was waited for, on connections of its own.
    viewer_longest_ms: f64,
    attacks: Vec<Told>,
    aside: Vec<Aside>,
    seconds_per_attack: u32,
    seed: u64,
    seconds: f64,
}

/// Results of one attack.
#[derive(Debug, Serialize)]
struct Told {
    attack: &'static str,
    finding: &'static str,
    attempts: u64,
    honest_p99_ratio: f64,
    honest_refused: u64,
    worked: u64,
    viewer_longest_ms: f64,
}

impl Report {
    /// Total of the faults: honest callers that were disturbed, and attacks that succeeded.
    pub(crate) fn faults(&self) -> u64 {
        self.honest_refused + self.held_after_60_s + self.attacks_that_worked
    }
}

/// All participants.
struct Scene {
    serving: Serving,
    admin: Client,
    honest: Vec<Honest>,
    foes: Vec<Foe>,
    prey: Prey,
}

/// Starts a server and runs one attack after the other.
pub(crate) async fn run(
    command: &Path,
    args: &Args,
    say: &dyn Fn(String),
) -> anyhow::Result<Report> {
    let begun = Instant::now();
    let material = Arc::new(Material::new()?);
    let folder = tempfile::tempdir().context("cannot make a folder")?;
    let data = folder.path().join("data");
    let scene = set_the_scene(command, &data, args, &material).await?;
    let Scene { serving, admin, honest, mut foes, prey } = scene;
    let url = serving.url.clone();
    let log = Arc::new(Log::default());
    log.next_window();
    let robots: Vec<_> = honest
        .into_iter()
        .map(|robot| tokio::spawn(robot.work(url.clone(), Arc::clone(&material), Arc::clone(&log))))
        .collect();
    // The first touches are slower: a model is loaded, and all robots start at once.
    tokio::time::sleep(Duration::from_secs(u64::from(args.seconds))).await;
    let before = log.next_window();
    tokio::time::sleep(Duration::from_secs(u64::from(args.seconds * BASELINE))).await;

    let Attacked { mut told, windows, mut faults } =
        attack_in_turn(&admin, &url, &mut foes, &prey, &log, args, say).await;
    log.end();
    for robot in robots {
        robot.await.context("a robot panicked")?;
    }
    let forgotten = verdicts::audit(&admin, &url, &foes).await;
    forgotten.iter().for_each(|fault| say(shortened(fault)));
    faults.extend(forgotten);
    let held_after_60_s = given_back(&admin, &url).await?;
    let idle_cores_after = cores_used(serving.process()).await?;
    let peak_mb = peak_mb(serving.process())?;
    let said = serving.end()?;
    if foes.iter().any(|foe| said.contains(&foe.viewer_key)) {
        say("a key is in the server's log".to_owned());
        faults.push("a key is in the server's log".to_owned());
    }
    let refusals = log.refusals.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone();
    for refusal in refusals.iter().take(SAID) {
        say(shortened(&format!("an honest robot was refused: {refusal}")));
    }

    let within = Duration::from_secs(u64::from(args.seconds));
    let aside = aside::attack(command, folder.path(), within).await?;
    for fault in aside.iter().flat_map(|aside| &aside.faults).take(SAID) {
        say(shortened(fault));
    }
    faults.extend(aside.iter().flat_map(|aside| aside.faults.clone()));

    let before = log.window(before);
    let mut during = Seen::default();
    for (told, window) in told.iter_mut().zip(windows) {
        let seen = log.window(window);
        told.honest_p99_ratio = seen.p99() / before.p99();
        told.honest_refused = seen.refused;
        during.add(&seen);
    }
    Ok(Report {
        honest_p99_ratio: during.p99() / before.p99(),
        honest_refused: before.refused + during.refused,
        peak_mb,
        held_after_60_s,
        attacks_that_worked: faults.len() as u64,
        honest_p99_ms_before: 1e3 * before.p99(),
        honest_p99_ms_during: 1e3 * during.p99(),
        honest_requests: before.requests() + during.requests(),
        idle_cores_after,
        viewer_longest_ms: told.iter().map(|told| told.viewer_longest_ms).fold(0.0, f64::max),
        attacks: told,
        aside,
        seconds_per_attack: args.seconds,
        seed: args.seed,
        seconds: begun.elapsed().as_secs_f64(),
    })
}

/// Results of all attacks: each with the number of its time window.
struct Attacked {
    told: Vec<Told>,
    windows: Vec<usize>,
    faults: Vec<String>,
}

/// Runs one attack after the other.
async fn attack_in_turn(
    admin: &Client,
    url: &str,
    foes: &mut [Foe],
    prey: &Prey,
    log: &Log,
    args: &Args,
    say: &dyn Fn(String),
) -> Attacked {
    let seconds = args.seconds;
    let mut told = Vec::new();
    let mut windows = Vec::new();
    let mut faults = Vec::new();
    for what in Attack::ALL.into_iter().filter(|what| what.is_of(args.review)) {
        windows.push(log.next_window());
        let (name, finding) = what.name();
        for foe in foes.iter_mut() {
            foe.until = Instant::now() + Duration::from_secs(u64::from(seconds));
            foe.attempts = 0.into();
        }
        let metrics_before = metrics_bytes(admin, url).await;
        let viewer_key = foes[0].viewer_key.clone();
        let attacking = foes.iter().map(|foe| attack(what, foe, prey));
        let attacking = futures::future::join_all(attacking);
        let looked = looking(&viewer_key, url, seconds);
        let (worked, viewer_longest_ms) = futures::join!(attacking, looked);
        let mut worked: Vec<String> = worked.concat();
        let grown = metrics_bytes(admin, url).await.saturating_sub(metrics_before);
        if grown > METRICS_GROWTH {
            worked.push(format!("the metrics grew by {grown} bytes"));
        }
        if what == Attack::WashedOutbox {
            let heard = prey.set.as_ref().map(|set| second::outbox(&set.heard));
            worked.extend(futures::future::OptionFuture::from(heard).await.unwrap_or_default());
        }
        let attempts = foes.iter_mut().map(|foe| *foe.attempts.get_mut()).sum();
        say(format!("{name}: {attempts} attempts, {} worked", worked.len()));
        worked.iter().take(SAID).for_each(|fault| say(shortened(fault)));
        told.push(Told {
            attack: name,
            finding,
            attempts,
            honest_p99_ratio: 0.0,
            honest_refused: 0,
            worked: worked.len() as u64,
            viewer_longest_ms,
        });
        faults.extend(worked);
        if what == Attack::Downloads {
            let found = verdicts::downloads(admin, url, foes).await;
            found.iter().for_each(|fault| say(shortened(fault)));
            faults.extend(found);
        }
    }
    Attacked { told, windows, faults }
}

/// The first characters of a text that may be long.
fn shortened(text: &str) -> String {
    text.chars().take(400).collect()
}

/// A server with data of every kind, honest robots, and the keys stolen by attackers.
async fn set_the_scene(
    command: &Path,
    data: &Path,
    args: &Args,
    material: &Material,
) -> anyhow::Result<Scene> {
    let http = client()?;
    let mut robots: Vec<Robot> = (0..HONEST)
        .map(|n| {
            let stream = Stream::new(args.seed, Purpose::ReadingChoice, n as u64);
            Robot::new(format!("robot-{n}"), http.clone(), stream)
        })
        .collect();
    kill::set_up(command, data, &mut robots, &http, Access::Keys).await?;
    let more = ["--session-ttl-s", "30", "--webhook-allow-private", "--training-memory-mb", "400"];
    let serving = match Serving::start_within(command, data, Access::Keys, MEMORY_KIB, &more)? {
        Ok(serving) => serving,
        Err(refused) => bail!("the server does not start: {}", refused.0),
    };
    let url = serving.url.clone();
    let first = robots.first().context("no robots")?;
    let (teacher, toucher) = (first.teacher.clone(), first.client.clone());
    let admin = first.keeper.clone().context("no keeper of keys")?;
    let leaver = key(&admin, &url, "leaver", "admin").await?;
    let mut foes = Vec::new();
    for number in 0..FOES {
        let stolen = Stolen {
            robot: key(&admin, &url, &format!("hand-{number}"), "robot").await?,
            viewer: key(&admin, &url, &format!("looker-{number}"), "viewer").await?,
            admin: leaver.clone(),
        };
        foes.push(Foe::new(number, &url, stolen)?);
    }
    let set = if args.review == Some(1) {
        None
    } else {
        let trainer_key = key(&admin, &url, "learner", "trainer").await?;
        let admin_key = key(&admin, &url, "keeper-of-hooks", "admin").await?;
        let keys = [trainer_key, admin_key];
        Some(second::set(&admin, keys, &url, &material.indentations).await?)
    };
    let long_session = teach(&teacher, &toucher, &url, material).await?;
    let refused = client_with(&foes[0].viewer_key)?;
    send(&refused, Method::DELETE, format!("{url}/v1/objects/{}", verdicts::EVIDENCE), None).await;
    let honest: Vec<Honest> = robots
        .into_iter()
        .map(|robot| Honest { name: robot.name, client: robot.client, now: Arc::default() })
        .collect();
    let known = honest.iter().map(|robot| (robot.name.clone(), Arc::clone(&robot.now))).collect();
    let touches = material.touches.concat();
    let touch = material.touches[0][0].clone();
    let prey = Prey { robots: known, long_session, touch, touches, set };
    Ok(Scene { serving, admin, honest, foes, prey })
}

/// Trains the objects that attackers request, and fills the long session.
async fn teach(
    teacher: &Client,
    toucher: &Client,
    url: &str,
    material: &Material,
) -> anyhow::Result<String> {
    let wanted = |outcome: Outcome| match outcome {
        Outcome::Done(body) => Ok(body),
        other => bail!("cannot set up: {other:?}"),
    };
    let post = |client: Client, path: String, body: Value| async move {
        wanted(send(&client, Method::POST, format!("{url}{path}"), Some(&body)).await)
    };
    for name in ["large", verdicts::EVIDENCE] {
        post(teacher.clone(), "/v1/objects".to_owned(), json!({ "name": name })).await?;
    }
    let mesh = teacher.put(format!("{url}/v1/objects/large/mesh?unit=mm"));
    let mesh = mesh.header("content-type", "model/off").body(off_box([30.0; 3], MESH_LINES));
    wanted(answer(mesh).await)?;
    let touch = |n: usize| material.touches[0][n % material.touches[0].len()].clone();
    let readings: Vec<Value> = (0..LARGE_OBJECT).map(touch).collect();
    for readings in readings.chunks(200) {
        let body = json!({ "readings": readings });
        post(teacher.clone(), "/v1/objects/large/readings".to_owned(), body).await?;
    }
    let training = json!({"objects": ["cube", "bar"], "readings_per_object": 60, "n_classes": 8,
        "seed": 3, "geometric": {"kind": "solid", "cell": 0.004}});
    let job = post(teacher.clone(), "/v1/catalogues/solid/trainings".to_owned(), training).await?;
    let state = kill::ended(teacher, url, job["id"].as_str().unwrap_or_default()).await;
    if state != "succeeded" {
        bail!("the training of solid maps is {state}");
    }
    let session = json!({"catalogue": "default", "ttl_s": 86_400});
    let session = post(toucher.clone(), "/v1/sessions".to_owned(), session).await?;
    let session = session["id"].as_str().unwrap_or_default().to_owned();
    let readings: Vec<Value> = (0..LONG_SESSION).map(touch).collect();
    for readings in readings.chunks(50) {
        let path = format!("/v1/sessions/{session}/readings");
        post(toucher.clone(), path, json!({ "readings": readings })).await?;
    }
    Ok(session)
}

async fn key(admin: &Client, url: &str, name: &str, role: &str) -> anyhow::Result<String> {
    let body = json!({"name": name, "role": role});
    let made = send(admin, Method::POST, format!("{url}/v1/keys"), Some(&body)).await.done();
    let secret = made.as_ref().and_then(|made| made["secret"].as_str());
    secret.map(str::to_owned).with_context(|| format!("cannot make the key {name}"))
}
