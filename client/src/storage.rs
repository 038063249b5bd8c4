//! Storage: how many bytes are stored, by which key, and what takes most of the room.

use palpate_schemas::Storage;

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;

impl Client {
    /// Returns the stored bytes per key, and the things that take most.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn storage(&self) -> Result<Storage, Error> {
        self.send(Request::get(["v1", "storage"])).await
    }
}
