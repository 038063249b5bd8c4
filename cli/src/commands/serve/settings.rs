//! The server's configuration from the arguments of `palpate serve`.

use std::time::Duration;

use palpate_server::tls::TlsFiles;
use palpate_server::{Access, Config};
use palpate_store::audit::RingSizes;

use super::{AccessChoice, CERTIFICATE_LOOK_EVERY, ServeArgs};

/// The server's configuration from the arguments.
pub(super) fn config(args: ServeArgs) -> Config {
    let access = match args.access {
        AccessChoice::Auto => Access::Auto,
        AccessChoice::Keys => Access::Keys,
        AccessChoice::Open => Access::Open,
    };
    let tls = args.tls_cert.zip(args.tls_key);
    let usual = Config::new(args.data);
    Config {
        listen: args.listen,
        insecure_bind: args.insecure_bind,
        host_names: args.host_names,
        access,
        new_admin_key: args.new_admin_key,
        open_metrics: args.open_metrics,
        webhook_allow_private: args.webhook_allow_private,
        tls: tls.map(|(certificate, key)| TlsFiles {
            certificate,
            key,
            look_every: CERTIFICATE_LOOK_EVERY,
        }),
        cors_origins: args.cors_origins,
        audit_entries_max: RingSizes {
            changes: args.audit_entries,
            refused: args.audit_refused,
            strangers: args.audit_strangers,
        },
        failed_changes_per_minute: args.failed_changes,
        model_memory_bytes_max: args.model_memory_mb * 1_000_000,
        belief_memory_bytes_max: args.belief_memory_mb as usize * 1_000_000,
        bodies_bytes_max: args.body_memory_mb as usize * 1_000_000,
        answers_bytes_max: args.answer_memory_mb as usize * 1_000_000,
        connections_max: args.connections as usize,
        sessions_open_max: args.sessions_open as usize,
        session_time_to_live: Duration::from_secs(args.session_ttl_s),
        session_kept: args.keep_sessions_s.map(Duration::from_secs),
        rate_per_second: args.rate,
        requests_max: args.requests.map_or(usual.requests_max, |requests| requests as usize),
        store_cache_bytes: args.store_cache_mb * 1_000_000,
        compute_queue_max: args.compute_queue as usize,
        training_time_max: Duration::from_secs(args.training_max_s),
        training_memory_bytes_max: args.training_memory_mb * 1_000_000,
        migrate: args.migrate,
        disk_reserve_bytes: args.disk_reserve_mb * 1_000_000,
        store_slack_bytes: args.store_slack_mb * 1_000_000,
        store_quota_bytes: Some(args.store_quota_mb * 1_000_000).filter(|bytes| *bytes > 0),
        ..usual
    }
}
