//! 3MF through `zip` and `quick-xml`: the meshes of all build items, with components, transforms
//! and the unit of the model.
//!
//! Reads the core specification and models in several parts (production extension). Other
//! extensions that a file requires are refused by name, as are lattices. What a small file can
//! unpack to is bounded everywhere: parts, bytes of XML, objects, instances, depth.

use std::collections::BTreeMap;
use std::io::{BufReader, Cursor, Read as _};

use glam::{DAffine3, DVec3};
use palpate_core::units::{INCH, MM};
use quick_xml::events::{BytesStart, Event};
use zip::ZipArchive;

use super::polygons::{Polygons, check_count};
use super::{MeshError, MeshFormat, TRIANGLES_MAX, VERTICES_MAX};

const FORMAT: MeshFormat = MeshFormat::ThreeMf;
/// Most parts of an archive.
const PARTS_MAX: usize = 10_000;
/// Most bytes of all models, unpacked: two million triangles have 170 MB.
const XML_BYTES_MAX: u64 = 256_000_000;
/// Most objects, components and build items, and most instances of objects.
const OBJECTS_MAX: usize = 100_000;
/// Most components inside each other.
const DEPTH_MAX: usize = 16;
/// Words in the names of extensions that do not change a shape, or are read.
const READ: [&str; 3] = ["/production/", "/material/", "/trianglesets/"];

/// A part of the archive and the object's number in it.
type Key = (String, u32);

#[derive(Default)]
struct Object {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    components: Vec<(Key, DAffine3)>,
}

#[derive(Default)]
struct Model {
    objects: BTreeMap<Key, Object>,
    items: Vec<(Key, DAffine3)>,
    unit: Option<f64>,
    n_vertices: usize,
    n_triangles: usize,
    n_components: usize,
}

/// Reads a file; returns its unit in metres.
pub(super) fn read(bytes: &[u8], polygons: &mut Polygons) -> Result<f64, MeshError> {
    // Each entry of the directory begins with this; the archive's reader makes something of each.
    let n_parts = bytes.windows(4).filter(|at| *at == b"PK\x01\x02").count();
    check_count("parts in its archive", n_parts, PARTS_MAX)?;
    let unreadable = |_| MeshError::Unreadable { format: FORMAT };
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(unreadable)?;
    let mut model = Model::default();
    let mut left = XML_BYTES_MAX;
    for idx in 0..archive.len() {
        let file = archive.by_index(idx).map_err(|_| part("archive", "parts without password"))?;
        let name = key(&file.name().map_err(unreadable)?);
        if name.ends_with(".model") {
            let mut limited = file.take(left + 1);
            model.read_part(&name, BufReader::new(&mut limited))?;
            left = limited.limit().checked_sub(1).ok_or(part(&name, "at most 256 MB unpacked"))?;
        }
    }
    if model.items.is_empty() {
        return Err(part("build", "at least one item"));
    }
    let mut n_left = OBJECTS_MAX;
    for (key, place) in &model.items {
        model.place(key, *place, DEPTH_MAX, &mut n_left, polygons)?;
    }
    Ok(model.unit.unwrap_or(MM))
}

fn part(part: &str, expected: &'static str) -> MeshError {
    MeshError::Part { format: FORMAT, part: part.into(), expected }
}

/// A part's name as a key: names do not depend on case, and may begin with a slash.
fn key(name: &str) -> String {
    name.trim_start_matches('/').to_ascii_lowercase()
}

impl Model {
    fn read_part(&mut self, name: &str, xml: impl std::io::BufRead) -> Result<(), MeshError> {
        let mut reader = quick_xml::Reader::from_reader(xml);
        let mut object = None;
        let mut buffer = Vec::new();
        loop {
            buffer.clear();
            let event = reader.read_event_into(&mut buffer);
            match event.map_err(|_| part(name, "well-formed XML, at most 256 MB of it"))? {
                Event::Start(element) | Event::Empty(element) => {
                    self.element(name, &element, &mut object)?;
                }
                Event::Eof => return Ok(()),
                _ => {}
            }
        }
    }

    fn element(
        &mut self,
        name: &str,
        element: &BytesStart<'_>,
        object: &mut Option<u32>,
    ) -> Result<(), MeshError> {
        let local = element.local_name();
        let text = |attribute: &str| text(element, attribute);
        let number = |attribute: &'static str| text(attribute)?.parse::<u32>().ok();
        match local.as_ref() {
            "model" => self.begin(name, element)?,
            "object" => {
                let id = number("id").ok_or(part(name, "objects with an id"))?;
                self.objects.insert((name.to_owned(), id), Object::default());
                check_count("objects", self.objects.len(), OBJECTS_MAX)?;
                *object = Some(id);
            }
            "item" | "component" => {
                let id = number("objectid").ok_or(part(name, "components with an objectid"))?;
                let path = text("path").map_or(name.to_owned(), |path| key(&path));
                let place = text("transform").map_or(Some(DAffine3::IDENTITY), |t| transform(&t));
                let place = place.ok_or(part(name, "transforms of twelve numbers"))?;
                self.n_components += 1;
                check_count("components", self.n_components, OBJECTS_MAX)?;
                if local.as_ref() == "item" {
                    self.items.push(((path, id), place));
                } else {
                    self.current(name, *object)?.components.push(((path, id), place));
                }
            }
            "vertex" => {
                let along = |axis| text(axis)?.parse::<f64>().ok();
                let (Some(x), Some(y), Some(z)) = (along("x"), along("y"), along("z")) else {
                    return Err(part(name, "vertices with x, y and z"));
                };
                self.n_vertices += 1;
                check_count("vertices", self.n_vertices, VERTICES_MAX)?;
                self.current(name, *object)?.vertices.push(DVec3::new(x, y, z));
            }
            "triangle" => {
                let (Some(a), Some(b), Some(c)) = (number("v1"), number("v2"), number("v3")) else {
                    return Err(part(name, "triangles with v1, v2 and v3"));
                };
                self.n_triangles += 1;
                check_count("triangles", self.n_triangles, TRIANGLES_MAX)?;
                self.current(name, *object)?.triangles.push([a, b, c]);
            }
            "beamlattice" => {
                return Err(MeshError::Unsupported { format: FORMAT, name: "beamlattice".into() });
            }
            _ => {}
        }
        Ok(())
    }

    /// The attributes of a model: its unit, and the extensions that it requires.
    fn begin(&mut self, name: &str, element: &BytesStart<'_>) -> Result<(), MeshError> {
        let unit = match text(element, "unit").as_deref() {
            None | Some("millimeter") => MM,
            Some("micron") => 1e-6,
            Some("centimeter") => 10.0 * MM,
            Some("inch") => INCH,
            Some("foot") => 12.0 * INCH,
            Some("meter") => 1.0,
            Some(_) => {
                return Err(part(name, "micron, millimeter, centimeter, inch, foot or meter"));
            }
        };
        let before = *self.unit.get_or_insert(unit);
        if (before / unit - 1.0).abs() > 1e-9 {
            return Err(part(name, "the unit of the other parts"));
        }
        let required = text(element, "requiredextensions").unwrap_or_default();
        for prefix in required.split_whitespace() {
            // The prefix is declared as `xmlns:prefix="name"`, whose local name is the prefix.
            let name = text(element, prefix).unwrap_or_else(|| prefix.to_owned());
            if !READ.iter().any(|read| name.contains(read)) {
                return Err(MeshError::Unsupported { format: FORMAT, name: name.into() });
            }
        }
        Ok(())
    }

    fn current(&mut self, name: &str, object: Option<u32>) -> Result<&mut Object, MeshError> {
        let object = object.and_then(|id| self.objects.get_mut(&(name.to_owned(), id)));
        object.ok_or(part(name, "geometry inside an object"))
    }

    /// Adds an object and its components at a place.
    fn place(
        &self,
        key: &Key,
        build_from_object: DAffine3,
        depth: usize,
        n_left: &mut usize,
        polygons: &mut Polygons,
    ) -> Result<(), MeshError> {
        let object = self.objects.get(key).ok_or(part(&key.0, "the object that an item names"))?;
        *n_left = n_left.checked_sub(1).ok_or(part(&key.0, "at most 100000 instances"))?;
        let first = polygons.n_vertices() as u32;
        for vertex in &object.vertices {
            polygons.vertex(build_from_object.transform_point3(*vertex))?;
        }
        let n_vertices = object.vertices.len();
        let is_mirrored = build_from_object.matrix3.determinant() < 0.0;
        for (triangle, &[a, b, c]) in object.triangles.iter().enumerate() {
            if let Some(found) = [a, b, c].into_iter().find(|at| *at as usize >= n_vertices) {
                return Err(MeshError::Index { triangle, found: found.into(), n_vertices });
            }
            let [b, c] = if is_mirrored { [c, b] } else { [b, c] };
            polygons.polygon(&[first + a, first + b, first + c])?;
        }
        for (part_of, object_from_part) in &object.components {
            let depth = depth.checked_sub(1).ok_or(part(&key.0, "at most 16 components deep"))?;
            let place = build_from_object * *object_from_part;
            self.place(part_of, place, depth, n_left, polygons)?;
        }
        Ok(())
    }
}

/// The value of the attribute with this local name, under any prefix.
fn text(element: &BytesStart<'_>, name: &str) -> Option<String> {
    let mut attributes = element.attributes();
    let found = attributes
        .with_checks(false)
        .flatten()
        .find(|attribute| attribute.key.local_name().as_ref() == name)?;
    Some(found.value.into_owned())
}

/// A transform of twelve numbers, row by row for points that are rows.
fn transform(text: &str) -> Option<DAffine3> {
    let numbers: Vec<f64> = text.split_whitespace().map_while(|word| word.parse().ok()).collect();
    let numbers: [f64; 12] = numbers.try_into().ok()?;
    Some(DAffine3::from_cols_array(&numbers))
}
