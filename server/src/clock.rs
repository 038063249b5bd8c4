//! The only reading of the clock for stored times, and the pauses of work in the background.

use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use tokio::sync::watch;

/// Time by which tests set the clock ahead, ms.
static AHEAD_MS: AtomicI64 = AtomicI64::new(0);

/// Milliseconds since 1970; 0 when the machine's clock is before that.
pub(crate) fn now_ms() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let shown = u64::try_from(since.as_millis()).unwrap_or(u64::MAX);
    shown.saturating_add_signed(AHEAD_MS.load(Ordering::Relaxed))
}

/// Sets the clock of all servers in this process ahead, or back; for tests.
pub fn set_ahead(ms: i64) {
    AHEAD_MS.store(ms, Ordering::Relaxed);
}

/// Waits for a time; false when the server stops before it is over.
pub(crate) async fn pause(time: Duration, stopping: &mut watch::Receiver<bool>) -> bool {
    tokio::select! {
        () = tokio::time::sleep(time) => true,
        _ = stopping.wait_for(|stopping| *stopping) => false,
    }
}
