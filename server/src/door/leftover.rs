//! Bodies of requests that are not read to their end, or end in the middle.
//!
//! An answer may be sent before the request's body has arrived.
//! Closing a connection with unread bytes resets it, and the client may lose the answer in
//! its own buffer; a client that keeps the connection sends its next request into one that is
//! about to close. So such an answer announces the end of the connection, and arriving bytes
//! are read and discarded for a while (RFC 9112, section 9.6).

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use axum::BoxError;
use axum::body::Bytes;
use hyper::body::{Body, Frame, Incoming, SizeHint};

use super::pace::Pace;

/// The body of a request, which notifies the connection if it is not read to its end.
pub(super) struct Asked {
    body: Incoming,
    has_ended: bool,
    pace: Arc<Pace>,
}

impl Asked {
    pub(super) fn new(body: Incoming, pace: Arc<Pace>) -> Self {
        Self { body, has_ended: false, pace }
    }
}

impl Body for Asked {
    type Data = Bytes;
    type Error = BoxError;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, BoxError>>> {
        let polled = Pin::new(&mut self.body).poll_frame(context);
        self.has_ended |= matches!(polled, Poll::Ready(None));
        if self.has_ended || self.body.is_end_stream() {
            self.pace.arrived();
        } else if polled.is_pending() && self.pace.has_ended() {
            // All that came has been read.
            return Poll::Ready(Some(Err("the connection ended in the middle of the body".into())));
        }
        polled.map_err(Into::into)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

impl Drop for Asked {
    fn drop(&mut self) {
        if !self.has_ended && !self.body.is_end_stream() {
            self.pace.leave_unread();
        }
    }
}
