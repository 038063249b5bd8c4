//! TLS from certificate and key files, with errors that name the file and its fault.
//!
//! Certificates live for weeks and servers for months, so changed files are read again.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use rustls::ServerConfig;
use rustls::pki_types::pem::{self, PemObject};
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use thiserror::Error;
use tokio::sync::watch;

use crate::certificate::expiry;
use crate::clock::pause;

/// The files of a certificate and of its key, both PEM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TlsFiles {
    /// The server's certificate, then the intermediate ones up to the trusted authority.
    pub certificate: PathBuf,
    /// The certificate's private key: PKCS #8, PKCS #1 or SEC1, not encrypted.
    pub key: PathBuf,
    /// Interval at which changes of the files are detected.
    pub look_every: Duration,
}

/// Error of a server that cannot use TLS.
#[derive(Debug, Error)]
pub enum TlsError {
    /// A file cannot be read.
    #[error("cannot read the {what} {}: {source}", path.display())]
    Read {
        /// The kind of file.
        what: &'static str,
        /// Its path.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// A file is not PEM.
    #[error("the {what} {} is not PEM: {source}", path.display())]
    Pem {
        /// The kind of file.
        what: &'static str,
        /// Its path.
        path: PathBuf,
        /// The fault.
        source: pem::Error,
    },
    /// A file is PEM without the expected content.
    #[error("the {what} {} has no {expected}", path.display())]
    Nothing {
        /// The kind of file.
        what: &'static str,
        /// Its path.
        path: PathBuf,
        /// The expected content.
        expected: &'static str,
    },
    /// The key does not belong to the certificate.
    #[error("the key {} does not belong to the certificate {}", key.display(), certificate.display())]
    Mismatch {
        /// Path of the certificate.
        certificate: PathBuf,
        /// Path of the key.
        key: PathBuf,
    },
    /// The files are readable and unusable.
    #[error("cannot use the certificate {} with the key {}: {source}", certificate.display(), key.display())]
    Unusable {
        /// Path of the certificate.
        certificate: PathBuf,
        /// Path of the key.
        key: PathBuf,
        /// The cause.
        source: rustls::Error,
    },
}

const CERTIFICATE: &str = "certificate";
const KEY: &str = "key of the certificate";

/// The configuration for TLS 1.2 and 1.3 with these files. Blocks.
pub(crate) fn configure(files: &TlsFiles) -> Result<Arc<ServerConfig>, TlsError> {
    let TlsFiles { certificate, key, .. } = files;
    let text = read(CERTIFICATE, certificate)?;
    let chain: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(&text).collect();
    let chain = chain.map_err(|source| pem_error(CERTIFICATE, certificate, source))?;
    if chain.is_empty() {
        let (path, expected) = (certificate.clone(), "certificate (BEGIN CERTIFICATE)");
        return Err(TlsError::Nothing { what: CERTIFICATE, path, expected });
    }
    let private =
        PrivateKeyDer::from_pem_slice(&read(KEY, key)?).map_err(|source| match source {
            pem::Error::NoItemsFound => {
                let expected = "private key that is not encrypted (BEGIN PRIVATE KEY)";
                TlsError::Nothing { what: KEY, path: key.clone(), expected }
            }
            source => pem_error(KEY, key, source),
        })?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let unusable = |source| match source {
        rustls::Error::InconsistentKeys(_) => {
            TlsError::Mismatch { certificate: certificate.clone(), key: key.clone() }
        }
        source => TlsError::Unusable { certificate: certificate.clone(), key: key.clone(), source },
    };
    let ends = expiry(&chain);
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .map_err(unusable)?
        .with_no_client_auth()
        .with_single_cert(chain, private)
        .map_err(unusable)?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    if let Some(ends) = ends {
        metrics::gauge!("palpate_certificate_expiry_timestamp_seconds").set(ends as f64);
    }
    Ok(Arc::new(config))
}

/// Checks the files periodically, and publishes the configuration of changed ones. Ends with
/// the server.
///
/// Unusable files give one warning for each state; the previous configuration stays in use
/// meanwhile.
pub(crate) async fn renew(
    files: TlsFiles,
    in_use: watch::Sender<Arc<ServerConfig>>,
    mut stopping: watch::Receiver<bool>,
) {
    let mut seen = state(&files).await;
    while pause(files.look_every, &mut stopping).await {
        let now = state(&files).await;
        if now == seen {
            continue;
        }
        seen = now;
        let read = files.clone();
        match tokio::task::spawn_blocking(move || configure(&read)).await {
            Ok(Ok(config)) => {
                in_use.send_replace(config);
                tracing::info!("Took up the certificate {}", files.certificate.display());
            }
            Ok(Err(error)) => {
                tracing::warn!(%error, "The certificate changed and cannot be used; the one before stays");
            }
            Err(error) => tracing::error!(%error, "Reading the certificate panicked"),
        }
    }
}

/// The content of the files, `None` for an unreadable one.
async fn state(files: &TlsFiles) -> [Option<Vec<u8>>; 2] {
    [tokio::fs::read(&files.certificate).await.ok(), tokio::fs::read(&files.key).await.ok()]
}

fn read(what: &'static str, path: &Path) -> Result<Vec<u8>, TlsError> {
    std::fs::read(path).map_err(|source| TlsError::Read { what, path: path.to_owned(), source })
}

fn pem_error(what: &'static str, path: &Path, source: pem::Error) -> TlsError {
    TlsError::Pem { what, path: path.to_owned(), source }
}
