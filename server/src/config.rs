//! Configuration of a server: addresses, folders, and every limit.

use std::fmt;
use std::net::{Ipv4Addr, SocketAddr};
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

use palpate_store::audit::RingSizes;
use palpate_store::nats::NatsOptions;
use palpate_store::sled::{FreeSpace, RESERVE_BYTES, SLACK_BYTES};

use crate::door::Patience;
use crate::secret::ChosenKey;
use crate::tls::TlsFiles;

/// Whether requests need an API key.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Access {
    /// Required if there is a valid key when the server starts.
    #[default]
    Auto,
    /// Always required. The first admin's key is created if missing.
    Keys,
    /// Never required.
    Open,
}

impl fmt::Display for Access {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Auto => "auto",
            Self::Keys => "keys",
            Self::Open => "open",
        })
    }
}

/// Forwarding of a cell's sessions to a central service. An `outbox` does the work.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Forward {
    /// Address of the central service.
    pub to: String,
    /// Name under which the central service knows this cell.
    pub cell: String,
    /// Catalogues whose current versions come from the central service.
    pub catalogues: Vec<String>,
}

/// The settings of a server. Defaults suit one machine and a small fleet.
#[derive(Clone, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "settings that are on or off, each for itself")]
pub struct Config {
    /// The address to listen at; port 0 takes any free one.
    pub listen: SocketAddr,
    /// Permits an address that other machines can reach without keys.
    pub insecure_bind: bool,
    /// Names of this machine in the network; without keys, requests for other names are
    /// refused. Addresses and the machine's own names need not be listed.
    pub host_names: Vec<String>,
    /// Whether requests need an API key.
    pub access: Access,
    /// Creates another admin's key at the start, for operators who have lost theirs.
    pub new_admin_key: bool,
    /// The first admin's key, if the operator chooses it; used only where one would be created.
    pub first_admin_key: Option<ChosenKey>,
    /// Permits reading `/metrics` without a key.
    pub open_metrics: bool,
    /// The certificate and key for TLS; plain HTTP without.
    pub tls: Option<TlsFiles>,
    /// Origins whose pages may use the API from a browser, such as `https://lab.example`.
    pub cors_origins: Vec<String>,
    /// Number of entries that each ring of the audit log keeps.
    pub audit_entries_max: RingSizes,
    /// Number of failed changes of one key per minute; further ones have to wait.
    pub failed_changes_per_minute: NonZeroU32,
    /// The database folder; created if it does not exist.
    pub data: PathBuf,
    /// The NATS cluster that stores everything; the database folder does it if `None`.
    pub cluster: Option<NatsOptions>,
    /// Migrates a database of an older layout; otherwise it is refused.
    pub migrate: bool,
    /// Memory of the database's page cache, bytes.
    pub store_cache_bytes: u64,
    /// Bytes of the disk that stay free: with fewer, writes are refused (507).
    pub disk_reserve_bytes: u64,
    /// Space beyond 1.5 times the live bytes at which the store compacts itself.
    pub store_slack_bytes: u64,
    /// Bytes of stored data that one API key may hold; no bound when `None`.
    pub store_quota_bytes: Option<u64>,
    /// Source of the number of free bytes.
    pub free_space: FreeSpace,
    /// The longest body of JSON or MessagePack, in bytes.
    pub json_bytes_max: usize,
    /// The longest mesh file, in bytes.
    pub mesh_bytes_max: usize,
    /// Time limit for a body to arrive.
    pub body_timeout: Duration,
    /// Time limit of an answer, after which the robot is asked to retry.
    pub answer_timeout: Duration,
    /// Maximum number of concurrent requests.
    pub requests_max: usize,
    /// Maximum total bytes of the bodies of concurrent requests.
    pub bodies_bytes_max: usize,
    /// Maximum total bytes of unread answers.
    pub answers_bytes_max: usize,
    /// Maximum number of open connections; fewer if the system allows fewer files.
    pub connections_max: usize,
    /// Time limits of a connection's steps.
    pub patience: Patience,
    /// Maximum requests per second of each client; no limit if `None`.
    pub rate_per_second: Option<NonZeroU32>,
    /// Maximum number of open event streams.
    pub streams_max: usize,
    /// Threads that update beliefs and read meshes.
    pub compute_threads: usize,
    /// Maximum number of computations that wait for a thread.
    pub compute_queue_max: usize,
    /// Threads that train, without delaying the readings of running sessions.
    pub training_threads: usize,
    /// Maximum number of waiting trainings.
    pub training_queue_max: usize,
    /// Time limit of one training.
    pub training_time_max: Duration,
    /// Maximum memory of one training, as estimated before it starts.
    pub training_memory_bytes_max: u64,
    /// Maximum memory of models for sessions, bytes.
    pub model_memory_bytes_max: u64,
    /// Maximum memory of beliefs, bytes; the least recently used ones are rebuilt from their
    /// journals.
    pub belief_memory_bytes_max: usize,
    /// Maximum number of sessions in memory; others are rebuilt from their journals.
    pub beliefs_in_memory_max: usize,
    /// Maximum number of open sessions.
    pub sessions_open_max: usize,
    /// Default lifetime of a session without a new reading; zero is unlimited.
    pub session_time_to_live: Duration,
    /// Time for which ended sessions are kept with their readings; unlimited if `None`.
    pub session_kept: Option<Duration>,
    /// Maximum number of readings of one session.
    pub session_readings_max: usize,
    /// Maximum number of training readings of one object.
    pub object_readings_max: usize,
    /// Permits webhooks of this machine and of private networks, and unencrypted ones.
    pub webhook_allow_private: bool,
    /// Pauses between the attempts of a delivery to a webhook; each is lengthened by up to a fifth.
    pub webhook_pauses: Vec<Duration>,
    /// The central service to which sessions are forwarded, if any.
    pub forward: Option<Forward>,
}

/// Concurrent requests per core: accepted requests wait for earlier ones, and more of them
/// would only wait longer.
const REQUESTS_PER_CORE: usize = 128;

/// Chosen: five a second are more than a robot or a person causes by mistake.
const FAILED_CHANGES_PER_MINUTE: NonZeroU32 = NonZeroU32::new(300).expect("300 is not 0");

/// Chosen: a receiver that restarts gets an event within seconds, one that is repaired the next day
/// gets it, too.
const WEBHOOK_PAUSES: [Duration; 7] = [
    Duration::from_secs(5),
    Duration::from_secs(30),
    Duration::from_secs(120),
    Duration::from_secs(600),
    Duration::from_secs(3_600),
    Duration::from_secs(21_600),
    Duration::from_secs(86_400),
];

impl Config {
    /// The defaults, with the database in `data`, listening at 127.0.0.1:7411.
    #[must_use]
    pub fn new(data: impl Into<PathBuf>) -> Self {
        let n_cores = std::thread::available_parallelism().map_or(1, usize::from);
        Self {
            listen: SocketAddr::from((Ipv4Addr::LOCALHOST, 7411)),
            insecure_bind: false,
            host_names: Vec::new(),
            access: Access::Auto,
            new_admin_key: false,
            first_admin_key: None,
            open_metrics: false,
            tls: None,
            cors_origins: Vec::new(),
            audit_entries_max: RingSizes { changes: 100_000, refused: 20_000, strangers: 10_000 },
            failed_changes_per_minute: FAILED_CHANGES_PER_MINUTE,
            data: data.into(),
            cluster: None,
            migrate: false,
            store_cache_bytes: 64 << 20,
            disk_reserve_bytes: RESERVE_BYTES,
            store_slack_bytes: SLACK_BYTES,
            store_quota_bytes: Some(10_000_000_000),
            free_space: FreeSpace::of_disk(),
            json_bytes_max: 32 << 20,
            mesh_bytes_max: 64 << 20,
            body_timeout: Duration::from_secs(60),
            answer_timeout: Duration::from_secs(90),
            requests_max: REQUESTS_PER_CORE * n_cores,
            bodies_bytes_max: 256 << 20,
            answers_bytes_max: 256 << 20,
            connections_max: 4096,
            patience: Patience::default(),
            rate_per_second: None,
            streams_max: 1024,
            compute_threads: n_cores,
            compute_queue_max: 256,
            training_threads: n_cores.saturating_sub(1).max(1),
            training_queue_max: 32,
            training_time_max: Duration::from_secs(86_400),
            training_memory_bytes_max: 2_000_000_000,
            model_memory_bytes_max: 1_000_000_000,
            belief_memory_bytes_max: 500_000_000,
            beliefs_in_memory_max: 1024,
            sessions_open_max: 10_000,
            session_time_to_live: Duration::from_secs(86_400),
            session_kept: None,
            session_readings_max: 10_000,
            object_readings_max: 100_000,
            webhook_allow_private: false,
            webhook_pauses: WEBHOOK_PAUSES.to_vec(),
            forward: None,
        }
    }
}
