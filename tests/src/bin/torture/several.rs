//! `kill -9` of servers that share a store on a NATS cluster, and of the leader of its stream, at
//! random moments under robots that go on with another server.
//!
//! Nothing acknowledged may be lost and nothing invented, whoever acknowledged it, and beliefs must
//! equal those of a single server on a folder that was never interrupted.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use palpate_core::rng::{Purpose, Stream};
use reqwest::Method;
use serde_json::json;

use crate::http::{client, send};
use crate::kill::{check_all, check_models, compare_beliefs, copy, note, set_up, start};
use crate::material::Material;
use crate::nats::Cluster;
use crate::pauses::Pauses;
use crate::robot::Robot;
use crate::serving::Serving;
use crate::{Args, Counts};

/// Bounds of the seconds after which a server is killed.
const MOMENT_S: (f64, f64) = (0.2, 3.0);
/// Time after the last kill up to which robots write at least, and until the first acknowledgement
/// after it.
const AFTER: Duration = Duration::from_secs(3);
/// Interval at which that acknowledgement is looked for.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// In two of this many rounds the stream's leader is killed as well: with two and with three servers.
const LEADER_EVERY: u32 = 4;
/// Maximum time until every server writes again.
const WRITES_WITHIN: Duration = Duration::from_secs(60);
/// Time after that in which what servers still had to write is stored, and known to all. Chosen:
/// a commit is tried again at least every half second.
const SETTLES_WITHIN: Duration = Duration::from_secs(2);

/// The servers of a run; `None` for one that is down.
struct Servers<'run> {
    command: &'run Path,
    folder: &'run Path,
    address: String,
    args: &'run Args,
    running: Vec<Option<Serving>>,
}

impl Servers<'_> {
    /// Starts all servers up to this number that are not running, and stops those beyond.
    fn bring(&mut self, wanted: usize, counts: &mut Counts) -> anyhow::Result<()> {
        self.running.resize_with(wanted.max(self.running.len()), || None);
        for number in 0..self.running.len() {
            match (number < wanted, self.running[number].is_some()) {
                (true, false) => self.running[number] = Some(self.start(number, counts)?),
                (false, true) => self.kill(number)?,
                (true, true) | (false, false) => {}
            }
        }
        Ok(())
    }

    fn start(&self, number: usize, counts: &mut Counts) -> anyhow::Result<Serving> {
        let begun = Instant::now();
        let more = ["--store", &self.address, "--store-shared"].map(str::to_owned);
        let data = self.folder.join(format!("server-{number}"));
        match Serving::start_with(self.command, &data, self.args.access, &more)? {
            Ok(serving) => {
                counts.restarts += 1;
                let took = begun.elapsed().as_secs_f64();
                counts.restart_seconds_max = counts.restart_seconds_max.max(took);
                Ok(serving)
            }
            Err(refused) => bail!("server {number} does not start: {}", refused.0),
        }
    }

    fn kill(&mut self, number: usize) -> anyhow::Result<()> {
        self.running[number].take().map_or(Ok(()), Serving::kill)
    }

    fn urls(&self) -> Vec<String> {
        self.running.iter().flatten().map(|serving| serving.url.clone()).collect()
    }
}

/// Runs the rounds.
pub(crate) async fn run(
    command: &Path,
    program: &Path,
    args: &Args,
    counts: &mut Counts,
    say: &dyn Fn(String),
) -> anyhow::Result<()> {
    let material = Material::new()?;
    let folders = tempfile::tempdir().context("cannot make a folder")?;
    let (data, calm_data) = (folders.path().join("data"), folders.path().join("calm"));
    let http = client()?;
    let mut robots = Robot::all(args.writers, args.seed, &http);
    set_up(command, &data, &mut robots, &http, args.access).await?;
    copy(&data, &calm_data)?;
    let calm = start(command, &calm_data, args.access)?;
    let mut cluster = Cluster::start(program, &folders.path().join("nats"), &http).await?;
    upload(command, &data, &cluster.address())?;
    let (address, folder) = (cluster.address(), folders.path());
    let mut servers = Servers { command, folder, address, args, running: Vec::new() };
    let mut moments = Stream::new(args.seed, Purpose::ReadingChoice, u64::MAX);
    let pauses = Pauses::new();
    for round in 1..=args.rounds {
        servers.bring(2 + (round as usize + 1) % 2, counts)?;
        let urls = servers.urls();
        pauses.resume();
        let killed = round_of_kills(&mut servers, &mut cluster, round, &mut moments);
        let until = tokio::sync::watch::Sender::new(false);
        let writing = robots.iter_mut().enumerate().map(|(place, robot)| {
            robot.write_anywhere(&urls, place, &material, (&pauses, until.subscribe()))
        });
        let killing = async {
            let killed = killed.await;
            let begun = Instant::now();
            // An acknowledgement that was on its way says nothing about the pause.
            while pauses.last() < begun + AFTER && begun.elapsed() < WRITES_WITHIN {
                tokio::time::sleep(LOOK_EVERY).await;
            }
            until.send_replace(true);
            killed
        };
        let (_, killed) = tokio::join!(futures::future::join_all(writing), killing);
        let Killed { server, leader } = killed?;
        counts.servers_killed += 1;
        if let Some(leader) = leader {
            counts.leaders_killed += 1;
            cluster.restart(leader).await?;
        }
        servers.bring(servers.running.len(), counts)?;
        let urls = servers.urls();
        settle(&robots, &urls).await?;
        let url = &urls[moments.index(urls.len())];
        check_all(&mut robots, url, false, counts, say).await;
        let serving = servers.running.iter().flatten().find(|serving| serving.url == *url);
        let serving = serving.context("a server has gone")?;
        compare_beliefs(&robots, serving, &calm, &mut moments, counts, say).await;
        counts.rounds += 1;
        note(&robots, counts);
        counts.longest_pause_s = pauses.longest().as_secs_f64();
        say(format!(
            "round {round}: {} servers, killed server {server}{}, {} acknowledged, {} unanswered \
             so far, longest pause {:.1} s",
            urls.len(),
            leader.map_or(String::new(), |leader| format!(" and NATS leader {leader}")),
            counts.acknowledged,
            counts.unanswered,
            counts.longest_pause_s
        ));
    }
    let urls = servers.urls();
    check_all(&mut robots, &urls[0], true, counts, say).await;
    check_models(&robots, &urls[0], counts, say).await;
    Ok(())
}

/// Waits until all servers write, and until nothing is left of requests that they did not answer in
/// time: a server that lives may still store those.
async fn settle(robots: &[Robot], urls: &[String]) -> anyhow::Result<()> {
    let robot = robots.first().context("there is no robot")?;
    let begun = Instant::now();
    for url in urls {
        let path = format!("{url}/v1/sensors/{}/labels", robot.sensor());
        let body = json!({"labels": {}});
        while send(&robot.teacher, Method::PUT, path.clone(), Some(&body)).await.done().is_none() {
            if begun.elapsed() > WRITES_WITHIN {
                bail!("{url} does not write {WRITES_WITHIN:?} after the last kill");
            }
        }
    }
    tokio::time::sleep(SETTLES_WITHIN).await;
    Ok(())
}

/// What a round killed.
struct Killed {
    server: usize,
    leader: Option<usize>,
}

async fn round_of_kills(
    servers: &mut Servers<'_>,
    cluster: &mut Cluster,
    round: u32,
    moments: &mut Stream,
) -> anyhow::Result<Killed> {
    let moment =
        |moments: &mut Stream| Duration::from_secs_f64(moments.uniform(MOMENT_S.0, MOMENT_S.1));
    tokio::time::sleep(moment(moments)).await;
    let server = moments.index(servers.running.len());
    servers.kill(server)?;
    if round % LEADER_EVERY < LEADER_EVERY / 2 {
        return Ok(Killed { server, leader: None });
    }
    tokio::time::sleep(moment(moments)).await;
    let leader = cluster.leader().await;
    if let Some(leader) = leader {
        cluster.kill(leader)?;
    }
    Ok(Killed { server, leader })
}

/// Copies a folder to the cluster.
fn upload(command: &Path, data: &Path, address: &str) -> anyhow::Result<()> {
    let from = format!("sled:{}", data.display());
    let mut copying = Command::new(command);
    copying.args(["copy", "--from", &from, "--to", address]);
    let done = copying.output().context("cannot run the command")?;
    if !done.status.success() {
        bail!("cannot copy to the cluster: {}", String::from_utf8_lossy(&done.stderr));
    }
    Ok(())
}
