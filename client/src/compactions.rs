//! Compaction of the server's database.

use palpate_schemas::Compacted;

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;

impl Client {
    /// Frees the disk space of removed and replaced records.
    ///
    /// # Errors
    /// [`Error`]; status 503 if the compacted copy would not fit on the disk.
    pub async fn compact(&self) -> Result<Compacted, Error> {
        self.send(Request::post(["v1", "compactions"])).await
    }
}
