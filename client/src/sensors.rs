//! Sensors and coverings.

use palpate_schemas::{
    AnalyseCoverings, CalibrateSensor, CalibrationQuery, CommissionSensor, Commissioning,
    CoveringAnalysis, CreateSensor, LabelledQuery, Reading, ReadingCheck, ReferenceBodies,
    ReferenceBodyName, Sensor, SensorCalibration, SensorHealth, SensorPage, SensorPassport,
};

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;
use crate::retry::Repeat;

impl Client {
    /// Creates a sensor.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn create_sensor(&self, sensor: &CreateSensor) -> Result<Sensor, Error> {
        self.send(Request::post(["v1", "sensors"]).json(sensor)).await
    }

    /// Returns a page of the sensors.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn sensors(&self, query: &LabelledQuery) -> Result<SensorPage, Error> {
        self.send(Request::get(["v1", "sensors"]).labelled(query)).await
    }

    /// Returns a sensor, by id or name.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn sensor(&self, sensor: &str) -> Result<Sensor, Error> {
        self.send(Request::get(["v1", "sensors", sensor])).await
    }

    /// Deletes a sensor.
    ///
    /// # Errors
    /// [`Error`]; status 409 while something uses it.
    pub async fn delete_sensor(&self, sensor: &str) -> Result<(), Error> {
        self.send_for_nothing(Request::delete(["v1", "sensors", sensor])).await
    }

    /// Returns the server's interpretation of a reading. Nothing is stored.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn check_reading(
        &self,
        sensor: &str,
        reading: &Reading,
    ) -> Result<ReadingCheck, Error> {
        let request = Request::post(["v1", "sensors", sensor, "check"]).json(reading);
        self.send(request.repeat(Repeat::Harmless)).await
    }

    /// Calibrates a sensor. The calibration applies to readings received after it.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn calibrate_sensor(
        &self,
        sensor: &str,
        indentations: &CalibrateSensor,
    ) -> Result<SensorCalibration, Error> {
        self.send(Request::post(["v1", "sensors", sensor, "calibration"]).json(indentations)).await
    }

    /// Returns a calibration of a sensor; the newest if `query` has no number.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn calibration(
        &self,
        sensor: &str,
        query: &CalibrationQuery,
    ) -> Result<SensorCalibration, Error> {
        let request = Request::get(["v1", "sensors", sensor, "calibration"]);
        self.send(request.query("number", query.number)).await
    }

    /// Returns a sensor's health: whether to commission it again, and why.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn sensor_health(&self, sensor: &str) -> Result<SensorHealth, Error> {
        self.send(Request::get(["v1", "sensors", sensor, "health"])).await
    }

    /// Finds what touches of a known object say about a sensor on its robot; with `apply` they become
    /// its passport.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn commission_sensor(
        &self,
        sensor: &str,
        touches: &CommissionSensor,
    ) -> Result<Commissioning, Error> {
        let request = Request::post(["v1", "sensors", sensor, "commissionings"]).json(touches);
        // Applied twice, a passport only gets two numbers.
        self.send(request.repeat(Repeat::Harmless)).await
    }

    /// Returns the passport of a sensor; the newest if `query` has no number.
    ///
    /// # Errors
    /// [`Error`]; status 404 if it has none.
    pub async fn passport(
        &self,
        sensor: &str,
        query: &CalibrationQuery,
    ) -> Result<SensorPassport, Error> {
        let request = Request::get(["v1", "sensors", sensor, "passport"]);
        self.send(request.query("number", query.number)).await
    }

    /// Returns the reference bodies to commission sensors with.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn reference_bodies(&self) -> Result<ReferenceBodies, Error> {
        self.send(Request::get(["v1", "reference-bodies"])).await
    }

    /// Returns the STL file of a reference body, in millimetres.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn reference_mesh(&self, body: ReferenceBodyName) -> Result<Vec<u8>, Error> {
        self.send_for_file(Request::get(["v1", "reference-bodies", body.name(), "mesh"])).await
    }

    /// Compares coverings. Nothing is stored.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn analyse_coverings(
        &self,
        question: &AnalyseCoverings,
    ) -> Result<CoveringAnalysis, Error> {
        let request = Request::post(["v1", "analyses", "covering"]).json(question);
        self.send(request.repeat(Repeat::Harmless)).await
    }
}
