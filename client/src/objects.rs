//! Objects, their meshes and their training readings.

use bytes::Bytes;
use palpate_schemas::{
    AddTrainingReadings, CreateObject, LabelledQuery, MeshFormat, MeshReport, MeshUnit, ObjectInfo,
    ObjectPage, PageQuery, Reading, StoredReadingPage, TrainingReadingsAdded, UpdateObject,
};

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;
use crate::retry::Repeat;

impl Client {
    /// Creates an object.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn create_object(&self, object: &CreateObject) -> Result<ObjectInfo, Error> {
        self.send(Request::post(["v1", "objects"]).json(object)).await
    }

    /// Returns a page of the objects.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn objects(&self, query: &LabelledQuery) -> Result<ObjectPage, Error> {
        self.send(Request::get(["v1", "objects"]).labelled(query)).await
    }

    /// Returns all objects, page by page.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn all_objects(&self) -> Result<Vec<ObjectInfo>, Error> {
        let query = LabelledQuery { limit: Some(1000), ..LabelledQuery::default() };
        self.objects_that_fit(query).await
    }

    /// Returns all objects that fit a query, page by page from its cursor on.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn objects_that_fit(
        &self,
        mut query: LabelledQuery,
    ) -> Result<Vec<ObjectInfo>, Error> {
        let mut all = Vec::new();
        loop {
            let page = self.objects(&query).await?;
            all.extend(page.items);
            query.cursor = page.next_cursor;
            if query.cursor.is_none() {
                return Ok(all);
            }
        }
    }

    /// Returns an object, by id or name.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn object(&self, object: &str) -> Result<ObjectInfo, Error> {
        self.send(Request::get(["v1", "objects", object])).await
    }

    /// Changes an object's name or description.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn update_object(
        &self,
        object: &str,
        changes: &UpdateObject,
    ) -> Result<ObjectInfo, Error> {
        self.send(Request::patch(["v1", "objects", object]).json(changes)).await
    }

    /// Deletes an object with its mesh and readings. Trained versions still recognise it.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn delete_object(&self, object: &str) -> Result<(), Error> {
        self.send_for_nothing(Request::delete(["v1", "objects", object])).await
    }

    /// Uploads or replaces an object's mesh. GLB and 3MF files need no unit.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn put_mesh(
        &self,
        object: &str,
        format: MeshFormat,
        unit: impl Into<Option<MeshUnit>>,
        file: Bytes,
    ) -> Result<MeshReport, Error> {
        let media_type = match format {
            MeshFormat::Stl => "model/stl",
            MeshFormat::Obj => "model/obj",
            MeshFormat::Ply => "model/ply",
            MeshFormat::Off => "model/off",
            MeshFormat::Glb => "model/gltf-binary",
            MeshFormat::ThreeMf => "model/3mf",
        };
        let request = Request::put(["v1", "objects", object, "mesh"])
            .query("unit", unit.into().map(MeshUnit::name))
            .raw(media_type, file);
        self.send(request).await
    }

    /// Returns the file of an object's mesh, as uploaded.
    ///
    /// # Errors
    /// [`Error`]; status 404 if it has none.
    pub async fn mesh(&self, object: &str) -> Result<Vec<u8>, Error> {
        self.send_for_file(Request::get(["v1", "objects", object, "mesh"])).await
    }

    /// Adds 1 to 1000 training readings of an object. Retried after a lost connection only if every
    /// reading has `robot` and `seq`.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn add_training_readings(
        &self,
        object: &str,
        readings: &AddTrainingReadings,
    ) -> Result<TrainingReadingsAdded, Error> {
        let request = Request::post(["v1", "objects", object, "readings"])
            .json(readings)
            .repeat(repeat_of(&readings.readings));
        self.send(request).await
    }

    /// Returns a page of an object's training readings.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn training_readings(
        &self,
        object: &str,
        page: &PageQuery,
    ) -> Result<StoredReadingPage, Error> {
        self.send(Request::get(["v1", "objects", object, "readings"]).page(page)).await
    }
}

/// Whether readings may be sent twice: only if each has an id.
pub(crate) fn repeat_of(readings: &[Reading]) -> Repeat {
    let numbered = |reading: &Reading| reading.robot.is_some() && reading.seq.is_some();
    if readings.iter().all(numbered) { Repeat::Harmless } else { Repeat::Harmful }
}
