//! Corpora of the fuzzers: every committed input goes through its target's function.
//! `UPDATE_CORPORA=1` writes the seeds.

#[allow(unreachable_pub, reason = "a library there, a module here")]
#[path = "../../fuzz/src/lib.rs"]
mod fuzzed;

use std::fs;
use std::path::{Path, PathBuf};

use palpate_sim::mesh::{Mesh, MeshFormat};
use palpate_store::engine::{Commit, Engine};
use palpate_store::envelope;
use palpate_store::memory::MemoryEngine;
use palpate_store::model_codec::symmetry_to_block;
use palpate_store::snapshot::{SnapshotHeader, SnapshotWriter};
use serde_json::json;

use fuzzed::TARGETS;

/// A tetrahedron, with every optional part of the format.
const OFF: &str = "OFF # a tetrahedron\n4 4 6\n0 0 0\n9 0 0\n0 9 0\n0 0 9\n\
    3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3 255 0 0\n";
const OBJ: &str = "# a tetrahedron\nmtllib t.mtl\no t\nv 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 9\n\
    vt 0 0\nvn 0 0 1\ns off\nf 1/1/1 3/1/1 2/1/1\nf 1 2 4\nf 2//1 3//1 4//1\nf -2 -4 -1\n";
const PLY: &str = "ply\nformat ascii 1.0\ncomment a tetrahedron\nelement vertex 4\n\
    property float x\nproperty float y\nproperty float z\nproperty uchar red\nelement face 4\n\
    property list uchar int vertex_indices\nend_header\n0 0 0 1\n9 0 0 1\n0 9 0 1\n0 0 9 1\n\
    3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n";
const STL: &str = "solid t\nfacet normal 0 0 -1\nouter loop\nvertex 0 0 0\nvertex 0 9 0\n\
    vertex 9 0 0\nendloop\nendfacet\nendsolid t\n";
/// A small database, one pair a line in hexadecimal.
const DUMP: &str = include_str!("../../migrations/golden/layout2.txt");

fn corpora() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus")
}

fn unhex(text: &str) -> Vec<u8> {
    let digit = |place| u8::from_str_radix(&text[place..place + 2], 16).unwrap();
    (0..text.len()).step_by(2).map(digit).collect()
}

/// The seeds: target, name, bytes.
fn seeds() -> Vec<(&'static str, String, Vec<u8>)> {
    let mut seeds = Vec::new();
    let mut add = |target, name: &str, bytes: Vec<u8>| {
        seeds.push((target, format!("seed-{name}"), bytes));
    };
    let mesh = Mesh::from_bytes(MeshFormat::Off, OFF.as_bytes(), 1e-3).unwrap();
    add("mesh_stl", "ascii", STL.into());
    add("mesh_stl", "binary", mesh.to_stl_bytes());
    add("mesh_text", "off", OFF.into());
    add("mesh_text", "obj", OBJ.into());
    // Written once by other programs.
    let packed = |name: &str| fs::read(corpora().join("mesh_packed").join(name)).unwrap();
    for name in ["glb", "3mf", "3mf-deflated"] {
        add("mesh_packed", name, packed(&format!("seed-{name}")));
    }
    add("mesh_ply", "ascii", PLY.into());
    add("mesh_ply", "binary", binary_ply());
    add("snapshot", "database", snapshot(DUMP));
    add("snapshot", "layout", snapshot(DUMP.lines().next().unwrap()));
    for (number, pair) in DUMP.lines().enumerate() {
        let value = unhex(pair.split_once(' ').unwrap().1);
        add("record", &format!("{number:02}"), as_record(&value));
    }
    let all: Vec<u8> =
        DUMP.lines().flat_map(|pair| as_record(&unhex(pair.split_once(' ').unwrap().1))).collect();
    add("record", "all", all);
    add("record", "envelope", unhex(DUMP.lines().next().unwrap().split_once(' ').unwrap().1));
    for (name, block) in fuzzed_blocks() {
        add("model", name, block);
    }
    for (n, kind) in [(1, ""), (2, "-refused")] {
        let body = body(n);
        add("readings", &format!("json{kind}"), body.to_string().into());
        let mut packed = Vec::new();
        pack(&body, &mut packed);
        add("readings", &format!("msgpack{kind}"), packed);
    }
    seeds
}

fn binary_ply() -> Vec<u8> {
    let mut file = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\n\
        property double y\nproperty double z\nelement face 1\n\
        property list uchar uint vertex_index\nend_header\n"
        .to_vec();
    for value in [0.0f64, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 9.0, 0.0] {
        file.extend(value.to_le_bytes());
    }
    file.push(3);
    [0u32, 1, 2].iter().for_each(|corner| file.extend(corner.to_le_bytes()));
    file
}

fn snapshot(dump: &str) -> Vec<u8> {
    let engine = MemoryEngine::new();
    let commit = dump.lines().fold(Commit::new(), |commit, line| {
        let (key, value) = line.split_once(' ').unwrap();
        commit.put(unhex(key), unhex(value))
    });
    engine.commit(commit).wait().unwrap();
    let header = SnapshotHeader { layout: 2, created_at_ms: 1, made_by: "seed".to_owned() };
    let mut writer = SnapshotWriter::new(engine.cut().unwrap(), &header);
    let mut bytes = Vec::new();
    while let Some(chunk) = writer.next_chunk().unwrap() {
        bytes.extend(chunk);
    }
    bytes
}

/// A sealed value in the input form of the target `record`.
fn as_record(value: &[u8]) -> Vec<u8> {
    let Ok((kind, opened)) = envelope::open_any(value) else { return value.to_vec() };
    let space = fuzzed::SPACES.iter().position(|(_, known, _)| *known as u16 == kind);
    let length = (opened.payload.len() as u16).to_le_bytes();
    let head = [space.unwrap_or(0) as u8, opened.schema as u8, length[0], length[1]];
    [&head[..], opened.payload].concat()
}

/// The smallest block of each kind.
fn fuzzed_blocks() -> Vec<(&'static str, Vec<u8>)> {
    use glam::DVec3;
    use palpate_core::symmetry::{AxisOrder, Symmetry, SymmetryAxis};
    let axis = |direction, order| SymmetryAxis { point: DVec3::ZERO, direction, order };
    let axes = vec![axis(DVec3::Z, AxisOrder::Continuous), axis(DVec3::X, AxisOrder::Finite(2))];
    let block = symmetry_to_block(&Symmetry { center: DVec3::ZERO, axes });
    vec![("symmetry", [&[2][..], &block].concat())]
}

/// The first `n` of two readings; the second one is refused, since no taxel has a value.
fn body(n: usize) -> serde_json::Value {
    let image: Vec<f64> = (0..36).map(|taxel| f64::from(taxel) * 100.5).collect();
    let readings = json!([
        {"robot": "arm", "seq": 1, "sensor": "digitacts-6x6", "stamp": {"sec": 3, "nanosec": 5},
         "pose": {"position": [0.1, -0.2, 0.3], "orientation": [0.0, 0.0, 0.0, 1.0]},
         "image": image, "approach_m": 0.1,
         "object_moved": {"position_m": 0.001, "angle_rad": 0.1}},
        {"sensor": "digitacts-6x6", "image": vec![None::<f64>; 36], "feature": [1.0, 2.0]},
    ]);
    json!({"readings": readings.as_array().unwrap()[..n]})
}

/// MessagePack of a JSON value, numbers as 64 bits, maps and lists of up to 65535.
fn pack(value: &serde_json::Value, bytes: &mut Vec<u8>) {
    use serde_json::Value;
    let sized = |marker: u8, n: usize| [&[marker][..], &(n as u16).to_be_bytes()].concat();
    match value {
        Value::Null => bytes.push(0xc0),
        Value::Bool(value) => bytes.push(0xc2 + u8::from(*value)),
        Value::Number(number) => match number.as_u64() {
            Some(integer) => {
                bytes.push(0xcf);
                bytes.extend(integer.to_be_bytes());
            }
            None => {
                bytes.push(0xcb);
                bytes.extend(number.as_f64().unwrap().to_be_bytes());
            }
        },
        Value::String(text) => {
            bytes.extend(sized(0xda, text.len()));
            bytes.extend(text.as_bytes());
        }
        Value::Array(items) => {
            bytes.extend(sized(0xdc, items.len()));
            items.iter().for_each(|item| pack(item, bytes));
        }
        Value::Object(fields) => {
            bytes.extend(sized(0xde, fields.len()));
            for (name, field) in fields {
                pack(&Value::String(name.clone()), bytes);
                pack(field, bytes);
            }
        }
    }
}

#[test]
fn every_committed_input_passes_its_target() {
    if std::env::var_os("UPDATE_CORPORA").is_some() {
        for (target, name, bytes) in seeds() {
            fs::create_dir_all(corpora().join(target)).unwrap();
            fs::write(corpora().join(target).join(name), bytes).unwrap();
        }
    }
    let mut bytes_in_all = 0;
    for (target, run) in TARGETS {
        let mut paths: Vec<PathBuf> = fs::read_dir(corpora().join(target))
            .unwrap_or_else(|_| panic!("{target} has no corpus"))
            .map(|entry| entry.unwrap().path())
            .collect();
        paths.sort();
        assert!(!paths.is_empty(), "{target} has an empty corpus");
        for path in paths {
            let bytes = fs::read(&path).unwrap();
            bytes_in_all += bytes.len();
            let outcome = std::panic::catch_unwind(|| run(&bytes));
            assert!(outcome.is_ok(), "{} fails its target", path.display());
        }
    }
    assert!(bytes_in_all < 200_000, "the corpora have {bytes_in_all} bytes");
}

#[test]
fn targets_accept_their_seeds() {
    let seeds = seeds();
    let seed = |target: &str, name: &str| {
        let found = seeds.iter().find(|seed| seed.0 == target && seed.1 == format!("seed-{name}"));
        found.unwrap().2.clone()
    };
    for (format, target, name) in [
        (MeshFormat::Stl, "mesh_stl", "ascii"),
        (MeshFormat::Stl, "mesh_stl", "binary"),
        (MeshFormat::Ply, "mesh_ply", "ascii"),
        (MeshFormat::Ply, "mesh_ply", "binary"),
        (MeshFormat::Off, "mesh_text", "off"),
        (MeshFormat::Obj, "mesh_text", "obj"),
        (MeshFormat::Glb, "mesh_packed", "glb"),
        (MeshFormat::ThreeMf, "mesh_packed", "3mf"),
        (MeshFormat::ThreeMf, "mesh_packed", "3mf-deflated"),
    ] {
        let mesh = Mesh::from_bytes(format, &seed(target, name), 1e-3);
        assert!(mesh.is_ok(), "{target} {name}: {mesh:?}");
    }
    let (manifest, report) =
        palpate_store::snapshot::verify(&seed("snapshot", "database")[..]).unwrap();
    assert_eq!((manifest.pairs.values().sum::<u64>(), report.n_damaged), (36, 0));
    let intake = palpate_server::intake::Intake::new();
    for (form, name) in [
        (palpate_server::intake::Form::Json, "json"),
        (palpate_server::intake::Form::MessagePack, "msgpack"),
    ] {
        assert_eq!(intake.read(form, &seed("readings", name)), Ok(1));
        let refused = intake.read(form, &seed("readings", &format!("{name}-refused")));
        assert_eq!(refused.unwrap_err().status, 422);
    }
}
