//! Changed and truncated files: damage is refused or reported, never answered wrongly in silence.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Context;
use palpate_core::rng::{Purpose, Stream};
use reqwest::{Client, Method};
use serde_json::{Value, json};

use crate::http::{Outcome, client, send};
use crate::kill::{copy, set_up};
use crate::material::Material;
use crate::robot::Robot;
use crate::serving::Serving;
use crate::{Access, Args, Counts};

/// Number of sessions in the damaged store, and of readings in each.
const SESSIONS: usize = 12;
const READINGS: usize = 8;

/// All answers of a server, by path.
type Answers = BTreeMap<String, Outcome>;

/// Runs the rounds.
pub(crate) async fn run(
    command: &Path,
    args: &Args,
    counts: &mut Counts,
    say: &dyn Fn(String),
) -> anyhow::Result<()> {
    let folders = tempfile::tempdir().context("cannot make a folder")?;
    let whole = folders.path().join("whole");
    let http = client()?;
    let paths = fill(command, &whole, &http, args.seed).await?;
    let mut chance = Stream::new(args.seed, Purpose::ReadingChoice, u64::MAX - 1);
    let sound = {
        let untouched = folders.path().join("sound");
        copy(&whole, &untouched)?;
        let serving = Serving::start(command, &untouched, Access::Open)?;
        let serving = serving.map_err(|refused| anyhow::anyhow!("{}", refused.0))?;
        ask(&http, &serving.url, &paths).await
    };
    for round in 1..=args.rounds {
        let data = folders.path().join(format!("damaged-{round}"));
        copy(&whole, &data)?;
        let damage = damage(&data, &mut chance)?;
        counts.damages += 1;
        let words = match Serving::start(command, &data, Access::Open)? {
            Err(refused) if refused.0.is_empty() => {
                counts.unexpected_answers += 1;
                "FAULT: refused without a word".to_owned()
            }
            Err(refused) => {
                counts.damages_refused += 1;
                format!("refused: {}", refused.0.lines().last().unwrap_or_default())
            }
            Ok(serving) => {
                let found = ask(&http, &serving.url, &paths).await;
                serving.kill()?;
                compare(command, &data, &sound, &found, counts)?
            }
        };
        say(format!("round {round}: {damage}: {words}"));
        std::fs::remove_dir_all(&data).context("cannot remove a folder")?;
    }
    Ok(())
}

/// Fills a store with every kind of data, and returns the paths whose answers cover it.
async fn fill(
    command: &Path,
    data: &Path,
    http: &Client,
    seed: u64,
) -> anyhow::Result<Vec<String>> {
    let material = Material::new()?;
    let stream = Stream::new(seed, Purpose::ReadingChoice, 0);
    let mut robot = Robot::new("robot-0".to_owned(), http.clone(), stream);
    set_up(command, data, std::slice::from_mut(&mut robot), http, Access::Open).await?;
    let serving = Serving::start(command, data, Access::Open)?;
    let serving = serving.map_err(|refused| anyhow::anyhow!("{}", refused.0))?;
    let url = &serving.url;
    let mut paths: Vec<String> = [
        "/v1/sensors",
        "/v1/objects?limit=1000",
        "/v1/objects/cube/mesh",
        "/v1/objects/bar/mesh",
        "/v1/objects/bar/readings",
        "/v1/sessions?limit=1000",
        "/v1/jobs",
        "/v1/catalogues",
        "/v1/catalogues/default/versions",
        "/v1/catalogues/default/versions/1/objects/cube/map",
        "/v1/catalogues/default/versions/1/objects/bar/map",
        "/v1/catalogues/default/versions/1/report/appearance",
        "/v1/sensors/sensor-robot-0/calibration",
    ]
    .map(str::to_owned)
    .to_vec();
    let post = |path: String, body: Value| async move {
        let sent = send(http, Method::POST, format!("{url}{path}"), Some(&body)).await;
        sent.done().context("cannot fill the store")
    };
    for number in 0..SESSIONS {
        let method = ["surface", "sva", "appearance"][number % 3];
        let session = post("/v1/sessions".to_owned(), json!({ "method": method })).await?;
        let path = format!("/v1/sessions/{}", session["id"].as_str().unwrap_or_default());
        let touches = &material.touches[number % 2];
        for seq in 0..READINGS {
            let mut reading = touches[(number * READINGS + seq) % touches.len()].clone();
            (reading["robot"], reading["seq"]) = (json!("robot"), json!(seq));
            let body = json!({"readings": [reading]});
            post(format!("{path}/readings?belief=none"), body).await?;
        }
        paths.extend([path.clone(), format!("{path}/belief?poses=20")]);
    }
    let readings = json!({"readings": &material.touches[1][..20]});
    post("/v1/objects/bar/readings".to_owned(), readings).await?;
    post("/v1/sensors/sensor-robot-0/calibration".to_owned(), material.indentations).await?;
    serving.kill()?;
    Ok(paths)
}

async fn ask(http: &Client, url: &str, paths: &[String]) -> Answers {
    let mut answers = Answers::new();
    for path in paths {
        let mut answer = send(http, Method::GET, format!("{url}{path}"), None).await;
        if let Outcome::Done(value) = &mut answer {
            forget_latest(value);
        }
        answers.insert(path.clone(), answer);
    }
    answers
}

/// Leaves out what the newest beliefs of sessions say: it is formed in the background.
fn forget_latest(answer: &mut Value) {
    let Some(document) = answer.as_object_mut() else { return };
    document.remove("latest");
    let items = document.get_mut("items").and_then(Value::as_array_mut);
    items.into_iter().flatten().for_each(forget_latest);
}

/// Damages one of the files; returns a description.
fn damage(data: &Path, chance: &mut Stream) -> anyhow::Result<String> {
    let mut files = files(data)?;
    files.retain(|path| path.file_name().is_some_and(|name| name != "lock"));
    files.sort();
    let log = files.iter().position(|path| path.ends_with("sled/db"));
    let log = log.context("the store has no log")?;
    // The log is nearly all of the data.
    let chosen = if chance.index(4) > 0 { log } else { chance.index(files.len()) };
    let path = &files[chosen];
    let mut bytes = std::fs::read(path).with_context(|| format!("cannot read {path:?}"))?;
    let used = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    let name = path.strip_prefix(data).unwrap_or(path).display().to_string();
    if used == 0 {
        std::fs::remove_file(path).with_context(|| format!("cannot remove {path:?}"))?;
        return Ok(format!("{name}: removed"));
    }
    let place = chance.index(used);
    let words = match chance.index(5) {
        0 => {
            bytes.truncate(place);
            format!("cut to {place} of {used} bytes")
        }
        1 => {
            // The state of a log whose end was lost in a power cut.
            let lost = 1 + chance.index(used.min(20_000));
            bytes[used - lost..].fill(0);
            format!("the last {lost} bytes are 0")
        }
        2 => {
            let n = 1 + chance.index(4096.min(used - place));
            bytes[place..place + n].fill(0);
            format!("{n} bytes from {place} are 0")
        }
        3 => {
            for _ in 0..16 {
                let place = chance.index(used);
                bytes[place] ^= 1 << chance.index(8);
            }
            "16 bits flipped".to_owned()
        }
        _ => {
            bytes[place] ^= 1 << chance.index(8);
            format!("a bit of byte {place} flipped")
        }
    };
    std::fs::write(path, bytes).with_context(|| format!("cannot write {path:?}"))?;
    Ok(format!("{name}: {words}"))
}

fn files(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(|| format!("cannot read {folder:?}"))? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            found.extend(files(&entry.path())?);
        } else {
            found.push(entry.path());
        }
    }
    Ok(found)
}

/// An answer must be unchanged, or an error that reports the damage, or `fsck` must name it.
fn compare(
    command: &Path,
    data: &Path,
    sound: &Answers,
    found: &Answers,
    counts: &mut Counts,
) -> anyhow::Result<String> {
    let mut wrong = Vec::new();
    let mut n_named = 0;
    for (path, expected) in sound {
        match (expected, &found[path]) {
            (Outcome::Done(expected), Outcome::Done(found)) if expected == found => {}
            (Outcome::Refused(expected, _), Outcome::Refused(found, _)) if expected == found => {}
            (_, Outcome::Refused(500.., _) | Outcome::Unknown) => n_named += 1,
            _ => wrong.push(path.clone()),
        }
    }
    if wrong.is_empty() && n_named == 0 {
        counts.damages_harmless += 1;
        return Ok("every answer is as it was".to_owned());
    }
    if wrong.is_empty() {
        counts.damages_named += 1;
        return Ok(format!("{n_named} answers name damage"));
    }
    let checked = Command::new(command).arg("fsck").arg("--data").arg(data).output();
    let checked = checked.context("cannot run fsck")?;
    counts.silent_corruptions += 1;
    let said = String::from_utf8_lossy(&checked.stdout);
    let first = said.lines().next().unwrap_or_default();
    Ok(format!("FAULT: other answers at {wrong:?}; fsck: {} {first}", checked.status))
}
