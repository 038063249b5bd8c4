//! Calls about catalogues, their versions, and the jobs that train them.

use palpate_schemas::{
    AppearanceReport, Catalogue, CataloguePage, CatalogueVersion, CatalogueVersionPage,
    CurrentVersion, Job, JobPage, ObjectMap, PageQuery, SetCurrent, StartTraining,
};
use uuid::Uuid;

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;
use crate::retry::Repeat;

impl Client {
    /// A page of the catalogues.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn catalogues(&self, page: &PageQuery) -> Result<CataloguePage, Error> {
        self.send(Request::get(["v1", "catalogues"]).page(page)).await
    }

    /// A catalogue.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn catalogue(&self, name: &str) -> Result<Catalogue, Error> {
        self.send(Request::get(["v1", "catalogues", name])).await
    }

    /// Deletes a catalogue that nothing needs, with all its versions.
    ///
    /// # Errors
    /// [`Error`]; status 409 while something needs it.
    pub async fn delete_catalogue(&self, name: &str) -> Result<(), Error> {
        self.send_for_nothing(Request::delete(["v1", "catalogues", name])).await
    }

    /// Deletes a version that nothing needs.
    ///
    /// # Errors
    /// [`Error`]; status 409 while something needs it.
    pub async fn delete_version(&self, name: &str, version: u32) -> Result<(), Error> {
        let version = version.to_string();
        let path = ["v1", "catalogues", name, "versions", &version];
        self.send_for_nothing(Request::delete(path)).await
    }

    /// A page of a catalogue's versions.
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

    /// A version of a catalogue, with its report.
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

    /// What held-back readings say of a version's appearance.
    ///
    /// # Errors
    /// [`Error`]; status 409 when the version was trained without appearance.
    pub async fn appearance_report(
        &self,
        name: &str,
        version: u32,
    ) -> Result<AppearanceReport, Error> {
        let version = version.to_string();
        let path = ["v1", "catalogues", name, "versions", &version, "report", "appearance"];
        self.send(Request::get(path)).await
    }

    /// The trained map of one object of a version, with a page of its patches. `object` is
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

    /// Which version of a catalogue new sessions use.
    ///
    /// # Errors
    /// [`Error`]; status 409 while there is none.
    pub async fn current_version(&self, name: &str) -> Result<CurrentVersion, Error> {
        self.send(Request::get(["v1", "catalogues", name, "current"])).await
    }

    /// Makes a version the one that new sessions use, if the current one is still of
    /// `revision`.
    ///
    /// # Errors
    /// [`Error`]; status 412 when somebody has switched in between.
    pub async fn set_current_version(
        &self,
        name: &str,
        version: u32,
        revision: u32,
    ) -> Result<CurrentVersion, Error> {
        let request = Request::put(["v1", "catalogues", name, "current"])
            .header("if-match", format!("\"{revision}\""))
            .json(&SetCurrent { version })
            // A second attempt after a success would find another revision.
            .repeat(Repeat::Harmful);
        self.send(request).await
    }

    /// Asks for a training; the answer is the job that does it.
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

    /// A page of the jobs.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn jobs(&self, page: &PageQuery) -> Result<JobPage, Error> {
        self.send(Request::get(["v1", "jobs"]).page(page)).await
    }

    /// A job.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn job(&self, id: Uuid) -> Result<Job, Error> {
        self.send(Request::get(["v1", "jobs", &id.to_string()])).await
    }

    /// Asks a job to stop; it does so shortly.
    ///
    /// # Errors
    /// [`Error`]; status 409 when it has ended.
    pub async fn cancel_job(&self, id: Uuid) -> Result<Job, Error> {
        self.send(Request::post(["v1", "jobs", &id.to_string(), "cancel"])).await
    }
}
