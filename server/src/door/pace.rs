//! Deadlines of a connection: for unfinished headers and for unread answers.
//!
//! The state of a connection is known on two sides: bytes pass through [`Paced`], requests
//! and answers through [`Pace::request`] and [`Served`]. Both share one [`Pace`].

use std::io;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, ready};

use axum::body::{Body, Bytes, HttpBody};
use hyper::body::{Frame, SizeHint};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep, sleep_until};

use super::Patience;

/// Number of bytes of an unread body that are discarded at a time.
const LEFTOVER_BLOCK: usize = 8 << 10;

/// The event that a connection waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The rest of a request's headers, until this time.
    Headers(Instant),
    /// The first byte of a request.
    Idle,
    /// The server's answer.
    Request,
}

/// The pace of one connection.
#[derive(Debug)]
pub(super) struct Pace {
    patience: Patience,
    phase: Mutex<Phase>,
    /// Whether a request's body was not read to its end.
    is_unread: AtomicBool,
}

/// A request under way; dropped with the last byte of its answer's body.
#[derive(Debug)]
pub(super) struct RequestUnderWay(Arc<Pace>);

impl Pace {
    pub(super) fn new(patience: Patience) -> Arc<Self> {
        let phase = Phase::Headers(Instant::now() + patience.headers);
        Arc::new(Self { patience, phase: Mutex::new(phase), is_unread: AtomicBool::new(false) })
    }

    /// Registers complete headers of a request.
    pub(super) fn request(self: &Arc<Self>) -> RequestUnderWay {
        self.enter(Phase::Request);
        RequestUnderWay(Arc::clone(self))
    }

    /// Registers an answer before the end of the request's body.
    pub(super) fn leave_unread(&self) {
        self.is_unread.store(true, Ordering::Release);
    }

    /// Whether the connection can serve no other request: the rest of a body comes first.
    pub(super) fn is_unread(&self) -> bool {
        self.is_unread.load(Ordering::Acquire)
    }

    /// Registers incoming bytes.
    fn hear(&self) {
        let mut phase = self.phase.lock().unwrap_or_else(PoisonError::into_inner);
        if *phase == Phase::Idle {
            *phase = Phase::Headers(Instant::now() + self.patience.headers);
        }
    }

    fn enter(&self, phase: Phase) {
        *self.phase.lock().unwrap_or_else(PoisonError::into_inner) = phase;
    }

    /// Deadline of arriving headers.
    fn deadline(&self) -> Option<Instant> {
        match *self.phase.lock().unwrap_or_else(PoisonError::into_inner) {
            Phase::Headers(until) => Some(until),
            Phase::Idle | Phase::Request => None,
        }
    }
}

impl Drop for RequestUnderWay {
    fn drop(&mut self) {
        self.0.enter(Phase::Idle);
    }
}

/// A resettable deadline.
#[derive(Debug, Default)]
struct Alarm(Option<Pin<Box<Sleep>>>);

impl Alarm {
    /// Whether `until` has passed; otherwise the task is woken then.
    fn poll(&mut self, until: Instant, context: &mut Context<'_>) -> bool {
        let sleep = self.0.get_or_insert_with(|| Box::pin(sleep_until(until)));
        if sleep.deadline() != until {
            sleep.as_mut().reset(until);
        }
        sleep.as_mut().poll(context).is_ready()
    }
}

/// The bytes of a connection, with its deadlines.
#[derive(Debug)]
pub(super) struct Paced<T> {
    inner: T,
    pace: Arc<Pace>,
    headers: Alarm,
    /// Time by which the reader must have taken some of the waiting bytes.
    stalled_until: Option<Instant>,
    stalled: Alarm,
    /// Time until which the rest of an unread body may arrive after the writing side is closed.
    leftover_until: Option<Instant>,
    leftover: Alarm,
}

impl<T> Paced<T> {
    pub(super) fn new(inner: T, pace: Arc<Pace>) -> Self {
        let [headers, stalled, leftover] = std::array::from_fn(|_| Alarm::default());
        Self { inner, pace, headers, stalled_until: None, stalled, leftover_until: None, leftover }
    }

    /// Ends a write that makes no progress.
    fn wrote<R>(
        &mut self,
        poll: Poll<io::Result<R>>,
        context: &mut Context<'_>,
    ) -> Poll<io::Result<R>> {
        if poll.is_ready() {
            self.stalled_until = None;
            return poll;
        }
        let answer = self.pace.patience.answer;
        let until = *self.stalled_until.get_or_insert_with(|| Instant::now() + answer);
        if self.stalled.poll(until, context) {
            return Poll::Ready(Err(io::Error::new(
                io::ErrorKind::TimedOut,
                format!("the reader took nothing of its answer for {answer:?}"),
            )));
        }
        Poll::Pending
    }
}

impl<T: AsyncRead + Unpin> AsyncRead for Paced<T> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let this = &mut *self;
        let read = Pin::new(&mut this.inner).poll_read(context, buffer);
        if buffer.filled().len() > before {
            this.pace.hear();
        }
        // Slowly arriving bytes do not extend the deadline.
        let Some(until) = this.pace.deadline() else { return read };
        if this.headers.poll(until, context) {
            return Poll::Ready(Err(io::Error::new(
                io::ErrorKind::TimedOut,
                format!("no complete headers within {:?}", this.pace.patience.headers),
            )));
        }
        read
    }
}

impl<T: AsyncRead + AsyncWrite + Unpin> AsyncWrite for Paced<T> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.inner).poll_write(context, bytes);
        self.wrote(written, context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.inner).poll_write_vectored(context, slices);
        self.wrote(written, context)
    }

    fn is_write_vectored(&self) -> bool {
        self.inner.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let flushed = Pin::new(&mut self.inner).poll_flush(context);
        self.wrote(flushed, context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        if self.leftover_until.is_none() {
            let shut = Pin::new(&mut self.inner).poll_shutdown(context);
            ready!(self.wrote(shut, context))?;
        }
        if self.pace.is_unread() {
            ready!(self.forget_leftover(context));
        }
        Poll::Ready(Ok(()))
    }
}

impl<T: AsyncRead + Unpin> Paced<T> {
    /// Reads and discards incoming bytes until the peer closes or the time is over.
    fn forget_leftover(&mut self, context: &mut Context<'_>) -> Poll<()> {
        let patience = self.pace.patience.body;
        let until = *self.leftover_until.get_or_insert_with(|| Instant::now() + patience);
        let mut block = [0; LEFTOVER_BLOCK];
        while !self.leftover.poll(until, context) {
            let mut buffer = ReadBuf::new(&mut block);
            let read = ready!(Pin::new(&mut self.inner).poll_read(context, &mut buffer));
            if read.is_err() || buffer.filled().is_empty() {
                break;
            }
        }
        Poll::Ready(())
    }
}

/// The body of an answer, with its request.
pub(super) struct Served {
    body: Body,
    request: Option<RequestUnderWay>,
}

impl Served {
    pub(super) fn new(body: Body, request: RequestUnderWay) -> Self {
        Self { body, request: Some(request) }
    }
}

impl HttpBody for Served {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        if frame.is_none() {
            self.request = None;
        }
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
