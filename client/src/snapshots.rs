//! Snapshots: everything a server has stored, as a stream of bytes.

use bytes::Bytes;
use futures::stream::BoxStream;
use futures::{StreamExt, TryStreamExt};

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;

impl Client {
    /// Takes a snapshot and streams its bytes. It is complete when the stream ends without an error
    /// and `palpate snapshot verify` accepts it.
    ///
    /// # Errors
    /// [`Error`]; status 503 while the maximum number of snapshots is in progress.
    pub async fn snapshot(&self) -> Result<BoxStream<'static, Result<Bytes, Error>>, Error> {
        let request = Request::post(["v1", "snapshots"]);
        let url = self.url(&request).to_string();
        let answer = self.open_file(&request).await?;
        let broken = move |source| Error::Broken { url: url.clone(), source };
        Ok(answer.bytes_stream().map_err(broken).boxed())
    }
}
