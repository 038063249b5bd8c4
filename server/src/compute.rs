//! The threads that compute, behind a queue with a fixed number of places.
//!
//! As many threads compute as the operator allows: parts of one piece of work (`rayon` in
//! core) are done by these threads too, never by a pool of the whole process. Each piece
//! has a thread that waits for it, so that no more pieces are begun than threads compute.
//! Async threads only wait for it. Whoever wants to compute takes a [`Place`] first, before
//! anything is stored; when there is none the robot is asked to come back. A panic in one
//! piece of work ends that piece only.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread;
use std::time::Instant;

use thiserror::Error;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};

type Work = Box<dyn FnOnce() + Send>;

/// Threads that compute, and the places in the queue before them.
#[derive(Clone, Debug)]
pub(crate) struct Pool {
    places: Arc<Semaphore>,
    queue: mpsc::Sender<Work>,
    n_places: usize,
}

/// A place in the queue; dropped, it is free again.
#[derive(Debug)]
pub(crate) struct Place {
    permit: OwnedSemaphorePermit,
    queue: mpsc::Sender<Work>,
}

/// Why something was not computed.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub(crate) enum ComputeError {
    /// Every place in the queue is taken.
    #[error("all {places} places of the compute queue are taken")]
    Full {
        /// How many there are.
        places: usize,
    },
    /// The work panicked.
    #[error("the computation panicked")]
    Panicked,
}

impl Pool {
    /// Starts `threads` threads (at least one) and opens `queue_max` places besides.
    ///
    /// # Errors
    /// What the operating system says when it gives no thread.
    pub(crate) fn start(threads: usize, queue_max: usize) -> std::io::Result<Self> {
        let threads = threads.max(1);
        let computing = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|thread| format!("compute-{thread}"))
            .build()
            .map_err(std::io::Error::other)?;
        let computing = Arc::new(computing);
        let (sender, receiver) = mpsc::channel::<Work>();
        let receiver = Arc::new(Mutex::new(receiver));
        for thread in 0..threads {
            let (receiver, computing) = (Arc::clone(&receiver), Arc::clone(&computing));
            thread::Builder::new().name(format!("compute-wait-{thread}")).spawn(move || {
                while let Some(work) = take(&receiver) {
                    computing.install(work);
                }
            })?;
        }
        let n_places = threads + queue_max;
        Ok(Self { places: Arc::new(Semaphore::new(n_places)), queue: sender, n_places })
    }

    /// Takes a place in the queue, without waiting.
    ///
    /// # Errors
    /// [`ComputeError::Full`] when all are taken.
    pub(crate) fn place(&self) -> Result<Place, ComputeError> {
        let permit = Arc::clone(&self.places).try_acquire_owned();
        metrics::gauge!("palpate_compute_places_free").set(self.places.available_permits() as f64);
        match permit {
            Ok(permit) => Ok(Place { permit, queue: self.queue.clone() }),
            Err(_) => Err(ComputeError::Full { places: self.n_places }),
        }
    }

    /// How many places are free.
    #[must_use]
    pub(crate) fn n_free(&self) -> usize {
        self.places.available_permits()
    }
}

impl Place {
    /// Computes on one of the pool's threads.
    ///
    /// # Errors
    /// [`ComputeError::Panicked`] when `work` panicked.
    pub(crate) async fn run<T: Send + 'static>(
        self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ComputeError> {
        let (answer, answered) = oneshot::channel();
        let permit = self.permit;
        let queued = Instant::now();
        let work = Box::new(move || {
            metrics::histogram!("palpate_compute_wait_seconds").record(queued.elapsed());
            let begun = Instant::now();
            let outcome = catch_unwind(AssertUnwindSafe(work));
            metrics::histogram!("palpate_compute_seconds").record(begun.elapsed());
            drop(permit);
            // A robot that has gone away does not read the answer.
            let _ = answer.send(outcome.map_err(|_| ComputeError::Panicked));
        });
        self.queue.send(work).map_err(|_| ComputeError::Panicked)?;
        answered.await.unwrap_or(Err(ComputeError::Panicked))
    }
}

fn take(queue: &Mutex<mpsc::Receiver<Work>>) -> Option<Work> {
    queue.lock().unwrap_or_else(PoisonError::into_inner).recv().ok()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use rayon::prelude::*;

    use super::*;

    #[tokio::test]
    async fn a_full_queue_refuses_and_a_free_place_accepts_again() {
        let pool = Pool::start(1, 1).unwrap();
        let (first, second) = (pool.place().unwrap(), pool.place().unwrap());
        assert_eq!(pool.place().unwrap_err(), ComputeError::Full { places: 2 });
        drop(first);
        assert_eq!(second.run(|| 6 * 7).await, Ok(42));
        assert_eq!(pool.n_free(), 2);
    }

    #[tokio::test]
    async fn parts_of_the_work_stay_on_the_pools_threads() {
        let pool = Pool::start(2, 0).unwrap();
        let name = |_| thread::current().name().unwrap_or_default().to_owned();
        let work = move || (0..1000).into_par_iter().map(name).collect::<BTreeSet<String>>();
        let names = pool.place().unwrap().run(work).await.unwrap();
        assert!(
            names.iter().all(|name| ["compute-0", "compute-1"].contains(&&**name)),
            "{names:?}"
        );
    }

    #[tokio::test]
    async fn a_panic_ends_only_its_own_work() {
        let pool = Pool::start(1, 1).unwrap();
        let outcome = pool.place().unwrap().run(|| panic!("on purpose")).await;
        assert_eq!(outcome, Err::<(), _>(ComputeError::Panicked));
        assert_eq!(pool.place().unwrap().run(|| 1).await, Ok(1));
    }
}
