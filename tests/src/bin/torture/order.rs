//! One set of readings, sent in many ways, must give beliefs that are equal bit for bit.
//!
//! The readings are permuted, batched, repeated, sent by eight robots at once, and sent with
//! others that are withdrawn again; the beliefs must also survive a `kill -9`.

use std::path::Path;

use anyhow::{Context, bail};
use palpate_core::rng::{Purpose, Stream};
use reqwest::{Client, Method};
use serde_json::{Value, json};

use crate::http::{Outcome, client, send};
use crate::material::{Material, TRAINED, off_box};
use crate::serving::Serving;
use crate::{Access, Args, Counts};

/// Number of robots that share a session.
const ROBOTS: usize = 8;
/// Maximum readings of one robot in a session.
const READINGS_MAX: usize = 4;
/// Number of ways in which each round sends its readings.
const WAYS: u64 = 8;
/// The server is killed once every this many rounds, and its answers are checked again.
const KILL_EVERY: u32 = 25;
/// Recognition methods, drawn for each session.
const METHODS: [&str; 4] = ["surface", "surface", "sva", "appearance"];

/// Contents of one round.
struct Case {
    method: &'static str,
    /// By robot, each with robot and seq.
    readings: Vec<Vec<Value>>,
    /// Indices of the withdrawn readings, robot by robot.
    withdrawn: Vec<(usize, usize)>,
}

/// A session and its expected answer.
struct Known {
    session: String,
    belief: Value,
}

/// Runs the rounds.
pub(crate) async fn run(
    command: &Path,
    args: &Args,
    counts: &mut Counts,
    say: &dyn Fn(String),
) -> anyhow::Result<()> {
    let material = Material::new()?;
    let folder = tempfile::tempdir().context("cannot make a folder")?;
    let http = client()?;
    let mut serving = start(command, folder.path())?;
    train(&http, &serving.url).await?;
    let mut known: Vec<Known> = Vec::new();
    for round in 1..=args.rounds {
        let mut stream = Stream::new(args.seed, Purpose::ReadingChoice, u64::from(round));
        let case = Case::draw(&material, &mut stream);
        let expected = in_order(&http, &serving.url, &case).await?;
        for way in 0..WAYS {
            let session = begin(&http, &serving.url, case.method).await?;
            let index = u64::from(round) * WAYS + way;
            in_any_order(&http, &serving.url, &case, &session, args.seed, index).await?;
            let found = belief(&http, &serving.url, &session).await?;
            counts.orders_compared += 1;
            if found != expected {
                counts.orders_differ += 1;
                say(format!("round {round}, way {way}: {found} instead of {expected}"));
            }
            known.push(Known { session, belief: found });
        }
        if round % KILL_EVERY == 0 || round == args.rounds {
            serving.kill()?;
            counts.restarts += 1;
            serving = start(command, folder.path())?;
            for Known { session, belief: before } in known.drain(..) {
                counts.beliefs_compared += 1;
                let found = belief(&http, &serving.url, &session).await?;
                if found != before {
                    counts.orders_differ += 1;
                    say(format!("after a restart: {found} instead of {before}"));
                }
            }
            say(format!("round {round}: {} orders compared", counts.orders_compared));
        }
        counts.rounds += 1;
    }
    Ok(())
}

impl Case {
    fn draw(material: &Material, stream: &mut Stream) -> Self {
        let touches = &material.touches[stream.index(material.touches.len())];
        let method = METHODS[stream.index(METHODS.len())];
        // Some fleets have clocks, some have none; in others only some robots have one.
        let stamped = stream.index(3);
        let mut readings = Vec::new();
        for robot in 0..ROBOTS {
            let n = 1 + stream.index(READINGS_MAX);
            let mut own = Vec::with_capacity(n);
            for seq in 0..n {
                let mut reading = touches[stream.index(touches.len())].clone();
                reading["robot"] = json!(format!("robot-{robot}"));
                reading["seq"] = json!(seq);
                if stamped == 1 || (stamped == 2 && stream.index(2) == 0) {
                    // A coarse clock: many stamps are equal.
                    reading["stamp"] = json!({"sec": stream.index(12), "nanosec": 0});
                }
                if method == "surface" && stream.index(12) == 0 {
                    reading["object_moved"] = json!({"position_m": 0.002, "angle_rad": 0.02});
                }
                own.push(reading);
            }
            readings.push(own);
        }
        let n_withdrawn = stream.index(4);
        let mut withdrawn: Vec<(usize, usize)> = (0..n_withdrawn)
            .map(|_| {
                let robot = stream.index(ROBOTS);
                (robot, stream.index(readings[robot].len()))
            })
            .collect();
        withdrawn.sort_unstable();
        withdrawn.dedup();
        Self { method, readings, withdrawn }
    }

    fn is_withdrawn(&self, robot: usize, seq: usize) -> bool {
        self.withdrawn.contains(&(robot, seq))
    }
}

/// The belief of the valid readings, sent once, together.
async fn in_order(http: &Client, url: &str, case: &Case) -> anyhow::Result<Value> {
    let session = begin(http, url, case.method).await?;
    let mut readings = Vec::new();
    for (robot, own) in case.readings.iter().enumerate() {
        let counting = own.iter().enumerate().filter(|(seq, _)| !case.is_withdrawn(robot, *seq));
        readings.extend(counting.map(|(_, reading)| reading.clone()));
    }
    post(http, url, &session, &readings, "full").await?;
    belief(http, url, &session).await
}

/// Sends the readings in another way, determined by the seed.
async fn in_any_order(
    http: &Client,
    url: &str,
    case: &Case,
    session: &str,
    seed: u64,
    index: u64,
) -> anyhow::Result<()> {
    let mut stream = Stream::new(seed, Purpose::Sampling, index);
    if stream.index(4) == 0 {
        // All robots at once, each its own readings, last first: the network decides the order.
        let robots = case.readings.iter().map(|own| async move {
            for reading in own.iter().rev() {
                post(http, url, session, std::slice::from_ref(reading), "top").await?;
            }
            anyhow::Ok(())
        });
        futures::future::try_join_all(robots).await?;
    } else {
        let mut left: Vec<Value> = case.readings.concat();
        let mut sent: Vec<Value> = Vec::new();
        while !left.is_empty() {
            let n = 1 + stream.index(left.len().min(6));
            let mut batch: Vec<Value> =
                (0..n).map(|_| left.swap_remove(stream.index(left.len()))).collect();
            if !sent.is_empty() && stream.index(2) == 0 {
                // A repeated reading among new ones.
                batch.push(sent[stream.index(sent.len())].clone());
            }
            let detail = ["none", "top", "full"][stream.index(3)];
            post(http, url, session, &batch, detail).await?;
            if stream.index(4) == 0 {
                post(http, url, session, &batch, detail).await?;
            }
            sent.extend(batch);
        }
    }
    for (robot, seq) in &case.withdrawn {
        let path = format!("{url}/v1/sessions/{session}/readings/robot-{robot}/{seq}");
        for _again in 0..=stream.index(2) {
            done(send(http, Method::DELETE, path.clone(), None).await)?;
        }
        // A repeated reading stays withdrawn.
        post(http, url, session, &case.readings[*robot][*seq..=*seq], "none").await?;
    }
    Ok(())
}

async fn begin(http: &Client, url: &str, method: &str) -> anyhow::Result<String> {
    let body = json!({ "method": method });
    let session = done(send(http, Method::POST, format!("{url}/v1/sessions"), Some(&body)).await)?;
    Ok(session["id"].as_str().context("a session without an id")?.to_owned())
}

async fn post(
    http: &Client,
    url: &str,
    session: &str,
    readings: &[Value],
    detail: &str,
) -> anyhow::Result<()> {
    let path = format!("{url}/v1/sessions/{session}/readings?belief={detail}");
    done(send(http, Method::POST, path, Some(&json!({ "readings": readings }))).await)?;
    Ok(())
}

/// The belief without the fields that depend on the order of arrival.
async fn belief(http: &Client, url: &str, session: &str) -> anyhow::Result<Value> {
    let path = format!("{url}/v1/sessions/{session}/belief?poses=20");
    let mut belief = done(send(http, Method::GET, path, None).await)?;
    (belief["session"], belief["revision"]) = (Value::Null, Value::Null);
    Ok(belief)
}

/// Trains the two objects for all methods in use.
async fn train(http: &Client, url: &str) -> anyhow::Result<()> {
    for (name, size) in TRAINED {
        let path = format!("{url}/v1/objects");
        done(send(http, Method::POST, path, Some(&json!({ "name": name }))).await)?;
        let mesh = http.put(format!("{url}/v1/objects/{name}/mesh?unit=mm"));
        let mesh = mesh.header("content-type", "model/off").body(off_box(size, 0));
        done(crate::http::answer(mesh).await)?;
    }
    let training = json!({"readings_per_object": 60, "n_classes": 8, "seed": 3,
        "appearance": {"n_classes": [8]}});
    let path = format!("{url}/v1/catalogues/default/trainings");
    let job = done(send(http, Method::POST, path, Some(&training)).await)?;
    let id = job["id"].as_str().context("a job without an id")?;
    // The stream ends when the job does.
    let events = http.get(format!("{url}/v1/jobs/{id}/events")).send().await?.text().await?;
    if !events.contains("\"succeeded\"") {
        bail!("the training did not succeed: {events}");
    }
    Ok(())
}

fn done(outcome: Outcome) -> anyhow::Result<Value> {
    match outcome {
        Outcome::Done(body) => Ok(body),
        Outcome::Refused(status, body) => bail!("refused with {status}: {body}"),
        Outcome::Unknown => bail!("no answer"),
    }
}

fn start(command: &Path, data: &Path) -> anyhow::Result<Serving> {
    Serving::start(command, data, Access::Open)?
        .map_err(|refused| anyhow::anyhow!("the server does not start: {}", refused.0))
}
