//! `palpate touch`: a simulated robot touches a mesh in an unknown pose, through the server.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use palpate_client::schemas::{
    CatalogueVersion, CreateSensor, CreateSession, GeometricKind, MeshUnit, Method, ProblemType,
    SensorPreset,
};
use palpate_client::{Client, Error as ClientError};
use palpate_sim::press::PressSimulator;
use palpate_sim::symmetry;
use serde::Serialize;

use super::Context;
use super::sensors::parse_preset;
use crate::calibrated;
use crate::exit::Ended;
use crate::json_file::read_json;
use crate::output;
use crate::robot::{self, Approach, Robot};
use crate::trial::{self, Step, StopRule, TrialResult, Truth};
use crate::verdict::{NONE, can_answer_none};

/// Arguments of `palpate touch`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  palpate touch --object mug --mesh mug.stl --readings 15 --seed 7\n\n\
    Example:\n  palpate touch --object none --mesh vase.stl\n\n\
    The answer is the likeliest of the catalogue's objects and \"none of these\". Exits with 4 \
    if the final answer is wrong."
)]
pub(crate) struct TouchArgs {
    /// The true object of the mesh: its name when it was trained, or `none` if the catalogue does
    /// not have it (method `surface`).
    #[arg(long)]
    object: String,
    /// Mesh to touch: .stl, .obj, .ply, .off, .glb or .3mf.
    #[arg(long, value_name = "FILE")]
    mesh: PathBuf,
    /// Unit of the mesh file's coordinates, `mm` if neither this nor the file says it.
    #[arg(long, value_enum)]
    unit: Option<MeshUnit>,
    /// Number of touches.
    #[arg(long, default_value_t = 15, value_parser = clap::value_parser!(u32).range(1..=1000))]
    readings: u32,
    /// Seed of the object's pose and the touches.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Pause between two touches in milliseconds.
    #[arg(long, value_name = "MS", default_value_t = 0)]
    pace: u64,
    /// Catalogue to recognise with.
    #[arg(long, default_value = "default")]
    catalogue: String,
    /// Recognition method [default: surface]. The methods `geometric…` need a version trained with
    /// `--geometric`. With `planar` maps, the robot presses straight down within 8 mm of where a
    /// camera saw the object; with `solid` maps, it touches from all sides, and the camera is
    /// accurate to 8 mm and 0.2 rad. The methods `appearance…` need a version trained with
    /// `--appearance`; the robot then sends no poses.
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// Prior probability that the object is not in the catalogue, above 0 and below 1; for `surface`
    /// [default: 0.05].
    #[arg(long, value_name = "PROBABILITY")]
    unknown_prior: Option<f64>,
    /// What a camera says about the object and its pose, for `surface`: a JSON file with a
    /// `pose_prior` of kind `camera`, or `-` for standard input.
    #[arg(long, value_name = "FILE")]
    prior: Option<PathBuf>,
    /// Sensor of the robot.
    #[arg(long, default_value = "digitacts-6x6", value_parser = parse_preset)]
    sensor: SensorPreset,
    /// Close the session at the end with the true object and its true pose: the dashboard then
    /// draws the truth beside the belief, and recalibrations learn from it.
    #[arg(long)]
    close: bool,
}

/// The answer of the command.
#[derive(Debug, Serialize)]
struct Touched {
    session: uuid::Uuid,
    truth: String,
    /// The final answer, its probability, and that of "none of these".
    answer: String,
    probability: f64,
    unknown: f64,
    right: bool,
    position_error_mm: Option<f64>,
    angle_error_deg: Option<f64>,
    plain_angle_error_deg: Option<f64>,
    steps: Vec<Step>,
}

/// Runs the command.
pub(crate) async fn run(args: TouchArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    let file = robot::read_mesh(&args.mesh, args.unit)?;
    output.say(robot::read_as(&file));
    let mesh = file.mesh;
    ensure_sensor(client, args.sensor).await?;
    let current = client.current_version(&args.catalogue).await?.version;
    let version = client.catalogue_version(&args.catalogue, current).await?;
    let method = args.method;
    let symmetry = symmetry::of_mesh(&mesh);
    let simulator = Arc::new(PressSimulator::new(mesh, robot::described(args.sensor)));
    let approach = approach(method, &version);
    let mut robot = Robot::approaching(simulator, approach, args.seed, 0);
    let truth = match args.object.as_str() {
        NONE => {
            can_answer_none(method.unwrap_or(Method::Surface))?;
            Truth::none_of_these(&robot)
        }
        object => Truth::new(&robot, &symmetry, object, &version.report)?,
    };
    let session = CreateSession {
        catalogue: Some(args.catalogue),
        version: Some(current),
        method,
        unknown_prior: args.unknown_prior,
        pose_prior: match args.prior {
            Some(path) => Some(read_json(path)?),
            None => method
                .is_some_and(Method::is_geometric)
                .then(|| robot.pose_prior(truth.origin_in_mesh)),
        },
        ..CreateSession::default()
    };
    if method.is_some_and(Method::is_appearance) {
        robot = robot.without_poses();
    }
    let mut session = client.touch_session(&session, &context.robot("simulated")).await?;
    if let Some(reason) = calibrated::reason_of(method, &version.report) {
        output.say(calibrated::note(reason));
    }
    // Take all readings: no probability ends the trial.
    let rule = StopRule {
        probability: f64::INFINITY,
        in_a_row: 1,
        touches_max: args.readings,
        pause: Duration::from_millis(args.pace),
    };
    let show = |step: &Step| output.say(step_words(step));
    let trial = trial::run(robot, &mut session, args.sensor.name(), &truth, rule, show);
    let result = tokio::select! {
        result = trial => result?,
        interrupted = tokio::signal::ctrl_c() => {
            interrupted?;
            return Err(Ended::Interrupted.into());
        }
    };
    let is_posed = !method.is_some_and(Method::is_appearance) && args.object != NONE;
    if args.close {
        client.close_session_with(session.id(), &truth.closing()).await?;
    }
    let touched = Touched::of(session.id(), &result);
    output.answer(&touched, |touched| verdict(touched, &result.last, is_posed))?;
    if let [only] = &version.report.objects[..] {
        output.say(format!(
            "{} is the only object of the catalogue: nothing had to be told apart. Train others",
            only.name
        ));
    }
    if touched.right { Ok(()) } else { Err(Ended::NotRecognised.into()) }
}

impl Touched {
    /// The answer for the result of a trial.
    fn of(session: uuid::Uuid, result: &TrialResult) -> Self {
        let last = &result.last;
        Self {
            session,
            truth: result.truth.clone(),
            right: last.right,
            position_error_mm: last.position_error_mm(),
            angle_error_deg: last.angle_error_deg(),
            plain_angle_error_deg: last.plain_angle_error_deg(),
            answer: last.answer.clone(),
            probability: last.probability,
            unknown: last.unknown,
            steps: result.steps.clone(),
        }
    }
}

/// The last line: the answer, the truth, and the pose error if there is a pose.
fn verdict(touched: &Touched, last: &Step, is_posed: bool) -> String {
    let verdict = if touched.right { "right" } else { "wrong" };
    let identity = format!(
        "\n{verdict}: {} with {:.1} %; truth: {}",
        touched.answer,
        touched.probability * 100.0,
        touched.truth
    );
    if !is_posed {
        return identity;
    }
    format!(
        "{identity}; off by {} and {}\n{}",
        last.position_error.map_or("–".to_owned(), output::mm),
        last.angle_error.map_or("–".to_owned(), output::degrees),
        output::ERRORS_OF_POSE,
    )
}

/// The approach of the robot: straight down for planar maps.
fn approach(method: Option<Method>, version: &CatalogueVersion) -> Approach {
    let mut kinds = version.report.objects.iter().filter_map(|object| object.geometric);
    let is_planar = kinds.any(|geometry| geometry.kind == GeometricKind::Planar);
    if method.is_some_and(Method::is_geometric) && is_planar {
        Approach::StraightDown
    } else {
        Approach::Anywhere
    }
}

fn step_words(step: &Step) -> String {
    format!(
        "touch {:3}  {:<16} {} {:5.1} %  none of these {:5.1} %  {:.2} bits  {:>10} {:>8}",
        step.touches,
        step.answer,
        output::bar(step.probability),
        step.probability * 100.0,
        step.unknown * 100.0,
        step.entropy_bits,
        step.position_error.map_or("–".to_owned(), output::mm),
        step.angle_error.map_or("–".to_owned(), output::degrees),
    )
}

/// Adds the sensor to the server under its preset's name, if missing.
pub(crate) async fn ensure_sensor(
    client: &Client,
    preset: SensorPreset,
) -> Result<(), ClientError> {
    match client.sensor(preset.name()).await {
        Err(error) if error.kind() == Some(ProblemType::NotFound) => {
            let name = preset.name().to_owned();
            let new = CreateSensor { name, preset: Some(preset), ..CreateSensor::default() };
            match client.create_sensor(&new).await {
                // Another robot has added it meanwhile.
                Err(error) if error.kind() == Some(ProblemType::Conflict) => Ok(()),
                other => other.map(|_| ()),
            }
        }
        other => other.map(|_| ()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_of_the_wire_can_be_simulated() {
        for preset in SensorPreset::ALL {
            assert!(robot::described(preset).n_taxels() >= 9);
        }
    }
}
