//! Plans of trainings: the request is checked on arrival, and its names are looked up at its turn.

use palpate_recogniser::train::mesh_touches;
use palpate_schemas::{SensorKnowledge, StartTraining};
use palpate_store::catalogue::{Manifest, VersionObject};
use palpate_store::entity::{Object, Sensor};
use palpate_store::error::StoreError;
use palpate_store::journal::Event;
use uuid::Uuid;

use super::Jobs;
use super::error::JobError;
use crate::cause::Cause;
use crate::limits::megabytes;
use crate::services::training::{AppearancePlan, Base, Load, Plan, TrainingFailure, memory_bytes};
use crate::wire as convert;
use crate::wire::training::VersionParameters;

impl Jobs {
    /// A request with every default filled in and every name looked up.
    pub(super) fn checked(
        &self,
        catalogue: &str,
        request: &StartTraining,
    ) -> Result<StartTraining, JobError> {
        let base = request.extend.map(|version| self.base_of(catalogue, version)).transpose()?;
        let mut training = match &base {
            None => convert::training::training(request)?,
            Some((manifest, base)) => {
                convert::training::extension(request, manifest.version, base)?
            }
        };
        let sensor = training.sensor.clone().unwrap_or_default();
        let sensor = self.sensors.find_to_use(&sensor)?.ok_or_else(|| {
            Cause::field(
                "/sensor",
                format!("there is no sensor {sensor:?}, expected an id or a name"),
            )
        })?;
        training.sensor = Some(sensor.id.to_string());
        let passport = self.sensors.known().newest(sensor.id).map_err(Cause::from)?;
        let passport = passport.and_then(|applied| applied.passport);
        if passport.is_none() && training.sensor_knowledge == Some(SensorKnowledge::Commissioned) {
            let detail = format!(
                "came `commissioned`, but the sensor {:?} has no passport: commission it first",
                sensor.name
            );
            return Err(Cause::field("/sensor_knowledge", detail).into());
        }
        let kept = self.kept(catalogue, &sensor)?.map(|(_, level)| level);
        let stated = kept.unwrap_or(convert::coupling::knowledge(sensor.knowledge));
        let by_default = passport.map_or(stated, |_| SensorKnowledge::Commissioned);
        training.sensor_knowledge = Some(training.sensor_knowledge.unwrap_or(by_default));
        let known = base.map_or(Vec::new(), |(manifest, _)| manifest.objects);
        let objects = self.objects_of(&training, &known)?;
        training.objects = Some(objects.iter().map(|object| object.id.to_string()).collect());
        self.weigh(request, &training, objects.iter().map(|object| object.id))?;
        Ok(training)
    }

    /// The current version whose meshes the sensor pressed, and its level of knowledge, which a
    /// training anew keeps unless it states its own or there is a passport.
    fn kept(
        &self,
        catalogue: &str,
        sensor: &Sensor,
    ) -> Result<Option<(u32, SensorKnowledge)>, Cause> {
        let Some((version, known)) = self.catalogues.current_of(catalogue)? else {
            return Ok(None);
        };
        let VersionParameters { training, report, .. } = known;
        let pressed = match (report.sensor_knowledge, training.sensor_knowledge) {
            // Trained before there was a choice.
            (None, None) => Some(SensorKnowledge::Measured),
            (pressed, _) => pressed,
        };
        let is_same = training.sensor.is_some_and(|id| id == sensor.id.to_string());
        let level = pressed.filter(|level| is_same && *level != SensorKnowledge::Commissioned);
        Ok(level.map(|level| (version, level)))
    }

    /// Refuses a checked training that would take more memory than one may; the refusal names the
    /// largest factor that `request` states.
    fn weigh(
        &self,
        request: &StartTraining,
        training: &StartTraining,
        objects: impl Iterator<Item = Uuid>,
    ) -> Result<(), Cause> {
        let asked = (training.readings_per_object, training.surface_readings_per_object);
        let [n, n_of_surface] = mesh_touches(asked.0, asked.1).map(u64::from);
        let is_for_surface = training.surface.unwrap_or(false) && n_of_surface > n;
        let n_touches = if is_for_surface { n_of_surface } else { n };
        let n_taxels = |sensor: &Sensor| sensor.description.grid().n_taxels() as u64;
        let sensor = self.sensors.get(training.sensor.as_deref().unwrap_or_default())?;
        let touched = Load { n_readings: n_touches, n_values: n_taxels(&sensor) };
        let mut loads = Vec::new();
        for object in objects {
            let journal = self.store.training();
            let first = journal.entry(object, 0)?.map(|entry| entry.event);
            loads.push(match first {
                Some(Event::Reading(first)) => {
                    let sensor = self.sensors.get(&first.sensor.to_string())?;
                    // The features of an object are equally long.
                    let n_features = first.feature.map_or(0, |feature| feature.len() as u64);
                    let n_values = n_taxels(&sensor) + n_features;
                    Load { n_readings: journal.len(object)?, n_values }
                }
                _ => touched,
            });
        }
        let (bytes, max) = (memory_bytes(&loads, self.training_threads), self.memory_max);
        if bytes <= max {
            return Ok(());
        }
        let (of_all, of_surface) =
            (request.readings_per_object, request.surface_readings_per_object);
        let field = match is_for_surface {
            _ if !loads.contains(&touched) => "/objects",
            true if of_surface.is_some() => "/surface_readings_per_object",
            false if of_all.is_some() => "/readings_per_object",
            _ => "/objects",
        };
        let (n_objects, has, max) = (loads.len(), megabytes(bytes), megabytes(max));
        let detail = format!(
            "{n_objects} objects with these readings, taxels and features would take about {has} of \
             memory, expected at most {max}: train fewer readings, or fewer objects at a time \
             (`extend`), or start the server with `--training-memory-mb`"
        );
        Err(Cause::field(field, detail))
    }

    /// The version to extend, and its training parameters.
    fn base_of(&self, catalogue: &str, version: u32) -> Result<(Manifest, StartTraining), Cause> {
        let found = self.catalogues.manifest_of(catalogue, version);
        let (manifest, parameters) = found.map_err(|error| Cause::field("/extend", error))?;
        Ok((manifest, parameters.training))
    }

    /// The plan of a checked training.
    pub(super) async fn plan(
        &self,
        catalogue: &str,
        training: &StartTraining,
    ) -> Result<Plan, TrainingFailure> {
        let references = training.objects.as_deref().unwrap_or_default();
        let objects: Result<Vec<VersionObject>, Cause> = references
            .iter()
            .map(|reference| {
                let object = self.objects.find(reference)?;
                Ok(VersionObject { id: object.id, name: object.name })
            })
            .collect();
        let objects = objects?;
        // Readings may have been added since the request.
        self.weigh(training, training, objects.iter().map(|object| object.id))?;
        let base = match training.extend {
            None => None,
            Some(version) => {
                let (manifest, parameters) = self.catalogues.manifest_of(catalogue, version)?;
                let model = self.catalogues.whole(manifest.catalogue, version).await?;
                Some(Base { model, reports: parameters.report.objects })
            }
        };
        let appearance = training.appearance.as_ref().map(|settings| AppearancePlan {
            config: convert::appearance::config(settings),
            source: settings.source.unwrap_or_default(),
        });
        let knowledge = convert::training::stated_knowledge(training);
        let sensor = self.sensors.get(training.sensor.as_deref().unwrap_or_default())?;
        let of_sensor = convert::coupling::knowledge(sensor.knowledge);
        let before = match training.extend {
            Some(version) => Some((version, knowledge)),
            None => self.kept(catalogue, &sensor)?,
        };
        let kept_from = before
            .filter(|(_, level)| *level == knowledge && knowledge != of_sensor)
            .filter(|(_, level)| *level != SensorKnowledge::Commissioned)
            .map(|(version, _)| version);
        let sensor = match knowledge {
            SensorKnowledge::Commissioned => self.sensors.known().interpreted(sensor)?,
            SensorKnowledge::Measured | SensorKnowledge::DataSheet | SensorKnowledge::Unknown => {
                sensor
            }
        };
        let asked = (training.readings_per_object, training.surface_readings_per_object);
        let touches = mesh_touches(asked.0, asked.1).map(|n| n as usize);
        let [readings_per_object, surface_readings_per_object] = touches;
        Ok(Plan {
            objects,
            sensor,
            knowledge,
            kept_from,
            readings_per_object,
            surface_readings_per_object,
            seed: training.seed.unwrap_or(1),
            config: convert::training::config(training)?,
            geometric: training.geometric.as_ref().map(convert::geometry::config),
            appearance,
            sva: training.sva.unwrap_or(true),
            surface: training.surface.unwrap_or(false),
            base,
            strict: training.strict.unwrap_or(false),
        })
    }

    /// The objects of a training that have training data. Without names those that are not
    /// `known` already.
    fn objects_of(
        &self,
        training: &StartTraining,
        known: &[VersionObject],
    ) -> Result<Vec<Object>, JobError> {
        let Some(references) = &training.objects else {
            let mut objects = Vec::new();
            for object in self.store.objects().all()? {
                let is_known = known.iter().any(|known| known.id == object.id);
                if !is_known && self.has_data(&object)? {
                    objects.push(object);
                }
            }
            if objects.is_empty() {
                let new = if known.is_empty() { "" } else { "new " };
                let detail = format!("no {new}object has data: upload a mesh or readings first");
                return Err(Cause::field("/objects", detail).into());
            }
            return Ok(objects);
        };
        if references.is_empty() {
            return Err(Cause::field("/objects", "came empty, expected at least one object").into());
        }
        let mut objects: Vec<Object> = Vec::with_capacity(references.len());
        for (index, reference) in references.iter().enumerate() {
            let at = format!("/objects/{index}");
            let object = match self.objects.find(reference) {
                Err(missing @ Cause::NotFound { .. }) => {
                    return Err(Cause::field(at, missing).into());
                }
                other => other?,
            };
            if objects.iter().any(|known| known.id == object.id) {
                let detail = format!("object {:?} is named twice", object.name);
                return Err(Cause::field(at, detail).into());
            }
            if !self.has_data(&object)? {
                let detail = format!(
                    "object {:?} has no data: upload a mesh or readings first",
                    object.name
                );
                return Err(Cause::field(at, detail).into());
            }
            objects.push(object);
        }
        Ok(objects)
    }

    fn has_data(&self, object: &Object) -> Result<bool, StoreError> {
        Ok(self.store.training().len(object.id)? > 0
            || self.store.meshes().info(object.id)?.is_some())
    }
}
