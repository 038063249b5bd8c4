//! Compaction: room of the server's disk that is given back.

use palpate_schemas::Compacted;

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;

impl Client {
    /// Gives back the room that removed and replaced records take on the server's disk.
    ///
    /// # Errors
    /// [`Error`]; status 503 when there is no room for its copy.
    pub async fn compact(&self) -> Result<Compacted, Error> {
        self.send(Request::post(["v1", "compactions"])).await
    }
}
