//! Members: the servers that divide the objects of catalogues.

use palpate_schemas::Members;

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;

impl Client {
    /// The servers that divide the objects of catalogues, as the one that answers knows them.
    ///
    /// # Errors
    /// [`Error`] of the request.
    pub async fn members(&self) -> Result<Members, Error> {
        self.send(Request::get(["v1", "members"])).await
    }
}
