//! `palpate letters`: raised letters of a font, as meshes and as readings of a simulated rig.
//!
//! The rig is that of section 3.2.3: 192 planar presses per letter and repetition. The readings are
//! written in the API's format, for training or for a session. Needs no server.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::{Args, Subcommand, ValueEnum};
use glam::{DQuat, DVec3};
use palpate_client::schemas::{self, SensorPreset};
use palpate_core::pose::Pose;
use palpate_core::reading::SensorId;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::{DEG, MM};
use palpate_load::wire::on_the_wire;
use palpate_sim::letters::{Font, LOOK_ALIKE, Letter, RotationOrder, SYMBOLS, look_alikes};
use palpate_sim::rig::{Rig, RigNoise, plan, rig_sensor};
use serde::Serialize;

use crate::numbers::numbers;
use crate::output::{self, Output};

/// Name of the rig's sensor on the server, and of the rig in its readings.
const SENSOR: SensorPreset = SensorPreset::Digitacts6x6Thin;
const ROBOT: &str = "letter-rig";

/// Arguments of `palpate letters`.
#[derive(Debug, Args)]
pub(crate) struct LettersArgs {
    #[command(subcommand)]
    action: Action,
    /// Font file (TrueType or OpenType) [default: Quicksand Bold].
    #[arg(long, value_name = "FILE", global = true)]
    font: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// List the letters, their symmetries, and the pairs that are the same shape when rotated.
    List,
    /// Write letters as STL files in millimetres, face up at z = 0.
    #[command(after_help = "Examples:\n  palpate letters mesh A --out .\n  \
        palpate letters mesh --all --out letters")]
    Mesh {
        /// Letter to write.
        #[arg(value_parser = parse_letter, required_unless_present = "all", conflicts_with = "all")]
        letter: Option<char>,
        /// Write all 52 letters.
        #[arg(long)]
        all: bool,
        /// Folder to write to; created if missing.
        #[arg(long, value_name = "DIR", default_value = ".")]
        out: PathBuf,
        /// Thickness of the letters in millimetres.
        #[arg(long, default_value_t = 3.0, value_parser = parse_thickness)]
        thickness_mm: f64,
    },
    /// Press a letter with a simulated rig: 192 readings at 4 × 4 positions and 12 angles.
    #[command(after_help = "Examples:\n  palpate letters press A --out a.json\n  \
        palpate objects readings add A --file a.json\n  \
        palpate letters press A --repetition 1 --pose -5,3.5,120 --readings 9 --out test.json")]
    Press(PressArgs),
}

#[derive(Debug, Args)]
struct PressArgs {
    /// Letter to press.
    #[arg(value_parser = parse_letter)]
    letter: char,
    /// File to write: a JSON list of the API's `Reading`.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Repetition; each has its own noise.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u32).range(..1_000_000))]
    repetition: u32,
    /// Seed of the sensor's gains and of all noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Quality of the rig and the sensor.
    #[arg(long, value_enum, default_value = "physical")]
    noise: Noise,
    /// Pose of the letter in the session frame: x and y in millimetres, then degrees
    /// counter-clockwise. The poses written are then `session_from_sensor`.
    #[arg(long, value_name = "X,Y,DEG", value_parser = parse_pose, allow_hyphen_values = true)]
    pose: Option<Pose>,
    /// Number of readings to write, drawn at random [default: all].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=192))]
    readings: Option<u16>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Noise {
    /// As in the dissertation's rig.
    Physical,
    /// A bad rig with a bad sensor.
    Harsh,
    /// No noise.
    None,
}

/// A row of the list.
#[derive(Debug, Serialize)]
struct LetterRow {
    letter: char,
    width_mm: f64,
    height_mm: f64,
    /// Order of the rotational symmetry: 1 is none, absent for a shape that looks the same at every
    /// angle.
    rotation_order: Option<u32>,
}

/// Two letters with nearly the same shape.
#[derive(Debug, Serialize)]
struct PairRow {
    letters: [char; 2],
    overlap: f64,
    angle_deg: f64,
}

#[derive(Debug, Serialize)]
struct Listed {
    letters: Vec<LetterRow>,
    look_alikes: Vec<PairRow>,
}

/// Runs the command.
pub(crate) fn run(args: LettersArgs, output: Output) -> anyhow::Result<()> {
    let font = match args.font {
        None => Font::built_in(),
        Some(path) => {
            let bytes =
                std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
            Font::from_bytes(bytes).with_context(|| format!("cannot use {}", path.display()))?
        }
    };
    match args.action {
        Action::List => list(&font, output),
        Action::Mesh { letter, out, thickness_mm, .. } => {
            let letters: Vec<&Letter> = match letter {
                Some(symbol) => vec![found(&font, symbol)?],
                None => font.letters().iter().collect(),
            };
            write_meshes(&letters, &out, thickness_mm * MM, output)
        }
        Action::Press(press) => {
            let readings = readings(&font, &press)?;
            std::fs::write(&press.out, serde_json::to_vec(&readings)?)
                .with_context(|| format!("cannot write {}", press.out.display()))?;
            let path = press.out.display().to_string();
            output.say(format!("wrote {} readings to {path}", readings.len()));
            let answer = serde_json::json!({ "readings": readings.len(), "file": path });
            if output.json { output.answer(&answer, |_| String::new()) } else { Ok(()) }
        }
    }
}

fn list(font: &Font, output: Output) -> anyhow::Result<()> {
    let letters = font.letters().iter().map(|letter| LetterRow {
        letter: letter.symbol(),
        width_mm: letter.size().x / MM,
        height_mm: letter.size().y / MM,
        rotation_order: match letter.rotation_order() {
            RotationOrder::Finite(order) => Some(order),
            RotationOrder::Continuous => None,
        },
    });
    let pairs = look_alikes(font.letters(), LOOK_ALIKE).into_iter().map(|pair| PairRow {
        letters: [pair.first, pair.second],
        overlap: pair.overlap,
        angle_deg: pair.angle / DEG,
    });
    let listed = Listed { letters: letters.collect(), look_alikes: pairs.collect() };
    output.answer(&listed, |listed| {
        let letters = output::table(
            ["letter", "width", "height", "same after a turn of"],
            listed.letters.iter().map(|row| {
                let turn = match row.rotation_order {
                    Some(1) => "360°".to_owned(),
                    Some(order) => format!("{}°", 360 / order),
                    None => "any".to_owned(),
                };
                let mm = |length: f64| format!("{length:.1} mm");
                [row.letter.to_string(), mm(row.width_mm), mm(row.height_mm), turn]
            }),
        );
        let pairs = output::table(
            ["look alike", "overlap", "second turned by"],
            listed.look_alikes.iter().map(|row| {
                let [first, second] = row.letters;
                let overlap = format!("{:.0} %", 100.0 * row.overlap);
                [format!("{first} {second}"), overlap, format!("{:.0}°", row.angle_deg)]
            }),
        );
        format!("{letters}\n\n{pairs}")
    })
}

fn write_meshes(
    letters: &[&Letter],
    out: &Path,
    thickness: f64,
    output: Output,
) -> anyhow::Result<()> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    let mut written = Vec::new();
    for letter in letters {
        let mesh = letter.solid(thickness);
        // Mesh files are usually in millimetres; the mesh is in metres.
        let in_mm = mesh.scaled_to_largest_dimension(mesh.largest_dimension() / MM);
        // Some file systems do not distinguish a from A.
        let case = if letter.symbol().is_uppercase() { "upper" } else { "lower" };
        let path = out.join(format!("{case}_{}.stl", letter.symbol()));
        std::fs::write(&path, in_mm.to_stl_bytes())
            .with_context(|| format!("cannot write {}", path.display()))?;
        output.say(format!("wrote {}", path.display()));
        written.push(path);
    }
    if output.json { output.answer(&written, |_| String::new()) } else { Ok(()) }
}

/// The requested readings, in the API's format.
fn readings(font: &Font, args: &PressArgs) -> anyhow::Result<Vec<schemas::Reading>> {
    let noise = match args.noise {
        Noise::Physical => RigNoise::physical(),
        Noise::Harsh => RigNoise::harsh(),
        Noise::None => RigNoise::none(),
    };
    let rig = Rig::new(SensorId(0), &rig_sensor(), noise, args.seed);
    let field = rig.field(found(font, args.letter)?);
    let session = rig.session(&field, args.repetition);
    let session_from_letter = args.pose.unwrap_or(Pose::IDENTITY);
    let first_seq = u64::from(args.repetition) * plan().len() as u64;
    Ok(chosen(session.len(), args)
        .into_iter()
        .map(|press| {
            let reading = session[press].moved_by(session_from_letter);
            schemas::Reading {
                robot: Some(ROBOT.to_owned()),
                seq: Some(first_seq + press as u64),
                ..on_the_wire(&reading, SENSOR.name())
            }
        })
        .collect())
}

/// Indices of the presses to write: all in order, or a random selection without repetition.
fn chosen(n: usize, args: &PressArgs) -> Vec<usize> {
    let mut presses: Vec<usize> = (0..n).collect();
    let Some(wanted) = args.readings else { return presses };
    let index = u64::from(u32::from(args.letter)) << 32 | u64::from(args.repetition);
    let mut stream = Stream::new(args.seed, Purpose::ReadingChoice, index);
    let wanted = usize::from(wanted).min(n);
    for place in 0..wanted {
        presses.swap(place, place + stream.index(n - place));
    }
    presses.truncate(wanted);
    presses
}

fn found(font: &Font, symbol: char) -> anyhow::Result<&Letter> {
    font.letter(symbol).with_context(|| format!("the font has no letter {symbol}"))
}

fn parse_letter(text: &str) -> Result<char, String> {
    let mut symbols = text.chars();
    match (symbols.next(), symbols.next()) {
        (Some(symbol), None) if SYMBOLS.contains(symbol) => Ok(symbol),
        _ => Err("expected one letter, A to Z or a to z".to_owned()),
    }
}

fn parse_thickness(text: &str) -> Result<f64, String> {
    let expected = || "expected 0.1 to 1000 millimetres".to_owned();
    let thickness: f64 = text.parse().map_err(|_| expected())?;
    if (0.1..=1000.0).contains(&thickness) { Ok(thickness) } else { Err(expected()) }
}

/// `session_from_letter` of "x_mm,y_mm,degrees".
fn parse_pose(text: &str) -> Result<Pose, String> {
    let expected = || "expected x,y,angle: two places in mm and degrees, as -5,3.5,120".to_owned();
    let [x, y, degrees] = numbers(text).ok_or_else(expected)?;
    if [x, y, degrees].iter().any(|number| number.abs() > 1e6) {
        return Err(expected());
    }
    let rotation = DQuat::from_rotation_z(degrees * DEG);
    Ok(Pose::from_parts(rotation, DVec3::new(x, y, 0.0) * MM))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(pose: Option<Pose>, readings: Option<u16>) -> PressArgs {
        let (letter, out, noise) = ('A', PathBuf::new(), Noise::None);
        PressArgs { letter, out, repetition: 1, seed: 1, noise, pose, readings }
    }

    #[test]
    fn a_repetition_is_192_readings_that_the_wire_understands() {
        let readings = readings(&Font::built_in(), &args(None, None)).unwrap();
        assert_eq!(readings.len(), 192);
        assert_eq!((readings[0].seq, readings[191].seq), (Some(192), Some(383)));
        assert!(readings.iter().all(|reading| reading.image.len() == 36));
        // Over the lower left of the letter, looking down: −0.8 · 1.016 mm below the face.
        let [x, y, z] = readings[0].pose.unwrap().position;
        assert!((x + 10.2 * MM).abs() < 1e-12 && (y + 10.2 * MM).abs() < 1e-12);
        assert!((z + 0.8128 * MM).abs() < 1e-12);
    }

    #[test]
    fn a_letter_at_another_pose_keeps_its_images() {
        let font = Font::built_in();
        let still = readings(&font, &args(None, None)).unwrap();
        // A quarter turn and 5 mm along x: (−10.2, −10.2) goes to (10.2 + 5, −10.2) mm.
        let moved = parse_pose("5,0,90").unwrap();
        let moved = readings(&font, &args(Some(moved), None)).unwrap();
        let [x, y, _] = moved[0].pose.unwrap().position;
        assert!((x - 15.2 * MM).abs() < 1e-12 && (y + 10.2 * MM).abs() < 1e-12, "{x}, {y}");
        assert_eq!(still[7].image, moved[7].image);
    }

    #[test]
    fn readings_drawn_at_random_are_of_the_session_and_none_twice() {
        let font = Font::built_in();
        let all = readings(&font, &args(None, None)).unwrap();
        let some = readings(&font, &args(None, Some(50))).unwrap();
        let mut seqs: Vec<u64> = some.iter().filter_map(|reading| reading.seq).collect();
        assert!(some.iter().all(|reading| all.contains(reading)));
        assert!(!seqs.is_sorted());
        seqs.sort_unstable();
        seqs.dedup();
        assert_eq!(seqs.len(), 50);
    }
}
