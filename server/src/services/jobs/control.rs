//! An unfinished job, shared by its followers and the training threads.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use palpate_schemas as wire;
use palpate_schemas::JobStage;
use palpate_store::engine::lease::Lease;
use tokio::sync::watch;

use crate::wire::count;

/// Minimum interval of progress events.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(100);
/// Order to the running training: continue, stop for good, stop until the next start, or stop
/// at the time limit.
const GO_ON: u8 = 0;
pub(super) const CANCEL: u8 = 1;
pub(super) const SUSPEND: u8 = 2;
pub(super) const OVERDUE: u8 = 3;
/// Stop: another server may work on it.
pub(super) const LOST: u8 = 4;

/// An unfinished job: its order and its progress.
pub(super) struct Control {
    order: AtomicU8,
    pub(super) job: watch::Sender<wire::Job>,
    told: Mutex<(JobStage, Instant, Instant)>,
    /// Deadline of the job; set when it begins.
    ends: OnceLock<Instant>,
    /// The right to work on it, while this server does.
    lease: Mutex<Option<Lease>>,
}

impl Control {
    pub(super) fn new(job: wire::Job) -> Self {
        let now = Instant::now();
        Self {
            order: AtomicU8::new(GO_ON),
            job: watch::Sender::new(job),
            told: Mutex::new((JobStage::Sampling, now, now)),
            ends: OnceLock::new(),
            lease: Mutex::default(),
        }
    }

    /// Takes the job on.
    pub(super) fn hold(&self, lease: Lease) {
        self.order(GO_ON);
        *self.lease() = Some(lease);
    }

    /// Gives the job away.
    pub(super) fn release(&self) {
        self.lease().take();
    }

    /// Whether this server works on the job.
    pub(super) fn is_held(&self) -> bool {
        self.lease().is_some()
    }

    fn lease(&self) -> MutexGuard<'_, Option<Lease>> {
        self.lease.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins the time that the training may take.
    pub(super) fn begin(&self, within: Duration) {
        // A job begins once in the life of its control.
        let _ = self.ends.set(Instant::now() + within);
    }

    /// Sets the order for the training's next step.
    pub(super) fn order(&self, order: u8) {
        self.order.store(order, Ordering::Relaxed);
    }

    /// Whether its followers know its end.
    pub(super) fn is_over(&self) -> bool {
        self.job.borrow().state.is_final()
    }

    pub(super) fn is_ordered(&self, order: u8) -> bool {
        self.order.load(Ordering::Relaxed) == order
    }

    /// Reports progress to the followers, and returns whether to continue.
    pub(super) fn tell(&self, stage: JobStage, done: usize, total: usize) -> ControlFlow<()> {
        if self.ends.get().is_some_and(|ends| Instant::now() >= *ends) && self.is_ordered(GO_ON) {
            self.order(OVERDUE);
        }
        if self.lease().as_ref().is_some_and(Lease::is_lost) {
            self.order(LOST);
        }
        if !self.is_ordered(GO_ON) {
            return ControlFlow::Break(());
        }
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        let now = Instant::now();
        let is_new = told.0 != stage;
        if is_new {
            *told = (stage, now, now);
        }
        if is_new || done == total || now - told.2 >= PROGRESS_INTERVAL {
            told.2 = now;
            let elapsed = (now - told.1).as_secs_f64();
            let left = total.saturating_sub(done) as f64;
            self.job.send_modify(|job| {
                job.stage = Some(stage);
                job.done = count(done);
                job.total = count(total);
                job.eta_s = (done > 0).then(|| elapsed / done as f64 * left);
            });
        }
        ControlFlow::Continue(())
    }
}
