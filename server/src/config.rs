//! What an operator chooses: where to listen, where to keep data, and every bound.

use std::fmt;
use std::net::{Ipv4Addr, SocketAddr};
use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

use palpate_store::audit::RingSizes;
use palpate_store::sled::{FreeSpace, RESERVE_BYTES, SLACK_BYTES};

use crate::door::Patience;
use crate::tls::TlsFiles;

/// Whether requests need an API key.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Access {
    /// As soon as a key is stored that is not revoked; looked up when the server starts.
    #[default]
    Auto,
    /// Always. The first admin's key is made when there is none.
    Keys,
    /// Never, whatever is stored.
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

/// The settings of a server. Every default is meant for one machine and a small fleet.
#[derive(Clone, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "settings that are on or off, each for itself")]
pub struct Config {
    /// The address to listen at; port 0 takes any free one.
    pub listen: SocketAddr,
    /// Listen at an address that other machines can reach although nobody is asked for a key.
    pub insecure_bind: bool,
    /// Names that this machine has in the network: without keys, a request for another name is
    /// refused. Addresses and names of the machine itself need not be listed.
    pub host_names: Vec<String>,
    /// Whether requests need an API key.
    pub access: Access,
    /// Make one more admin's key at the start, for operators who have lost theirs.
    pub new_admin_key: bool,
    /// Let everybody read `/metrics`, also without a key.
    pub open_metrics: bool,
    /// The certificate and key to speak TLS with; plain HTTP without.
    pub tls: Option<TlsFiles>,
    /// Origins whose pages may use the API from a browser, such as `https://lab.example`.
    pub cors_origins: Vec<String>,
    /// How many entries the audit log keeps, of each ring.
    pub audit_entries_max: RingSizes,
    /// How many changes of one key may fail within a minute; then it has to wait.
    pub failed_changes_per_minute: NonZeroU32,
    /// The folder of the database; made if it does not exist.
    pub data: PathBuf,
    /// Bring a database of an older layout to today's; otherwise it is refused.
    pub migrate: bool,
    /// How many bytes of memory the database keeps pages in.
    pub store_cache_bytes: u64,
    /// Bytes of the disk that stay free: with fewer, writes are refused (507).
    pub disk_reserve_bytes: u64,
    /// Room beyond 1.5 times the live bytes at which the stored data is compacted by itself.
    pub store_slack_bytes: u64,
    /// Bytes of stored data that one API key may hold; no bound when `None`.
    pub store_quota_bytes: Option<u64>,
    /// How the free bytes are found.
    pub free_space: FreeSpace,
    /// The longest body of JSON or MessagePack, in bytes.
    pub json_bytes_max: usize,
    /// The longest mesh file, in bytes.
    pub mesh_bytes_max: usize,
    /// How long a body may take to arrive.
    pub body_timeout: Duration,
    /// How long an answer may take before the robot is told to come back.
    pub answer_timeout: Duration,
    /// How many requests may be under way at once.
    pub requests_max: usize,
    /// How many bytes the bodies of all requests under way may have together.
    pub bodies_bytes_max: usize,
    /// How many bytes the answers may have together that are not read yet.
    pub answers_bytes_max: usize,
    /// How many connections may be open at once; fewer where the system allows fewer files.
    pub connections_max: usize,
    /// How long a connection may take for each step.
    pub patience: Patience,
    /// How many requests a second each client may make; no bound of its own when `None`.
    pub rate_per_second: Option<NonZeroU32>,
    /// How many event streams may be open at once.
    pub streams_max: usize,
    /// Threads that update beliefs and read meshes.
    pub compute_threads: usize,
    /// How many pieces of such work may wait for a thread.
    pub compute_queue_max: usize,
    /// Threads that train; readings of running sessions are not held up by them.
    pub training_threads: usize,
    /// How many trainings may wait.
    pub training_queue_max: usize,
    /// How long one training may take.
    pub training_time_max: Duration,
    /// How many bytes of memory models may have that sessions recognise by.
    pub model_memory_bytes_max: u64,
    /// How many bytes of memory beliefs may have; those that were not used for longest are
    /// rebuilt from their journals.
    pub belief_memory_bytes_max: usize,
    /// How many sessions are kept in memory; others are rebuilt from their journals.
    pub beliefs_in_memory_max: usize,
    /// How many sessions may be open at once.
    pub sessions_open_max: usize,
    /// How long a session stays open without a new reading, unless it says so itself; zero is
    /// for ever.
    pub session_time_to_live: Duration,
    /// How long sessions are kept after they ended, with their readings; for ever if `None`.
    pub session_kept: Option<Duration>,
    /// How many readings one session may have.
    pub session_readings_max: usize,
    /// How many training readings one object may have.
    pub object_readings_max: usize,
}

/// So many requests may be under way for each core: what is accepted waits for those before it,
/// and more of them would only wait longer.
const REQUESTS_PER_CORE: usize = 128;

/// Chosen: five a second are more than a robot or a person brings about by mistake.
const FAILED_CHANGES_PER_MINUTE: NonZeroU32 = NonZeroU32::new(300).expect("300 is not 0");

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
            open_metrics: false,
            tls: None,
            cors_origins: Vec::new(),
            audit_entries_max: RingSizes { changes: 100_000, refused: 20_000, strangers: 10_000 },
            failed_changes_per_minute: FAILED_CHANGES_PER_MINUTE,
            data: data.into(),
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
            model_memory_bytes_max: 1_000_000_000,
            belief_memory_bytes_max: 500_000_000,
            beliefs_in_memory_max: 1024,
            sessions_open_max: 10_000,
            session_time_to_live: Duration::from_secs(86_400),
            session_kept: None,
            session_readings_max: 10_000,
            object_readings_max: 100_000,
        }
    }
}
