//! Options of a store on a cluster: where it is, who asks, how many copies.

use std::path::PathBuf;
use std::time::Duration;

/// Name of the stream if the address has none.
const STREAM: &str = "palpate";
/// What the bucket's name has behind the stream's.
const CONTENT: &str = "-content";
/// What the name of the bucket of snapshots has behind that of an address.
const SNAPSHOTS: &str = "-snapshots";
/// Time for which removed content is kept. Chosen: a snapshot or a copy of a store of some
/// hundred GB is read within an hour.
const REMOVED_KEPT: Duration = Duration::from_secs(3600);
/// Content of a unit in a commit from which on it is put as an object. Chosen: an object costs two
/// more messages with their subjects, of about 500 bytes, and two more answers to wait for;
/// of 16 KiB that is 3 %. Most blocks of maps and meshes have more, most symmetries less.
pub(super) const CONTENT_BYTES_MIN: usize = 16 << 10;

/// Options of a store on a NATS cluster.
#[derive(Clone, Debug)]
pub struct NatsOptions {
    /// Addresses of servers, such as `nats://10.0.0.1:4222`; any of the cluster leads to all.
    pub servers: Vec<String>,
    /// Name of the stream, and first part of its subjects.
    pub stream: String,
    /// Number of copies; `None` for 3, or 1 on a server without a cluster.
    pub replicas: Option<usize>,
    /// File with a user's JWT and key, as `nsc` writes it.
    pub credentials: Option<PathBuf>,
    /// File with certificates of authorities that sign the servers' certificates.
    pub certificate_authority: Option<PathBuf>,
    /// Files with the client's certificate and its key.
    pub client_certificate: Option<(PathBuf, PathBuf)>,
    /// Whether several processes may use the store at a time.
    pub is_shared: bool,
    /// Folder for temporary files; none of them is needed after a stop.
    pub spool: PathBuf,
    /// Time for which content in the bucket outlives the last record that names it: as long as a
    /// snapshot may take.
    pub removed_kept: Duration,
    /// Content of a unit in a commit from which on it is put as an object, bytes. Above all content
    /// (`usize::MAX`), new content stays in the messages of the stream, as in earlier versions.
    pub content_bytes_min: usize,
}

impl NatsOptions {
    /// The options of an address: `nats://host:port[,host:port…][/stream]`, or `tls://…`.
    ///
    /// # Errors
    /// What was found and what was expected.
    pub fn parse(address: &str, spool: PathBuf) -> Result<Self, String> {
        let fault = |fault: &str| {
            let expected = "nats://host:port[,host:port][/stream], or tls://…";
            format!("{address:?} {fault}, expected {expected}")
        };
        let (scheme, rest) = address.split_once("://").ok_or_else(|| fault("has no scheme"))?;
        if !matches!(scheme, "nats" | "tls") {
            return Err(fault("is no address of NATS"));
        }
        let (hosts, stream) = rest.split_once('/').unwrap_or((rest, STREAM));
        let is_allowed = |letter: char| letter.is_ascii_alphanumeric() || "-_".contains(letter);
        if stream.is_empty() || stream.len() > 64 || !stream.chars().all(is_allowed) {
            return Err(fault("names a stream by other characters than A-Z, a-z, 0-9, - and _"));
        }
        if hosts.split(',').any(str::is_empty) {
            return Err(fault("has an empty host"));
        }
        let own = |host: &str| match host.contains("://") {
            true => host.to_owned(),
            false => format!("{scheme}://{host}"),
        };
        Ok(Self {
            servers: hosts.split(',').map(own).collect(),
            stream: stream.to_owned(),
            replicas: None,
            credentials: None,
            certificate_authority: None,
            client_certificate: None,
            is_shared: false,
            spool,
            removed_kept: REMOVED_KEPT,
            content_bytes_min: CONTENT_BYTES_MIN,
        })
    }

    /// Name of the bucket with large content.
    pub(super) fn bucket(&self) -> String {
        format!("{}{CONTENT}", self.stream)
    }

    /// Name of the bucket with snapshots.
    pub(super) fn snapshots(&self) -> String {
        format!("{}{SNAPSHOTS}", self.stream)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_names_servers_and_a_stream() {
        let parse = |address| NatsOptions::parse(address, PathBuf::from("spool"));
        let options = parse("nats://a:1,b:2/fleet").expect("it is well formed");
        assert_eq!(options.servers, ["nats://a:1", "nats://b:2"]);
        assert_eq!(options.stream, "fleet");
        let options = parse("tls://a").expect("it is well formed");
        assert_eq!((&options.servers[..], &options.stream[..]), (&["tls://a".into()][..], STREAM));
        for wrong in ["a:1", "http://a:1", "nats://", "nats://a,,b", "nats://a/", "nats://a/b.c"] {
            let error = parse(wrong).expect_err(wrong);
            assert!(error.contains("expected nats://"), "{error}");
        }
    }
}
