//! A running server: started with a [`Config`], stopped with [`Server::shutdown`].
//!
//! A stop refuses new connections, ends streams, lets requests finish for a while, suspends
//! the running training, and closes the store last.

mod database;
mod start;

use std::fmt;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use palpate_store::database::Database;
use palpate_store::engine::Engine;
use tokio::net::TcpListener;
use tokio::sync::watch;
use tokio::task::JoinHandle;

use crate::admission::Admission;
use crate::app::{App, Parts};
use crate::compute::Pool;
use crate::config::Config;
use crate::door::Door;
use crate::hearing::hear;
use crate::middleware::telemetry;
use crate::notices::Notices;
use crate::outbox::Outbox;
use crate::outgoing::Outgoing;
use crate::rate::Rates;
use crate::roles::Operations;
use crate::router::router;
use crate::services::audit::{Audit, is_essential};
use crate::services::catalogues::Catalogues;
use crate::services::commissionings::Commissionings;
use crate::services::integrity;
use crate::services::jobs::Jobs;
use crate::services::keys::Keys;
use crate::services::objects::Objects;
use crate::services::sensors::Sensors;
use crate::services::sessions::Sessions;
use crate::services::storage::{self, Storage};
use crate::services::webhooks::Webhooks;
use crate::{openapi, tls};
use database::{close, database, open};
use start::is_exposed;
pub use start::{StartError, check};

/// Time limit of requests under way after a stop.
const SHUTDOWN_PATIENCE: Duration = Duration::from_secs(10);

/// A running server.
pub struct Server {
    local_addr: SocketAddr,
    stop: watch::Sender<bool>,
    serving: JoinHandle<()>,
    working: JoinHandle<()>,
    delivering: JoinHandle<()>,
    webhooks: Arc<Webhooks>,
    sessions: Arc<Sessions>,
    audit: Arc<Audit>,
    time_keeper: Arc<Keys>,
    engine: Arc<dyn Engine>,
    outbox: Option<Outbox>,
    scheme: &'static str,
    admin_key: Option<String>,
}

impl fmt::Debug for Server {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Server").field("address", &self.address()).finish_non_exhaustive()
    }
}

impl Server {
    /// Opens the database, resumes unfinished jobs and listens.
    ///
    /// # Errors
    /// [`StartError`]; nothing is left running then.
    pub async fn start(config: Config) -> Result<Self, StartError> {
        check(&config)?;
        let address = config.listen;
        let is_exposed = is_exposed(&config);
        // First: metrics of what follows are lost without it.
        telemetry::metrics_handle();
        let tls_files = config.tls.clone();
        let tls = tls_files.as_ref().map(tls::configure).transpose()?.map(watch::Sender::new);
        let scheme = if tls.is_some() { "https" } else { "http" };
        let listener = TcpListener::bind(address)
            .await
            .map_err(|source| StartError::Listen { address, source })?;
        let local_addr = listener.local_addr()?;
        let (stop, stopping) = watch::channel(false);
        let engine = open(&config).await?;
        let store = database(Arc::clone(&engine), config.migrate).await?;
        let store = store.with_accounts(storage::accounts(config.store_quota_bytes));
        // Before anything is read: what changes from here on is looked at again.
        let news = store.news();
        let (access, chosen) = (config.access, config.first_admin_key.clone());
        let (keys, admin_key) =
            Keys::open(store.clone(), access, config.new_admin_key, chosen).await?;
        let keys = Arc::new(keys);
        if is_exposed && !keys.required() {
            return Err(StartError::InsecureBind { address });
        }
        if !address.ip().is_loopback() && tls.is_none() {
            tracing::warn!(
                "Keys and readings travel unencrypted to {address}: use `--tls-cert` and \
                 `--tls-key`, or a proxy that speaks TLS"
            );
        }
        let (time_keeper, checked) = (Arc::clone(&keys), store.clone());
        let (app, jobs) = assemble(config, store, keys, stopping.clone()).await?;
        let checked_catalogues = Arc::clone(&app.catalogues);
        let sessions = Arc::clone(&app.sessions);
        spawn_background(&app, &stopping);
        tokio::spawn(hear(app.clone(), news, stopping.clone()));
        let working = tokio::spawn(jobs.work(stopping.clone()));
        let webhooks = Arc::clone(&app.webhooks);
        let delivering = tokio::spawn(Arc::clone(&webhooks).work(stopping.clone()));
        let audit = Arc::clone(&app.audit);
        let outbox = app.outgoing.forward().map(|_| Outbox::new(app.clone()));
        tokio::spawn(Arc::clone(&time_keeper).keep_time(stopping.clone()));
        integrity::check(checked, checked_catalogues, stopping.clone())?;
        let door = Door {
            listener,
            tls: tls.as_ref().map(watch::Sender::subscribe),
            connections: Arc::clone(app.admission.connections()),
            patience: app.config.patience,
        };
        if let (Some(files), Some(tls)) = (tls_files, tls) {
            tokio::spawn(tls::renew(files, tls, stopping.clone()));
        }
        let serving = tokio::spawn(door.serve(router(app), stopping));
        tracing::info!("Listening at {scheme}://{local_addr}");
        Ok(Self {
            local_addr,
            stop,
            serving,
            working,
            delivering,
            webhooks,
            sessions,
            audit,
            time_keeper,
            engine,
            outbox,
            scheme,
            admin_key,
        })
    }

    /// `http`, or `https` with a certificate.
    #[must_use]
    pub fn scheme(&self) -> &'static str {
        self.scheme
    }

    /// The server's URL, such as `http://127.0.0.1:7411`.
    #[must_use]
    pub fn address(&self) -> String {
        format!("{}://{}", self.scheme, self.local_addr)
    }

    /// The secret of the admin's key created at this start, if any; `None` from the second
    /// call on.
    pub fn take_admin_key(&mut self) -> Option<String> {
        self.admin_key.take()
    }

    /// The outbox of a cell, once; `None` on a server without [`Config::forward`].
    pub fn take_outbox(&mut self) -> Option<Outbox> {
        self.outbox.take()
    }

    /// The address and port at which it listens.
    #[must_use]
    pub fn local_addr(&self) -> SocketAddr {
        self.local_addr
    }

    /// Stops the server; returns when everything is stored and closed.
    pub async fn shutdown(mut self) {
        tracing::info!("Stopping");
        self.stop.send_replace(true);
        if tokio::time::timeout(SHUTDOWN_PATIENCE, &mut self.serving).await.is_err() {
            tracing::warn!("Requests were still under way after {SHUTDOWN_PATIENCE:?}");
            self.serving.abort();
            let _ = (&mut self.serving).await;
        }
        if (&mut self.working).await.is_err() {
            tracing::error!("The worker of training jobs panicked");
        }
        if (&mut self.delivering).await.is_err() {
            tracing::error!("The worker of webhooks panicked");
        }
        self.webhooks.announce_rest().await;
        drop(self.webhooks);
        self.audit.store().await;
        drop(self.audit);
        if let Err(error) = self.time_keeper.store_time().await {
            tracing::warn!(%error, "Cannot store the time");
        }
        drop(self.time_keeper);
        let sessions = self.sessions;
        if tokio::task::spawn_blocking(move || sessions.store_beliefs()).await.is_err() {
            tracing::error!("Storing checkpoints of beliefs panicked");
        }
        close(self.engine).await;
        tracing::info!("Stopped");
    }
}

/// Starts the background tasks for sessions, metrics, the audit log and the disk.
fn spawn_background(app: &App, stopping: &watch::Receiver<bool>) {
    let sessions = || Arc::clone(&app.sessions);
    tokio::spawn(telemetry::tidy(stopping.clone()));
    tokio::spawn(sessions().watch(stopping.clone()));
    tokio::spawn(sessions().keep_health(stopping.clone()));
    tokio::spawn(sessions().keep_watch(stopping.clone()));
    tokio::spawn(Arc::clone(&app.audit).keep(stopping.clone()));
    tokio::spawn(Arc::clone(&app.storage).watch(stopping.clone()));
    if let Some(keep) = app.config.session_kept {
        tokio::spawn(sessions().forget(keep, stopping.clone()));
    }
}

async fn assemble(
    config: Config,
    store: Database,
    keys: Arc<Keys>,
    stopping: watch::Receiver<bool>,
) -> Result<(App, Arc<Jobs>), StartError> {
    let pool = Pool::start(config.compute_threads, config.compute_queue_max)?;
    let sensors = Arc::new(Sensors::new(store.clone()));
    sensors.add_presets().await?;
    let objects = Objects::new(store.clone(), Arc::clone(&sensors), pool.clone(), &config);
    let objects = Arc::new(objects);
    let commissionings = Commissionings::new(
        store.clone(),
        Arc::clone(&sensors),
        Arc::clone(&objects),
        pool.clone(),
    );
    let catalogues = Arc::new(Catalogues::new(&store, pool.clone(), &config));
    let notices = Arc::new(Notices::default());
    let outgoing = Arc::new(Outgoing::new(config.forward.clone()));
    let jobs = Arc::new(Jobs::new(
        store.clone(),
        Arc::clone(&notices),
        Arc::clone(&objects),
        Arc::clone(&sensors),
        Arc::clone(&catalogues),
        pool.clone(),
        &config,
    )?);
    jobs.resume().await.map_err(|error| StartError::Jobs { reason: error.to_string() })?;
    let sessions = Arc::new(Sessions::new(
        store.clone(),
        Arc::clone(&catalogues),
        Arc::clone(&sensors),
        pool.clone(),
        Arc::clone(&keys),
        (Arc::clone(&notices), Arc::clone(&outgoing)),
        &config,
    ));
    let counted = Arc::clone(&sessions);
    let counted = tokio::task::spawn_blocking(move || counted.take_stock()).await;
    let pictured = Arc::clone(&objects);
    tokio::task::spawn_blocking(move || pictured.tidy_thumbnails())
        .await
        .map_err(std::io::Error::other)?;
    counted
        .map_err(std::io::Error::other)?
        .map_err(|refusal| StartError::Sessions { reason: refusal.to_string() })?;
    let webhooks = Webhooks::open(&store, &sessions, notices, &config).await;
    let webhooks = webhooks.map_err(|error| StartError::Webhooks { reason: error.to_string() })?;
    let (log, sizes) = (store.clone(), config.audit_entries_max);
    let log = tokio::task::spawn_blocking(move || log.audit(sizes, is_essential)).await;
    let log = log.map_err(std::io::Error::other)??;
    let audit = Arc::new(Audit::new(log, config.failed_changes_per_minute));
    let storage = Storage::new(store.clone(), Arc::clone(&keys), config.store_quota_bytes);
    let admission = Admission::new(&config);
    let rates = config.rate_per_second.map(Rates::new);
    let working = Arc::clone(&jobs);
    let parts = Parts {
        config,
        store,
        pool,
        admission,
        rates,
        sensors,
        objects,
        commissionings,
        catalogues,
        jobs,
        sessions,
        keys,
        webhooks: Arc::new(webhooks),
        audit,
        operations: Operations::new(openapi::operation_ids()),
        storage: Arc::new(storage),
        outgoing,
        stopping,
    };
    Ok((App::new(parts), working))
}
