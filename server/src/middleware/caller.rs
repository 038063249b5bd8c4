//! The caller of a request: the key that `guard` found, and the client that the request
//! counts towards.

use axum::extract::{ConnectInfo, Request};
use palpate_schemas::Role;
use palpate_store::access::AccessKey;

use crate::app::App;
use crate::client::Client;
use crate::door::Peer;
use crate::wire;

/// The caller, for handlers and for the audit log.
#[derive(Clone, Debug)]
pub(crate) struct Caller {
    /// The key, if keys are required.
    pub(crate) key: Option<AccessKey>,
}

impl Caller {
    /// Resolves when sending to the caller must end: with its key, or with the server.
    pub(crate) fn until_ended(self, app: &App) -> impl Future<Output = ()> + Send + 'static {
        let (app, mut stopping) = (app.clone(), app.stopping.clone());
        async move {
            let refused = async {
                match self.key {
                    Some(key) => app.keys.until_refused(key).await,
                    None => std::future::pending().await,
                }
            };
            tokio::select! {
                // Without a sender the server is gone, which is a stop as well.
                _ = stopping.wait_for(|stopping| *stopping) => {}
                () = refused => {}
            }
        }
    }

    /// The caller's role: admin, if keys are not required.
    pub(crate) fn role(&self) -> Role {
        self.key.as_ref().map_or(Role::Admin, |key| wire::access::role(key.role))
    }
}

/// The client of a request; `None` outside a connection.
pub(crate) fn client(request: &Request) -> Option<Client> {
    let caller = request.extensions().get::<Caller>();
    if let Some(key) = caller.and_then(|caller| caller.key.as_ref()) {
        return Some(Client::Key(key.id));
    }
    let ConnectInfo(peer) = request.extensions().get::<ConnectInfo<Peer>>()?;
    Some(Client::at(peer.address.ip()))
}
