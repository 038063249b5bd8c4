//! `palpate draw`: pictures that need no server, such as the tactile image of one press.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use clap::{Args, Subcommand};
use glam::{DMat3, DQuat, DVec3};
use palpate_client::schemas::{MeshUnit, Pose as WirePose, SensorPreset};
use palpate_core::pose::Pose;
use palpate_core::reading::{SensorId, TactileImage};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::{DEG, KPA, MM};
use palpate_sim::mesh::Mesh;
use palpate_sim::plot::grids::{Grid, grids_svg};
use palpate_sim::press::PressSimulator;
use palpate_sim::shapes;
use serde::Serialize;

use super::sensors::parse_preset;
use crate::numbers::numbers;
use crate::output::Output;
use crate::robot;

/// Gap between the object's bounding sphere and a sensor that begins to approach, metres. Chosen.
const GAP: f64 = 5.0 * MM;
/// Largest coordinate of a pose, mm. Chosen: a kilometre.
const COORDINATE_MAX_MM: f64 = 1e6;

/// Arguments of `palpate draw`.
#[derive(Debug, Args)]
pub(crate) struct DrawArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Draw the tactile image of one press of a mesh (SVG), with a scale of length and pressure.
    #[command(
        after_help = "Examples:\n  palpate draw press --object mug --from 90,0 --out mug.svg\n  \
        palpate draw press --mesh part.stl --sensor tekscan-26x26 --from 30,45 --turn 90 --out p.svg\
        \n  palpate draw press --object mug --pose 0,0,-27.8,1,0,0,0 --out bottom.svg\n\n\
        The picture is seen from the object: the sensor's x to the right, its y up."
    )]
    Press(PressArgs),
}

/// Arguments of `palpate draw press`.
#[derive(Debug, Args)]
struct PressArgs {
    /// A built-in example to press.
    #[arg(long, required_unless_present = "mesh", conflicts_with = "mesh")]
    object: Option<String>,
    /// Mesh to press: .stl, .obj, .ply, .off, .glb or .3mf.
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Unit of the mesh file's coordinates, `mm` if neither this nor the file says it.
    #[arg(long, value_enum)]
    unit: Option<MeshUnit>,
    /// The sensor that presses.
    #[arg(long, default_value = "digitacts-6x6", value_parser = parse_preset)]
    sensor: SensorPreset,
    /// Pose of the sensor in the mesh's frame, its +z towards the object: x, y, z in millimetres,
    /// then a unit quaternion x, y, z, w.
    #[arg(
        long, value_name = "X,Y,Z,QX,QY,QZ,QW", value_parser = parse_pose,
        allow_hyphen_values = true, required_unless_present = "from",
        conflicts_with_all = ["from", "depth", "turn"]
    )]
    pose: Option<Pose>,
    /// Direction from which the sensor comes towards the object's middle: azimuth about z from +x,
    /// and elevation, in degrees.
    #[arg(
        long, value_name = "AZIMUTH,ELEVATION", value_parser = parse_direction,
        allow_hyphen_values = true
    )]
    from: Option<Direction>,
    /// Depth of the press as a share of the covering's thickness, 0.01 to 1.
    #[arg(long, default_value_t = 0.8, value_name = "SHARE", value_parser = parse_depth)]
    depth: f64,
    /// Turn of the sensor about its own z, degrees.
    #[arg(long, default_value_t = 0.0, value_name = "DEGREES", allow_hyphen_values = true)]
    turn: f64,
    /// Seed of the sensor's noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// File to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// A direction from the object's middle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Direction {
    azimuth: f64,
    elevation: f64,
}

/// The answer of the command.
#[derive(Debug, Serialize)]
struct Drawn {
    file: PathBuf,
    /// `object_from_sensor`, metres.
    pose: WirePose,
    /// How deep the object is in the covering.
    depth_mm: f64,
    /// Number of rows and of columns.
    shape: [usize; 2],
    /// Row-major, rows along +y, pascal.
    image: Vec<f64>,
}

/// Runs the command.
pub(crate) fn run(args: DrawArgs, output: Output) -> anyhow::Result<()> {
    let Action::Press(args) = args.action;
    let mesh = mesh(&args, output)?;
    let name = name(&args);
    let drawn = press(&args, mesh, &name)?;
    output.answer(&drawn, |drawn| {
        let most = drawn.image.iter().copied().fold(0.0, f64::max) / KPA;
        let [rows, cols] = drawn.shape;
        format!(
            "wrote {}: {rows} × {cols} taxels, at most {most:.1} kPa, pressed {:.2} mm deep",
            drawn.file.display(),
            drawn.depth_mm
        )
    })
}

fn mesh(args: &PressArgs, output: Output) -> anyhow::Result<Mesh> {
    match (&args.mesh, &args.object) {
        (Some(path), _) => {
            let file = robot::read_mesh(path, args.unit)?;
            output.say(robot::read_as(&file));
            Ok(file.mesh)
        }
        (None, Some(name)) => shapes::example(name).with_context(|| {
            let names = shapes::NAMES.join(", ");
            format!("object {name} is not a built-in example, expected one of {names}")
        }),
        (None, None) => anyhow::bail!("expected --object NAME or --mesh FILE"),
    }
}

/// The object's name, for the title.
fn name(args: &PressArgs) -> String {
    let stem = |path: &Path| path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let of_file = args.mesh.as_deref().and_then(stem);
    of_file.or_else(|| args.object.clone()).unwrap_or_default()
}

/// Presses, and writes the picture.
fn press(args: &PressArgs, mesh: Mesh, name: &str) -> anyhow::Result<Drawn> {
    let sensor = robot::described(args.sensor);
    let simulator = PressSimulator::new(mesh, sensor.clone());
    let object_from_sensor = match (args.pose, args.from) {
        (Some(pose), _) => pose,
        (None, Some(from)) => approached(&simulator, from, args.turn * DEG, args.depth)?,
        (None, None) => anyhow::bail!("expected --pose or --from"),
    };
    let pressed = simulator.press(object_from_sensor);
    ensure!(
        pressed.max_penetration > 0.0,
        "the sensor does not touch the object: its covering has to be in it, with +z towards it"
    );
    let (depth, thickness) =
        (pressed.max_penetration / MM, sensor.parameters().covering_thickness / MM);
    ensure!(
        depth <= thickness + 1e-6,
        "the object is {depth:.2} mm deep in a covering of {thickness:.2} mm: move the sensor back"
    );
    let mut stream = Stream::new(args.seed, Purpose::SensorNoise, 0);
    let reading = simulator.read(SensorId(0), object_from_sensor, &mut stream);
    let image: &TactileImage = reading.image();
    let title = format!("{name}, {}", args.sensor.name());
    let full = image.max().max(f64::MIN_POSITIVE);
    let drawing = Grid::tactile(&title, sensor.grid(), &image.pressures, full);
    std::fs::write(&args.out, grids_svg(&[drawing], 1))
        .with_context(|| format!("cannot write {}", args.out.display()))?;
    Ok(Drawn {
        file: args.out.clone(),
        pose: robot::wire_pose(object_from_sensor),
        depth_mm: depth,
        shape: [image.rows, image.cols],
        image: image.pressures.clone(),
    })
}

/// The pose of a sensor that came from a direction towards the object's middle, until the object
/// is `depth` of the covering deep in it.
fn approached(
    simulator: &PressSimulator,
    from: Direction,
    turn: f64,
    depth: f64,
) -> anyhow::Result<Pose> {
    let (low, high) = simulator.mesh().bounds();
    let (middle, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
    let (sin, cos) = from.elevation.sin_cos();
    let outward = DVec3::new(cos * from.azimuth.cos(), cos * from.azimuth.sin(), sin);
    let forward = -outward;
    // The sensor's y is as upright as it can be; from straight above or below it is the mesh's y.
    let upright = if sin.abs() > 1.0 - 1e-9 { DVec3::Y } else { DVec3::Z };
    let up = (upright - upright.dot(forward) * forward).normalize();
    let axes = DMat3::from_cols(up.cross(forward), up, forward);
    let rotation = DQuat::from_mat3(&axes) * DQuat::from_rotation_z(turn);
    let start = Pose::from_parts(rotation, middle + (radius + GAP) * outward);
    let heights = simulator.heights(start, 2.0 * (radius + GAP));
    let distance = heights.lowest();
    ensure!(distance.is_finite(), "the sensor passes the object by: there is no surface ahead");
    let travel = distance + depth * simulator.sensor().parameters().covering_thickness;
    Ok(start * Pose::from_parts(DQuat::IDENTITY, travel * DVec3::Z))
}

fn parse_pose(text: &str) -> Result<Pose, String> {
    let expected = "seven numbers: x, y, z in mm, within ±1e6, and a unit quaternion x, y, z, w";
    let wrong = || format!("expected {expected}");
    let [x, y, z, qx, qy, qz, qw] = numbers(text).ok_or_else(wrong)?;
    let position = DVec3::new(x, y, z);
    if position.abs().max_element() > COORDINATE_MAX_MM {
        return Err(wrong());
    }
    let metres = (position * MM).to_array();
    Pose::new(metres, [qx, qy, qz, qw]).map_err(|error| error.to_string())
}

fn parse_direction(text: &str) -> Result<Direction, String> {
    let expected = "two angles in degrees, azimuth within ±360 and elevation within ±90, as 30,45";
    let wrong = || format!("expected {expected}");
    let [azimuth, elevation] = numbers(text).ok_or_else(wrong)?;
    if azimuth.abs() > 360.0 || elevation.abs() > 90.0 {
        return Err(wrong());
    }
    Ok(Direction { azimuth: azimuth * DEG, elevation: elevation * DEG })
}

fn parse_depth(text: &str) -> Result<f64, String> {
    let depth = text.parse::<f64>().ok().filter(|depth| (0.01..=1.0).contains(depth));
    depth.ok_or_else(|| "expected a share from 0.01 to 1".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(out: &Path, pose: Option<&str>, from: Option<&str>) -> PressArgs {
        PressArgs {
            object: Some("mug".to_owned()),
            mesh: None,
            unit: None,
            sensor: SensorPreset::Digitacts6x6,
            pose: pose.map(|text| parse_pose(text).unwrap()),
            from: from.map(|text| parse_direction(text).unwrap()),
            depth: 0.8,
            turn: 0.0,
            seed: 1,
            out: out.to_owned(),
        }
    }

    fn drawn(args: &PressArgs) -> anyhow::Result<Drawn> {
        press(args, mesh(args, Output { json: true })?, &name(args))
    }

    #[test]
    fn a_sensor_comes_from_the_stated_side_and_as_deep() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("mug.svg");
        let drawn = drawn(&args(&out, None, Some("90,0"))).unwrap();
        // 0.8 of 0.10 inch.
        assert!((drawn.depth_mm - 2.032).abs() < 0.01, "{}", drawn.depth_mm);
        // From +y: the sensor's z is −y of the mesh, its y the mesh's z.
        let pose = DQuat::from_array(drawn.pose.orientation);
        assert!((pose * DVec3::Z).distance(DVec3::NEG_Y) < 1e-9);
        assert!((pose * DVec3::Y).distance(DVec3::Z) < 1e-9);
        assert!(drawn.pose.position[1] > 0.0, "{:?}", drawn.pose.position);
        let svg = std::fs::read_to_string(out).unwrap();
        assert_eq!(svg.matches("<rect ").count(), 37); // 36 taxels and the background
        assert!(svg.contains("mug, digitacts-6x6") && svg.contains("kPa"), "{svg}");
    }

    #[test]
    fn a_stated_pose_gives_the_image_of_its_direction() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("mug.svg");
        let first = drawn(&args(&out, None, Some("20,10"))).unwrap();
        let [x, y, z] = first.pose.position.map(|metres| metres / MM);
        let [qx, qy, qz, qw] = first.pose.orientation;
        let text = format!("{x},{y},{z},{qx},{qy},{qz},{qw}");
        let again = drawn(&args(&out, Some(&text), None)).unwrap();
        assert_eq!(first.shape, again.shape);
        // Rounding of millimetres may move a value by one step of the converter, 20 kPa / 255.
        let same = first.image.iter().zip(&again.image).all(|(a, b)| (a - b).abs() < 100.0);
        assert!(same, "{:?} {:?}", first.image, again.image);
    }

    #[test]
    fn a_sensor_in_free_air_is_refused_with_the_reason() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("mug.svg");
        let error = drawn(&args(&out, Some("500,0,0,0,0,0,1"), None)).unwrap_err();
        assert!(error.to_string().contains("does not touch"), "{error}");
        assert!(!out.exists());
    }

    #[test]
    fn a_press_through_the_covering_is_refused_with_its_depth() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("mug.svg");
        // The mug's bottom is 25.8 mm below its middle; the covering is 2.54 mm thick.
        let error = drawn(&args(&out, Some("0,0,-30,1,0,0,0"), None)).unwrap_err();
        assert!(error.to_string().contains("deep in a covering of 2.54 mm"), "{error}");
        assert!(drawn(&args(&out, Some("0,0,-27.8,1,0,0,0"), None)).is_ok());
    }

    #[test]
    fn poses_and_directions_out_of_range_are_refused() {
        for text in ["1,2,3", "0,0,0,0,0,0,2", "2e6,0,0,0,0,0,1", "nan,0,0,0,0,0,1"] {
            assert!(parse_pose(text).is_err(), "{text}");
        }
        for text in ["361,0", "0,91", "0", "a,b"] {
            assert!(parse_direction(text).is_err(), "{text}");
        }
        assert!(parse_depth("0").is_err() && parse_depth("1.1").is_err());
    }
}
