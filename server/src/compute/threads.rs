//! The threads that compute: some take pieces from a queue, others help them with large ones.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use super::queue::{Piece, Queue};
use super::urgency::{Size, Urgency, give_way};

/// Starts threads that take work from the queue.
pub(super) fn compute(threads: usize, urgency: Urgency) -> io::Result<Arc<Queue>> {
    let name = match urgency {
        Urgency::Reading => "compute",
        Urgency::Question => "compute-question",
        Urgency::Long => "compute-long",
    };
    let sharing = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(move |thread| format!("{name}-share-{thread}"))
        .start_handler(move |_| give_way(urgency))
        .build()
        .map_err(io::Error::other)?;
    let (queue, sharing) = (Arc::new(Queue::new()), Arc::new(sharing));
    let at_work = Arc::new(AtomicUsize::new(0));
    for thread in 0..threads {
        let (queue, sharing, at_work) = (queue.clone(), sharing.clone(), at_work.clone());
        thread::Builder::new().name(format!("{name}-{thread}")).spawn(move || {
            give_way(urgency);
            // With itself as its only thread, what the work would share out stays here.
            let alone = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
            if let Err(error) = &alone {
                tracing::warn!(%error, "A compute thread always shares its work: {error}");
            }
            while let Some(Piece { size, work }) = queue.take() {
                let n_at_work = at_work.fetch_add(1, Ordering::Relaxed) + 1;
                // Long work goes on after the piece beside it has ended.
                let gains = n_at_work < threads || urgency == Urgency::Long;
                if alone.is_ok() && (size == Size::Small || !gains) {
                    work();
                } else {
                    sharing.install(work);
                }
                at_work.fetch_sub(1, Ordering::Relaxed);
            }
        })?;
    }
    Ok(queue)
}
