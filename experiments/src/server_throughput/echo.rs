//! The least that a server can do with the same requests: it reads their bodies and answers what a
//! real server once answered.

use std::net::{Ipv4Addr, SocketAddr};

use axum::Router;
use axum::body::Bytes;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use axum::routing::post;
use palpate_schemas::{ReadingsAdded, Session};
use tokio::net::TcpListener;
use tokio::task::JoinHandle;

/// A running echo; it ends when it is dropped.
pub(super) struct Echo {
    address: SocketAddr,
    serving: JoinHandle<()>,
}

impl Echo {
    /// Starts on a free port. `session` is the answer to new and closed sessions, `added` that to
    /// readings.
    pub(super) async fn start(session: &Session, added: &ReadingsAdded) -> anyhow::Result<Self> {
        let (session, added) = (json(session)?, json(added)?);
        let answer = |body: Bytes| move |_request: Bytes| std::future::ready(answered(&body));
        let app = Router::new()
            .route("/v1/sessions", post(answer(session.clone())))
            .route("/v1/sessions/{session}/readings", post(answer(added)))
            .route("/v1/sessions/{session}/close", post(answer(session)));
        let listener = TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, 0))).await?;
        let address = listener.local_addr()?;
        let serving = tokio::spawn(async move {
            // It ends with its task.
            let _ = axum::serve(listener, app).await;
        });
        Ok(Self { address, serving })
    }

    pub(super) fn address(&self) -> String {
        format!("http://{}", self.address)
    }
}

impl Drop for Echo {
    fn drop(&mut self) {
        self.serving.abort();
    }
}

fn json(answer: &impl serde::Serialize) -> anyhow::Result<Bytes> {
    Ok(serde_json::to_vec(answer)?.into())
}

fn answered(body: &Bytes) -> Response {
    ([(CONTENT_TYPE, "application/json")], body.clone()).into_response()
}
