//! What a request leaves unread: an answer may go out before the request's body has come in.
//!
//! Closing a connection on bytes that nobody has read resets it, and the client may lose the
//! answer that lies in its own buffer. And a client that keeps the connection sends its next
//! request into one that is about to close. So such an answer says that the connection ends, and
//! what still comes in is read and forgotten for a while (RFC 9112, section 9.6).

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use axum::body::Bytes;
use hyper::body::{Body, Frame, Incoming, SizeHint};

use super::pace::Pace;

/// The body of a request, which tells the connection if nobody reads it to its end.
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
    type Error = hyper::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, hyper::Error>>> {
        let polled = Pin::new(&mut self.body).poll_frame(context);
        self.has_ended |= matches!(polled, Poll::Ready(None));
        polled
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
