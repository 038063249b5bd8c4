//! API keys, robot names and the audit log.

use palpate_schemas::{
    ApiKey, ApiKeyPage, AuditPage, AuditQuery, AuditRing, BindRobot, CreateKey, NewApiKey,
    PageQuery, Robot, RobotPage, RotateKey, Whoami,
};

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;

impl Client {
    /// Returns the caller's key and role.
    ///
    /// # Errors
    /// [`Error`]; status 401 without a valid key.
    pub async fn whoami(&self) -> Result<Whoami, Error> {
        self.send(Request::get(["v1", "whoami"])).await
    }

    /// Returns a page of the keys.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn keys(&self, page: &PageQuery) -> Result<ApiKeyPage, Error> {
        self.send(Request::get(["v1", "keys"]).page(page)).await
    }

    /// Returns a key, by id or name.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn key(&self, key: &str) -> Result<ApiKey, Error> {
        self.send(Request::get(["v1", "keys", key])).await
    }

    /// Creates a key and returns its secret, once.
    ///
    /// # Errors
    /// [`Error`]; status 409 if the name is taken.
    pub async fn create_key(&self, key: &CreateKey) -> Result<NewApiKey, Error> {
        self.send(Request::post(["v1", "keys"]).json(key)).await
    }

    /// Revokes a key.
    ///
    /// # Errors
    /// [`Error`]; status 409 for the last admin key.
    pub async fn revoke_key(&self, key: &str) -> Result<(), Error> {
        self.send_for_nothing(Request::delete(["v1", "keys", key])).await
    }

    /// Rotates a key's secret and returns the new one, once.
    ///
    /// # Errors
    /// [`Error`]; status 409 if the key was revoked or has expired.
    pub async fn rotate_key(&self, key: &str, how: &RotateKey) -> Result<NewApiKey, Error> {
        self.send(Request::post(["v1", "keys", key, "rotate"]).json(how)).await
    }

    /// Returns a page of the robot names that keys hold.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn robots(&self, page: &PageQuery) -> Result<RobotPage, Error> {
        self.send(Request::get(["v1", "robots"]).page(page)).await
    }

    /// Assigns a robot name to a key, given by id or name.
    ///
    /// # Errors
    /// [`Error`]; status 409 if the key was revoked.
    pub async fn bind_robot(&self, robot: &str, key: &str) -> Result<Robot, Error> {
        let request = BindRobot { key: key.to_owned() };
        self.send(Request::put(["v1", "robots", robot]).json(&request)).await
    }

    /// Releases a robot name; the next key that uses it gets it.
    ///
    /// # Errors
    /// [`Error`]; status 404 if no key holds it.
    pub async fn release_robot(&self, robot: &str) -> Result<(), Error> {
        self.send_for_nothing(Request::delete(["v1", "robots", robot])).await
    }

    /// Returns a page of the audit log, newest first.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn audit(&self, query: &AuditQuery) -> Result<AuditPage, Error> {
        let request = Request::get(["v1", "audit"])
            .query("since", query.since.as_ref())
            .query("until", query.until.as_ref())
            .query("key", query.key.as_ref())
            .query("operation", query.operation.as_ref())
            .query("ring", query.ring.map(ring))
            .query("limit", query.limit)
            .query("cursor", query.cursor.as_ref());
        self.send(request).await
    }
}

fn ring(ring: AuditRing) -> &'static str {
    match ring {
        AuditRing::Changes => "changes",
        AuditRing::Refused => "refused",
        AuditRing::Strangers => "strangers",
    }
}
