//! 3MF through `zip` and `quick-xml`: the meshes of all build items, with components, transforms
//! and the unit of the root model.
//!
//! Reads the core specification and models in several parts (production extension). Parts that no
//! build item reaches are not read. Other extensions that a part requires are refused by name, as
//! are lattices. What a small file can unpack to is bounded everywhere: parts, their names, bytes
//! of XML, objects, instances, depth.

mod xml;

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufReader, Cursor, Read as _};

use glam::{DAffine3, DVec3};
use palpate_core::units::{INCH, MM};
use quick_xml::events::BytesStart;
use zip::ZipArchive;

use super::polygons::{Polygons, check_count};
use super::{MeshError, MeshFormat, TRIANGLES_MAX, VERTICES_MAX};
use xml::{attributes, each_element, text, transform};

const FORMAT: MeshFormat = MeshFormat::ThreeMf;
/// Most parts of an archive.
const PARTS_MAX: usize = 10_000;
/// Longest name of a part.
const NAME_BYTES_MAX: usize = 1024;
/// Most bytes of all models, unpacked: two million triangles have 170 MB.
const XML_BYTES_MAX: u64 = 256_000_000;
/// Most objects, components and build items, and most instances of objects.
const OBJECTS_MAX: usize = 100_000;
/// Most components inside each other.
const DEPTH_MAX: usize = 16;
/// Words in the names of extensions that do not change a shape, or are read.
const READ: [&str; 3] = ["/production/", "/material/", "/trianglesets/"];
/// The part that says which one is the root model, and where the root is if it does not.
const RELATIONS: &str = "_rels/.rels";
const ROOT: &str = "3d/3dmodel.model";

/// A part's index in the archive, and an object's number in it.
type Key = (usize, u32);

/// A reference to an object, with the transform from its part to that of the reference; `None` for
/// a part that the archive does not have.
type Placed = (Option<Key>, DAffine3);

#[derive(Default)]
struct Object {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    components: Vec<Placed>,
}

/// The parts of an archive.
struct Parts<'a> {
    archive: ZipArchive<Cursor<&'a [u8]>>,
    names: Vec<String>,
    by_name: BTreeMap<String, usize>,
    /// Bytes that may still be unpacked.
    left: u64,
}

/// What has been read of a model.
#[derive(Default)]
struct Model {
    objects: BTreeMap<Key, Object>,
    /// Metres in the unit of each part that has been read.
    units: BTreeMap<usize, f64>,
    n_vertices: usize,
    n_triangles: usize,
    n_components: usize,
}

/// Reads a file; returns its unit in metres.
pub(super) fn read(bytes: &[u8], polygons: &mut Polygons) -> Result<f64, MeshError> {
    let mut parts = Parts::of(bytes)?;
    let mut model = Model::default();
    let root = parts.root()?;
    let items = model.read_part(&mut parts, root)?;
    if items.is_empty() {
        return Err(part("build", "at least one item"));
    }
    model.read_reached(&mut parts, &items)?;
    let mut n_left = OBJECTS_MAX;
    for item in &items {
        let (key, place) = model.placed(item, root, &parts)?;
        model.place(&parts, key, place, DEPTH_MAX, &mut n_left, polygons)?;
    }
    Ok(model.unit(root))
}

fn part(part: &str, expected: &'static str) -> MeshError {
    MeshError::part(FORMAT, part, expected)
}

/// A part's name as a key: names do not depend on case, and may begin with a slash.
fn key(name: &str) -> Result<String, MeshError> {
    let name = name.trim_start_matches('/').to_ascii_lowercase();
    let is_short = name.len() <= NAME_BYTES_MAX;
    if is_short { Ok(name) } else { Err(part(&name, "names of parts of at most 1024 bytes")) }
}

impl<'a> Parts<'a> {
    fn of(bytes: &'a [u8]) -> Result<Self, MeshError> {
        // Each entry of the directory begins with this; the archive's reader makes something of
        // each.
        let n_parts = bytes.windows(4).filter(|at| *at == b"PK\x01\x02").count();
        check_count("parts in its archive", n_parts, PARTS_MAX)?;
        let unreadable = |_| MeshError::Unreadable { format: FORMAT };
        let archive = ZipArchive::new(Cursor::new(bytes)).map_err(unreadable)?;
        let mut names = Vec::with_capacity(archive.len());
        for name in archive.file_names() {
            names.push(key(&name.map_err(unreadable)?)?);
        }
        let by_name = names.iter().cloned().enumerate().map(|(idx, name)| (name, idx)).collect();
        Ok(Self { archive, names, by_name, left: XML_BYTES_MAX })
    }

    fn get(&self, name: &str) -> Option<usize> {
        self.by_name.get(name).copied()
    }

    /// The root model.
    fn root(&mut self) -> Result<usize, MeshError> {
        let mut target = None;
        if let Some(relations) = self.get(RELATIONS) {
            self.each_element(relations, |_, element| {
                if text(element, "Type").is_some_and(|of| of.ends_with("/3dmodel")) {
                    target = text(element, "Target").map(|target| key(&target)).transpose()?;
                }
                Ok(())
            })?;
        }
        let named = target.and_then(|target| self.get(&target)).or_else(|| self.get(ROOT));
        let is_model = |name: &String| name.ends_with(".model");
        let root = named.or_else(|| self.names.iter().position(is_model));
        root.ok_or_else(|| part("archive", "a model"))
    }

    /// Calls `see` with each element of a part.
    fn each_element(
        &mut self,
        idx: usize,
        mut see: impl FnMut(&BTreeMap<String, usize>, &BytesStart<'_>) -> Result<(), MeshError>,
    ) -> Result<(), MeshError> {
        let Self { archive, names, by_name, left } = self;
        let name = &names[idx];
        let file = archive.by_index(idx).map_err(|_| part(name, "a part without password"))?;
        let mut limited = file.take(*left + 1);
        each_element(name, BufReader::new(&mut limited), |element| see(by_name, element))?;
        *left = limited.limit().checked_sub(1).ok_or(part(name, "at most 256 MB unpacked"))?;
        Ok(())
    }

    /// The name of a part.
    fn name(&self, idx: usize) -> &str {
        &self.names[idx]
    }
}

impl Model {
    /// Reads the parts of all objects that `items` reach.
    fn read_reached(&mut self, parts: &mut Parts<'_>, items: &[Placed]) -> Result<(), MeshError> {
        let mut waiting: Vec<Key> = items.iter().filter_map(|(key, _)| *key).collect();
        let mut reached = BTreeSet::new();
        while let Some(key) = waiting.pop() {
            if !reached.insert(key) {
                continue;
            }
            if !self.units.contains_key(&key.0) {
                self.read_part(parts, key.0)?;
            }
            let object = self.objects.get(&key);
            let components = object.iter().flat_map(|of| &of.components);
            waiting.extend(components.filter_map(|(key, _)| *key));
        }
        Ok(())
    }

    /// Reads a part; returns its build items, which count in the root alone.
    fn read_part(
        &mut self,
        parts: &mut Parts<'_>,
        part_idx: usize,
    ) -> Result<Vec<Placed>, MeshError> {
        let name = parts.name(part_idx).to_owned();
        let (mut object, mut items) = (None, Vec::new());
        self.units.insert(part_idx, MM);
        parts.each_element(part_idx, |by_name, element| {
            let find = |path: String| Ok(by_name.get(&key(&path)?).copied());
            match element.local_name().as_ref() {
                "model" => {
                    self.units.insert(part_idx, begin(&name, element)?);
                }
                of @ ("item" | "component") => {
                    let named = text(element, "path").map_or(Ok(Some(part_idx)), find)?;
                    let placed = self.reference(&name, named, element)?;
                    if of == "item" {
                        items.push(placed);
                    } else {
                        self.current(&name, object)?.components.push(placed);
                    }
                }
                "object" => {
                    let id = number(element, "id").ok_or(part(&name, "objects with an id"))?;
                    self.objects.insert((part_idx, id), Object::default());
                    check_count("objects", self.objects.len(), OBJECTS_MAX)?;
                    object = Some((part_idx, id));
                }
                _ => self.geometry(&name, object, element)?,
            }
            Ok(())
        })?;
        Ok(items)
    }

    /// The reference of an item or a component to an object of the part `named`.
    fn reference(
        &mut self,
        name: &str,
        named: Option<usize>,
        element: &BytesStart<'_>,
    ) -> Result<Placed, MeshError> {
        let id = number(element, "objectid").ok_or(part(name, "components with an objectid"))?;
        let place = text(element, "transform").map_or(Some(DAffine3::IDENTITY), |t| transform(&t));
        let place = place.ok_or(part(name, "transforms of twelve numbers"))?;
        self.n_components += 1;
        check_count("components", self.n_components, OBJECTS_MAX)?;
        Ok((named.map(|part_idx| (part_idx, id)), place))
    }

    /// Adds a vertex or a triangle to the object that is being read.
    fn geometry(
        &mut self,
        name: &str,
        object: Option<Key>,
        element: &BytesStart<'_>,
    ) -> Result<(), MeshError> {
        match element.local_name().as_ref() {
            "vertex" => {
                let along = |axis| text(element, axis)?.parse::<f64>().ok();
                let (Some(x), Some(y), Some(z)) = (along("x"), along("y"), along("z")) else {
                    return Err(part(name, "vertices with x, y and z"));
                };
                self.n_vertices += 1;
                check_count("vertices", self.n_vertices, VERTICES_MAX)?;
                self.current(name, object)?.vertices.push(DVec3::new(x, y, z));
            }
            "triangle" => {
                let corner = |name| number(element, name);
                let (Some(a), Some(b), Some(c)) = (corner("v1"), corner("v2"), corner("v3")) else {
                    return Err(part(name, "triangles with v1, v2 and v3"));
                };
                self.n_triangles += 1;
                check_count("triangles", self.n_triangles, TRIANGLES_MAX)?;
                self.current(name, object)?.triangles.push([a, b, c]);
            }
            "beamlattice" => return Err(MeshError::unsupported(FORMAT, "beamlattice")),
            _ => {}
        }
        Ok(())
    }

    fn current(&mut self, name: &str, object: Option<Key>) -> Result<&mut Object, MeshError> {
        let object = object.and_then(|key| self.objects.get_mut(&key));
        object.ok_or(part(name, "geometry inside an object"))
    }

    /// Metres in the unit of a part.
    fn unit(&self, part_idx: usize) -> f64 {
        self.units.get(&part_idx).copied().unwrap_or(MM)
    }

    /// The object of a reference in the part `from`, and the transform between their units.
    fn placed(
        &self,
        (key, place): &Placed,
        from: usize,
        parts: &Parts<'_>,
    ) -> Result<(Key, DAffine3), MeshError> {
        let key = key.ok_or(part(parts.name(from), "parts that the archive has"))?;
        let scale = DVec3::splat(self.unit(key.0) / self.unit(from));
        Ok((key, *place * DAffine3::from_scale(scale)))
    }

    /// Adds an object and its components at a place.
    fn place(
        &self,
        parts: &Parts<'_>,
        key: Key,
        build_from_object: DAffine3,
        depth: usize,
        n_left: &mut usize,
        polygons: &mut Polygons,
    ) -> Result<(), MeshError> {
        let fault = |expected| part(parts.name(key.0), expected);
        let object = self.objects.get(&key).ok_or(fault("the object that an item names"))?;
        *n_left = n_left.checked_sub(1).ok_or(fault("at most 100000 instances"))?;
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
        for component in &object.components {
            let depth = depth.checked_sub(1).ok_or(fault("at most 16 components deep"))?;
            let (component, place) = self.placed(component, key.0, parts)?;
            self.place(parts, component, build_from_object * place, depth, n_left, polygons)?;
        }
        Ok(())
    }
}

/// The attributes of a model: its unit in metres, and the extensions that it requires.
fn begin(name: &str, element: &BytesStart<'_>) -> Result<f64, MeshError> {
    let attributes = attributes(element);
    let text = |name: &str| attributes.get(name).map(String::as_str);
    let unit = match text("unit") {
        None | Some("millimeter") => MM,
        Some("micron") => 1e-6,
        Some("centimeter") => 10.0 * MM,
        Some("inch") => INCH,
        Some("foot") => 12.0 * INCH,
        Some("meter") => 1.0,
        Some(_) => return Err(part(name, "micron, millimeter, centimeter, inch, foot or meter")),
    };
    for prefix in text("requiredextensions").unwrap_or_default().split_whitespace() {
        // The prefix is declared as `xmlns:prefix="name"`, whose local name is the prefix.
        let name = text(prefix).unwrap_or(prefix);
        if !READ.iter().any(|read| name.contains(read)) {
            return Err(MeshError::unsupported(FORMAT, name));
        }
    }
    Ok(unit)
}

fn number(element: &BytesStart<'_>, name: &str) -> Option<u32> {
    text(element, name)?.parse().ok()
}
