//! `palpate sensors commission`: a guide through touches of a known object, and what they say.

mod simulated;
mod text;

use std::io::BufRead;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::Args;
use palpate_client::Client;
use palpate_client::schemas::{
    CommissionSensor, Commissioning, CommissioningReading, FindingName, Pose, ReferenceBodyName,
};
use palpate_commissioning::mistakes::Kind;
use serde::Deserialize;

use super::super::Context;
use crate::numbers::numbers;

/// Touches from which the server can say something, and touches between two questions to it.
const FIRST_ASKED: usize = 8;
const ASKED_EVERY: usize = 4;

/// Arguments of `palpate sensors commission`.
#[derive(Debug, Args)]
pub(super) struct CommissionArgs {
    /// Id or name of the sensor.
    sensor: String,
    /// Id or name of the touched object, which has a mesh; or `ridge`, `sphere`, `cube` or `wedge`
    /// for a printed reference body, if no object has that name.
    #[arg(long, required_unless_present = "reference")]
    object: Option<String>,
    /// The touched reference body. `palpate sensors reference` writes its STL.
    #[arg(long, value_enum, conflicts_with = "object")]
    reference: Option<ReferenceBodyName>,
    /// File of touches, one JSON object `{"image": […], "pose": {"position": […], "orientation":
    /// […]}}` a line, as the driver sends them; `-` reads standard input as they arrive.
    #[arg(long, value_name = "FILE", required_unless_present = "simulate")]
    readings: Option<PathBuf>,
    /// Pose of the object in the session frame: x,y,z in metres and the quaternion x,y,z,w.
    #[arg(long, value_name = "X,Y,Z,QX,QY,QZ,QW", value_parser = parse_pose, allow_hyphen_values = true)]
    pose: Option<Pose>,
    /// Touches to take.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(8..=100))]
    touches: u64,
    /// Store the result as the sensor's passport, which corrects later readings.
    #[arg(long)]
    apply: bool,
    /// Touch a simulated object instead of a real one, to see how it goes.
    #[arg(long, conflicts_with = "readings")]
    simulate: bool,
    /// Mistakes of the simulated driver.
    #[arg(long, value_parser = simulated::mistake_kind(), value_delimiter = ',', requires = "simulate")]
    mistake: Vec<Kind>,
    /// Seed of the search, and of the simulation.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// One line of a file of touches; other fields of a reading are ignored.
#[derive(Deserialize)]
struct Line {
    image: Vec<Option<f64>>,
    pose: Pose,
}

/// The touched thing: a catalogue's object, or a reference body.
pub(super) enum Touched {
    Object(String),
    Body(ReferenceBodyName),
}

impl Touched {
    async fn of(args: &CommissionArgs, client: &Client) -> anyhow::Result<Self> {
        let name = match (&args.object, args.reference) {
            (_, Some(body)) => return Ok(Self::Body(body)),
            (Some(name), None) => name,
            (None, None) => anyhow::bail!("expected --object or --reference"),
        };
        let body = ReferenceBodyName::ALL.into_iter().find(|body| body.name() == name);
        match (client.object(name).await, body) {
            (Ok(_), _) | (Err(_), None) => Ok(Self::Object(name.clone())),
            (Err(error), Some(body)) if error.status() == Some(404) => Ok(Self::Body(body)),
            (Err(error), Some(_)) => Err(error.into()),
        }
    }

    fn name(&self) -> &str {
        match self {
            Self::Object(name) => name,
            Self::Body(body) => body.name(),
        }
    }
}

/// Runs the command.
pub(super) async fn run(args: CommissionArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    let touched = Touched::of(&args, client).await?;
    let n_wanted = args.touches as usize;
    output.say(format!(
        "commission {} by {n_wanted} touches of {} at rest, each pressed until it settles",
        args.sensor,
        touched.name()
    ));
    let mut source = source(&args, &touched, client).await?;
    let mut readings: Vec<CommissioningReading> = Vec::new();
    let mut open: Vec<FindingName> = Vec::new();
    while readings.len() < n_wanted {
        let n_left = n_wanted - readings.len();
        output.say(format!("{n_left} left: {}", text::next_touch(readings.len(), &open)));
        // Lines may come as slowly as a robot touches.
        let taken = tokio::task::spawn_blocking(move || (source.next(), source)).await?;
        source = taken.1;
        let Some(reading) = taken.0 else { break };
        readings.push(reading?);
        let n = readings.len();
        let is_asked = n >= FIRST_ASKED && (n - FIRST_ASKED).is_multiple_of(ASKED_EVERY);
        if is_asked && n < n_wanted {
            let known = ask(client, &args, &touched, &readings, false).await?;
            output.say(format!("after {n} touches: {}", known.summary));
            open = known.undetermined;
        }
    }
    anyhow::ensure!(
        readings.len() >= FIRST_ASKED,
        "{} touches came, expected at least {FIRST_ASKED}",
        readings.len()
    );
    let found = ask(client, &args, &touched, &readings, args.apply).await?;
    let sensor = client.sensor(&args.sensor).await?;
    output.answer(&found, |found| text::report(found, &sensor))
}

async fn ask(
    client: &Client,
    args: &CommissionArgs,
    touched: &Touched,
    readings: &[CommissioningReading],
    apply: bool,
) -> anyhow::Result<Commissioning> {
    let (object, reference_body) = match touched {
        Touched::Object(name) => (Some(name.clone()), None),
        Touched::Body(body) => (None, Some(*body)),
    };
    let request = CommissionSensor {
        object,
        reference_body,
        session_from_object: args.pose,
        readings: readings.to_vec(),
        seed: Some(args.seed),
        apply,
    };
    Ok(client.commission_sensor(&args.sensor, &request).await?)
}

type Source = Box<dyn Iterator<Item = anyhow::Result<CommissioningReading>> + Send>;

async fn source(
    args: &CommissionArgs,
    touched: &Touched,
    client: &Client,
) -> anyhow::Result<Source> {
    match &args.readings {
        Some(path) => lines(path),
        None => {
            let sensor = client.sensor(&args.sensor).await?;
            let mesh = simulated::mesh(client, touched).await?;
            let n = args.touches as usize;
            let touches = simulated::touches(mesh, &sensor, &args.mistake, n, args.seed)?;
            Ok(Box::new(touches.into_iter().map(Ok)))
        }
    }
}

/// The touches of a file, line by line.
fn lines(path: &Path) -> anyhow::Result<Source> {
    let reader: Box<dyn BufRead + Send> = if path == Path::new("-") {
        Box::new(std::io::BufReader::new(std::io::stdin()))
    } else {
        let file =
            std::fs::File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
        Box::new(std::io::BufReader::new(file))
    };
    let named = path.display().to_string();
    let parsed = move |(index, line): (usize, std::io::Result<String>)| {
        let at = || format!("{named}, line {}", index + 1);
        let line = line.with_context(at)?;
        let Line { image, pose } = serde_json::from_str(&line).with_context(at)?;
        Ok(CommissioningReading { image, pose })
    };
    let is_empty =
        |line: &std::io::Result<String>| line.as_ref().is_ok_and(|line| line.trim().is_empty());
    Ok(Box::new(reader.lines().enumerate().filter(move |(_, line)| !is_empty(line)).map(parsed)))
}

fn parse_pose(text: &str) -> Result<Pose, String> {
    let wrong = || format!("came {text:?}, expected 7 numbers: x,y,z in metres, then x,y,z,w");
    let [x, y, z, a, b, c, d] = numbers(text).ok_or_else(wrong)?;
    Ok(Pose { position: [x, y, z], orientation: [a, b, c, d] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_has_seven_numbers() {
        let pose = parse_pose("0.1, -0.2,0.3,0,0,0,1").unwrap();
        assert_eq!((pose.position, pose.orientation), ([0.1, -0.2, 0.3], [0.0, 0.0, 0.0, 1.0]));
        assert!(parse_pose("1,2,3").unwrap_err().contains("expected 7"));
        assert!(parse_pose("1,2,3,0,0,0,w").is_err());
    }
}
