//! The assembled service: the state of the handlers, the router and its layers.

use std::ops::Deref;
use std::sync::Arc;

use palpate_core::units::Bytes;
use palpate_schemas::{Check, Readiness};
use palpate_store::database::Database;
use palpate_store::engine::EngineStats;
use palpate_store::model_codec::ModelPart;
use tokio::sync::watch;

use crate::admission::Admission;
use crate::compute::Pool;
use crate::config::Config;
use crate::figures;
use crate::model::part_name;
use crate::outgoing::Outgoing;
use crate::process;
use crate::rate::Rates;
use crate::refusal::Refusal;
use crate::roles::Operations;
use crate::services::audit::Audit;
use crate::services::catalogues::Catalogues;
use crate::services::commissionings::Commissionings;
use crate::services::jobs::Jobs;
use crate::services::keys::Keys;
use crate::services::objects::Objects;
use crate::services::sensors::Sensors;
use crate::services::sessions::Sessions;
use crate::services::storage::Storage;
use crate::services::webhooks::Webhooks;

/// The state of the handlers. Cheap to clone.
#[derive(Clone)]
pub(crate) struct App(Arc<Parts>);

/// The parts of the service.
pub(crate) struct Parts {
    pub(crate) config: Config,
    pub(crate) store: Database,
    pub(crate) pool: Pool,
    pub(crate) admission: Admission,
    pub(crate) rates: Option<Rates>,
    pub(crate) sensors: Arc<Sensors>,
    pub(crate) objects: Arc<Objects>,
    pub(crate) commissionings: Commissionings,
    pub(crate) catalogues: Arc<Catalogues>,
    pub(crate) jobs: Arc<Jobs>,
    pub(crate) sessions: Arc<Sessions>,
    pub(crate) keys: Arc<Keys>,
    pub(crate) webhooks: Arc<Webhooks>,
    pub(crate) audit: Arc<Audit>,
    pub(crate) operations: Operations,
    pub(crate) storage: Arc<Storage>,
    pub(crate) outgoing: Arc<Outgoing>,
    /// Becomes true when the server stops.
    pub(crate) stopping: watch::Receiver<bool>,
}

impl Deref for App {
    type Target = Parts;

    fn deref(&self) -> &Parts {
        &self.0
    }
}

impl App {
    pub(crate) fn new(parts: Parts) -> Self {
        Self(Arc::new(parts))
    }

    /// Runs a long read of the store on a compute thread, so that request threads stay free.
    pub(crate) async fn apart<T: Send + 'static, E: Send + 'static>(
        &self,
        read: impl FnOnce(&Self) -> Result<T, E> + Send + 'static,
    ) -> Result<T, Refusal>
    where
        Refusal: From<E>,
    {
        let app = self.clone();
        Ok(self.pool.place()?.run_long(move || read(&app)).await??)
    }

    /// Whether the server is ready.
    pub(crate) fn readiness(&self) -> Readiness {
        let (store, room) = match self.store.stats() {
            Ok(stats) => (check("store", true, taken(&stats)), room(&stats, &self.storage)),
            Err(error) => {
                let unknown = check("room", true, "nobody can tell".to_owned());
                (check("store", false, error.to_string()), unknown)
            }
        };
        let n_damaged = self.catalogues.n_damaged();
        let integrity =
            check("integrity", n_damaged == 0, format!("{n_damaged} versions are damaged"));
        let n_free = self.pool.n_free();
        let is_stalled = self.pool.is_stalled();
        let stalled = if is_stalled { ", no thread takes work" } else { "" };
        let compute = format!("{n_free} more requests can compute{stalled}");
        let compute = check("compute", n_free > 0 && !is_stalled, compute);
        let stopping = *self.stopping.borrow();
        let serving = if stopping { "the server stops" } else { "the server serves" };
        let (beliefs, bodies) = (self.sessions.belief_bytes(), self.admission.body_bytes());
        let (beliefs_max, bodies_max) =
            (self.config.belief_memory_bytes_max, self.config.bodies_bytes_max);
        let memory = check(
            "memory",
            beliefs <= beliefs_max,
            format!(
                "beliefs have {} of {}, requests in progress {} of {}",
                Bytes(beliefs as u64),
                Bytes(beliefs_max as u64),
                Bytes(bodies as u64),
                Bytes(bodies_max as u64)
            ),
        );
        let vital = [store, compute, check("serving", !stopping, serving.to_owned())];
        // With a full disk or a damaged version the server still does most of its work, and
        // failing over would not help.
        let ready = vital.iter().all(|check| check.passed);
        Readiness { ready, checks: vital.into_iter().chain([room, memory, integrity]).collect() }
    }

    /// Updates the metrics that have no other source.
    pub(crate) fn measure(&self) {
        process::measure();
        metrics::gauge!("palpate_sessions_in_memory").set(self.sessions.n_live() as f64);
        metrics::gauge!("palpate_sessions_open").set(self.sessions.n_open() as f64);
        let sessions_max = self.config.sessions_open_max as f64;
        metrics::gauge!("palpate_sessions_open_max").set(sessions_max);
        metrics::gauge!("palpate_jobs_unfinished").set(self.jobs.n_unfinished() as f64);
        metrics::gauge!("palpate_compute_places_free").set(self.pool.n_free() as f64);
        self.sensors.health().measure();
        self.webhooks.measure();
        self.outgoing.measure();
        let n_damaged = self.catalogues.n_damaged() as f64;
        metrics::gauge!("palpate_versions_damaged").set(n_damaged);
        let memory = [
            ("beliefs", self.sessions.belief_bytes()),
            ("bodies", self.admission.body_bytes()),
            ("answers", self.admission.answer_bytes()),
        ];
        for (kind, bytes) in memory {
            metrics::gauge!("palpate_memory_bytes", "kind" => kind).set(bytes as f64);
        }
        for (resource, used, total) in self.admission.occupied() {
            metrics::gauge!("palpate_occupied", "resource" => resource).set(used as f64);
            metrics::gauge!("palpate_occupied_max", "resource" => resource).set(total as f64);
        }
        for part in ModelPart::ALL {
            let bytes = self.catalogues.bytes_in_memory(part) as f64;
            metrics::gauge!("palpate_model_bytes", "part" => part_name(part)).set(bytes);
        }
        if let Ok(stats) = self.store.stats() {
            metrics::gauge!("palpate_store_bytes").set(stats.bytes as f64);
            metrics::gauge!("palpate_store_live_bytes").set(stats.live_bytes as f64);
            metrics::counter!("palpate_store_compactions_total").absolute(stats.compactions);
            if let Some(free) = stats.free_bytes {
                metrics::gauge!("palpate_store_free_bytes").set(free as f64);
            }
            metrics::counter!("palpate_store_commits_total").absolute(stats.commits);
            metrics::counter!("palpate_store_flushes_total").absolute(stats.flushes);
            figures::of_cluster(&stats);
        }
    }
}

/// Whether writes are taken; if not, what would make room.
fn room(stats: &EngineStats, storage: &Storage) -> Check {
    let reserve = Bytes(stats.reserve_bytes);
    match stats.free_bytes {
        Some(free) if free < stats.reserve_bytes => {
            let (free, advice) = (Bytes(free), storage.advice(stats));
            let found = format!("{free} are free, {reserve} must stay: no writes{advice}");
            check("room", false, found)
        }
        Some(free) => check("room", true, format!("{} are free", Bytes(free))),
        None => check("room", true, "nobody can tell".to_owned()),
    }
}

/// The stored bytes, and the live ones among them.
fn taken(stats: &EngineStats) -> String {
    format!("{}, {} live", Bytes(stats.bytes), Bytes(stats.live_bytes))
}

fn check(name: &str, passed: bool, detail: String) -> Check {
    Check { name: name.to_owned(), passed, detail }
}
