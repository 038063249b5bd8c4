//! Sensors: presets, and grids of taxels by the numbers of a data sheet.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use palpate_core::reading::SensorId;
use palpate_core::sensor::point_spread::point_spread_of_covering;
use palpate_core::sensor::{
    Coupling, ForceCurve, ImageOrder, Preset, SensorDescription, SensorError, SensorFamily,
    SensorKnowledge, SensorParameters, StatedRanges, TaxelGrid, defaults,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::fault;

/// A sensor's description, how far it is to be trusted, and its identity.
#[derive(Debug)]
pub(crate) struct Known {
    pub(crate) id: SensorId,
    pub(crate) description: SensorDescription,
    knowledge: SensorKnowledge,
    ranges: StatedRanges,
    /// Name of the preset that it is.
    preset: Option<String>,
}

impl Known {
    /// The sensors that the description may stand for: they press meshes in trainings.
    pub(crate) fn family(&self) -> SensorFamily {
        SensorFamily::within(self.description.clone(), self.knowledge, &self.ranges)
    }

    /// Values in the sensor frame's order, in the order in which the driver sends them.
    pub(crate) fn as_driver<T: Copy>(&self, values: &[T]) -> Vec<T> {
        let (order, grid) = (self.description.parameters().image_order, self.description.grid());
        // Values of a list of taxels come in its order.
        if order == ImageOrder::default() {
            return values.to_vec();
        }
        order.of_driver(values, grid.rows, grid.cols)
    }
}

/// Arguments of the function that makes a sensor from a pickle.
type Arguments<'py> = (Bound<'py, PyDict>,);

/// A tactile array sensor.
#[pyclass(frozen, module = "palpate._native")]
pub(crate) struct Sensor {
    pub(crate) known: Arc<Known>,
}

impl Sensor {
    /// A sensor that differs from all others of this process, as a session tells them apart.
    fn known(
        description: SensorDescription,
        knowledge: SensorKnowledge,
        ranges: StatedRanges,
        preset: Option<String>,
    ) -> Self {
        static CREATED: AtomicU64 = AtomicU64::new(1);
        let id = SensorId(u128::from(CREATED.fetch_add(1, Ordering::Relaxed)));
        Self { known: Arc::new(Known { id, description, knowledge, ranges, preset }) }
    }
}

#[pymethods]
impl Sensor {
    /// The preset of a name; `knowledge="measured"` for a simulated array that it describes.
    #[staticmethod]
    #[pyo3(signature = (name, *, knowledge="data_sheet"))]
    fn preset(name: &str, knowledge: &str) -> PyResult<Self> {
        let Preset { description, ranges } = Preset::named(name).ok_or_else(|| {
            let known = Preset::NAMES.join(", ");
            fault::of("name", format!("came {name:?}, expected one of {known}"))
        })?;
        Ok(Self::known(description, level(knowledge)?, ranges, Some(name.to_owned())))
    }

    /// The names of the presets.
    #[staticmethod]
    fn preset_names() -> Vec<&'static str> {
        Preset::NAMES.to_vec()
    }

    /// A grid of taxels; defaults are those of `POST /v1/sensors`. `image_order` says whether the
    /// driver's image is transposed and has its rows and columns reversed.
    #[staticmethod]
    #[pyo3(signature = (
        rows, cols, *, pitch, taxel_width, covering_thickness, saturation, quantisation,
        point_spread=None, force_curve=None, noise=None, knowledge="data_sheet",
        image_order=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "the numbers of a data sheet, named in Python")]
    fn grid(
        rows: usize,
        cols: usize,
        pitch: f64,
        taxel_width: f64,
        covering_thickness: f64,
        saturation: f64,
        quantisation: f64,
        point_spread: Option<f64>,
        force_curve: Option<Vec<(f64, f64)>>,
        noise: Option<f64>,
        knowledge: &str,
        image_order: Option<(bool, bool, bool)>,
    ) -> PyResult<Self> {
        let force_curve = match force_curve {
            None => defaults::force_curve(covering_thickness, saturation),
            Some(knots) => ForceCurve::new(knots).map_err(|error| refuse(&error))?,
        };
        let (transposed, rows_reversed, cols_reversed) = image_order.unwrap_or_default();
        let parameters = SensorParameters {
            grid: TaxelGrid { rows, cols, pitch, taxel_width },
            layout: None,
            covering_thickness,
            point_spread: point_spread
                .unwrap_or_else(|| point_spread_of_covering(covering_thickness)),
            force_curve,
            saturation,
            noise: noise.unwrap_or_else(|| defaults::noise(saturation, quantisation)),
            quantisation,
            image_order: ImageOrder { transposed, rows_reversed, cols_reversed },
            coupling: Coupling::default(),
        };
        let description = SensorDescription::new(parameters).map_err(|error| refuse(&error))?;
        Ok(Self::known(description, level(knowledge)?, StatedRanges::default(), None))
    }

    /// Number of rows of the image.
    #[getter]
    fn rows(&self) -> usize {
        self.known.description.grid().rows
    }

    /// Number of columns of the image.
    #[getter]
    fn cols(&self) -> usize {
        self.known.description.grid().cols
    }

    /// Number of values of a reading.
    #[getter]
    fn n_taxels(&self) -> usize {
        self.known.description.n_taxels()
    }

    /// Distance of neighbouring taxels, metres.
    #[getter]
    fn pitch(&self) -> f64 {
        self.known.description.grid().pitch
    }

    /// Thickness of the covering, metres.
    #[getter]
    fn covering_thickness(&self) -> f64 {
        self.known.description.parameters().covering_thickness
    }

    /// Standard deviation of the point spread, metres.
    #[getter]
    fn point_spread(&self) -> f64 {
        self.known.description.parameters().point_spread
    }

    /// Upper limit of a value, Pa.
    #[getter]
    fn saturation(&self) -> f64 {
        self.known.description.parameters().saturation
    }

    /// Standard deviation of the noise, Pa.
    #[getter]
    fn noise(&self) -> f64 {
        self.known.description.parameters().noise
    }

    /// Pressure above which a taxel is in contact, Pa.
    #[getter]
    fn contact_floor(&self) -> f64 {
        self.known.description.contact_floor()
    }

    /// How far the description is to be trusted: `measured`, `data_sheet` or `unknown`.
    #[getter]
    fn knowledge(&self) -> &'static str {
        match self.known.knowledge {
            SensorKnowledge::Measured => "measured",
            SensorKnowledge::Unknown => "unknown",
            _ => "data_sheet",
        }
    }

    fn __eq__(&self, other: &Self) -> bool {
        let (own, other) = (&self.known, &other.known);
        own.description == other.description
            && own.knowledge == other.knowledge
            && own.preset == other.preset
    }

    fn __hash__(&self) -> u64 {
        self.pitch().to_bits() ^ self.known.description.n_taxels() as u64
    }

    /// A pickle holds the arguments of `preset` or `grid`. What is read from it is equal, and a
    /// sensor of its own.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Arguments<'py>)> {
        let (known, arguments) = (&self.known, PyDict::new(py));
        arguments.set_item("knowledge", self.knowledge())?;
        if let Some(name) = &known.preset {
            arguments.set_item("name", name)?;
        } else {
            let parameters = known.description.parameters();
            let SensorParameters { grid, image_order, .. } = parameters;
            arguments.set_item("rows", grid.rows)?;
            arguments.set_item("cols", grid.cols)?;
            arguments.set_item("pitch", grid.pitch)?;
            arguments.set_item("taxel_width", grid.taxel_width)?;
            arguments.set_item("covering_thickness", parameters.covering_thickness)?;
            arguments.set_item("point_spread", parameters.point_spread)?;
            arguments.set_item("force_curve", parameters.force_curve.knots().to_vec())?;
            arguments.set_item("saturation", parameters.saturation)?;
            arguments.set_item("noise", parameters.noise)?;
            arguments.set_item("quantisation", parameters.quantisation)?;
            let ImageOrder { transposed, rows_reversed, cols_reversed } = *image_order;
            let order = (transposed, rows_reversed, cols_reversed);
            arguments.set_item("image_order", order)?;
        }
        Ok((py.import("palpate.local")?.getattr("sensor_of")?, (arguments,)))
    }

    fn __repr__(&self) -> String {
        let named = self.known.preset.as_ref().map(|name| format!("{name}, ")).unwrap_or_default();
        let (n, pitch) = (self.known.description.n_taxels(), 1e3 * self.pitch());
        format!("Sensor({named}{n} taxels, pitch {pitch:.2} mm, {})", self.knowledge())
    }
}

/// The level of knowledge of a name.
fn level(name: &str) -> PyResult<SensorKnowledge> {
    match name {
        "measured" => Ok(SensorKnowledge::Measured),
        "data_sheet" => Ok(SensorKnowledge::DataSheet),
        "unknown" => Ok(SensorKnowledge::Unknown),
        found => {
            let detail = format!("came {found:?}, expected measured, data_sheet or unknown");
            Err(fault::of("knowledge", detail))
        }
    }
}

/// The error of a description, at its argument.
fn refuse(error: &SensorError) -> PyErr {
    let argument = match error {
        SensorError::Count { field, .. }
        | SensorError::Range { field, .. }
        | SensorError::Order { field, .. }
        | SensorError::Empty { field } => field,
        SensorError::ForceCurve { .. } => "force_curve",
        SensorError::Layout(_) => "taxels",
        SensorError::OrderOfLayout => "image_order",
    };
    fault::of(argument, error)
}
