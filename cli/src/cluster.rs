//! Arguments that say how to reach a store on a NATS cluster.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Args;
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
}

impl StoreArgs {
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
