//! Fuzz targets: one function for each parser of hostile bytes, called by `cargo fuzz` and
//! the tests.
//!
//! A target takes any bytes and panics when the parser panics or breaks a promise: accepted
//! input must be complete and read back as it was written. Not here: the inputs. Corpora are
//! in `corpus/`, with the crashes that were found.

use std::sync::OnceLock;

use palpate_server::intake::{Form, Intake};
use palpate_sim::mesh::{Mesh, MeshFormat};
use palpate_store::engine::{Commit, Engine};
use palpate_store::envelope::{self, Kind};
use palpate_store::fsck::check;
use palpate_store::memory::MemoryEngine;
use palpate_store::model_codec;
use palpate_store::snapshot::{self, SnapshotHeader, SnapshotWriter};

/// A target: the name of its corpus, and its function.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: [Target; 8] = [
    ("mesh_stl", mesh_stl),
    ("mesh_ply", mesh_ply),
    ("mesh_text", mesh_text),
    ("mesh_packed", mesh_packed),
    ("snapshot", snapshot),
    ("record", record),
    ("model", model),
    ("readings", readings),
];

/// Parses an STL file, binary or ASCII.
pub fn mesh_stl(bytes: &[u8]) {
    mesh(MeshFormat::Stl, bytes);
}

/// Parses a PLY file, binary or ASCII.
pub fn mesh_ply(bytes: &[u8]) {
    mesh(MeshFormat::Ply, bytes);
}

/// Parses an OFF file if it begins like one, otherwise an OBJ file.
pub fn mesh_text(bytes: &[u8]) {
    let format = match MeshFormat::from_content(bytes) {
        Some(MeshFormat::Off) => MeshFormat::Off,
        _ => MeshFormat::Obj,
    };
    mesh(format, bytes);
}

/// Parses a 3MF file if it begins like an archive, otherwise a GLB file.
pub fn mesh_packed(bytes: &[u8]) {
    let is_archive = bytes.starts_with(b"PK");
    mesh(if is_archive { MeshFormat::ThreeMf } else { MeshFormat::Glb }, bytes);
}

/// Parses a mesh; an accepted mesh can be touched, and reads back unchanged after it is written.
fn mesh(format: MeshFormat, bytes: &[u8]) {
    let Ok(mesh) = Mesh::from_bytes(format, bytes, 1e-3) else { return };
    assert!(!mesh.triangles().is_empty(), "a mesh without triangles was accepted");
    assert!(mesh.vertices().iter().all(|vertex| vertex.is_finite()));
    let n = mesh.vertices().len();
    assert!(mesh.triangles().iter().flatten().all(|corner| (*corner as usize) < n));
    let again = Mesh::from_bytes(MeshFormat::Off, &mesh.to_off_bytes(), 1.0);
    assert!(again.is_ok(), "a mesh that was accepted is refused when it is written: {again:?}");
}

/// Restores a snapshot; every snapshot that verifies restores completely.
pub fn snapshot(bytes: &[u8]) {
    let verified = snapshot::verify(bytes);
    let engine = MemoryEngine::new();
    let restored = snapshot::restore(bytes, &engine, snapshot::KeysFrom::Snapshot);
    match (verified, restored) {
        (Ok((manifest, report)), Ok(restored)) => {
            assert_eq!(manifest, restored);
            let checked = check(&engine).expect("a memory engine does not fail");
            assert_eq!(checked, report, "the restored store is another one than the snapshot");
        }
        // A snapshot without a layout is valid, but is not a database.
        (_, Err(_)) => {}
        (Err(error), Ok(_)) => panic!("restored though it does not verify: {error}"),
    }
}

/// Kinds of records by the letters of their key spaces.
pub const SPACES: [(u8, Kind, usize); 20] = [
    (b'!', Kind::Layout, 1),
    (b's', Kind::Sensor, 17),
    (b'o', Kind::Object, 17),
    (b'n', Kind::Name, 20),
    (b'm', Kind::Mesh, 17),
    (b'f', Kind::MeshFile, 33),
    (b'T', Kind::JournalHead, 17),
    (b't', Kind::JournalEntry, 25),
    (b'u', Kind::JournalRobot, 30),
    (b'j', Kind::Job, 17),
    (b'e', Kind::Session, 17),
    (b'r', Kind::JournalEntry, 25),
    (b'w', Kind::JournalRobot, 30),
    (b'x', Kind::JournalRetraction, 25),
    (b'c', Kind::Catalogue, 17),
    (b'v', Kind::Version, 25),
    (b'k', Kind::Calibration, 25),
    (b'b', Kind::Block, 33),
    (b'a', Kind::AccessKey, 17),
    (b'l', Kind::Audit, 9),
];

/// Reads stored records: bytes as an envelope, and as payloads of valid envelopes.
///
/// The input repeats `(space u8, schema u8, length u16 little-endian, payload)`. All records
/// together form a store, which is checked and sent through a snapshot.
pub fn record(bytes: &[u8]) {
    let _ = envelope::open_any(bytes);
    let engine = MemoryEngine::new();
    let mut commit = Commit::new();
    let mut rest = bytes;
    for number in 0..64u8 {
        let Some((&[space, schema, low, high], behind)) = rest.split_first_chunk() else { break };
        let length = usize::from(u16::from_le_bytes([low, high])).min(behind.len()).min(4000);
        let (payload, behind) = behind.split_at(length);
        rest = behind;
        let (letter, kind, key_bytes) = SPACES[usize::from(space) % SPACES.len()];
        let mut key = vec![number; key_bytes];
        key[0] = letter;
        commit = commit.put(key, envelope::seal(kind, u16::from(schema), payload));
    }
    engine.commit(commit).wait().expect("a memory engine takes what is within its bounds");
    let report = check(&engine).expect("a memory engine does not fail");
    let header = SnapshotHeader { layout: 1, created_at_ms: 0, made_by: "fuzz".to_owned() };
    let cut = engine.cut().expect("a memory engine does not fail");
    let mut writer = SnapshotWriter::new(cut, &header);
    let mut written = Vec::new();
    while let Some(chunk) = writer.next_chunk().expect("a memory engine does not fail") {
        written.extend(chunk);
    }
    let (_, found) = snapshot::verify(&written[..]).expect("what was written verifies");
    assert_eq!(found, report);
}

/// Decodes a block of a trained version, as a hostile snapshot could contain it. The first
/// byte selects the block; the rest are its bytes.
pub fn model(bytes: &[u8]) {
    let Some((which, block)) = bytes.split_first() else { return };
    match which % 3 {
        0 => drop(model_codec::vocabulary_from_block(block)),
        1 => drop(model_codec::map_from_block(block)),
        _ => drop(model_codec::symmetry_from_block(block)),
    }
}

/// Parses readings as robots send them, in JSON and in MessagePack.
pub fn readings(bytes: &[u8]) {
    static INTAKE: OnceLock<Intake> = OnceLock::new();
    let intake = INTAKE.get_or_init(Intake::new);
    let form = if bytes.first() == Some(&b'{') { Form::Json } else { Form::MessagePack };
    match intake.read(form, bytes) {
        Ok(n) => assert!((1..=1000).contains(&n), "{n} readings were taken"),
        Err(refused) => assert!((400..500).contains(&refused.status), "{refused:?}"),
    }
}
