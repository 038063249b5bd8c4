//! Calls about keys: who is let in, and who changed what.

use palpate_schemas::{
    ApiKey, ApiKeyPage, AuditPage, AuditQuery, AuditRing, BindRobot, CreateKey, NewApiKey,
    PageQuery, Robot, RobotPage, RotateKey, Whoami,
};

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;

impl Client {
    /// Whom the server takes this client for.
    ///
    /// # Errors
    /// [`Error`]; status 401 when it is not let in.
    pub async fn whoami(&self) -> Result<Whoami, Error> {
        self.send(Request::get(["v1", "whoami"])).await
    }

    /// A page of the keys.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn keys(&self, page: &PageQuery) -> Result<ApiKeyPage, Error> {
        self.send(Request::get(["v1", "keys"]).page(page)).await
    }

    /// A key, by its id or name.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn key(&self, key: &str) -> Result<ApiKey, Error> {
        self.send(Request::get(["v1", "keys", key])).await
    }

    /// Makes a key; the answer holds its secret, this once.
    ///
    /// # Errors
    /// [`Error`]; status 409 when the name is taken.
    pub async fn create_key(&self, key: &CreateKey) -> Result<NewApiKey, Error> {
        self.send(Request::post(["v1", "keys"]).json(key)).await
    }

    /// Has a key refused from now on.
    ///
    /// # Errors
    /// [`Error`]; status 409 when it is the last admin's.
    pub async fn revoke_key(&self, key: &str) -> Result<(), Error> {
        self.send_for_nothing(Request::delete(["v1", "keys", key])).await
    }

    /// Gives a key a new secret; the answer holds it, this once.
    ///
    /// # Errors
    /// [`Error`]; status 409 when the key is refused already.
    pub async fn rotate_key(&self, key: &str, how: &RotateKey) -> Result<NewApiKey, Error> {
        self.send(Request::post(["v1", "keys", key, "rotate"]).json(how)).await
    }

    /// A page of the names of robots that belong to keys.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn robots(&self, page: &PageQuery) -> Result<RobotPage, Error> {
        self.send(Request::get(["v1", "robots"]).page(page)).await
    }

    /// Gives a robot's name to a key, by the key's id or name.
    ///
    /// # Errors
    /// [`Error`]; status 409 when the key was revoked.
    pub async fn bind_robot(&self, robot: &str, key: &str) -> Result<Robot, Error> {
        let request = BindRobot { key: key.to_owned() };
        self.send(Request::put(["v1", "robots", robot]).json(&request)).await
    }

    /// Releases a robot's name: it belongs to the key that uses it next.
    ///
    /// # Errors
    /// [`Error`]; status 404 when it belongs to no key.
    pub async fn release_robot(&self, robot: &str) -> Result<(), Error> {
        self.send_for_nothing(Request::delete(["v1", "robots", robot])).await
    }

    /// A page of the audit log, newest first.
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
