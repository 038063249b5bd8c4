//! `kill -9` at random moments under concurrent writers.
//!
//! Nothing acknowledged may be lost and nothing invented, and beliefs must equal those of a
//! server that was never interrupted.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use palpate_core::rng::{Purpose, Stream};
use reqwest::{Client, Method};
use serde_json::{Value, json};

use crate::check::{check, check_strangers};
use crate::http::{Outcome, answer, client, send};
use crate::keys;
use crate::ledger::Session;
use crate::material::{Material, TRAINED, off_box};
use crate::robot::Robot;
use crate::serving::Serving;
use crate::{Access, Args, Counts};

/// Number of beliefs compared with the uninterrupted server in each round.
const BELIEFS_PER_ROUND: usize = 6;
/// Every round of this many lasts long enough for a training.
const LONG_ROUND_EVERY: u32 = 10;
/// Maximum time for jobs to end when the server is no longer killed.
const JOBS_PATIENCE: Duration = Duration::from_secs(300);
/// Makes the killed server compact as often as it can, so that kills hit every step,
/// including the first compaction of a folder.
const COMPACTING: [&str; 2] = ["--store-slack-mb", "0"];

/// Runs the rounds.
pub(crate) async fn run(
    command: &Path,
    args: &Args,
    counts: &mut Counts,
    say: &dyn Fn(String),
) -> anyhow::Result<()> {
    let material = Material::new()?;
    let folders = tempfile::tempdir().context("cannot make a folder")?;
    let data = folders.path().join("data");
    let calm_data = folders.path().join("calm");
    let http = client()?;
    let mut robots = Robot::all(args.writers, args.seed, &http);
    set_up(command, &data, &mut robots, &http, args.access).await?;
    copy(&data, &calm_data)?;
    let calm = start(command, &calm_data, args.access)?;
    let mut moments = Stream::new(args.seed, Purpose::ReadingChoice, u64::MAX);
    for round in 1..=args.rounds {
        let serving = restart(command, &data, args.access, counts)?;
        let longest = if round % LONG_ROUND_EVERY == 0 { 4.0 } else { 0.8 };
        let moment = Duration::from_secs_f64(moments.uniform(0.02, longest));
        let url = serving.url.clone();
        let writing = robots.iter_mut().map(|robot| robot.write(&url, &material));
        let killing = tokio::spawn(async move {
            tokio::time::sleep(moment).await;
            serving.kill()
        });
        futures::future::join_all(writing).await;
        killing.await.context("the killer panicked")??;
        let serving = restart(command, &data, args.access, counts)?;
        check_all(&mut robots, &serving.url, false, counts, say).await;
        compare_beliefs(&robots, &serving, &calm, &mut moments, counts, say).await;
        serving.kill()?;
        counts.rounds += 1;
        note(&robots, counts);
        say(format!(
            "round {round}: killed after {} ms, {} acknowledged, {} unanswered so far",
            moment.as_millis(),
            counts.acknowledged,
            counts.unanswered
        ));
    }
    let serving = restart(command, &data, args.access, counts)?;
    check_all(&mut robots, &serving.url, true, counts, say).await;
    check_models(&robots, &serving.url, counts, say).await;
    Ok(())
}

pub(crate) fn start(command: &Path, data: &Path, access: Access) -> anyhow::Result<Serving> {
    match Serving::start(command, data, access)? {
        Ok(serving) => Ok(serving),
        Err(refused) => bail!("the server does not start: {}", refused.0),
    }
}

fn restart(
    command: &Path,
    data: &Path,
    access: Access,
    counts: &mut Counts,
) -> anyhow::Result<Serving> {
    let begun = Instant::now();
    let more = COMPACTING.map(str::to_owned);
    let serving = match Serving::start_with(command, data, access, &more)? {
        Ok(serving) => serving,
        Err(refused) => bail!("the server does not start: {}", refused.0),
    };
    counts.restarts += 1;
    counts.restart_seconds_max = counts.restart_seconds_max.max(begun.elapsed().as_secs_f64());
    Ok(serving)
}

/// Gives robots their keys if the server requires them, adds the objects, trains them, and
/// gives every robot its sensor.
pub(crate) async fn set_up(
    command: &Path,
    data: &Path,
    robots: &mut [Robot],
    http: &Client,
    access: Access,
) -> anyhow::Result<()> {
    let serving = start(command, data, access)?;
    let url = &serving.url;
    if let Some(admin_key) = &serving.admin_key {
        keys::give(robots, url, admin_key).await?;
    }
    let http = robots.first().map_or(http, |robot| &robot.teacher);
    let wanted = |outcome: Outcome| match outcome {
        Outcome::Done(body) => Ok(body),
        other => bail!("cannot set up: {other:?}"),
    };
    let post = |path: String, body: Value| async move {
        wanted(send(http, Method::POST, path, Some(&body)).await)
    };
    for (name, size) in TRAINED {
        post(format!("{url}/v1/objects"), json!({ "name": name })).await?;
        let mesh = http.put(format!("{url}/v1/objects/{name}/mesh?unit=mm"));
        wanted(answer(mesh.header("content-type", "model/off").body(off_box(size, 0))).await)?;
    }
    for robot in robots.iter() {
        let sensor = json!({"name": robot.sensor(), "preset": "digitacts-6x6"});
        post(format!("{url}/v1/sensors"), sensor).await?;
    }
    let training = json!({"readings_per_object": 60, "n_classes": 8, "seed": 3,
        "appearance": {"n_classes": [4]}});
    let job = post(format!("{url}/v1/catalogues/default/trainings"), training).await?;
    let state = ended(http, url, job["id"].as_str().unwrap_or_default()).await;
    if state != "succeeded" {
        bail!("the first training is {state}");
    }
    serving.kill()
}

/// Waits for the end of a job and returns its state.
pub(crate) async fn ended(http: &Client, url: &str, job: &str) -> String {
    let begun = Instant::now();
    loop {
        let shown = send(http, Method::GET, format!("{url}/v1/jobs/{job}"), None).await.done();
        let state = shown.and_then(|job| job["state"].as_str().map(str::to_owned));
        let state = state.unwrap_or_default();
        let is_final = ["succeeded", "failed", "cancelled"].contains(&state.as_str());
        if is_final || begun.elapsed() > JOBS_PATIENCE {
            return state;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

pub(crate) async fn check_all(
    robots: &mut [Robot],
    url: &str,
    all: bool,
    counts: &mut Counts,
    say: &dyn Fn(String),
) {
    let checking = robots.iter_mut().map(|robot| check(robot, url, all));
    for found in futures::future::join_all(checking).await {
        found.add_to(counts, say);
    }
    check_strangers(robots, url, TRAINED.len()).await.add_to(counts, say);
}

/// Folds the readings of some sessions again on the uninterrupted server.
pub(crate) async fn compare_beliefs(
    robots: &[Robot],
    serving: &Serving,
    calm: &Serving,
    choice: &mut Stream,
    counts: &mut Counts,
    say: &dyn Fn(String),
) {
    let sessions: Vec<(&Robot, &Session)> = robots
        .iter()
        .flat_map(|robot| robot.ledger.sessions.iter().map(move |session| (robot, session)))
        .filter(|(_, session)| session.deleted.is_none() && !session.readings.is_empty())
        .collect();
    for _ in 0..BELIEFS_PER_ROUND.min(sessions.len()) {
        let (robot, session) = sessions[choice.index(sessions.len())];
        let path = format!("{}/v1/sessions/{}/belief?poses=20", serving.url, session.id);
        let found = send(&robot.client, Method::GET, path, None).await.done();
        let expected = uninterrupted(&robot.client, &calm.url, session).await;
        counts.beliefs_compared += 1;
        match (found.map(answered), expected.map(answered)) {
            (Some(found), Some(expected)) if found == expected => {}
            (found, expected) => {
                counts.beliefs_differ += 1;
                say(format!("FAULT: belief of {}: {found:?}, not {expected:?}", session.id));
            }
        }
    }
}

/// The belief without its identity, as text, which shows every bit of a number.
fn answered(mut belief: Value) -> String {
    if let Some(fields) = belief.as_object_mut() {
        fields.remove("session");
    }
    belief.to_string()
}

async fn uninterrupted(http: &Client, url: &str, session: &Session) -> Option<Value> {
    let path = format!("{url}/v1/sessions");
    let begun = send(http, Method::POST, path.clone(), Some(&session.request)).await.done()?;
    let path = format!("{path}/{}", begun["id"].as_str()?);
    for sent in &session.readings {
        let body = json!({"readings": [sent.reading]});
        let path = format!("{path}/readings?belief=none");
        send(http, Method::POST, path, Some(&body)).await.done()?;
    }
    if session.closed.is_some() {
        send(http, Method::POST, format!("{path}/close"), None).await.done()?;
    }
    send(http, Method::GET, format!("{path}/belief?poses=20"), None).await.done()
}

/// Checks that every job ends, and that versions of successful ones can be used.
pub(crate) async fn check_models(
    robots: &[Robot],
    url: &str,
    counts: &mut Counts,
    say: &dyn Fn(String),
) {
    for robot in robots {
        let mut n_succeeded = 0;
        for job in &robot.ledger.jobs {
            match ended(&robot.teacher, url, job).await.as_str() {
                "succeeded" => n_succeeded += 1,
                "failed" => {}
                state => {
                    counts.unexpected_answers += 1;
                    say(format!("FAULT: job {job} is {state:?} at the end"));
                }
            }
        }
        let path = format!("{url}/v1/catalogues/{}/versions?limit=1000", robot.catalogue());
        let page = send(&robot.client, Method::GET, path, None).await.done();
        let versions = page.and_then(|page| page["items"].as_array().cloned()).unwrap_or_default();
        let most = n_succeeded + robot.ledger.jobs_unknown;
        if (versions.len() as u64) < n_succeeded {
            counts.acknowledged_lost += 1;
            say(format!("FAULT: {} versions of {n_succeeded} trainings", versions.len()));
        }
        if versions.len() as u64 > most {
            counts.invented += 1;
            say(format!("FAULT: {} versions of at most {most} trainings", versions.len()));
        }
        for version in &versions {
            let session = json!({"catalogue": robot.catalogue(), "version": version["version"]});
            let path = format!("{url}/v1/sessions");
            let begun = send(&robot.client, Method::POST, path, Some(&session)).await;
            counts.versions_trained += 1;
            if begun.refused().is_some() {
                counts.acknowledged_lost += 1;
                say(format!("FAULT: version {} recognises nothing: {begun:?}", version["version"]));
            }
        }
    }
}

pub(crate) fn note(robots: &[Robot], counts: &mut Counts) {
    counts.acknowledged = robots.iter().map(|robot| robot.ledger.acknowledged).sum();
    counts.unanswered = robots.iter().map(|robot| robot.ledger.unanswered).sum();
    counts.keys_created = robots.iter().map(|robot| robot.ledger.keys_created).sum();
    counts.keys_revoked = robots.iter().map(|robot| robot.ledger.keys_revoked).sum();
    counts.keys_tried = robots.iter().map(|robot| robot.ledger.keys_tried).sum();
}

/// Copies a folder that no process has open.
pub(crate) fn copy(from: &Path, to: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(to).with_context(|| format!("cannot make {}", to.display()))?;
    for entry in std::fs::read_dir(from).with_context(|| format!("cannot read {from:?}"))? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy(&entry.path(), &target)?;
        } else {
            std::fs::copy(entry.path(), &target)
                .with_context(|| format!("cannot copy {}", entry.path().display()))?;
        }
    }
    Ok(())
}
