//! Commissioning of sensors: touches of a known object, findings, and the passport if it is applied.
//!
//! Touches are taken after the response lines of the sensor's newest calibration and before any
//! passport, so that a new passport replaces the old one.

use std::sync::Arc;

use palpate_commissioning::commission::{Findings, RESIDUAL_MAX, Setup, commission};
use palpate_commissioning::passport::passport;
use palpate_core::sensor::Passport;
use palpate_schemas as wire;
use palpate_sim::mesh::Mesh;
use palpate_sim::press::PressSimulator;
use palpate_sim::shapes;
use palpate_store::calibration::StoredPassport;
use palpate_store::database::Database;
use palpate_store::entity::{Object, Sensor};

use crate::asker::Asker;
use crate::cause::Cause;
use crate::clock::now_ms;
use crate::compute::{ComputeError, Pool};
use crate::services::objects::Objects;
use crate::services::sensors::Sensors;
use crate::wire::commissioning::{self as convert, Answered, Touches};
use crate::wire::object::{read_format, unit_metres};
use crate::wire::{Invalid, count};

/// Commissioning.
pub(crate) struct Commissionings {
    store: Database,
    sensors: Arc<Sensors>,
    objects: Arc<Objects>,
    pool: Pool,
}

/// The touched thing.
enum Touched {
    Object(Object),
    Body(wire::ReferenceBodyName),
}

impl Touched {
    fn name(&self) -> String {
        match self {
            Self::Object(object) => object.name.clone(),
            Self::Body(body) => body.name().to_owned(),
        }
    }

    /// The mesh, metres.
    fn mesh(&self, store: &Database) -> Result<Mesh, Cause> {
        let object = match self {
            Self::Object(object) => object,
            Self::Body(body) => return Ok(reference_body(*body)),
        };
        let (info, file) = store.meshes().get(object.id)?.ok_or_else(|| {
            let detail = format!("{:?} has no mesh, expected an object with one", object.name);
            Cause::field("/object", detail)
        })?;
        Mesh::from_bytes(read_format(info.format), &file, unit_metres(info.unit))
            .map_err(|error| Cause::field("/object", error))
    }
}

impl Commissionings {
    pub(crate) fn new(
        store: Database,
        sensors: Arc<Sensors>,
        objects: Arc<Objects>,
        pool: Pool,
    ) -> Self {
        Self { store, sensors, objects, pool }
    }

    /// Finds what holds for a sensor, and applies it if asked to.
    pub(crate) async fn commission(
        &self,
        sensor: &Arc<Sensor>,
        request: wire::CommissionSensor,
    ) -> Result<wire::Commissioning, Cause> {
        let place = self.pool.place()?;
        let touched = self.touched(&request)?;
        let applied = self.sensors.known().newest(sensor.id)?;
        let correction = applied.as_ref().map(|applied| &*applied.correction);
        let touches = convert::touches(&request, &sensor.description, correction)?;
        let (store, stop) = (self.store.clone(), Asker::current().overdue().clone());
        let described = sensor.description.clone();
        let work = move || -> Result<(Touched, Touches, Findings), Cause> {
            let object = PressSimulator::new(touched.mesh(&store)?, described);
            let setup = Setup {
                object: &object,
                session_from_object: touches.session_from_object,
                touches: &touches.sent,
                seed: touches.seed,
                stop: &stop,
            };
            let findings = commission(&setup).map_err(|error| {
                convert::refused(error).map_or(ComputeError::Stopped.into(), Cause::from)
            })?;
            Ok((touched, touches, findings))
        };
        let (touched, touches, findings) = place.run_long(work).await??;
        let passport = passport(&findings, &sensor.description);
        let calibration = if request.apply {
            usable(&findings, &passport, sensor)?;
            let stored = stored(&touched, &findings, &passport, sensor);
            Some(self.sensors.calibrations().apply(sensor, stored).await?)
        } else {
            None
        };
        Ok(convert::commissioning(Answered {
            sensor,
            touched: touched.name(),
            touches: &touches,
            findings: &findings,
            passport: &passport,
            calibration,
        }))
    }

    fn touched(&self, request: &wire::CommissionSensor) -> Result<Touched, Cause> {
        match (&request.object, request.reference_body) {
            (Some(object), None) => match self.objects.find(object) {
                Ok(object) => Ok(Touched::Object(object)),
                Err(Cause::NotFound { .. }) => {
                    let detail = format!("there is no object {object:?}, expected an id or a name");
                    Err(Cause::field("/object", detail))
                }
                Err(other) => Err(other),
            },
            (None, Some(body)) => Ok(Touched::Body(body)),
            (Some(_), Some(_)) | (None, None) => {
                let detail = "expected exactly one of `object` and `reference_body`";
                Err(Cause::field("/object", detail))
            }
        }
    }

    /// The reference bodies.
    pub(crate) fn bodies() -> wire::ReferenceBodies {
        let body = |name| {
            let mesh = reference_body(name);
            convert::reference_body(name, mesh.extent().to_array(), mesh.triangles().len())
        };
        let items = wire::ReferenceBodyName::ALL.map(body).to_vec();
        wire::ReferenceBodies { items }
    }

    /// The mesh of a reference body as a binary STL, in millimetres.
    pub(crate) fn body_file(name: &str) -> Result<Vec<u8>, Cause> {
        let known = wire::ReferenceBodyName::ALL.into_iter().find(|known| known.name() == name);
        let body = known.ok_or_else(|| Cause::unknown("reference body", name))?;
        let mesh = reference_body(body);
        let millimetres = 1e3 * mesh.largest_dimension();
        Ok(mesh.scaled_to_largest_dimension(millimetres).to_stl_bytes())
    }
}

/// The mesh of a reference body, metres.
fn reference_body(body: wire::ReferenceBodyName) -> Mesh {
    shapes::reference_body(&format!("reference_{}", body.name()))
        .expect("every name on the wire is that of a body")
}

/// Refuses a passport of touches that are not understood.
fn usable(findings: &Findings, passport: &Passport, sensor: &Sensor) -> Result<(), Invalid> {
    let found = findings.residual.1;
    if found > RESIDUAL_MAX {
        let detail = format!(
            "the touches leave a residual of {found:.2}, expected at most {RESIDUAL_MAX}: a passport \
             of touches that are not understood would make readings worse; nothing was stored"
        );
        return Err(Invalid::field("/apply", detail));
    }
    let described = passport.description(&sensor.description);
    described.map_err(|error| Invalid::field("/apply", error))?;
    Ok(())
}

fn stored(
    touched: &Touched,
    findings: &Findings,
    passport: &Passport,
    sensor: &Sensor,
) -> StoredPassport {
    StoredPassport {
        since: 0,
        passport: passport.clone(),
        touched: touched.name(),
        object: match touched {
            Touched::Object(object) => Some(object.id),
            Touched::Body(_) => None,
        },
        n_touches: count(findings.images.len()),
        residual: findings.residual,
        undetermined: convert::undetermined(findings, passport, &sensor.description),
        created_at_ms: now_ms(),
    }
}
