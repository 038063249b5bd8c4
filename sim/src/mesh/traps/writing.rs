//! Writes a prism in every format, for the corpus of traps.

use std::io::{Cursor, Write as _};

use glam::DVec3;

use crate::mesh::MeshFormat;

/// Vertices and polygons, as a file writes them.
#[derive(Clone)]
pub(super) struct Solid {
    pub(super) vertices: Vec<DVec3>,
    pub(super) faces: Vec<Vec<usize>>,
}

/// The prism, its caps as polygons of six corners that begin at the inner corner plus `first`.
pub(super) fn prism(first: usize) -> Solid {
    let outline = [(40, 0), (40, 10), (10, 10), (10, 40), (0, 40), (0, 0)];
    let level = |z: f64| outline.map(|(x, y)| DVec3::new(f64::from(x), f64::from(y), z));
    let turned = |from: usize| (0..6).map(move |step| (from + step) % 6);
    let top: Vec<usize> = turned(first).map(|at| 6 + at).collect();
    let bottom: Vec<usize> = turned(first).map(|at| 5 - at).collect();
    let sides = (0..6).map(|at| vec![at, (at + 1) % 6, 6 + (at + 1) % 6, 6 + at]);
    let faces = [top, bottom].into_iter().chain(sides).collect();
    Solid { vertices: [level(0.0), level(20.0)].concat(), faces }
}

impl Solid {
    pub(super) fn moved(&self, by: DVec3) -> Self {
        Self { vertices: self.vertices.iter().map(|at| *at + by).collect(), ..self.clone() }
    }

    /// The faces as triangles of an ear cut by hand: the caps at the inner corner.
    fn triangles(&self) -> Vec<[usize; 3]> {
        let by_hand = [[2, 3, 4], [2, 4, 5], [2, 5, 0], [2, 0, 1]];
        let caps = |face: &[usize]| {
            let level = 6 * (face[0] / 6);
            let turn = |[a, b, c]: [usize; 3]| if level == 0 { [a, c, b] } else { [a, b, c] };
            by_hand.map(|triangle| turn(triangle).map(|at| level + at)).to_vec()
        };
        self.faces
            .iter()
            .flat_map(|face| match face[..] {
                [a, b, c] => vec![[a, b, c]],
                [a, b, c, d] => vec![[a, b, c], [a, c, d]],
                _ => caps(face),
            })
            .collect()
    }
}

pub(super) fn stl_text(solids: &[Solid]) -> Vec<u8> {
    let mut text = String::new();
    for solid in solids {
        text += "solid part\n";
        for triangle in solid.triangles() {
            text += "facet normal 0 0 0\nouter loop\n";
            for DVec3 { x, y, z } in triangle.map(|at| solid.vertices[at]) {
                text += &format!("vertex {x} {y} {z}\n");
            }
            text += "endloop\nendfacet\n";
        }
        text += "endsolid part\n";
    }
    text.into()
}

pub(super) fn stl_binary(solids: &[Solid]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for solid in solids {
        bytes.extend([b' '; 80]);
        bytes.extend((solid.triangles().len() as u32).to_le_bytes());
        for triangle in solid.triangles() {
            let corners = triangle.map(|at| solid.vertices[at].as_vec3());
            bytes.extend([f32::NAN; 3].map(f32::to_le_bytes).concat());
            bytes.extend(corners.iter().flat_map(|at| at.to_array()).flat_map(f32::to_le_bytes));
            bytes.extend([0, 0]);
        }
    }
    bytes
}

pub(super) fn obj(solids: &[Solid]) -> Vec<u8> {
    let (mut text, mut first) = (String::new(), 1);
    for (number, solid) in solids.iter().enumerate() {
        text += &format!("o part{number}\n");
        for DVec3 { x, y, z } in &solid.vertices {
            text += &format!("v {x} {y} {z}\n");
        }
        for face in &solid.faces {
            text += "f";
            face.iter().for_each(|at| text += &format!(" {}", first + at));
            text += "\n";
        }
        first += solid.vertices.len();
    }
    text.into()
}

pub(super) fn off(solids: &[Solid]) -> Vec<u8> {
    let mut text = String::new();
    for solid in solids {
        text += &format!("OFF\n{} {} 0\n", solid.vertices.len(), solid.faces.len());
        for DVec3 { x, y, z } in &solid.vertices {
            text += &format!("{x} {y} {z}\n");
        }
        for face in &solid.faces {
            text += &format!("{}", face.len());
            face.iter().for_each(|at| text += &format!(" {at}"));
            text += "\n";
        }
    }
    text.into()
}

pub(super) fn ply_head(solid: &Solid, kind: &str, number: &str) -> String {
    let (n_vertices, n_faces) = (solid.vertices.len(), solid.faces.len());
    format!(
        "ply\nformat {kind} 1.0\ncomment C:\\parts\\\nelement vertex {n_vertices}\n\
         property {number} x\nproperty {number} y\nproperty {number} z\nelement face {n_faces}\n\
         property list uchar int vertex_indices\nend_header\n"
    )
}

pub(super) fn ply_text(solids: &[Solid]) -> Vec<u8> {
    let mut text = String::new();
    for solid in solids {
        text += &ply_head(solid, "ascii", "float");
        for DVec3 { x, y, z } in &solid.vertices {
            text += &format!("{x} {y} {z}\n");
        }
        for face in &solid.faces {
            text += &format!("{}", face.len());
            face.iter().for_each(|at| text += &format!(" {at}"));
            text += "\n";
        }
    }
    text.into()
}

pub(super) fn ply_binary(solids: &[Solid]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for solid in solids {
        bytes.extend(ply_head(solid, "binary_big_endian", "double").into_bytes());
        bytes.extend(solid.vertices.iter().flat_map(|at| at.to_array()).flat_map(f64::to_be_bytes));
        for face in &solid.faces {
            bytes.push(face.len() as u8);
            bytes.extend(face.iter().flat_map(|at| (*at as i32).to_be_bytes()));
        }
    }
    bytes
}

/// A GLB of a node for each solid, with `extra` members of the document before the others.
pub(super) fn glb_with(solids: &[Solid], extra: &str) -> Vec<u8> {
    let (mut bin, mut views, mut accessors, mut meshes) =
        (Vec::<u8>::new(), Vec::new(), Vec::new(), Vec::new());
    for (number, solid) in solids.iter().enumerate() {
        let first = bin.len();
        let numbers = solid.vertices.iter().flat_map(|at| at.as_vec3().to_array());
        bin.extend(numbers.flat_map(f32::to_le_bytes));
        let middle = bin.len();
        let corners = solid.triangles();
        bin.extend(corners.iter().flatten().flat_map(|at| (*at as u16).to_le_bytes()));
        for (from, to) in [(first, middle), (middle, bin.len())] {
            let length = to - from;
            views.push(format!(r#"{{"buffer":0,"byteOffset":{from},"byteLength":{length}}}"#));
        }
        let (n_vertices, n_corners) = (solid.vertices.len(), 3 * corners.len());
        let (places, indices) = (2 * number, 2 * number + 1);
        accessors.push(format!(
            r#"{{"bufferView":{places},"componentType":5126,"count":{n_vertices},"type":"VEC3"}},
            {{"bufferView":{indices},"componentType":5123,"count":{n_corners},"type":"SCALAR"}}"#
        ));
        meshes.push(format!(
            r#"{{"primitives":[{{"attributes":{{"POSITION":{places}}},"indices":{indices}}}]}}"#
        ));
        bin.resize(bin.len().next_multiple_of(4), 0);
    }
    let nodes: Vec<String> =
        (0..solids.len()).map(|number| format!(r#"{{"mesh":{number}}}"#)).collect();
    let roots: Vec<String> = (0..solids.len()).map(|number| number.to_string()).collect();
    let nodes = if extra.contains("\"nodes\"") {
        String::new()
    } else {
        let (nodes, roots) = (nodes.join(","), roots.join(","));
        format!(r#""nodes":[{nodes}],"scenes":[{{"nodes":[{roots}]}}],"#)
    };
    let mut json = format!(
        r#"{{{extra}{nodes}"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{}}}],
        "bufferViews":[{}],"accessors":[{}],"meshes":[{}]}}"#,
        bin.len(),
        views.join(","),
        accessors.join(","),
        meshes.join(",")
    )
    .into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF".to_vec();
    let length = 12 + 8 + json.len() + 8 + bin.len();
    for (number, chunk) in
        [(2, Vec::new()), (length, Vec::new()), (json.len(), [b"JSON", &json[..]].concat())]
    {
        bytes.extend((number as u32).to_le_bytes());
        bytes.extend(chunk);
    }
    bytes.extend((bin.len() as u32).to_le_bytes());
    bytes.extend([b"BIN\0", &bin[..]].concat());
    bytes
}

pub(super) fn glb(solids: &[Solid]) -> Vec<u8> {
    glb_with(solids, "")
}

pub(super) fn zipped(parts: &[(&str, &str)]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, text) in parts {
        let options = zip::write::SimpleFileOptions::default();
        writer.start_file(*name, options).unwrap();
        writer.write_all(text.as_bytes()).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

pub(super) fn mesh_xml(solid: &Solid) -> String {
    let vertices: String = solid
        .vertices
        .iter()
        .map(|DVec3 { x, y, z }| format!(r#"<vertex x="{x}" y="{y}" z="{z}"/>"#))
        .collect();
    let triangles: String = solid
        .triangles()
        .iter()
        .map(|[a, b, c]| format!(r#"<triangle v1="{a}" v2="{b}" v3="{c}"/>"#))
        .collect();
    format!("<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>")
}

/// A model of one unit with objects and build items.
pub(super) fn model(attributes: &str, objects: &str, items: &str) -> Vec<u8> {
    let text = format!(
        "\u{feff}<?xml version=\"1.0\" encoding=\"UTF-8\"?><model {attributes} xmlns=\"http://\
         schemas.microsoft.com/3dmanufacturing/core/2015/02\"><resources>{objects}</resources>\
         <build>{items}</build></model>"
    );
    zipped(&[("[Content_Types].xml", "<Types/>"), ("3D/3dmodel.model", &text)])
}

pub(super) fn three_mf(solids: &[Solid]) -> Vec<u8> {
    let (mut objects, mut items) = (String::new(), String::new());
    for (id, solid) in solids.iter().enumerate() {
        objects += &format!(r#"<object id="{id}" type="model">{}</object>"#, mesh_xml(solid));
        items += &format!(r#"<item objectid="{id}"/>"#);
    }
    model("unit=\"millimeter\"", &objects, &items)
}

pub(super) type Writer = fn(&[Solid]) -> Vec<u8>;

/// Every writing of a mesh: its format, and whether it is text and knows polygons.
pub(super) const WRITINGS: [(MeshFormat, Writer, bool, bool); 8] = [
    (MeshFormat::Stl, stl_text, true, false),
    (MeshFormat::Stl, stl_binary, false, false),
    (MeshFormat::Obj, obj, true, true),
    (MeshFormat::Off, off, true, true),
    (MeshFormat::Ply, ply_text, true, true),
    (MeshFormat::Ply, ply_binary, false, true),
    (MeshFormat::Glb, glb, false, false),
    (MeshFormat::ThreeMf, three_mf, false, false),
];
