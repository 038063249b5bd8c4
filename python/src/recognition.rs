//! A session without a server: readings in, beliefs out.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use palpate_core::belief::answer::{Answer, PoseMode};
use palpate_core::plausible::{self, Doubt};
use palpate_core::pose::Pose;
use palpate_core::reading::{Looseness, Reading};
use palpate_core::sensor::SensorDescription;
use palpate_core::stop::Stop;
use palpate_core::symmetry::{AxisOrder, SymmetryAxis};
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::model::{CalibrationBasis, SurfaceModel};
use palpate_recogniser::options::SurfaceOptions;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::catalogue::Catalogue;
use crate::readings::Readings;
use crate::{fault, interrupt};

/// Largest number of poses of an answer: the server's limit.
const POSES_MAX: usize = 100;

/// The belief over one object's identity and pose, by the method `surface`.
#[pyclass(module = "palpate._native")]
pub(crate) struct Recognition {
    names: Vec<String>,
    belief: SurfaceBelief,
    /// The recogniser's prior of "none of these", unless the session stated one.
    untold_unknown_prior: Option<f64>,
    /// Position of the first reading, metres, session frame.
    first: Option<DVec3>,
    /// Probable mistakes in the readings so far: the first of each kind, with its reading's number.
    doubts: Vec<(Doubt, usize, String)>,
    n_readings: usize,
}

#[pymethods]
impl Recognition {
    /// The belief before the first reading. `prior` holds the weights of the objects, in the
    /// catalogue's order; `object_moves` the deviations of a drift between touches, metres and
    /// radians.
    #[new]
    #[pyo3(signature = (catalogue, *, unknown_prior=None, prior=None, object_moves=None))]
    fn new(
        catalogue: &Catalogue,
        unknown_prior: Option<f64>,
        prior: Option<Vec<f64>>,
        object_moves: Option<(f64, f64)>,
    ) -> PyResult<Self> {
        let usual = SurfaceOptions::default();
        let unknown = match unknown_prior {
            Some(found) if found > 0.0 && found < 1.0 => found,
            Some(found) => {
                let detail = format!("came {found}, expected more than 0 and less than 1");
                return Err(fault::of("unknown_prior", detail));
            }
            None => usual.unknown,
        };
        let motion = object_moves.map(|moved| looseness("object_moves", moved)).transpose()?;
        let options = SurfaceOptions { unknown, motion, ..usual };
        let belief = SurfaceBelief::new(Arc::clone(&catalogue.model), options, prior.as_deref());
        let belief = belief.map_err(|error| fault::of("prior", error))?;
        let untold_unknown_prior = unknown_prior.is_none().then_some(usual.unknown);
        let names = catalogue.names.clone();
        let (first, doubts, n_readings) = (None, Vec::new(), 0);
        Ok(Self { names, belief, untold_unknown_prior, first, doubts, n_readings })
    }

    /// Adds readings in their order; each counts as a press. An interrupted call adds nothing.
    fn add(&mut self, py: Python<'_>, readings: &Readings) -> PyResult<()> {
        let (stop, mut next) = (Stop::possible(), self.belief.clone());
        next.heed(&stop);
        let added = interrupt::run(py, &stop, move || {
            for reading in readings.readings.iter() {
                next.add(reading, &readings.sensor.description);
            }
            next
        })?;
        self.belief = added;
        for reading in readings.readings.iter() {
            self.judge(reading, &readings.sensor.description);
        }
        Ok(())
    }

    /// Announces that the object may have moved since the last reading, by these standard
    /// deviations, metres and radians.
    fn announce_move(&mut self, position: f64, angle: f64) -> PyResult<()> {
        self.belief.announce_move(&looseness("position, angle", (position, angle))?);
        Ok(())
    }

    /// The belief in the form of the server's answers, with at most `poses` poses; `risk` adds
    /// the advice on stopping.
    #[pyo3(signature = (*, poses=5, risk=None))]
    fn belief<'py>(
        &self,
        py: Python<'py>,
        poses: usize,
        risk: Option<f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        fault::count("poses", poses, 0, POSES_MAX)?;
        let risk = risk.map(|risk| fault::within("risk", risk, 0.0001, 0.5)).transpose()?;
        let belief = &self.belief;
        let answer = interrupt::run(py, &Stop::never(), || belief.answer(poses))?;
        self.to_python(py, &answer, risk)
    }
}

impl Recognition {
    /// Looks for probable mistakes in a reading, as the server does.
    fn judge(&mut self, reading: &Reading, sensor: &SensorDescription) {
        let position = reading.sent_pose().translation;
        let first = *self.first.get_or_insert(position);
        let found = plausible::of_pressures(reading, sensor).into_iter();
        let found = found.chain(plausible::of_position(position));
        for (doubt, detail) in found.chain(plausible::of_two_positions(first, position)) {
            if self.doubts.iter().all(|(known, ..)| *known != doubt) {
                self.doubts.push((doubt, self.n_readings, detail));
            }
        }
        self.n_readings += 1;
    }

    fn to_python<'py>(
        &self,
        py: Python<'py>,
        answer: &Answer,
        risk: Option<f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let model = self.belief.model();
        let mut ranked: Vec<(&f64, &String)> =
            answer.probabilities.iter().zip(&self.names).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(a.0));
        let objects = PyList::empty(py);
        for (probability, name) in ranked {
            let object = PyDict::new(py);
            object.set_item("name", name)?;
            object.set_item("probability", probability)?;
            objects.append(object)?;
        }
        let poses = PyList::empty(py);
        for mode in &answer.modes {
            poses.append(self.hypothesis(py, mode)?)?;
        }
        let reason = match model.calibration.basis {
            CalibrationBasis::HeldBack { .. } | CalibrationBasis::Sessions { .. } => None,
            CalibrationBasis::OneObject => Some("one_object"),
            CalibrationBasis::FewReadings => Some("few_readings"),
        };
        let belief = PyDict::new(py);
        belief.set_item("n_readings", answer.n_readings)?;
        belief.set_item("objects", objects)?;
        belief.set_item("unknown", answer.unknown)?;
        belief.set_item("entropy_bits", answer.entropy_bits)?;
        belief.set_item("calibrated", reason.is_none())?;
        belief.set_item("uncalibrated_reason", reason)?;
        belief.set_item("poses", poses)?;
        let warnings = PyList::empty(py);
        for (doubt, number, detail) in &self.doubts {
            let warning = PyDict::new(py);
            warning.set_item("code", doubt.code())?;
            warning.set_item("pointer", format!("/readings/{number}"))?;
            warning.set_item("detail", detail)?;
            warnings.append(warning)?;
        }
        belief.set_item("warnings", warnings)?;
        belief.set_item("stop", risk.map(|risk| self.stop(py, answer, risk)).transpose()?)?;
        Ok(belief)
    }

    fn stop<'py>(
        &self,
        py: Python<'py>,
        answer: &Answer,
        risk: f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let rule = self.belief.model().calibration.stop;
        let found = answer.risk(self.untold_unknown_prior, rule);
        let stop = PyDict::new(py);
        stop.set_item("risk", risk)?;
        stop.set_item("found", found)?;
        stop.set_item("reached", found <= risk)?;
        Ok(stop)
    }

    fn hypothesis<'py>(&self, py: Python<'py>, mode: &PoseMode) -> PyResult<Bound<'py, PyDict>> {
        let (model, object): (&SurfaceModel, usize) = (self.belief.model(), mode.object.0 as usize);
        let (map, covariance) = (&model.maps()[object], mode.covariance);
        let object_from_model = Pose::from_parts(DQuat::IDENTITY, -map.origin_in_training());
        let numbers: Vec<f64> = (0..36).map(|index| covariance[(index / 6, index % 6)]).collect();
        let symmetry = PyList::empty(py);
        for axis in &map.symmetry().axes {
            symmetry.append(to_axis(py, axis, &mode.session_from_object)?)?;
        }
        let hypothesis = PyDict::new(py);
        hypothesis.set_item("name", &self.names[object])?;
        hypothesis.set_item("weight", mode.weight)?;
        hypothesis.set_item("pose", to_pose(py, &mode.session_from_object)?)?;
        let session_from_model = mode.session_from_object * object_from_model;
        hypothesis.set_item("session_from_model", to_pose(py, &session_from_model)?)?;
        hypothesis.set_item("covariance", numbers)?;
        hypothesis.set_item("symmetry", symmetry)?;
        Ok(hypothesis)
    }
}

fn to_pose<'py>(py: Python<'py>, pose: &Pose) -> PyResult<Bound<'py, PyDict>> {
    let given = PyDict::new(py);
    given.set_item("position", pose.translation.to_array())?;
    given.set_item("orientation", pose.rotation.to_array())?;
    Ok(given)
}

fn to_axis<'py>(
    py: Python<'py>,
    axis: &SymmetryAxis,
    session_from_object: &Pose,
) -> PyResult<Bound<'py, PyDict>> {
    let given = PyDict::new(py);
    given.set_item("point", (*session_from_object * axis.point).to_array())?;
    given.set_item("direction", session_from_object.turn(axis.direction).to_array())?;
    let order = match axis.order {
        AxisOrder::Finite(order) => Some(order),
        AxisOrder::Continuous => None,
    };
    given.set_item("order", order)?;
    Ok(given)
}

fn looseness(argument: &str, (position, angle): (f64, f64)) -> PyResult<Looseness> {
    let above = |found: f64, max: f64, unit: &str| {
        let detail = format!("came {found}, expected {unit} above 0, at most {max}");
        if found > 0.0 && found <= max { Ok(found) } else { Err(fault::of(argument, detail)) }
    };
    Ok(Looseness {
        position: above(position, 0.1, "metres")?,
        angle: above(angle, 1.0, "radians")?,
    })
}
