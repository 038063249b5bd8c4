//! A corpus of small files, one for each trap, in every format where the trap can exist: each file
//! must give the body that the plain file gives.
//!
//! The body is a prism on an L, 40 × 40 × 20 in the file's unit, or two of them.

mod containers;
mod writing;

use glam::{DAffine3, DVec3};

use super::{Mesh, MeshError, MeshFile, MeshFormat, MeshRemark};
use writing::*;

fn read(format: MeshFormat, bytes: &[u8]) -> Result<MeshFile, MeshError> {
    Mesh::read(format, bytes, Some(1e-3).filter(|_| !format.knows_its_unit()))
}

/// The file gives `n` prisms, closed, of the right size and volume, and `remarks` about them.
#[track_caller]
fn check(format: MeshFormat, bytes: &[u8], n: usize, remarks: usize) {
    let file = read(format, bytes).unwrap_or_else(|error| panic!("{format}: {error}"));
    // 40 × 10 and 10 × 30, 20 high.
    let volume = 14_000.0 * file.unit.powi(3) * n as f64;
    let found = file.mesh.signed_volume();
    assert!((found / volume - 1.0).abs() < 1e-6, "{format}: volume {found}, expected {volume}");
    assert!(file.mesh.is_watertight(), "{format}");
    assert_eq!(file.mesh.triangles().len(), 20 * n, "{format}");
    assert_eq!(file.mesh.vertices().len(), 12 * n, "{format}");
    let size = file.mesh.extent() / file.unit;
    let expected = DVec3::new(40.0 + 60.0 * (n - 1) as f64, 40.0, 20.0);
    assert!(size.distance(expected) < 1e-3, "{format}: {size}");
    // A GLB in metres is 40 m large, and says so.
    let expected = remarks + usize::from(file.mesh.largest_dimension() > 2.0);
    assert_eq!(file.remarks.len(), expected, "{format}: {:?}", file.remarks);
}

#[test]
fn concave_polygons_keep_their_shape_in_every_format() {
    for (format, write, ..) in WRITINGS {
        (0..6).for_each(|first| check(format, &write(&[prism(first)]), 1, 0));
    }
}

#[test]
fn all_solids_of_a_file_are_read_in_every_format() {
    let two = [prism(0), prism(3).moved(DVec3::X * 60.0)];
    for (format, write, ..) in WRITINGS {
        check(format, &write(&two), 2, 0);
    }
}

#[test]
fn what_is_left_behind_the_end_is_refused_in_every_format() {
    for (format, write, is_text, _) in WRITINGS {
        let good = write(&[prism(0)]);
        let junk: &[u8] = if is_text { b"1 2 3 4\n" } else { &[7; 100] };
        // An OBJ has no end, and skips lines of unknown words; an archive's end is found backwards.
        if matches!(format, MeshFormat::Obj | MeshFormat::ThreeMf) {
            continue;
        }
        let left = read(format, &[&good[..], junk].concat());
        assert!(
            matches!(left, Err(MeshError::Left { .. } | MeshError::Syntax { .. })),
            "{format}: {left:?}"
        );
        check(format, &[&good[..], &[b'\n'; 200]].concat(), 1, 0);
    }
}

#[test]
fn every_encoding_and_line_end_is_read_in_every_text_format() {
    for (format, write, ..) in WRITINGS.into_iter().filter(|(.., is_text, _)| *is_text) {
        let text = String::from_utf8(write(&[prism(0)])).unwrap();
        let wide = |read: fn(u16) -> [u8; 2]| -> Vec<u8> {
            format!("\u{feff}{text}").encode_utf16().flat_map(read).collect()
        };
        let writings: [Vec<u8>; 9] = [
            text.replace('\n', "\r\n").into(),
            text.replace('\n', "\r").into(),
            format!("\u{feff}{text}").into(),
            wide(u16::to_le_bytes),
            wide(u16::to_be_bytes),
            text.replace('\n', " # Geh\u{e4}use\n").into(),
            text.replace('\n', "\t \n\n").into(),
            text.chars()
                .map(|letter| if letter == 'a' { 'A' } else { letter })
                .collect::<String>()
                .into(),
            text.to_uppercase().into(),
        ];
        writings.iter().for_each(|writing| check(format, writing, 1, 0));
        // Latin-1 in a comment and in a name.
        let mut latin = text.replace("part", "Geh@use").into_bytes();
        latin.iter_mut().filter(|byte| **byte == b'@').for_each(|byte| *byte = 0xe4);
        check(format, &[&latin[..], b"# \xe4\n"].concat(), 1, 0);
    }
}

#[test]
fn the_word_off_takes_every_form() {
    let text = String::from_utf8(off(&[prism(0)])).unwrap();
    for word in ["", "off", "CNOFF", "STOFF", "STCNOFF", "NOFF", "COFF"] {
        check(MeshFormat::Off, text.replace("OFF", word).as_bytes(), 1, 0);
    }
    check(MeshFormat::Off, text.replace("OFF\n", "OFF ").as_bytes(), 1, 0);
    // A fourth coordinate divides the others.
    let solid = prism(0);
    let mut lines: Vec<String> = text.replace("OFF", "4OFF").lines().map(str::to_owned).collect();
    for (line, at) in lines[2..].iter_mut().zip(&solid.vertices) {
        *line = format!("{} {} {} 2", 2.0 * at.x, 2.0 * at.y, 2.0 * at.z);
    }
    check(MeshFormat::Off, lines.join("\n").as_bytes(), 1, 0);
    for word in ["nOFF", "OFF BINARY"] {
        assert!(read(MeshFormat::Off, text.replace("OFF", word).as_bytes()).is_err());
    }
}

#[test]
fn an_obj_goes_on_behind_a_backslash() {
    let text = String::from_utf8(obj(&[prism(0)])).unwrap();
    check(MeshFormat::Obj, text.replace(" 0\n", " \\\n0\n").as_bytes(), 1, 0);
    check(MeshFormat::Obj, text.replace(" 1\n", "\\\r\n  1\r\n").as_bytes(), 1, 0);
}

#[test]
fn unused_vertices_are_no_part_of_the_body_in_any_format() {
    let mut solid = prism(0);
    solid.vertices.push(DVec3::X * 5000.0);
    // STL has no vertices but those of triangles.
    for (format, write, ..) in WRITINGS.into_iter().filter(|it| it.0 != MeshFormat::Stl) {
        check(format, &write(&[solid.clone()]), 1, 0);
    }
    solid.vertices.push(DVec3::splat(f64::NAN));
    for (format, write) in [(MeshFormat::Obj, obj as Writer), (MeshFormat::Off, off)] {
        check(format, &write(&[solid.clone()]), 1, 0);
    }
}

#[test]
fn faces_that_come_twice_count_once_in_every_format() {
    let mut solid = prism(0);
    solid.faces.extend(solid.faces.clone());
    // The same corners, begun elsewhere.
    solid.faces[9].rotate_left(2);
    for (format, write, ..) in WRITINGS {
        check(format, &write(&[solid.clone()]), 1, 1);
    }
}

#[test]
fn far_coordinates_are_exact_or_said_in_every_format() {
    let far = prism(0).moved(DVec3::new(1e9 + 0.125, 0.0, 0.0));
    for (format, write, is_text, _) in WRITINGS {
        let bytes = write(std::slice::from_ref(&far));
        let single = format == MeshFormat::Glb || (format, is_text) == (MeshFormat::Stl, false);
        if single {
            let file = read(format, &bytes).unwrap();
            let far = |remark: &MeshRemark| matches!(remark, MeshRemark::Far { .. });
            assert!(file.remarks.iter().any(far), "{format}: {:?}", file.remarks);
        } else {
            check(format, &bytes, 1, 0);
        }
    }
    // Rounding of 0.06 mm spoils 40 mm by more than a thousandth; that of 0.006 mm does not.
    for (distance, expected) in [(1e6, 1), (1e5, 0)] {
        let bytes = stl_binary(&[prism(0).moved(DVec3::X * distance)]);
        let file = read(MeshFormat::Stl, &bytes).unwrap();
        assert_eq!(file.remarks.len(), expected, "{:?}", file.remarks);
    }
}

#[test]
fn turned_faces_are_counted_in_every_format() {
    let mut solid = prism(0);
    solid.faces[7].reverse();
    for (format, write, ..) in WRITINGS {
        let file = read(format, &write(&[solid.clone()])).unwrap();
        let turned = MeshRemark::Turned { n: 2, of: 20 };
        assert!(file.remarks.contains(&turned), "{format}: {:?}", file.remarks);
    }
}

#[test]
fn a_ply_is_text_however_its_header_is_spaced() {
    let far = prism(0).moved(DVec3::X * 1_000_000.01);
    let text = String::from_utf8(ply_text(&[far])).unwrap();
    for format in ["format  ascii", "format\tascii", " FORMAT ASCII"] {
        let spaced = text.replace("format ascii", format);
        check(MeshFormat::Ply, spaced.as_bytes(), 1, 0);
        let low = read(MeshFormat::Ply, spaced.as_bytes()).unwrap().mesh.bounds().0;
        assert!((low.x - 1000.00001).abs() < 1e-9, "{low}");
    }
}

#[test]
fn a_unit_is_needed_where_a_file_records_none() {
    for (format, write, ..) in WRITINGS {
        let read = Mesh::read(format, &write(&[prism(0)]), None);
        let is_missing = matches!(read, Err(MeshError::UnitMissing { .. }));
        assert_eq!(is_missing, !format.knows_its_unit(), "{format}");
    }
}

/// The trap of reading a transform by columns: a turn by 90° about z must turn to the right side.
#[test]
fn transforms_of_both_formats_turn_the_same_way() {
    let turn = DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2);
    let [a, b, c] = [turn.matrix3.x_axis, turn.matrix3.y_axis, turn.matrix3.z_axis];
    let row = |v: DVec3| format!("{} {} {}", v.x.round(), v.y.round(), v.z.round());
    let object = format!(r#"<object id="1">{}</object>"#, mesh_xml(&prism(0).moved(DVec3::X)));
    let item =
        format!(r#"<item objectid="1" transform="{} {} {} 0 0 0"/>"#, row(a), row(b), row(c));
    let node = r#""nodes":[{"mesh":0,"rotation":[0,0,0.70710678,0.70710678]}],
        "scenes":[{"nodes":[0]}],"#;
    for (format, bytes) in [
        (MeshFormat::ThreeMf, model("", &object, &item)),
        (MeshFormat::Glb, glb_with(&[prism(0).moved(DVec3::X)], node)),
    ] {
        let file = read(format, &bytes).unwrap();
        let (low, high) = file.mesh.bounds();
        let (low, high) = (low / file.unit, high / file.unit);
        let (right_low, right_high) = (DVec3::new(-40.0, 1.0, 0.0), DVec3::new(0.0, 41.0, 20.0));
        assert!(low.distance(right_low) < 1e-4 && high.distance(right_high) < 1e-4, "{low} {high}");
    }
}
