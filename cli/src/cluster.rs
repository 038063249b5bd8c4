//! Arguments that say how to reach a store on a NATS cluster.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::anyhow;
use clap::Args;
use palpate_server::Dividing;
use palpate_store::nats::NatsOptions;

/// Folder in the data folder for temporary files of a server on a cluster.
const SPOOL_FOLDER: &str = "spool";

/// Where a server stores.
#[derive(Clone, Debug, Args)]
pub(crate) struct StoreArgs {
    /// NATS cluster that stores the data instead of the folder: `nats://HOST:PORT[,HOST:PORT][/STREAM]`,
    /// or tls://…; servers of version 2.12 or later.
    #[arg(long, env = "PALPATE_STORE", value_name = "URL")]
    store: Option<String>,
    #[command(flatten)]
    cluster: ClusterArgs,
    /// With --store-shared on every server: divide the objects of catalogues of more than 64 objects
    /// among the servers, with this many copies of each. Use the same number on all servers; with 2,
    /// one server may be lost [default: every server holds whole catalogues].
    #[arg(
        long,
        env = "PALPATE_DIVIDE_COPIES",
        value_name = "N",
        value_parser = clap::value_parser!(u64).range(1..=16)
    )]
    divide_copies: Option<u64>,
    /// Milliseconds that the other servers have to answer for their objects; the belief then leaves
    /// out what is missing, and says so.
    #[arg(
        long,
        env = "PALPATE_DIVIDE_WAIT_MS",
        value_name = "MS",
        default_value_t = 10_000,
        value_parser = clap::value_parser!(u64).range(100..=60_000)
    )]
    divide_wait_ms: u64,
}

impl StoreArgs {
    /// How the servers of the cluster divide catalogues, if they do.
    pub(crate) fn dividing(&self) -> Option<Dividing> {
        let within = Duration::from_millis(self.divide_wait_ms);
        self.divide_copies.map(|copies| Dividing { copies: copies as usize, within })
    }

    /// The options of the cluster, if the store is on one.
    pub(crate) fn options(&self, data: &Path) -> anyhow::Result<Option<NatsOptions>> {
        let options = |store: &String| self.cluster.options(store, data.join(SPOOL_FOLDER));
        self.store.as_ref().map(options).transpose()
    }
}

/// The place of a server's data, for people.
pub(crate) fn place(cluster: Option<&NatsOptions>, data: &Path) -> String {
    match cluster {
        Some(options) => format!("{}/{}", options.servers.join(","), options.stream),
        None => data.display().to_string(),
    }
}

/// How to reach a cluster.
#[derive(Clone, Debug, Args)]
pub(crate) struct ClusterArgs {
    /// Credentials for the NATS cluster: a file with a user's JWT and key, as `nsc` writes it.
    #[arg(long, env = "PALPATE_STORE_CREDS", value_name = "FILE")]
    store_creds: Option<PathBuf>,
    /// Authority of the cluster's TLS certificates: a PEM file.
    #[arg(long, env = "PALPATE_STORE_CA", value_name = "FILE")]
    store_ca: Option<PathBuf>,
    /// Certificate that this client shows to the cluster: a PEM file.
    #[arg(long, env = "PALPATE_STORE_CERT", value_name = "FILE", requires = "store_key")]
    store_cert: Option<PathBuf>,
    /// Private key of that certificate: a PEM file.
    #[arg(long, env = "PALPATE_STORE_KEY", value_name = "FILE", requires = "store_cert")]
    store_key: Option<PathBuf>,
    /// Copies that the cluster keeps, for a store that does not exist yet [default: 3, or 1 on a
    /// NATS server without a cluster].
    #[arg(
        long,
        env = "PALPATE_STORE_REPLICAS",
        value_name = "N",
        value_parser = clap::value_parser!(u64).range(1..=5)
    )]
    store_replicas: Option<u64>,
    /// Let several servers share the store as one service: each with a data folder of its own, all
    /// with the same settings (docs/scaling.md).
    #[arg(long, env = "PALPATE_STORE_SHARED")]
    store_shared: bool,
}

impl ClusterArgs {
    /// The options of the cluster at an address; temporary files go to `spool`.
    pub(crate) fn options(&self, address: &str, spool: PathBuf) -> anyhow::Result<NatsOptions> {
        let options = NatsOptions::parse(address, spool).map_err(|fault| anyhow!(fault))?;
        Ok(NatsOptions {
            replicas: self.store_replicas.map(|replicas| replicas as usize),
            credentials: self.store_creds.clone(),
            certificate_authority: self.store_ca.clone(),
            is_shared: self.store_shared,
            client_certificate: self.store_cert.clone().zip(self.store_key.clone()),
            ..options
        })
    }
}
