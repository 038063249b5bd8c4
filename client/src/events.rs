//! Event streams of jobs and sessions.

use std::marker::PhantomData;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use bytes::Bytes;
use eventsource_stream::{EventStreamError, Eventsource};
use futures::stream::BoxStream;
use futures::{Stream, StreamExt};
use palpate_schemas::{Job, SessionEvent};
use serde::de::DeserializeOwned;
use uuid::Uuid;

use crate::client::Client;
use crate::error::Error;
use crate::request::Request;

/// Pause before a job's event stream is reopened.
const REOPEN_PAUSE: Duration = Duration::from_millis(200);

/// Silence of a stream after which the job itself is requested.
const SILENCE_MAX: Duration = Duration::from_secs(30);

/// An event stream. It ends when the server ends it.
pub struct Events<T> {
    url: String,
    events: BoxStream<'static, Result<eventsource_stream::Event, EventStreamError<reqwest::Error>>>,
    last_id: String,
    kind: PhantomData<fn() -> T>,
}

impl<T> Events<T> {
    /// Id of the last event, to resume after it.
    #[must_use]
    pub fn last_id(&self) -> &str {
        &self.last_id
    }
}

impl<T: DeserializeOwned> Stream for Events<T> {
    type Item = Result<T, Error>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        loop {
            let event = match self.events.poll_next_unpin(context) {
                Poll::Pending => return Poll::Pending,
                Poll::Ready(None) => return Poll::Ready(None),
                Poll::Ready(Some(event)) => event,
            };
            let url = self.url.clone();
            let event = match event {
                Ok(event) => event,
                Err(EventStreamError::Transport(source)) => {
                    return Poll::Ready(Some(Err(Error::Broken { url, source })));
                }
                Err(error) => {
                    let detail = error.to_string();
                    return Poll::Ready(Some(Err(Error::Event { url, detail })));
                }
            };
            self.last_id.clone_from(&event.id);
            // Comments and keep-alives carry no data.
            if event.data.is_empty() {
                continue;
            }
            let parsed = serde_json::from_str(&event.data);
            return Poll::Ready(Some(parsed.map_err(|source| Error::Unexpected { url, source })));
        }
    }
}

impl Client {
    /// Streams the states of a job; the last one is final.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn job_events(&self, id: Uuid) -> Result<Events<Job>, Error> {
        self.events(Request::get(["v1", "jobs", &id.to_string(), "events"]), None).await
    }

    /// Streams the events of a session. `last_id` resumes after an event.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn session_events(
        &self,
        id: Uuid,
        last_id: Option<&str>,
    ) -> Result<Events<SessionEvent>, Error> {
        let request = Request::get(["v1", "sessions", &id.to_string(), "events"]);
        self.events(request, last_id).await
    }

    /// Streams the events of 1 to 100 sessions.
    ///
    /// # Errors
    /// [`Error`].
    pub async fn events_of_sessions(&self, ids: &[Uuid]) -> Result<Events<SessionEvent>, Error> {
        let ids: Vec<String> = ids.iter().map(Uuid::to_string).collect();
        let request = Request::get(["v1", "events"]).query("sessions", Some(ids.join(",")));
        self.events(request, None).await
    }

    /// Follows a job to its end and calls `progress` at each change.
    ///
    /// Reopens a broken stream; gives up only if the job itself cannot be read.
    ///
    /// # Errors
    /// [`Error`]. A failed or cancelled job is not an error here.
    pub async fn follow_job(&self, id: Uuid, mut progress: impl FnMut(&Job)) -> Result<Job, Error> {
        loop {
            // A stream that cannot be opened or breaks is no reason to give up: the job itself
            // is asked for below, and then the stream again.
            if let Ok(mut events) = self.job_events(id).await {
                while let Ok(Some(Ok(job))) = tokio::time::timeout(SILENCE_MAX, events.next()).await
                {
                    progress(&job);
                    if job.state.is_final() {
                        return Ok(job);
                    }
                }
            }
            let job = self.job(id).await?;
            progress(&job);
            if job.state.is_final() {
                return Ok(job);
            }
            tokio::time::sleep(REOPEN_PAUSE).await;
        }
    }

    async fn events<T>(&self, request: Request, last_id: Option<&str>) -> Result<Events<T>, Error> {
        let url = self.url(&request).to_string();
        let request = match last_id {
            Some(id) => request.header("last-event-id", id.to_owned()),
            None => request,
        };
        let answer = self.open_events(&request).await?;
        let bytes: BoxStream<'static, Result<Bytes, reqwest::Error>> =
            answer.bytes_stream().boxed();
        let last_id = last_id.unwrap_or_default().to_owned();
        Ok(Events { url, events: bytes.eventsource().boxed(), last_id, kind: PhantomData })
    }
}
