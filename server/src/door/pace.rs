//! Deadlines of a connection: for unfinished headers and for unread answers.
//!
//! A client may close its direction after a request and wait for the answer (RFC 9112, section
//! 9.5). The end of its bytes looks the same when it has gone, so it is passed on only when the
//! answer is complete, or when writing to the client fails: before an answer begins, an interim
//! one (100) is written, and a client that has gone resets the connection.
//!
//! The state of a connection is known on two sides: bytes pass through [`Paced`], requests
//! and answers through [`Pace::request`] and [`Served`]. Both share one [`Pace`].

use std::io;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::body::{Body, Bytes, HttpBody};
use hyper::body::{Frame, Incoming, SizeHint};
use hyper::{Request, Version};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep, sleep_until};

use super::Patience;

/// An answer that clients skip (RFC 9110, section 15.2).
const INTERIM: &[u8] = b"HTTP/1.1 100 Continue\r\n\r\n";

/// Time of interim answers after a client has closed its direction, and then every [`QUIET`].
/// Chosen: most answers come before the first. One that has gone is noticed at the second, within
/// the second in which a core must be free again.
const INTERIM_AFTER: [Duration; 3] =
    [Duration::from_millis(150), Duration::from_millis(200), Duration::from_millis(300)];

/// Time between two looks of a request for its body whose client has closed its direction.
/// Chosen: short beside the first interim answer.
const BODY_LOOK: Duration = Duration::from_millis(20);

/// Pause of an answer, in which nothing is written, after which a client that has closed its
/// direction counts as gone.
const QUIET: Duration = Duration::from_secs(2);

/// Number of bytes of an unread body that are discarded at a time.
const LEFTOVER_BLOCK: usize = 8 << 10;

/// The event that a connection waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The rest of a request's headers, until this time.
    Headers(Instant),
    /// The first byte of a request.
    Idle,
    /// The rest of a request's body.
    Body,
    /// The server's answer; `interim` says whether an interim one may come before it.
    Answer { interim: bool },
}

/// The pace of one connection.
#[derive(Debug)]
pub(super) struct Pace {
    patience: Patience,
    phase: Mutex<Phase>,
    /// Whether interim answers are possible: not in HTTP/1.0.
    is_modern: AtomicBool,
    /// Whether a request's body was not read to its end.
    is_unread: AtomicBool,
    /// Whether the client has closed its direction, and all bytes before are at their request.
    has_ended: AtomicBool,
}

/// A request under way; dropped with the last byte of its answer's body.
#[derive(Debug)]
pub(super) struct RequestUnderWay(Arc<Pace>);

impl Pace {
    pub(super) fn new(patience: Patience) -> Arc<Self> {
        let phase = Phase::Headers(Instant::now() + patience.headers);
        let [is_modern, is_unread, has_ended] = [true, false, false].map(AtomicBool::new);
        Arc::new(Self { patience, phase: Mutex::new(phase), is_modern, is_unread, has_ended })
    }

    /// Registers complete headers of a request.
    pub(super) fn request(self: &Arc<Self>, request: &Request<Incoming>) -> RequestUnderWay {
        self.is_modern.store(request.version() >= Version::HTTP_11, Ordering::Relaxed);
        self.enter(Phase::Body);
        if request.body().is_end_stream() {
            self.arrived();
        }
        RequestUnderWay(Arc::clone(self))
    }

    /// Registers the end of a request's body.
    pub(super) fn arrived(&self) {
        let mut phase = self.phase();
        if *phase == Phase::Body {
            *phase = Phase::Answer { interim: self.is_modern.load(Ordering::Relaxed) };
        }
    }

    /// Registers an answer before the end of the request's body.
    pub(super) fn leave_unread(&self) {
        self.is_unread.store(true, Ordering::Release);
    }

    /// Whether the connection can serve no other request: the rest of a body comes first.
    pub(super) fn is_unread(&self) -> bool {
        self.is_unread.load(Ordering::Acquire)
    }

    /// Whether a body that is not complete stays so.
    pub(super) fn has_ended(&self) -> bool {
        self.has_ended.load(Ordering::Acquire)
    }

    /// Registers incoming bytes.
    fn hear(&self) {
        let mut phase = self.phase();
        if *phase == Phase::Idle {
            *phase = Phase::Headers(Instant::now() + self.patience.headers);
        }
    }

    /// Registers bytes of an answer.
    fn answer(&self) {
        let mut phase = self.phase();
        if matches!(*phase, Phase::Answer { .. }) {
            *phase = Phase::Answer { interim: false };
        }
    }

    fn enter(&self, phase: Phase) {
        *self.phase() = phase;
    }

    fn phase(&self) -> MutexGuard<'_, Phase> {
        self.phase.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Deadline of arriving headers.
    fn deadline(&self) -> Option<Instant> {
        match *self.phase() {
            Phase::Headers(until) => Some(until),
            Phase::Idle | Phase::Body | Phase::Answer { .. } => None,
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
    /// Time at which the client closed its direction, and number of interim answers since.
    half_closed: Option<(Instant, usize)>,
    /// Time of the last written byte.
    written: Instant,
    awaited: Alarm,
}

impl<T> Paced<T> {
    pub(super) fn new(inner: T, pace: Arc<Pace>) -> Self {
        let [headers, stalled, leftover, awaited] = std::array::from_fn(|_| Alarm::default());
        let (stalled_until, leftover_until, half_closed) = (None, None, None);
        let written = Instant::now();
        Self {
            inner,
            pace,
            headers,
            stalled_until,
            stalled,
            leftover_until,
            leftover,
            half_closed,
            written,
            awaited,
        }
    }

    /// Registers bytes of an answer.
    fn sent(&mut self, written: &Poll<io::Result<usize>>) {
        if matches!(written, Poll::Ready(Ok(_))) {
            self.written = Instant::now();
            self.pace.answer();
        }
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

impl<T: AsyncWrite + Unpin> Paced<T> {
    /// Whether a client that has closed its direction is still to get an answer.
    fn is_awaited(&mut self, context: &mut Context<'_>) -> bool {
        if self.stalled_until.is_some() {
            return true;
        }
        let now = Instant::now();
        let (since, n) = *self.half_closed.get_or_insert((now, 0));
        match *self.pace.phase() {
            Phase::Answer { interim: true } => {}
            Phase::Answer { interim: false } => {
                return !self.awaited.poll(since.max(self.written) + QUIET, context);
            }
            // The whole body is here and not yet read by its request, or that now gets an error
            // (`leftover`): hyper looks for more bytes only after it has handed on all before.
            Phase::Body if now < since + self.pace.patience.body => {
                self.pace.has_ended.store(true, Ordering::Release);
                let _ = self.awaited.poll(now + BODY_LOOK, context);
                return true;
            }
            _ => return false,
        }
        let due = INTERIM_AFTER.get(n).map_or(self.written + QUIET, |after| since + *after);
        if !self.awaited.poll(due, context) {
            return true;
        }
        match Pin::new(&mut self.inner).poll_write(context, INTERIM) {
            // The client has gone. A part of an interim answer cannot be taken back.
            Poll::Ready(Err(_)) => return false,
            Poll::Ready(Ok(length)) if length < INTERIM.len() => return false,
            Poll::Ready(Ok(_)) | Poll::Pending => {}
        }
        (self.half_closed, self.written) = (Some((since, n + 1)), now);
        let due = INTERIM_AFTER.get(n + 1).map_or(now + QUIET, |after| since + *after);
        // Registers the next one.
        let _ = self.awaited.poll(due.max(now + Duration::from_millis(1)), context);
        true
    }
}

impl<T: AsyncRead + AsyncWrite + Unpin> AsyncRead for Paced<T> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let this = &mut *self;
        let read = Pin::new(&mut this.inner).poll_read(context, buffer);
        let is_end = matches!(read, Poll::Ready(Ok(()))) && buffer.filled().len() == before;
        if buffer.filled().len() > before {
            this.pace.hear();
        } else if is_end && this.is_awaited(context) {
            return Poll::Pending;
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
        self.sent(&written);
        self.wrote(written, context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.inner).poll_write_vectored(context, slices);
        self.sent(&written);
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
