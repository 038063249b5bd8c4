//! Readings whose contact Drake computes: a peer with other physics than our simulator's.
//!
//! Our sampler brings the sensor to rest in a world without Drake. Drake then gives the pressures
//! on the covering's surface at exactly that pose, by hydroelastic contact of a compliant box with
//! the rigid mesh. Spread and edge, force curve, noise, converter and gains are our simulator's.
//! At equal poses the images of both differ by 0.04 % of their maximum in the median and by at most
//! 1.5 % (60 presses of the ten built-in and ten assembled objects, without noise). The peer is a
//! script (`tests/peers/press_drake.py`) that reads meshes and poses from a folder.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};

use anyhow::{Context as _, bail, ensure};
use clap::Args;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::rng::{Purpose, Stream};
use palpate_core::sensor::SensorDescription;
use palpate_sim::press::{HOUSING_DEPTH, PressSimulator};
use serde::Serialize;

use crate::objects::TestObject;
use crate::sensing::Sensing;

/// The script's exit code when its module is missing.
const MODULE_MISSING: i32 = 3;

/// Streams of the electronics, beside those of gains and relative noise.
const ELECTRONICS: u64 = 1 << 63;

/// The program that asks Drake.
#[derive(Args, Clone, Debug, Serialize)]
pub struct Drake {
    /// A Python with drake, pyyaml and numpy, which presses in the worlds of Drake. Without them
    /// these worlds are left out.
    #[arg(long, default_value = "python3", value_name = "PATH")]
    #[serde(skip)]
    pub python: PathBuf,
    /// The script that presses.
    #[arg(long, default_value = "tests/peers/press_drake.py", value_name = "PATH")]
    #[serde(skip)]
    pub script: PathBuf,
}

impl Drake {
    /// What is missing for Drake's worlds; `None` when they can be played.
    ///
    /// # Errors
    /// When the script breaks off for another reason than its missing module.
    pub(super) fn missing(&self) -> anyhow::Result<Option<String>> {
        if !self.script.is_file() {
            return Ok(Some(format!("there is no script {}", self.script.display())));
        }
        // The script says the same, but its words would tear the progress bar.
        match self.command().arg("--module").stderr(Stdio::null()).status() {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                Ok(Some(format!("there is no program {}", self.python.display())))
            }
            Err(error) => Err(error).context(format!("cannot run {}", self.python.display())),
            Ok(status) if status.code() == Some(MODULE_MISSING) => {
                Ok(Some("its module is missing: pip install drake==1.51.1 pyyaml numpy".to_owned()))
            }
            Ok(status) => self.ended(status).map(|()| None),
        }
    }

    /// `n` readings of each object: poses as by [`Sensing::touch_all`], contact by Drake.
    ///
    /// # Errors
    /// When an object cannot be touched often enough, or the script breaks off or answers
    /// something else than it was asked.
    pub(super) fn touch_all(
        &self,
        sensing: &Sensing,
        objects: &[TestObject],
        n: usize,
        seed: u64,
    ) -> anyhow::Result<Vec<Vec<Reading>>> {
        let rested = sensing.touch_all(objects, n, seed)?;
        let simulators: Vec<PressSimulator> =
            objects.iter().map(|object| sensing.simulator(object)).collect();
        let folder = tempfile::tempdir().context("cannot create a folder for Drake")?;
        let status = write_presses(&simulators, &rested, folder.path())
            .and_then(|()| self.run(folder.path()))?;
        self.ended(status)?;
        let text = read(&folder.path().join("pressures.csv"))?;
        let mut lines = text.lines();
        let slope = pressure_per_depth(&sensing.sensor);
        let mut felt = Vec::with_capacity(objects.len());
        for (object, (simulator, rested)) in simulators.iter().zip(&rested).enumerate() {
            let one = |(index, rested): (usize, &Reading)| -> anyhow::Result<Reading> {
                let line = lines.next().context("the peer wrote too few lines")?;
                let (rows, cols, _) = simulator.cells();
                let indentations = indentations(line, rows * cols, slope)?;
                let press = simulator.press_of(&indentations);
                let number = ELECTRONICS | ((object as u64) << 32) | index as u64;
                let mut stream = Stream::new(seed, Purpose::SensorNoise, number);
                let pressures = simulator.pressures(&press, &mut stream);
                let pose = rested.session_from_sensor();
                Ok(simulator.reading(SensorId(0), pose, &pressures))
            };
            let readings: Vec<Reading> =
                rested.iter().enumerate().map(one).collect::<anyhow::Result<_>>()?;
            felt.push(sensing.as_taxels_give(&readings, object, seed)?);
        }
        ensure!(lines.next().is_none(), "the peer wrote too many lines");
        Ok(felt)
    }

    fn command(&self) -> Command {
        let mut command = Command::new(&self.python);
        command.arg(&self.script);
        command
    }

    fn run(&self, folder: &Path) -> anyhow::Result<ExitStatus> {
        let status = self.command().arg(folder).status();
        status.with_context(|| format!("cannot run {}", self.python.display()))
    }

    fn ended(&self, status: ExitStatus) -> anyhow::Result<()> {
        ensure!(status.success(), "{} ended with {status}", self.script.display());
        Ok(())
    }
}

/// The slope of a force curve between both ends of the covering, Pa/m: Drake's field of pressure
/// is linear in depth.
fn pressure_per_depth(sensor: &SensorDescription) -> f64 {
    let parameters = sensor.parameters();
    let thickness = parameters.covering_thickness;
    parameters.force_curve.pressure(thickness) / thickness
}

/// `covering.csv`: thickness, pressure per depth, largest depth of an object, rows, columns and
/// side of the cells; a mesh for each object, `0.off` and on; `poses.csv`: object and
/// `object_from_sensor` as position and quaternion x, y, z, w. Metres and pascals.
fn write_presses(
    simulators: &[PressSimulator],
    rested: &[Vec<Reading>],
    folder: &Path,
) -> anyhow::Result<()> {
    let Some(first) = simulators.first() else { bail!("there is no object to press") };
    let thickness = first.sensor().parameters().covering_thickness;
    let slope = pressure_per_depth(first.sensor());
    let (rows, cols, side) = first.cells();
    let covering = format!("{thickness},{slope},{HOUSING_DEPTH},{rows},{cols},{side}\n");
    write(folder, "covering.csv", covering.as_bytes())?;
    let mut poses = String::new();
    for (object, (simulator, rested)) in simulators.iter().zip(rested).enumerate() {
        write(folder, &format!("{object}.off"), &simulator.mesh().to_off_bytes())?;
        for reading in rested {
            let pose = reading.session_from_sensor();
            let [x, y, z] = pose.translation.to_array();
            let [qx, qy, qz, qw] = pose.rotation.to_array();
            writeln!(poses, "{object},{x},{y},{z},{qx},{qy},{qz},{qw}")?;
        }
    }
    write(folder, "poses.csv", poses.as_bytes())
}

/// The indentations (metres) of the cells by a line of their pressures.
fn indentations(line: &str, n_cells: usize, pressure_per_depth: f64) -> anyhow::Result<Vec<f64>> {
    let indentation = |text: &str| -> anyhow::Result<f64> {
        let pressure: f64 = text.parse().with_context(|| format!("{text} is not a number"))?;
        ensure!(pressure.is_finite() && pressure >= 0.0, "the peer's pressure is {pressure} Pa");
        Ok(pressure / pressure_per_depth)
    };
    let values: Vec<f64> = line.split(',').map(indentation).collect::<anyhow::Result<_>>()?;
    ensure!(values.len() == n_cells, "the peer pressed {} cells, expected {n_cells}", values.len());
    Ok(values)
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> anyhow::Result<()> {
    let path = folder.join(name);
    std::fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

fn read(path: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}

#[cfg(test)]
mod tests {
    use palpate_core::sensor::{Coupling, CoveringEdge, SensorParameters};
    use palpate_core::units::{KPA, MM};
    use palpate_sim::press::Load;
    use palpate_sim::shapes::LARGEST_DIMENSION;

    use super::*;
    use crate::objects::generated;

    /// A sensor without noise and with an even response, whose covering ends with the array.
    fn ending() -> SensorDescription {
        let known = SensorDescription::digitacts_6x6().parameters().clone();
        let edge = CoveringEdge::LosesForce;
        let coupling = Coupling { margin: Some(0.0), edge, ..known.coupling };
        let quiet = SensorParameters { noise: 0.0, quantisation: 0.0, coupling, ..known };
        SensorDescription::new(quiet).unwrap()
    }

    /// A "peer" that is a shell script of this text.
    fn peer(folder: &Path, text: &str) -> Drake {
        let script = folder.join("peer.sh");
        std::fs::write(&script, text).unwrap();
        Drake { python: PathBuf::from("sh"), script }
    }

    #[test]
    fn readings_are_the_peers_pressures_at_the_samplers_poses() {
        // Each of the 2 × 3 presses has 12 × 12 cells at 4 kPa.
        let script = "test $1 = --module && exit 0\n\
            test $(wc -l < $1/poses.csv) = 6 && test -s $1/0.off && test -s $1/1.off \\\n\
            && test $(cut -d, -f4-5 $1/covering.csv) = 12,12 || exit 1\n\
            line=4000; for cell in $(seq 143); do line=$line,4000; done\n\
            for press in 1 2 3 4 5 6; do echo $line; done > $1/pressures.csv";
        let folder = tempfile::tempdir().unwrap();
        let drake = peer(folder.path(), script);
        assert_eq!(drake.missing().unwrap(), None);
        let objects = generated(&["hammer", "mug"], LARGEST_DIMENSION).unwrap();
        let sensing = Sensing { gain_spread: 0.05, ..Sensing::with(ending()) };
        let rested = sensing.touch_all(&objects, 3, 5).unwrap();
        let felt = drake.touch_all(&sensing, &objects, 3, 5).unwrap();
        let even = sensing.simulator(&objects[0]).press_of(&[4.0 / 20.0 * 2.54 * MM; 144]);
        let Load::Displacements(even) = even.load else { panic!("a spread gives displacements") };
        for (rested, felt) in rested.iter().flatten().zip(felt.iter().flatten()) {
            assert_eq!(rested.session_from_sensor(), felt.session_from_sensor());
            for (displacement, pressure) in even.iter().zip(&felt.image().pressures) {
                let expected = displacement / (2.54 * MM) * 20.0 * KPA;
                assert!((pressure / expected - 1.0).abs() < 0.151, "{pressure} for {expected}");
            }
        }
        let gains = |image: &Reading| image.image().pressures[0] / image.image().pressures[35];
        assert!((gains(&felt[0][0]) / gains(&felt[1][2]) - 1.0).abs() < 1e-9, "of one sensor");
    }

    #[test]
    fn what_is_missing_is_told_and_what_fails_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let nowhere = Drake { script: folder.path().join("none.py"), python: "sh".into() };
        assert!(nowhere.missing().unwrap().unwrap().contains("there is no script"));
        let drake = peer(folder.path(), "exit 3");
        assert!(drake.missing().unwrap().unwrap().contains("pip install"));
        let without = Drake { python: folder.path().join("python"), ..drake };
        assert!(without.missing().unwrap().unwrap().contains("there is no program"));
        let drake = peer(folder.path(), "exit 1");
        assert!(drake.missing().unwrap_err().to_string().contains("exit status: 1"));
        let drake = peer(folder.path(), "echo 1,2,3 > $1/pressures.csv");
        let hammer = generated(&["hammer"], LARGEST_DIMENSION).unwrap();
        let error = drake.touch_all(&Sensing::with(ending()), &hammer, 1, 5).unwrap_err();
        assert!(error.to_string().contains("pressed 3 cells, expected 144"), "{error}");
    }

    #[test]
    fn the_peers_check_expects_the_images_of_our_simulator() {
        // A sphere of 20 mm at (4, −2) mm, 1 mm deep: the script has the same images, in pascal.
        let script = include_str!("../../../tests/peers/press_drake.py");
        let object = &generated(&["hammer"], LARGEST_DIMENSION).unwrap()[0];
        for (name, sensor) in [("ENDS", ending()), ("BEYOND", SensorDescription::digitacts_6x6())] {
            let simulator = Sensing::with(sensor).simulator(object);
            let (rows, cols, side) = simulator.cells();
            let middle = |index: usize, n: usize| (index as f64 - 0.5 * (n as f64 - 1.0)) * side;
            let indentation = |at: usize| {
                let (x, y) = (middle(at % cols, cols), middle(at / cols, rows));
                let (x, y) = (x - 4.0 * MM, y + 2.0 * MM);
                1.0 * MM - 20.0 * MM + ((20.0 * MM).powi(2) - x * x - y * y).max(0.0).sqrt()
            };
            let press = simulator.press_of(&(0..rows * cols).map(indentation).collect::<Vec<_>>());
            let Load::Displacements(image) = press.load else { panic!("a spread") };
            let pressure = |d: &f64| format!("{:.1}", d / 2.54e-3 * 20e3);
            let row = |row: &[f64]| row.iter().map(pressure).collect::<Vec<_>>().join(", ");
            let rows: String = image.chunks(6).map(|of| format!("    [{}],\n", row(of))).collect();
            let expected = format!("{name} = [\n{rows}]\n");
            assert!(script.contains(&expected), "the script lacks {expected}");
        }
    }
}
