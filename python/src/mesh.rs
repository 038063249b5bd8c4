//! Triangle meshes: from files, from arrays, and the built-in examples.

use std::hash::{Hash, Hasher};

use glam::DVec3;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2};
use palpate_core::stop::Stop;
use palpate_sim::mesh::MeshFormat;
use palpate_sim::{mesh, shapes};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::{arrays, fault, interrupt};

/// Arguments with which a pickle makes a mesh: vertices and faces.
type Content<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<i64>>);

/// A checked triangle mesh, metres.
#[pyclass(frozen, module = "palpate._native")]
pub(crate) struct Mesh {
    pub(crate) mesh: mesh::Mesh,
}

#[pymethods]
impl Mesh {
    /// The mesh of vertices (n × 3, metres) and faces (m × 3 indices).
    #[new]
    fn new(
        py: Python<'_>,
        vertices: PyReadonlyArray2<'_, f64>,
        faces: PyReadonlyArray2<'_, i64>,
    ) -> PyResult<Self> {
        let (vertices, faces) = (vertices.as_array(), faces.as_array());
        for (argument, found) in [("vertices", vertices.ncols()), ("faces", faces.ncols())] {
            if found != 3 {
                return Err(fault::of(argument, format!("has {found} columns, expected 3")));
            }
        }
        let points: Vec<DVec3> =
            vertices.rows().into_iter().map(|row| DVec3::new(row[0], row[1], row[2])).collect();
        let mut triangles = Vec::with_capacity(faces.nrows());
        for (triangle, row) in faces.rows().into_iter().enumerate() {
            let mut corners = [0_u32; 3];
            for (corner, index) in corners.iter_mut().zip(row) {
                let n = points.len();
                let wrong = || {
                    let detail = format!("came {index}, expected an index from 0 to {n} - 1");
                    fault::of(format!("faces[{triangle}]"), detail)
                };
                *corner = u32::try_from(*index).map_err(|_| wrong())?;
                if *corner as usize >= n {
                    return Err(wrong());
                }
            }
            triangles.push(corners);
        }
        let mesh = py.detach(|| mesh::Mesh::new(points, triangles));
        Ok(Self { mesh: mesh.map_err(|error| fault::of("vertices", error))? })
    }

    /// The mesh of a file's bytes; `format` is an extension (stl, obj, ply, off, glb, 3mf), `unit`
    /// the length of the file's unit in metres, if the format does not record it. Warns of what is
    /// remarkable, such as an unusual size.
    #[staticmethod]
    #[pyo3(signature = (content, format, unit=None))]
    fn from_bytes(
        py: Python<'_>,
        content: &[u8],
        format: &str,
        unit: Option<f64>,
    ) -> PyResult<Self> {
        let known = MeshFormat::from_extension(format).ok_or_else(|| {
            let expected = "expected stl, obj, ply, off, glb or 3mf";
            let detail = match mesh::other_content(content) {
                Some(found) => format!("the file is {found}"),
                None => format!("came {format:?}, {expected}"),
            };
            fault::of("format", detail)
        })?;
        let content = content.to_vec();
        let stop = Stop::never();
        let read = interrupt::run(py, &stop, || mesh::Mesh::read(known, &content, unit))?;
        let argument = |error: &mesh::MeshError| match error {
            mesh::MeshError::Unit { .. }
            | mesh::MeshError::UnitMissing { .. }
            | mesh::MeshError::UnitContradicts { .. } => "unit",
            _ => "content",
        };
        let read = read.map_err(|error| fault::of(argument(&error), error))?;
        for remark in &read.remarks {
            let text = std::ffi::CString::new(remark.to_string()).unwrap_or_default();
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 2)?;
        }
        Ok(Self { mesh: read.mesh })
    }

    /// A built-in example, 80 mm large.
    #[staticmethod]
    fn example(name: &str) -> PyResult<Self> {
        let mesh = shapes::example(name).ok_or_else(|| {
            let known = shapes::PUBLIC_NAMES.join(", ");
            fault::of("name", format!("came {name:?}, expected one of {known}"))
        })?;
        Ok(Self { mesh })
    }

    /// The names of the built-in examples.
    #[staticmethod]
    fn example_names() -> Vec<&'static str> {
        shapes::PUBLIC_NAMES.to_vec()
    }

    /// The vertices, n × 3, metres.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let vertices = self.mesh.vertices();
        let numbers = vertices.iter().flat_map(|vertex| vertex.to_array()).collect();
        arrays::matrix(py, vertices.len(), 3, numbers)
    }

    /// The faces, m × 3 indices of vertices.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<i64>> {
        let triangles = self.mesh.triangles();
        let indices = Array2::from_shape_fn((triangles.len(), 3), |(triangle, corner)| {
            i64::from(triangles[triangle][corner])
        });
        indices.into_pyarray(py)
    }

    /// The largest extent along an axis, metres.
    #[getter]
    fn largest_dimension(&self) -> f64 {
        self.mesh.largest_dimension()
    }

    /// The centroid of the surface, metres: the origin of the object frame.
    #[getter]
    fn centroid(&self) -> [f64; 3] {
        self.mesh.centroid().to_array()
    }

    /// Whether the surface is closed.
    #[getter]
    fn is_watertight(&self) -> bool {
        self.mesh.is_watertight()
    }

    /// The mesh as an OFF file in metres, exact to the last bit.
    fn to_off<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.mesh.to_off_bytes())
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.mesh.vertices() == other.mesh.vertices()
            && self.mesh.triangles() == other.mesh.triangles()
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = std::hash::DefaultHasher::new();
        self.mesh.triangles().hash(&mut hasher);
        hasher.finish()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Content<'py>)> {
        let (py, mesh) = (slf.py(), slf.get());
        Ok((slf.get_type().into_any(), (mesh.vertices(py), mesh.faces(py))))
    }

    /// A drawing, for a notebook.
    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, mesh) = (slf.py(), slf.get());
        let shown = (mesh.vertices(py), mesh.faces(py), mesh.__repr__());
        py.import("palpate.pictures")?.call_method1("mesh", shown)
    }

    fn __repr__(&self) -> String {
        let (vertices, faces) = (self.mesh.vertices().len(), self.mesh.triangles().len());
        let size = 1e3 * self.mesh.largest_dimension();
        format!("Mesh({vertices} vertices, {faces} faces, {size:.1} mm)")
    }
}
