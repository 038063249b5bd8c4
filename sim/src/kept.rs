//! A folder that keeps simulated touches, so that long work goes on after a stop where it was.
//!
//! Touches follow from the object, the sensor, the sampler and a seed; a file is named by a hash
//! of all of them ([`Cause`]), so that a folder serves any number of meshes and runs, and touches
//! of what has changed since are not found. Damaged files count as absent, since touches can be
//! taken again.

use std::fmt::Debug;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::SensorDescription;

use crate::press::{PressSimulator, in_row_major_order};
use crate::sampler::SamplerConfig;

/// Version of the files and of the simulation. Raise it when either changes: touches of another
/// version are not found.
const VERSION: u32 = 1;

/// Marks a taxel without a value. A reading has finite values.
const MISSING: f64 = f64::NAN;

/// What touches follow from, as a hash.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cause(blake3::Hash);

impl Cause {
    /// The cause of touches of a simulator's object by a sampler, and of `more`: the number of
    /// touches, their seed and whatever else decides on them.
    #[must_use]
    pub fn new(simulator: &PressSimulator, config: &SamplerConfig, more: &impl Debug) -> Self {
        let mut hasher = blake3::Hasher::new();
        let mesh = simulator.mesh();
        let numbers = mesh.vertices().iter().flat_map(|vertex| vertex.to_array());
        hasher.update(&VERSION.to_le_bytes());
        hasher.update(&(mesh.vertices().len() as u64).to_le_bytes());
        numbers.for_each(|number| {
            hasher.update(&number.to_le_bytes());
        });
        mesh.triangles().as_flattened().iter().for_each(|corner| {
            hasher.update(&corner.to_le_bytes());
        });
        // The shortest decimals that give a number back are as exact as its bits.
        let settings = (simulator.sensor(), simulator.config(), config, more);
        hasher.update(format!("{settings:?}").as_bytes());
        Self(hasher.finalize())
    }
}

/// A folder with touches.
#[derive(Clone, Debug)]
pub struct Kept {
    folder: PathBuf,
}

impl Kept {
    /// Opens a folder, which is made if there is none.
    ///
    /// # Errors
    /// When it cannot be made.
    pub fn open(folder: &Path) -> io::Result<Self> {
        std::fs::create_dir_all(folder)?;
        Ok(Self { folder: folder.to_owned() })
    }

    /// The lists of readings that were kept of this cause; `None` if there are none, or if their
    /// file is damaged. `sensor` has the description that took them.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn read(
        &self,
        cause: &Cause,
        sensor: &SensorDescription,
    ) -> io::Result<Option<Vec<Vec<Reading>>>> {
        match std::fs::read(self.file(cause)) {
            Ok(bytes) => Ok(lists(&bytes, &in_row_major_order(sensor))),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Keeps lists of readings. The file appears under its name when it is whole.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, cause: &Cause, lists: &[&[Reading]]) -> io::Result<()> {
        let file = self.file(cause);
        let part = file.with_extension("part");
        std::fs::write(&part, bytes(lists))?;
        std::fs::rename(part, file)
    }

    /// The number of files.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn n_files(&self) -> io::Result<usize> {
        let entries = std::fs::read_dir(&self.folder)?;
        let is_whole = |path: PathBuf| path.extension().is_some_and(|kind| kind == EXTENSION);
        entries.map(|entry| Ok(usize::from(is_whole(entry?.path())))).sum()
    }

    /// The bytes of all files.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn n_bytes(&self) -> io::Result<u64> {
        std::fs::read_dir(&self.folder)?.map(|entry| Ok(entry?.metadata()?.len())).sum()
    }

    fn file(&self, cause: &Cause) -> PathBuf {
        self.folder.join(cause.0.to_hex().as_str()).with_extension(EXTENSION)
    }
}

/// Extension of a whole file.
const EXTENSION: &str = "touches";

/// The bytes of a file of these lists.
#[must_use]
pub fn n_bytes(lists: &[&[Reading]]) -> u64 {
    let reading = |reading: &Reading| READING_BYTES + 8 * reading.values().len() as u64;
    let list = |list: &&[Reading]| 4 + list.iter().map(reading).sum::<u64>();
    HEAD_BYTES + lists.iter().map(list).sum::<u64>()
}

/// Bytes of a file before its lists, and of a reading before its values.
const HEAD_BYTES: u64 = 32 + 4;
const READING_BYTES: u64 = 16 + 8 * (3 + 4 + 1) + 4;

/// The hash of what follows, and the lists, little-endian: their number, and of each its length
/// and its readings.
fn bytes(lists: &[&[Reading]]) -> Vec<u8> {
    let mut bytes = Vec::new();
    bytes.extend((lists.len() as u32).to_le_bytes());
    for readings in lists {
        bytes.extend((readings.len() as u32).to_le_bytes());
        readings.iter().for_each(|reading| add(&mut bytes, reading));
    }
    let hash = blake3::hash(&bytes);
    [&hash.as_bytes()[..], &bytes].concat()
}

/// A reading: id of the sensor, position (m), quaternion (x, y, z, w), free path before the press
/// (m), and the number and values of the taxels in the sensor frame's order (Pa).
fn add(bytes: &mut Vec<u8>, reading: &Reading) {
    let (pose, values) = (reading.sent_pose(), reading.values());
    bytes.extend(reading.sensor().0.to_le_bytes());
    let numbers = pose.translation.to_array().into_iter().chain(pose.rotation.to_array());
    numbers.chain([reading.approach()]).for_each(|number| bytes.extend(number.to_le_bytes()));
    bytes.extend((values.len() as u32).to_le_bytes());
    let values = values.into_iter().map(|value| value.unwrap_or(MISSING));
    values.for_each(|value| bytes.extend(value.to_le_bytes()));
}

/// The lists in a file; `None` if it is damaged.
fn lists(bytes: &[u8], sensor: &SensorDescription) -> Option<Vec<Vec<Reading>>> {
    let (hash, mut rest) = bytes.split_first_chunk()?;
    if blake3::hash(rest) != blake3::Hash::from_bytes(*hash) {
        return None;
    }
    let n_lists = u32::from_le_bytes(take(&mut rest)?);
    let list = |rest: &mut &[u8]| {
        let n_readings = u32::from_le_bytes(take(rest)?);
        (0..n_readings).map(|_| reading(rest, sensor)).collect::<Option<Vec<Reading>>>()
    };
    (0..n_lists).map(|_| list(&mut rest)).collect()
}

fn reading(rest: &mut &[u8], sensor: &SensorDescription) -> Option<Reading> {
    let id = SensorId(u128::from_le_bytes(take(rest)?));
    let mut number = || Some(f64::from_le_bytes(take(rest)?));
    let position = [number()?, number()?, number()?];
    let quaternion = [number()?, number()?, number()?, number()?];
    let approach = number()?;
    let n_values = u32::from_le_bytes(take(rest)?);
    let value = |rest: &mut &[u8]| Some(f64::from_le_bytes(take(rest)?));
    let values = (0..n_values).map(|_| value(rest).map(|value| value.is_finite().then_some(value)));
    let values: Vec<Option<f64>> = values.collect::<Option<_>>()?;
    let pose = Pose::stored(position, quaternion).ok()?;
    Some(Reading::new(id, sensor, &values, pose).ok()?.after_approach(approach))
}

/// The next bytes.
fn take<const N: usize>(rest: &mut &[u8]) -> Option<[u8; N]> {
    let (taken, left) = rest.split_first_chunk()?;
    *rest = left;
    Some(*taken)
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::sampler::sample;
    use crate::shapes;

    fn simulator(name: &str) -> PressSimulator {
        let mesh = shapes::example(name).unwrap();
        PressSimulator::new(mesh, SensorDescription::digitacts_6x6())
    }

    fn touches(simulator: &PressSimulator, n: usize) -> Vec<Reading> {
        let config = SamplerConfig::for_simulator(simulator);
        let mut go_on = |_: usize, _: usize| ControlFlow::Continue(());
        sample(simulator, SensorId(7), n, 1, &config, &mut go_on).unwrap()
    }

    fn cause(simulator: &PressSimulator, seed: u64) -> Cause {
        Cause::new(simulator, &SamplerConfig::for_simulator(simulator), &seed)
    }

    #[test]
    fn kept_touches_are_the_same_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        let mug = simulator("mug");
        let (train, test) = (touches(&mug, 12), touches(&mug, 3));
        let kept = Kept::open(&folder.path().join("new")).unwrap();
        kept.write(&cause(&mug, 1), &[&train, &test]).unwrap();
        let found = kept.read(&cause(&mug, 1), mug.sensor()).unwrap().unwrap();
        assert_eq!((found, kept.n_files().unwrap()), (vec![train, test], 1));
    }

    #[test]
    fn touches_of_another_object_or_seed_are_not_found() {
        let folder = tempfile::tempdir().unwrap();
        let (mug, gear) = (simulator("mug"), simulator("gear"));
        let kept = Kept::open(folder.path()).unwrap();
        kept.write(&cause(&mug, 1), &[]).unwrap();
        for other in [cause(&mug, 2), cause(&gear, 1)] {
            assert_eq!(kept.read(&other, mug.sensor()).unwrap(), None);
        }
        assert_eq!(kept.read(&cause(&mug, 1), mug.sensor()).unwrap(), Some(Vec::new()));
    }

    #[test]
    fn a_damaged_file_counts_as_absent() {
        let folder = tempfile::tempdir().unwrap();
        let mug = simulator("mug");
        let kept = Kept::open(folder.path()).unwrap();
        kept.write(&cause(&mug, 1), &[&touches(&mug, 2)]).unwrap();
        let file = kept.file(&cause(&mug, 1));
        let whole = std::fs::read(&file).unwrap();
        let mut changed = whole.clone();
        *changed.last_mut().unwrap() ^= 1;
        for damaged in [&whole[..whole.len() - 1], &whole[..20], &changed] {
            std::fs::write(&file, damaged).unwrap();
            assert_eq!(kept.read(&cause(&mug, 1), mug.sensor()).unwrap(), None);
        }
    }
}
