//! Soak: a long mix of kept and removed records, and its disk usage.
//!
//! Writers send readings as fast as they are answered, into sessions that live for a minute,
//! one in ten of which lives much longer. Beside them objects are trained, meshes replaced,
//! keys created and revoked, sessions searched by label, and all of it is audited. The stored and the live bytes are read
//! from the server's metrics. At the end the server is killed under the load and started
//! again, and every acknowledged reading is looked up.

mod figures;
mod mix;

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use palpate_core::rng::{Purpose, Stream};
use reqwest::Client;

use crate::http::client;
use crate::kill::set_up;
use crate::material::Material;
use crate::robot::Robot;
use crate::serving::Serving;
use crate::{Access, Args};
use figures::{Figures, Sample};
use mix::{Acknowledged, Mix, Writer};

/// Time between two samples.
const SAMPLE_EVERY: Duration = Duration::from_millis(500);
/// Lifetime of a session that is not kept; less in a short run.
const LIFE: Duration = Duration::from_secs(60);

/// Runs the mix.
pub(crate) async fn run(args: &Args) -> anyhow::Result<Figures> {
    let command = match &args.palpate {
        Some(path) => path.clone(),
        None => crate::serving::build()?,
    };
    let say = |line: String| {
        if !args.json {
            eprintln!("{line}");
        }
    };
    let folder = tempfile::tempdir().context("cannot make a folder")?;
    let data = args.data.clone().unwrap_or_else(|| folder.path().join("data"));
    let http = client()?;
    let mut robots: Vec<Robot> = (0..args.writers)
        .map(|writer| {
            let stream = Stream::new(args.seed, Purpose::ReadingChoice, u64::from(writer));
            Robot::new(format!("robot-{writer}"), http.clone(), stream)
        })
        .collect();
    set_up(&command, &data, &mut robots, &http, Access::Keys).await?;
    let keeper = robots.first().and_then(|robot| robot.keeper.clone());
    let keeper = keeper.context("there is no writer")?;
    let serving = start(&command, &data, args)?;
    let duration = Duration::from_secs_f64(args.minutes * 60.0);
    let mix = Mix {
        url: serving.url.clone(),
        life: LIFE.min(duration / 6),
        kept_for: duration / 3,
        ends: Instant::now(),
        acknowledged: Acknowledged::default(),
    };
    let material = Material::new()?;
    let mut writers: Vec<Writer> =
        robots.iter().map(|robot| Writer::new(robot, args.seed)).collect();
    let filled = filled(&mix, &material, &mut writers, args).await?;
    say(format!("{filled} readings are kept from the beginning on"));
    let mix = Mix { ends: Instant::now() + duration, ..mix };
    mix.acknowledged.begin();
    let (samples, ()) = tokio::join!(
        watched(&mix, &keeper, serving, args.readings, &say),
        written(&mix, &material, &mut writers, &robots)
    );
    let samples = samples?;
    let begun = Instant::now();
    let serving = start(&command, &data, args)?;
    let restart_ready = begun.elapsed();
    let mut lost = 0;
    for writer in &writers {
        lost += mix::lost(writer, &serving.url, &say).await;
    }
    let after = figures::sample(&keeper, &serving.url, 0.0, 0).await?;
    serving.kill()?;
    let figures = Figures::of(args, &mix.acknowledged, &samples, restart_ready, lost, &after);
    if let Some(path) = &args.report {
        std::fs::write(path, figures.with_samples(&samples))
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    if let Some(path) = &args.picture {
        std::fs::write(path, figures::picture(&samples))
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(figures)
}

fn start(command: &Path, data: &Path, args: &Args) -> anyhow::Result<Serving> {
    let more = ["--store-slack-mb".to_owned(), args.slack_mb.to_string()];
    match Serving::start_with(command, data, Access::Keys, &more)? {
        Ok(serving) => Ok(serving),
        Err(refused) => bail!("the server does not start: {}", refused.0),
    }
}

/// Stores the readings that are kept to the end and returns their number.
async fn filled(
    mix: &Mix,
    material: &Material,
    writers: &mut [Writer],
    args: &Args,
) -> anyhow::Result<u64> {
    let each = args.kept.div_ceil(u64::from(args.writers));
    let filling = writers.iter_mut().map(|writer| writer.fill(mix, material, each));
    let filled = futures::future::join_all(filling).await;
    filled.into_iter().try_fold(0, |sum, filled| Ok(sum + filled?))
}

/// Samples the bytes until the time is over or enough is written, then kills the server,
/// which ends the mix.
async fn watched(
    mix: &Mix,
    keeper: &Client,
    serving: Serving,
    readings_max: u64,
    say: &dyn Fn(String),
) -> anyhow::Result<Vec<Sample>> {
    let (begun, mut samples, mut said) = (Instant::now(), Vec::new(), 0);
    while Instant::now() < mix.ends && mix.acknowledged.readings() < readings_max {
        let at = begun.elapsed().as_secs_f64();
        // The figures count a sample that failed as missing.
        if let Ok(sample) = figures::sample(keeper, &mix.url, at, mix.acknowledged.readings()).await
        {
            let minute = (at / 60.0) as u64;
            if minute > said {
                said = minute;
                say(format!("minute {minute}: {}", sample.words()));
            }
            samples.push(sample);
        }
        tokio::time::sleep(SAMPLE_EVERY).await;
    }
    let killed = serving.kill();
    mix.acknowledged.end();
    killed.map(|()| samples)
}

/// Runs all writers until the mix ends.
async fn written(mix: &Mix, material: &Material, writers: &mut [Writer], robots: &[Robot]) {
    let writing = writers.iter_mut().map(|writer| writer.write(mix, material));
    let teaching = robots.first().map(|robot| mix::teach(mix, robot));
    let searching = robots.first().map(|robot| mix::search(mix, robot));
    let beside = futures::future::join(
        futures::future::OptionFuture::from(teaching),
        futures::future::OptionFuture::from(searching),
    );
    tokio::join!(futures::future::join_all(writing), beside);
}
