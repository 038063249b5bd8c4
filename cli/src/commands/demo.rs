//! `palpate demo`: the whole service at once, over real HTTP.
//!
//! Starts an embedded server on a temporary folder, adds ten example objects as meshes, trains
//! them, and lets four simulated robots touch objects in unknown poses, each guided by the next
//! touch that the server proposes. Every step goes through the SDK, as for a real robot.

mod screen;
mod summary;

use std::io::ErrorKind;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use anyhow::Context as _;
use clap::Args;
use palpate_client::Client;
use palpate_client::schemas::{
    CatalogueVersion, CreateObject, CreateSession, JobState, LabelledQuery, MeshFormat, MeshUnit,
    ProblemType, SensorKnowledge, SensorPreset, StartTraining,
};
use palpate_core::symmetry::Symmetry;
use palpate_server::{Config, Server, StartError};
use palpate_sim::press::PressSimulator;
use palpate_sim::{shapes, symmetry};
use tokio::task::JoinSet;

use self::screen::Screen;
use self::summary::Summary;
use super::{touch, train};
use crate::exit::Ended;
use crate::listen::{DEFAULT_LISTEN, listen_address};
use crate::output::Output;
use crate::progress::is_watched;
use crate::robot::{Robot, described};
use crate::supervisor::Signals;
use crate::trial::{self, StopRule, TrialResult, Truth};

/// Number of robots that touch at once.
const N_ROBOTS: usize = 4;
/// Name of the trained catalogue.
const CATALOGUE: &str = "default";
/// Sensor of the robots.
const SENSOR: SensorPreset = SensorPreset::Digitacts6x6;
/// Stop rule of a robot.
const RULE: StopRule =
    StopRule { probability: 0.95, in_a_row: 2, touches_max: 20, pause: Duration::ZERO };
/// Pause between two touches on a terminal.
const WATCHED_PAUSE: Duration = Duration::from_millis(300);

/// Arguments of `palpate demo`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  palpate demo\n  palpate demo --once --json\n\n\
    A robot stops when an object has had a probability of at least 95 % twice in a row, or \
    after 20 touches.")]
pub(crate) struct DemoArgs {
    /// Exit when the robots are done, instead of serving until Ctrl-C.
    #[arg(long)]
    once: bool,
    /// Number of objects to touch.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    trials: u32,
    /// Seed of the objects' poses and the touches.
    #[arg(long, default_value_t = 2026)]
    seed: u64,
    /// Number of simulated training readings per object.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(20..=20_000))]
    readings_per_object: u32,
    /// Pause between two touches in milliseconds [default: 300 on a terminal, else 0].
    #[arg(long, value_name = "MS")]
    pace: Option<u64>,
    /// Folder to keep the database in [default: a temporary one].
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Address to listen on [default: 127.0.0.1:7411, or any free port if that is taken].
    #[arg(long, value_name = "ADDR", value_parser = listen_address)]
    listen: Option<SocketAddr>,
}

/// Runs the command.
pub(crate) async fn run(args: DemoArgs, output: Output) -> anyhow::Result<()> {
    if output.json && !args.once {
        usage("--json needs --once: its one line comes at the end");
    }
    // Kept until the server has stopped; dropping it deletes the folder.
    let temporary = tempfile::Builder::new().prefix("palpate-demo-").tempdir()?;
    let data = args.data.clone().unwrap_or_else(|| temporary.path().join("data"));
    let mut signals = Signals::listen()?;
    let server = start(data, args.listen).await?;
    let outcome = tokio::select! {
        outcome = show(&args, &server, output) => outcome,
        () = signals.told_to_stop() => Err(Ended::Interrupted.into()),
    };
    if outcome.is_ok() && !args.once {
        let address = server.local_addr();
        output.say(format!("\nAPI documentation: http://{address}/docs"));
        output.say("The server keeps running; Ctrl-C stops it.");
        signals.told_to_stop().await;
    }
    tokio::select! {
        () = server.shutdown() => {}
        _ = tokio::signal::ctrl_c() => {}
    }
    outcome
}

/// Exits like clap, for errors that clap cannot detect.
fn usage(words: &str) -> ! {
    let mut command = DemoArgs::augment_args(clap::Command::new("demo").bin_name("palpate demo"));
    command.error(clap::error::ErrorKind::ArgumentConflict, words).exit()
}

async fn start(data: PathBuf, listen: Option<SocketAddr>) -> anyhow::Result<Server> {
    let default: SocketAddr = DEFAULT_LISTEN.parse().context("the default address is valid")?;
    let config = Config { listen: listen.unwrap_or(default), ..Config::new(data) };
    match Server::start(config.clone()).await {
        Err(StartError::Listen { source, .. })
            if listen.is_none() && source.kind() == ErrorKind::AddrInUse =>
        {
            let any = SocketAddr::new(default.ip(), 0);
            Ok(Server::start(Config { listen: any, ..config }).await?)
        }
        started => Ok(started?),
    }
}

async fn show(args: &DemoArgs, server: &Server, output: Output) -> anyhow::Result<()> {
    let address = format!("http://{}", server.local_addr());
    let client = Client::new(&address)?;
    output.say(format!("Palpate serves {address}, documentation at {address}/docs"));
    add_objects(&client, output).await?;
    let version = train_objects(&client, args, output).await?;
    let report = &version.report;
    output.say(format!(
        "Trained {} objects in {:.1} s, {:.1} MB of pairs of touches\n",
        report.objects.len(),
        report.seconds,
        report.index_bytes as f64 / 1e6
    ));
    touch::ensure_sensor(&client, SENSOR).await?;
    let results = touch_all(client, Arc::new(version), args, output).await?;
    let summary = Summary::of(&results);
    output.say(format!("\n{}\n", summary::table(&results)));
    output.answer(&summary, Summary::words)
}

/// Adds the example objects that are missing on the server.
async fn add_objects(client: &Client, output: Output) -> anyhow::Result<()> {
    let mut added = 0;
    for name in shapes::NAMES {
        let new = CreateObject {
            name: name.to_owned(),
            description: "an example that comes with Palpate".to_owned(),
            ..CreateObject::default()
        };
        match client.create_object(&new).await {
            Ok(_) => {}
            Err(error) if error.kind() == Some(ProblemType::Conflict) => {
                if client.object(name).await?.mesh.is_some() {
                    continue;
                }
            }
            Err(error) => return Err(error.into()),
        }
        let file = tokio::task::spawn_blocking(move || {
            shapes::example(name).map(|mesh| mesh.to_stl_bytes())
        });
        let file = file.await?.with_context(|| format!("there is no example {name}"))?;
        client.put_mesh(name, MeshFormat::Stl, MeshUnit::M, file.into()).await?;
        added += 1;
    }
    output.say(format!("Added {added} objects as meshes: {}", shapes::NAMES.join(", ")));
    Ok(())
}

/// Trains the examples, unless the current version knows them all.
async fn train_objects(
    client: &Client,
    args: &DemoArgs,
    output: Output,
) -> anyhow::Result<CatalogueVersion> {
    if let Some(version) = current_version(client).await? {
        return Ok(version);
    }
    let training = StartTraining {
        objects: Some(shapes::NAMES.map(str::to_owned).to_vec()),
        // The demo's robots press with the description itself.
        sensor_knowledge: Some(SensorKnowledge::Measured),
        readings_per_object: Some(args.readings_per_object),
        ..StartTraining::default()
    };
    let job = client.start_training(CATALOGUE, &training).await?;
    let job = train::follow(client, &job, output).await?;
    match (job.state, job.version) {
        (JobState::Succeeded, Some(version)) => {
            Ok(client.catalogue_version(CATALOGUE, version).await?)
        }
        (JobState::Cancelled, _) => Err(Ended::Interrupted.into()),
        _ => anyhow::bail!("the training failed: {}", job.reason.unwrap_or_default()),
    }
}

async fn current_version(client: &Client) -> anyhow::Result<Option<CatalogueVersion>> {
    let page = client.catalogues(&LabelledQuery::default()).await?;
    let catalogue = page.items.into_iter().find(|catalogue| catalogue.name == CATALOGUE);
    let Some(current) = catalogue.and_then(|catalogue| catalogue.current) else {
        return Ok(None);
    };
    let version = client.catalogue_version(CATALOGUE, current.version).await?;
    let knows = |name: &&str| version.report.objects.iter().any(|object| object.name == *name);
    Ok(shapes::NAMES.iter().all(knows).then_some(version))
}

/// State shared by all robots.
struct Floor {
    client: Client,
    version: Arc<CatalogueVersion>,
    simulators: Vec<Arc<PressSimulator>>,
    /// Symmetry of each mesh, in its frame.
    symmetries: Vec<Symmetry>,
    next_trial: AtomicUsize,
    n_trials: usize,
    seed: u64,
    rule: StopRule,
    screen: Screen,
    results: Mutex<Vec<TrialResult>>,
}

/// Lets the robots touch objects until all trials are done. Results are in the order in which the
/// trials end.
async fn touch_all(
    client: Client,
    version: Arc<CatalogueVersion>,
    args: &DemoArgs,
    output: Output,
) -> anyhow::Result<Vec<TrialResult>> {
    let simulators = tokio::task::spawn_blocking(|| {
        let simulator = |name| {
            let mesh = shapes::example(name).expect("every name has its example");
            let symmetry = symmetry::of_mesh(&mesh);
            (Arc::new(PressSimulator::new(mesh, described(SENSOR))), symmetry)
        };
        shapes::NAMES.map(simulator).into_iter().unzip::<_, _, Vec<_>, Vec<_>>()
    });
    let n_trials = args.trials as usize;
    let (simulators, symmetries) = simulators.await?;
    let floor = Arc::new(Floor {
        client,
        version,
        simulators,
        symmetries,
        next_trial: AtomicUsize::new(0),
        n_trials,
        seed: args.seed,
        rule: StopRule { pause: pause(args), ..RULE },
        screen: Screen::new(N_ROBOTS, n_trials, output),
        results: Mutex::default(),
    });
    let mut robots = JoinSet::new();
    for robot in 0..N_ROBOTS {
        robots.spawn(work(Arc::clone(&floor), robot));
    }
    while let Some(ended) = robots.join_next().await {
        ended??;
    }
    floor.screen.clear();
    Ok(std::mem::take(&mut *floor.results.lock().expect("no robot panicked")))
}

fn pause(args: &DemoArgs) -> Duration {
    match args.pace {
        Some(pace) => Duration::from_millis(pace),
        None if !args.once && is_watched() => WATCHED_PAUSE,
        None => Duration::ZERO,
    }
}

/// One robot: runs trials until none is left.
async fn work(floor: Arc<Floor>, robot: usize) -> anyhow::Result<()> {
    loop {
        let trial = floor.next_trial.fetch_add(1, Ordering::Relaxed);
        if trial >= floor.n_trials {
            floor.screen.rests(robot);
            return Ok(());
        }
        let object = trial % shapes::NAMES.len();
        let simulator = Arc::clone(&floor.simulators[object]);
        let simulated = Robot::new(simulator, floor.seed, trial as u64);
        let symmetry = &floor.symmetries[object];
        let truth = Truth::new(&simulated, symmetry, shapes::NAMES[object], &floor.version.report)?;
        let wanted = CreateSession {
            catalogue: Some(CATALOGUE.to_owned()),
            version: Some(floor.version.version),
            ..CreateSession::default()
        };
        let name = format!("robot-{}", robot + 1);
        let mut session = floor.client.touch_session(&wanted, &name).await?;
        floor.screen.begins(robot, truth.name());
        let show = |step: &trial::Step| floor.screen.touched(robot, truth.name(), step);
        let result =
            trial::run(simulated, &mut session, SENSOR.name(), &truth, floor.rule, show).await?;
        // The dashboard then draws the truth beside the belief.
        floor.client.close_session_with(session.id(), &truth.closing()).await?;
        floor.screen.ends(robot, &result);
        floor.results.lock().expect("no robot panicked").push(result);
    }
}
