//! `palpate explore`: a simulated arm explores an unknown object. Its readings go to a server, to a
//! file, or both; a file can be replayed.

mod planner;
mod truth;

use std::ops::ControlFlow;
use std::path::PathBuf;

use clap::Args;
use palpate_client::schemas::{
    AddReadings, Belief, BeliefDetail, CreateSession, MeshUnit, Method, Reading, ReadingsQuery,
    SensorPreset, Session,
};
use palpate_sim::shapes;
use serde::Serialize;
use uuid::Uuid;

use self::planner::Planner;
use self::truth::Truth;
use super::Context;
use super::sensors::parse_preset;
use super::touch::ensure_sensor;
use crate::exit::Ended;
use crate::explorer::{self, Plan};
use crate::ids::SessionName;
use crate::method::among;
use crate::output::{self, Output};
use crate::readings_file::ReadingsFile;
use crate::verdict::Verdict;

/// Arguments of `palpate explore`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  palpate explore --object mug --readings 40 --out mug.json\n  \
    palpate explore --object mug --perturb --method appearance --readings 40\n  \
    palpate explore --mesh part.stl --readings 100 --offline --out part.json\n  \
    palpate explore --replay mug.json --session 0198a0d0-0000-7000-8000-000000000000\n\n\
    The answer is the likeliest of the catalogue's objects and \"none of these\". Exits with 4 \
    if the final answer is not the --object named."
)]
pub(crate) struct ExploreArgs {
    /// The object: a built-in example, or with --mesh its name in the catalogue, or `none` if the
    /// catalogue does not have it (method `surface`).
    #[arg(long, required_unless_present_any = ["mesh", "replay"])]
    object: Option<String>,
    /// Mesh to explore: .stl, .obj, .ply, .off, .glb or .3mf.
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Unit of the mesh file's coordinates, `mm` if neither this nor the file says it.
    #[arg(long, value_enum)]
    unit: Option<MeshUnit>,
    /// Send the readings of this file instead of exploring; `-` reads standard input.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["mesh", "object", "offline", "out"])]
    replay: Option<PathBuf>,
    /// Number of readings to take.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    readings: u32,
    /// Probability of the local strategy, 0 to 1.
    #[arg(long, default_value_t = 0.5, value_name = "L", value_parser = parse_share)]
    local: f64,
    /// Number of links of the arm.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(3..=32))]
    links: u32,
    /// Seed of the object's pose, the exploration and the sensor's noise.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Move the object by up to 10° and a tenth of its size after every reading.
    #[arg(long)]
    perturb: bool,
    /// Extra sensor noise, as a fraction of the sensing range, 0 to 2.
    #[arg(long, default_value_t = 0.0, value_name = "LEVEL", value_parser = explorer::parse_noise)]
    noise: f64,
    /// The arm's sensor.
    #[arg(long, default_value = "digitacts-6x6", value_parser = parse_preset)]
    sensor: SensorPreset,
    /// Maximum number of targets that the planner chooses.
    #[arg(long, default_value_t = 200_000, value_parser = clap::value_parser!(u32).range(1..))]
    iterations: u32,
    /// Session to send the readings to [default: a new one].
    #[arg(long, conflicts_with = "offline")]
    session: Option<SessionName>,
    /// Catalogue of a new session.
    #[arg(long, default_value = "default")]
    catalogue: String,
    /// Recognition method of a new session [default: surface]. With --perturb, use a method that
    /// ignores poses: `appearance`, with a version trained with `--appearance`.
    #[arg(long, value_parser = among(&BLIND), conflicts_with_all = ["session", "offline"])]
    method: Option<Method>,
    /// Prior probability that the object is not in the catalogue, above 0 and below 1; for `surface`
    /// [default: 0.05].
    #[arg(long, value_name = "PROBABILITY", conflicts_with_all = ["session", "offline"])]
    unknown_prior: Option<f64>,
    /// Do not use a server.
    #[arg(long, requires = "out")]
    offline: bool,
    /// Write the readings to this file, for --replay.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write a picture of the arm, the object and the touches (PNG).
    #[arg(long, value_name = "FILE", conflicts_with = "replay")]
    picture: Option<PathBuf>,
}

/// Methods without a pose prior, which a blind arm does not have.
const BLIND: [Method; 5] = [
    Method::Surface,
    Method::Sva,
    Method::SvaLiteral,
    Method::Appearance,
    Method::AppearanceLiteral,
];

/// The answer of the command.
#[derive(Debug, Serialize)]
struct Explored {
    session: Option<Uuid>,
    readings: usize,
    /// Statistics of the planner; absent for readings from a file.
    planner: Option<Planner>,
    /// The true object, if known.
    truth: Option<String>,
    /// The final answer, if a server was used.
    answer: Option<String>,
    probability: Option<f64>,
    /// Probability of "none of these".
    unknown: Option<f64>,
    right: Option<bool>,
}

/// Runs the command.
pub(crate) async fn run(args: ExploreArgs, context: &Context) -> anyhow::Result<()> {
    match &args.replay {
        Some(path) => {
            let file = ReadingsFile::read(path)?;
            let work = replay(&args, file, context);
            unless_interrupted(work).await
        }
        None => unless_interrupted(explore(&args, context)).await,
    }
}

async fn unless_interrupted(work: impl Future<Output = anyhow::Result<()>>) -> anyhow::Result<()> {
    tokio::select! {
        done = work => done,
        interrupted = tokio::signal::ctrl_c() => {
            interrupted?;
            Err(Ended::Interrupted.into())
        }
    }
}

/// Sends the readings of a file.
async fn replay(args: &ExploreArgs, file: ReadingsFile, context: &Context) -> anyhow::Result<()> {
    let session = session(args, context).await?;
    let truth = match &file.object {
        Some(object) => Truth::of_file(object, &session, context).await?,
        None => None,
    };
    let mut last = None;
    let n_readings = file.readings.len();
    for (idx, reading) in file.readings.into_iter().enumerate() {
        let belief = send(&session, reading, context).await?;
        context.output.say(belief_words(idx + 1, &belief));
        last = Some(belief);
    }
    answer(Some(&session), n_readings, None, truth, last.as_ref(), context)
}

/// Explores, sends each reading as it is taken, and writes all of them at the end.
async fn explore(args: &ExploreArgs, context: &Context) -> anyhow::Result<()> {
    let plan = plan(args, context.output)?;
    let (session, truth) = if args.offline {
        (None, args.object.as_deref().map(Truth::named))
    } else {
        ensure_sensor(&context.client, args.sensor).await?;
        let session = session(args, context).await?;
        let truth = match &args.object {
            Some(object) => Some(Truth::told(object, &session, context).await),
            None => None,
        };
        if matches!(truth, Some(Err(_))) && args.session.is_none() {
            context.client.delete_session(session.id).await?;
        }
        let truth = truth.transpose()?;
        (Some(session), truth)
    };
    // At most one reading waits while another is sent, so the arm does not outrun the server.
    let (sender, mut taken) = tokio::sync::mpsc::channel::<Reading>(1);
    let work = tokio::task::spawn_blocking(move || {
        let explored = plan.explore(&mut |reading| {
            let goes_on = match reading {
                Some(reading) => sender.blocking_send(reading).is_ok(),
                None => !sender.is_closed(),
            };
            if goes_on { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        (plan, explored)
    });
    let mut readings = Vec::new();
    let heard = hear(&mut taken, &mut readings, session.as_ref(), context).await;
    // Also if the server fails midway, because the touches are already made.
    let n_readings = readings.len();
    if let Some(path) = args.out.as_ref().filter(|_| n_readings > 0) {
        ReadingsFile::new(args.object.clone(), Some(args.seed), readings).write(path)?;
        context.output.say(format!("wrote {}", path.display()));
    }
    let last = heard?;
    let (plan, explored) = work.await?;
    let explored = explored?;
    if let Some(path) = &args.picture {
        explorer::write_picture(path, &plan, &explored)?;
    }
    let wanted = args.readings as usize;
    if n_readings < wanted {
        context.output.say(format!(
            "only {n_readings} of {wanted} readings within {} iterations",
            args.iterations
        ));
    }
    let planner = Some(explored.statistics.into());
    answer(session.as_ref(), n_readings, planner, truth, last.as_ref(), context)
}

/// Collects the readings and sends them if there is a session. Returns the last belief.
async fn hear(
    taken: &mut tokio::sync::mpsc::Receiver<Reading>,
    readings: &mut Vec<Reading>,
    session: Option<&Session>,
    context: &Context,
) -> anyhow::Result<Option<Belief>> {
    let mut last = None;
    while let Some(reading) = taken.recv().await {
        readings.push(reading.clone());
        match session {
            Some(session) => {
                let belief = send(session, reading, context).await?;
                context.output.say(belief_words(readings.len(), &belief));
                last = Some(belief);
            }
            None if readings.len().is_multiple_of(10) => {
                context.output.say(format!("{} readings", readings.len()));
            }
            None => {}
        }
    }
    Ok(last)
}

fn plan(args: &ExploreArgs, output: Output) -> anyhow::Result<Plan> {
    let mesh = match (&args.mesh, &args.object) {
        (Some(path), _) => {
            let file = crate::robot::read_mesh(path, args.unit)?;
            output.say(crate::robot::read_as(&file));
            file.mesh
        }
        (None, Some(name)) => shapes::example(name).ok_or_else(|| {
            anyhow::anyhow!(
                "object {name} is not a built-in example, expected one of {} or --mesh FILE",
                shapes::NAMES.join(", ")
            )
        })?,
        (None, None) => anyhow::bail!("expected --object NAME or --mesh FILE"),
    };
    Ok(Plan {
        mesh,
        sensor: args.sensor,
        noise: args.noise,
        readings: args.readings as usize,
        local: args.local,
        links: args.links as usize,
        seed: args.seed,
        perturb: args.perturb,
        iterations: args.iterations as usize,
    })
}

/// The session named, or a new one.
async fn session(args: &ExploreArgs, context: &Context) -> anyhow::Result<Session> {
    let session = match &args.session {
        Some(name) => context.client.session(name.id(&context.client).await?).await?,
        None => {
            let new = CreateSession {
                catalogue: Some(args.catalogue.clone()),
                method: args.method,
                unknown_prior: args.unknown_prior,
                ..CreateSession::default()
            };
            context.client.create_session(&new).await?
        }
    };
    Ok(session)
}

/// Sends one reading. Sending it again to the same session has no effect.
async fn send(session: &Session, reading: Reading, context: &Context) -> anyhow::Result<Belief> {
    // Only the key that holds a robot name may post under it.
    let robot = reading.robot.as_ref().map(|name| context.robot(name));
    let reading = Reading { frame_id: session.frame_id.clone(), robot, ..reading };
    let readings = AddReadings { readings: vec![reading] };
    let query = ReadingsQuery { belief: Some(BeliefDetail::Full) };
    let added = context.client.add_readings(session.id, &readings, query).await?;
    match added.belief {
        Some(belief) => Ok(belief),
        None => Ok(context.client.belief(session.id, Default::default()).await?),
    }
}

fn belief_words(touches: usize, belief: &Belief) -> String {
    let verdict = Verdict::of(belief);
    format!(
        "touch {touches:3}  {:<16} {} {:5.1} %  none of these {:5.1} %  {:.2} bits",
        verdict.name(),
        output::bar(verdict.probability),
        verdict.probability * 100.0,
        belief.unknown * 100.0,
        belief.entropy_bits,
    )
}

fn answer(
    session: Option<&Session>,
    readings: usize,
    planner: Option<Planner>,
    truth: Option<Truth>,
    last: Option<&Belief>,
    context: &Context,
) -> anyhow::Result<()> {
    let verdict = last.map(Verdict::of);
    let right = verdict.zip(truth.as_ref()).map(|(verdict, truth)| truth.is_told_by(verdict));
    let explored = Explored {
        session: session.map(|session| session.id),
        readings,
        planner,
        truth: truth.map(|truth| truth.name().to_owned()),
        answer: verdict.map(|verdict| verdict.name().to_owned()),
        probability: verdict.map(|verdict| verdict.probability),
        unknown: last.map(|belief| belief.unknown),
        right,
    };
    context.output.answer(&explored, words)?;
    if right == Some(false) { Err(Ended::NotRecognised.into()) } else { Ok(()) }
}

fn words(explored: &Explored) -> String {
    let mut words = format!("\n{} readings", explored.readings);
    if let Some(planner) = &explored.planner {
        words += &planner.words();
    }
    if let (Some(answer), Some(probability)) = (&explored.answer, explored.probability) {
        words += &format!("\nanswer: {answer} with {:.1} %", probability * 100.0);
    }
    if let Some(truth) = explored.truth.as_ref().filter(|_| explored.right.is_some()) {
        words += &format!("; truth: {truth}");
    }
    words
}

fn parse_share(text: &str) -> Result<f64, String> {
    let share = text.parse::<f64>().ok().filter(|share| (0.0..=1.0).contains(share));
    share.ok_or_else(|| "expected a number from 0 to 1".to_owned())
}
