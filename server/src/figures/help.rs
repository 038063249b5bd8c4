//! The descriptions of all metrics, as `# HELP` in `/metrics`. `docs/operations.md` says more.

/// Name and description of each metric.
const HELP: [(&str, &str); 70] = [
    ("palpate_beliefs_resumed_total", "Beliefs resumed from a checkpoint"),
    ("palpate_build_info", "1, with the version"),
    ("palpate_certificate_expiry_timestamp_seconds", "Earliest end of the chain's certificates"),
    ("palpate_compute_places_free", "Computations that may still be accepted"),
    ("palpate_compute_seconds", "Time of computations"),
    ("palpate_compute_wait_seconds", "Time that computations waited for a thread"),
    ("palpate_connections_displaced_total", "Connections closed for newer ones"),
    ("palpate_content_bytes", "Bytes of the objects of large content that records name"),
    ("palpate_content_cache_hits_total", "Reads of large content from the cache"),
    ("palpate_content_cached_bytes", "Bytes of the cache of large content"),
    ("palpate_content_fetched_bytes_total", "Bytes of fetched large content"),
    ("palpate_content_fetches_failed_total", "Failed fetches of large content"),
    ("palpate_content_fetches_total", "Objects of large content fetched"),
    ("palpate_content_missing", "Objects of large content that records name and are missing"),
    ("palpate_content_objects", "Objects of large content that records name"),
    ("palpate_content_puts_total", "Objects of large content put"),
    ("palpate_content_removals_total", "Objects of large content removed"),
    ("palpate_feedback_probability", "Probability that beliefs gave the reported truth"),
    ("palpate_feedback_total", "Sessions with a reported truth"),
    ("palpate_forwarding_down_seconds", "Time since the line to the central service failed"),
    ("palpate_forwarding_entries_waiting", "Readings and retractions waiting to be forwarded"),
    ("palpate_forwarding_oldest_waiting_seconds", "Age of the oldest entry to be forwarded"),
    ("palpate_forwarding_sessions_refused", "Sessions that the central service refused"),
    ("palpate_forwarding_sessions_waiting", "Sessions waiting to be forwarded"),
    ("palpate_http_request_seconds", "Time of answers"),
    ("palpate_http_requests_total", "Requests"),
    ("palpate_jobs_total", "Ended trainings and recalibrations"),
    ("palpate_jobs_unfinished", "Trainings and recalibrations waiting or running"),
    ("palpate_memory_bytes", "Memory of a kind that has a budget"),
    ("palpate_memory_limit_bytes", "Least limit on the memory of the process and the machine"),
    ("palpate_model_bytes", "Memory of models"),
    ("palpate_occupied", "Resources in use"),
    ("palpate_occupied_max", "Limits of resources"),
    ("palpate_readings_folded_total", "Readings folded into beliefs, including rebuilds"),
    ("palpate_readings_total", "New readings of sessions"),
    ("palpate_records_damaged", "Damaged records"),
    ("palpate_requests_denied_total", "Requests without a valid key or without the role"),
    ("palpate_sensor_health_left_out_total", "Sessions left out of the health of sensors"),
    ("palpate_sensor_health_sessions_total", "Sessions counted towards the health of sensors"),
    ("palpate_sensors", "Sensors by health"),
    ("palpate_sessions_by_attention", "Open sessions by the attention they need"),
    ("palpate_sessions_in_memory", "Sessions with a belief in memory"),
    ("palpate_sessions_needing_attention", "Open sessions that somebody should look at"),
    ("palpate_sessions_open", "Open sessions"),
    ("palpate_sessions_open_max", "Maximum number of open sessions"),
    ("palpate_snapshot_timestamp_seconds", "Time of the newest snapshot that was sent to its end"),
    ("palpate_snapshots_total", "Snapshots sent to their end"),
    ("palpate_start_timestamp_seconds", "Time of the start"),
    ("palpate_store_bytes", "Bytes of the database"),
    ("palpate_store_commits_total", "Commits"),
    ("palpate_store_compactions_total", "Compactions of the database"),
    ("palpate_store_flushes_total", "Flushes that commits shared"),
    ("palpate_store_free_bytes", "Free space of the disk, the held reserve included"),
    ("palpate_store_key_bytes", "Bytes that a key holds"),
    ("palpate_store_largest_bytes", "Bytes that removing a thing frees"),
    ("palpate_store_live_bytes", "Bytes of keys and records in the database"),
    ("palpate_store_received_bytes_total", "Bytes that the cluster sent to the store"),
    ("palpate_versions_damaged", "Damaged versions of catalogues"),
    ("palpate_webhook_attempts_total", "Attempts to deliver events"),
    ("palpate_webhook_deliveries_total", "Ended deliveries of events"),
    ("palpate_webhook_oldest_waiting_seconds", "Age of the oldest event that waits"),
    ("palpate_webhooks_failing", "Webhooks whose last attempt failed"),
    ("process_cpu_seconds_total", "Processor time of the process"),
    ("process_max_fds", "Maximum number of open files"),
    ("process_open_fds", "Open files"),
    ("process_resident_memory_bytes", "Resident memory"),
    ("process_start_time_seconds", "Start of the process"),
    ("process_threads", "Threads"),
    ("process_virtual_memory_bytes", "Virtual memory"),
    ("process_virtual_memory_max_bytes", "Maximum virtual memory"),
];

/// Gives the metrics their descriptions, whatever their type.
pub(super) fn describe() {
    for (name, help) in HELP {
        metrics::describe_gauge!(name, help);
    }
}

/// The description of a metric.
pub(crate) fn help(metric: &str) -> &'static str {
    HELP.iter().find(|(name, _)| *name == metric).map_or("", |(_, help)| help)
}
