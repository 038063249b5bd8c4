//! Catalogues, versions and training jobs.

use palpate_schemas::{
    AppearanceReport, Catalogue, CataloguePage, CatalogueVersion, CatalogueVersionPage,
    CurrentVersion, Job, JobPage, LabelledQuery, ObjectMap, PageQuery, RecalibrateCatalogue,
    SetCurrent, ShadowVersion, StartTraining,
};
use uuid::Uuid;

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;
use crate::retry::Repeat;

impl Client {
    /// Starts a comparison of a version with another one on ended sessions.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn shadow_version(
        &self,
        catalogue: &str,
        version: u32,
        request: &ShadowVersion,
    ) -> Result<Job, Error> {
        let version = version.to_string();
        let path = ["v1", "catalogues", catalogue, "versions", &version, "shadow"];
        self.send(Request::post(path).json(request)).await
    }

    /// Returns a page of the catalogues.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn catalogues(&self, query: &LabelledQuery) -> Result<CataloguePage, Error> {
        self.send(Request::get(["v1", "catalogues"]).labelled(query)).await
    }

    /// Returns a catalogue.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn catalogue(&self, name: &str) -> Result<Catalogue, Error> {
        self.send(Request::get(["v1", "catalogues", name])).await
    }

    /// Deletes a catalogue with all its versions.
    ///
    /// # Errors
    /// [`Error`]; status 409 while something uses it.
    pub async fn delete_catalogue(&self, name: &str) -> Result<(), Error> {
        self.send_for_nothing(Request::delete(["v1", "catalogues", name])).await
    }

    /// Deletes a version.
    ///
    /// # Errors
    /// [`Error`]; status 409 while something uses it.
    pub async fn delete_version(&self, name: &str, version: u32) -> Result<(), Error> {
        let version = version.to_string();
        let path = ["v1", "catalogues", name, "versions", &version];
        self.send_for_nothing(Request::delete(path)).await
    }

    /// Returns a page of a catalogue's versions.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn catalogue_versions(
        &self,
        name: &str,
        page: &PageQuery,
    ) -> Result<CatalogueVersionPage, Error> {
        self.send(Request::get(["v1", "catalogues", name, "versions"]).page(page)).await
    }

    /// Returns a version of a catalogue, with its report.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn catalogue_version(
        &self,
        name: &str,
        version: u32,
    ) -> Result<CatalogueVersion, Error> {
        let version = version.to_string();
        self.send(Request::get(["v1", "catalogues", name, "versions", &version])).await
    }

    /// Returns the appearance report of a version.
    ///
    /// # Errors
    /// [`Error`]; status 409 if the version was trained without appearance.
    pub async fn appearance_report(
        &self,
        name: &str,
        version: u32,
    ) -> Result<AppearanceReport, Error> {
        let version = version.to_string();
        let path = ["v1", "catalogues", name, "versions", &version, "report", "appearance"];
        self.send(Request::get(path)).await
    }

    /// Returns the trained map of an object of a version, with a page of its patches. `object` is
    /// its id, or its name when it was trained.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn object_map(
        &self,
        name: &str,
        version: u32,
        object: &str,
        page: &PageQuery,
    ) -> Result<ObjectMap, Error> {
        let version = version.to_string();
        let path = ["v1", "catalogues", name, "versions", &version, "objects", object, "map"];
        self.send(Request::get(path).page(page)).await
    }

    /// Returns the version that new sessions use.
    ///
    /// # Errors
    /// [`Error`]; status 409 if there is none.
    pub async fn current_version(&self, name: &str) -> Result<CurrentVersion, Error> {
        self.send(Request::get(["v1", "catalogues", name, "current"])).await
    }

    /// Makes a version current if the current one still has `revision`.
    ///
    /// # Errors
    /// [`Error`]; status 412 if it has changed meanwhile.
    pub async fn set_current_version(
        &self,
        name: &str,
        version: u32,
        revision: u32,
    ) -> Result<CurrentVersion, Error> {
        let request = Request::put(["v1", "catalogues", name, "current"])
            .header("if-match", format!("\"{revision}\""))
            .json(&SetCurrent { version })
            // A retry after an unnoticed success would find another revision.
            .repeat(Repeat::Harmful);
        self.send(request).await
    }

    /// Starts a training and returns its job.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn start_training(
        &self,
        catalogue: &str,
        training: &StartTraining,
    ) -> Result<Job, Error> {
        let request = Request::post(["v1", "catalogues", catalogue, "trainings"]).json(training);
        self.send(request).await
    }

    /// Starts a recalibration from ended sessions, and returns its job.
    ///
    /// # Errors
    /// [`Error`]; status 409 if too few sessions tell what they touched.
    pub async fn recalibrate(
        &self,
        catalogue: &str,
        recalibration: &RecalibrateCatalogue,
    ) -> Result<Job, Error> {
        let path = ["v1", "catalogues", catalogue, "calibrations"];
        self.send(Request::post(path).json(recalibration)).await
    }

    /// Returns a page of the jobs.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn jobs(&self, page: &PageQuery) -> Result<JobPage, Error> {
        self.send(Request::get(["v1", "jobs"]).page(page)).await
    }

    /// Returns a job.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn job(&self, id: Uuid) -> Result<Job, Error> {
        self.send(Request::get(["v1", "jobs", &id.to_string()])).await
    }

    /// Cancels a job, which ends shortly after.
    ///
    /// # Errors
    /// [`Error`]; status 409 if it has already ended.
    pub async fn cancel_job(&self, id: Uuid) -> Result<Job, Error> {
        self.send(Request::post(["v1", "jobs", &id.to_string(), "cancel"])).await
    }

    /// Deletes an ended job. The version it created stays.
    ///
    /// # Errors
    /// [`Error`]; status 409 while it waits or runs.
    pub async fn delete_job(&self, id: Uuid) -> Result<(), Error> {
        self.send_for_nothing(Request::delete(["v1", "jobs", &id.to_string()])).await
    }
}
