//! Merging of the levels under the top into one base, on a separate thread.
//!
//! These levels do not change. The sum of the copy must equal the tally at the moment of
//! freezing: then the copy is exact.

use std::io;
use std::ops::Bound;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use palpate_core::units::Bytes;

use super::base::Base;
use super::base::writing::BaseWriter;
use super::levels::Levels;
use super::tally::TALLY_KEY;
use crate::engine::{Compacted, EngineError};

/// Number of bytes after which the thread sleeps as long as they took: requests need the
/// cores and the disk more than a compaction does. Chosen: such a stride takes a few
/// milliseconds.
const STRIDE_BYTES: u64 = 256 << 10;

/// Writes all pairs of `levels` into a file; `None` if it is stopped before the end.
///
/// Stops after `stop_after` pairs, if given.
pub(super) fn merge(
    levels: &Levels,
    path: &Path,
    sum: u128,
    stop: &AtomicBool,
    stop_after: Option<u64>,
) -> Result<Option<Base>, EngineError> {
    super::guarded("compacting", || {
        let mut writer = BaseWriter::create(path)?;
        let (mut begun, mut stride_from) = (Instant::now(), 0);
        for pair in levels.range(Bound::Excluded(&TALLY_KEY)) {
            if stop.load(Ordering::Relaxed) || stop_after == Some(writer.contents().n_pairs) {
                return Ok(None);
            }
            let (key, value) = pair?;
            writer.put(&key, &value)?;
            let written = writer.contents().live_bytes;
            if written - stride_from >= STRIDE_BYTES {
                stride_from = written;
                std::thread::sleep(begun.elapsed());
                begun = Instant::now();
            }
        }
        if sum != writer.contents().sum {
            let what = "the stored records do not give the stored sum";
            return Err(io::Error::new(io::ErrorKind::InvalidData, what).into());
        }
        Ok(Some(writer.finish()?))
    })
}

/// Bytes on disk of a base of `live_bytes`: with heads of pairs, checksums and the index.
pub(super) fn bytes_needed(live_bytes: u64) -> u64 {
    live_bytes + live_bytes / 8 + (1 << 20)
}

/// Logs the result of a compaction.
pub(super) fn log_compacted(compacted: &Compacted) {
    let Compacted { before_bytes, after_bytes, live_bytes } = *compacted;
    tracing::info!(
        before_bytes,
        after_bytes,
        live_bytes,
        "Compacted the database from {} to {}; {} are live",
        Bytes(before_bytes),
        Bytes(after_bytes),
        Bytes(live_bytes)
    );
}
