//! `palpate sensors`: sensors and their calibrations.

mod commission;
mod coupling;
mod health;

use std::path::PathBuf;

use anyhow::Context as _;
use clap::{Args, Subcommand};
use palpate_client::schemas::{
    CalibrateSensor, CalibrationQuery, CreateSensor, DescribeSensor, Drawing, Reading,
    ReadingCheck, ReferenceBody, ReferenceBodyName, ResponseForm, Sensor, SensorPassport,
    SensorPreset,
};

use super::labels::{self, LabelArgs, WantedArgs};
use super::{Context, calibrate};
use crate::json_file::read_json;
use crate::output;
use commission::CommissionArgs;
use coupling::CouplingArgs;

/// Arguments of `palpate sensors`.
#[derive(Debug, Args)]
pub(crate) struct SensorsArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// List the sensors.
    List(WantedArgs),
    /// Set the labels of a sensor; everything else of it is immutable.
    Label(LabelArgs),
    /// Show one sensor.
    Show {
        /// Id or name of the sensor.
        sensor: String,
    },
    /// Add a sensor, from a preset or a JSON description.
    #[command(
        after_help = "Examples:\n  palpate sensors add left-finger --preset digitacts-6x6\n  \
        palpate sensors add palm --description palm.json\n  \
        palpate sensors add thumb --preset digitacts-6x6 --knowledge data_sheet --margin-mm 1"
    )]
    Add {
        /// Unique name of the sensor.
        name: String,
        /// Preset of a known sensor.
        #[arg(long, value_parser = parse_preset, required_unless_present = "description")]
        preset: Option<SensorPreset>,
        /// JSON file with the API's `DescribeSensor`. The guide "sensors" explains how to fill it
        /// in from a data sheet.
        #[arg(long, value_name = "FILE", conflicts_with = "preset")]
        description: Option<PathBuf>,
        #[command(flatten)]
        coupling: CouplingArgs,
    },
    /// Remove a sensor. Refused while something uses it.
    Remove {
        /// Id or name of the sensor.
        sensor: String,
    },
    /// Fit the taxels' response to indentations; later readings are corrected with it.
    Calibrate {
        /// Id or name of the sensor.
        sensor: String,
        /// JSON file with the API's `CalibrateSensor`.
        #[arg(long, value_name = "FILE")]
        file: PathBuf,
        /// Fit curves instead of lines, for a sensor that stiffens.
        #[arg(long)]
        curves: bool,
    },
    /// Show a sensor's calibration.
    Calibration {
        /// Id or name of the sensor.
        sensor: String,
        /// Number of the calibration [default: the newest].
        #[arg(long)]
        number: Option<u32>,
    },
    /// Show whether to commission a sensor again, and why: drift, dead taxels, tool centre.
    Health {
        /// Id or name of the sensor.
        sensor: String,
    },
    /// Simulate indentations of a sensor, with a dead and a cross-wired taxel, as input for
    /// `calibrate`.
    Indent {
        /// Id or name of the sensor.
        sensor: String,
        /// File to write.
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
        /// Seed of gains, faults and noise.
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Find out by touches of a known object what holds for a sensor on its robot.
    #[command(
        after_help = "Examples:\n  palpate sensors commission finger --object mug --readings - \
        --apply\n  palpate sensors commission finger --reference ridge --simulate --mistake mirror"
    )]
    Commission(Box<CommissionArgs>),
    /// List the bodies to print and commission with, or write the STL of one.
    Reference {
        /// Name of the body.
        #[arg(value_enum)]
        body: Option<ReferenceBodyName>,
        /// File to write.
        #[arg(long, value_name = "FILE", requires = "body")]
        out: Option<PathBuf>,
    },
    /// Show a sensor's passport: what its readings are corrected by.
    Passport {
        /// Id or name of the sensor.
        sensor: String,
        /// Number of the calibration [default: the newest].
        #[arg(long)]
        number: Option<u32>,
    },
    /// Show how the server interprets a reading: orientation, dead taxels, contact.
    Check {
        /// Id or name of the sensor.
        sensor: String,
        /// JSON file with the API's `Reading`.
        #[arg(long, value_name = "FILE")]
        reading: PathBuf,
    },
}

/// Runs the command.
pub(crate) async fn run(args: SensorsArgs, context: &Context) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    match args.action {
        Action::List(wanted) => {
            let page = client.sensors(&wanted.query()).await?;
            output.answer(&page, |page| table(&page.items))
        }
        Action::Label(args) => {
            let sensor = args.thing.clone();
            let sensor = client.set_sensor_labels(&sensor, &args.labels()).await?;
            output.answer(&sensor, |sensor| table(std::slice::from_ref(sensor)))
        }
        Action::Show { sensor } => {
            let sensor = client.sensor(&sensor).await?;
            output.answer(&sensor, |sensor| {
                let known = coupling::words(sensor);
                let passport = sensor.passport.map(|number| {
                    format!("\ncommissioned: the passport of calibration {number} applies")
                });
                let passport = passport.unwrap_or_default();
                format!("{}\n{known}{passport}", table(std::slice::from_ref(sensor)))
            })
        }
        Action::Add { name, preset, description, coupling } => {
            let description = description.map(read_json::<DescribeSensor>).transpose()?;
            let new = coupling.applied(CreateSensor {
                name,
                preset,
                description,
                ..CreateSensor::default()
            });
            let sensor = client.create_sensor(&new).await?;
            output.answer(&sensor, |sensor| {
                let words = coupling::words(sensor);
                format!("added sensor {} ({})\n{words}", sensor.name, sensor.id)
            })
        }
        Action::Remove { sensor } => {
            client.delete_sensor(&sensor).await?;
            output.answer(&(), |()| format!("removed sensor {sensor}"))
        }
        Action::Calibrate { sensor, file, curves } => {
            let mut indentations: CalibrateSensor = read_json(file)?;
            if curves {
                indentations.form = Some(ResponseForm::Curves);
            }
            let calibration = client.calibrate_sensor(&sensor, &indentations).await?;
            output.answer(&calibration, calibrate::text)
        }
        Action::Calibration { sensor, number } => {
            let calibration = client.calibration(&sensor, &CalibrationQuery { number }).await?;
            output.answer(&calibration, calibrate::text)
        }
        Action::Health { sensor } => {
            output.answer(&client.sensor_health(&sensor).await?, health::text)
        }
        Action::Indent { sensor, out, seed } => {
            let said = calibrate::indent(client, &sensor, &out, seed).await?;
            output.answer(&out, |_| said)
        }
        Action::Commission(args) => commission::run(*args, context).await,
        Action::Reference { body, out } => reference(body, out, context).await,
        Action::Passport { sensor, number } => {
            let passport = client.passport(&sensor, &CalibrationQuery { number }).await?;
            output.answer(&passport, passport_text)
        }
        Action::Check { sensor, reading } => {
            let reading: Reading = read_json(reading)?;
            let check = client.check_reading(&sensor, &reading).await?;
            output.answer(&check, check_text)
        }
    }
}

/// Lists the reference bodies, or writes one.
async fn reference(
    body: Option<ReferenceBodyName>,
    out: Option<PathBuf>,
    context: &Context,
) -> anyhow::Result<()> {
    let (client, output) = (&context.client, context.output);
    let Some(body) = body else {
        let bodies = client.reference_bodies().await?;
        return output.answer(&bodies, |bodies| {
            let size = |body: &ReferenceBody| {
                let sides: Vec<String> =
                    body.size.iter().map(|side| format!("{:.0}", side * 1e3)).collect();
                format!("{} mm", sides.join(" × "))
            };
            let row = |body: &ReferenceBody| {
                let (tells, stands_on) = (body.tells.clone(), body.stands_on.clone());
                [body.name.name().to_owned(), size(body), tells, stands_on]
            };
            output::table(["name", "size", "tells", "stands on"], bodies.items.iter().map(row))
        });
    };
    let out = out.unwrap_or_else(|| PathBuf::from(format!("{}.stl", body.name())));
    let file = client.reference_mesh(body).await?;
    std::fs::write(&out, file).with_context(|| format!("cannot write {}", out.display()))?;
    output.answer(&out, |out| format!("wrote {}, in millimetres", out.display()))
}

fn check_text(check: &ReadingCheck) -> String {
    let mut lines = Vec::new();
    for row in check.image.chunks(check.cols.max(1) as usize) {
        let taxels: Vec<_> = row.iter().map(|value| format!("{value:8.0}")).collect();
        lines.push(taxels.join(" "));
    }
    lines.push(format!(
        "{} taxels touch, {} are saturated, {} have no value; largest {:.0} Pa",
        check.contact.len(),
        check.saturated.len(),
        check.missing.len(),
        check.max_pressure
    ));
    if let Some(number) = check.calibration {
        let n = check.unusable.len();
        lines.push(format!("corrected with calibration {number}, which excludes {n}"));
    }
    if let Some(number) = check.passport {
        lines.push(format!("corrected by the passport of calibration {number}"));
    }
    lines.extend(check.hints.iter().map(|hint| format!("note: {hint}")));
    lines.join("\n")
}

fn passport_text(passport: &SensorPassport) -> String {
    let mut lines = vec![format!(
        "passport of calibration {}, made {} by {} touches of {}",
        passport.number, passport.created_at, passport.n_touches, passport.touched
    )];
    lines.push(format!(
        "unexplained pressure: {:.1} % as stated, {:.1} % as found",
        100.0 * passport.residual_before,
        100.0 * passport.residual_after
    ));
    if passport.corrections.is_empty() {
        lines.push("readings are not changed; trainings press with the sensor as measured".into());
    }
    lines.extend(passport.corrections.iter().cloned());
    let open: Vec<&str> = passport.undetermined.iter().map(|name| name.name()).collect();
    if !open.is_empty() {
        lines.push(format!("not determined, and left as stated: {}", open.join(", ")));
    }
    lines.join("\n")
}

pub(crate) fn parse_preset(name: &str) -> Result<SensorPreset, String> {
    let names = || SensorPreset::ALL.map(SensorPreset::name).join(", ");
    let known = SensorPreset::ALL.into_iter().find(|preset| preset.name() == name);
    known.ok_or_else(|| format!("expected one of {}", names()))
}

/// The number of taxels: rows and columns, or how many are listed.
fn taxels(sensor: &Sensor) -> String {
    let (grid, listed) = (&sensor.description.grid, &sensor.description.taxels);
    match (&sensor.layout, listed) {
        (Some(layout), Some(taxels)) if layout.drawing != Drawing::AsIs => taxels.len().to_string(),
        _ => format!("{} × {}", grid.rows, grid.cols),
    }
}

fn table(sensors: &[Sensor]) -> String {
    output::table(
        ["name", "id", "taxels", "pitch", "covering", "up to", "knowledge", "labels"],
        sensors.iter().map(|sensor| {
            let description = &sensor.description;
            [
                sensor.name.clone(),
                sensor.id.to_string(),
                taxels(sensor),
                output::mm(description.grid.pitch),
                output::mm(description.covering_thickness),
                format!("{:.0} kPa", description.saturation / 1e3),
                sensor.sensor_knowledge.name().to_owned(),
                labels::words(&sensor.labels),
            ]
        }),
    )
}
