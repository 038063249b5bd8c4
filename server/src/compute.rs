//! The compute threads, behind a queue with a fixed number of slots.
//!
//! There are three kinds, each with as many threads as the operator permits, and each after the
//! first with a lower priority: for readings, for questions such as where to touch next, and for
//! long work, such as lists, drawings and explanations. What a piece of work costs is not guessed:
//! each begins as its asker waits for it and works for at most 50 ms. Then another thread takes the
//! next piece, and the one that has had its time goes on after all fresh work, in turns with others
//! like it (`turns`). So short work waits for slices of long work, never for its end, and a client
//! waits in proportion to the time that it has spent itself.
//!
//! A large piece is shared out to as many threads as there are cores (`rayon` in core), at most four
//! pieces of a kind at once. Small pieces stay on one thread, and so do large ones once as many are
//! at work as there are threads: sharing costs processor time to wake threads and to let them look
//! for parts. No two pieces have the same threads. Async threads only wait. A computation takes a
//! [`Place`] before anything is stored; if there is none, the request gets 503 and can be repeated.
//! Work whose asker has gone (`asker`) is not started. A panic in one piece ends that piece only.

mod urgency;
mod sharing;
mod turns;
mod threads;

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

use palpate_core::stop::Stop;
use thiserror::Error;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};

use crate::asker::Asker;
use turns::{Piece, Turns};
pub(crate) use urgency::{Size, Urgency};

/// Time without progress after which waiting readings or questions make the server not ready.
/// Chosen: a piece takes milliseconds, the slowest seconds.
const STALLED_AFTER: Duration = Duration::from_secs(30);
/// The same for long work. Chosen: beyond the time limit of any answer.
const LONG_STALLED_AFTER: Duration = Duration::from_secs(180);

/// The compute threads, and the slots of the queue before them.
#[derive(Clone)]
pub(crate) struct Pool {
    places: Arc<Semaphore>,
    open: Arc<Open>,
    n_places: usize,
}

/// The turns of all work, closed when no more can come.
struct Open(Arc<Turns>);

impl Drop for Open {
    fn drop(&mut self) {
        self.0.close();
    }
}

/// A slot in the queue, released on drop.
pub(crate) struct Place {
    permit: OwnedSemaphorePermit,
    open: Arc<Open>,
}

/// Error of a computation.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub(crate) enum ComputeError {
    /// Every slot in the queue is taken.
    #[error("all {places} places of the compute queue are taken")]
    Full {
        /// Number of slots.
        places: usize,
    },
    /// The work panicked.
    #[error("the computation panicked")]
    Panicked,
    /// The caller has gone, or the time limit is reached.
    #[error("the computation was ended before its answer: its time was up")]
    Stopped,
}

impl Pool {
    /// Starts `threads` threads (at least one) with `queue_max` further slots.
    ///
    /// # Errors
    /// The operating system's error when it gives no thread.
    pub(crate) fn start(threads: usize, queue_max: usize) -> io::Result<Self> {
        let threads = threads.max(1);
        let open = Arc::new(Open(Arc::new(Turns::new(threads))));
        threads::start(&open.0)?;
        let n_places = threads + queue_max;
        Ok(Self { places: Arc::new(Semaphore::new(n_places)), open, n_places })
    }

    /// Takes a slot in the queue, without waiting.
    ///
    /// # Errors
    /// [`ComputeError::Full`] when all are taken.
    pub(crate) fn place(&self) -> Result<Place, ComputeError> {
        let permit = Arc::clone(&self.places).try_acquire_owned();
        metrics::gauge!("palpate_compute_places_free").set(self.places.available_permits() as f64);
        match permit {
            Ok(permit) => Ok(Place { permit, open: Arc::clone(&self.open) }),
            Err(_) => Err(ComputeError::Full { places: self.n_places }),
        }
    }

    /// Waits for a slot, for the next piece of an answer that has begun.
    pub(crate) async fn place_in_time(&self) -> io::Result<Place> {
        let permit = Arc::clone(&self.places).acquire_owned().await.map_err(io::Error::other)?;
        Ok(Place { permit, open: Arc::clone(&self.open) })
    }

    /// Number of free slots.
    #[must_use]
    pub(crate) fn n_free(&self) -> usize {
        self.places.available_permits()
    }

    /// Whether work waits and no thread has taken any for a while: all are busy with endless
    /// pieces.
    pub(crate) fn is_stalled(&self) -> bool {
        let stalled = |urgency| self.open.0.stalled(urgency);
        stalled(Urgency::Reading).max(stalled(Urgency::Question)) >= STALLED_AFTER
            || stalled(Urgency::Long) >= LONG_STALLED_AFTER
    }
}

impl Place {
    /// Computes on one of the pool's threads, in its asker's turn.
    ///
    /// # Errors
    /// [`ComputeError::Panicked`] when `work` panicked, [`ComputeError::Stopped`] when it ended
    /// because its asker has gone.
    pub(crate) async fn run<T: Send + 'static>(
        self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ComputeError> {
        self.run_as((Urgency::Reading, Size::Large), work).await
    }

    /// Like [`Place::run`], for long work, which yields to all other work.
    ///
    /// # Errors
    /// As [`Place::run`].
    pub(crate) async fn run_long<T: Send + 'static>(
        self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ComputeError> {
        self.run_as((Urgency::Long, Size::Large), work).await
    }

    /// Like [`Place::run`], for work of any urgency and size.
    ///
    /// # Errors
    /// As [`Place::run`].
    pub(crate) async fn run_as<T: Send + 'static>(
        self,
        (urgency, size): (Urgency, Size),
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ComputeError> {
        let (answer, answered) = oneshot::channel();
        let Self { permit, open } = self;
        let (asker, queued) = (Asker::current(), Instant::now());
        let (client, pause) = (asker.client(), asker.overdue().clone());
        let work = Box::new(move || {
            metrics::histogram!("palpate_compute_wait_seconds").record(queued.elapsed());
            let begun = Instant::now();
            let outcome = if asker.is_gone() { Err(ComputeError::Stopped) } else { outcome(work) };
            metrics::histogram!("palpate_compute_seconds").record(begun.elapsed());
            drop(permit);
            // The receiver is gone if the robot has left.
            let _ = answer.send(outcome);
        });
        open.0.push(urgency, Piece { client, size, pause, work });
        drop(open);
        answered.await.unwrap_or(Err(ComputeError::Panicked))
    }
}

fn outcome<T>(work: impl FnOnce() -> T) -> Result<T, ComputeError> {
    let done = catch_unwind(AssertUnwindSafe(|| Stop::heeding(work)));
    done.map_or(Err(ComputeError::Panicked), |done| done.map_err(|_| ComputeError::Stopped))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::sync::Mutex;
    use std::thread;

    use futures::future::join_all;
    use rayon::prelude::*;

    use super::urgency::{LONG_NICE, QUESTION_NICE};
    use super::*;
    use crate::asker;
    use crate::client::Client;

    #[tokio::test]
    async fn a_full_queue_refuses_and_a_free_place_accepts_again() {
        let pool = Pool::start(1, 1).unwrap();
        let (first, second) = (pool.place().unwrap(), pool.place().unwrap());
        assert_eq!(pool.place().err(), Some(ComputeError::Full { places: 2 }));
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
        let own = ["compute-share-0", "compute-share-1"];
        assert!(names.iter().all(|name| own.contains(&&**name)), "{names:?}");
    }

    #[tokio::test]
    async fn work_stays_on_one_thread_while_all_are_busy() {
        let pool = Pool::start(2, 2).unwrap();
        let (begun, has_begun) = std::sync::mpsc::channel();
        let (release, released) = std::sync::mpsc::channel::<()>();
        let other = tokio::spawn(pool.place().unwrap().run(move || {
            begun.send(()).unwrap();
            released.recv()
        }));
        tokio::task::spawn_blocking(move || has_begun.recv()).await.unwrap().unwrap();
        let name = |_| thread::current().name().unwrap_or_default().to_owned();
        let work = move || (0..1000).into_par_iter().map(name).collect::<BTreeSet<String>>();
        let names = pool.place().unwrap().run(work).await.unwrap();
        let small = (Urgency::Reading, Size::Small);
        let alone = Pool::start(2, 0).unwrap().place().unwrap().run_as(small, work).await.unwrap();
        assert_eq!(alone.len(), 1, "small work stays on one thread of an idle pool");
        release.send(()).unwrap();
        assert_eq!(other.await.unwrap(), Ok(Ok(())));
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        assert!(matches!(names[..], ["compute-0"] | ["compute-1"]), "{names:?}");
    }

    #[tokio::test]
    async fn work_without_an_asker_frees_its_thread() {
        let pool = Pool::start(1, 1).unwrap();
        let endless = asker::ask(None, async {
            let stop = Asker::current().overdue().clone();
            let turning = move || -> () {
                loop {
                    stop.check();
                }
            };
            pool.place().unwrap().run(turning).await
        });
        let moment = Duration::from_millis(50);
        tokio::time::timeout(moment, endless).await.expect_err("it has no end");
        let free = pool.place().unwrap().run(|| 6 * 7);
        let free = tokio::time::timeout(Duration::from_secs(120), free).await;
        assert_eq!(free.expect("the thread is free"), Ok(42));
        while pool.n_free() < 2 {
            tokio::task::yield_now().await;
        }
    }

    #[tokio::test]
    async fn a_busy_client_does_not_delay_another() {
        let pool = Pool::start(1, 32).unwrap();
        let done = Arc::new(Mutex::new(Vec::new()));
        let piece = |host: u8| {
            let (place, done) = (pool.place().unwrap(), Arc::clone(&done));
            let work = move || {
                thread::sleep(Duration::from_millis(5));
                done.lock().unwrap().push(host);
            };
            asker::ask(Some(Client::at([10, 0, 0, host].into())), place.run(work))
        };
        // Queued in this order, all of the greedy client before the other.
        let mut all: Vec<_> = (0..20).map(|_| piece(1)).collect();
        all.push(piece(2));
        join_all(all).await;
        let turn = done.lock().unwrap().iter().position(|host| *host == 2).unwrap();
        assert!(turn <= 2, "{turn}");
    }

    #[tokio::test]
    async fn urgent_work_does_not_wait_for_other_work() {
        let pool = Pool::start(1, 4).unwrap();
        let patience = Duration::from_secs(120);
        let mut waiting = Vec::new();
        for (busy, urgent) in
            [(Urgency::Long, Urgency::Question), (Urgency::Question, Urgency::Reading)]
        {
            let (release, released) = std::sync::mpsc::channel::<()>();
            let work = move || released.recv();
            waiting.push((
                release,
                tokio::spawn(pool.place().unwrap().run_as((busy, Size::Large), work)),
            ));
            let answer = pool.place().unwrap().run_as((urgent, Size::Large), || 7);
            let answer = tokio::time::timeout(patience, answer).await;
            assert_eq!(answer.expect("every thread of urgent work is free"), Ok(7));
        }
        for (release, waiting) in waiting {
            release.send(()).unwrap();
            assert_eq!(waiting.await.unwrap(), Ok(Ok(())));
        }
        #[cfg(target_os = "linux")]
        {
            let nice = || rustix::process::getpriority_process(None).unwrap();
            let at = |urgency| pool.place().unwrap().run_as((urgency, Size::Small), nice);
            let urgent = at(Urgency::Reading).await.unwrap();
            let question = at(Urgency::Question).await.unwrap();
            assert_eq!(question, (urgent + QUESTION_NICE).min(19));
            assert_eq!(at(Urgency::Long).await.unwrap(), (urgent + LONG_NICE).min(19));
        }
    }

    #[tokio::test]
    async fn a_panic_ends_only_its_own_work() {
        let pool = Pool::start(1, 1).unwrap();
        let outcome = pool.place().unwrap().run(|| panic!("on purpose")).await;
        assert_eq!(outcome, Err::<(), _>(ComputeError::Panicked));
        assert_eq!(pool.place().unwrap().run(|| 1).await, Ok(1));
    }
}
