//! Outgoing answers: bytes are counted until the last one is passed to the system.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use axum::body::{Body, Bytes, HttpBody};
use axum::response::{IntoResponse, Response};
use hyper::body::{Frame, SizeHint};

use crate::admission::{InMemory, share};
use crate::budget::{Budget, Holding, Over};
use crate::client::Client;
use crate::refusal::{LoadError, Refusal};

/// Largest piece of an answer that is passed on at once. The connection requests the next one
/// when it has sent nearly all before it, so at most a few pieces wait uncounted.
const PIECE_BYTES: usize = 64 << 10;

/// The answer with its bytes counted, or a refusal when unread answers leave no space for it.
/// Event streams have their own budget, no length and no [`InMemory`].
pub(super) fn count(answers: &Arc<Budget>, client: Option<Client>, answer: Response) -> Response {
    let whole = || usize::try_from(answer.body().size_hint().exact()?).ok();
    let in_memory = answer.extensions().get().map(|InMemory(bytes)| *bytes);
    let Some(bytes) = in_memory.or_else(whole) else { return answer };
    match answers.take(client, bytes) {
        Ok(holding) if bytes > PIECE_BYTES => {
            answer.map(|body| Body::new(Counted { body, rest: Bytes::new(), _holding: holding }))
        }
        // An answer that the connection sends in one piece needs no counting.
        Ok(_) => answer,
        Err(Over::Total) => {
            let (used, max) = (answers.used(), answers.total());
            Refusal::from(LoadError::AnswersFull { used, max }).into_response()
        }
        Err(Over::Share) => {
            Refusal::from(share("answers", "content-bytes", answers)).into_response()
        }
    }
}

/// A long body in pieces, with its part of the budget.
struct Counted {
    body: Body,
    /// The part of the body that was not passed on.
    rest: Bytes,
    _holding: Holding,
}

impl HttpBody for Counted {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        while self.rest.is_empty() {
            match std::task::ready!(Pin::new(&mut self.body).poll_frame(context)) {
                Some(Ok(frame)) => match frame.into_data() {
                    Ok(data) => self.rest = data,
                    Err(frame) => return Poll::Ready(Some(Ok(frame))),
                },
                other => return Poll::Ready(other),
            }
        }
        let length = self.rest.len().min(PIECE_BYTES);
        Poll::Ready(Some(Ok(Frame::data(self.rest.split_to(length)))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_empty() && self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        let rest = self.rest.len() as u64;
        let exact = self.body.size_hint().exact().map(|body| body + rest);
        exact.map_or_else(SizeHint::default, SizeHint::with_exact)
    }
}
