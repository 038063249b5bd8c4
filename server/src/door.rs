//! Connections: accepts them, limits them in total, and serves HTTP/1.1.
//!
//! A connection has a deadline for its TLS handshake, for the headers of a request, for
//! idling between requests, and for an answer that is not read (`pace`). When the total is reached,
//! connections on which no key was shown are closed for new ones (`bounds`). A stop lets requests
//! under way finish.

mod bounds;
mod connection;
mod leftover;
mod pace;

use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::extract::ConnectInfo;
use axum::http::header::CONNECTION;
use axum::http::{HeaderValue, Request};
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use rustls::ServerConfig;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::task::JoinSet;
use tokio_rustls::TlsAcceptor;
use tower_service::Service;

pub(crate) use bounds::Connections;
use bounds::Place;
use connection::Connection;
use leftover::Asked;
use pace::{Pace, Paced, Served};

/// Maximum bytes of a request's headers. The last read may add as many again: a connection's
/// buffer has at most 64 kB. Chosen: browsers send at most 16 kB.
const HEADER_BYTES: usize = 32 << 10;

/// Pause after the system refused a connection, for example without a free file descriptor.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);

/// The peer of a connection.
#[derive(Clone, Debug)]
pub(crate) struct Peer {
    /// Its address.
    pub(crate) address: SocketAddr,
    /// The connection's place among all.
    pub(crate) place: Arc<Place>,
}

/// Time limits of a connection's steps.
#[derive(Clone, Copy, Debug)]
pub struct Patience {
    /// A TLS handshake.
    pub handshake: Duration,
    /// The headers of a request, from their first byte; after connecting, from the beginning.
    pub headers: Duration,
    /// The pause between two requests.
    pub idle: Duration,
    /// A pause of an incoming body; also the time in which the rest of an unneeded body may
    /// arrive.
    pub body: Duration,
    /// A pause of a reader while its answer is sent.
    pub answer: Duration,
}

impl Default for Patience {
    /// Chosen: a handshake and headers take well under a second on any network of robots; an
    /// idle connection outlives the seconds between two touches, and is free within a minute;
    /// a reader that takes nothing for half a minute is gone.
    fn default() -> Self {
        let seconds = Duration::from_secs;
        Self {
            handshake: seconds(10),
            headers: seconds(10),
            idle: seconds(45),
            body: seconds(10),
            answer: seconds(30),
        }
    }
}

/// Common state of all connections.
#[derive(Clone)]
struct Desk {
    router: Router,
    patience: Patience,
    stopping: watch::Receiver<bool>,
}

/// A listener for HTTP, or for HTTP through TLS.
pub(crate) struct Door {
    pub(crate) listener: TcpListener,
    /// TLS configuration of new connections; plain HTTP without.
    pub(crate) tls: Option<watch::Receiver<Arc<ServerConfig>>>,
    pub(crate) connections: Arc<Connections>,
    pub(crate) patience: Patience,
}

impl Door {
    /// Serves connections until the server stops and those under way are done.
    pub(crate) async fn serve(self, router: Router, stopping: watch::Receiver<bool>) {
        let mut stopped = std::pin::pin!(stop(stopping.clone()));
        let desk = Desk { router, patience: self.patience, stopping };
        let mut under_way = JoinSet::new();
        loop {
            let (stream, address) = tokio::select! {
                accepted = self.listener.accept() => match accepted {
                    Ok(accepted) => accepted,
                    Err(error) => {
                        refuse(&error).await;
                        continue;
                    }
                },
                Some(_) = under_way.join_next() => continue,
                () = &mut stopped => break,
            };
            // Answers are small: waiting to fill a packet costs 40 ms each.
            let _ = stream.set_nodelay(true);
            end_unread(&stream, self.patience.answer);
            let peer = Peer { address, place: self.connections.place(address.ip()) };
            let tls = self.tls.as_ref().map(|tls| Arc::clone(&tls.borrow()));
            under_way.spawn(attend(stream, peer, tls, desk.clone()));
        }
        drop(self.listener);
        while under_way.join_next().await.is_some() {}
    }
}

/// Resolves when the server stops.
async fn stop(mut stopping: watch::Receiver<bool>) {
    // Without a sender the server is gone, which is a stop as well.
    let _ = stopping.wait_for(|stopping| *stopping).await;
}

/// Lets the system end a connection whose reader takes nothing of an answer for this time. `pace`
/// sees only what the system's buffers do not hold; a short answer lies in them whole.
fn end_unread(stream: &TcpStream, answer: Duration) {
    #[cfg(target_os = "linux")]
    {
        let milliseconds = u32::try_from(answer.as_millis()).unwrap_or(u32::MAX);
        let _ = rustix::net::sockopt::set_tcp_user_timeout(stream, milliseconds);
    }
    #[cfg(not(target_os = "linux"))]
    let _ = (stream, answer);
}

/// Pauses when the system refuses a connection.
async fn refuse(error: &io::Error) {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    if !matches!(error.kind(), ConnectionAborted | ConnectionRefused | ConnectionReset) {
        tracing::warn!(%error, "Cannot accept a connection: {error}");
        tokio::time::sleep(ACCEPT_PAUSE).await;
    }
}

/// Serves one connection until it ends or gives way to a newer one.
async fn attend(stream: TcpStream, peer: Peer, tls: Option<Arc<ServerConfig>>, desk: Desk) {
    let place = Arc::clone(&peer.place);
    let serving = async {
        let connection = match tls {
            None => Connection::Plain(stream),
            Some(tls) => {
                let shaking = TlsAcceptor::from(tls).accept(stream);
                let shaking = tokio::time::timeout(desk.patience.handshake, shaking);
                let shaken = tokio::select! {
                    shaken = shaking => shaken,
                    () = stop(desk.stopping.clone()) => return,
                };
                match shaken {
                    Ok(Ok(stream)) => Connection::Tls(Box::new(stream)),
                    Ok(Err(error)) => return tracing::debug!(%error, "A TLS handshake failed"),
                    Err(_) => return tracing::debug!("A TLS handshake took too long"),
                }
            }
        };
        serve(connection, peer, desk).await;
    };
    tokio::select! {
        () = serving => {}
        () = place.evicted() => tracing::debug!("Closed a connection for a newer one"),
    }
}

/// Serves the requests of a connection one after the other.
async fn serve(connection: Connection, peer: Peer, desk: Desk) {
    let Desk { router, patience, stopping } = desk;
    let pace = Pace::new(patience);
    let io = TokioIo::new(Paced::new(connection, Arc::clone(&pace)));
    let service = service_fn(move |mut request: Request<Incoming>| {
        request.extensions_mut().insert(ConnectInfo(peer.clone()));
        let request_under_way = pace.request(&request);
        let pace = Arc::clone(&pace);
        let body = |body| Body::new(Asked::new(body, Arc::clone(&pace)));
        let answering = router.clone().call(request.map(body));
        async move {
            let Ok(mut response) = answering.await;
            if pace.is_unread() {
                response.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
            }
            Ok::<_, Infallible>(response.map(|body| Served::new(body, request_under_way)))
        }
    });
    let mut builder = http1::Builder::new();
    // Hyper's own deadline covers idling as well; the one for headers alone is in `pace`.
    builder.timer(TokioTimer::new()).header_read_timeout(patience.idle).max_buf_size(HEADER_BYTES);
    let connection = builder.serve_connection(io, service);
    let mut connection = std::pin::pin!(connection);
    let ended = tokio::select! {
        ended = connection.as_mut() => ended,
        () = stop(stopping) => {
            connection.as_mut().graceful_shutdown();
            connection.await
        }
    };
    if let Err(error) = ended {
        tracing::debug!(%error, "A connection ended: {error}");
    }
}
