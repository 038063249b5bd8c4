//! GLB (glTF 2.0, binary) through `gltf`: the triangles of the default scene, each at its node's
//! place, in metres.
//!
//! Buffers must be inside the file, and the description must be valid where it says a shape.
//! Extensions that a file requires are refused by name, except those on looks. Skins and animations
//! are not read: a body has the shape of its rest.

use std::borrow::Cow;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use gltf::accessor::{DataType, Dimensions};
use gltf::binary::Glb;
use gltf::json::validation::{self, Validate as _};
use gltf::json::{Path, Root};
use gltf::mesh::Mode;
use gltf::scene::Transform;
use gltf::{Document, Node, Primitive, buffer};

use super::polygons::Polygons;
use super::{MeshError, MeshFormat};

const FORMAT: MeshFormat = MeshFormat::Glb;
const HEADER_BYTES: usize = 12;
/// Largest description of nodes and meshes. Small items of it become a hundred times as large.
const JSON_BYTES_MAX: usize = 2_000_000;
/// Words in the names of extensions that do not change a shape, behind the prefix of any vendor.
const LOOKS: [&str; 3] = ["_materials_", "_texture_", "_lights_"];
/// The members of a description that say a shape.
const SHAPES: [&str; 6] = ["scene", "nodes", "meshes", "accessors", "bufferViews", "buffers"];
/// Members of these that do not.
const NO_SHAPES: [&str; 4] = [".material", ".camera", ".skin", ".extensions"];

/// Reads one file; returns what follows.
pub(super) fn read<'a>(bytes: &'a [u8], polygons: &mut Polygons) -> Result<&'a [u8], MeshError> {
    let length = bytes.get(8..HEADER_BYTES).and_then(|length| length.try_into().ok());
    let length = length.map_or(HEADER_BYTES, |length| u32::from_le_bytes(length) as usize);
    if bytes.len() < length.max(HEADER_BYTES) {
        return Err(MeshError::Truncated { format: FORMAT, found: bytes.len(), expected: length });
    }
    let unreadable = MeshError::Unreadable { format: FORMAT };
    let (file, rest) = bytes.split_at(length);
    let glb = Glb::from_slice(file).map_err(|_| unreadable.clone())?;
    if glb.json.len() > JSON_BYTES_MAX {
        return Err(part("JSON", "at most 2 MB: join the parts before export"));
    }
    let root: Root = gltf::json::deserialize::from_slice(&glb.json)
        .map_err(|_| part("JSON", "a glTF 2.0 document"))?;
    let shapes = |name: &&String| !LOOKS.iter().any(|looks| name.contains(looks));
    if let Some(name) = root.extensions_required.iter().find(shapes) {
        return Err(MeshError::unsupported(FORMAT, name));
    }
    validate(&root)?;
    let document = Document::from_json_without_validation(root);
    let mut reader = Reader { bin: glb.bin.unwrap_or(Cow::Borrowed(&[])), polygons };
    let mut is_seen = vec![false; document.nodes().len()];
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let scene = scene.ok_or(part("scenes", "at least one scene"))?;
    let mut waiting: Vec<(Node<'_>, DAffine3)> =
        scene.nodes().map(|node| (node, DAffine3::IDENTITY)).collect();
    while let Some((node, scene_from_parent)) = waiting.pop() {
        if std::mem::replace(&mut is_seen[node.index()], true) {
            return Err(part(&format!("nodes/{}", node.index()), "one parent"));
        }
        let scene_from_node = scene_from_parent * transform(&node);
        if let Some(mesh) = node.mesh() {
            for primitive in mesh.primitives() {
                reader.primitive(&primitive, scene_from_node)?;
            }
        }
        waiting.extend(node.children().map(|child| (child, scene_from_node)));
    }
    Ok(rest)
}

/// Refuses indices of what is not there, and values outside the format, where they say a shape.
fn validate(root: &Root) -> Result<(), MeshError> {
    let mut fault = None;
    let report = &mut |path: &dyn Fn() -> Path, error: validation::Error| {
        let expected = match error {
            _ if fault.is_some() => return,
            validation::Error::IndexOutOfBounds => "the index of one that exists",
            validation::Error::Invalid => "a value of glTF 2.0",
            // Buffers and extents that are missing are met, or not needed, by the reader.
            _ => return,
        };
        let path = path();
        let is_shape = SHAPES.iter().any(|member| path.as_str().starts_with(member))
            && !NO_SHAPES.iter().any(|member| path.as_str().contains(member));
        // Attributes of any name are allowed, and extents of positions not read.
        let is_unread = error == validation::Error::Invalid && path.as_str().contains("attributes");
        if is_shape && !is_unread {
            fault = Some(part(path.as_str(), expected));
        }
    };
    root.validate(root, Path::new, report);
    fault.map_or(Ok(()), Err)
}

fn part(part: &str, expected: &'static str) -> MeshError {
    MeshError::part(FORMAT, part, expected)
}

/// A node's transform, in double precision.
fn transform(node: &Node<'_>) -> DAffine3 {
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    match node.transform() {
        Transform::Matrix { matrix } => {
            let column = |idx: usize| {
                let [x, y, z, _] = matrix[idx];
                vector([x, y, z])
            };
            let turned = DMat3::from_cols(column(0), column(1), column(2));
            DAffine3::from_mat3_translation(turned, column(3))
        }
        Transform::Decomposed { translation, rotation, scale } => {
            let rotation = DQuat::from_array(rotation.map(f64::from)).normalize();
            let (scale, translation) = (vector(scale), vector(translation));
            DAffine3::from_scale_rotation_translation(scale, rotation, translation)
        }
    }
}

struct Reader<'a> {
    bin: Cow<'a, [u8]>,
    polygons: &'a mut Polygons,
}

impl Reader<'_> {
    fn primitive(
        &mut self,
        primitive: &Primitive<'_>,
        scene_from_node: DAffine3,
    ) -> Result<(), MeshError> {
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip)
        {
            return Ok(());
        }
        let positions = primitive.get(&gltf::Semantic::Positions);
        let is_vectors = positions.is_some_and(|accessor| {
            (accessor.data_type(), accessor.dimensions()) == (DataType::F32, Dimensions::Vec3)
        });
        if !is_vectors {
            return Err(part("POSITION", "vectors of three floats"));
        }
        let reader = primitive.reader(|buffer| match buffer.source() {
            buffer::Source::Bin => Some(&self.bin[..]),
            buffer::Source::Uri(_) => None,
        });
        let outside = || part("buffers", "data inside the file");
        let first = self.polygons.n_vertices() as u32;
        for [x, y, z] in reader.read_positions().ok_or_else(outside)? {
            let place = DVec3::new(x.into(), y.into(), z.into());
            self.polygons.vertex(scene_from_node.transform_point3(place))?;
        }
        let n = self.polygons.n_vertices() as u32 - first;
        let mut corners: Box<dyn Iterator<Item = u32> + '_> = match primitive.indices() {
            None => Box::new(0..n),
            Some(_) => Box::new(reader.read_indices().ok_or_else(outside)?.into_u32()),
        };
        // A mirror turns triangles inside out.
        let is_mirrored = scene_from_node.matrix3.determinant() < 0.0;
        let polygons = &mut *self.polygons;
        let mut add = |[a, b, c]: [u32; 3], is_turned: bool| {
            if let Some(found) = [a, b, c].into_iter().find(|corner| *corner >= n) {
                return Err(polygons.no_vertex(polygons.len(), found.into()));
            }
            let (b, c) = if is_turned == is_mirrored { (b, c) } else { (c, b) };
            polygons.polygon(&[first + a, first + b, first + c])
        };
        match primitive.mode() {
            Mode::Triangles => {
                while let (Some(a), Some(b), Some(c)) =
                    (corners.next(), corners.next(), corners.next())
                {
                    add([a, b, c], false)?;
                }
            }
            mode => {
                let (Some(mut a), Some(mut b)) = (corners.next(), corners.next()) else {
                    return Ok(());
                };
                for (number, c) in corners.enumerate() {
                    let is_strip = mode == Mode::TriangleStrip;
                    add([a, b, c], is_strip && number % 2 == 1)?;
                    (a, b) = (if is_strip { b } else { a }, c);
                }
            }
        }
        Ok(())
    }
}
