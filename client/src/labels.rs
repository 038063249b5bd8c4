//! Labels of sessions, objects, sensors and catalogues, and aliases of versions.

use palpate_schemas::{Catalogue, Labels, ObjectInfo, Sensor, Session, SetAlias, SetLabels};
use serde::de::DeserializeOwned;
use uuid::Uuid;

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;
use crate::retry::Repeat;

impl Client {
    /// Replaces all labels of a session, also of an ended one.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn set_session_labels(&self, id: Uuid, labels: &Labels) -> Result<Session, Error> {
        self.set_labels("sessions", &id.to_string(), labels).await
    }

    /// Replaces all labels of an object, by id or name.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn set_object_labels(
        &self,
        object: &str,
        labels: &Labels,
    ) -> Result<ObjectInfo, Error> {
        self.set_labels("objects", object, labels).await
    }

    /// Replaces all labels of a sensor, by id or name.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn set_sensor_labels(&self, sensor: &str, labels: &Labels) -> Result<Sensor, Error> {
        self.set_labels("sensors", sensor, labels).await
    }

    /// Replaces all labels of a catalogue.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn set_catalogue_labels(
        &self,
        catalogue: &str,
        labels: &Labels,
    ) -> Result<Catalogue, Error> {
        self.set_labels("catalogues", catalogue, labels).await
    }

    /// Lets an alias, such as `candidate`, name a version of a catalogue.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn set_alias(
        &self,
        catalogue: &str,
        alias: &str,
        version: u32,
    ) -> Result<Catalogue, Error> {
        let request = Request::put(["v1", "catalogues", catalogue, "aliases", alias]);
        self.send(request.json(&SetAlias { version }).repeat(Repeat::Harmless)).await
    }

    /// Removes an alias; the version stays.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn remove_alias(&self, catalogue: &str, alias: &str) -> Result<(), Error> {
        let request = Request::delete(["v1", "catalogues", catalogue, "aliases", alias]);
        self.send_for_nothing(request).await
    }

    async fn set_labels<T: DeserializeOwned>(
        &self,
        kind: &str,
        thing: &str,
        labels: &Labels,
    ) -> Result<T, Error> {
        let asked = SetLabels { labels: labels.clone() };
        let request = Request::put(["v1", kind, thing, "labels"]).json(&asked);
        self.send(request.repeat(Repeat::Harmless)).await
    }
}
